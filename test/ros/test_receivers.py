#!/usr/bin/env python3
"""Receivers through their drivers' messages, live: the presets of localization.launch give fixes, velocities and
satellites with one stamp a solution, and say what they cannot read."""
import math
import os
import sys
import threading
import unittest

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped, TwistWithCovarianceStamped
from sensor_msgs.msg import NavSatFix
from urban_gnss_localization.msg import SatelliteArray

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import driver_messages as driver  # noqa: E402

SECOND = 1522344207   # 2018-03-29 17:23:27 UTC
TIME_OF_WEEK = 408225000  # ms, of the same instant
SECONDS = 4


def stamp(second, nanosecond=0):
    return rospy.Time(SECOND + second, nanosecond)


class Listener:
    """What a receiver's node publishes in a namespace."""

    def __init__(self, namespace):
        self.changed = threading.Condition()
        self.fixes, self.velocities, self.satellites = [], [], []
        self.subscribers = [
            rospy.Subscriber(namespace + "/gps/fix", NavSatFix, self.take, self.fixes),
            rospy.Subscriber(namespace + "/gps/velocity", TwistWithCovarianceStamped, self.take, self.velocities),
            rospy.Subscriber(namespace + "/gps/satellites", SatelliteArray, self.take, self.satellites)]

    def take(self, message, where):
        with self.changed:
            where.append(message)
            self.changed.notify_all()

    def wait(self, fixes, velocities, satellites):
        with self.changed:
            return self.changed.wait_for(lambda: len(self.fixes) >= fixes and len(self.velocities) >= velocities and
                                         len(self.satellites) >= satellites, 10.0)

    def stamps(self, messages):
        return [message.header.stamp for message in messages]


