#!/usr/bin/env python3
"""Each line of docs/requirements.md has a mutation whose text and test are there. And what no other test can see: no
callback asks the parameter server or waits, and the definitions of released messages do not change."""
import hashlib
import os
import re
import signal
import sys
import unittest


def find_root():
    """The folder of package.xml, above this file."""
    folder = os.path.dirname(os.path.abspath(__file__))
    while not os.path.exists(os.path.join(folder, "package.xml")):
        folder = os.path.dirname(folder)
    return folder


ROOT = find_root()
sys.path.insert(0, os.path.join(ROOT, "dev"))
import mutation_run  # noqa: E402

LINES = ["F{}".format(number) for number in range(1, 37)]


def read_text(path):
    """A file's text."""
    with open(os.path.join(ROOT, path), encoding="utf-8") as file:
        return file.read()


def rows(text):
    """The first cells of a page's table rows that name a line."""
    return re.findall(r"^\| (F\d+) \|", text, re.MULTILINE)


def has_test(mutation):
    """Whether the test that a mutation names is there."""
    if mutation.kind == "gtest":
        room, name = mutation.test.split()
        suite, case = name.split(".")
        folder = os.path.join(ROOT, "test", room)
        sources = "".join(read_text(os.path.join(folder, each)) for each in sorted(os.listdir(folder))
                          if each.endswith(".cpp"))
        return re.search(r"^TEST(_F)?\({}, {}\)".format(suite, case), sources, re.MULTILINE)
    if mutation.kind == "rostest":
        return os.path.exists(os.path.join(ROOT, "test/ros", mutation.test))
    module, case, method = mutation.test.split(".")
    text = read_text("test/python/{}.py".format(module))
    found = re.search(r"^class {}\(.*?(?=^class |\Z)".format(case), text, re.MULTILINE | re.DOTALL)
    return found and re.search(r"^    def {}\(self".format(method), found.group(), re.MULTILINE)


class Mutations(unittest.TestCase):
    """dev/mutations.yaml and docs/requirements.md."""

    @classmethod
    def setUpClass(cls):
        cls.mutations = mutation_run.read_mutations(ROOT)

    def test_every_line_has_one(self):
        found = [each.line for each in self.mutations]
        self.assertEqual(LINES, sorted(set(found), key=lambda line: int(line[1:])))

    def test_their_texts_stand_once(self):
        for each in self.mutations:
            with self.subTest(line=each.line, what=each.what):
                self.assertEqual(1, read_text(each.file).count(each.text))
                self.assertNotEqual(each.text, each.mutant)

    def test_their_tests_are_there(self):
        for each in self.mutations:
            with self.subTest(line=each.line, test=each.test):
                self.assertTrue(has_test(each))

    def test_the_page_has_a_row_for_every_line(self):
        self.assertEqual(LINES, rows(read_text(mutation_run.PAGE).split(mutation_run.BEGIN)[0]))

    def test_every_result_is_that_of_a_mutation_and_none_survives(self):
        results = read_text(mutation_run.PAGE).split(mutation_run.BEGIN)[1]
        possible = [mutation_run.row(each, mutation_run.KILLED) for each in self.mutations]
        for line in results.splitlines():
            if line.startswith("| F"):
                self.assertIn(line, possible, "run dev/mutation_run.py --write")


class MutationRun(unittest.TestCase):
    """The program itself: what it refuses, and that it puts back what it has changed."""

    def test_an_entry_needs_one_test(self):
        entry = {"what": "a", "file": "b", "text": "c", "mutant": "d"}
        for tests in ({}, {"gtest": "a B.C", "rostest": "d.test"}, {"gtest": "a B.C", "tset": 1}):
            with self.assertRaises(ValueError):
                mutation_run.Mutation("F1", dict(entry, **tests))

    def test_a_change_lasts_as_long_as_its_test(self):
        mutation = self.mutation("package.xml", "<name>urban_gnss_localization</name>")
        before = read_text("package.xml")
        changed = mutation_run.Change(Here(), mutation).changed
        self.assertEqual(before.replace(mutation.text, "another"), changed)
        self.assertEqual(before, read_text("package.xml"))

    def test_a_text_that_stands_twice_ends_the_run(self):
        with self.assertRaises(SystemExit):
            mutation_run.Change(Here(), self.mutation("package.xml", "depend"))

    def test_a_command_ends_in_time_though_what_it_started_goes_on(self):
        code, output = mutation_run.Copy(ROOT, 1, 5.0).run(["bash", "-c", "setsid sleep 60 & echo $!; sleep 60"])
        self.assertIsNone(code)
        os.kill(int(output), signal.SIGKILL)  # ProcessLookupError where it was waited for

    @staticmethod
    def mutation(file, text):
        return mutation_run.Mutation("F1", {"what": "a", "file": file, "text": text, "mutant": "another",
                                            "gtest": "a B.C"})


