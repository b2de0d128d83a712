#!/usr/bin/env python3
"""gps/satellites live: residuals of ranges, before their fix or after it, tell a localizer that reflections bias its fixes."""
import math
import os
import sys

import numpy as np
import rospy
import rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix
from urban_gnss_localization.msg import LocalizationStatus, Satellite, SatelliteArray

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from drive import make_fix  # noqa: E402
from localizer_case import LocalizerCase  # noqa: E402

SPEED, YAW_RATE = 2.0, 0.1  # m/s, rad/s
SECONDS, SETTLED = 30, 15   # of the drive; from when on it is judged
ODOMETRY_PER_FIX = 10       # 10 Hz and 1 Hz
LATE = 3                    # messages of odometry that come between a fix and satellites that come after it

# Constellation, azimuth and elevation (deg), C/N0 (dB-Hz), by how much the range is too long (m).
SKY = [(Satellite.GPS, 190, 20, 30, 40), (Satellite.GPS, 230, 30, 43, 0), (Satellite.GPS, 80, 20, 41, 0),
       (Satellite.GPS, 30, 30, 43, 0), (Satellite.GPS, 40, 45, 45, 0), (Satellite.GPS, 300, 70, 47, 0),
       (Satellite.GALILEO, 320, 30, 30, 40), (Satellite.GALILEO, 120, 55, 46, 0), (Satellite.GALILEO, 190, 55, 46, 0),
       (Satellite.GALILEO, 330, 30, 43, 0)]


def design():
    """Derivatives of the ranges by east, north, up and the clock of each constellation."""
    rows = []
    for constellation, azimuth, elevation, _, _ in SKY:
        a, e = math.radians(azimuth), math.radians(elevation)
        rows.append([-math.sin(a) * math.cos(e), -math.cos(a) * math.cos(e), -math.sin(e),
                     constellation == Satellite.GPS, constellation == Satellite.GALILEO])
    return np.array(rows, dtype=float)


def solve(noise):
    """The error of a receiver's least squares (m, east and north), and its residuals."""
    clocks = [120.0, -35.0]
    ranges = design()[:, 3:] @ clocks + [each[4] for each in SKY] + noise.normal(0.0, 0.5, len(SKY))
    solution = np.linalg.lstsq(design(), ranges, rcond=None)[0]
    return solution[:2], ranges - design() @ solution


def satellites(stamp, residuals):
    message = SatelliteArray()
    message.header.stamp, message.header.frame_id = stamp, "gps"
    for number, ((constellation, azimuth, elevation, cn0, _), residual) in enumerate(zip(SKY, residuals)):
        message.satellites.append(Satellite(
            constellation=constellation, svid=number + 1, azimuth=math.radians(azimuth), elevation=math.radians(elevation),
            cn0=cn0, tracked=True, used=Satellite.USED, pseudorange_residual=residual))
    return message


def truth(seconds):
    radius, turned = SPEED / YAW_RATE, YAW_RATE * seconds
    return radius * math.sin(turned), radius * (1.0 - math.cos(turned)), turned


def odometry(stamp, pose):
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id, message.child_frame_id = "odom", "base_link"
    message.pose.pose.position.x, message.pose.pose.position.y = pose[:2]
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(pose[2] / 2.0), math.cos(pose[2] / 2.0)
    message.twist.twist.linear.x, message.twist.twist.angular.z = SPEED, YAW_RATE
    return message


class SatellitesTest(LocalizerCase):
    def drive(self, namespace, late=0, stamped_late_s=0.0):
        """Satellites come `late` messages of odometry after their fix (0: before it), their stamps that much too late.
        Returns the largest error of the estimate and the mean one of the fixes (m), and how many of them had ranges."""
        subscribers = [rospy.Subscriber(namespace + "/localizer/status", LocalizationStatus, self.on_status),
                       rospy.Subscriber(namespace + "/odometry/filtered", Odometry, self.on_estimate, queue_size=1000)]
        odometries, fixes, skies = publishers = [
            rospy.Publisher(namespace + "/" + topic, kind, queue_size=1000, tcp_nodelay=True)
            for topic, kind in (("odom", Odometry), ("gps/fix", NavSatFix), ("gps/satellites", SatelliteArray))]
        self.connect(publishers + subscribers)
        noise = np.random.RandomState(1)
        worst, biases = 0.0, []
        for k in range(SECONDS * ODOMETRY_PER_FIX):
            seconds, since_fix = 0.1 * k, k % ODOMETRY_PER_FIX
            stamp, pose = rospy.Time.from_sec(1000.0 + seconds), truth(seconds)
            if since_fix == 0:
                error, residuals = solve(noise)
                biases.append(np.linalg.norm(error))
                fix, sky = make_fix(stamp, *(pose[:2] + error)), satellites(stamp, residuals)
                fix.position_covariance = [25.0, 0, 0, 0, 25.0, 0, 0, 0, 100.0]
                sky.header.stamp += rospy.Duration.from_sec(stamped_late_s)
            if since_fix == late:
                if late and k > ODOMETRY_PER_FIX:
                    self.assertNotEqual(self.status.last_fix.stamp, fix.header.stamp, "does not wait for its satellites")
                skies.publish(sky)
            if since_fix == 0:
                fixes.publish(fix)
            odometries.publish(odometry(stamp, pose))
            # One message at a time: no queue is long enough for a machine that is slow enough.
            self.wait(lambda: self.estimate is not None and self.estimate.header.stamp == stamp, "no estimate")
            if since_fix == LATE:
                self.wait(lambda: self.status is not None and self.status.last_fix.stamp == fix.header.stamp, "no decision")
            if seconds > SETTLED:
                place = self.estimate.pose.pose.position
                worst = max(worst, math.hypot(place.x - pose[0], place.y - pose[1]))
        for subscriber in subscribers:
            subscriber.unregister()
        with self.changed:
            return worst, np.mean(biases), self.status.fixes_with_ranges

    def expect_unbiased(self, namespace, **kwargs):
        worst, bias, with_ranges = self.drive(namespace, **kwargs)
        print("%s: fixes wrong by %.1f m, the estimate by %.2f m at most" % (namespace, bias, worst))
        self.assertAlmostEqual(bias, 10.0, delta=2.0)
        self.assertLess(worst, 2.0)
        # Nothing waits for the first satellites, on a connection of their own.
        self.assertGreaterEqual(with_ranges, SECONDS - 1)

    def test_before_their_fix(self):
        self.expect_unbiased("before")

    def test_after_their_fix(self):
        self.expect_unbiased("after", late=LATE)

    def test_mode_switching(self):
        self.expect_unbiased("switching")

    def test_of_no_fix(self):
        worst, bias, with_ranges = self.drive("strangers", stamped_late_s=0.2)
        print("strangers: fixes wrong by %.1f m, the estimate by %.2f m at most" % (bias, worst))
        self.assertEqual(with_ranges, 0)
        self.assertGreater(worst, 5.0)


if __name__ == "__main__":
    rospy.init_node("test_satellites")
    rostest.rosrun("urban_gnss_localization", "test_satellites", SatellitesTest)
