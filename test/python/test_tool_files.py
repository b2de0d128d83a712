"""The files of the command-line programs: none writes over what it reads, an output appears whole or not at all, and a
damaged bag is an error that says what to do.

URBAN_GNSS_PROGRAMS names the folder of the programs."""
import hashlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import rosbag
import rospy
from std_msgs.msg import String

import test_tools

sys.path.insert(0, os.path.join(test_tools.PACKAGE, "dev"))
sys.path.insert(0, os.path.join(test_tools.PACKAGE, "reports"))
import damage_inputs  # noqa: E402
import whole_file  # noqa: E402

PROGRAMS = test_tools.PROGRAMS
DOCTOR = os.path.join(test_tools.PACKAGE, "doctor", "doctor")


def content(path):
    """A file's bytes."""
    with open(path, "rb") as stream:
        return stream.read()


def digest(path):
    """Of a file's bytes."""
    return hashlib.sha1(content(path)).hexdigest()


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class FilesTest(unittest.TestCase):
    """With all inputs in a folder of the class, copied for each test."""

    @classmethod
    def setUpClass(cls):
        cls.sources = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.sources.cleanup)
        damage_inputs.write_all(cls.sources.name)

    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = os.path.join(scratch.name, "in")
        shutil.copytree(self.sources.name, self.folder)

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def run_tool(self, program, *arguments, **options):
        command = [sys.executable, "-B", DOCTOR] if program == "doctor" else [os.path.join(PROGRAMS, program)]
        environment = dict(os.environ)
        environment["ROS_PACKAGE_PATH"] = test_tools.PACKAGE + ":" + environment.get("ROS_PACKAGE_PATH", "")
        return subprocess.run(command + list(map(str, arguments)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              universal_newlines=True, env=environment, timeout=120, cwd=self.folder, **options)

    def expect_refusal(self, text, program, *arguments, **options):
        done = self.run_tool(program, *arguments, **options)
        self.assertGreater(done.returncode, 0, (program, arguments, done.stdout))
        self.assertIn(text, done.stdout, (program, arguments))
        self.assertNotIn("Traceback", done.stdout)
        self.assertEqual([name for name in os.listdir(self.folder) if ".part-" in name], [])
        return done.stdout

    def succeed(self, program, *arguments, **options):
        done = self.run_tool(program, *arguments, **options)
        self.assertEqual(done.returncode, 0, done.stdout)
        return done.stdout


class InputsTest(FilesTest):
    """No program writes over what it reads."""

    def expect_kept(self, source, program, *arguments):
        """The program refuses, and the file is as it was."""
        before = digest(self.path(source))
        self.expect_refusal("is not written, for it is the file that is read", program, *arguments)
        self.assertEqual(digest(self.path(source)), before)

    def test_replay(self):
        bag = "drive_none.bag"
        for option in ("--output", "--json", "--tum"):
            self.expect_kept(bag, "replay", bag, option, bag)
            self.expect_kept("params.yaml", "replay", bag, "--params", "params.yaml", option, "./params.yaml")
        self.expect_kept("log.nmea", "replay", "--nmea", "log.nmea", "--odom", "none", "--json", "log.nmea")
        robots = os.path.join(test_tools.PACKAGE, "config", "robots")
        self.expect_refusal("is not written", "replay", bag, "--robot", "car", "--tum",
                            os.path.join(robots, sorted(os.listdir(robots))[0]))

    def test_links_and_other_ways(self):
        bag = "drive_none.bag"
        os.symlink(bag, self.path("symbolic.bag"))
        os.link(self.path(bag), self.path("hard.bag"))
        os.symlink(self.folder, self.path("here"))
        for name in ("symbolic.bag", "hard.bag", self.path(bag), "here/here/" + bag, "../in/" + bag):
            self.expect_kept(bag, "replay", bag, "--output", name)
            self.expect_kept(bag, "replay", name, "--json", bag)

    def test_two_outputs(self):
        text = "another option writes this file"
        self.expect_refusal(text, "replay", "drive_none.bag", "--json", "x", "--tum", "./x")
        self.expect_refusal(text, "doctor", "drive_none.bag", "--json", "x", "--html", "./x")

    def test_csv_to_bag(self):
        for name in ("odom.csv", "gnss.csv", "meta.json", "imu.csv"):
            self.expect_kept(name, "csv_to_bag", ".", name)

    def test_simulate(self):
        for name in ("city.yaml", "blocks.csv", "track.csv", "sky.alm"):
            for option in ("--output", "--json"):
                self.expect_kept(name, "simulate", "--scenario", "city.yaml", "--duration", 1, option, name)

    def test_experiments(self):
        scenario = ("--scenarios", "city.yaml", "--seeds", 1, "--json", "city.yaml")
        for program in ("bias_experiment", "localizer_experiment", "occlusion_experiment"):
            self.expect_kept("city.yaml", program, *scenario)
        shutil.copytree(os.path.join(test_tools.PACKAGE, "config", "paper_field"), self.path("field"))
        name = os.path.join("field", "simulator.yaml")
        self.expect_kept(name, "paper_experiment", "--config", "field", "--seeds", 1, "--json", name)

    def test_evaluate(self):
        os.mkdir(self.path("report"))
        os.symlink(self.path("drive_none.bag"), self.path("report", "metrics.json"))
        self.expect_kept("drive_none.bag", "evaluate", "drive_none.bag", "--estimate-topic", "/odom", "--output",
                         "report", "--no-plots")

    def test_check_visibility(self):
        for name in ("wall_ascii.pcd", "table.csv"):
            self.expect_kept(name, "check_visibility", "--map", "wall_ascii.pcd", "--table", "table.csv", "--json",
                             name)

    def test_doctor(self):
        for option in ("--json", "--html"):
            self.expect_kept("drive_none.bag", "doctor", "drive_none.bag", option, "drive_none.bag")
            self.expect_kept("params.yaml", "doctor", "drive_none.bag", "--params", "params.yaml", option,
                             "params.yaml")

    def test_a_link_to_another_file_is_followed(self):
        os.symlink("target.tum", self.path("link.tum"))
        self.succeed("replay", "drive_none.bag", "--tum", "link.tum")
        self.assertTrue(os.path.islink(self.path("link.tum")))
        self.assertGreater(os.path.getsize(self.path("target.tum")), 1000)


class WholeTest(FilesTest):
    """An output appears whole or not at all."""

    def test_disk_full(self):
        """The limit on the size of a file stands for the disk's."""
        def limited():
            resource.setrlimit(resource.RLIMIT_FSIZE, (12000, 12000))
        for arguments in (("replay", "drive_none.bag", "--output", "out"), ("replay", "drive_bz2.bag", "--tum", "out"),
                          ("csv_to_bag", ".", "out"),
                          ("simulate", "--scenario", "city.yaml", "--duration", 3, "--output", "out")):
            with open(self.path("out"), "w") as stream:
                stream.write("older")
            text = self.expect_refusal("out: could not be written in full: File too large", *arguments,
                                       preexec_fn=limited)
            self.assertNotIn("terminate called", text)
            self.assertEqual(content(self.path("out")), b"older", arguments)
        self.expect_refusal("No space left on device", "replay", "drive_none.bag", "--tum", "/dev/full")
        self.expect_refusal("No space left on device", "doctor", "drive_none.bag", "--html", "/dev/full")

    def test_a_run_that_fails_half_way(self):
        """Leaves the older whole bag."""
        with rosbag.Bag(self.path("drive_none.bag")) as whole, rosbag.Bag(self.path("wrong.bag"), "w") as wrong:
            for k, (topic, message, stamp) in enumerate(whole.read_messages()):
                wrong.write(topic, message, stamp)
                if k == whole.get_message_count() // 2:
                    wrong.write("/gps/velocity", String("x"), stamp)
        self.succeed("replay", "drive_none.bag", "--output", "out.bag", "--tum", "out.tum")
        before = [digest(self.path(name)) for name in ("out.bag", "out.tum")]
        self.expect_refusal("/gps/velocity", "replay", "wrong.bag", "--output", "out.bag", "--tum", "out.tum")
        self.assertEqual([digest(self.path(name)) for name in ("out.bag", "out.tum")], before)
        self.expect_refusal("wrong.bag", "replay", "wrong.bag", "--output", "new.bag", "--tum", "new.tum")
        self.assertFalse(os.path.exists(self.path("new.bag")) or os.path.exists(self.path("new.tum")))

    def test_each_bag_for_itself(self):
        """With --jobs, what each bag gives alone; a bag that fails does not stop the others."""
        self.succeed("replay", "drive_none.bag", "--json", "one.json", "--tum", "one.tum", "--output", "one.bag")
        shutil.copy(self.path("drive_none.bag"), self.path("again.bag"))
        with open(self.path("broken.bag"), "w") as file:
            file.write("no bag")
        text = self.expect_refusal("broken.bag: is no bag", "replay", "drive_none.bag", "broken.bag", "again.bag", "--jobs",
                                   "2", "--json", "night", "--tum", "night", "--output", "night")
        self.assertIn("1 of 3 bags failed", text)
        self.assertEqual(sorted(os.listdir(self.path("night"))),
                         sorted(stem + "." + kind for stem in ("drive_none", "again") for kind in ("bag", "json", "tum")))
        for kind in ("bag", "tum"):
            for stem in ("drive_none", "again"):
                self.assertEqual(content(self.path("night", stem + "." + kind)), content(self.path("one." + kind)), kind)
        with open(self.path("night", "again.json")) as night, open(self.path("one.json")) as one:
            again, alone = json.load(night), json.load(one)
        self.assertEqual(again.pop("bag"), "again.bag")
        alone.pop("bag")
        self.assertEqual(again, alone)

    def test_each_bag_has_results_of_its_own(self):
        os.mkdir(self.path("other"))
        shutil.copy(self.path("drive_none.bag"), self.path("other", "drive_none.bag"))
        self.expect_refusal("two bags are named drive_none", "replay", "drive_none.bag", "other/drive_none.bag", "--jobs", "2",
                            "--json", "night")
        self.expect_refusal("is the file that is read", "replay", "drive_none.bag", "--jobs", "1", "--output", ".")

    def test_a_signal(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            process = subprocess.Popen([os.path.join(PROGRAMS, "simulate"), "--scenario", "downtown_grid", "--output",
                                        self.path("long.bag")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            end = time.monotonic() + 30.0
            while not any(name.startswith("long.bag.part-") for name in os.listdir(self.folder)):
                self.assertLess(time.monotonic(), end)
                time.sleep(0.01)
            process.send_signal(number)
            self.assertEqual(process.wait(30), -number)
            self.assertEqual([name for name in os.listdir(self.folder) if "long" in name], [])

    def test_evaluate_says_what_a_cut_off_estimate_covers(self):
        with rosbag.Bag(self.path("drive_none.bag")) as whole, rosbag.Bag(self.path("half.bag"), "w") as half:
            for topic, message, stamp in whole.read_messages("/odom"):
                if stamp.to_sec() < damage_inputs.T0 + 12.0:
                    half.write(topic, message, stamp)
        text = self.succeed("evaluate", "half.bag", "--truth", "drive_none.bag", "--estimate-topic", "/odom",
                            "--output", "report", "--no-plots")
        self.assertIn("ends 13.0 s before the truth, which has 24.9 s", text)
        text = self.succeed("evaluate", "drive_none.bag", "--estimate-topic", "/odom", "--output", "report",
                            "--no-plots")
        self.assertNotIn("before the truth", text)

    def test_what_cannot_be_written(self):
        os.mkdir(self.path("folder"))
        self.expect_refusal("folder: cannot be written: Is a directory", "replay", "drive_none.bag", "--json", "folder")
        self.expect_refusal("its folder cannot be made", "replay", "drive_none.bag", "--json", "table.csv/x")
        self.expect_refusal("its folder cannot be made", "evaluate", "drive_none.bag", "--estimate-topic", "/odom",
                            "--output", "table.csv")

    def test_python(self):
        path = self.path("x.json")
        whole_file.write_whole(path, "{}")
        with self.assertRaises(ValueError):
            with whole_file.whole_file(path) as stream:
                stream.write("half")
                raise ValueError
        self.assertEqual(content(path), b"{}")
        with self.assertRaisesRegex(whole_file.NotWritten, "x.json: is not written"):
            whole_file.write_whole(path, "new", [self.path("absent"), path])
        with self.assertRaisesRegex(whole_file.NotWritten, "/dev/full: could not be written: No space left"):
            whole_file.write_whole("/dev/full", "new")
        self.assertEqual([name for name in os.listdir(self.folder) if ".part-" in name], [])


class BagTest(FilesTest):
    """Bags as people have them."""

    def write(self, name, data):
        with open(self.path(name), "wb") as stream:
            stream.write(data)

    def test_what_is_no_whole_bag(self):
        data = content(self.path("drive_none.bag"))
        unindexed = data.replace(b"index_pos=" + data.split(b"index_pos=")[1][:8], b"index_pos=" + bytes(8), 1)
        os.mkdir(self.path("folder.bag"))
        for name, damaged, text in (("cut.bag", data[:len(data) // 2], "rosbag reindex cut.bag"),
                                    ("unindexed.bag", unindexed, "was not ended: rosbag reindex unindexed.bag"),
                                    ("text.bag", b"stamp,lat,lon\n", "text.bag: is no bag"),
                                    ("empty.bag", b"", "empty.bag: is empty"),
                                    ("old.bag", b"#ROSBAG V1.2\n" + data[13:], "rosbag reindex old.bag"),
                                    ("folder.bag", None, "folder.bag"), ("absent.bag", None, "absent.bag")):
            if damaged is not None:
                self.write(name, damaged)
            self.expect_refusal(text, "replay", name)
            self.expect_refusal(name, "evaluate", name, "--output", "report")
            self.expect_refusal(name, "evaluate", "drive_none.bag", "--truth", name, "--output", "report")

    def test_every_length_in_the_bag(self):
        """Each word that may be a length or a place is made huge."""
        data = content(self.path("drive_bz2.bag"))
        places = [k for k in range(0, len(data) - 4)
                  if data[k + 2:k + 4] == b"\x00\x00" and data[k:k + 2] != b"\x00\x00"]
        for k in places[::max(1, len(places) // 60)]:
            for word in (b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f"):
                self.write("damaged.bag", data[:k] + word + data[k + 4:])
                done = self.run_tool("replay", "damaged.bag")
                self.assertIn(done.returncode, (0, 1), (k, done.stdout))
                if done.returncode == 1 and "no estimate" not in done.stdout:
                    self.assertIn("damaged.bag", done.stdout.splitlines()[-1], k)

    def test_parts_of_one_recording(self):
        with rosbag.Bag(self.path("drive_none.bag")) as whole, rosbag.Bag(self.path("a.bag"), "w") as a, \
                rosbag.Bag(self.path("b.bag"), "w", compression="lz4") as b:
            for topic, message, stamp in whole.read_messages():
                (a if stamp < rospy.Time.from_sec(damage_inputs.T0 + 11.05) else b).write(topic, message, stamp)
        self.succeed("replay", "drive_none.bag", "--tum", "whole.tum", "--json", "whole.json")
        for name, bags in (("ab", ("a.bag", "b.bag")), ("ba", ("b.bag", "a.bag"))):
            self.succeed("replay", *bags, "--tum", name + ".tum", "--json", name + ".json")
            self.assertEqual(content(self.path(name + ".tum")), content(self.path("whole.tum")))
        with open(self.path("ab.json")) as stream:
            self.assertEqual(json.load(stream)["bag"], "a.bag, b.bag")

    def test_reasons_are_said_once(self):
        """Of a bag whose fixes are none."""
        with rosbag.Bag(self.path("drive_none.bag")) as whole, rosbag.Bag(self.path("none.bag"), "w") as none:
            for topic, message, stamp in whole.read_messages():
                if topic == "/gps/fix":
                    message.status.status = -1
                none.write(topic, message, stamp)
        done = self.run_tool("replay", "none.bag")
        self.assertEqual(done.returncode, 1)
        lines = [line for line in done.stdout.replace("\r", "\n").splitlines() if "messages" not in line]
        self.assertLess(len(lines), 20, done.stdout)
        self.assertRegex(done.stdout, r"\n  \d+ times rejected_\w+: \w+")
        self.assertRegex(lines[-1], r"no estimate: still waiting for \w+.*\w+")


class MemoryTest(FilesTest):
    """The memory of replay does not grow with the bag."""

    def write_long(self, name, laps):
        """Odometry and fixes without end, and no truth."""
        with rosbag.Bag(self.path("drive_none.bag")) as bag, rosbag.Bag(self.path(name), "w") as long:
            messages = [entry for entry in bag.read_messages() if "truth" not in entry[0]]
            for lap in range(laps):
                shift = rospy.Duration(lap * damage_inputs.SECONDS)
                for topic, message, stamp in messages:
                    if topic != "/tf_static":
                        message.header.stamp += rospy.Duration(damage_inputs.SECONDS if lap else 0)
                        long.write(topic, message, stamp + shift)

    def peak_kb(self, name):
        """Of one run with every output that grows."""
        process = subprocess.Popen([os.path.join(PROGRAMS, "replay"), self.path(name), "--output", self.path("o.bag"),
                                    "--tum", self.path("o.tum")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = status
        self.assertEqual(status, 0)
        return usage.ru_maxrss

    def test_long_bags(self):
        self.write_long("short.bag", 8)
        self.write_long("long.bag", 64)
        short, long = self.peak_kb("short.bag"), self.peak_kb("long.bag")
        self.assertLess(long - short, 4000, "{} and {} kB".format(short, long))


if __name__ == "__main__":
    unittest.main()
