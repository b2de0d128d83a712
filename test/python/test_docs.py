#!/usr/bin/env python3
"""The pages hold together: links lead somewhere, named files and functions exist, lines can be read."""
import os
import re
import shutil
import subprocess
import tempfile
import unittest

PACKAGE = "urban_gnss_localization"
MAX_LINE = 120  # characters, also in tables
GENERATED = "docs/parameters.md"  # its tables are as wide as the program that writes them makes them
READ_BY_USERS = re.compile(r"(README\.md|CONTRIBUTING\.md|CHANGELOG\.rst|docs/.*\.md|launch/[^/]*\.launch"
                           r"|test/ros/[^/]*\.test|scenarios/[^/]*\.yaml)$")
SOURCE = re.compile(r"`((?:\w+/)+\w+)\.([ch]pp)`")
FUNCTION = re.compile(r"`(?:\w+::)*(\w+)\(\)`")


def find_root():
    """The folder of package.xml, above this file."""
    folder = os.path.dirname(os.path.abspath(__file__))
    while not os.path.exists(os.path.join(folder, "package.xml")):
        folder = os.path.dirname(folder)
    return folder


ROOT = find_root()


def read_text(path):
    """A file's text."""
    with open(path, encoding="utf-8") as file:
        return file.read()


def pages(root):
    """Every Markdown page: those at the top and those of docs/."""
    found = [os.path.join(root, name) for name in sorted(os.listdir(root)) if name.endswith(".md")]
    for folder, _, names in sorted(os.walk(os.path.join(root, "docs"))):
        found += [os.path.join(folder, name) for name in sorted(names) if name.endswith(".md")]
    return found


def files_read_by_users(root):
    """Every file that READ_BY_USERS matches, by its path below root."""
    for top in ("", "docs", "launch", "test/ros", "scenarios"):
        for folder, folders, names in os.walk(os.path.join(root, top)):
            folders[:] = sorted(folders) if top else []
            for name in sorted(names):
                path = os.path.relpath(os.path.join(folder, name), root).replace(os.sep, "/")
                if READ_BY_USERS.match(path):
                    yield path


def long_lines(root):
    """path:line of every line above MAX_LINE. Only a word that is too long by itself, such as a URL, may stick out."""
    for path in files_read_by_users(root):
        for number, line in enumerate(read_text(os.path.join(root, path)).splitlines(), 1):
            if path == GENERATED and line.startswith("|"):
                continue
            if len(line) > MAX_LINE and max(len(word) for word in line.split(" ")) <= MAX_LINE:
                yield "{}:{}: {} characters".format(path, number, len(line))


def prose(text):
    """The text with its code blocks emptied, line by line as it was."""
    inside = False
    for line in text.splitlines():
        fence = line.lstrip().startswith("```")
        yield "" if inside or fence else line
        inside ^= fence


def anchors(text):
    """The anchors of a page's headings, as GitHub makes them."""
    headings = [re.sub(r"^#+ ", "", line) for line in prose(text) if re.match(r"#+ ", line)]
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def fault_of_link(page, link):
    """What is wrong with a link of a page; empty where nothing is."""
    if re.match(r"\w+:", link):
        return ""
    path, _, anchor = link.partition("#")
    target = os.path.normpath(os.path.join(os.path.dirname(page), path)) if path else page
    if not os.path.exists(target):
        return "no such file"
    if anchor and anchor not in anchors(read_text(target)):
        return "no such heading"
    return ""


def source_text(root, stem):
    """Header and source of this name; empty where there is neither."""
    stem = re.sub("^src/", "", stem)
    paths = [os.path.join(root, folder, stem + end) for folder in ("src", "include/" + PACKAGE) for end in
             (".cpp", ".hpp")]
    return "".join(read_text(path) for path in paths if os.path.exists(path))


