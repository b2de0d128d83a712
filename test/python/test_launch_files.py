"""Launch files: nodes forget the parameters of the launch before, and files are found where the user stands."""
import glob
import os
import re
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree

ROOT = os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..")


REQUIRED = {"replay.launch": ["bag"]}


def roslaunch(*arguments, folder="."):
    """What roslaunch says, called in a folder. Nothing is started."""
    environment = dict(os.environ, PWD=folder, ROS_LOG_DIR=folder,
                       ROS_PACKAGE_PATH=os.path.realpath(ROOT) + ":" + os.environ["ROS_PACKAGE_PATH"])
    return subprocess.run(["roslaunch", *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          universal_newlines=True, cwd=folder, env=environment, timeout=100).stdout


class LaunchFilesTest(unittest.TestCase):
    def test_every_argument_is_documented(self):
        """roslaunch --ros-args: none is required that is not, and none is shown that is not the user's."""
        files = sorted(glob.glob(os.path.join(ROOT, "launch", "*.launch")))
        self.assertGreater(len(files), 7)
        for path in files:
            name = os.path.basename(path)
            said = roslaunch("--ros-args", path)
            required, _, optional = said.partition("Optional Arguments:\n")
            self.assertEqual(re.findall(r"^  (\w+):", required, re.M), REQUIRED.get(name, []), name)
            shown = re.findall(r'^  (\w+) \(default "', optional, re.M)
            self.assertTrue(shown, said)
            self.assertNotIn("undocumented", said, name)
            arguments = ElementTree.parse(path).getroot().findall("arg")
            self.assertEqual(sorted(REQUIRED.get(name, []) + shown),
                             sorted(each.get("name") for each in arguments if each.get("value") is None), name)

    def test_a_wrong_choice_is_named_with_the_choices(self):
        path = os.path.join(ROOT, "launch", "localization.launch")
        with open(os.path.join(ROOT, "src", "localizers", "registry.cpp"), encoding="utf-8") as file:
            localizers = re.findall(r"^  X\((\w+)\)", file.read(), re.M)
        said = roslaunch("--dump-params", path, "localizer:=ekf")
        choices = re.search(r"config/ekf: no such localizer, but (.*)]", said)
        self.assertTrue(choices, said)
        self.assertEqual(sorted(choices.group(1).split(", ")), sorted(localizers))
        said = roslaunch("--dump-params", path, "robot:=tank")
        choices = re.search(r"config/robots/tank: no such robot, but (.*)]", said)
        self.assertTrue(choices, said)
        robots = [os.path.basename(each)[:-5] for each in glob.glob(os.path.join(ROOT, "config", "robots", "*.yaml"))]
        self.assertEqual(sorted(choices.group(1).split(", ")), sorted(robots))

    def test_a_localizer_of_the_comparison_that_is_none_is_named(self):
        path = os.path.join(ROOT, "launch", "comparison.launch")
        self.assertIn("config/imm: no such localizer, but", roslaunch("--dump-params", path, "localizers:=imm ukf"))
        self.assertNotIn("no such", roslaunch("--dump-params", path, "localizers:=imm_ekf ukf"))

    def test_parameters_of_the_launch_before_are_cleared(self):
        """A file of parameters that was corrected is launched again on the same roscore: what was wrong is gone."""
        ours = 0
        for path in sorted(glob.glob(os.path.join(ROOT, "launch", "*.launch"))):
            for node in ElementTree.parse(path).iter("node"):
                if "urban_gnss_localization" not in node.get("pkg"):
                    continue
                ours += 1
                self.assertEqual(node.get("clear_params"), "true", "%s: %s" % (os.path.basename(path), node.get("name")))
        self.assertGreater(ours, 10)

    def test_files_may_be_relative(self):
        """To the folder where roslaunch was called; a file that is missing is named with that folder."""
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, "mine.yaml"), "w", encoding="utf-8") as file:
                file.write("imm_ekf: {expert: {fix_delay: 0.25}}\n")

            def said(launch, *arguments, option="--dump-params"):
                return roslaunch(*option.split(), os.path.join(ROOT, "launch", launch), *arguments, folder=folder)

            for launch in ("localization.launch", "comparison.launch"):
                params = said(launch, "params:=mine.yaml")
                self.assertIn("imm_ekf/expert/fix_delay: 0.25", params)
                self.assertIn("imm_ekf/params_file: {}/mine.yaml".format(folder), params)
            self.assertIn("/occlusion/imm_ekf/expert/fix_delay: 0.25", said("occlusion.launch", "params:=mine.yaml"))
            for launch in ("localization.launch", "occlusion.launch"):
                self.assertIn("file does not exist [{}/no.yaml]".format(folder), said(launch, "params:=no.yaml"))
            self.assertIn("ls: cannot access 'no.bag': No such file", said("replay.launch", "bag:=no.bag"))
            for name in ("a.bag", "b.bag", "c.bag"):
                open(os.path.join(folder, name), "w", encoding="utf-8").close()
            player = said("replay.launch", "bag:=a.bag b.bag {}/c.bag".format(folder), option="--args player")
            self.assertIn("env --chdir={} ".format(folder), player)
            self.assertIn(" --bags a.bag b.bag {}/c.bag --topics ".format(folder), player)


if __name__ == "__main__":
    unittest.main()