class Here:
    """A copy that is the tree itself."""

    folder = ROOT


def node_sources():
    """Path and text of what runs in a node, without comments."""
    for top in ("src/nodes", "src/nodelets", "src/ros", "src/simulation_ros", "include/urban_gnss_localization/ros",
                "include/urban_gnss_localization/simulation_ros"):
        for folder, _, names in sorted(os.walk(os.path.join(ROOT, top))):
            for name in sorted(names):
                path = os.path.relpath(os.path.join(folder, name), ROOT)
                yield path, re.sub(r"//[^\n]*", "", read_text(path))


def calls(text, name):
    """The arguments, as one text, of every call of a function."""
    for found in re.finditer(r"\b{}\(".format(name), text):
        depth, end = 1, found.end()
        while depth > 0:
            depth += {"(": 1, ")": -1}.get(text[end], 0)
            end += 1
        yield text[found.end():end - 1]


def count_arguments(arguments):
    """How many there are, by the commas outside of brackets."""
    while re.search(r"\([^()]*\)", arguments):
        arguments = re.sub(r"\([^()]*\)", "", arguments)
    return arguments.count(",") + 1


class Callbacks(unittest.TestCase):
    """A node reads its parameters when it starts, and waits for nothing afterwards."""

    # Each of these is called before the node subscribes.
    AT_THE_START = {"src/ros/node_parameters.cpp": 2, "src/nodes/gps_bias_node.cpp": 1,
                    "src/nodes/complementary_ekf_node.cpp": 1, "src/ros/state_keeper.cpp": 1}
    OWN_THREAD = {"src/nodes/gpsd_node.cpp"}  # its reader pauses between two attempts to connect

    def test_none_asks_the_parameter_server(self):
        found = {}
        for path, text in node_sources():
            count = len(re.findall(r"\b(?:get|set|has|search)Param(?:Cached|Names)?\(|\bparam<|ros::param::", text))
            if count > 0:
                found[path] = count
        self.assertEqual(self.AT_THE_START, found)

    def test_none_waits_for_tf(self):
        for path, text in node_sources():
            for name in ("canTransform", "lookupTransform"):
                for arguments in calls(text, name):
                    self.assertLessEqual(count_arguments(arguments), 3, "{}: {}({})".format(path, name, arguments))

    def test_none_waits_otherwise(self):
        for path, text in node_sources():
            waits = re.findall(r"\bwaitFor\w+|\bsleep\w*\(", text)
            self.assertTrue(path in self.OWN_THREAD or not waits, "{}: {}".format(path, waits))


class Messages(unittest.TestCase):
    """Bags must stay readable: a definition that was released is frozen, but for its comments. What is new is another
    message."""

    FROZEN = {
        "msg/FixDecision.msg": "edc809962c7c10f9160f942cd5915cef",
        "msg/GpsBias.msg": "45a287636aa2c9914d0d93719a680ca3",
        "msg/LocalizationStatus.msg": "a9c32b85e825b38fc4c9a4dc7628f717",
        "msg/Satellite.msg": "93bc2dfc23afaf8c6156d061958c9572",
        "msg/SatelliteArray.msg": "87c065d93348d099c8fc746eab00e71e",
        "msg/SatelliteVisibility.msg": "a1303f736a71d12994fb74b9bcb6d512",
        "msg/SignalPath.msg": "0996e849d07a3a710dcac76b58ce8c4f",
        "msg/SignalPathArray.msg": "38d5900665dd9980ee5b289d8b564291",
        "msg/Visibility.msg": "361157ab40bd3971a918267c7d5f7b6f",
        "srv/FromLL.srv": "13e9f7cfebfbd87f426e7e6b518ef966",
        "srv/FromLLArray.srv": "9e3b0fdb28d8035c7f91988e99493d24",
        "srv/SaveMap.srv": "dbc7586f7a24c278876f050a9aeb9f48",
        "srv/SetDatum.srv": "7fda287fad6483fdf29662002d6c3bc4",
        "srv/SetPose.srv": "2abcdea134b168bf70a9d39c7988e47d",
        "srv/ToLL.srv": "703e36e770c53bc149919ebd59b9fc26",
        "srv/ToLLArray.srv": "6b5bae764f89bd6694220140075aa58f",
    }

    @staticmethod
    def digest(path):
        """MD5 of a definition without comments and without the spaces that mean nothing."""
        lines = [" ".join(re.sub(r"#.*", "", line).split()) for line in read_text(path).splitlines()]
        return hashlib.md5("\n".join(line for line in lines if line).encode()).hexdigest()

    def test_definitions_are_frozen(self):
        found = {}
        for folder in ("msg", "srv"):
            for name in sorted(os.listdir(os.path.join(ROOT, folder))):
                found["{}/{}".format(folder, name)] = self.digest("{}/{}".format(folder, name))
        self.assertEqual(self.FROZEN, found)


if __name__ == "__main__":
    unittest.main()
