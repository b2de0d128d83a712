#!/usr/bin/env python3
"""What the repository uses is declared, and dev/dependencies.py sees what is not."""
import os
import subprocess
import sys
import tempfile
import textwrap
import unittest


def find_root():
    """The folder of package.xml, above this file."""
    folder = os.path.dirname(os.path.abspath(__file__))
    while not os.path.exists(os.path.join(folder, "package.xml")):
        folder = os.path.dirname(folder)
    return folder


ROOT = find_root()
sys.path.insert(0, os.path.join(ROOT, "dev"))
import dependencies  # noqa: E402
import shell_commands  # noqa: E402

TABLE_FILE = dependencies.TABLE
ON_DEBIAN = unittest.skipUnless(dependencies.Debian.here(), "no Debian with ROS from Debian knows who ships a file")

PACKAGE_XML = """
    <package format="3">
      <name>our_robot</name>
      <depend>good</depend>
      <test_depend>fine_msgs</test_depend>
    </package>
    """
TABLE = """
    # comment
    libgood-dev       libgood        good       # comment
    python3-fine-msgs ros-fine-msgs  fine_msgs
    build-essential   build-essential  -
    """
SHIPPED = {
    "good.h": "libgood-dev", "bad/bad.h": "libbad-dev", "vector": "libc6-dev",
    "fine_msgs.msg.Fine": "python3-fine-msgs", "bad_msgs.msg.Bad": "python3-bad-msgs", "bad_nodes/play": "bad-nodes",
    "bad_nodes": "bad-nodes",
    "bad_msgs/Bad": "ros-bad-msgs", "bad_msgs": "libbad-msgs-dev", "Good": "libgood-dev", "catkin": "libgood-dev",
    "badtool": "bad-tools", "g++": "g++", "rosrun": "bad-rosbash", "sed": "required",
    "bash": "required", "timeout": "required", "python3": "required", "sys": "required", "subprocess": "required",
}


class System:
    """Stands for Debian with the packages of SHIPPED."""

    def __init__(self, uses):
        self.packages = {use: {SHIPPED[use.name]} for use in uses if use.name in SHIPPED}
        self.found = set(self.packages)

    @staticmethod
    def standard(packages):
        return bool(packages & {"libc6-dev", "required"})

    @staticmethod
    def covered(listed):
        return set(listed) | ({"g++"} if "build-essential" in listed else set())

    @staticmethod
    def absent(listed):
        return []


