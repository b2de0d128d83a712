"""The package's programs, for tests that run them, or that pretend them for a script.

URBAN_GNSS_PROGRAMS names the folder of the programs."""
import os
import stat
import subprocess

PROGRAMS = os.environ.get("URBAN_GNSS_PROGRAMS", "")
PACKAGE = os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", ".."))

# A program that makes an empty bag.
CSV_TO_BAG = """#!/usr/bin/env python3
import sys
open(sys.argv[2], "w").close()
"""


def run(program, *arguments, stderr=subprocess.STDOUT):
    """What a program says; its errors are part of that, unless `stderr` is a pipe of their own."""
    environment = dict(os.environ)
    environment["ROS_PACKAGE_PATH"] = PACKAGE + ":" + environment.get("ROS_PACKAGE_PATH", "")
    return subprocess.run([os.path.join(PROGRAMS, program), *map(str, arguments)], stdout=subprocess.PIPE,
                          stderr=stderr, universal_newlines=True, env=environment, timeout=300)


def pretend(directory, **scripts):
    """Writes programs of these names and texts, which can be executed."""
    for name, text in scripts.items():
        path = os.path.join(directory, name)
        with open(path, "w") as file:
            file.write(text)
        os.chmod(path, os.stat(path).st_mode | stat.S_IXUSR)
