"""The program `doctor` on bags that are written here, good and spoilt ones, and on what is no bag."""
import json
import os
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import spoil_bag  # noqa: E402
from doctor_drive import drive, write_bag  # noqa: E402

PROGRAM = os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..", "doctor", "doctor")


class ProgramTest(unittest.TestCase):
    """The program on bags that are written here."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.bag = os.path.join(cls.folder.name, "drive.bag")
        write_bag(cls.bag, drive(seconds=90.0, parts=("odometry", "fix", "imu", "velocity")))

    def run_doctor(self, *arguments):
        return subprocess.run([sys.executable, "-B", PROGRAM] + list(arguments), stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, universal_newlines=True, timeout=60, cwd=self.folder.name)

    def test_a_good_bag(self):
        done = self.run_doctor("drive.bag", "--json", "a.json", "--html", "a.html")
        self.assertEqual(0, done.returncode, done.stdout + done.stderr)
        self.assertIn("odometry:   /odom (its usual name)", done.stdout)
        self.assertTrue(done.stdout.splitlines()[-1].startswith("summary: 0 FAIL"))
        with open(os.path.join(self.folder.name, "a.json"), encoding="utf-8") as stream_of:
            self.assertEqual(0, json.load(stream_of)["exit_code"])
        self.assertGreater(os.path.getsize(os.path.join(self.folder.name, "a.html")), 10000)

    def test_spoilt_bags(self):
        for fault, words in (("speed_kmh", "km/h"), ("imu_ned", "NED"), ("velocity_in_body", "robot's own frame")):
            path = os.path.join(self.folder.name, fault + ".bag")
            spoil_bag.spoil(fault, self.bag, path)
            done = self.run_doctor(path, "--quiet")
            self.assertEqual(1, done.returncode, fault + done.stdout + done.stderr)
            self.assertIn(words, done.stdout, fault)

    def test_what_cannot_be_read(self):
        with open(self.bag, "rb") as whole:
            content = whole.read()
        for name, data, words in (("cut.bag", content[:len(content) // 2], "rosbag reindex"),
                                  ("text.bag", b"text", "no bag"),
                                  ("empty.bag", b"", "empty"), ("missing.bag", None, "No such file")):
            if data is not None:
                with open(os.path.join(self.folder.name, name), "wb") as target:
                    target.write(data)
            done = self.run_doctor(name)
            self.assertEqual(2, done.returncode, done.stdout)
            self.assertIn(words, done.stderr)
            self.assertNotIn("Traceback", done.stderr)

    def test_usage(self):
        for arguments in ((), ("--live", "drive.bag"), ("drive.bag", "--params", "missing.yaml"),
                          ("drive.bag", "--json", "missing/a.json"), ("--live", "--seconds", "0")):
            done = self.run_doctor(*arguments)
            self.assertEqual(2, done.returncode, arguments)
            self.assertNotIn("Traceback", done.stderr)

    def test_params_that_no_node_would_take(self):
        """As the nodes and replay read them: values, names, sections, and what stands in none."""
        for text, words in (("imm_ekf: {fix_sigma_default: -4.0}", "fix_sigma_default = -4: must be"),
                            ("occlusion: {antenna_ofset: [0, 0, 1]}", "did you mean antenna_offset"),
                            ("imm_ekf: {antenna_offset: 3}", "imm_ekf.antenna_offset"),
                            ("robot1: {ukf: {odom_frame: [1]}}", "robot1/ukf.odom_frame"),
                            ("im_ekf: {}", "did you mean imm_ekf?"), ("antenna_offset: [1, 2]", "outside of a section"),
                            ("imm_ekf:", "imm_ekf is empty"), ("[1]", "must be a map"), ("a: [", "p.yaml"),
                            (b"imm_ekf: {map_frame: \xff\xfe}", "p.yaml")):
            with open(os.path.join(self.folder.name, "p.yaml"), "wb") as stream_of:
                stream_of.write(text if isinstance(text, bytes) else text.encode())
            done = self.run_doctor("drive.bag", "--params", "p.yaml")
            self.assertEqual(2, done.returncode, done.stdout)
            self.assertIn(words, done.stderr)
            self.assertTrue(done.stderr.startswith("doctor: p.yaml"), done.stderr)
            self.assertNotIn("Traceback", done.stderr)

    def test_params_without_a_section(self):
        with open(os.path.join(self.folder.name, "p.yaml"), "w", encoding="utf-8") as stream_of:
            stream_of.write("my_driver: {rate: 5}")
        done = self.run_doctor("drive.bag", "--params", "p.yaml")
        self.assertEqual(0, done.returncode, done.stdout + done.stderr)
        self.assertIn("has no section imm_ekf, but my_driver", done.stderr)
        for text in ("", "robot1: {imm_ekf: }", "imm_ekf: {map_frame: 1}", "my_driver: {receiver: {port: 3}}"):
            with open(os.path.join(self.folder.name, "p.yaml"), "w", encoding="utf-8") as stream_of:
                stream_of.write(text)
            done = self.run_doctor("drive.bag", "--params", "p.yaml")
            self.assertEqual(0, done.returncode, done.stdout + done.stderr)

    def test_a_bag_without_fixes_says_so_in_its_last_line(self):
        for parts, words in ((("odometry", "imu"), "; no fixes in it"), (("fix", "velocity"), "; no odometry in it"),
                             (("imu",), "; no odometry and no fixes in it")):
            write_bag(os.path.join(self.folder.name, "part.bag"), drive(seconds=20.0, parts=parts))
            done = self.run_doctor("part.bag", "--quiet")
            self.assertEqual(0, done.returncode, done.stdout)
            self.assertTrue(done.stdout.splitlines()[-1].endswith(words), done.stdout)

    def test_topics_that_are_asked_for(self):
        done = self.run_doctor("drive.bag", "--fix-topic", "other", "--odom-topic", "/imu/data")
        self.assertEqual(1, done.returncode)
        self.assertIn("other was asked for and is not there", done.stdout)
        self.assertIn("/imu/data has the type sensor_msgs/Imu, not nav_msgs/Odometry", done.stdout)


if __name__ == "__main__":
    unittest.main()
