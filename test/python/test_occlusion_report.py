"""occlusion_report.py end to end: a short drive or a bag, its tables, figures and page."""
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import rosbag

PROGRAMS = os.environ.get("URBAN_GNSS_PROGRAMS", "")
PACKAGE = os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", ".."))
SCRIPT = os.path.join(PACKAGE, "reports", "occlusion_report.py")


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
            self.assertIn("| building_pass | paper_as_printed | %.2f ±" %
                          content["trajectory"]["paper_as_printed"]["position_mean_m"], tables)
            # What the paper prints, which is computed here from its errors.
            for log, right, position, orientation in (("014", "79.3 %", "-38.5 %", "-27.6 %"),
                                                      ("042", "73.0 %", "-37.4 %", "-11.8 %"),
                                                      ("022", "78.7 %", "-21.2 %", "-10.7 %")):
                rows = [line for line in tables.splitlines() if "*printed: Log " + log in line]
                self.assertEqual(len(rows), 4)
                self.assertIn(right, rows[0])
                self.assertIn("| paper |", rows[3])
                self.assertIn("| {} |".format(position), rows[3])
                self.assertIn("| {} |".format(orientation), rows[3])

    def test_says_what_is_missing(self):
        with tempfile.TemporaryDirectory() as out:
            done = report(out, "--no-run")
            self.assertEqual(done.returncode, 1)
            self.assertIn("metrics.json", done.stdout)


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class BagReportTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.bag = cls.path("drive.bag")
        environment = dict(os.environ, ROS_PACKAGE_PATH=PACKAGE + ":" + os.environ.get("ROS_PACKAGE_PATH", ""))
        subprocess.run([os.path.join(PROGRAMS, "simulate"), "--scenario", "downtown_grid", "--duration", "20", "--set",
                        "lidar.points_per_revolution=120", "--set", "lidar.beams=8", "--output", cls.bag],
                       check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment, timeout=300)
        cls.done = report(cls.path("out"), "--bag", cls.bag, "--", "--occlusion-params",
                          os.path.join(PACKAGE, "config", "occlusion_simulator.yaml"))

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    @classmethod
    def path(cls, *names):
        return os.path.join(cls.scratch.name, *names)

    def read(self, out):
        with open(os.path.join(out, "metrics.json"), encoding="utf-8") as stream:
            content = json.load(stream)["scenarios"]
        with open(os.path.join(out, "tables.md"), encoding="utf-8") as stream:
            return content, stream.read()

    def changed_bag(self, name, source, change):
        with rosbag.Bag(source) as bag, rosbag.Bag(self.path(name), "w") as target:
            for topic, message, time in bag.read_messages():
                if change(topic):
                    target.write(topic, message, time)
        return self.path(name)

    def test_with_truth(self):
        self.assertEqual(self.done.returncode, 0, self.done.stdout)
        content, tables = self.read(self.path("out"))
        drive = content["drive"]
        for name in ("fig5.png", "fig6.png", "fig7.png", "report.html"):
            self.assertGreater(os.path.getsize(self.path("out", name)), 1000, name)
        with rosbag.Bag(self.bag) as bag:
            errors = [math.hypot(m.vector.x, m.vector.y) for _, m, _ in bag.read_messages("/ground_truth/gps_error")]
        for model in ("conventional", "paper", "soft"):
            c = drive["classification"][model]
            self.assertEqual(c["bad_called_good"] + c["bad_called_bad"], sum(error > 6.0 for error in errors))
            self.assertEqual(drive["fixes"][model]["fixes"], len(errors))
            self.assertGreater(drive["trajectory"][model]["coverage"], 0.5)
            self.assertIn("| drive | %s | %.2f ±" % (model, drive["trajectory"][model]["position_mean_m"]), tables)
        self.assertGreater(drive["satellites_of"]["soft"]["direct_called_free"], 0.8)
        self.assertGreater(drive["satellites_of"]["soft"]["hidden_called_blocked"], 0.2)  # few beams
        self.assertGreater(drive["fix_nees"]["conventional"]["mean"], drive["fix_nees"]["soft"]["mean"])
        for title in ("Table I", "Table II", "NEES", "What the models say", "What the map says"):
            self.assertIn(title, tables)

    def test_errors_against_the_poses_of_a_truth(self):
        """Where no simulator tells the errors they are the distances from the antenna's true place."""
        bag = self.changed_bag("posed.bag", self.bag, lambda topic: topic != "/ground_truth/gps_error")
        shutil.copytree(self.path("out", "runs"), self.path("posed", "runs"))
        done = report(self.path("posed"), "--bag", bag, "--no-run")
        self.assertEqual(done.returncode, 0, done.stdout)
        posed = self.read(self.path("posed"))[0]["posed"]
        told = self.read(self.path("out"))[0]["drive"]
        self.assertEqual(posed["trajectory"], told["trajectory"])
        for model in told["fix_nees"]:
            self.assertAlmostEqual(posed["fix_nees"][model]["mean"], told["fix_nees"][model]["mean"],
                                   delta=0.01 * told["fix_nees"][model]["mean"])

    def test_about_another_datum(self):
        """The truth is about the bag's own; the errors stay."""
        done = report(self.path("moved"), "--bag", self.bag, "--", "--occlusion-params",
                      os.path.join(PACKAGE, "config", "occlusion_simulator.yaml"), "--datum", "22.2998,114.1732,5.0")
        self.assertEqual(done.returncode, 0, done.stdout)
        moved, told = (self.read(self.path(name))[0]["drive"] for name in ("moved", "out"))
        for model in ("conventional", "paper", "soft"):
            self.assertAlmostEqual(moved["trajectory"][model]["position_mean_m"],
                                   told["trajectory"][model]["position_mean_m"], delta=0.1)

    def test_without_truth(self):
        bag = self.changed_bag("blind.bag", self.bag, lambda topic: not topic.startswith("/ground_truth"))
        done = report(self.path("blind"), "--bag", bag)
        self.assertEqual(done.returncode, 0, done.stdout)
        content, tables = self.read(self.path("blind"))
        self.assertEqual(set(content["blind"]), {"fixes", "satellites_of"})
        self.assertNotIn("Table I", tables)
        self.assertIn("What the models say of the fixes", tables)
        satellites = content["blind"]["satellites_of"]["soft"]
        self.assertIsNone(satellites["hidden_called_blocked"])
        self.assertGreater(satellites["cn0_free_dbhz"], satellites["cn0_blocked_dbhz"] + 3.0)
        self.assertGreater(os.path.getsize(self.path("blind", "fig7.png")), 1000)

    def test_recorded(self):
        live = self.path("live.bag")
        with rosbag.Bag(live, "w") as target:
            for source, topics in ((self.bag, ["/gps/datum", "/ground_truth/odom"]),
                                   (self.path("out", "runs", "paper.bag"), None)):
                with rosbag.Bag(source) as bag:
                    for topic, message, time in bag.read_messages(topics):
                        target.write(topic, message, time)
        done = report(self.path("recorded"), "--bag", live, "--recorded")
        self.assertEqual(done.returncode, 0, done.stdout)
        content, tables = self.read(self.path("recorded"))
        self.assertEqual(set(content["live"]["classification"]), {"paper"})
        expected = self.read(self.path("out"))[0]["drive"]["trajectory"]["paper"]
        self.assertEqual(content["live"]["trajectory"]["paper"], expected)
        self.assertIn("live, paper", tables)

    def test_says_what_is_missing(self):
        done = report(self.path("none"), "--bag", self.path("absent.bag"))
        self.assertEqual(done.returncode, 1)
        self.assertIn("absent.bag", done.stdout)
        done = report(self.path("none"), "--bag", self.bag, "--recorded")
        self.assertEqual(done.returncode, 1)
        self.assertIn("has no message on gps/visibility", done.stdout)
        done = report(self.path("none"), "--bag", self.bag, "--", "--points-topic", "velodyne_points")
        self.assertEqual(done.returncode, 1)
        self.assertIn("velodyne_points", done.stdout)


if __name__ == "__main__":
    unittest.main()
