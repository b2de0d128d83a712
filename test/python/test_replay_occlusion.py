"""replay --occlusion end to end, on a simulated bag with a small lidar: deterministic, of use, and clear about what is
missing.

URBAN_GNSS_PROGRAMS names the folder of the programs."""
import filecmp
import json
import os
import tempfile
import unittest

import rosbag

from programs import PACKAGE, PROGRAMS, run

SMALL_LIDAR = ("--set", "lidar.points_per_revolution=120", "--set", "lidar.beams=8")
SIMULATOR = ("--occlusion-params", os.path.join(PACKAGE, "config", "occlusion_simulator.yaml"))


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class ReplayOcclusionTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.drive = os.path.join(cls.scratch.name, "drive.bag")
        done = run("simulate", "--scenario", "downtown_grid", "--duration", 30, *SMALL_LIDAR, "--output", cls.drive)
        if done.returncode != 0:
            raise AssertionError(done.stdout)
        cls.report, cls.said = cls.replay("a")

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    @classmethod
    def path(cls, name):
        return os.path.join(cls.scratch.name, name)

    @classmethod
    def replay(cls, name, *arguments, bag=None):
        """The report of a run with occlusion, and what was printed."""
        done = run("replay", bag or cls.drive, "--occlusion", *SIMULATOR, *arguments, "--output",
                   cls.path(name + ".bag"), "--tum", cls.path(name + ".tum"), "--json", cls.path(name + ".json"))
        if done.returncode != 0:
            raise AssertionError(done.stdout)
        with open(cls.path(name + ".json")) as file:
            return json.load(file), done.stdout

    def refuse(self, *arguments, bag=None):
        done = run("replay", bag or self.drive, *arguments)
        self.assertNotEqual(done.returncode, 0, done.stdout)
        return done.stdout

    def of(self, name, topic):
        with rosbag.Bag(self.path(name)) as bag:
            return [message for _, message, _ in bag.read_messages(topic)]

    def changed_bag(self, name, change):
        """The drive with every message as change(topic, message) has it; None leaves it out."""
        with rosbag.Bag(self.drive) as source, rosbag.Bag(self.path(name), "w") as target:
            for topic, message, time in source.read_messages():
                message = change(topic, message)
                if message is not None:
                    target.write(topic, message, time)
        return self.path(name)

    def test_twice_the_same(self):
        self.replay("b")
        for kind in (".bag", ".tum", ".json"):
            self.assertTrue(filecmp.cmp(self.path("a" + kind), self.path("b" + kind), shallow=False), kind)

    def test_every_fix_is_weighed_and_used(self):
        fixes = {m.header.stamp.to_nsec(): m for m in self.of("drive.bag", "/gps/fix")}
        weighted = {m.header.stamp.to_nsec(): m for m in self.of("a.bag", "/gps/fix_weighted")}
        self.assertEqual(sorted(weighted), sorted(fixes))
        with_position = [t for t, m in fixes.items() if m.status.status >= 0]
        self.assertEqual({m.header.stamp.to_nsec() for m in self.of("a.bag", "/gps/visibility")}, set(with_position))
        for t in with_position:
            self.assertGreaterEqual(sum(weighted[t].position_covariance[i] for i in (0, 4)),
                                    0.999 * sum(fixes[t].position_covariance[i] for i in (0, 4)))
            self.assertEqual(weighted[t].latitude, fixes[t].latitude)
        counts = self.report["occlusion"]["fixes"]
        self.assertEqual(counts["weighed"], len(with_position))
        self.assertEqual(counts["without_position"], len(fixes) - len(with_position))
        self.assertEqual(sum(self.report["decisions"].values()), len(fixes))

    def test_counts_are_those_of_the_bags(self):
        report = self.report["occlusion"]
        self.assertEqual(report["clouds"]["received"], len(self.of("drive.bag", "/points")))
        self.assertEqual(report["clouds"]["received"],
                         report["clouds"]["in_map"] + sum(report["clouds"]["left_out"].values()))
        self.assertGreater(report["clouds"]["in_map"], 0.8 * report["clouds"]["received"])  # others did not fit
        visibilities = self.of("a.bag", "/gps/visibility")
        judged = [s.visibility for v in visibilities for s in v.satellites if s.visibility != s.NOT_USED]
        self.assertEqual(report["satellites"]["judged"], len(judged))
        for number, name in ((1, "free"), (2, "blocked"), (3, "unknown")):
            self.assertEqual(report["satellites"][name], judged.count(number), name)
        self.assertGreater(report["satellites"]["blocked"], 50)
        self.assertEqual(report["fixes"]["bad"], sum(not v.good for v in visibilities))
        widened = sum(v.weighted_covariance[0] + v.weighted_covariance[3] >
                      1.001 * (v.claimed_covariance[0] + v.claimed_covariance[3]) for v in visibilities)
        self.assertEqual(report["fixes"]["widened"], widened)
        self.assertGreater(widened, 20)
        for number in (report["clouds"]["in_map"], widened, report["satellites"]["judged"]):
            self.assertIn(str(number), self.said)

    def test_the_map_knows_the_lines_of_sight(self):
        truth = {(m.header.stamp.to_nsec(), p.name): p.line_of_sight
                 for m in self.of("drive.bag", "/ground_truth/signal_paths") for p in m.paths}
        right, count = 0, 0
        for visibility in self.of("a.bag", "/gps/visibility"):
            for satellite in visibility.satellites:
                key = (visibility.header.stamp.to_nsec(), satellite.name)
                if satellite.known_fraction > 0.8 and key in truth:
                    right += (satellite.blocked_fraction < 0.5) == truth[key]
                    count += 1
        self.assertGreater(count, 300)
        self.assertGreater(right, 0.75 * count)

    def test_the_localizer_takes_the_weighed_fixes(self):
        plain = run("replay", self.drive, "--localizer", "ukf", "--tum", self.path("plain.tum"))
        self.assertEqual(plain.returncode, 0, plain.stdout)
        self.replay("ukf", "--localizer", "ukf")
        with open(self.path("plain.tum")) as a, open(self.path("ukf.tum")) as b:
            self.assertNotEqual(a.read(), b.read())

    def test_parameters(self):
        with open(self.path("params.yaml"), "w") as file:
            file.write("occlusion: {model: paper}\nimm_ekf: {gps_lever: 1}\nukf: {outliers: none}\n")
        report, _ = self.replay("c", "--localizer", "ukf", "--params", self.path("params.yaml"))
        self.assertEqual(report["occlusion"]["model"], "paper")
        report, _ = self.replay("c", "--params", self.path("params.yaml"), "--localizer", "ukf", "--set",
                                "occlusion.model=conventional")
        self.assertEqual(report["occlusion"]["model"], "conventional")
        output = self.refuse("--occlusion", "--set", "occlusion.modl=paper", "--set", "occlusion.expert.sky_mask=7")
        self.assertIn("occlusion.modl: no such parameter; did you mean mode?", output)
        self.assertIn("occlusion.expert.sky_mask = 7", output)

    def test_without_tf_of_the_robot_the_odometry_serves(self):
        bag = self.changed_bag("no_tf.bag", lambda topic, message: None if topic == "/tf" else message)
        report, said = self.replay("d", bag=bag)
        self.assertIn("no tf from odom: the odometry's poses are used", said)
        self.assertEqual(report["occlusion"]["clouds"]["in_map"], self.report["occlusion"]["clouds"]["in_map"])
        self.assertNotIn("the odometry's poses are used", self.said)

    def test_the_pose_of_a_recorded_localizer_is_not_taken(self):
        def mislead(topic, message):
            if topic == "/tf":
                wrong = type(message.transforms[0])()
                wrong.header.stamp, wrong.header.frame_id = message.transforms[0].header.stamp, "map"
                wrong.child_frame_id, wrong.transform.rotation.z = "odom", 1.0
                message.transforms.append(wrong)
            return message
        report, _ = self.replay("e", bag=self.changed_bag("misleading.bag", mislead))
        self.assertEqual(report["occlusion"], self.report["occlusion"])

    def test_without_tf_of_the_lidar(self):
        def unmount(topic, message):
            if topic == "/tf_static":
                message.transforms = [t for t in message.transforms if t.child_frame_id != "lidar"]
            return message
        report, said = self.replay("f", bag=self.changed_bag("unmounted.bag", unmount))
        clouds = report["occlusion"]["clouds"]
        self.assertEqual((clouds["in_map"], sum(clouds["left_out"].values())), (0, clouds["received"]))
        self.assertIn("lidar", said)
        self.assertIn("fixes without clouds", said)
        self.assertEqual(report["occlusion"]["fixes"]["with_map"], 0)

    def test_without_satellites(self):
        bag = self.changed_bag("no_sky.bag", lambda topic, message: None if topic == "/gps/satellites" else message)
        report, said = self.replay("g", bag=bag)
        self.assertIn("no topic gps/satellites (--satellites-topic)", said)
        fixes = report["occlusion"]["fixes"]
        self.assertGreater(fixes["with_map"], 0)
        self.assertEqual(sum(n for what, n in fixes["missing"].items() if "satellites" in what), fixes["weighed"])

    def test_bad_clouds_are_counted_by_their_reason(self):
        count = 0

        def spoil(topic, message):
            nonlocal count
            if topic == "/points":
                count += 1
                if count % 3 == 0:
                    message.fields = message.fields[:2]
                elif count % 3 == 1:
                    message.data = message.data[:100]
            return message
        report, said = self.replay("h", bag=self.changed_bag("spoilt.bag", spoil))
        left_out = report["occlusion"]["clouds"]["left_out"]
        self.assertGreater(left_out["no field z"], 50)
        self.assertGreater(left_out["less data than width, height and row_step say"], 50)
        self.assertGreater(report["occlusion"]["clouds"]["in_map"], 50)
        self.assertIn("no field z", said)

    def test_refuses(self):
        output = self.refuse("--occlusion", "--points-topic", "velodyne_points")
        self.assertIn("no sensor_msgs/PointCloud2 on velodyne_points (--points-topic)", output)
        self.assertIn("it has them on /points", output)
        self.assertIn("no sensor_msgs/PointCloud2 on odom", self.refuse("--occlusion", "--points-topic", "odom"))
        without = self.changed_bag("no_points.bag", lambda topic, message: None if topic == "/points" else message)
        self.assertIn("it has none on any topic", self.refuse("--occlusion", bag=without))
        self.assertIn("--occlusion needs odometry", self.refuse("--occlusion", "--odom", "none"))
        self.assertIn("weighed already", self.refuse("--occlusion", "--fix-topic", "/gps/fix_weighted"))
        self.assertIn("--occlusion", self.refuse("--points-topic", "points"))
        self.assertIn("no_such.yaml", self.refuse("--occlusion", "--occlusion-params", self.path("no_such.yaml")))


if __name__ == "__main__":
    unittest.main()
