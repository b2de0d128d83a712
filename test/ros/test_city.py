#!/usr/bin/env python3
"""demo.launch in a city: every sensor and the truth are there, and the localizer follows the robot."""
import math
import threading
import unittest

import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import TwistWithCovarianceStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, NavSatFix, PointCloud2
from urban_gnss_localization.msg import SatelliteArray, SignalPathArray
from visualization_msgs.msg import MarkerArray

DRIVE_S = 60.0   # simulated
BOUND_M = 60.0   # a street's block: a localizer that is farther off is lost
TOPICS = {"odom": Odometry, "imu/data": Imu, "gps/fix": NavSatFix, "gps/satellites": SatelliteArray,
          "gps/velocity": TwistWithCovarianceStamped, "gps/datum": NavSatFix, "points": PointCloud2,
          "ground_truth/odom": Odometry, "ground_truth/gps_error": Vector3Stamped,
          "ground_truth/signal_paths": SignalPathArray, "world_markers": MarkerArray, "traffic_markers": MarkerArray,
          "signal_markers": MarkerArray}


class CityTest(unittest.TestCase):
    def test_drive(self):
        latest, counts, disordered = {}, {topic: 0 for topic in TOPICS}, []
        truth, estimates = {}, {}
        start = []
        done = threading.Event()

        def on_message(message, topic):
            before = latest.get(topic)
            if hasattr(message, "header") and before is not None and message.header.stamp <= before.header.stamp:
                disordered.append(topic)
            latest[topic] = message
            counts[topic] += 1

        def on_truth(message):
            start.append(message.header.stamp)
            truth[message.header.stamp.to_nsec()] = message.pose.pose.position
            if (message.header.stamp - start[0]).to_sec() > DRIVE_S:
                done.set()

        def on_estimate(message):
            estimates[message.header.stamp.to_nsec()] = message.pose.pose.position

        buffer = tf2_ros.Buffer(debug=False)
        tf2_ros.TransformListener(buffer)
        for topic, kind in TOPICS.items():
            rospy.Subscriber(topic, kind, on_message, topic, queue_size=2000)
        rospy.Subscriber("ground_truth/odom", Odometry, on_truth, queue_size=5000)
        rospy.Subscriber("odometry/filtered", Odometry, on_estimate, queue_size=5000)
        self.assertTrue(done.wait(150.0), "the simulation did not get through %g s" % DRIVE_S)

        self.assertEqual([topic for topic, count in counts.items() if count == 0], [])
        self.assertEqual(disordered, [], "stamps must ascend")
        self.assertGreater(counts["gps/fix"], 0.8 * 5.0 * DRIVE_S)
        self.assertGreater(counts["points"], 0.8 * 10.0 * DRIVE_S)
        self.assertEqual(counts["gps/datum"], 1, "the localizer takes the simulator's datum")
        self.assertEqual(latest["points"].header.frame_id, "lidar")
        self.assertGreater(latest["points"].width * latest["points"].height, 5000)
        self.assertEqual(latest["ground_truth/odom"].header.frame_id, "map")
        self.assertEqual(latest["gps/fix"].header.frame_id, "gps")
        self.assertGreater(len(latest["gps/satellites"].satellites), 5)
        self.assertGreater(len(latest["world_markers"].markers), 0)

        for target, source in (("map", "odom"), ("odom", "base_link"), ("map", "base_link"), ("base_link", "lidar"),
                               ("base_link", "gps"), ("base_link", "imu_link"), ("map", "base_link_truth")):
            self.assertTrue(buffer.can_transform(target, source, rospy.Time(0)), target + " <- " + source)

        common = sorted(set(truth) & set(estimates))
        self.assertGreater(len(common), 0.6 * DRIVE_S * 50)
        errors = [math.hypot(truth[t].x - estimates[t].x, truth[t].y - estimates[t].y) for t in common]
        self.assertTrue(all(math.isfinite(error) for error in errors))
        rospy.loginfo("estimate: max %.1f m, rmse %.1f m", max(errors),
                      math.sqrt(sum(e * e for e in errors) / len(errors)))
        self.assertLess(max(errors), BOUND_M)
        moved = math.hypot(truth[common[-1]].x - truth[common[0]].x, truth[common[-1]].y - truth[common[0]].y)
        self.assertGreater(moved, 150.0)


if __name__ == "__main__":
    rospy.init_node("test_city")
    rostest.rosrun("urban_gnss_localization", "test_city", CityTest)
