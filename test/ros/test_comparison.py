#!/usr/bin/env python3
"""comparison.launch: every localizer runs in its namespace on the same fixes, one broadcasts tf, and the errors of all
are plotted."""
import math
import threading
import unittest

import rospy
import rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

NAMES = ("particle_filter", "switching_particle_filter", "imm_ekf", "complementary_ekf", "ukf")
# As in rviz/comparison.rviz.
COLOURS = ((230, 41, 41), (242, 153, 0), (41, 130, 255), (179, 77, 217), (26, 179, 64))
COMMON_S = 15.0  # simulated, during which all have an estimate
WAIT_S = 150.0   # of the wall clock, for a slow machine


class ComparisonTest(unittest.TestCase):
    def test_all_at_once(self):
        news = threading.Condition()
        estimates, truth, plots, senders = {name: {} for name in NAMES}, {}, [], set()

        def on_pose(message, store):
            with news:
                store[message.header.stamp.to_nsec()] = message.pose.pose.position
                news.notify_all()

        def on_plot(message):
            with news:
                plots.append(message)
                news.notify_all()

        def common():
            return set(truth).intersection(*estimates.values())

        def is_plotted():
            """The newest plot is from when all had been there for long."""
            stamps = common()
            return bool(stamps) and bool(plots) and plots[-1].header.stamp.to_nsec() - min(stamps) > COMMON_S * 1e9

        def on_tf(message):
            if any(each.child_frame_id == "odom" for each in message.transforms):
                senders.add(message._connection_header["callerid"])

        rospy.Subscriber("/tf", TFMessage, on_tf, queue_size=1000)
        for name in NAMES:
            rospy.Subscriber(name + "/odometry/filtered", Odometry, on_pose, estimates[name], queue_size=5000)
        rospy.Subscriber("ground_truth/odom", Odometry, on_pose, truth, queue_size=5000)
        rospy.Subscriber("error_plot", Image, on_plot, queue_size=2)
        ellipses = {}
        rospy.Subscriber("ellipses", Marker, lambda message: ellipses.__setitem__(message.id, message.color),
                         queue_size=1000)
        with news:
            self.assertTrue(news.wait_for(is_plotted, WAIT_S), {name: len(each) for name, each in estimates.items()})
            stamps, plot = common(), plots[-1]

        self.assertEqual(sorted(ellipses), list(range(len(NAMES))))
        for i, colour in enumerate(COLOURS):
            for part, value in zip((ellipses[i].r, ellipses[i].g, ellipses[i].b), colour):
                self.assertAlmostEqual(255.0 * part, value, delta=1.0)
        for name in NAMES:
            errors = [math.hypot(estimates[name][t].x - truth[t].x, estimates[name][t].y - truth[t].y) for t in stamps]
            rospy.loginfo("%s: at most %.1f m off", name, max(errors))
            self.assertLess(max(errors), 20.0, name)  # on the open car park

        self.assertEqual(senders, {"/imm_ekf/imm_ekf"}, "one alone may broadcast map -> odom")

        self.assertEqual((plot.encoding, plot.width, plot.height, plot.step), ("rgb8", 480, 480, 1440))
        self.assertEqual(len(plot.data), 480 * 1440)
        pixels = {tuple(plot.data[i:i + 3]) for i in range(0, len(plot.data), 3)}
        self.assertLessEqual(set(COLOURS), pixels)


if __name__ == "__main__":
    rospy.init_node("test_comparison")
    rostest.rosrun("urban_gnss_localization", "test_comparison", ComparisonTest)
