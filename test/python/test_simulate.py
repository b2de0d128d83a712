"""The program simulate end to end: what the bag of a scenario holds, that it depends on scenario and seed alone, and what
is refused.

URBAN_GNSS_PROGRAMS names the folder of the programs."""
import filecmp
import json
import math
import os
import re
import tempfile
import unittest

import rosbag
import sensor_msgs.point_cloud2 as point_cloud2
from sensor_msgs.msg import NavSatFix, NavSatStatus

import programs
from programs import PROGRAMS

SENSORS = {"/odom": "nav_msgs/Odometry", "/imu/data": "sensor_msgs/Imu", "/gps/fix": "sensor_msgs/NavSatFix",
           "/gps/velocity": "geometry_msgs/TwistWithCovarianceStamped",
           "/gps/satellites": "urban_gnss_localization/SatelliteArray", "/points": "sensor_msgs/PointCloud2",
           "/gps/datum": "sensor_msgs/NavSatFix", "/tf": "tf2_msgs/TFMessage", "/tf_static": "tf2_msgs/TFMessage"}
TRUTH = {"/ground_truth/odom": "nav_msgs/Odometry", "/ground_truth/gps_error": "geometry_msgs/Vector3Stamped",
         "/ground_truth/signal_paths": "urban_gnss_localization/SignalPathArray"}
SMALL_LIDAR = ["--set", "lidar.points_per_revolution=60", "--set", "lidar.beams=4"]