class TreeTest(unittest.TestCase):
    def check(self, table=TABLE, package_xml=PACKAGE_XML, folder="room", **files):
        """What is wrong in a tree of these files in one folder; __ in a name stands for a point."""
        with tempfile.TemporaryDirectory() as root:
            contents = {"package.xml": package_xml, TABLE_FILE: table}
            contents.update((os.path.join(folder, name.replace("__", ".")), text) for name, text in files.items())
            for name, text in contents.items():
                path = os.path.join(root, name)
                os.makedirs(os.path.dirname(path), exist_ok=True)
                with open(path, "w") as stream:
                    stream.write(textwrap.dedent(text).lstrip("\n"))
            return dependencies.check(root, System)

    def expect(self, problems, *beginnings):
        """One problem for each beginning, in any order."""
        self.assertEqual(len(problems), len(beginnings), problems)
        for beginning in beginnings:
            self.assertTrue(any(each.startswith(beginning) for each in problems), (beginning, problems))

    def test_what_is_declared_passes(self):
        self.expect(self.check(
            a__cpp='#include <good.h>\n#include <vector>\n#include <our_robot/b.hpp>\n#include "c.hpp"\n', c__hpp="",
            b__py="import sys\nimport c\nfrom our_robot.msg import Ours\n", c__py="",
            d__launch="<launch><node pkg='our_robot' type='x' name='x' args='$(find our_robot)/y'/></launch>\n",
            e__sh="#!/bin/sh\nhelp() { g++ -v | sed s/a/b/; }\nhelp badtool_of_another_name 'badtool'  # badtool\n"))

    def test_undeclared_include(self):
        self.expect(self.check(a__cpp="#include <good.h>\n\n#  include <bad/bad.h>\n"),
                    "room/a.cpp:3: include bad/bad.h is shipped by libbad-dev, which scripts/apt-debian.txt lacks")
        self.expect(self.check(a__hpp='#include "bad/bad.h"\n'), "room/a.hpp:1: include bad/bad.h is shipped")

    def test_undeclared_import(self):
        bad = "import bad_msgs.msg.Bad is shipped by python3-bad-msgs"
        self.expect(self.check(a__py="import sys\n\ndef f():\n    from bad_msgs.msg import Bad\n"),
                    "room/a.py:4: " + bad)
        self.expect(self.check(a__cfg="#!/usr/bin/env python3\nfrom bad_msgs.msg import Bad\n"), "room/a.cfg:2: " + bad)
        self.expect(self.check(a__sh="python3 - << 'END'\nimport sys\nfrom bad_msgs.msg import Bad\nEND\n"),
                    "room/a.sh:3: " + bad)

    def test_import_by_name(self):
        bad = "import bad_msgs.msg.Bad is shipped by python3-bad-msgs"
        for call in ("importlib.import_module('bad_msgs.msg.Bad')", "__import__('bad_msgs.msg.Bad')"):
            self.expect(self.check(a__py="import sys\nx = " + call + "\n"), "room/a.py:2: " + bad)
        self.expect(self.check(a__py="import sys\nx = __import__(sys.argv[1])\n"))

    def test_what_cmake_finds(self):
        text = "set(more bad_msgs)  # a list\nfind_package(Good)\nfind_package(catkin REQUIRED COMPONENTS ${more})\n"
        self.expect(self.check(CMakeLists__txt=text), 
                    "room/CMakeLists.txt:3: cmake bad_msgs is shipped by libbad-msgs-dev")
        self.expect(self.check(CMakeLists__txt="generate_messages(DEPENDENCIES bad_msgs)\n"),
                    "room/CMakeLists.txt:1: cmake bad_msgs")

    def test_what_is_declared_for_tests_only(self):
        use = "from fine_msgs.msg import Fine\n"
        self.expect(self.check(folder="test", a__py=use))
        self.expect(self.check(a__py=use), "room/a.py:1: import fine_msgs.msg.Fine is used here, but package.xml has "
                                           "fine_msgs for tests only")
        also = PACKAGE_XML.replace("<depend>good", "<exec_depend>fine_msgs</exec_depend>\n      <depend>good")
        self.expect(self.check(a__py=use, package_xml=also))

    def test_undeclared_node(self):
        self.expect(self.check(a__launch="""
            <launch>
              <node pkg="bad_nodes" type="play" name="play"/>
              <node pkg="$(eval 'bad_nodes' if manager else 'our_robot')" type="play" name="two"/>
            </launch>
            """), "room/a.launch:2, room/a.launch:3: node bad_nodes/play is shipped by bad-nodes")
        self.expect(self.check(a__test="<launch><arg name='b' default='$(find bad_nodes)/x'/></launch>"),
                    "room/a.test:1: package bad_nodes is shipped by bad-nodes")
        self.expect(self.check(a__py="import subprocess\nsubprocess.run(['rosrun', 'bad_nodes', 'play'])\n"),
                    "room/a.py:2: program rosrun is shipped by bad-rosbash", "room/a.py:2: node bad_nodes/play")

    def test_undeclared_message(self):
        self.expect(self.check(A__msg="uint8 X=1\nbad_msgs/Bad[2] bad  # it is\n"),
                    "room/A.msg:2: message bad_msgs/Bad is shipped by ros-bad-msgs")

    def test_undeclared_program_of_a_shell_script(self):
        for script in ("badtool --help", "if ! badtool; then :; fi", "x=$(sed 1d y | badtool)", 'echo "a $(badtool)"',
                       "timeout 3 badtool", "A=1 badtool", "run() { \"$@\"; }; run badtool", "bash -c 'badtool'",
                       "case $1 in a | b) badtool ;; esac", "trap 'badtool' EXIT", "[[ a == b ]] && badtool",
                       "x=(); badtool", "for ((i = 0; i < 3; i++)); do badtool; done", "y=${x:-$(badtool)}",
                       "sed <<E\nx\nE\nbadtool"):
            with self.subTest(script=script):
                line = 4 if "<<" in script else 1
                self.expect(self.check(a__sh=script + "\n"),
                            "room/a.sh:%d: program badtool is shipped by bad-tools" % line)
        self.expect(self.check(run="#!/usr/bin/env bash\nbadtool\n"), "room/run:2: program badtool")

    def test_what_is_no_program(self):
        for script in ("echo badtool", "# badtool", "badtool() { :; }; badtool", "sed <<E\nbadtool\nE", "x=(badtool)",
                       "case $1 in badtool) : ;; esac", "for x in badtool; do :; done", "command -v badtool",
                       "x=badtool", "echo > badtool", "./badtool", '"$x/badtool"', "[ badtool = y ]", "export badtool"):
            with self.subTest(script=script):
                self.expect(self.check(a__sh=script + "\n"))

    def test_undeclared_program_of_a_python_script(self):
        for call in ("subprocess.run(['badtool', x])", "subprocess.check_output(['badtool'] + x)",
                     "os.system('badtool x')", "c = ['badtool']; subprocess.Popen(c)",
                     "subprocess.run(f())\ndef f():\n    return ['badtool']"):
            with self.subTest(call=call):
                self.expect(self.check(a__py="import sys\n" + call + "\n"),
                            "room/a.py:2: program badtool is shipped by bad-tools")
        self.expect(self.check(a__py="import sys\nsubprocess.run([sys.executable, 'badtool'])\n"))

    def test_a_program_may_be_left_to_the_reader(self):
        self.expect(self.check(a__sh="# Needs `apt-get install bad-tools`.\nbadtool\n"))
        self.expect(self.check(a__sh="# Needs `apt-get install other-tools`.\nbadtool\n"),
                    "room/a.sh:2: program badtool is shipped by bad-tools")
        self.expect(self.check(a__sh="# Needs `apt-get install bad-tools`.\n", b__sh="badtool\n"),
                    "room/b.sh:1: program badtool is shipped by bad-tools")

    def test_what_no_package_ships(self):
        self.expect(self.check(a__sh="nosuchtool\n", b__cpp="#include <nosuch.h>\n"),
                    "room/a.sh:1: program nosuchtool is in no package",
                    "room/b.cpp:1: include nosuch.h is in no package")

    def test_the_table_and_package_xml_agree(self):
        self.expect(self.check(table="libgood-dev libgood good\n"), "package.xml: fine_msgs has no line in ")
        self.expect(self.check(table=TABLE + "    libx-dev libx x\n"), TABLE_FILE + ":5: package.xml lacks x")
        self.expect(self.check(table=TABLE + "    libx-dev libx\n"), TABLE_FILE + ":5: three names are wanted")
        self.expect(self.check(table=TABLE + "    libgood-dev libgood good\n"), TABLE_FILE + ":5: libgood-dev stands")


