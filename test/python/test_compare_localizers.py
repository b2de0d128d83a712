"""compare_localizers.py: its statistics and tables, and the whole of it with programs that only pretend."""
import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest

import programs

import numpy as np

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "reports")
SCRIPT = os.path.join(SCRIPTS, "compare_localizers.py")
sys.path.insert(0, SCRIPTS)
spec = importlib.util.spec_from_file_location("compare_localizers", SCRIPT)
compare = importlib.util.module_from_spec(spec)
spec.loader.exec_module(compare)

# Writes what evaluate would: every run's errors are as large as the length of its name.
EVALUATE = """#!/usr/bin/env python3
import os, sys
runs = [a for a in sys.argv[1:sys.argv.index("--truth")]]
output = sys.argv[sys.argv.index("--output") + 1]
os.makedirs(os.path.join(output, "data"), exist_ok=True)
for run in runs:
    stem = os.path.splitext(os.path.basename(run))[0]
    is_recording = stem == "recording"
    name = stem + ("_gps_fix" if is_recording else "_odometry_filtered")
    size = 7 if is_recording else len(stem)
    with open(os.path.join(output, "data", "errors_" + name + ".csv"), "w") as file:
        file.write("t,position_error_m,heading_error_rad,est_x,est_y,truth_x,truth_y,sigma_m,nees\\n")
        for t in range(40):
            file.write("%d,%d,0,%d,0,%d,0,1,1\\n" % (t, size, t + size, t))
"""
REPLAY = """#!/usr/bin/env python3
import json, sys
if "--list-variants" in sys.argv:
    print("ekf\\nswitching")
else:
    open(sys.argv[sys.argv.index("--output") + 1], "w").close()
    with open(sys.argv[sys.argv.index("--json") + 1], "w") as file:
        json.dump({"errors": {"inside_95": 0.925, "position_nees_mean": 2.5, "beyond_protection": 0.001}}, file)
"""


class ScoresTest(unittest.TestCase):
    def test_percentiles_leave_out_what_is_missing(self):
        scores = compare.Scores(np.arange(5.0), np.array([1.0, 2.0, np.nan, 3.0, 5.0]))
        self.assertEqual(scores.percentile(50), 2.5)
        self.assertEqual(scores.cell(), "2.5 / 4.7 / 5")
        self.assertEqual(compare.Scores(np.array([]), np.array([])).cell(), "–")

    def test_the_maximum_is_never_rounded_to_below_the_95(self):
        self.assertEqual(compare.Scores(np.arange(3.0), np.full(3, 2.24)).cell(), "2.2 / 2.2 / 2.2")
        self.assertEqual(compare.Scores(np.arange(3.0), np.full(3, 2.6)).cell(), "2.6 / 2.6 / 3")

    def test_divergence_is_a_large_error_for_long(self):
        t = np.arange(0.0, 100.0)
        for seconds, diverged in ((29, False), (31, True)):
            error = np.where((t >= 10.0) & (t <= 10.0 + seconds), 101.0, 1.0)
            self.assertEqual(compare.Scores(t, error).has_diverged(), diverged)
            self.assertEqual("†" in compare.Scores(t, error).cell(), diverged)


class TextTest(unittest.TestCase):
    def test_replaces_between_markers_only(self):
        text = "a\n<!-- comparison -->\nold\n<!-- end of comparison -->\nb\n"
        self.assertEqual(compare.replace_between(text, "comparison", "new", "f"),
                         "a\n<!-- comparison -->\nnew\n<!-- end of comparison -->\nb\n")
        for broken in ("a", text + text, text.replace("end of", "")):
            with self.assertRaises(compare.common.ReportError):
                compare.replace_between(broken, "comparison", "new", "f")


    def test_wide_table_becomes_several(self):
        header = ["name", "a" * 50, "b" * 50, "c" * 50]
        tables = compare.markdown(header, [["x", "1", "2", "3"]]).split("\n\n")
        self.assertEqual(tables, ["| name | {} | {} |\n|---|---|---|\n| `x` | 1 | 2 |".format(*header[1:3]),
                                  "| name | {} |\n|---|---|\n| `x` | 3 |".format(header[3])])
        self.assertEqual(compare.markdown(["n", "a", "b"], []), "| n | a | b |\n|---|---|---|")


class ProgramTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = scratch.name
        programs.pretend(self.directory, evaluate=EVALUATE, replay=REPLAY, csv_to_bag=programs.CSV_TO_BAG)
        for recording, files in (("one", compare.NEEDED), ("two", compare.NEEDED), ("no_truth", ("gnss.csv",))):
            folder = os.path.join(self.directory, "data", recording)
            os.makedirs(folder)
            for file in files:
                open(os.path.join(folder, file), "w").close()

    def run_script(self, *arguments):
        environment = dict(os.environ, URBAN_GNSS_PROGRAMS=self.directory)
        return subprocess.run([sys.executable, "-B", SCRIPT, os.path.join(self.directory, "out"), "--data",
                               os.path.join(self.directory, "data"), *arguments], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, universal_newlines=True, env=environment)

    def test_page_docs_and_figures(self):
        docs = os.path.join(self.directory, "real_data.md")
        with open(docs, "w") as file:
            file.write("# Real\n<!-- comparison -->\n<!-- end of comparison -->\n"
                       "<!-- honesty -->\n<!-- end of honesty -->\n")
        done = self.run_script("--methods", "ekf", "switching", "imm_ekf", "--docs", docs)
        self.assertEqual(done.returncode, 0, done.stderr)
        with open(os.path.join(self.directory, "out", "report.html"), encoding="utf-8") as file:
            page = file.read()
        with open(docs, encoding="utf-8") as file:
            table = file.read()
        for text in ("`one`", "`two`", "3.0 / 3.0 / 3", "9.0 / 9.0 / 9", "7.0 / 7.0 / 7",
                     "| `two` | 7.0 / 7.0 / 7 | 0.925 | 1.25 | 0.10 % |"):
            self.assertIn(text, table)
        self.assertNotIn("no_truth", page + table)
        for picture in ("one.png", "two.png", "overview.png"):
            self.assertIn(picture, page)
            self.assertGreater(os.path.getsize(os.path.join(self.directory, "out", picture)), 1000)
        self.assertGreater(os.path.getsize(os.path.join(self.directory, "real_data.png")), 1000)

    def test_ablation_compares_with_the_whole(self):
        done = self.run_script("--ablation", "--recordings", "one")
        self.assertEqual(done.returncode, 0, done.stderr)
        with open(os.path.join(self.directory, "out", "report.html"), encoding="utf-8") as file:
            page = file.read()
        for name in compare.ABLATIONS:
            self.assertIn(name, page)
        self.assertIn("+0 %", page)

    def test_says_what_is_wrong(self):
        for arguments, text in ((("--recordings", "three"), "three"), (("--docs", os.path.join(self.directory, "x")), "x")):
            done = self.run_script(*arguments)
            self.assertEqual(done.returncode, 1)
            self.assertIn(text, done.stderr)
        os.remove(os.path.join(self.directory, "replay"))
        done = self.run_script()
        self.assertEqual(done.returncode, 1)
        self.assertIn("replay", done.stderr)


if __name__ == "__main__":
    unittest.main()
