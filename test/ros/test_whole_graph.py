#!/usr/bin/env python3
"""demo.launch with everything that the paper's filter can have in front: the simulator's fixes are weighed by the
occlusion node, gps_bias follows their bias, the particle filter takes both. All are nodes of their own."""
import math
import threading
import unittest

import rosnode
import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import PoseArray
from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix, PointCloud2
from urban_gnss_localization.msg import FixDecision, GpsBias, LocalizationStatus, Visibility

DRIVE_S = 25.0      # simulated, from the first estimate
WAIT_S = 200.0      # of the wall clock, for a slow machine
RMSE_BOUND_M = 15.0
MAX_BOUND_M = 30.0  # a street is 18 m wide; a filter that is farther off is lost
TOPICS = {"gps/fix": NavSatFix, "gps/fix_weighted": NavSatFix, "gps/visibility": Visibility, "gps/bias": GpsBias,
          "odometry/filtered": Odometry, "ground_truth/odom": Odometry, "particle_cloud": PoseArray,
          "particle_cloud_weighted": PointCloud2, "particle_filter/status": LocalizationStatus}


class WholeGraphTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.news = threading.Condition()
        cls.received = {topic: {} for topic in TOPICS}  # stamp in ns -> message
        cls.buffer = tf2_ros.Buffer(cache_time=rospy.Duration(600.0), debug=False)
        cls.listener = tf2_ros.TransformListener(cls.buffer)
        for topic, kind in TOPICS.items():
            rospy.Subscriber(topic, kind, cls.on_message, topic, queue_size=5000)
        with cls.news:
            if not cls.news.wait_for(cls.has_driven, WAIT_S):
                raise AssertionError("no %g s of estimates; messages: %s" % (
                    DRIVE_S, {topic: len(messages) for topic, messages in cls.received.items()}))
            cls.got = {topic: dict(messages) for topic, messages in cls.received.items()}  # more come during the tests

    @classmethod
    def on_message(cls, message, topic):
        with cls.news:
            cls.received[topic][message.header.stamp.to_nsec()] = message
            cls.news.notify_all()

    @classmethod
    def has_driven(cls):
        estimates = cls.received["odometry/filtered"]
        return bool(estimates) and max(estimates) - min(estimates) > DRIVE_S * 1e9

    def test_nodes_are_separate(self):
        nodes = set(rosnode.get_node_names())
        self.assertLessEqual({"/simulator", "/occlusion", "/gps_bias", "/particle_filter"}, nodes)
        publishers = dict(rospy.get_master().getSystemState()[2][0])
        for topic, node in (("/gps/fix", "/simulator"), ("/gps/fix_weighted", "/occlusion"), ("/gps/bias", "/gps_bias"),
                            ("/odometry/filtered", "/particle_filter"), ("/particle_cloud", "/particle_filter")):
            self.assertEqual(publishers[topic], [node], topic)

    def test_bias_node_and_filter_take_the_weighted_fixes(self):
        subscribers = dict(rospy.get_master().getSystemState()[2][1])
        self.assertLessEqual({"/gps_bias", "/particle_filter"}, set(subscribers["/gps/fix_weighted"]))
        self.assertNotIn("/gps_bias", subscribers["/gps/fix"])
        self.assertNotIn("/particle_filter", subscribers["/gps/fix"])
        weighted, claimed = self.got["gps/fix_weighted"], self.got["gps/fix"]
        common = [t for t in weighted if t in claimed and claimed[t].status.status >= 0]
        self.assertGreater(len(common), 3 * DRIVE_S)
        changed = [t for t in common
                   if weighted[t].position_covariance[0] > 1.01 * claimed[t].position_covariance[0]]
        self.assertGreater(len(changed), 0.5 * len(common), "between buildings most fixes are worse than they claim")

    def test_every_fix_passes_through_all_nodes(self):
        """From the first fix whose bias is known on: by its stamp, whatever the order of arrival."""
        biases = self.got["gps/bias"]
        usable = [t for t, bias in biases.items() if bias.fix.decision != FixDecision.NOT_EXAMINED]
        self.assertGreater(len(usable), 3 * DRIVE_S)
        missing = [t for t in biases if min(usable) < t < max(usable) and t not in self.got["gps/fix_weighted"]]
        self.assertEqual(missing, [])
        fixes = [t for t in self.got["gps/fix_weighted"] if min(usable) < t < max(usable)]
        self.assertEqual([t for t in fixes if t not in biases], [], "a weighted fix without its bias")
        for t in usable:
            self.assertTrue(math.isfinite(biases[t].radius) and biases[t].radius >= 0.0)
        status = self.got["particle_filter/status"]
        newest = status[max(status)]
        self.assertGreater(newest.fixes_used, 0.7 * len(usable))
        self.assertGreater(max(each.bias_radius for each in status.values() if math.isfinite(each.bias_radius)), 0.0)

    def test_estimate_is_near_the_truth(self):
        estimates, truth = self.got["odometry/filtered"], self.got["ground_truth/odom"]
        common = sorted(set(estimates) & set(truth))
        self.assertGreater(len(common), 0.8 * len(estimates))
        errors = []
        for t in common:
            a, b = estimates[t].pose.pose.position, truth[t].pose.pose.position
            errors.append(math.hypot(a.x - b.x, a.y - b.y))
        rmse = math.sqrt(sum(error * error for error in errors) / len(errors))
        rospy.loginfo("particle filter behind the occlusion node: RMSE %.1f m, max %.1f m", rmse, max(errors))
        self.assertTrue(all(math.isfinite(error) for error in errors))
        self.assertLess(rmse, RMSE_BOUND_M)
        self.assertLess(max(errors), MAX_BOUND_M)

    def test_particle_clouds(self):
        estimates = self.got["odometry/filtered"]
        for topic in ("particle_cloud", "particle_cloud_weighted"):
            clouds = {t: cloud for t, cloud in self.got[topic].items() if t in estimates}
            self.assertGreater(len(clouds), 0.5 * 5.0 * DRIVE_S, topic)
            self.assertEqual({cloud.header.frame_id for cloud in clouds.values()}, {"map"})
        for t, cloud in self.got["particle_cloud"].items():
            self.assertEqual(len(cloud.poses), 1000)
            for pose in cloud.poses[::50]:
                q = pose.orientation
                self.assertAlmostEqual(q.z * q.z + q.w * q.w, 1.0, places=6)
                self.assertEqual((q.x, q.y, pose.position.z), (0.0, 0.0, 0.0))
            if t not in estimates:
                continue
            place = estimates[t].pose.pose.position
            nearest = min(math.hypot(pose.position.x - place.x, pose.position.y - place.y) for pose in cloud.poses)
            self.assertLess(nearest, 5.0, "the estimate is a mean of particles of one cluster")
        for cloud in self.got["particle_cloud_weighted"].values():
            self.assertEqual(cloud.width * cloud.height, 1000)

    def test_tf_is_the_estimate(self):
        estimates = self.got["odometry/filtered"]
        examined = 0
        for t in sorted(estimates)[::50]:
            stamp = estimates[t].header.stamp
            if not self.buffer.can_transform("map", "base_link", stamp):
                continue  # older than the listener, or between two transforms that have not come
            found = self.buffer.lookup_transform("map", "base_link", stamp).transform.translation
            place = estimates[t].pose.pose.position
            self.assertLess(math.hypot(found.x - place.x, found.y - place.y), 1.0)
            examined += 1
        self.assertGreater(examined, 10)


if __name__ == "__main__":
    rospy.init_node("test_whole_graph")
    rostest.rosrun("urban_gnss_localization", "test_whole_graph", WholeGraphTest)
