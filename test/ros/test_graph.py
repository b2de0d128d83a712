#!/usr/bin/env python3
"""The live graph of bias node and particle filter: replayed twice, fed with bad input, compared with the offline replay."""
import copy
import math
import os
import subprocess
import sys
import tempfile
import threading
import unittest

import rosbag
import rospy
import rostest
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_srvs.srv import Empty
from urban_gnss_localization.msg import FixDecision, GpsBias
from urban_gnss_localization.srv import FromLL, SetPose, SetPoseRequest, ToLL

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import drive  # noqa: E402

LIVE_OFFLINE_TOLERANCE_M = 0.05
NOT_LOST_M = 6.0  # the raw fixes of the drive have an RMSE of 4.2 m: a quarter of them is 8 m off


class GraphTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.graph = drive.Graph(listeners=4)  # those of /literal, too
        cls.drive = drive.Drive()

    def setUp(self):
        rospy.wait_for_service("particle_filter/reset", 10.0)
        rospy.ServiceProxy("particle_filter/reset", Empty)()

    def test_bag_that_starts_over_resets_everything(self):
        """The clock jumps back, the graph starts anew and does the same again."""
        first = self.graph.feed(self.drive.messages)
        second = self.graph.feed(self.drive.messages)
        self.assertEqual(len(first), len(second))
        stamps = [o.header.stamp for o in second]
        self.assertTrue(all(a < b for a, b in zip(stamps, stamps[1:])))
        worst = max(math.hypot(a[1] - b[1], a[2] - b[2]) for a, b in zip(drive.poses(first), drive.poses(second)))
        self.assertLess(worst, 1e-6)
        self.assertLess(drive.rmse(second, self.drive.truth), NOT_LOST_M)

    def test_bad_fixes_do_no_harm(self):
        """NaN, no fix, zero covariance and absurd values between the good fixes."""
        clean = self.graph.feed(self.drive.messages)
        spoilt = []
        for index, (topic, message) in enumerate(self.drive.messages):
            spoilt.append((topic, message))
            if topic != "gps/fix":
                continue
            bad = copy.deepcopy(message)
            bad.header.stamp += rospy.Duration(0, 1000000)
            kind = index // (drive.FIX_EVERY + 1) % 5
            if kind == 0:
                bad.latitude = float("nan")
            elif kind == 1:
                bad.status.status = NavSatStatus.STATUS_NO_FIX
            elif kind == 2:
                bad.latitude, bad.longitude = 0.0, 0.0
            elif kind == 3:
                bad.longitude = float("inf")
            else:
                bad.position_covariance = [float("nan")] * 9
                bad.latitude = 91.0
            spoilt.append((topic, bad))
        outputs = self.graph.feed(spoilt)
        self.assertTrue(drive.all_finite(outputs))
        self.assertEqual(drive.poses(outputs)[-1][0], drive.poses(clean)[-1][0])
        # Every one of them is rejected, so nothing at all may change.
        worst = max(math.hypot(a[1] - b[1], a[2] - b[2]) for a, b in zip(drive.poses(clean), drive.poses(outputs)))
        self.assertLess(worst, 1e-6)

    def test_zero_covariance_means_the_default(self):
        """A fix without a covariance is used, and does not make the estimate worse than its default allows."""
        bare = copy.deepcopy(self.drive.messages)
        for topic, message in bare:
            if topic == "gps/fix":
                message.position_covariance = [0.0] * 9
                message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_UNKNOWN
        outputs = self.graph.feed(bare)
        self.assertTrue(drive.all_finite(outputs))
        self.assertTrue(self.graph.status.last_fix.covariance_clamped)
        self.assertIn(self.graph.status.last_fix.decision, (FixDecision.INFLATED, FixDecision.BIAS_COMPENSATED))
        self.assertLess(drive.rmse(outputs, self.drive.truth), NOT_LOST_M)

    def test_bad_odometry_does_no_harm(self):
        """Odometry that is not finite is left out."""
        spoilt = []
        for topic, message in self.drive.messages[:400]:
            if topic == "odom" and message.header.stamp.nsecs == 500000000:
                bad = copy.deepcopy(message)
                bad.header.stamp -= rospy.Duration(0, 1000000)
                bad.twist.twist.linear.x = float("nan")
                spoilt.append((topic, bad))
                worse = copy.deepcopy(bad)
                worse.twist.twist.linear.x = 1e300
                spoilt.append((topic, worse))
            spoilt.append((topic, message))
        def is_good(topic, message):
            return topic != "odom" or (math.isfinite(message.twist.twist.linear.x)
                                       and message.twist.twist.linear.x < 1e3)
        outputs = self.graph.feed(spoilt, is_good)
        self.assertTrue(drive.all_finite(outputs))
        self.assertLess(drive.rmse(outputs, self.drive.truth), NOT_LOST_M)

    def test_live_agrees_with_offline(self):
        """The live graph and the offline replay run the same core."""
        live = drive.poses(self.graph.feed(self.drive.messages))
        with tempfile.TemporaryDirectory() as directory:
            source, result = os.path.join(directory, "in.bag"), os.path.join(directory, "out.bag")
            with rosbag.Bag(source, "w") as bag:
                for index, (topic, message) in enumerate(self.drive.messages):
                    bag.write("/" + topic, message, message.header.stamp + rospy.Duration(0, index))
            parameters = os.path.join(directory, "parameters.yaml")
            subprocess.run(["rosparam", "dump", parameters, "/offline"], check=True)
            subprocess.run(["rosrun", "urban_gnss_localization", "replay", source, "--localizer", "particle_filter",
                            "--params", parameters, "--output", result], check=True)
            with rosbag.Bag(result) as bag:
                offline = drive.poses([m for _, m, _ in bag.read_messages("/odometry/filtered")])
        self.assertEqual([p[0] for p in live], [p[0] for p in offline])
        worst = max(math.hypot(a[1] - b[1], a[2] - b[2]) for a, b in zip(live, offline))
        self.assertLess(worst, LIVE_OFFLINE_TOLERANCE_M)

    def test_bias_node_takes_the_mode_from_the_localizer(self):
        """r-hat of `literal` is the fix's distance from the datum, about which the drive is a circle."""
        rospy.wait_for_service("literal/particle_filter/reset", 10.0)
        rospy.ServiceProxy("literal/particle_filter/reset", Empty)()
        radii, news = {}, threading.Condition()

        def on_bias(message):
            with news:
                radii[message.header.stamp.to_nsec()] = message
                news.notify_all()

        subscriber = rospy.Subscriber("literal/gps/bias", GpsBias, on_bias, queue_size=1000)
        while subscriber.get_num_connections() == 0:
            rospy.sleep(0.01)
        self.graph.feed(self.drive.messages[:500])
        examined = lambda: [m.radius for m in radii.values() if m.fix.decision != FixDecision.NOT_EXAMINED]  # noqa: E731
        with news:
            self.assertTrue(news.wait_for(lambda: len(examined()) > 30, 20.0), len(radii))
        for radius in examined():
            self.assertAlmostEqual(radius, drive.RADIUS, delta=20.0)  # without noise in it, it lags behind
        mine = [m.radius for m in self.graph.biases if m.header.stamp.to_nsec() in radii]
        self.assertLess(max(mine), 15.0)

    def test_services(self):
        """toLL and fromLL are inverse; set_pose moves the estimate, and refuses another frame."""
        self.graph.feed(self.drive.messages[:60])  # longer than what counts as a late message
        place = rospy.ServiceProxy("toLL", ToLL)(map_point=drive.Odometry().pose.pose.position)
        self.assertTrue(place.success)
        self.assertAlmostEqual(place.latitude, drive.DATUM[0], places=9)
        latitude, longitude = drive.to_geodetic(30.0, -20.0)
        back = rospy.ServiceProxy("fromLL", FromLL)(latitude=latitude, longitude=longitude, altitude=drive.DATUM[2])
        self.assertAlmostEqual(back.map_point.x, 30.0, delta=0.02)
        self.assertAlmostEqual(back.map_point.y, -20.0, delta=0.02)

        request = SetPoseRequest()
        request.pose.header.frame_id = "map"
        request.pose.pose.pose.position.x = 12.0
        request.pose.pose.pose.orientation.w = 1.0
        request.pose.pose.covariance[0] = request.pose.pose.covariance[7] = request.pose.pose.covariance[35] = 0.01
        self.assertTrue(rospy.ServiceProxy("set_pose", SetPose)(request).success)
        moved = self.graph.feed(self.drive.messages[60:61])[-1]
        self.assertAlmostEqual(moved.pose.pose.position.x, 12.0, delta=0.5)
        request.pose.header.frame_id = "odom"
        refused = rospy.ServiceProxy("set_pose", SetPose)(request)
        self.assertFalse(refused.success)
        self.assertIn("odom", refused.message)


if __name__ == "__main__":
    rospy.init_node("test_graph")
    rostest.rosrun("urban_gnss_localization", "test_graph", GraphTest)