def faults_of_names(root, line):
    """Source files that a line names and that are not there, and functions that the file before them does not have."""
    faults = []
    text = None
    for found in re.finditer(SOURCE.pattern + "|" + FUNCTION.pattern, line):
        stem, _, function = found.groups()
        if stem:
            text = source_text(root, stem)
            if not text:
                faults.append("no such file: " + stem)
        elif text and not re.search(r"\b" + function + r"\(", text):
            faults.append("no such function there: " + function)
    return faults


def unknown_tests(root, line):
    """Tests that a table names in italics, *`Name`*, and that are neither a gtest nor a file below test/."""
    names = re.findall(r"(?<!\*)\*`([A-Z]\w+|test_\w+\.py)`\*(?!\*)", line)
    if not names:
        return []
    sources = []
    for folder, _, files in os.walk(os.path.join(root, "test")):
        sources += files
        sources += re.findall(r"^TEST(?:_[FP])?\(\w+, (\w+)\)", "".join(
            read_text(os.path.join(folder, name)) for name in files if name.endswith(".cpp")), re.MULTILINE)
    return ["no such test: " + name for name in names if name not in sources]


def find_faults(root):
    """page:line of everything that is wrong."""
    faults = list(long_lines(root))
    for page in pages(root):
        name = os.path.relpath(page, root)
        text = read_text(page)
        for number, line in enumerate(prose(text), 1):
            for link in re.findall(r"\]\(([^)\s]+)\)", line):
                fault = fault_of_link(page, link)
                if fault:
                    faults.append("{}:{}: {}: {}".format(name, number, link, fault))
            faults += ["{}:{}: {}".format(name, number, fault) for fault in unknown_tests(root, line)]
        # A sentence goes on in the next line, so paragraphs are looked at as a whole.
        for paragraph in re.split(r"\n\s*\n|\n(?=[-\d|])", "\n".join(prose(text))):
            faults += ["{}: {}".format(name, fault) for fault in faults_of_names(root, paragraph)]
    return faults


class Repository(unittest.TestCase):
    """The pages of this repository."""

    def test_pages(self):
        faults = find_faults(ROOT)
        self.assertEqual([], faults, "\n" + "\n".join(faults))

    def test_every_page_is_in_the_index(self):
        index = read_text(os.path.join(ROOT, "docs", "index.md"))
        for page in pages(ROOT):
            name = os.path.relpath(page, os.path.join(ROOT, "docs"))
            if not name.startswith("..") and name != "index.md":
                self.assertIn("(" + name.replace(os.sep, "/") + ")", index)

    def test_scripts_that_pages_call_are_programs(self):
        named = set()
        for page in pages(ROOT):
            named.update(re.findall(r"rosrun urban_gnss_localization (\w+\.py)", read_text(page)))
        self.assertIn("compare_localizers.py", named)
        for name in named:
            self.assertTrue(os.access(os.path.join(ROOT, "reports", name), os.X_OK), name)

    def test_comments_name_pages_that_exist(self):
        for top in ("src", "include", "launch", "config", "reports", "scripts", "dev"):
            for folder, _, names in os.walk(os.path.join(ROOT, top)):
                for name in names:
                    if not name.endswith((".cpp", ".hpp", ".launch", ".yaml", ".py", ".sh")):
                        continue
                    for page in re.findall(r"\bdocs/[\w/]+\.(?:md|png)", read_text(os.path.join(folder, name))):
                        self.assertTrue(os.path.exists(os.path.join(ROOT, page)), name + ": " + page)


