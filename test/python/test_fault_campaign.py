"""A bounded run of dev/fault_campaign.py: no odd message ends, silences or misleads a live node. And what the campaign
itself sees.

URBAN_GNSS_PROGRAMS names the folder of the programs."""
import math
import os
import random
import subprocess
import sys
import unittest

import test_tools

DEV = os.path.join(test_tools.PACKAGE, "dev")
sys.path.insert(0, DEV)
import fault_messages  # noqa: E402

from geometry_msgs.msg import PoseArray, Pose  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from sensor_msgs.msg import NavSatFix, PointCloud2  # noqa: E402
from urban_gnss_localization.msg import LocalizationStatus, Visibility  # noqa: E402

SECONDS = 30
LEAST_CASES = 30  # in that time, also on a busy machine
NODES = ("imm_ekf", "particle_filter", "occlusion")


class FaultMessagesTest(unittest.TestCase):
    def test_every_number_of_a_message_is_walked(self):
        message = Odometry()
        names = {name for name, _, _ in fault_messages.field_cases(message)}
        for field in ["pose.covariance.%d" % i for i in range(36)] + ["twist.twist.angular.z", "pose.pose.position.x"]:
            for value in ("nan", "inf", "-inf", "1.79769e+308", "4.94066e-324", "-1", "0", "1e+300"):
                self.assertIn(field + "=" + value, names)
        self.assertTrue({"header.seq=4294967295", "child_frame_id=1 MB", "header.stamp=+3600 s"} <= names)
        for name, path, value in fault_messages.field_cases(message):
            fault_messages.buffer_of(fault_messages.with_value(message, path, value))
        self.assertEqual(message, Odometry())

    def test_arrays_are_empty_and_huge_and_walked(self):
        names = {name for name, _, _ in fault_messages.field_cases(PoseArray(poses=[Pose()]))}
        self.assertTrue({"poses=empty", "poses=huge", "poses.0.orientation.w=nan"} <= names)
        names = {name for name, _, _ in fault_messages.field_cases(PointCloud2(data=b"1234"))}
        self.assertTrue({"data=empty", "data=huge", "point_step=4294967295", "is_dense=255"} <= names)

    def test_the_same_seed_damages_alike(self):
        one, two = (fault_messages.damaged(Odometry(), random.Random(3)) for _ in range(2))
        self.assertEqual(fault_messages.buffer_of(one), fault_messages.buffer_of(two))
        self.assertNotEqual(fault_messages.buffer_of(one), fault_messages.buffer_of(Odometry()))

    def test_what_is_no_number_is_seen_unless_its_definition_allows_it(self):
        message = Odometry()
        self.assertIsNone(fault_messages.fault_of(message))
        message.twist.twist.linear.y = math.nan
        self.assertEqual(fault_messages.fault_of(message)[0], "non-finite")
        message = Odometry()
        message.pose.covariance = [0.0] * 35 + [-1.0]
        self.assertEqual(fault_messages.fault_of(message)[0], "negative variance")
        self.assertIsNone(fault_messages.fault_of(LocalizationStatus(heading_sigma=math.nan)))
        self.assertIsNone(fault_messages.fault_of(Visibility(hdop_visible=math.nan)))
        self.assertIsNone(fault_messages.fault_of(NavSatFix(altitude=math.nan)))
        self.assertIsNotNone(fault_messages.fault_of(NavSatFix(latitude=math.nan)))
        self.assertIsNotNone(fault_messages.fault_of(LocalizationStatus(heading_sigma=math.inf)))


@unittest.skipUnless(test_tools.PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class FaultCampaignTest(unittest.TestCase):
    def test_no_fault(self):
        done = subprocess.run([sys.executable, "-B", os.path.join(DEV, "fault_campaign.py"), "--seconds", str(SECONDS),
                               "--seed", "2", "--rigs", *NODES], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              universal_newlines=True, timeout=300.0, check=False)
        self.assertEqual(done.returncode, 0, done.stdout)
        total = next(line for line in done.stdout.splitlines() if line.startswith("| all |"))
        self.assertGreater(int(total.split("|")[3]), LEAST_CASES, done.stdout)


if __name__ == "__main__":
    unittest.main()
