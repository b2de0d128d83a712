#!/usr/bin/env python3
"""demo.launch, closed loop: the robot drives a lap through the shadow on its own estimate."""
import math
import threading
import unittest

import rospy
import rostest
import tf2_ros
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool
from urban_gnss_localization.msg import LocalizationStatus
from visualization_msgs.msg import MarkerArray

LAP_S = 10.0          # simulated: a ring of 15 m at 10 m/s takes 9.4 s
BOUND_M = 5.0         # the experiment calls a run diverged beyond this
RMSE_BOUND_M = 2.0    # the experiment's shadow RMSE over 30 seeds is 1.0 m


class DemoTest(unittest.TestCase):
    def test_lap(self):
        truth, estimates, shadow, status = {}, {}, [], []
        done = threading.Event()
        order = []

        def on_truth(message):
            truth[message.header.stamp.to_nsec()] = message.pose.pose.position
            if message.header.stamp.to_sec() > 1.0 + LAP_S:
                done.set()

        def on_estimate(message):
            order.append(message.header.stamp)
            estimates[message.header.stamp.to_nsec()] = message.pose.pose.position

        clouds, markers = [], {}
        buffer = tf2_ros.Buffer(debug=False)
        tf2_ros.TransformListener(buffer)
        rospy.Subscriber("ground_truth/odom", Odometry, on_truth, queue_size=2000)
        rospy.Subscriber("odometry/filtered", Odometry, on_estimate, queue_size=2000)
        rospy.Subscriber("ground_truth/in_shadow", Bool, lambda m: shadow.append(m.data), queue_size=2000)
        rospy.Subscriber("particle_filter/status", LocalizationStatus, status.append, queue_size=2000)
        rospy.Subscriber("particle_cloud_weighted", PointCloud2, clouds.append, queue_size=10)
        for topic in ("world_markers", "targets", "gps/bias_markers"):
            rospy.Subscriber(topic, MarkerArray, lambda m, topic=topic: markers.__setitem__(topic, m), queue_size=10)
        self.assertTrue(done.wait(100.0), "the simulation did not get through a lap")

        common = sorted(set(truth) & set(estimates))
        self.assertGreater(len(common), 0.8 * LAP_S * 100)
        errors = [math.hypot(truth[t].x - estimates[t].x, truth[t].y - estimates[t].y) for t in common]
        self.assertTrue(all(math.isfinite(e) for e in errors))
        self.assertLess(max(errors), BOUND_M)
        self.assertLess(math.sqrt(sum(e * e for e in errors) / len(errors)), RMSE_BOUND_M)
        self.assertTrue(any(shadow) and not all(shadow), "the lap must cross the border of the shadow")
        self.assertTrue(all(a < b for a, b in zip(order, order[1:])), "stamps must ascend")
        self.assertTrue(status[-1].healthy, status[-1].reason)
        self.assertGreater(status[-1].fixes_used, 500)
        self.assertEqual(clouds[-1].width * clouds[-1].height, 1000)
        self.assertEqual(set(markers), {"world_markers", "targets", "gps/bias_markers"})
        self.assertTrue(buffer.can_transform("map", "base_link", rospy.Time(0)))


if __name__ == "__main__":
    rospy.init_node("test_demo")
    rostest.rosrun("urban_gnss_localization", "test_demo", DemoTest)
