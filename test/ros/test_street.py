#!/usr/bin/env python3
"""The occlusion node beside a wall: node and nodelet agree, and what is wrong or missing is handled and said."""
import math
import os
import signal
import subprocess
import sys
import threading
import unittest
import xmlrpc.client

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Log
from urban_gnss_localization.msg import Visibility

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from street import NORTH, SOUTH, Street, by_svid, horizontal, is_at_least, wall  # noqa: E402

NODE, NODELET, TURNED, LOST = "", "/nodelet", "/turned", "/lost"
NODES = (NODE, NODELET, TURNED, LOST)
WALL = wall(10.0)
MANY = 20  # epochs
CLOUD_QUEUE = 5  # the node's default


def numbers(message):
    """Every number in a message, in its order; its texts too."""
    if hasattr(message, "__slots__"):
        return [x for name in message.__slots__ for x in numbers(getattr(message, name))]
    if isinstance(message, (list, tuple)):
        return [x for element in message for x in numbers(element)]
    return [message]


def is_same(a, b):
    if isinstance(a, float) and isinstance(b, float):
        return (math.isnan(a) and math.isnan(b)) or a == b or abs(a - b) <= 1e-6 * max(abs(a), abs(b))
    return a == b


class StreetTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.street = Street(NODES)
        cls.logs, cls.statuses = [], {}
        cls.lock = threading.Condition()
        rospy.Subscriber("/rosout", Log, cls.on_log, queue_size=1000)
        rospy.Subscriber("/diagnostics", DiagnosticArray, cls.on_diagnostics, queue_size=100)

    @classmethod
    def on_log(cls, message):
        with cls.lock:
            cls.logs.append((message.name, message.msg))
            cls.lock.notify_all()

    @classmethod
    def on_diagnostics(cls, message):
        with cls.lock:
            for status in message.status:
                cls.statuses[status.name] = status
            cls.lock.notify_all()

    def wait_for(self, condition, what):
        with self.lock:
            self.assertTrue(self.lock.wait_for(condition, 20.0), what)

    def wait_for_log(self, node, text):
        self.wait_for(lambda: any(name == node and text in said for name, said in self.logs),
                      "%s has not said: %s" % (node, text))

    def wait_for_status(self, node, text):
        name = node[1:] + ": occlusion"
        with self.lock:
            self.statuses.pop(name, None)  # from now on
        def is_said():
            return name in self.statuses and text in self.statuses[name].message
        self.wait_for(is_said, "%s: %s, not: %s" % (name, self.statuses.get(name), text))

    def feed(self, epochs=MANY, **what):
        """Returns the last visibility of each node. No fix is ever made more certain than the receiver has it."""
        stamps = self.street.feed(epochs, **what)
        with self.street.news:
            for node in NODES:
                for stamp in stamps:
                    weighted = horizontal(self.street.weighted[node][stamp])
                    self.assertTrue(all(math.isfinite(x) for x in weighted))
                    self.assertTrue(is_at_least(weighted, [4.0, 1.0, 1.0, 9.0]), (node, weighted))
            return {node: self.street.visibilities[node][stamps[-1]] for node in NODES}

    def feed_until(self, node, condition, what, **how):
        for _ in range(10):
            seen = self.feed(5, **how)
            if condition(seen[node]):
                return seen
        self.fail("%s: no %s:\n%s" % (node or "node", what, seen[node]))

    def feed_complete(self):
        for node in (NODE, NODELET, TURNED):
            self.feed_until(node, lambda v: not v.missing, "complete fix", cloud=WALL)

    def resume(self):
        """After a gap: stamps that are far ahead are believed at the third, and what had no tf by then waits for it."""
        self.feed(12, cloud=WALL, lag=11)

    def test_01_the_wall_hides_what_is_behind_it(self):
        self.feed_complete()
        seen = by_svid(self.feed(cloud=WALL)[NODE])
        for svid, satellite in seen.items():
            self.assertAlmostEqual(satellite.blocked_fraction, 1.0 if svid in NORTH else 0.0, msg=str(satellite))

    def test_02_the_nodelet_says_the_same(self):
        self.feed_complete()
        self.street.time_s += 10.0  # longer than a receiver coasts: what one of them heard earlier is forgotten
        self.resume()
        begin = 1e9 * self.street.time_s
        self.feed(cloud=WALL)
        with self.street.news:
            stamps = sorted(stamp for stamp in self.street.weighted[NODELET] if stamp > begin)[:-1]
            self.assertGreaterEqual(len(stamps), MANY - 2)
            for kind in (self.street.weighted, self.street.visibilities):
                for stamp in stamps:
                    a, b = numbers(kind[NODE][stamp]), numbers(kind[NODELET][stamp])
                    self.assertTrue(len(a) == len(b) and all(map(is_same, a[1:], b[1:])), "%s\n%s" % (a, b))

    def test_03_the_nodelet_is_in_the_managers_process(self):
        subscribers = {name for topic, names in rospy.get_master().getSystemState()[2][1] if topic == "/points"
                       for name in names}
        self.assertEqual(subscribers, {"/occlusion", "/manager", "/turned/occlusion", "/lost/occlusion"})
        # A second one that takes the map of the first as its clouds: they go from one to the other as pointers.
        with self.loaded("/behind", "points:=/nodelet/occlusion_map", "gps/fix:=/nodelet/gps/fix_weighted"):
            self.feed(5, cloud=WALL)
            master = rospy.get_master()
            uri = master.lookupNode("/manager")[2]
            info = xmlrpc.client.ServerProxy(uri).getBusInfo("/test_street")[2]
            transports = {topic: transport for _, _, _, transport, topic, *_ in info
                          if topic in ("/nodelet/occlusion_map", "/nodelet/gps/fix_weighted") and
                          transport == "INTRAPROCESS"}
            self.assertEqual(len(transports), 2, info)

    def loader(self, name, *arguments):
        return subprocess.Popen(["rosrun", "nodelet", "nodelet", "load", "urban_gnss_localization/occlusion", "/manager",
                                 "__name:=" + name[1:], *arguments], start_new_session=True, stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, universal_newlines=True)

    class Loaded:
        def __init__(self, test, name, arguments):
            self.test, self.name, self.arguments = test, name, arguments

        def __enter__(self):
            self.process = self.test.loader(self.name, *self.arguments)
            rospy.wait_for_service(self.name + "/clear_map", 30.0)

        def __exit__(self, *error):
            os.killpg(self.process.pid, signal.SIGINT)
            output, _ = self.process.communicate(timeout=30)
            self.test.assertNotIn("Segmentation", output)
            self.test.wait_for(lambda: not self.test.services_of(self.name), self.name + " is still there")

    def loaded(self, name, *arguments):
        return self.Loaded(self, name, arguments)

    @staticmethod
    def services_of(name):
        return [service for service, _ in rospy.get_master().getSystemState()[2][2]
                if service.startswith(name + "/") and "logger" not in service]

    def test_04_unloaded_and_loaded_again_while_clouds_come(self):
        for _ in range(3):
            with self.loaded("/again", "points:=/points", "gps/fix:=/gps/fix", "gps/fix_weighted:=/again/fix",
                             "gps/visibility:=/again/visibility"):
                self.feed(5, cloud=WALL)
            self.feed(5, cloud=WALL)  # the other nodelet, and with it the manager, is alive

    def test_05_bad_parameters_leave_the_manager_alone(self):
        process = self.loader("/bad", "_expert/voxels/voxel_size:=-1.0", "_model:=best", "_windw:=3.0")
        output, _ = process.communicate(timeout=30)
        self.assertNotEqual(process.returncode, 0, output)
        for fault in ("voxel_size = -1", "conventional", "did you mean expert.voxels.window?"):
            self.wait_for_log("/manager", fault)
        self.assertEqual(self.services_of("/bad"), [])
        self.feed(5, cloud=WALL)

    def test_06_a_heading_off_by_half_a_turn_shows(self):
        self.feed_complete()
        seen = self.feed(cloud=WALL)
        right, wrong = by_svid(seen[NODE]), by_svid(seen[TURNED])
        for svid in NORTH:
            self.assertGreater(right[svid].blocked_fraction, 0.99)
            self.assertLess(wrong[svid].blocked_fraction, 0.01)
        for svid in SOUTH:
            self.assertLess(right[svid].blocked_fraction, 0.01)
            self.assertGreater(wrong[svid].blocked_fraction, 0.99)
        # And it is said, as what is received does not fit.
        wrong = self.feed_until(TURNED, lambda v: v.doubt, "doubt", cloud=WALL)
        self.assertEqual(wrong[NODE].doubt, "")
        self.assertGreater(wrong[TURNED].strong_share, 0.9)
        self.wait_for_status("/turned/occlusion", "the heading or the map is wrong")

    def test_07_tf_missing(self):
        seen = self.feed(cloud=WALL)[LOST]
        self.assertIn("the robot's pose in the odometry frame", seen.missing)
        self.assertEqual(seen.source, Visibility.SOURCE_SATELLITES)
        self.wait_for_status("/lost/occlusion", "the robot's pose in the odometry frame")
        self.wait_for(lambda: any(value.key == "tf" and "nowhere" in value.value
                                  for value in self.statuses["lost/occlusion: occlusion"].values), "no word of tf")
        self.feed_complete()
        # What has ended is waited for no longer than tf_timeout.
        self.assertIn("the robot's pose in the odometry frame", self.feed(cloud=WALL, tf=False, lag=5)[NODE].missing)
        self.resume()
        self.feed_complete()

    def test_08_satellites_missing(self):
        self.feed_complete()
        seen = self.feed(cloud=WALL, satellites=False)
        for node in (NODE, NODELET, TURNED):
            self.assertEqual(seen[node].missing, "satellites")
            self.assertEqual(seen[node].source, Visibility.SOURCE_LIDAR)
        self.wait_for_status("/occlusion", "without satellites")
        self.feed_complete()
        self.wait_for_status("/occlusion", "weighing by lidar_and_satellites")

    def test_09_clouds_that_are_dropped_are_counted_and_reported(self):
        self.feed_complete()
        before = self.count_from_now_on("/occlusion", "clouds dropped")
        self.street.burst(25, WALL)  # their transform never comes
        # At least: of the clouds before, some may still have waited beside them.
        self.wait_for(lambda: self.count("/occlusion", "clouds dropped") >= before + 25 - CLOUD_QUEUE, "no count")
        self.wait_for_log("/occlusion", "clouds dropped: they come faster than they go into the map")
        self.feed_complete()

    def count_from_now_on(self, node, key):
        """Of a status that is newer than what the test has fed so far: it comes once a second."""
        name = node[1:] + ": occlusion"
        with self.lock:
            self.statuses.pop(name, None)
        self.wait_for(lambda: name in self.statuses, "no status")
        return self.count(node, key)

    def count(self, node, key):
        values = self.statuses[node[1:] + ": occlusion"].values
        return int(next(value.value for value in values if value.key == key))

    def test_10_a_bag_that_starts_over(self):
        self.feed_complete()
        both = self.feed(cloud=WALL + wall(-10.0))[NODE]
        self.assertEqual({svid for svid, s in by_svid(both).items() if s.blocked_fraction > 0.99}, {*NORTH, *SOUTH})
        self.street.time_s -= 500.0
        # Without clouds: nothing is left of the map. The first transform may come before the fix that tells of the new
        # clock, and is then ignored; its fix is answered when it is overdue.
        self.feed(10, lag=5)
        for node in (NODE, NODELET, TURNED):
            newest = max(t for t in self.street.visibilities[node] if t < 1e9 * self.street.time_s)
            self.assertIn("clouds", self.street.visibilities[node][newest].missing)
        self.wait_for_log("/occlusion", "the clock was set back by")
        self.feed_complete()
        self.street.transform_of(500.0)  # of the former clock, late: tf then ignores all that is older
        self.feed(20, cloud=WALL, lag=5)
        self.feed_complete()
        again = self.feed(cloud=WALL)
        for node in (NODE, NODELET):
            blocked = {svid for svid, s in by_svid(again[node]).items() if s.blocked_fraction > 0.99}
            self.assertEqual(blocked, set(NORTH), "the wall of the first round is still there")


if __name__ == "__main__":
    rospy.init_node("test_street")
    rostest.rosrun("urban_gnss_localization", "test_street", StreetTest)
