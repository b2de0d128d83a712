#!/usr/bin/env python3
"""rviz's 2D Pose Estimate starts the localizer, and starts it anew."""
import os
import sys

import rospy
import rostest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from localizer_case import LocalizerCase  # noqa: E402

ATTEMPTS = 100


class InitialPoseTest(LocalizerCase):
    def setUp(self):
        super().setUp()
        self.stamp = rospy.Time(1000.0)
        self.odometry = rospy.Publisher("odom", Odometry, queue_size=10)
        self.told = rospy.Publisher("initialpose", PoseWithCovarianceStamped, queue_size=10)
        subscriber = rospy.Subscriber("odometry/filtered", Odometry, self.on_estimate, queue_size=10)
        self.connect([self.odometry, self.told, subscriber])

    def stand(self):
        """One message of a robot that stands."""
        self.stamp += rospy.Duration(0, 100000000)
        odometry = Odometry()
        odometry.header.stamp = self.stamp
        odometry.header.frame_id, odometry.child_frame_id = "odom", "base_link"
        odometry.pose.pose.orientation.w = 1.0
        self.odometry.publish(odometry)
        rospy.sleep(0.02)

    def stand_until(self, condition, what):
        for _ in range(ATTEMPTS):
            self.stand()
            if condition():
                return
        self.fail(what)

    def tell(self, x, y):
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id = "map"
        pose.pose.pose.position.x, pose.pose.pose.position.y = x, y
        pose.pose.pose.orientation.w = 1.0
        for entry in (0, 7, 35):  # x, y and yaw, as rviz sets them
            pose.pose.covariance[entry] = 0.25
        self.told.publish(pose)

    def is_at(self, x, y):
        position = self.estimate.pose.pose.position if self.estimate else None
        return position is not None and abs(position.x - x) < 0.1 and abs(position.y - y) < 0.1

    def test_starts_and_starts_anew(self):
        for _ in range(10):
            self.stand()
        self.assertIsNone(self.estimate, "nobody has told where it is")
        self.tell(12.0, -3.0)
        self.stand_until(lambda: self.is_at(12.0, -3.0), "no estimate at the pose that was told")
        self.tell(-40.0, 7.0)
        self.stand_until(lambda: self.is_at(-40.0, 7.0), "no estimate at the second pose")


if __name__ == "__main__":
    rospy.init_node("test_initialpose")
    rostest.rosrun("urban_gnss_localization", "test_initialpose", InitialPoseTest)
