"""comparison.launch and rviz's views know every localizer of the registry, in the same colours, and the particles."""
import os
import re
import unittest
import xml.etree.ElementTree as ElementTree

import yaml

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", ".."))


def read_text(*path):
    with open(os.path.join(ROOT, *path), encoding="utf-8") as file:
        return file.read()


def localizers():
    """The names of the registry."""
    return re.findall(r"^  X\((\w+)\)", read_text("src", "localizers", "registry.cpp"), re.MULTILINE)


def displays(view):
    return yaml.safe_load(read_text("rviz", view + ".rviz"))["Visualization Manager"]["Displays"]


def palette():
    """The colours of the error plot, as rviz writes them, in the order of the names."""
    source = read_text("src", "nodes", "comparison_node.cpp")
    table = re.search(r"kPalette\[\] = \{(.*?)\};", source, re.DOTALL).group(1)
    rows = re.findall(r"\{([\d.F, ]+)\}", table)
    return ["; ".join(str(int(255.0 * float(part.strip("F ")) + 0.5)) for part in row.split(",")[:3]) for row in rows]


class ViewsTest(unittest.TestCase):
    def test_comparison_has_every_localizer(self):
        launch = ElementTree.fromstring(read_text("launch", "comparison.launch"))
        self.assertEqual({group.get("ns") for group in launch.findall("group")}, set(localizers()))
        defaults = {arg.get("name"): arg.get("default") for arg in launch.findall("arg")}
        self.assertEqual(set(defaults["localizers"].split()), set(localizers()))
        names = launch.find("node[@name='comparison']/param[@name='localizers']").get("value")
        self.assertEqual(names, "$(arg known)")
        self.assertEqual(launch.find("arg[@name='known']").get("value"), defaults["localizers"])

    def test_comparison_shows_each_in_its_colour(self):
        launch = ElementTree.fromstring(read_text("launch", "comparison.launch"))
        order = launch.find("arg[@name='localizers']").get("default").split()
        self.assertGreaterEqual(len(palette()), len(order))
        for name, colour in zip(order, palette()):
            shown = [display for display in displays("comparison")
                     if display.get("Topic") == name + "/odometry/filtered"]
            self.assertEqual({display["Shape"]["Color"] for display in shown}, {colour}, name)
            self.assertFalse(any(display["Covariance"]["Value"] for display in shown), "a column, seen from above")
        self.assertIn("ellipses", [display.get("Marker Topic") for display in displays("comparison")])
        self.assertIn("error_plot", [display.get("Image Topic") for display in displays("comparison")])

    def test_status_is_shown(self):
        for view in ("localization", "city", "occlusion", "replay"):
            shown = [display["Marker Topic"] for display in displays(view)
                     if display["Class"] == "rviz/Marker" and display["Enabled"]]
            self.assertEqual(["ellipse", "status_text"], shown, view)

    def test_particles_are_shown(self):
        for view in ("localization", "city", "occlusion", "replay"):
            shown = {(display["Class"], display["Topic"]) for display in displays(view)
                     if display["Enabled"] and "Topic" in display}
            self.assertIn(("rviz/PoseArray", "particle_cloud"), shown, view)
            self.assertIn(("rviz/PointCloud2", "particle_cloud_weighted"), shown, view)


if __name__ == "__main__":
    unittest.main()
