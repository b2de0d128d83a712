"""leave_one_out.py: what a drive is, that the drive left out has no say, and the whole of it with a pretended replay."""
import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest

import programs

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "reports")
SCRIPT = os.path.join(SCRIPTS, "leave_one_out.py")
sys.path.insert(0, SCRIPTS)
spec = importlib.util.spec_from_file_location("leave_one_out", SCRIPT)
report = importlib.util.module_from_spec(spec)
spec.loader.exec_module(report)

# The first value of the grid is the number of the set's error: the larger the share, the worse.
REPLAY = """#!/usr/bin/env python3
import json, sys
shares = [float(text.split("=")[1]) for text in sys.argv if "common_error_share" in text]
with open(sys.argv[sys.argv.index("--json") + 1], "w") as file:
    json.dump({"errors": {"position_m": {"median": 1.0 + sum(shares), "p95": 3.0}, "inside_95": 0.9,
                          "position_nees_mean": 2.0}}, file)
"""


def errors(median):
    return {"position_m": {"median": median, "p95": 2.0}, "inside_95": 0.95, "position_nees_mean": 2.0}


class LeaveOneOutTest(unittest.TestCase):
    def test_receivers_of_one_drive_are_one(self):
        self.assertEqual(report.drive_of("hk_tst_20210517_ublox"), report.drive_of("hk_tst_20210517_xiaomi"))
        self.assertNotEqual(report.drive_of("nclt_20130110"), report.drive_of("nclt_20130223"))
        self.assertEqual(report.drive_of("mtv_f9k_nmea"), "mtv_f9k_nmea")

    def test_too_careful_costs_as_much_as_too_sure(self):
        careful, sure = errors(1.0), errors(1.0)
        careful["position_nees_mean"], sure["position_nees_mean"] = 1.0, 4.0
        self.assertAlmostEqual(report.cost(careful), report.cost(sure))
        self.assertGreater(report.cost(sure), report.cost(errors(1.0)))

    def test_the_drive_left_out_has_no_say(self):
        good, other = report.sets()[1], report.sets()[2]
        results = {name: {chosen: errors(5.0) for chosen in report.sets()} for name in ("a_20200101_x", "b_20200202_x")}
        results["a_20200101_x"][other] = errors(0.1)
        results["b_20200202_x"][good] = errors(1.0)
        self.assertEqual(report.choose(results, "a_20200101"), good)
        self.assertEqual(report.choose(results, "b_20200202"), other)

    def test_writes_the_table(self):
        with tempfile.TemporaryDirectory() as directory:
            programs.pretend(directory, replay=REPLAY, csv_to_bag=programs.CSV_TO_BAG)
            for name in ("one", "two"):
                folder = os.path.join(directory, "data", name)
                os.makedirs(folder)
                for file in ("gnss.csv", "odom.csv", "truth.csv", "meta.json"):
                    open(os.path.join(folder, file), "w").close()
            docs = os.path.join(directory, "docs.md")
            with open(docs, "w") as file:
                file.write("<!-- leave one out -->\n<!-- end of leave one out -->\n")
            done = subprocess.run([sys.executable, "-B", SCRIPT, os.path.join(directory, "out"), "--data",
                                   os.path.join(directory, "data"), "--docs", docs],
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True,
                                  env=dict(os.environ, URBAN_GNSS_PROGRAMS=directory))
            self.assertEqual(done.returncode, 0, done.stderr)
            with open(docs) as file:
                text = file.read()
            self.assertIn("| `one` | 0.45, 4.0, 2.0 | 1.4 / 3.0, 0.90, 1.00 | 1.0 / 3.0, 0.90, 1.00 |", text)
            self.assertIn("| `two` |", text)


if __name__ == "__main__":
    unittest.main()