class ReceiversTest(unittest.TestCase):
    def connect(self, ends):
        deadline = rospy.Time.now() + rospy.Duration(20.0)
        while not all(end.get_num_connections() for end in ends):
            self.assertLess(rospy.Time.now(), deadline, "no connection")
            rospy.sleep(0.02)

    def start(self, namespace, topics):
        listener = Listener(namespace)
        publishers = [rospy.Publisher(namespace + "/" + name, kind, queue_size=100) for name, kind in topics]
        self.connect(publishers + listener.subscribers)
        return [listener] + publishers

    def check(self, listener, fixes, velocities, satellites):
        self.assertTrue(listener.wait(fixes, velocities, satellites),
                        "%d fixes, %d velocities, %d lists of satellites" %
                        (len(listener.fixes), len(listener.velocities), len(listener.satellites)))
        self.assertEqual(len(listener.fixes), fixes)
        self.assertEqual(listener.stamps(listener.velocities), listener.stamps(listener.fixes)[-velocities:])
        for fix in listener.fixes:
            self.assertAlmostEqual(fix.latitude, 51.51, delta=0.01)

    def test_ublox(self):
        pvt = driver.types("ublox_msgs/NavPVT", driver.NAV_PVT)["NavPVT"]
        navsat = driver.types("ublox_msgs/NavSAT", driver.NAV_SAT)
        listener, pvts, sats, fixes, velocities = self.start("ublox", [
            ("ublox_gps/navpvt", pvt), ("ublox_gps/navsat", navsat["NavSAT"]), ("ublox_gps/fix", NavSatFix),
            ("ublox_gps/fix_velocity", TwistWithCovarianceStamped)])
        for second in range(SECONDS):
            self.publish_ublox_second(second, pvts, fixes, velocities)
            self.assertTrue(listener.wait(second + 1, second + 1, 0))
        sky = [navsat["NavSAT_SV"](gnssId=0, svId=5, cno=25, elev=13, azim=60, prRes=179, flags=6428),
               navsat["NavSAT_SV"](gnssId=6, svId=255, cno=38, elev=-91, azim=0, prRes=0, flags=7),
               navsat["NavSAT_SV"](gnssId=0, svId=4, cno=40, elev=-91, azim=0, prRes=0, flags=2087)]
        sats.publish(iTOW=TIME_OF_WEEK + 2000, version=1, numSvs=3, sv=sky)
        self.check(listener, SECONDS, SECONDS, 1)
        epoch = listener.satellites[0]
        self.assertEqual(epoch.header.stamp, stamp(2, 211571))
        self.assertEqual([each.name for each in epoch.satellites], ["G05", "G04"])
        self.assertAlmostEqual(epoch.satellites[0].pseudorange_residual, 17.9, places=4)
        self.assertTrue(math.isnan(epoch.satellites[1].elevation))
        # Of the first solution the driver's own velocity may come before the receiver's message, on its own connection.
        self.assertAlmostEqual(listener.velocities[-1].twist.twist.linear.x, -0.003, places=6)
        self.assertAlmostEqual(listener.fixes[-1].position_covariance[0], 2.461 ** 2, places=6)
        # The frame is that of the driver's fix, which comes on another connection.
        for second in range(SECONDS, 30):
            if listener.fixes[-1].header.frame_id:
                break
            self.publish_ublox_second(second, pvts, fixes, velocities)
            self.assertTrue(listener.wait(second + 1, second + 1, 1))
        self.assertEqual(listener.fixes[-1].header.frame_id, "antenna")

    @staticmethod
    def publish_ublox_second(second, pvts, fixes, velocities):
        """A solution, and what the driver makes of it; it must not be given twice."""
        pvts.publish(iTOW=TIME_OF_WEEK + 1000 * second, year=2018, month=3, day=29, hour=17, min=23, sec=27 + second,
                     valid=7, nano=211571, fixType=3, flags=1, flags2=0xE0, lon=-1174133, lat=515103393, height=64671,
                     hAcc=2461, vAcc=4843, velN=-23, velE=-3, velD=0, sAcc=361)
        fix = NavSatFix(latitude=51.5103393, longitude=-0.1174133)
        fix.header.stamp, fix.header.frame_id = stamp(second, 211571), "antenna"
        fixes.publish(fix)
        velocity = TwistWithCovarianceStamped()
        velocity.header.stamp = stamp(second, 211571)
        velocities.publish(velocity)

    def test_unreadable_messages_are_named(self):
        """A version of NavSVINFO without residuals."""
        without = driver.types("ublox_msgs/NavSVINFO", driver.NAV_SVINFO.replace("int32 prRes", "int32 other"))
        publisher = rospy.Publisher("ublox/ublox_gps/navsvinfo", without["NavSVINFO"], queue_size=10)
        reports, changed = [], threading.Condition()

        def on_diagnostics(message):
            with changed:
                reports.extend(s.message for s in message.status if "receiver" in s.name)
                changed.notify_all()
        subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, on_diagnostics)
        self.connect([publisher, subscriber])
        publisher.publish(iTOW=TIME_OF_WEEK, sv=[without["NavSVINFO_SV"]()])
        wanted = ("navsvinfo", "ublox_msgs/NavSVINFO", without["NavSVINFO"]._md5sum, "sv[].prRes")
        with changed:
            self.assertTrue(changed.wait_for(
                lambda: any(all(word in text for word in wanted) for text in reports), 10.0), reports)

    def test_gpsd(self):
        fix_type = driver.types("gps_common/GPSFix", driver.GPS_FIX)
        status_type = driver.types("gps_common/GPSStatus", driver.GPS_STATUS + driver.HEADER)["GPSStatus"]
        listener, fixes, statuses = self.start("gpsd", [("extended_fix", fix_type["GPSFix"]),
                                                        ("status", status_type)])
        for second in range(SECONDS):
            message = fix_type["GPSFix"](latitude=51.51, longitude=-0.1, altitude=30.0, track=90.0, speed=2.0,
                                         time=SECOND + second, err_horz=5.0, err_vert=8.0, err_speed=0.5)
            message.header.stamp = stamp(second, 300000000)
            fixes.publish(message)
            self.assertTrue(listener.wait(second + 1, second + 1, second))
            status = status_type(satellite_visible_prn=[5, 70, 305], satellite_visible_z=[30, 91, 45],
                                 satellite_visible_azimuth=[-10, 100, 360], satellite_visible_snr=[40, 0, 35])
            status.header.stamp = stamp(second, 310000000)
            statuses.publish(status)
            self.assertTrue(listener.wait(second + 1, second + 1, second + 1))
        self.check(listener, SECONDS, SECONDS, SECONDS)
        self.assertEqual(listener.stamps(listener.fixes), [stamp(second) for second in range(SECONDS)])
        self.assertEqual(listener.stamps(listener.satellites), listener.stamps(listener.fixes))
        self.assertEqual([each.name for each in listener.satellites[0].satellites], ["G05", "R06", "E05"])
        self.assertAlmostEqual(listener.satellites[0].satellites[0].azimuth, math.radians(350.0), places=5)
        self.assertAlmostEqual(listener.velocities[0].twist.twist.linear.x, 2.0, places=6)

    def test_nmea(self):
        sentence_type = driver.types("nmea_msgs/Sentence", driver.SENTENCE)["Sentence"]
        listener, sentences = self.start("nmea", [("nmea_sentence", sentence_type)])
        for second in range(SECONDS + 1):
            for i, body in enumerate((
                    "GPRMC,1723%02d.00,A,5130.6200,N,00007.0448,W,4.0,90.0,290318,,,A" % (27 + second),
                    "GPGGA,1723%02d.00,5130.6200,N,00007.0448,W,1,08,1.0,20.0,M,45.0,M,," % (27 + second),
                    "GPGST,1723%02d.00,,,,,3.0,3.0,6.0" % (27 + second),
                    "GPGSV,1,1,03,05,30,350,40,07,45,100,35,09,10,200,")):
                message = sentence_type(sentence=driver.with_checksum(body).strip())
                message.header.stamp = stamp(second, 100000000 + 1000000 * i)
                sentences.publish(message)
        # The last solution waits for its successor until its last sentence is learnt.
        self.assertTrue(listener.wait(SECONDS, SECONDS, SECONDS))
        self.assertEqual(listener.stamps(listener.fixes)[:SECONDS],
                         [stamp(second, 100000000) for second in range(SECONDS)])
        self.assertEqual(listener.stamps(listener.satellites)[:SECONDS], listener.stamps(listener.fixes)[:SECONDS])
        self.assertAlmostEqual(listener.fixes[0].position_covariance[0], 9.0, delta=0.5)
        self.assertAlmostEqual(listener.velocities[0].twist.twist.linear.x, 4.0 * 1852.0 / 3600.0, places=3)

    def test_novatel(self):
        fix_type = driver.types("gps_common/GPSFix", driver.GPS_FIX)["GPSFix"]
        trackstat = driver.types("novatel_gps_msgs/Trackstat", driver.TRACKSTAT)
        gpgsv = driver.types("novatel_gps_msgs/Gpgsv", driver.GPGSV)
        listener, fixes, tracks, views = self.start("novatel", [
            ("gps", fix_type), ("trackstat", trackstat["Trackstat"]), ("gpgsv", gpgsv["Gpgsv"])])
        view = gpgsv["Gpgsv"](n_msgs=1, msg_number=1, n_satellites=2, satellites=[
            gpgsv["Satellite"](prn=5, elevation=40, azimuth=50, snr=42),
            gpgsv["Satellite"](prn=67, elevation=20, azimuth=300, snr=35)])
        view.header.stamp = stamp(0)
        views.publish(view)
        for second in range(SECONDS):
            message = fix_type(latitude=51.51, longitude=-0.1, track=0.0, speed=3.0, time=1000.0 + second,
                               position_covariance=[4.0, 0, 0, 0, 4.0, 0, 0, 0, 9.0], position_covariance_type=2)
            message.header.stamp = stamp(second)
            fixes.publish(message)
        self.assertTrue(listener.wait(SECONDS, SECONDS, 0))
        rospy.sleep(0.3)  # the satellites' directions come on a connection of their own
        track = trackstat["Trackstat"](channels=[
            trackstat["TrackstatChannel"](prn=5, ch_tr_status=0, c_no=45.0, psr_res=1.5, reject="GOOD"),
            trackstat["TrackstatChannel"](prn=40, ch_tr_status=1 << 16, c_no=38.0, psr_res=-2.5, reject="LOWPOWER")])
        track.header.stamp = stamp(SECONDS - 1, 20000000)
        before = len(listener.satellites)
        tracks.publish(track)
        self.check(listener, SECONDS, SECONDS, before + 1)
        epoch = listener.satellites[-1]
        self.assertEqual(epoch.header.stamp, stamp(SECONDS - 1))
        self.assertEqual([each.name for each in epoch.satellites], ["G05", "R03"])
        self.assertAlmostEqual(epoch.satellites[0].pseudorange_residual, 1.5, places=5)
        self.assertAlmostEqual(epoch.satellites[0].azimuth, math.radians(50.0), places=5)
        self.assertTrue(math.isnan(epoch.satellites[1].pseudorange_residual))

    def test_mavros(self):
        """In another namespace than mavros has by itself."""
        listener, fixes, velocities = self.start("mavros", [
            ("autopilot/global_position/raw/fix", NavSatFix), ("autopilot/global_position/raw/gps_vel", TwistStamped)])
        for second in range(SECONDS):
            fix = NavSatFix(latitude=51.51, longitude=-0.1, position_covariance=[-1.0] + 8 * [0.0])
            fix.header.stamp = stamp(second, 5)
            fixes.publish(fix)
            velocity = TwistStamped()
            velocity.header.stamp = stamp(second, 5)
            velocity.twist.linear.x, velocity.twist.linear.y = 1.0, -2.0
            velocities.publish(velocity)
        self.check(listener, SECONDS, SECONDS, 0)
        self.assertEqual(listener.fixes[0].position_covariance_type, NavSatFix.COVARIANCE_TYPE_UNKNOWN)
        self.assertEqual(list(listener.fixes[0].position_covariance), 9 * [0.0])
        self.assertEqual(listener.velocities[0].twist.twist.linear.y, -2.0)


if __name__ == "__main__":
    rospy.init_node("test_receivers")
    rostest.rosrun("urban_gnss_localization", "test_receivers", ReceiversTest)
