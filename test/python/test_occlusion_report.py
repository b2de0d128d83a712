"""occlusion_report.py end to end: a short drive, its tables, figures and page."""
import json
import os
import subprocess
import sys
import tempfile
import unittest

PROGRAMS = os.environ.get("URBAN_GNSS_PROGRAMS", "")
SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "reports", "occlusion_report.py")


def report(*arguments):
    return subprocess.run([sys.executable, SCRIPT, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          universal_newlines=True)


class OcclusionReportTest(unittest.TestCase):
    @unittest.skipUnless(os.path.exists(os.path.join(PROGRAMS, "occlusion_experiment")),
                         "no programs in URBAN_GNSS_PROGRAMS")
    def test_short_drive(self):
        with tempfile.TemporaryDirectory() as out:
            done = report(out, "--scenarios", "building_pass", "--seeds", "1", "--duration", "25")
            self.assertEqual(done.returncode, 0, done.stdout)
            for name in ("fig5.png", "fig6.png", "fig7.png", "report.html"):
                self.assertGreater(os.path.getsize(os.path.join(out, name)), 1000, name)
            with open(os.path.join(out, "metrics.json")) as stream:
                content = json.load(stream)["scenarios"]["building_pass"]
            with open(os.path.join(out, "tables.md"), encoding="utf-8") as stream:
                tables = stream.read()
            self.assertIn("| building_pass | conventional | %.2f ±" %
                          content["trajectory"]["conventional"]["position_mean_m"], tables)
            self.assertIn("%.1f %%" % (100.0 * content["classification"]["soft"]["correct"]), tables)
            self.assertIn("%.2f" % (0.5 * content["fix_nees"]["soft"]["mean"]), tables)

    def test_says_what_is_missing(self):
        with tempfile.TemporaryDirectory() as out:
            done = report(out, "--no-run")
            self.assertEqual(done.returncode, 1)
            self.assertIn("metrics.json", done.stdout)


if __name__ == "__main__":
    unittest.main()
