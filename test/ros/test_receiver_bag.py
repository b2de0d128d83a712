#!/usr/bin/env python3
"""A real bag of ublox_gps through `rosbag play`: the live node counts what `replay --receiver ublox` counts."""
import json
import os
import subprocess
import tempfile
import time
import unittest

import rospy
import rostest
from geometry_msgs.msg import TwistWithCovarianceStamped
from sensor_msgs.msg import NavSatFix
from urban_gnss_localization.msg import SatelliteArray

DATA = os.environ.get("URBAN_GNSS_DATA", os.path.join(os.getcwd(), "../shared/data"))
BAG = os.path.join(DATA, "receivers/terrace_ublox.bag")
RATE = 10


class ReceiverBagTest(unittest.TestCase):
    def offline(self):
        with tempfile.NamedTemporaryFile(suffix=".json") as report:
            subprocess.run(["rosrun", "urban_gnss_localization", "replay", BAG, "--receiver", "ublox", "--odom", "none",
                            "--json", report.name], check=True, timeout=60)
            return json.load(open(report.name, encoding="utf-8"))["receiver"]

    def test_live_counts_are_those_offline(self):
        if not os.path.exists(BAG):
            self.skipTest("no " + BAG + "; set URBAN_GNSS_DATA")
        fixes, velocities, satellites = [], [], []
        rospy.Subscriber("gps/fix", NavSatFix, lambda m: fixes.append(m.header.stamp.to_nsec()))
        rospy.Subscriber("gps/velocity", TwistWithCovarianceStamped,
                         lambda m: velocities.append(m.header.stamp.to_nsec()))
        rospy.Subscriber("gps/satellites", SatelliteArray, satellites.append)
        expected = self.offline()
        self.assertGreater(expected["fixes"], 50)
        self.assertEqual(expected["fixes_with_satellites"], 3)
        subprocess.run(["rosbag", "play", "--quiet", "--clock", "--delay=2", "--rate=%d" % RATE, BAG, "--topics"] +
                       ["/earth_gps/" + name for name in ("navpvt", "navsat", "fix", "fix_velocity")],
                       check=True, timeout=90)
        deadline = time.time() + 5.0
        while len(fixes) < expected["fixes"] and time.time() < deadline:
            time.sleep(0.1)
        self.assertEqual(len(fixes), expected["fixes"])
        self.assertEqual(len(velocities), expected["velocities"])
        with_satellites = [epoch for epoch in satellites if epoch.header.stamp.to_nsec() in fixes]
        self.assertEqual(len(with_satellites), expected["fixes_with_satellites"])
        with_residuals = [epoch for epoch in with_satellites
                          if any(each.used == 1 for each in epoch.satellites)]
        self.assertEqual(len(with_residuals), expected["fixes_with_residuals"])


if __name__ == "__main__":
    rospy.init_node("test_receiver_bag")
    rostest.rosrun("urban_gnss_localization", "test_receiver_bag", ReceiverBagTest)
