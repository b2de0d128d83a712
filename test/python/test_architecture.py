#!/usr/bin/env python3
"""docs/architecture.md is true: no include goes from one room to another where its table has no arrow."""
import os
import re
import tempfile
import textwrap
import unittest

PACKAGE = "urban_gnss_localization"
# Rooms that may use ROS. All others compute, and can be used where there is no ROS.
ROS_ROOMS = {"ros", "simulation_ros", "nodes", "nodelets", "tools"}
ROS_HEADER = re.compile(r"(ros\w*|tf2\w*|nodelet|pluginlib|diagnostic_updater|dynamic_reconfigure|topic_tools|"
                        r"\w+_msgs|\w+_srvs)/")
METHODS = "localizers/"  # below it, a folder a method is a room
SOURCE = (".hpp", ".h", ".cpp")


def find_root():
    """The folder of package.xml, above this file."""
    folder = os.path.dirname(os.path.abspath(__file__))
    while not os.path.exists(os.path.join(folder, "package.xml")):
        folder = os.path.dirname(folder)
    return folder


ROOT = find_root()


def read_text(*path):
    """A file's text."""
    with open(os.path.join(*path), encoding="utf-8") as file:
        return file.read()


def read_table(text, *columns):
    """The rows below the first header line with these columns, as lists of texts without back-quotes."""
    lines = iter(text.splitlines())
    cells = lambda line: [cell.strip().replace("`", "") for cell in line.strip().strip("|").split("|")]  # noqa: E731
    rows = None
    for line in lines:
        if rows is None:
            if line.startswith("|") and cells(line)[:len(columns)] == list(columns):
                rows = []
                next(lines)  # |---|
        elif line.startswith("|"):
            rows.append(cells(line))
        else:
            break
    if not rows:
        raise ValueError("no table with the columns " + " | ".join(columns))
    return rows


def split(names):
    """The set of comma-separated names."""
    return {name.strip() for name in names.split(",")} - {"", "–"}


def read_sets(text, *columns):
    """{name in the first column: names in the second}; a row without a name continues the row above."""
    sets = {}
    name = None
    for first, names, *_ in read_table(text, *columns):
        name = first or name
        sets.setdefault(name, set()).update(split(names))
    return sets


def read_arrows(text):
    """{room: rooms that it may include}."""
    return read_sets(text, "room", "may include")


def read_libraries(text):
    """{library: its rooms}."""
    return read_sets(text, "library", "rooms")


def room_of(path):
    """The room of a path below include/<package>/ or src/, with forward slashes; empty for a file in neither room."""
    folders = path.split("/")[:-1]
    if path.startswith(METHODS) and len(folders) > 1:
        return "/".join(folders[:2])
    return folders[0] if folders else ""


def includes(text):
    """(line number, what is included) of each #include."""
    for number, line in enumerate(text.splitlines(), 1):
        found = re.match(r'\s*#\s*include\s*[<"]([^>"]+)[>"]', line)
        if found:
            yield number, found.group(1)


def source_files(root):
    """(path below root, path below its include or src folder) of every header and source."""
    for top in ("include/" + PACKAGE, "src"):
        for folder, _, names in sorted(os.walk(os.path.join(root, top))):
            for name in sorted(names):
                if name.endswith(SOURCE):
                    path = os.path.relpath(os.path.join(folder, name), root)
                    yield path, os.path.relpath(path, top)


def target_of(header, inner, root):
    """The path below include/<package>/ or src/ of a header of this package; None for one of another package."""
    if header.startswith(PACKAGE + "/"):
        return header[len(PACKAGE) + 1:]
    beside = os.path.normpath(os.path.join(os.path.dirname(inner), header))
    return beside if os.path.exists(os.path.join(root, "src", beside)) else None


