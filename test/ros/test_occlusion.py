#!/usr/bin/env python3
"""occlusion.launch beside a simulated drive: every fix comes back weighed, and bad clouds do no harm."""
import math
import os
import sys
import tempfile
import threading
import unittest

import rospy
import rostest
import tf2_ros
from sensor_msgs.msg import NavSatFix, PointCloud2
from std_srvs.srv import Trigger
from urban_gnss_localization.msg import SatelliteVisibility, Visibility
from urban_gnss_localization.srv import SaveMap

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from street import horizontal, is_at_least, to_cloud, to_transform  # noqa: E402

WAIT_S = 120.0  # of the wall clock, for what takes seconds


class OcclusionTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.news = threading.Condition()
        cls.fixes, cls.weighted, cls.visibilities, cls.turned = {}, {}, {}, {}
        for topic, kind, store in (("gps/fix", NavSatFix, cls.fixes), ("gps/fix_weighted", NavSatFix, cls.weighted),
                                   ("gps/visibility", Visibility, cls.visibilities),
                                   ("turned/gps/visibility", Visibility, cls.turned)):
            rospy.Subscriber(topic, kind, cls.on_message, store, queue_size=1000)
        cls.static = tf2_ros.StaticTransformBroadcaster()
        cls.static.sendTransform(to_transform(rospy.Time(), "turned_map", "map", yaw=math.pi))
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
                x = getattr(before, name)
                self.assertEqual(getattr(after, name), x if math.isfinite(x) else 0.0, name)
            self.assertEqual(after.status, before.status)
            if before.status.status < 0:  # no place
                continue
            self.assertTrue(all(math.isfinite(value) for value in after.position_covariance))
            self.assertGreater(after.position_covariance[8], 0.0)
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
            for message in (to_cloud(now, []), to_cloud(now, [(nan, nan, nan)] * 50), to_cloud(now, wall, ("x", "y")),
                            to_cloud(now + rospy.Duration(1000.0), wall)):
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
            answer = save(file, False)
            self.assertTrue(answer.success, answer.message)
            self.assertGreater(answer.points, 100)
            with open(file, "rb") as stream:
                head = stream.read(1000).decode("latin-1")
            self.assertIn("POINTS %d\n" % answer.points, head)
            self.assertEqual(os.listdir(folder), ["map.pcd"])
            link, other = os.path.join(folder, "link.pcd"), os.path.join(folder, "other.txt")
            with open(other, "w") as stream:
                stream.write("precious")
            os.symlink(other, link)
            for path, overwrite, word in (
                    (os.path.join(folder, "no", "such", "map.pcd"), False, "no such folder"), ("map.pcd", False, "absolute"),
                    ("", False, "absolute"), (other, True, "must end in .pcd"), (folder, True, "must end in .pcd"),
                    (file, False, "is there already"), (link, True, "no ordinary file"),
                    (file + "\n.pcd", False, "control characters"), (file + "\0.pcd", False, "control characters")):
                refused = save(path, overwrite)
                self.assertFalse(refused.success, path)
                self.assertIn(word, refused.message)
            with open(other) as stream:
                self.assertEqual(stream.read(), "precious")
            self.assertTrue(save(file, True).success)
            self.assertEqual(sorted(os.listdir(folder)), ["link.pcd", "map.pcd", "other.txt"])
        before = answer.points
        self.assertTrue(clear().success)
        with tempfile.TemporaryDirectory() as folder:
            self.assertLess(save(os.path.join(folder, "map.pcd"), False).points, before)
        self.wait_for_fixes(5, "complete fix after the map was cleared", lambda v: not v.missing)

    def test_4_a_heading_off_by_half_a_turn_shows(self):
        """Most of all before the alley, which is much the same both ways."""
        self.wait_for(lambda: any(v.doubt for v in list(self.turned.values())), "doubt of a heading off by half a turn")
        with self.news:
            self.assertEqual({v.doubt for v in self.visibilities.values()}, {""}, "the right heading was doubted")
            pairs = [(self.visibilities[t], self.turned[t]) for t in set(self.visibilities) & set(self.turned)]
        shares = [(a.blocked_fraction, b.blocked_fraction) for right, wrong in pairs
                  for a, b in zip(right.satellites, wrong.satellites) if a.name == b.name]
        self.assertGreater(len(shares), 1000)
        self.assertGreater(sum(abs(a - b) > 0.5 for a, b in shares), 0.05 * len(shares))

    def test_5_no_fix_of_the_drive_is_made_more_certain(self):
        """Nor is one lost; on to the alley."""
        self.wait_for(lambda: len(self.weighted) > 600, "600 fixes")
        with self.news:
            first, last = min(self.weighted), max(self.weighted)
            self.assertEqual([t for t in self.fixes if first <= t <= last and t not in self.weighted], [])
            common = [t for t in self.weighted if t in self.fixes and self.fixes[t].status.status >= 0]
            self.assertGreater(len(common), 500)
            for t in common:
                weighted, claimed = horizontal(self.weighted[t]), horizontal(self.fixes[t])
                self.assertTrue(is_at_least(weighted, claimed), (weighted, claimed))


if __name__ == "__main__":
    rospy.init_node("test_occlusion")
    rostest.rosrun("urban_gnss_localization", "test_occlusion", OcclusionTest)