class Check(unittest.TestCase):
    """It fails where it must."""

    def faults(self, text, name="docs/page.md"):
        with tempfile.TemporaryDirectory() as root:
            os.makedirs(os.path.join(root, "docs"))
            os.makedirs(os.path.join(root, "src/gnss"))
            for path, content in ((name, text), ("docs/other.md", "# A heading, eq. (2)\n"),
                                  ("src/gnss/fix.cpp", "int sanitize(int a) { return a; }\n"),
                                  ("test/gnss/test_fix.cpp", "TEST(Fix, SanitizesEq1) {}\n")):
                os.makedirs(os.path.dirname(os.path.join(root, path)), exist_ok=True)
                with open(os.path.join(root, path), "w", encoding="utf-8") as file:
                    file.write(content)
            return find_faults(root)

    def test_good_page(self):
        self.assertEqual([], self.faults(
            "# Top\n[a](other.md) [b](other.md#a-heading-eq-2) [c](#top) [d](https://x.org/y)\n"
            "`gnss/fix.cpp`: it\nhas `sanitize()`, *`SanitizesEq1`*, *`sanitized`*.\n"
            "| " + "x" * 116 + " |\nhttps://x.org/" + "y" * 200 + "\n```\n# no heading [e](gone.md)\n```\n"))

    def test_bad_pages(self):
        for text, fault in (("[a](gone.md)", "docs/page.md:1: gone.md: no such file"),
                            ("\n![a](gone.png)", "docs/page.md:2: gone.png: no such file"),
                            ("[a](other.md#gone)", "docs/page.md:1: other.md#gone: no such heading"),
                            ("ä " * 60 + "ä", "docs/page.md:1: 121 characters"),
                            ("| a |\n|---|\n| " + "b " * 59 + "|", "docs/page.md:3: 121 characters"),
                            ("in `gnss/gone.hpp`", "docs/page.md: no such file: gnss/gone"),
                            ("| (1) | *`GoneEq1`* |", "docs/page.md:1: no such test: GoneEq1"),
                            ("| (1) | *`test_gone.py`* |", "docs/page.md:1: no such test: test_gone.py"),
                            ("`gnss/fix.cpp`: `gone()`", "docs/page.md: no such function there: gone"),
                            ("`gnss/fix.cpp`\nand `anize()`", "docs/page.md: no such function there: anize")):
            self.assertEqual([fault], self.faults(text), text)

    def test_long_lines_elsewhere(self):
        for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.rst", "docs/methods/a.md", "launch/a.launch",
                     "test/ros/a.test", "scenarios/a.yaml"):
            self.assertEqual([name + ":1: 121 characters"], self.faults("b " * 60 + "b", name))
        self.assertEqual([], self.faults("b " * 60 + "b", "src/gnss/fix.cfg"))

    def test_readme_is_a_page(self):
        self.assertEqual(["README.md:1: docs/gone.md: no such file"], self.faults("[a](docs/gone.md)", "README.md"))


class Environment(unittest.TestCase):
    """scripts/environment.sh, which the other scripts source before anything is built."""

    def test_it_ends_no_strict_script(self):
        """Also without a build, as in a fresh clone."""
        with tempfile.TemporaryDirectory() as clone:
            os.mkdir(os.path.join(clone, "scripts"))
            shutil.copy(os.path.join(ROOT, "scripts", "environment.sh"), os.path.join(clone, "scripts"))
            for options in ("-eo", "-ieo"):
                done = subprocess.run(["bash", options, "pipefail", "-c", ". scripts/environment.sh; echo goes on"],
                                      cwd=clone, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                      stderr=subprocess.STDOUT, universal_newlines=True)
                self.assertIn("goes on", done.stdout, options)

    def test_lines_on_the_console_name_their_node(self):
        """Unless the user has another format."""
        def format_with(**environment):
            command = '. scripts/environment.sh; echo "$ROSCONSOLE_FORMAT"'
            return subprocess.check_output(["bash", "-c", command], cwd=ROOT, universal_newlines=True,
                                           env=dict(environment, PATH=os.environ["PATH"]))
        self.assertEqual(format_with(), "[${severity}] [${time}] [${node}]: ${message}\n")
        self.assertEqual(format_with(ROSCONSOLE_FORMAT="${message}"), "${message}\n")


if __name__ == "__main__":
    unittest.main()
