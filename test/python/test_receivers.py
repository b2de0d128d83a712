#!/usr/bin/env python3
"""The table of receivers' topics: the documents and the launch files have what the programs have. And a real bag of a
driver through replay; skipped without URBAN_GNSS_DATA."""
import json
import os
import re
import subprocess
import tempfile
import unittest

PACKAGE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAMS = os.environ.get("URBAN_GNSS_PROGRAMS")
DATA = os.environ.get("URBAN_GNSS_DATA", os.path.join(PACKAGE, "..", "shared", "data"))
TERRACE = os.path.join(DATA, "receivers", "terrace_ublox.bag")


def read(*path):
    with open(os.path.join(PACKAGE, *path), encoding="utf-8") as file:
        return file.read()


def replay(*arguments):
    return subprocess.run([os.path.join(PROGRAMS, "replay")] + list(arguments), check=False, timeout=120,
                          universal_newlines=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class TableTest(unittest.TestCase):
    def setUp(self):
        self.rows = [line.split("\t") for line in replay("--list-receivers").stdout.splitlines()]

    def test_the_document_has_every_topic_and_type(self):
        text = read("docs", "receivers.md")
        for name, driver, topic, types, _ in self.rows:
            self.assertIn("`receiver:=`", text)
            self.assertIn("`" + name + "`", text)
            if name == "navsatfix":
                continue
            self.assertIn(driver.split(" ")[0], text)
            row = [line for line in text.splitlines() if "| `" + topic + "` |" in line]
            self.assertEqual(len(row), 1, topic)
            self.assertIn(types.split(", ")[0].replace("TwistWithCovarianceStamped", "Twist"),
                          row[0].replace("TwistWithCovarianceStamped", "Twist"))

    def test_the_launch_file_plays_every_topic(self):
        text = read("launch", "replay.launch")
        for name in {row[0] for row in self.rows} - {"navsatfix"}:
            played = re.search(r"'%s': '(@[^']*)'" % name, text).group(1)
            namespace = re.search(r"\{[^}]*'%s': '([^'@]*)'" % name, text)
            prefix = namespace.group(1) + "/" if namespace else ""
            self.assertEqual([prefix + each.lstrip("@") for each in played.split(" ")],
                             [row[2] for row in self.rows if row[0] == name])

    def test_localization_launch_names_every_receiver(self):
        text = read("launch", "localization.launch")
        for name in {row[0] for row in self.rows}:
            self.assertIn(name, text)


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
@unittest.skipUnless(os.path.exists(TERRACE), "no " + TERRACE + "; set URBAN_GNSS_DATA")
class TerraceTest(unittest.TestCase):
    def test_a_real_bag_of_ublox(self):
        with tempfile.TemporaryDirectory() as folder:
            report = os.path.join(folder, "report.json")
            done = replay(TERRACE, "--receiver", "ublox", "--odom", "none", "--json", report)
            self.assertEqual(done.returncode, 0, done.stderr)
            with open(report, encoding="utf-8") as file:
                metrics = json.load(file)
        counts = metrics["receiver"]
        # 58 messages NavPVT and 57 fixes, as rosbag info lists them; each solution counts once.
        self.assertEqual(counts["fixes"], 58)
        self.assertEqual(counts["velocities"], 58)
        self.assertEqual(counts["satellite_lists"], 3)
        self.assertEqual(counts["fixes_with_satellites"], 3)
        self.assertEqual(counts["fixes_with_residuals"], 3)
        self.assertEqual(counts["unreadable_messages"], 0)
        self.assertIn("constant-velocity model", metrics["odometry"])
        self.assertIn("constant-velocity model", done.stdout)
        self.assertGreater(metrics["estimates"], 300)
        self.assertGreater(metrics["velocities_used"], 30)

    def test_errors_name_what_there_is(self):
        done = replay(TERRACE, "--receiver", "novatel", "--odom", "none")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("/earth_gps/navpvt (ublox_msgs/NavPVT)", done.stderr)
        done = replay(TERRACE, "--receiver", "ublox", "--receiver-ns", "elsewhere", "--odom", "none")
        self.assertIn("elsewhere", done.stderr)
        done = replay(TERRACE, "--receiver", "ubox", "--odom", "none")
        self.assertIn("septentrio", done.stderr)
        done = replay(TERRACE, "--receiver", "ublox")
        self.assertIn("--odom-topic", done.stderr)


if __name__ == "__main__":
    unittest.main()
