#!/usr/bin/env python3
"""`doctor --live` on a running robot whose twist is in km/h, and on what record.launch recorded of it meanwhile."""
import glob
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import unittest

import rosbag
import rosnode
import rospy
import rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from drive import ODOM_RATE_HZ, Drive  # noqa: E402

LISTENING_S = 10.0
ODOM, FIX = "/wheel/odom", "/gps/fix"


class Robot(threading.Thread):
    """Publishes a drive by the wall clock, with stamps of now, until it is stopped."""

    def __init__(self, speed_factor):
        super().__init__(daemon=True)
        self.speed_factor = speed_factor
        self.is_stopped = threading.Event()
        self.publishers = {"odom": rospy.Publisher(ODOM, Odometry, queue_size=100),
                           "gps/fix": rospy.Publisher(FIX, NavSatFix, queue_size=100)}

    def run(self):
        start = rospy.Time.now()
        rate = rospy.Rate(ODOM_RATE_HZ)
        drive = Drive(seconds=170.0)
        first = drive.messages[0][1].header.stamp
        for topic, message in drive.messages:
            if self.is_stopped.is_set() or rospy.is_shutdown():
                return
            message.header.stamp = start + (message.header.stamp - first)
            if topic == "odom":
                message.twist.twist.linear.x *= self.speed_factor
                rate.sleep()
            self.publishers[topic].publish(message)


class DoctorLiveTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.robot = Robot(speed_factor=3.6)
        cls.robot.start()
        cls.addClassCleanup(cls.robot.is_stopped.set)

    def run_doctor(self, *arguments):
        report = os.path.join(self.folder.name, "report.json")
        done = subprocess.run(["rosrun", "urban_gnss_localization", "doctor", "--json", report] + list(arguments),
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, timeout=100)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        with open(report, encoding="utf-8") as stream:
            return done.stdout, json.load(stream)

    def check(self, report):
        failed = {finding["check"]: finding for finding in report["findings"] if finding["level"] == "FAIL"}
        self.assertIn("odometry.pose_and_twist", failed, report)
        self.assertIn("km/h", json.dumps(failed["odometry.pose_and_twist"]))

    def start_recording(self):
        recorder = subprocess.Popen(["roslaunch", "urban_gnss_localization", "record.launch",
                                     "folder:=" + self.folder.name, "odom_topic:=" + ODOM])
        self.addCleanup(recorder.kill)
        deadline = rospy.Time.now() + rospy.Duration(30.0)
        while not all(end.get_num_connections() for end in self.robot.publishers.values()):
            self.assertLess(rospy.Time.now(), deadline, "nobody records")
            rospy.sleep(0.1)
        return recorder

    def test_a_watch_that_is_ended_is_not_registered_any_more(self):
        def watchers():
            return [name for name in rosnode.get_node_names() if name.startswith("/watch")]

        for number in (signal.SIGTERM, signal.SIGINT):
            watch = subprocess.Popen(["rosrun", "urban_gnss_localization", "watch"], stderr=subprocess.DEVNULL)
            self.addCleanup(watch.kill)
            deadline = rospy.Time.now() + rospy.Duration(30.0)
            while not watchers():
                self.assertLess(rospy.Time.now(), deadline, "watch does not come")
                rospy.sleep(0.1)
            watch.send_signal(number)
            self.assertEqual(watch.wait(30.0), 2)  # nothing was said
            self.assertEqual(watchers(), [])

    def test_live_and_recorded(self):
        recorder = self.start_recording()
        said, report = self.run_doctor("--live", "--seconds", str(LISTENING_S))
        self.assertIn("odometry:   " + ODOM, said)
        self.check(report)
        recorder.send_signal(signal.SIGINT)
        recorder.wait(30.0)
        bags = glob.glob(os.path.join(self.folder.name, "drive_*.bag"))
        self.assertEqual(len(bags), 1, os.listdir(self.folder.name))
        with rosbag.Bag(bags[0]) as bag:
            counts = {topic: info.message_count for topic, info in bag.get_type_and_topic_info().topics.items()}
        self.assertGreater(counts.get(ODOM, 0), 0.8 * LISTENING_S * ODOM_RATE_HZ, counts)
        self.assertGreater(counts.get(FIX, 0), 0.8 * LISTENING_S * ODOM_RATE_HZ / 10, counts)
        self.check(self.run_doctor(bags[0])[1])


if __name__ == "__main__":
    rospy.init_node("test_doctor_live")
    rostest.rosrun("urban_gnss_localization", "test_doctor_live", DoctorLiveTest)