class ShellTest(unittest.TestCase):
    def test_words_and_lines(self):
        commands, functions = shell_commands.read(
            "a 'b c' \\\n  \"d$e\" > f; g() { h; }\nif i & then j; fi <<X 2>&1\nk\nX\nl\n")
        self.assertEqual([(command.line, [word.text for word in command.words]) for command in commands],
                         [(1, ["a", "b c", "d"]), (2, ["h"]), (3, ["i"]), (3, ["j"]), (6, ["l"])])
        self.assertEqual(functions, {"g"})

    def test_any_beginning_of_a_script_ends(self):
        script = "case $(a \"b ${c:-'d'}\" `e`) in f | g) [[ h ]] && i=(j) ;; esac <<K\nl\nK\n((m)); n() { o <(p); }\n"
        for end in range(len(script)):
            shell_commands.read(script[:end])


class RepositoryTest(unittest.TestCase):
    def test_table(self):
        self.assertEqual(dependencies.check(ROOT), [])

    @ON_DEBIAN
    def test_everything_that_is_used_is_declared(self):
        problems = dependencies.check(ROOT, dependencies.Debian)
        self.assertEqual(problems, [], "\n" + "\n".join(problems))

    @ON_DEBIAN
    def test_debian_knows_who_ships_what(self):
        uses = {name: dependencies.Use(kind, name, "x", 1, True) for kind, name in (
            ("include", "ros/ros.h"), ("include", "vector"), ("import", "rospy"), ("import", "json"),
            ("node", "rosbag/play"), ("message", "std_msgs/Header"), ("program", "roslaunch"), ("program", "grep"),
            ("include", "nosuch.h"))}
        system = dependencies.Debian(list(uses.values()))
        for name, package in (("ros/ros.h", "libroscpp-dev"), ("rospy", "python3-rospy"),
                              ("rosbag/play", "python3-rosbag"), ("std_msgs/Header", "ros-std-msgs"),
                              ("roslaunch", "python3-roslaunch"), ("nosuch.h", None)):
            self.assertEqual(system.packages[uses[name]], {package} - {None}, name)
        for name in ("vector", "json", "grep"):
            self.assertTrue(system.standard(system.packages[uses[name]]), name)
        self.assertFalse(system.standard({"python3-rospy"}))
        self.assertIn("g++", system.covered(["build-essential"]))

    def test_the_command_says_how_it_is_used(self):
        done = subprocess.run([sys.executable, "-B", os.path.join(ROOT, "dev", "dependencies.py"), "--help"],
                              stdout=subprocess.PIPE, universal_newlines=True, check=True)
        self.assertIn("--list", done.stdout)


if __name__ == "__main__":
    unittest.main()
