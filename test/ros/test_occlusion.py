#!/usr/bin/env python3
"""occlusion.launch beside a simulated drive: every fix comes back weighed, and bad clouds do no harm."""
import math
import os
import struct
import tempfile
import threading
import unittest

import rospy
import rostest
from sensor_msgs.msg import NavSatFix, PointCloud2, PointField
from std_srvs.srv import Trigger
from urban_gnss_localization.msg import SatelliteVisibility, Visibility
from urban_gnss_localization.srv import SaveMap

WAIT_S = 60.0  # of the wall clock, for what takes seconds


def cloud(stamp, points, names=("x", "y", "z")):
    message = PointCloud2(height=1, width=len(points), point_step=4 * len(names), is_dense=False)
    message.header.stamp, message.header.frame_id = stamp, "lidar"
    message.row_step = message.point_step * message.width
    message.fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate(names)]
    message.data = b"".join(struct.pack("<%df" % len(names), *point[:len(names)]) for point in points)
    return message


def is_at_least(matrix, floor):
    """Whether `matrix` - `floor` (rows of 2x2) has no negative eigenvalue, but for rounding."""
    a, b, c = matrix[0] - floor[0], matrix[1] - floor[1], matrix[3] - floor[3]
    return 0.5 * (a + c) - math.hypot(0.5 * (a - c), b) >= -1e-6 * (matrix[0] + matrix[3])


class OcclusionTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.news = threading.Condition()
        cls.fixes, cls.weighted, cls.visibilities = {}, {}, {}
        for topic, kind, store in (("gps/fix", NavSatFix, cls.fixes), ("gps/fix_weighted", NavSatFix, cls.weighted),
                                   ("gps/visibility", Visibility, cls.visibilities)):
            rospy.Subscriber(topic, kind, cls.on_message, store, queue_size=1000)
        cls.points = rospy.Publisher("points", PointCloud2, queue_size=10)

    @classmethod
    def on_message(cls, message, store):
        with cls.news:
            store[message.header.stamp.to_nsec()] = message
            cls.news.notify_all()

    def wait_for(self, condition, what):
        with self.news:
            self.assertTrue(self.news.wait_for(condition, WAIT_S), "no " + what)

    def wait_for_fixes(self, count, what, condition=lambda visibility: True):
        """`count` weighed fixes for which the condition holds, from now on."""
        with self.news:
            last = max(self.visibilities, default=0)
        self.wait_for(lambda: sum(t > last and condition(v) for t, v in list(self.visibilities.items())) >= count, what)

    def test_1_every_fix_is_weighed(self):
        both = Visibility.SOURCE_LIDAR_AND_SATELLITES
        self.wait_for_fixes(20, "fixes weighed by lidar and satellites", lambda v: v.source == both and not v.missing)
        with self.news:
            common = sorted(set(self.fixes) & set(self.weighted))
            first, last = min(self.weighted), max(self.weighted)
            missed = [t for t in self.fixes if first <= t <= last and t not in self.weighted]
            unknown = [t for t in self.weighted if min(self.fixes) <= t <= max(self.fixes) and t not in self.fixes]
        self.assertEqual(missed, [], "a fix was not weighed")
        self.assertEqual(unknown, [], "a stamp that no fix has")
        for t in common:
            before, after = self.fixes[t], self.weighted[t]
            self.assertEqual(after.header.frame_id, before.header.frame_id)
            for name in ("latitude", "longitude", "altitude"):
                x, y = getattr(before, name), getattr(after, name)
                self.assertTrue(x == y or (math.isnan(x) and math.isnan(y)), name)
            if before.status.status < 0:
                continue
            self.assertTrue(all(math.isfinite(value) for value in after.position_covariance))
            self.assertGreater(after.position_covariance[8], 0.0)
            horizontal = [[message.position_covariance[i] for i in (0, 1, 3, 4)] for message in (after, before)]
            self.assertTrue(is_at_least(*horizontal), horizontal)
        newest = max((t for t in self.visibilities if self.visibilities[t].source == both))
        seen = self.visibilities[newest]
        self.assertGreater(len(seen.satellites), 5)
        for satellite in seen.satellites:
            if satellite.visibility != SatelliteVisibility.NOT_USED:
                self.assertTrue(0.0 <= satellite.blocked_fraction <= 1.0, satellite)
                self.assertTrue(0.0 <= satellite.known_fraction <= 1.0, satellite)

    def test_2_bad_clouds_do_no_harm(self):
        self.wait_for_fixes(1, "fix")
        nan = float("nan")
        wall = [(5.0, 0.1 * i, 1.0) for i in range(100)]
        for _ in range(3):
            now = rospy.Time.now()
            for message in (cloud(now, []), cloud(now, [(nan, nan, nan)] * 50), cloud(now, wall, ("x", "y")),
                            cloud(now + rospy.Duration(1000.0), wall)):
                self.points.publish(message)
            self.wait_for_fixes(2, "fix after bad clouds")
        # The future cloud is not in the map, nor does its stamp make anything else old.
        self.wait_for_fixes(10, "complete fix after bad clouds", lambda v: not v.missing)

    def test_3_map_is_saved_and_cleared(self):
        self.wait_for_fixes(1, "complete fix", lambda v: not v.missing)
        save = rospy.ServiceProxy("occlusion/save_map", SaveMap)
        clear = rospy.ServiceProxy("occlusion/clear_map", Trigger)
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "map.pcd")
            answer = save(file)
            self.assertTrue(answer.success, answer.message)
            self.assertGreater(answer.points, 100)
            with open(file, "rb") as stream:
                head = stream.read(1000).decode("latin-1")
            self.assertIn("POINTS %d\n" % answer.points, head)
            refused = save(os.path.join(folder, "no", "such", "folder", "map.pcd"))
            self.assertFalse(refused.success)
            self.assertTrue(refused.message)
        before = answer.points
        self.assertTrue(clear().success)
        with tempfile.TemporaryDirectory() as folder:
            self.assertLess(save(os.path.join(folder, "map.pcd")).points, before)
        self.wait_for_fixes(5, "complete fix after the map was cleared", lambda v: not v.missing)


if __name__ == "__main__":
    rospy.init_node("test_occlusion")
    rostest.rosrun("urban_gnss_localization", "test_occlusion", OcclusionTest)
