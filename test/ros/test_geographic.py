#!/usr/bin/env python3
"""Between latitude and longitude and the map: the array services, gps/filtered, and geographic targets."""
import math
import os
import sys

import rospy
import rostest
from geometry_msgs.msg import Point, Twist
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import NavSatFix
from urban_gnss_localization.msg import LocalizationStatus
from urban_gnss_localization.srv import FromLLArray, ToLLArray

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import drive  # noqa: E402
from localizer_case import LocalizerCase  # noqa: E402

TARGETS = ((48.1376, 11.5760), (48.1370, 11.5765))


class GeographicTest(LocalizerCase):
    def collect(self, topic, kind):
        received = []

        def on_message(message):
            with self.changed:
                received.append(message)
                self.changed.notify_all()
        self.subscribers.append(rospy.Subscriber(topic, kind, on_message, queue_size=1000))
        return received

    def setUp(self):
        super().setUp()
        self.subscribers = []
        self.addCleanup(lambda: [subscriber.unregister() for subscriber in self.subscribers])

    def test_arrays_are_inverse(self):
        rospy.wait_for_service("fromLLArray", 10.0)
        places = [drive.to_geodetic(east, north) for east, north in ((30.0, -20.0), (0.0, 0.0), (-500.0, 400.0))]
        there = rospy.ServiceProxy("fromLLArray", FromLLArray)(latitudes=[p[0] for p in places],
                                                               longitudes=[p[1] for p in places], altitudes=[])
        self.assertTrue(there.success, there.message)
        self.assertEqual(len(there.map_points), 3)
        self.assertAlmostEqual(there.map_points[0].x, 30.0, delta=0.02)
        self.assertAlmostEqual(there.map_points[0].y, -20.0, delta=0.02)
        back = rospy.ServiceProxy("toLLArray", ToLLArray)(map_points=there.map_points)
        self.assertTrue(back.success, back.message)
        for (latitude, longitude), lat, lon, alt in zip(places, back.latitudes, back.longitudes, back.altitudes):
            self.assertAlmostEqual(lat, latitude, places=9)
            self.assertAlmostEqual(lon, longitude, places=9)
            self.assertAlmostEqual(alt, drive.DATUM[2], places=6)
        empty = rospy.ServiceProxy("fromLLArray", FromLLArray)(latitudes=[], longitudes=[], altitudes=[])
        self.assertTrue(empty.success)
        self.assertEqual(empty.map_points, [])

    def test_arrays_are_refused_whole_with_the_index(self):
        rospy.wait_for_service("fromLLArray", 10.0)
        from_ll = rospy.ServiceProxy("fromLLArray", FromLLArray)
        refused = from_ll(latitudes=[48.1, 95.0], longitudes=[11.5, 11.5], altitudes=[])
        self.assertFalse(refused.success)
        self.assertIn("element 1: latitude = 95", refused.message)
        self.assertEqual(refused.map_points, [])
        refused = from_ll(latitudes=[48.1, 48.2], longitudes=[11.5], altitudes=[])
        self.assertFalse(refused.success)
        self.assertIn("2 latitudes, 1 longitudes", refused.message)
        refused = from_ll(latitudes=[48.1], longitudes=[11.5], altitudes=[520.0, 521.0])
        self.assertFalse(refused.success)
        refused = rospy.ServiceProxy("toLLArray", ToLLArray)(map_points=[Point(), Point(0.0, math.nan, 0.0)])
        self.assertFalse(refused.success)
        self.assertIn("element 1", refused.message)
        self.assertEqual(list(refused.latitudes), [])

    def test_the_estimate_is_published_as_a_fix(self):
        fixes = self.collect("gps/filtered", NavSatFix)
        estimates = self.collect("odometry/filtered", Odometry)
        self.subscribers.append(rospy.Subscriber("imm_ekf/status", LocalizationStatus, self.on_status, queue_size=100))
        publishers = {"odom": rospy.Publisher("odom", Odometry, queue_size=1000),
                      "gps/fix": rospy.Publisher("gps/fix", NavSatFix, queue_size=1000)}
        self.connect(list(publishers.values()) + self.subscribers)
        for topic, message in drive.Drive(30.0).messages:
            publishers[topic].publish(message)
            rospy.sleep(0.002)
        self.wait(lambda: estimates and len(fixes) == len(estimates), "the estimate came as a fix")
        for fix, estimate in zip(fixes, estimates):
            self.assertEqual(fix.header.stamp, estimate.header.stamp)
            self.assertEqual(fix.header.frame_id, "base_link")
            latitude, longitude = drive.to_geodetic(estimate.pose.pose.position.x, estimate.pose.pose.position.y)
            self.assertAlmostEqual(fix.latitude, latitude, delta=3e-7)
            self.assertAlmostEqual(fix.longitude, longitude, delta=3e-7)
            self.assertEqual(fix.altitude, drive.DATUM[2])
            self.assertEqual(fix.position_covariance_type, NavSatFix.COVARIANCE_TYPE_KNOWN)
            covariance = estimate.pose.covariance
            self.assertEqual(fix.position_covariance[:2] + fix.position_covariance[3:5],
                             covariance[:2] + covariance[6:8])
            self.assertEqual(fix.position_covariance[8], 1e6)

    def test_geographic_targets_wait_for_the_datum(self):
        """Nothing is steered until then; afterwards the robot is steered for the first target."""
        commands = self.collect("cmd_vel", Twist)
        paths = self.collect("targets_path", Path)
        estimates = rospy.Publisher("given/estimate", Odometry, queue_size=10)
        datum = rospy.Publisher("late/datum", NavSatFix, queue_size=1, latch=True)
        self.connect([estimates, datum] + self.subscribers)
        stamp = [100.0]

        def estimate():
            message = Odometry()
            message.header.stamp = rospy.Time.from_sec(stamp[0])
            message.header.frame_id = "map"
            message.pose.pose.orientation.w = 1.0
            estimates.publish(message)
            stamp[0] += 0.1
        for _ in range(5):
            estimate()
            rospy.sleep(0.05)
        self.assertEqual(commands, [])
        place = NavSatFix(latitude=drive.DATUM[0], longitude=drive.DATUM[1], altitude=drive.DATUM[2])
        datum.publish(place)
        deadline = rospy.Time.now() + rospy.Duration(10.0)
        while not commands and rospy.Time.now() < deadline:
            estimate()
            rospy.sleep(0.05)
        self.assertTrue(commands, "it was never steered")
        self.wait(lambda: paths, "the targets were shown")
        for pose, (latitude, longitude) in zip(paths[-1].poses, TARGETS):
            back = drive.to_geodetic(pose.pose.position.x, pose.pose.position.y)
            self.assertAlmostEqual(back[0], latitude, delta=3e-7)
            self.assertAlmostEqual(back[1], longitude, delta=3e-7)
        self.assertEqual(commands[-1].linear.x, 1.0)
        self.assertGreater(commands[-1].angular.z, 0.0, "the first target is to the left, north of east")


if __name__ == "__main__":
    rospy.init_node("test_geographic")
    rostest.rosrun("urban_gnss_localization", "test_geographic", GeographicTest)
