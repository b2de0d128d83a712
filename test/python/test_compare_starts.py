"""compare_starts.py: when it starts, what it counts, and the whole of it with programs that only pretend."""
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import unittest

import programs

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "reports")
SCRIPT = os.path.join(SCRIPTS, "compare_starts.py")
sys.path.insert(0, SCRIPTS)
spec = importlib.util.spec_from_file_location("compare_starts", SCRIPT)
starts = importlib.util.module_from_spec(spec)
spec.loader.exec_module(starts)

# From 0 s there is no estimate; from later on the share inside is 0.8 and more.
REPLAY = """#!/usr/bin/env python3
import json, sys
start = float(sys.argv[sys.argv.index("--start") + 1])
if start == 0.0:
    sys.exit("no estimate: still waiting for odometry")
with open(sys.argv[sys.argv.index("--json") + 1], "w") as file:
    json.dump({"errors": {"inside_95": 0.8 + start / 1000.0}, "time_to_start_s": 4.0, "time_to_heading_s": None}, file)
"""


class StartsTest(unittest.TestCase):
    def test_each_start_has_its_duration(self):
        self.assertEqual(starts.start_times(290.0, 90.0, 3), [0.0, 100.0, 200.0])
        self.assertEqual(starts.start_times(100.0, 90.0, 20), [0.0])

    def test_times_for_people(self):
        self.assertEqual(starts.seconds([3.0, None, 8.4]), "8 / never")
        self.assertEqual(starts.seconds([]), "–")

    def test_counts_and_writes_the_table(self):
        with tempfile.TemporaryDirectory() as directory:
            programs.pretend(directory, replay=REPLAY, csv_to_bag=programs.CSV_TO_BAG)
            folder = os.path.join(directory, "data", "drive")
            os.makedirs(folder)
            for file in ("gnss.csv", "truth.csv", "meta.json"):
                open(os.path.join(folder, file), "w").close()
            with open(os.path.join(folder, "odom.csv"), "w") as file:
                file.write("stamp,v,yaw_rate\n10,1,0\n300,1,0\n")
            docs = os.path.join(directory, "docs.md")
            with open(docs, "w") as file:
                file.write("<!-- starts -->\n<!-- end of starts -->\n")
            done = subprocess.run([sys.executable, "-B", SCRIPT, os.path.join(directory, "out"), "--data",
                                   os.path.join(directory, "data"), "--docs", docs, "--starts", "3"],
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True,
                                  env=dict(os.environ, URBAN_GNSS_PROGRAMS=directory))
            self.assertEqual(done.returncode, 0, done.stderr)
            with open(docs, encoding="utf-8") as file:
                self.assertIn("| `drive` | 3 | 2 | 2 | 0.950 | 4 / 4 | never / never |", file.read())
            with open(os.path.join(directory, "out", "starts.json"), encoding="utf-8") as file:
                self.assertIsNone(json.load(file)["drive"][0])


if __name__ == "__main__":
    unittest.main()
