#!/usr/bin/env python3
"""Two robots on one master: one moves sideways with an IMU upside down, as tf says, the other leaves its twist empty."""
import math
import os
import sys

import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, NavSatFix
from urban_gnss_localization.msg import LocalizationStatus

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from localizer_case import LocalizerCase  # noqa: E402

STEPS = 600          # messages of odometry, at 10 Hz
METRE_NORTH = 1.0 / 111200.0  # degrees
METRE_EAST = 1.0 / 74400.0


def pose_at(k, sideways):
    """x, y, yaw of a robot that drives, or slides, along a circle of 20 m round the datum's north, from (0, 0, 0)."""
    angle = 0.05 * 0.1 * k * 1.5
    x, y = 20.0 * math.sin(angle), 20.0 * (1.0 - math.cos(angle))
    return x, y, angle - (0.5 * math.pi if sideways else 0.0)


def odometry(stamp, k, frames, sideways, with_twist):
    x, y, yaw = pose_at(k, sideways)
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id, message.child_frame_id = frames
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    if with_twist:
        message.twist.twist.linear.x, message.twist.twist.linear.y = (0.0, 1.5) if sideways else (1.5, 0.0)
        message.twist.twist.angular.z = 0.075
    return message


def fix(stamp, k):
    x, y, _ = pose_at(k, False)
    message = NavSatFix()
    message.header.stamp = stamp
    message.header.frame_id = "gps"
    message.latitude, message.longitude = 48.1374 + y * METRE_NORTH, 11.5755 + x * METRE_EAST
    message.altitude = 520.0
    message.position_covariance = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0]
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    return message


def imu(stamp):
    """Upside down, without an orientation."""
    message = Imu()
    message.header.stamp = stamp
    message.header.frame_id = "robot1/imu_link"
    message.orientation_covariance[0] = -1.0
    message.angular_velocity.z = -0.075
    return message


def upside_down():
    transform = TransformStamped()
    transform.header.stamp = rospy.Time.from_sec(1000.0)
    transform.header.frame_id, transform.child_frame_id = "robot1/base_link", "robot1/imu_link"
    transform.transform.rotation.x = 1.0
    return transform


class RobotsTest(LocalizerCase):
    def drive(self, namespace, node, odom_topic, frames, sideways, with_twist, with_imu):
        self.estimate, self.status = None, None
        ends = [rospy.Subscriber(namespace + "/" + node + "/status", LocalizationStatus, self.on_status),
                rospy.Subscriber(namespace + "/odometry/filtered", Odometry, self.on_estimate, queue_size=1000)]
        odometries = rospy.Publisher(namespace + odom_topic, Odometry, queue_size=1000)
        fixes = rospy.Publisher(namespace + "/gps/fix", NavSatFix, queue_size=1000)
        imus = rospy.Publisher(namespace + "/imu/data", Imu, queue_size=1000)
        self.connect([odometries, fixes, imus] + ends)
        for k in range(STEPS + 1):
            stamp = rospy.Time.from_sec(1000.0 + 0.1 * k)
            if with_imu:
                imus.publish(imu(stamp))
            if k % 10 == 0:
                fixes.publish(fix(stamp, k))
            odometries.publish(odometry(stamp, k, frames, sideways, with_twist))
            rospy.sleep(0.004)
        last = rospy.Time.from_sec(1000.0 + 0.1 * STEPS)
        self.wait(lambda: self.estimate is not None and self.estimate.header.stamp >= last, "no estimate")
        self.wait(lambda: self.status is not None and self.status.header.stamp >= last, "no status")
        x, y, _ = pose_at(STEPS, sideways)
        pose = self.estimate.pose.pose.position
        self.assertLess(math.hypot(pose.x - x, pose.y - y), 2.0)
        self.assertTrue(self.status.healthy, self.status.reason)
        self.assertEqual(self.estimate.header.frame_id, "map")

    def test_each_robot_has_its_own_localizer_topics_and_frames(self):
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        broadcaster = tf2_ros.StaticTransformBroadcaster()
        broadcaster.sendTransform(upside_down())
        rospy.sleep(1.0)
        self.drive("/robot1", "imm_ekf", "/odom", ("robot1/odom", "robot1/base_link"), True, True, True)
        self.assertEqual(self.estimate.child_frame_id, "robot1/base_link")
        self.drive("/robot2", "ukf", "/wheels/odometry", ("robot2/odom", "robot2/base_link"), False, False, False)
        self.assertEqual(self.estimate.child_frame_id, "robot2/base_link")
        for frame in ("robot1/odom", "robot2/odom"):
            self.assertTrue(buffer.can_transform("map", frame, rospy.Time(0), rospy.Duration(5.0)), frame)
        self.assertAlmostEqual(rospy.get_param("/robot1/imm_ekf/speed_scale_sigma"), 0.15)
        self.assertAlmostEqual(rospy.get_param("/robot2/ukf/speed_scale_sigma"), 0.03)
        listener.unregister()


if __name__ == "__main__":
    rospy.init_node("test_robots")
    rostest.rosrun("urban_gnss_localization", "test_robots", RobotsTest)
