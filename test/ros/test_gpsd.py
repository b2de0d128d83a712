#!/usr/bin/env python3
"""gpsd_node with a real gpsd, which gpsfake feeds with a log: made here, and where there is URBAN_GNSS_DATA a recorded one.

The node is started before any gpsd, and the gpsd is ended and started again: both in every run."""
import json
import math
import os
import subprocess
import sys
import tempfile
import time
import unittest

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistWithCovarianceStamped
from sensor_msgs.msg import NavSatFix
from urban_gnss_localization.msg import Satellite, SatelliteArray

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import driver_messages as driver  # noqa: E402

RECORDED = os.path.join(os.environ.get("URBAN_GNSS_DATA", ""), "nmea", "gpsd_ublox-zed-f9p-nmea.log")
START = 1581076800  # 2020-02-07 12:00:00 UTC
EPOCHS = 40         # at 1 Hz
KNOT = 1852.0 / 3600.0
WAIT = 60.0         # s
GALILEO, GLONASS = Satellite.GALILEO, Satellite.GLONASS


def latitude(k):
    return 48.0 + k * 1e-4


def satellites(k):
    """(constellation, svid): C/N0 of an epoch."""
    return {(Satellite.GPS, 5): 30.0 + k % 10, (Satellite.GPS, 12): 41.0, (GLONASS, 3): 25.0 + k % 7, (GALILEO, 11): 38.0}


def epoch(k):
    clock = time.strftime("%H%M%S.00", time.gmtime(START + k))
    place = "48%09.6f,N,01134.500000,E" % (60.0 * (latitude(k) - 48.0))
    cn0 = satellites(k)
    return "".join(driver.with_checksum(body) for body in (
        "GNRMC,%s,A,%s,3.600,90.00,070220,,,A" % (clock, place),
        "GNGGA,%s,%s,1,08,1.00,500.0,M,47.0,M,," % (clock, place),
        "GNGSA,A,3,05,12,,,,,,,,,,,2.0,1.0,1.7",
        "GNGSA,A,3,67,,,,,,,,,,,,2.0,1.0,1.7",
        "GPGSV,1,1,02,05,40,110,%02d,12,60,200,%02d" % (cn0[(Satellite.GPS, 5)], cn0[(Satellite.GPS, 12)]),
        "GLGSV,1,1,01,67,35,300,%02d" % cn0[(GLONASS, 3)],
        "GAGSV,1,1,01,11,20,020,%02d" % cn0[(GALILEO, 11)],
        "GNGST,%s,12.0,,,,3.0,2.0,5.0" % clock,
        "GNZDA,%s,07,02,2020,00,00" % clock))