def fault_of(room, header, inner, root, arrows, core):
    """What is wrong with an include in a room; empty where nothing is."""
    target = target_of(header, inner, root)
    is_message = target is not None and "/" not in target and header.startswith(PACKAGE + "/")
    if (is_message or (target is None and ROS_HEADER.match(header))) and room not in ROS_ROOMS:
        return "{} may not include ROS: {}".format(room, header)
    if target is None or is_message:
        return "{} may not include yaml-cpp".format(room) if header.startswith("yaml-cpp/") and room in core else ""
    if room_of(target) in arrows[room] | {room}:
        return ""
    return "{} may not include {}: {}".format(room, room_of(target), header)


def find_faults(root, arrows, core):
    """file:line of every include that the table does not allow, with the reason."""
    faults = []
    for path, inner in source_files(root):
        room = room_of(inner)
        if room not in arrows:
            faults.append("{}:1: the room '{}' is not in the table".format(path, room))
            continue
        for number, header in includes(read_text(root, path)):
            fault = fault_of(room, header, inner, root, arrows, core)
            if fault:
                faults.append("{}:{}: {}".format(path, number, fault))
    return faults


def find_circle(arrows):
    """Rooms that include each other in a circle; empty where none do."""
    left = dict(arrows)
    while left:
        ends = [room for room, targets in left.items() if not targets & left.keys()]
        if not ends:
            return sorted(left)
        for room in ends:
            del left[room]
    return []


class Repository(unittest.TestCase):
    """The table of docs/architecture.md, and what is there."""

    @classmethod
    def setUpClass(cls):
        text = read_text(ROOT, "docs", "architecture.md")
        cls.arrows = read_arrows(text)
        cls.libraries = read_libraries(text)

    def test_includes_follow_the_arrows(self):
        faults = find_faults(ROOT, self.arrows, self.libraries["core"])
        self.assertEqual([], faults, "\n" + "\n".join(faults))

    def test_arrows_lead_to_rooms_and_not_in_circles(self):
        for room, targets in self.arrows.items():
            self.assertEqual(set(), targets - self.arrows.keys(), "arrows of " + room)
        self.assertEqual([], find_circle(self.arrows))

    def test_what_the_house_forbids(self):
        """The table itself may not be opened for these."""
        methods = {room for room in self.arrows if room.startswith(METHODS)}
        self.assertEqual(4, len(methods))
        for room in self.libraries["core"]:
            self.assertEqual(set(), self.arrows[room] - self.libraries["core"], room + " leaves the core")
        for method in methods:
            self.assertEqual(set(), self.arrows[method] & methods, method)
        self.assertEqual(set(), self.arrows["localizers"] & methods)

    def test_libraries_are_those_of_cmake(self):
        found = {}
        for name, rooms in re.findall(r"add_room_library\((\w+)\s+ROOMS\s+([\w/\s]+?)\s+LINK",
                                      read_text(ROOT, "CMakeLists.txt")):
            found[name] = set(rooms.split())
        self.assertEqual(found, self.libraries)

    def test_every_ros_package_is_known_as_ros(self):
        packages = re.search(r"set\(ros_packages\s+([\w\s]+)\)", read_text(ROOT, "CMakeLists.txt")).group(1).split()
        self.assertIn("roscpp", packages)
        for package in packages:
            self.assertTrue(ROS_HEADER.match(package + "/header.h"), package)


