#!/usr/bin/env python3
"""Messages that no sensor should send, to every node at once: none dies, none publishes what is no number or no
covariance, one odd message changes nothing, and what was refused is said."""
import copy
import math
import os
import sys
import threading
import time
import unittest

import numpy
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, PoseWithCovarianceStamped, TransformStamped, Twist, TwistWithCovarianceStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import Imu, NavSatFix, PointCloud2
from tf2_msgs.msg import TFMessage
from urban_gnss_localization.msg import GpsBias, LocalizationStatus, SatelliteArray
from urban_gnss_localization.srv import FromLL, SetPose, ToLL
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import drive  # noqa: E402

LOCALIZERS = ("imm_ekf", "complementary_ekf", "ukf", "particle_filter")
WAIT_S = 20.0
BAD = (math.nan, math.inf, -math.inf, 1e300, -1.0)
LAST = 2 ** 32 - 1


def is_covariance(values, size):
    matrix = numpy.reshape(values, (size, size))
    return bool(numpy.isfinite(matrix).all()) and numpy.linalg.eigvalsh(matrix).min() > -1e-9 * abs(matrix).max()


def is_sound(message):
    pose = message.pose.pose
    numbers = (pose.position.x, pose.position.y, pose.orientation.z, pose.orientation.w, message.twist.twist.linear.x,
               message.twist.twist.angular.z)
    return (all(map(math.isfinite, numbers)) and is_covariance(message.pose.covariance, 6)
            and all(message.pose.covariance[i] > 0.0 for i in (0, 7, 35)))


class FaultsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.news = threading.Condition()
        cls.outputs = {name: [] for name in LOCALIZERS}
        cls.datums = {name: [] for name in LOCALIZERS}
        cls.status, cls.diagnostics, cls.lines, cls.weighted, cls.commands = {}, {}, [], [], []
        cls.targets = []

        def store(action):
            def on_message(message):
                with cls.news:
                    action(message)
                    cls.news.notify_all()
            return on_message

        for name in LOCALIZERS:
            rospy.Subscriber(name + "/odometry/filtered", Odometry, store(cls.outputs[name].append), queue_size=1000)
            rospy.Subscriber(name + "/gps/datum", NavSatFix, store(cls.datums[name].append), queue_size=10)
            rospy.Subscriber(name + "/localizer/status", LocalizationStatus,
                             store(lambda m, name=name: cls.status.__setitem__(name, m)), queue_size=1000)
        rospy.Subscriber("gps/fix_weighted", NavSatFix, store(cls.weighted.append), queue_size=1000)
        rospy.Subscriber("cmd_vel", Twist, store(cls.commands.append), queue_size=1000)
        rospy.Subscriber("targets", MarkerArray, store(cls.targets.append), queue_size=1000)
        rospy.Subscriber("/rosout_agg", Log, store(cls.lines.append), queue_size=10000)
        rospy.Subscriber("/diagnostics", DiagnosticArray, store(
            lambda m: cls.diagnostics.update({each.name: each for each in m.status})), queue_size=1000)
        kinds = {"odom": Odometry, "gps/fix": NavSatFix, "imu/data": Imu, "gps/velocity": TwistWithCovarianceStamped,
                 "gps/satellites": SatelliteArray, "initialpose": PoseWithCovarianceStamped}
        cls.publishers = {(name, topic): rospy.Publisher(name + "/" + topic, kind, queue_size=1000, tcp_nodelay=True)
                          for name in LOCALIZERS for topic, kind in kinds.items()}
        for topic, kind in (("gps/fix", NavSatFix), ("points", PointCloud2), ("/tf", TFMessage),
                            ("gps/satellites", SatelliteArray), ("odometry/filtered", Odometry)):
            cls.publishers[("", topic)] = rospy.Publisher(topic, kind, queue_size=1000, tcp_nodelay=True)
        cls.publishers[("particle_filter", "gps/bias")] = rospy.Publisher("particle_filter/gps/bias", GpsBias,
                                                                          queue_size=100)
        # Beside the particle filter listens gps_bias; beside the occlusion node its nodelet.
        listeners = dict.fromkeys([("particle_filter", "odom"), ("particle_filter", "gps/fix"), ("", "gps/fix"),
                                   ("", "points"), ("", "gps/satellites")], 2)
        cls.await_(lambda: all(p.get_num_connections() >= listeners.get(key, 1)
                               for key, p in cls.publishers.items() if key[1] != "gps/velocity"),
                   "the nodes to subscribe")
        cls.drive = drive.Drive(400.0)
        cls.next = 0
        cls.feed(60.0)

    @classmethod
    def await_(cls, condition, what):
        with cls.news:
            end = time.monotonic() + WAIT_S
            while not condition():
                if time.monotonic() > end:
                    raise AssertionError("waited for " + what)
                cls.news.wait(0.05)

    @classmethod
    def publish(cls, topic, message, names=LOCALIZERS):
        for name in names:
            cls.publishers[(name, topic)].publish(message)

    @classmethod
    def feed(cls, seconds):
        """The next part of the drive, to all; waits for every localizer's answer to every odometry."""
        until = cls.stamp() + rospy.Duration(seconds)
        while cls.stamp() < until:
            topic, message = cls.drive.messages[cls.next]
            cls.next += 1
            cls.publish(topic, message)
            if topic == "gps/fix":
                cls.publish(topic, message, ("",))
                cls.publish("/tf", cls.transform(message.header.stamp), ("",))
            else:
                estimate = copy.deepcopy(message)
                estimate.header.frame_id = "map"
                cls.publish("odometry/filtered", estimate, ("",))
                if any(cls.outputs.values()):
                    cls.await_(lambda: all(o and o[-1].header.stamp >= message.header.stamp
                                           for o in cls.outputs.values()), "an estimate of each localizer at %s: %s" % (
                        message.header.stamp, {n: o and o[-1].header.stamp for n, o in cls.outputs.items()}))
                else:
                    rospy.sleep(0.005)

    @classmethod
    def stamp(cls):
        return cls.drive.messages[cls.next][1].header.stamp

    @staticmethod
    def transform(stamp, child="base_link"):
        transform = TransformStamped(child_frame_id=child)
        transform.header.stamp, transform.header.frame_id = stamp, "odom"
        transform.transform.rotation.w = 1.0
        return TFMessage([transform])

    @classmethod
    def last(cls, topic):
        return copy.deepcopy(next(m for t, m in reversed(cls.drive.messages[:cls.next]) if t == topic))

    def setUp(self):
        with self.news:
            for outputs in self.outputs.values():
                del outputs[:-1]

    def tearDown(self):
        """After whatever it was: everything goes on, and all that came out is sound."""
        weighted = len(self.weighted)
        self.feed(3.0)
        self.await_(lambda: len(self.weighted) > weighted, "weighted fixes")
        for name, outputs in self.outputs.items():
            self.assertTrue(all(map(is_sound, outputs)), name)
        for fix in self.weighted:
            self.assertTrue(is_covariance(fix.position_covariance, 3))
        self.assertEqual([m.msg[:80] for m in self.lines if len(m.msg) > 400], [], "a line of the log is long")

    def truth(self, name, stamp):
        """x, y and yaw in the map of this localizer, about the datum that it has found, or was given."""
        x, y, yaw = self.drive.truth[stamp.to_nsec()]
        datum = self.datums[name][-1]
        metre_north, metre_east = (b - a for a, b in zip(drive.DATUM, drive.to_geodetic(1.0, 1.0)))
        return (x - (datum.longitude - drive.DATUM[1]) / metre_east, y - (datum.latitude - drive.DATUM[0]) / metre_north,
                yaw)

    def errors(self):
        """Of the positions (m), by the localizer."""
        errors = {}
        for name, outputs in self.outputs.items():
            x, y, _ = self.truth(name, outputs[-1].header.stamp)
            position = outputs[-1].pose.pose.position
            errors[name] = math.hypot(position.x - x, position.y - y)
        return errors

    def pose(self, name):
        x, y, yaw = self.truth(name, self.last("odom").header.stamp)
        message = PoseWithCovarianceStamped()
        message.header.frame_id = "map"
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        for i in (0, 7, 35):
            message.pose.covariance[i] = 0.25
        return message

    def test_a_pose_that_is_none_is_refused_with_the_numbers(self):
        for name in LOCALIZERS:
            set_pose = rospy.ServiceProxy(name + "/set_pose", SetPose)
            self.assertTrue(set_pose(self.pose(name)).success)
            for entry in range(36):
                for bad in BAD:
                    spoilt = self.pose(name)
                    spoilt.pose.covariance[entry] = bad
                    answer = set_pose(spoilt)
                    is_large = entry in (0, 7, 14, 21, 28, 35) and bad == 1e300
                    self.assertEqual(answer.success, is_large, (name, entry, bad, answer.message))
                    self.assertTrue(is_large or "ariance" in answer.message, answer.message)
            for field in ("x", "y"):
                for bad in BAD[:4]:
                    spoilt = self.pose(name)
                    setattr(spoilt.pose.pose.position, field, bad)
                    self.assertFalse(set_pose(spoilt).success, (name, field, bad))
            spoilt = self.pose(name)
            spoilt.pose.pose.orientation.w = spoilt.pose.pose.orientation.z = 0.0
            self.assertIn("orientation is 0", set_pose(spoilt).message)
            spoilt = self.pose(name)
            spoilt.header.frame_id = "/map"
            self.assertTrue(set_pose(spoilt).success)
            self.publishers[(name, "initialpose")].publish(self.spoilt_pose(name))
            self.feed(0.5)
            self.assertTrue(set_pose(self.pose(name)).success)

    def spoilt_pose(self, name):
        pose = self.pose(name)
        pose.pose.covariance[0] = -1.0
        return pose

    def test_a_covariance_of_zeros_means_the_default(self):
        for name in LOCALIZERS:
            unknown = self.pose(name)
            unknown.pose.covariance = [0.0] * 36
            self.assertTrue(rospy.ServiceProxy(name + "/set_pose", SetPose)(unknown).success)
        self.feed(0.5)
        for name, outputs in self.outputs.items():
            self.assertGreater(outputs[-1].pose.covariance[0], 0.1, name)

    def test_absurd_stamps_kill_nobody(self):
        for sec, nsec in ((LAST, 0), (LAST, LAST), (0, LAST), (4100000000, 0)):
            for topic in ("odom", "gps/fix"):
                message = self.last(topic)
                message.header.stamp = rospy.Time()
                message.header.stamp.secs, message.header.stamp.nsecs = sec, nsec
                self.publish(topic, message)
            for topic, kind in (("imu/data", Imu), ("gps/velocity", TwistWithCovarianceStamped),
                                ("gps/satellites", SatelliteArray), ("initialpose", PoseWithCovarianceStamped)):
                message = kind()
                message.header.stamp.secs, message.header.stamp.nsecs = sec, nsec
                self.publish(topic, message)
            bias = GpsBias()
            bias.header.stamp.secs, bias.header.stamp.nsecs = sec, nsec
            self.publish("gps/bias", bias, ("particle_filter",))
            for topic, message in (("gps/fix", self.last("gps/fix")), ("points", PointCloud2()),
                                   ("gps/satellites", SatelliteArray()), ("odometry/filtered", Odometry())):
                message.header.stamp.secs, message.header.stamp.nsecs = sec, nsec
                message.header.frame_id = "lidar"
                self.publish(topic, message, ("",))
            for child in ("base_link", "lidar"):
                stamp = rospy.Time()
                stamp.secs, stamp.nsecs = sec, nsec
                self.publish("/tf", self.transform(stamp, child), ("",))
        self.feed(10.0)
        for name, error in self.errors().items():
            self.assertLess(error, 8.0, name)

    def test_one_transform_of_the_future_silences_nothing(self):
        for ahead_s in (5.0, 3600.0, 1e8):
            self.publish("/tf", self.transform(self.stamp() + rospy.Duration(ahead_s)), ("",))
            self.feed(3.0)
            with self.news:
                del self.weighted[:]
            self.feed(3.0)
            self.await_(lambda: len(self.weighted) >= 5, "weighted fixes after a transform %.0f s ahead" % ahead_s)

    def test_one_odd_stamp_of_any_stream_resets_nothing(self):
        datums = {name: len(d) for name, d in self.datums.items()}
        for seconds in (-3.0, -1.2, 4.0, 3500.0):
            for topic in ("odom", "gps/fix"):
                message = self.last(topic)
                message.header.stamp += rospy.Duration(seconds)
                self.publish(topic, message)
                before = {name: len(o) for name, o in self.outputs.items()}
                self.feed(1.0)
                for name, count in before.items():
                    self.assertEqual(len(self.outputs[name]) - count, drive.ODOM_RATE_HZ, (name, topic, seconds))
            imu = Imu()
            imu.header.stamp = self.stamp() + rospy.Duration(seconds)
            imu.angular_velocity.z = 30.0
            self.publish("imu/data", imu)
        self.feed(1.0)
        self.assertEqual({name: len(d) for name, d in self.datums.items()}, datums, "the map's origin moved")
        self.assertEqual([m.msg for m in self.lines if "reset:" in m.msg], [])
        for name, error in self.errors().items():
            self.assertLess(error, 8.0, name)

    def test_a_late_estimate_does_not_send_the_robot_back(self):
        def current():
            return [m.color.g < 0.5 for m in self.targets[-1].markers if m.ns == "targets"].index(True)

        stamp = [self.stamp()]

        def estimate(x, y, back_s=0.0):
            message = Odometry()
            message.header.stamp, message.header.frame_id = stamp[0] - rospy.Duration(back_s), "map"
            message.pose.pose.position.x, message.pose.pose.position.y = x, y
            message.pose.pose.orientation.w = 1.0
            self.publish("odometry/filtered", message, ("",))
            stamp[0] += rospy.Duration(0.01)

        for _ in range(3):
            estimate(1000.0, 0.0)
        self.await_(lambda: self.targets and current() == 1, "the second target")
        estimate(500.0, 0.0, back_s=5.0)
        for _ in range(3):
            estimate(500.0, 0.0)
        rospy.sleep(0.3)
        self.assertEqual(current(), 1)

    def test_numbers_that_are_none_do_no_harm(self):
        for bad in BAD:
            odometry = self.last("odom")
            odometry.header.stamp += rospy.Duration(0.001)
            odometry.twist.twist.linear.x = bad if bad != -1.0 else 1e9
            odometry.pose.covariance = odometry.twist.covariance = [bad] * 36
            self.publish("odom", odometry)
            fix = self.last("gps/fix")
            fix.header.stamp += rospy.Duration(0.001)
            fix.position_covariance = [bad] * 9
            fix.altitude = bad
            self.publish("gps/fix", fix, ("",))
            velocity = TwistWithCovarianceStamped()
            velocity.header.stamp = odometry.header.stamp
            velocity.twist.twist.linear.x = bad if bad != -1.0 else 1e9
            velocity.twist.covariance = [bad] * 36
            self.publish("gps/velocity", velocity)
            imu = Imu()
            imu.header.stamp = odometry.header.stamp
            imu.angular_velocity.z = bad if bad != -1.0 else 1e9
            imu.orientation.w = imu.linear_acceleration.z = bad
            self.publish("imu/data", imu)
            bias = GpsBias(radius=bad)
            bias.header.stamp = fix.header.stamp
            bias.covariance = [bad] * 9
            self.publish("gps/bias", bias, ("particle_filter",))
            estimate = self.last("odom")
            estimate.header.stamp += rospy.Duration(0.001)
            estimate.header.frame_id = "map"
            estimate.pose.covariance = [bad] * 36
            estimate.pose.pose.position.x = bad
            self.publish("odometry/filtered", estimate, ("",))
            transform = self.transform(odometry.header.stamp)
            transform.transforms[0].transform.translation.x = bad if bad != -1.0 else math.nan
            self.publish("/tf", transform, ("",))
            self.feed(0.6)
        for command in self.commands:
            self.assertTrue(math.isfinite(command.angular.z) and math.isfinite(command.linear.x))
        for name, error in self.errors().items():
            self.assertLess(error, 8.0, name)

    def test_what_was_refused_is_counted_in_the_diagnostics(self):
        self.publish("initialpose", self.spoilt_pose("imm_ekf"))
        name = "imm_ekf/localizer: localization"

        def refused():
            matching = [s for n, s in self.diagnostics.items() if n.endswith(name)]
            return matching and {v.key: v.value for v in matching[0].values}
        self.await_(lambda: refused() and "variance of x = -1" in refused()["last refusal"], "the refusal's words")
        self.assertGreaterEqual(int(refused()["messages refused"]), 1)
        self.assertEqual(refused()["callbacks that failed"], "0")
        self.assertLess(max(s.level for n, s in self.diagnostics.items() if n.endswith(name)), DiagnosticStatus.ERROR)

    def test_frames_that_alternate_and_are_long_flood_no_log(self):
        with self.news:
            del self.lines[:]
        for k in range(50):
            fix = self.last("gps/fix")
            fix.header.frame_id = "f" * 100000 + str(k)
            fix.header.stamp += rospy.Duration(0.001 * k)
            for name in ("imm_ekf", ""):
                self.publishers[(name, "gps/fix")].publish(fix)
        self.feed(2.0)
        self.assertLess(len([m for m in self.lines if "frame_id" in m.msg]), 10)
        self.assertLess(len(self.lines), 200)

    def test_conversions_are_of_places_alone(self):
        to_ll = rospy.ServiceProxy("imm_ekf/toLL", ToLL)
        from_ll = rospy.ServiceProxy("imm_ekf/fromLL", FromLL)
        self.assertTrue(to_ll(Point(10.0, 20.0, 0.0)).success)
        for bad in (math.nan, math.inf, 1e15, 1e308):
            self.assertFalse(to_ll(Point(bad, 0.0, 0.0)).success)
            self.assertFalse(from_ll(48.1, bad, 500.0).success)
            self.assertFalse(from_ll(48.1, 11.5, bad).success)


if __name__ == "__main__":
    rospy.init_node("test_faults")
    rostest.rosrun("urban_gnss_localization", "test_faults", FaultsTest)
