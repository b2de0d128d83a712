"""The files that are made of the parameter structs: as the structs are, and read alike by rosparam and by the nodes.

URBAN_GNSS_PROGRAMS names the folder of the programs."""
import os
import re
import subprocess
import unittest

import yaml

PROGRAMS = os.environ.get("URBAN_GNSS_PROGRAMS", "")
PACKAGE = os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", ".."))
MOST_BASIC = 10  # parameters of tier one that a node may have
LONGEST_LINE = 120


def yaml_files():
    """Every YAML file of config/, by its path below it."""
    root = os.path.join(PACKAGE, "config")
    for folder, _, names in os.walk(root):
        for name in sorted(names):
            yield os.path.relpath(os.path.join(folder, name), root)


def scalars(value, path=""):
    """Every scalar of a map, with where it stands."""
    if isinstance(value, dict):
        for name, below in value.items():
            yield from scalars(below, path + "." + name)
    elif isinstance(value, list):
        for element in value:
            yield from scalars(element, path)
    else:
        yield path, value


class ParametersTest(unittest.TestCase):
    def run_tool(self, *arguments):
        return subprocess.run([os.path.join(PROGRAMS, "parameters"), *arguments], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, universal_newlines=True, timeout=60)

    def test_files_are_as_the_structs_are(self):
        done = self.run_tool("--check", PACKAGE)
        self.assertEqual(done.returncode, 0, done.stdout)

    def test_a_stale_file_is_found(self):
        done = self.run_tool("--check", os.path.join(PACKAGE, "config"))
        self.assertEqual(done.returncode, 1)
        self.assertIn("config/imm_ekf.yaml", done.stdout)
        self.assertIn("docs/parameters.md", done.stdout)

    def test_tier_one_is_short(self):
        with open(os.path.join(PACKAGE, "docs", "parameters.md"), encoding="utf-8") as stream:
            nodes = re.split(r"^## ", stream.read(), flags=re.M)[1:]
        self.assertGreaterEqual(len(nodes), 8)
        for node in nodes:
            name = node.splitlines()[0]
            paths = re.findall(r"^\| `([^`]+)`", node, flags=re.M)
            basic = [path for path in paths if not path.startswith("expert.")]
            self.assertTrue(0 < len(basic) <= MOST_BASIC, "{}: {}".format(name, basic))
            self.assertEqual(len(paths), len(set(paths)), name + ": a name stands twice")

    def test_every_parameter_has_a_meaning(self):
        with open(os.path.join(PACKAGE, "docs", "parameters.md"), encoding="utf-8") as stream:
            for line in stream:
                if line.startswith("| `"):
                    self.assertTrue(line.rstrip(" |\n").count("|") == 5, line)

    def test_rosparam_reads_numbers_as_numbers(self):
        """YAML 1.1, which rosparam reads, takes 1e-5 for a text and off for a boolean."""
        for name in yaml_files():
            with open(os.path.join(PACKAGE, "config", name), encoding="utf-8") as stream:
                text = stream.read()
            for path, value in scalars(yaml.safe_load(text) or {}):
                if isinstance(value, str):
                    self.assertIsNone(re.fullmatch(r"[-+.0-9]+([eE][-+]?[0-9]+)?", value), name + ": " + path)
            self.assertNotRegex(text, r"(?im)^\s*\w+: (on|off|yes|no|y|n)\b", name)

    def test_lines_are_short(self):
        for name in yaml_files():
            with open(os.path.join(PACKAGE, "config", name), encoding="utf-8") as stream:
                for line in stream:
                    self.assertLessEqual(len(line.rstrip("\n")), LONGEST_LINE, name + ": " + line)


if __name__ == "__main__":
    unittest.main()
