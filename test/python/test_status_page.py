"""docs/status.md has every state, decision and reason that a localizer can publish."""
import glob
import os
import re
import unittest

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", ".."))
PAGE = "docs/status.md"
SPOKEN = ("src/gnss", "src/pipeline", "src/localizers")
LEAST_LENGTH = 8  # of a piece of a text, so that "m" and "; " are none
# What gives a reason: an assignment, a rejection, or a function of one of these names.
REASON = re.compile(r'(?:reason \+?=\s*|fix_use = |Rejection\{FixDecision::\w+,\s*|decide_\w+\([^;]*?|add_reason\(outcome,\s*)'
                    r'((?:[^";]|"[^"]*")*?);')
FUNCTION = re.compile(r'^[\w:<>&* ]*\b(?:complaint|waiting_for|describe\((?:const Contradiction|SpeedFault|const '
                      r'TwistFinding))[^\n]*\{\n?(.*?)^\}', re.MULTILINE | re.DOTALL)
LITERAL = re.compile(r'"([^"\n]*)"')


def read_text(path):
    with open(os.path.join(ROOT, path), encoding="utf-8") as file:
        return file.read()


def constants(message):
    """The names of a message's constants."""
    return re.findall(r"^uint8 (\w+)=", read_text("msg/{}.msg".format(message)), re.MULTILINE)


def texts_of(function_file):
    """What the to_string() of a file gives, but for what no value has."""
    body = re.search(r"const char\* to_string\(.*?\n\}", read_text(function_file), re.DOTALL).group(0)
    return [text for text in re.findall(r'case .*?return "([^"]+)"', body)]


def pieces(source):
    """The fixed pieces of the reasons that a source can give."""
    for match in list(REASON.finditer(source)) + list(FUNCTION.finditer(source)):
        for literal in LITERAL.findall(match.group(1)):
            piece = literal.strip(" ;:,.?()")
            if len(piece) >= LEAST_LENGTH:
                yield piece


class StatusPageTest(unittest.TestCase):
    maxDiff = None

    def setUp(self):
        self.page = " ".join(read_text(PAGE).split())

    def test_every_constant_has_a_row(self):
        for message in ("LocalizationStatus", "FixDecision"):
            names = constants(message)
            self.assertGreater(len(names), 5)
            for number, name in enumerate(names):
                self.assertIn("| {} | `{}`".format(number, name), self.page)

    def test_every_name_stands_there(self):
        for path in ("src/gnss/fix_decision.cpp", "src/pipeline/status_reporter.cpp"):
            names = texts_of(path)
            self.assertGreater(len(names), 5, path)
            for name in names:
                self.assertIn("`{}`".format(name), self.page)

    def test_every_reason_stands_there(self):
        found = {}
        for folder in SPOKEN:
            for path in glob.glob(os.path.join(ROOT, folder, "**", "*.cpp"), recursive=True):
                for piece in pieces(read_text(path)):
                    found[piece] = os.path.relpath(path, ROOT)
        self.assertGreater(len(found), 40)
        missing = ["{}: {}".format(path, piece) for piece, path in sorted(found.items()) if piece not in self.page]
        self.assertEqual([], missing)


if __name__ == "__main__":
    unittest.main()
