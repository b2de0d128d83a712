#!/usr/bin/env python3
"""gps/velocity live: both types of messages reach the localizer and tell it the heading; another type does no harm."""
import math
import os
import sys

import rospy
import rostest
from geometry_msgs.msg import TwistStamped, TwistWithCovarianceStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from urban_gnss_localization.msg import LocalizationStatus

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from localizer_case import LocalizerCase  # noqa: E402

YAW = 0.4      # rad, true, where the localizer starts at 0 +- 0.5
SPEED = 2.0    # m/s
ODOMETRY = 200  # messages, at 10 Hz
EVERY = 10     # messages of odometry, a velocity


def velocity(kind, stamp):
    message = kind()
    message.header.stamp = stamp
    message.header.frame_id = "gps"
    if kind is Vector3Stamped:
        return message
    twist = message.twist if kind is TwistStamped else message.twist.twist
    twist.linear.x, twist.linear.y = SPEED * math.cos(YAW), SPEED * math.sin(YAW)
    if kind is TwistWithCovarianceStamped:
        message.twist.covariance[0] = message.twist.covariance[7] = 0.01
    return message


def odometry(stamp, x):
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id, message.child_frame_id = "odom", "base_link"
    message.pose.pose.position.x = x
    message.pose.pose.orientation.w = 1.0
    message.twist.twist.linear.x = SPEED
    return message


class VelocityTest(LocalizerCase):
    def drive(self, kind, namespace):
        """Drives straight on; returns the last estimate and how many velocities were used."""
        self.estimate = None
        subscribers = [rospy.Subscriber(namespace + "/imm_ekf/status", LocalizationStatus, self.on_status),
                       rospy.Subscriber(namespace + "/odometry/filtered", Odometry, self.on_estimate, queue_size=1000)]
        odometries = rospy.Publisher(namespace + "/odom", Odometry, queue_size=1000)
        velocities = rospy.Publisher(namespace + "/gps/velocity", kind, queue_size=1000)
        self.connect([odometries, velocities] + subscribers)
        for k in range(ODOMETRY + 1):
            stamp = rospy.Time.from_sec(1000.0 + 0.1 * k)
            if k % EVERY == 0:
                velocities.publish(velocity(kind, stamp))
            odometries.publish(odometry(stamp, 0.1 * SPEED * k))
            # One message at a time: no queue is long enough for a machine that is slow enough.
            self.wait(lambda: self.estimate is not None and self.estimate.header.stamp >= stamp, "no estimate")
        self.status = None
        self.wait(lambda: self.status is not None, "no status")
        for subscriber in subscribers:
            subscriber.unregister()
        orientation = self.estimate.pose.pose.orientation
        return 2.0 * math.atan2(orientation.z, orientation.w), self.status.velocities_used

    def test_velocities_of_every_type(self):
        for namespace, kind in (("plain", TwistStamped), ("with_covariance", TwistWithCovarianceStamped)):
            yaw, used = self.drive(kind, namespace)
            # The last may still be on its way: it comes on a connection of its own.
            self.assertGreaterEqual(used, ODOMETRY // EVERY, kind)
            self.assertAlmostEqual(yaw, YAW, delta=0.1, msg=str(kind))
        yaw, used = self.drive(Vector3Stamped, "wrong")
        self.assertEqual(used, 0)
        self.assertAlmostEqual(yaw, 0.0, delta=0.1)


if __name__ == "__main__":
    rospy.init_node("test_velocity")
    rostest.rosrun("urban_gnss_localization", "test_velocity", VelocityTest)
