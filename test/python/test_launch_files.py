"""Launch files: every node of ours forgets the parameters of the launch before."""
import glob
import os
import unittest
import xml.etree.ElementTree as ElementTree

ROOT = os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..")


class LaunchFilesTest(unittest.TestCase):
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


if __name__ == "__main__":
    unittest.main()
