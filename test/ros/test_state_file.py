#!/usr/bin/env python3
"""A localizer that is killed goes on where it was (~state_file); a state that says nothing is left out, and it is said
why. Stamps are those of a recording: the computer's clock plays no part."""
import json
import math
import os
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import rospy
import rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix
from urban_gnss_localization.msg import LocalizationStatus

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import drive  # noqa: E402

NODE = "/localizer"
WAIT_S = 60.0
FAR_M = 4.0   # of an estimate, on fixes of 1 m of which a quarter are 8 m off


class StateFileTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.file = os.path.join(self.folder.name, "state.json")
        rospy.set_param(NODE + "/state_file", self.file)
        self.news = threading.Condition()
        self.estimates, self.lines, self.datum, self.status, self.node = [], [], None, None, None
        self.ends = {"odom": rospy.Publisher("odom", Odometry, queue_size=1000, tcp_nodelay=True),
                     "gps/fix": rospy.Publisher("gps/fix", NavSatFix, queue_size=1000, tcp_nodelay=True)}
        self.outputs = [rospy.Subscriber("odometry/filtered", Odometry, self.take, "estimates", queue_size=1000),
                        rospy.Subscriber("gps/datum", NavSatFix, self.take, "datum", queue_size=10),
                        rospy.Subscriber(NODE + "/status", LocalizationStatus, self.take, "status", queue_size=1000)]
        self.messages = drive.Drive(300.0)
        self.next = 0

    def tearDown(self):
        self.kill()
        for end in self.outputs + list(self.ends.values()):
            end.unregister()
        self.folder.cleanup()

    def take(self, message, name):
        with self.news:
            if name in ("datum", "status"):
                setattr(self, name, message)
            else:
                getattr(self, name).append(message)
            self.news.notify_all()

    def wait(self, condition, what):
        end = time.monotonic() + WAIT_S
        with self.news:
            while not condition():
                self.assertLess(time.monotonic(), end, "waited for " + what)
                self.news.wait(0.05)

    def program(self):
        return subprocess.Popen(["rosrun", "urban_gnss_localization", "imm_ekf_node", "__name:=" + NODE[1:]],
                                stderr=subprocess.PIPE, universal_newlines=True)

    def start(self):
        self.estimates.clear()
        self.lines.clear()
        self.status = None
        self.node = self.program()
        self.reader = threading.Thread(target=self.read, args=(self.node,))
        self.reader.start()
        connected = list(self.ends.values()) + self.outputs
        self.wait(lambda: all(end.get_num_connections() for end in connected), "connections")
        self.wait(lambda: self.status is not None, "a status")

    def read(self, node):
        """What it says, from its first line on: /rosout is connected too late for that."""
        for line in node.stderr:
            self.take(line, "lines")

    def kill(self):
        """kill -9. Its connections are gone afterwards."""
        if self.node is None:
            return
        self.node.kill()
        self.node.wait()
        self.reader.join()
        self.node.stderr.close()
        self.node = None
        self.wait(lambda: not any(end.get_num_connections() for end in self.ends.values()), "its end")

    def feed(self, seconds, topics=("odom", "gps/fix")):
        until = self.stamp() + rospy.Duration(seconds)
        while self.stamp() < until:
            topic, message = self.messages.messages[self.next]
            self.next += 1
            if topic in topics:
                self.ends[topic].publish(message)
                time.sleep(0.001)

    def stamp(self):
        return self.messages.messages[self.next][1].header.stamp

    def last_odometry(self):
        return next(m for t, m in reversed(self.messages.messages[:self.next]) if t == "odom").header.stamp

    def wait_for_estimate(self):
        self.wait(lambda: self.estimates and self.estimates[-1].header.stamp == self.last_odometry(), "the estimate")

    def error_m(self, estimate):
        """From the truth about drive.DATUM, by the datum that was published."""
        x, y, _ = self.messages.truth[estimate.header.stamp.to_nsec()]
        metre_north, metre_east = (b - a for a, b in zip(drive.DATUM, drive.to_geodetic(1.0, 1.0)))
        position = estimate.pose.pose.position
        return math.hypot(position.x + (self.datum.longitude - drive.DATUM[1]) / metre_east - x,
                          position.y + (self.datum.latitude - drive.DATUM[0]) / metre_north - y)

    def saved(self):
        if not os.path.exists(self.file):
            return None
        with open(self.file) as stream:
            return json.load(stream)

    def wait_until_saved(self):
        stamp = self.last_odometry().to_nsec()
        self.wait(lambda: self.saved() is not None and self.saved()["stamp_ns"] == stamp, "the state of now")

    def drive_until_saved(self):
        self.start()
        self.feed(60.0)
        self.wait_for_estimate()
        self.wait(lambda: self.status.healthy, "a healthy status")
        self.wait_until_saved()

    def has_said(self, text):
        self.wait(lambda: any(text in line for line in self.lines), "the line: " + text)

    def test_1_after_kill_9_the_estimate_is_back_at_the_first_odometry(self):
        self.drive_until_saved()
        datum = self.datum
        self.kill()
        self.datum = None
        self.feed(2.0, ())  # while it is away
        self.start()
        due = next(m for t, m in self.messages.messages[self.next:] if t == "odom").header.stamp
        self.feed(0.06, ("odom",))
        self.wait_for_estimate()
        first = self.estimates[0]
        self.assertEqual(first.header.stamp, due, "of the first message")
        self.wait(lambda: self.datum is not None, "the datum")
        self.assertEqual((self.datum.latitude, self.datum.longitude), (datum.latitude, datum.longitude))
        # It has driven 10 m meanwhile; what is not known is covered.
        self.assertLess(self.error_m(first), 10.0 + FAR_M)
        self.assertGreater(first.pose.covariance[0], 4.0 ** 2)
        self.wait(lambda: "no fix" in self.status.reason, "a status that says so")
        self.assertFalse(self.status.healthy)
        self.feed(15.0)
        self.wait_for_estimate()
        self.wait(lambda: self.status.healthy, "a healthy status")
        self.assertLess(self.error_m(self.estimates[-1]), FAR_M)
        self.wait_until_saved()

    def test_2_what_says_nothing_is_left_out_with_the_reason(self):
        self.drive_until_saved()
        good = self.saved()
        self.kill()
        spoilt = {"no whole JSON": '{"format": ', "its map_frame is 'world', must be 'map'": dict(good, map_frame="world"),
                  "variance of": dict(good, covariance=[-1.0] + good["covariance"][1:]),
                  "later than the odometry": dict(good, stamp_ns=good["stamp_ns"] + 10 ** 12),
                  "s old, at most 60 s are believed": dict(good, stamp_ns=good["stamp_ns"] - 10 ** 11)}
        for reason, content in spoilt.items():
            with open(self.file, "w") as stream:
                stream.write(content if isinstance(content, str) else json.dumps(content))
            self.start()
            self.feed(1.0, ("odom",))
            self.has_said(reason)
            self.assertEqual(self.estimates, [], reason)
            self.kill()
        self.start()  # with the last of them
        self.feed(40.0)
        self.wait_for_estimate()
        self.wait_until_saved()

    def test_3_a_file_that_cannot_be_one_stops_the_node(self):
        for file, reason in (("state.json", "must be an absolute path"), (self.file + "/x", "there is no such folder"),
                             (3, "must be a text")):
            rospy.set_param(NODE + "/state_file", file)
            program = self.program()
            _, said = program.communicate(timeout=WAIT_S)
            self.assertEqual(program.returncode, 1)
            self.assertIn(reason, said)

    def test_4_without_it_nothing_is_written(self):
        rospy.delete_param(NODE + "/state_file")
        self.start()
        self.feed(60.0)
        self.wait_for_estimate()
        self.wait(lambda: self.status.healthy, "a healthy status")
        time.sleep(1.5)  # longer than between two states
        self.assertEqual(os.listdir(self.folder.name), [])


if __name__ == "__main__":
    rospy.init_node("test_state_file")
    rostest.rosrun("urban_gnss_localization", "test_state_file", StateFileTest)