def run(*arguments):
    return programs.run("simulate", *arguments)


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class SimulateTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = scratch.name

    def path(self, *names):
        return os.path.join(self.directory, *names)

    def succeed(self, *arguments):
        done = run(*arguments)
        self.assertEqual(done.returncode, 0, done.stdout)
        return done.stdout

    def refuse(self, *arguments):
        done = run(*arguments)
        self.assertEqual(done.returncode, 1, done.stdout)
        return done.stdout

    def messages(self, name, *topics):
        with rosbag.Bag(self.path(name)) as bag:
            return [(topic, message, time) for topic, message, time in bag.read_messages(topics or None)]

    def of(self, name, topic):
        return [message for _, message, _ in self.messages(name, topic)]

    def test_the_bag_is_whole_for_rosbag(self):
        """Its index finds what its chunks hold, of any topic and time; rosbag writes the same messages out of it."""
        self.succeed("--scenario", "open_sky", "--duration", "20", "--without-lidar", "--output", self.path("drive.bag"))
        with rosbag.Bag(self.path("drive.bag")) as bag:
            everything = [(topic, data[1], time) for topic, data, time in bag.read_messages(raw=True)]
            self.assertGreater(len(bag._chunks), 1)
            self.assertEqual(bag.get_message_count(), len(everything))
            times = [time for _, _, time in everything]
            self.assertEqual((bag.get_start_time(), bag.get_end_time()), (min(times).to_sec(), max(times).to_sec()))
            middle = times[len(times) // 2]
            found = [(topic, time) for topic, _, time in bag.read_messages(["/gps/fix", "/tf"], start_time=middle)]
            self.assertEqual(found, [(topic, time) for topic, _, time in everything
                                     if topic in ("/gps/fix", "/tf") and time >= middle])
            with rosbag.Bag(self.path("copy.bag"), "w") as copy:
                for topic, message, time in bag.read_messages(raw=True):
                    copy.write(topic, message, time, raw=True)
        with rosbag.Bag(self.path("copy.bag")) as copy:
            self.assertEqual([(topic, data[1], time) for topic, data, time in copy.read_messages(raw=True)], everything)

    def test_same_scenario_and_seed_give_the_same_bag(self):
        def simulate(name, *arguments):
            self.succeed("--scenario", "downtown_grid", "--duration", 3, *SMALL_LIDAR, "--output", self.path(name),
                         *arguments)
        simulate("a.bag")
        simulate("b.bag")
        simulate("one.bag", "--seed", 1)
        simulate("two.bag", "--seed", 2)
        self.assertTrue(filecmp.cmp(self.path("a.bag"), self.path("b.bag"), shallow=False))
        self.assertTrue(filecmp.cmp(self.path("a.bag"), self.path("one.bag"), shallow=False), "1 is the file's own")
        self.assertFalse(filecmp.cmp(self.path("a.bag"), self.path("two.bag"), shallow=False))

    def test_bag_holds_every_sensor_and_the_truth_apart(self):
        self.succeed("--scenario", "downtown_grid", "--duration", 5, *SMALL_LIDAR, "--output", self.path("a.bag"))
        with rosbag.Bag(self.path("a.bag")) as bag:
            topics = {name: topic.msg_type for name, topic in bag.get_type_and_topic_info().topics.items()}
        self.assertEqual(topics, {**SENSORS, **TRUTH})

        last = {}
        times = []
        for topic, message, time in self.messages("a.bag"):
            times.append(time)
            if not hasattr(message, "header"):
                continue
            stamp = message.header.stamp
            if topic in last and topic != "/gps/datum":
                self.assertGreater(stamp, last[topic], topic)
            last[topic] = stamp
            late = (time - stamp).to_sec()
            if topic in ("/gps/fix", "/gps/velocity", "/gps/satellites") or topic in list(TRUTH)[1:]:
                self.assertGreaterEqual(late, 0.05, topic)
                self.assertLess(late, 0.2001, topic)
            elif topic != "/points":  # cast within the step at whose end it is published
                self.assertLess(late, 1e-6, topic)
        self.assertTrue(all(a < b for a, b in zip(times, times[1:])), "the order of a bag's messages must be defined")

        for odom in self.of("a.bag", "/odom"):
            self.assertEqual((odom.header.frame_id, odom.child_frame_id), ("odom", "base_link"))
            self.assertGreater(odom.twist.covariance[0], 0.0)
            self.assertGreater(odom.twist.covariance[35], 0.0)
        for imu in self.of("a.bag", "/imu/data"):
            self.assertGreaterEqual(imu.orientation_covariance[0], 0.0)  # it has an orientation
            self.assertGreater(imu.angular_velocity_covariance[8], 0.0)
            self.assertAlmostEqual(imu.linear_acceleration.z, 9.8, delta=0.5)
        for truth in self.of("a.bag", "/ground_truth/odom"):
            self.assertEqual(truth.header.frame_id, "map")
        datum = self.of("a.bag", "/gps/datum")[0]
        self.assertEqual((datum.latitude, datum.longitude, datum.altitude), (22.2988, 114.1722, 5.0))

    def test_says_early_how_large_the_bag_will_be(self):
        for arguments in (SMALL_LIDAR, ("--without-lidar",)):
            said = self.succeed("--scenario", "downtown_grid", "--duration", 60, *arguments, "--output",
                                self.path("a.bag"))
            forecast = re.search(r"a\.bag: will have about (\d+) MB(.*)", said)
            self.assertTrue(forecast, said)
            self.assertLess(said.index("will have about"), said.index("20.0 %"), "while there is time to end it")
            self.assertAlmostEqual(float(forecast.group(1)) / (1e-6 * os.path.getsize(self.path("a.bag"))), 1.0,
                                   delta=0.4)
            self.assertEqual("--without-lidar" in forecast.group(2), "--without-lidar" not in arguments)

    def test_points_are_in_the_sensors_frame(self):
        self.succeed("--scenario", "downtown_grid", "--duration", 1, *SMALL_LIDAR, "--set", "lidar.mount_z=2.1",
                     "--output", self.path("a.bag"))
        mounting = {t.child_frame_id: t for t in self.of("a.bag", "/tf_static")[0].transforms}
        self.assertEqual(set(mounting), {"gps", "lidar", "imu_link"})
        self.assertEqual({t.header.frame_id for t in mounting.values()}, {"base_link"})
        self.assertEqual(mounting["lidar"].transform.translation.z, 2.1)
        clouds = self.of("a.bag", "/points")
        self.assertGreater(len(clouds), 5)
        for cloud in clouds:
            self.assertEqual(cloud.header.frame_id, "lidar")
            self.assertEqual([field.name for field in cloud.fields], ["x", "y", "z", "intensity", "ring"])
            points = list(point_cloud2.read_points(cloud))
            self.assertEqual(len(points), cloud.width * cloud.height)
            self.assertGreater(len(points), 50)
            self.assertTrue(all(0 <= point[4] < 4 for point in points))
            lowest = min(point[2] for point in points)
            self.assertAlmostEqual(lowest, -2.1, delta=0.2)  # the ground

    def test_satellites_are_rounded_and_their_truth_is_not(self):
        self.succeed("--scenario", "downtown_grid", "--duration", 10, "--without-lidar", "--output", self.path("a.bag"))
        arrays = self.of("a.bag", "/gps/satellites")
        self.assertGreater(len(arrays), 40)
        used = 0
        for array in arrays:
            self.assertAlmostEqual(array.angle_resolution, math.radians(1.0), places=6)
            for satellite in array.satellites:
                self.assertGreaterEqual(satellite.azimuth, 0.0)
                self.assertLess(satellite.azimuth, 2.0 * math.pi)
                for angle in (satellite.azimuth, satellite.elevation):
                    self.assertAlmostEqual(math.degrees(angle), round(math.degrees(angle)), places=4)
                self.assertEqual(math.isnan(satellite.cn0), not satellite.tracked)
                used += satellite.used
        self.assertGreater(used, 100)
        paths = [path for array in self.of("a.bag", "/ground_truth/signal_paths") for path in array.paths]
        self.assertGreater(len({path.path_class for path in paths}), 2)
        self.assertTrue(all(0.0 <= path.azimuth < 2.0 * math.pi for path in paths))
        self.assertTrue(any(abs(math.degrees(p.azimuth) - round(math.degrees(p.azimuth))) > 0.1 for p in paths))
        for path in paths:
            self.assertEqual(path.path_class == path.BLOCKED, math.isnan(path.cn0))

    def test_faults_of_the_receiver_are_in_the_bag_at_their_times(self):
        self.succeed("--scenario", "faulty_receiver", "--duration", 360, "--output", self.path("a.bag"))
        datum = self.of("a.bag", "/gps/datum")[0]
        start = datum.header.stamp
        east_scale = 111320.0 * math.cos(math.radians(datum.latitude))
        own, second = {}, {}
        for fix in self.of("a.bag", "/gps/fix"):
            (own if fix.header.frame_id == "gps" else second)[round((fix.header.stamp - start).to_sec(), 3)] = fix
        errors = {round((e.header.stamp - start).to_sec(), 3): e.vector for e in self.of("a.bag",
                                                                                       "/ground_truth/gps_error")}

        def between(values, low, high):
            return [value for t, value in sorted(values.items()) if low <= t < high]

        def horizontal(low, high):
            return [math.hypot(e.x, e.y) for e in between(errors, low, high)]

        quiet = horizontal(10.0, 60.0) + horizontal(70.0, 100.0) + horizontal(265.0, 290.0) + horizontal(320.0, 360.0)
        self.assertLess(max(quiet), 8.0)
        spikes = [e for e in horizontal(60.0, 70.0) if e > 150.0]  # 170 m
        self.assertTrue(1 <= len(spikes) <= 15, spikes)
        blackout = between(own, 100.0, 120.0)
        self.assertEqual(len(blackout), 100)
        self.assertEqual({fix.status.status for fix in blackout}, {NavSatStatus.STATUS_NO_FIX})
        self.assertTrue(all(math.isnan(fix.latitude) for fix in blackout))
        self.assertEqual(between(errors, 100.0, 120.0), [])
        decoy = between(errors, 120.0, 128.0)
        self.assertEqual(len(decoy), 40)
        for error in decoy:
            self.assertLess(math.hypot(error.x + 40.0, error.y - 25.0), 8.0)
        self.assertGreater(min(horizontal(229.0, 230.0)), 8.0)  # 60 s at 0.22 m/s
        self.assertLess(max(horizontal(230.0, 232.0)), 8.0)
        self.assertEqual(len({(fix.latitude, fix.longitude) for fix in between(own, 260.0, 265.0)}), 1)
        self.assertEqual(len({(fix.latitude, fix.longitude) for fix in between(own, 255.0, 260.0)}), 25)
        unhealthy = between(own, 290.0, 295.0)
        self.assertEqual({fix.status.status for fix in unhealthy}, {NavSatStatus.STATUS_FIX})
        self.assertTrue(3 <= sum(math.isnan(fix.latitude) for fix in unhealthy) <= 22)
        self.assertEqual({fix.header.frame_id for fix in second.values()}, {"gps_1"})
        self.assertEqual(sorted(second), [t for t in sorted(own) if 320.0 <= t < 350.0])
        for t, fix in second.items():
            self.assertAlmostEqual((fix.longitude - own[t].longitude) * east_scale, 5.0, delta=0.1)
            self.assertAlmostEqual((fix.latitude - own[t].latitude) * 111200.0, 5.0, delta=0.1)
        for fix in own.values():
            if fix.status.status == NavSatStatus.STATUS_FIX:
                self.assertEqual(fix.position_covariance_type, NavSatFix.COVARIANCE_TYPE_APPROXIMATED)
                self.assertGreater(fix.position_covariance[0], 0.0)

    def test_segway_has_wheels_and_late_fixes_and_nothing_else(self):
        text = self.succeed("--scenario", "campus_segway", "--duration", 30, "--output", self.path("a.bag"))
        self.assertIn("claimed sigma   none", text)
        topics = {topic for topic, _, _ in self.messages("a.bag")}
        self.assertEqual(topics - set(TRUTH), {"/odom", "/gps/fix", "/gps/datum", "/tf", "/tf_static"})
        fixes = [fix for fix in self.of("a.bag", "/gps/fix") if fix.status.status == NavSatStatus.STATUS_FIX]
        self.assertGreater(len(fixes), 25)
        for fix in fixes:
            self.assertEqual(fix.position_covariance_type, NavSatFix.COVARIANCE_TYPE_UNKNOWN)
            self.assertEqual(fix.position_covariance, (0.0,) * 9)

    def test_summary(self):
        text = self.succeed("--scenario", "tunnel", "--without-lidar", "--json", self.path("a.json"))
        self.assertIn("tunnel, seed 1", text)
        with open(self.path("a.json")) as file:
            summary = json.load(file)
        self.assertEqual((summary["scenario"], summary["seed"]), ("tunnel", 1))
        self.assertTrue(0.3 < summary["availability"] < 0.7, summary["availability"])
        self.assertGreater(summary["duration_s"], 120.0)
        self.assertEqual(set(summary["path_classes"]), {"direct", "multipath", "nlos", "blocked"})
        self.assertGreater(summary["path_classes"]["blocked"]["count"], 1000)

    def test_paper_field(self):
        self.succeed("--scenario", "paper_field", "--duration", 10, "--output", self.path("a.bag"), "--seed", 3)
        with rosbag.Bag(self.path("a.bag")) as bag:
            counts = {name: topic.message_count for name, topic in bag.get_type_and_topic_info().topics.items()}
        self.assertEqual(counts["/gps/fix"], 1000)
        self.assertEqual(counts["/odom"], 1000)
        shadow = [message.data for message in self.of("a.bag", "/ground_truth/in_shadow")]
        self.assertTrue(any(shadow) and not all(shadow))
        self.assertIn("takes none", self.refuse("--scenario", "paper_field", "--set", "seed=1"))

    def test_bad_scenario_is_refused_with_file_and_line(self):
        with open(self.path("bad.yaml"), "w") as file:
            file.write("seeed: 1\n"
                       "receiver: {rate: 99}\n"
                       "buildings:\n"
                       "  - {footprint: [[0, 50], [9, 59], [9, 50], [0, 59]], roof: 5}\n"
                       "  - {name: bank, box: {center: [0, 0], size: [9, 9]}, roof: 5}\n"
                       "route: {waypoints: [[0, 0], [50, 0]]}\n")
        output = self.refuse("--scenario", self.path("bad.yaml"), "--output", self.path("a.bag"))
        for part in ("bad.yaml:1: seeed: no such parameter; did you mean seed?", "bad.yaml:2: receiver.rate = 99: ",
                     "bad.yaml:4: buildings[0].footprint: ", "start (0, 0) is inside bank", "4 bad parameters"):
            self.assertIn(part, output)
        self.assertFalse(os.path.exists(self.path("a.bag")))
        with open(self.path("bad.yaml"), "w") as file:
            file.write("seed: 1\nroute: {waypoints: [[0, 0]\nimu: {}\n")
        self.assertIn("bad.yaml:3: ", self.refuse("--scenario", self.path("bad.yaml")))

    def test_bad_arguments_are_refused(self):
        output = self.refuse("--scenario", "nowhere")
        for name in ("nowhere", "paper_field", "downtown_grid", "tunnel"):
            self.assertIn(name, output)
        self.assertIn("imu.rat: no such parameter", self.refuse("--scenario", "open_sky", "--set", "imu.rat=3"))
        self.assertIn("SECTION.NAME=VALUE", self.refuse("--scenario", "open_sky", "--set", "imu"))
        self.assertNotEqual(run("--scenario", "open_sky", "--duration", "-1").returncode, 0)


if __name__ == "__main__":
    unittest.main()