class GpsdTest(unittest.TestCase):
    def setUp(self):
        self.fixes, self.velocities, self.lists, self.diagnosis = {}, {}, {}, None
        self.subscribers = [
            rospy.Subscriber("gps/fix", NavSatFix, lambda m: self.keep(self.fixes, m), queue_size=1000),
            rospy.Subscriber("gps/velocity", TwistWithCovarianceStamped, lambda m: self.keep(self.velocities, m),
                             queue_size=1000),
            rospy.Subscriber("gps/satellites", SatelliteArray, lambda m: self.keep(self.lists, m), queue_size=1000),
            rospy.Subscriber("/diagnostics", DiagnosticArray, self.on_diagnostics, queue_size=100)]
        self.gpsfake = None

    def tearDown(self):
        self.stop()
        for subscriber in self.subscribers:
            subscriber.unregister()

    @staticmethod
    def keep(messages, message):
        messages[message.header.stamp.to_sec()] = message

    def on_diagnostics(self, message):
        for status in message.status:
            if status.name.startswith("gpsd"):
                self.diagnosis = (status.level, status.message, {each.key: each.value for each in status.values})

    def play(self, log):
        """A gpsd whose receiver says again and again what is in the log."""
        self.gpsfake = subprocess.Popen(["gpsfake", "-q", "-c", "0.01", "-P", str(rospy.get_param("~port")), log],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def stop(self):
        if self.gpsfake:
            self.gpsfake.terminate()  # ends its gpsd too
            self.gpsfake.wait(timeout=WAIT)
            self.gpsfake = None

    def wait(self, condition, what):
        end = time.monotonic() + WAIT
        while not condition():
            self.assertLess(time.monotonic(), end, what + "; diagnostics: " + str(self.diagnosis))
            time.sleep(0.05)

    def has_fixes(self):
        return [stamp for stamp, fix in self.fixes.items() if fix.status.status >= 0]

    def check_epochs(self):
        complete = 0
        for stamp, fix in self.fixes.items():
            k = round(stamp - START)
            if fix.status.status < 0:
                continue
            self.assertAlmostEqual(fix.latitude, latitude(k), places=7)
            self.assertAlmostEqual(fix.longitude, 11.575, places=7)
            if stamp not in self.velocities or stamp not in self.lists:
                continue  # before gpsd knew the receiver's cycle
            self.assertAlmostEqual(self.velocities[stamp].twist.twist.linear.x, 3.6 * KNOT, places=2)
            if fix.position_covariance_type == NavSatFix.COVARIANCE_TYPE_KNOWN:
                self.assertAlmostEqual(math.sqrt(fix.position_covariance[0]), 2.0, places=3)
                self.assertAlmostEqual(math.sqrt(fix.position_covariance[4]), 3.0, places=3)
                self.assertAlmostEqual(fix.altitude, 547.0, places=2)
                seen = {(each.constellation, each.svid): each.cn0 for each in self.lists[stamp].satellites}
                complete += seen == satellites(k)
        self.assertEqual(set(self.velocities) - set(self.fixes), set())
        self.assertEqual(set(self.lists) - set(self.fixes), set())
        self.assertGreaterEqual(complete, 20)

    def test_generated_log_and_a_restart(self):
        with tempfile.TemporaryDirectory() as folder:
            log = os.path.join(folder, "generated.nmea")
            with open(log, "w") as file:
                file.write("".join(epoch(k) for k in range(EPOCHS)))
            self.wait(lambda: self.diagnosis is not None, "no diagnostics")
            connections = int(self.diagnosis[2]["connections"])
            for restart in (1, 2):
                for messages in (self.fixes, self.velocities, self.lists):
                    messages.clear()
                self.play(log)
                self.wait(lambda: len(self.has_fixes()) >= 30, "too few fixes, start %d of gpsd" % restart)
                self.stop()
                self.check_epochs()
                self.wait(lambda: self.diagnosis[0] == 2 and "no gpsd" in self.diagnosis[1], "the end was not noticed")
            # A gpsd that ends may accept one more.
            self.assertGreaterEqual(int(self.diagnosis[2]["connections"]), connections + 2)
            self.assertEqual(self.diagnosis[2]["release"], "")

    @unittest.skipUnless(os.path.isfile(RECORDED), "URBAN_GNSS_DATA has no nmea/")
    def test_recorded_log_as_through_the_file(self):
        text = subprocess.run(["rosrun", "urban_gnss_localization", "decode_nmea", RECORDED], check=True,
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, universal_newlines=True).stdout
        lines = [json.loads(line) for line in text.splitlines()]
        expected = {float(line["stamp"]): line for line in lines if line["class"] == "fix"}
        skies = {float(line["stamp"]): line["satellites"] for line in lines if line["class"] == "satellites"}
        self.play(RECORDED)
        self.wait(lambda: len(self.lists) >= len(expected) and len(self.has_fixes()) >= len(expected), "too few fixes")
        self.stop()
        self.assertEqual(set(self.has_fixes()), set(expected))
        for stamp, fix in expected.items():
            self.assertAlmostEqual(self.fixes[stamp].latitude, fix["lat"], places=8)
            self.assertAlmostEqual(self.fixes[stamp].longitude, fix["lon"], places=8)
        same = 0
        for stamp, satellites_of_file in skies.items():
            seen = {(each.constellation, each.svid): None if math.isnan(each.cn0) else round(each.cn0, 1)
                    for each in self.lists[stamp].satellites if each.constellation != Satellite.SBAS}
            # gpsd 3.22 takes Galileo's 33 for SBAS.
            same += seen == {(each["gnssid"], each["svid"]): each["cn0"] for each in satellites_of_file
                             if (each["gnssid"], each["svid"]) != (GALILEO, 33)}
        self.assertGreaterEqual(same, len(expected) - 3)  # the first ones come before gpsd knows the receiver's cycle


if __name__ == "__main__":
    rospy.init_node("test_gpsd")
    rostest.rosrun("urban_gnss_localization", "test_gpsd", GpsdTest)