class Check(unittest.TestCase):
    """It fails where it must: on a tree made for it."""

    ARROWS = {"common": set(), "simulation": {"common"}, "localizers": {"common"}, "ros": {"localizers"},
              "localizers/kim": {"common", "localizers"}, "localizers/maier": {"common", "localizers"}}
    CORE = {"common", "localizers", "localizers/kim", "localizers/maier"}

    def faults(self, files):
        with tempfile.TemporaryDirectory() as root:
            for path, text in files.items():
                full = os.path.join(root, path.replace("include/", "include/" + PACKAGE + "/"))
                os.makedirs(os.path.dirname(full), exist_ok=True)
                with open(full, "w", encoding="utf-8") as file:
                    file.write(textwrap.dedent(text))
            return find_faults(root, self.ARROWS, self.CORE)

    def faults_of(self, path, line):
        return self.faults({path: "#pragma once\n" + line + "\n"})

    def test_what_is_allowed(self):
        self.assertEqual([], self.faults({
            "include/localizers/kim/ekf.hpp": """
                #include <Eigen/Core>
                #include "urban_gnss_localization/localizers/kim/bias.hpp"
                #include "urban_gnss_localization/localizers/localizer.hpp"
                // #include "urban_gnss_localization/simulation/world.hpp"
                """,
            "src/localizers/kim/ekf.cpp": '#include "limits.hpp"\n',
            "src/localizers/kim/limits.hpp": "#include <vector>\n",
            "src/ros/conversions.cpp": """
                #include <ros/ros.h>
                #include <sensor_msgs/NavSatFix.h>
                #include <yaml-cpp/yaml.h>
                #include "urban_gnss_localization/GpsBias.h"
                """}))

    def test_localizer_includes_simulation(self):
        self.assertEqual(
            ["src/localizers/ukf.cpp:2: localizers may not include simulation: "
             "urban_gnss_localization/simulation/world.hpp"],
            self.faults_of("src/localizers/ukf.cpp", '#include "urban_gnss_localization/simulation/world.hpp"'))

    def test_method_includes_another(self):
        faults = self.faults_of("include/localizers/kim/ekf.hpp",
                                '#include "urban_gnss_localization/localizers/maier/ukf.hpp"')
        self.assertEqual(1, len(faults))
        self.assertIn("include/urban_gnss_localization/localizers/kim/ekf.hpp:2: localizers/kim may not include "
                      "localizers/maier", faults[0])

    def test_general_room_includes_a_method(self):
        self.assertEqual(1, len(self.faults_of("src/localizers/registry.cpp",
                                               '#include "urban_gnss_localization/localizers/maier/ukf.hpp"')))

    def test_core_includes_ros(self):
        for header in ("ros/ros.h", "sensor_msgs/NavSatFix.h", "std_srvs/Empty.h", "rosbag/bag.h", "tf2_ros/buffer.h",
                       PACKAGE + "/GpsBias.h", PACKAGE + "/ComplementaryEkfConfig.h"):
            faults = self.faults_of("src/common/stamp.cpp", "#include <" + header + ">")
            self.assertEqual(["src/common/stamp.cpp:2: common may not include ROS: " + header], faults)

    def test_simulation_includes_ros(self):
        self.assertEqual(1, len(self.faults_of("src/simulation/world.cpp", "# include <nav_msgs/Odometry.h>")))

    def test_core_includes_yaml(self):
        for path in ("include/common/parameters.hpp", "src/common/parameters.cpp"):
            self.assertEqual(1, len(self.faults_of(path, "#include <yaml-cpp/yaml.h>")))
        self.assertEqual([], self.faults_of("src/simulation/scenario.cpp", "#include <yaml-cpp/yaml.h>"))

    def test_private_header_of_another_room(self):
        faults = self.faults({"src/common/text.cpp": '#include "../simulation/nodes.hpp"\n',
                              "src/simulation/nodes.hpp": "\n"})
        self.assertEqual(["src/common/text.cpp:1: common may not include simulation: ../simulation/nodes.hpp"], faults)

    def test_unknown_room(self):
        self.assertEqual(["src/attic/old.cpp:1: the room 'attic' is not in the table"],
                         self.faults_of("src/attic/old.cpp", ""))
        self.assertEqual(1, len(self.faults_of("src/localizers/thrun/grid.cpp", "")))
        self.assertEqual(1, len(self.faults_of("src/main.cpp", "")))

    def test_circle(self):
        self.assertEqual([], find_circle(self.ARROWS))
        self.assertEqual(["a", "b", "c"], find_circle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": set()}))

    def test_table(self):
        text = ("text\n\n| room | may include |\n|---|---|\n| `a` | – |\n| `b/c` | `a`, d |\n| | e |\n\n"
                "| room | may include |\n")
        self.assertEqual({"a": set(), "b/c": {"a", "d", "e"}}, read_arrows(text))
        with self.assertRaises(ValueError):
            read_arrows("no table")


if __name__ == "__main__":
    unittest.main()
