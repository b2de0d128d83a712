#!/usr/bin/env python3
"""replay.launch occlusion:=true, live, gives what `replay --occlusion` gives offline: the same bag of a simulated drive
with a small lidar, through occlusion_node into the localizer."""
import math
import os
import signal
import subprocess
import tempfile
import threading
import unittest

import rosbag
import rosnode
import rospy
import rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix
from urban_gnss_localization.msg import Visibility

DRIVE_S = 20
WAIT_S = 100.0  # of the wall clock: the bag is played at its own speed
# The start is given: an odometry message more or less before it would move everything after it.
PARAMS = """
ukf:
  datum: [22.2988, 114.1722, 5.0]
  expert: {start: {initial_pose: [%g, %g, %g], initial_heading_sigma: 0.05}}
occlusion: {model: paper}
"""
TOPICS = {"gps/fix_weighted": NavSatFix, "gps/visibility": Visibility, "odometry/filtered": Odometry}


def rosrun(*arguments):
    subprocess.run(["rosrun", "urban_gnss_localization", *map(str, arguments)], check=True, timeout=120)


def median(values):
    return sorted(values)[len(values) // 2]


def sigma(fix):
    return math.sqrt(fix.position_covariance[0] + fix.position_covariance[4])


class ReplayOcclusionTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        drive, out = (os.path.join(cls.scratch.name, name) for name in ("drive.bag", "out.bag"))
        params = os.path.join(cls.scratch.name, "params.yaml")
        rosrun("simulate", "--scenario", "downtown_grid", "--duration", DRIVE_S, "--set",
               "lidar.points_per_revolution=180", "--set", "lidar.beams=8", "--output", drive)
        with rosbag.Bag(drive) as bag:
            pose = next(bag.read_messages("/ground_truth/odom")).message.pose.pose
        with open(params, "w", encoding="utf-8") as file:
            file.write(PARAMS % (pose.position.x, pose.position.y,
                                 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)))
        rosrun("replay", drive, "--occlusion", "--localizer", "ukf", "--params", params, "--output", out)
        cls.offline = {topic: {} for topic in TOPICS}
        with rosbag.Bag(out) as bag:
            for topic, message, _ in bag.read_messages(["/" + name for name in TOPICS]):
                cls.offline[topic.lstrip("/")][message.header.stamp.to_nsec()] = message
        cls.play(drive, params)

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    @classmethod
    def play(cls, drive, params):
        cls.news = threading.Condition()
        cls.live = {topic: {} for topic in TOPICS}
        for topic, kind in TOPICS.items():
            rospy.Subscriber(topic, kind, cls.on_message, topic, queue_size=5000)
        launch = subprocess.Popen(["roslaunch", "urban_gnss_localization", "replay.launch", "bag:=" + drive,
                                   "localizer:=ukf", "params:=" + params, "occlusion:=true", "rviz:=false",
                                   "end_with_bag:=false"],
                                  start_new_session=True, stdout=subprocess.DEVNULL)  # the player says much
        try:
            with cls.news:
                cls.news.wait_for(lambda: all(map(cls.is_whole, ("gps/fix_weighted", "odometry/filtered"))), WAIT_S)
            cls.nodes = set(rosnode.get_node_names())
            cls.subscribers = dict(rospy.get_master().getSystemState()[2][1])
        finally:
            os.killpg(launch.pid, signal.SIGINT)
            launch.wait(timeout=30)

    @classmethod
    def is_whole(cls, topic):
        """All but the last second of what came offline: the last fixes wait for what comes no more."""
        end = max(cls.offline[topic]) - 1e9
        return max(cls.live[topic], default=0) >= end

    @classmethod
    def on_message(cls, message, topic):
        with cls.news:
            cls.live[topic][message.header.stamp.to_nsec()] = message
            cls.news.notify_all()

    def test_the_graph(self):
        self.assertLessEqual({"/occlusion", "/ukf", "/player"}, self.nodes)
        self.assertIn("/occlusion", self.subscribers["/points"])
        self.assertIn("/ukf", self.subscribers["/gps/fix_weighted"])
        self.assertNotIn("/ukf", self.subscribers["/gps/fix"])

    def pairs(self, topic):
        common = sorted(set(self.offline[topic]) & set(self.live[topic]))
        self.assertGreater(len(common), 0.9 * len(self.offline[topic]), topic)
        return [(self.offline[topic][t], self.live[topic][t]) for t in common]

    def test_the_same_satellites_are_blocked(self):
        self.assertEqual({v.model for v in self.live["gps/visibility"].values()}, {"paper"}, "the section of params")
        same, count, with_map = 0, 0, 0
        for a, b in self.pairs("gps/visibility"):
            if a.missing or b.missing:
                continue
            with_map += 1
            for one, other in zip(a.satellites, b.satellites):
                self.assertEqual(one.name, other.name)
                same += one.visibility == other.visibility
                count += 1
        self.assertGreater(with_map, 3 * DRIVE_S, "of 5 fixes a second")
        self.assertGreater(same, 0.97 * count)

    def test_the_same_covariances(self):
        ratios = [abs(math.log(sigma(b) / sigma(a))) for a, b in self.pairs("gps/fix_weighted") if a.status.status >= 0]
        self.assertLess(median(ratios), 0.02)

    def test_the_same_estimates(self):
        distances = [math.hypot(a.pose.pose.position.x - b.pose.pose.position.x,
                                a.pose.pose.position.y - b.pose.pose.position.y)
                     for a, b in self.pairs("odometry/filtered")]
        rospy.loginfo("live against offline: median %.3f m, max %.3f m", median(distances), max(distances))
        self.assertLess(median(distances), 0.1)
        self.assertLess(max(distances), 2.0)


if __name__ == "__main__":
    rospy.init_node("test_replay_occlusion")
    rostest.rosrun("urban_gnss_localization", "test_replay_occlusion", ReplayOcclusionTest)
