"""The doctor's checks: each on synthetic drives, clean and with one fault."""
import itertools
import json
import math
import os
import re
import sys
import unittest

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from doctor_drive import LATITUDE, LONGITUDE, T0, drive, examine, said  # noqa: E402
from checkup import checks, evidence, fits, page, setup, signals, text  # noqa: E402
from checkup.recording import COLUMNS, Recording, Topic  # noqa: E402
from checkup.topic_choice import choose  # noqa: E402


class CleanDriveTest(unittest.TestCase):
    def test_nothing_is_wrong(self):
        findings = examine(drive())
        self.assertEqual("", said(findings, "FAIL") + said(findings, "WARN"))
        for check in ("clocks.imu_motion", "clocks.fix_motion", "clocks.velocity_motion", "imu.axes", "imu.yaw_rate",
                      "odometry.pose_and_twist", "odometry.speed", "odometry.yaw_rate", "velocity.frame",
                      "velocity.speed",
                      "covariance.size", "satellites.paired", "frames.tf_fix"):
            self.assertIn("PASS " + check, said(findings))

    def test_other_seeds(self):
        self.assertEqual("", said(examine(drive(seconds=150.0, seed=2)), "FAIL"))

    def test_any_part_alone(self):
        for parts in (("odometry",), ("fix",), ("imu",), ("velocity",), ("satellites",), ("odometry", "fix"),
                      ("odometry", "imu"), ("fix", "velocity"), ()):
            findings = examine(drive(seconds=60.0, parts=parts))
            self.assertNotIn("cannot be checked", said(findings), parts)
            if parts:
                self.assertEqual("", said(findings, "FAIL"), parts)

    def test_numbers_are_right(self):
        recording = drive(lever=(1.2, 0.0))
        recording.odometry.vx *= 1.06
        recording.odometry.x *= 1.06
        recording.odometry.y *= 1.06
        recording.imu.wz += 0.02
        values = {each.check: each.values for each in examine(recording)}
        self.assertAlmostEqual(1.06, values["odometry.speed"]["speed_over_receiver"], delta=0.02)
        self.assertAlmostEqual(0.02, values["imu.yaw_rate_bias"]["bias_rad_s"], delta=0.003)
        self.assertAlmostEqual(0.02, values["imu.bias"]["bias_rad_s"], delta=0.002)

    def test_antenna(self):
        recording = drive(lever=(2.5, 0.0), parts=("odometry", "fix", "imu"))
        good = {each.check: each for each in examine(recording)}["antenna.offset"]
        self.assertEqual("PASS", good.level)
        self.assertAlmostEqual(2.5, good.values["x_m"], delta=3.0 * good.values["sigma_x_m"])
        told = setup.setup_of({"imm_ekf": {"antenna_offset": [-2.0, 0.0]}})
        bad = {each.check: each for each in examine(recording, told)}["antenna.offset"]
        if bad.values["sigma_x_m"] < 0.35:
            self.assertEqual("WARN", bad.level)
            self.assertIn("antenna_offset: [", bad.change[0])


def set_columns(kind, **functions):
    """A fault: columns of a stream, each a function of the stream."""
    def change(recording):
        one = getattr(recording, kind)
        values = {name: function(one) for name, function in functions.items()}
        for name, column in values.items():
            setattr(one, name, np.broadcast_to(column, len(one)).astype(float))
    return change


def cut(kind, begin, end):
    """A fault: no messages for a while."""
    def change(recording):
        one = getattr(recording, kind)
        setattr(recording, kind, one.select((one.t < T0 + begin) | (one.t > T0 + end)))
    return change


def no_frame(kind):
    """A fault: empty frame_ids."""
    def change(recording):
        getattr(recording, kind).frames.clear()
        getattr(recording, kind).frames[""] = 1
    return change


def two_publishers(recording):
    recording.transforms.add("map", "odom", (0.0,) * 6 + (1.0,), "/amcl", False)
    recording.transforms.add("map", "odom", (0.0,) * 6 + (1.0,), "/imm_ekf", False)


def frozen_steps(one, begin, end):
    """A mask of a time."""
    return (one.t > T0 + begin) & (one.t < T0 + end)


DEGREES = 180.0 / math.pi
# (what, the fault, its level, what must be said)
FAULTS = (
    ("yaw rate in degrees", set_columns("odometry", wz=lambda o: o.wz * DEGREES), "FAIL", "degrees per second"),
    ("yaw rate reversed", set_columns("odometry", wz=lambda o: -o.wz), "FAIL", "reversed sign"),
    ("speed in km/h", set_columns("odometry", vx=lambda o: o.vx * 3.6), "FAIL", "km/h in place of m/s"),
    ("speed in mm/s", set_columns("odometry", vx=lambda o: o.vx * 1000.0), "FAIL", "mm/s"),
    ("speed and pose in mph", set_columns("odometry", vx=lambda o: o.vx * 2.237, x=lambda o: o.x * 2.237,
                                          y=lambda o: o.y * 2.237), "FAIL", "mph"),
    ("speed reversed", set_columns("odometry", vx=lambda o: -o.vx), "FAIL", "reversed"),
    ("twist in the odometry's frame", set_columns("odometry", vx=lambda o: o.vx * np.cos(o.yaw),
                                                  vy=lambda o: o.vx * np.sin(o.yaw)), "FAIL", "odometry's frame"),
    ("twist zero", set_columns("odometry", vx=lambda o: 0.0, wz=lambda o: 0.0), "FAIL", "twist is zero"),
    ("twist only", set_columns("odometry", x=lambda o: 0.0, y=lambda o: 0.0, yaw=lambda o: np.nan,
                               quaternion_norm=lambda o: 0.0), "WARN", "twist only"),
    ("dead encoder", set_columns("odometry", vx=lambda o: np.where(frozen_steps(o, 80.0, 120.0), 0.0, o.vx)),
     "FAIL", "dead encoder"),
    ("holonomic", set_columns("odometry", vy=lambda o: 0.5), "WARN", "holonomic"),
    ("NaN in the twist", set_columns("odometry", vx=lambda o: np.where(np.arange(len(o)) % 10, o.vx, np.nan)), "FAIL",
     "not finite"),
    ("gap in the odometry", cut("odometry", 80.0, 86.0), "WARN", "gaps"),
    ("many gaps", cut("odometry", 60.0, 80.0), "FAIL", "gaps"),
    ("stamps zero", set_columns("odometry", t=lambda o: 0.0), "FAIL", "stamps are zero"),
    ("stamps of the fix zero", set_columns("fix", t=lambda o: 0.0), "FAIL", "stamps are zero"),
    ("stamps twice", set_columns("fix", t=lambda o: np.floor((o.t - T0) / 2.0) * 2.0 + T0), "WARN",
     "those of the message before"),
    ("fixes late, with that stamp", set_columns("fix", t=lambda o: o.t + 1.5, received=lambda o: o.received + 1.5),
     "WARN",
     "1.5 s ahead"),
    ("fixes ahead", set_columns("fix", t=lambda o: o.t + 1.5), "FAIL", "1.50 s ahead"),
    ("GPS time", set_columns("fix", t=lambda o: o.t + 18.0), "FAIL", "GPS time"),
    ("IMU's clock, by arrival", set_columns("imu", t=lambda o: o.t + 1.0), "FAIL", "/imu/data: stamps are 1.00 s "
                                                                                   "ahead"),
    ("IMU's clock, by the motion", set_columns("imu", t=lambda o: o.t - 1.0, received=lambda o: o.received - 1.0),
     "FAIL",
     "behind"),
    ("a clock that runs away", set_columns("imu", t=lambda o: T0 + 1.02 * (o.t - T0)), "WARN", "runs away"),
    ("IMU since its start", set_columns("imu", t=lambda o: o.t - T0 + 50.0), "FAIL", "another time"),
    ("IMU in degrees", set_columns("imu", wz=lambda o: o.wz * DEGREES), "FAIL", "degrees per second"),
    ("IMU NED", set_columns("imu", wz=lambda o: -o.wz, az=lambda o: -o.az), "FAIL", "NED"),
    ("IMU on its side", set_columns("imu", wy=lambda o: o.wz, wz=lambda o: 0.001 * np.sin(o.t), ay=lambda o: o.az,
                                    az=lambda o: 0.0), "FAIL", "not vertical"),
    ("IMU without rates", set_columns("imu", rate_cov=lambda o: -1.0), "WARN", "angular_velocity_covariance"),
    ("IMU in g", set_columns("imu", az=lambda o: 1.0), "WARN", "in g"),
    ("velocity in the robot's frame", set_columns("velocity", vx=lambda o: np.hypot(o.vx, o.vy), vy=lambda o: 0.0),
     "FAIL",
     "robot's own frame"),
    ("velocity north, east", set_columns("velocity", vx=lambda o: o.vy, vy=lambda o: o.vx), "FAIL", "NED"),
    ("velocity reversed", set_columns("velocity", vx=lambda o: -o.vx, vy=lambda o: -o.vy), "FAIL", "reversed"),
    ("velocity in km/h", set_columns("velocity", vx=lambda o: 3.6 * o.vx, vy=lambda o: 3.6 * o.vy), "FAIL",
     "km/h in place of m/s"),
    ("velocity zero", set_columns("velocity", vx=lambda o: 0.0, vy=lambda o: 0.0), "FAIL", "always zero"),
    ("latitude and longitude swapped", set_columns("fix", lat=lambda o: o.lon, lon=lambda o: o.lat), "FAIL", "swapped"),
    ("swapped, beyond 90", set_columns("fix", lat=lambda o: o.lon + 100.0, lon=lambda o: o.lat), "FAIL", "swapped"),
    ("degrees times 10^7", set_columns("fix", lat=lambda o: o.lat * 1e7, lon=lambda o: o.lon * 1e7), "FAIL", "10^7"),
    ("millidegrees", set_columns("fix", lat=lambda o: o.lat * 1e3, lon=lambda o: o.lon * 1e3), "FAIL", "millidegrees"),
    ("radians", set_columns("fix", lat=lambda o: o.lat / DEGREES, lon=lambda o: o.lon / DEGREES), "FAIL", "radians"),
    ("status never", set_columns("fix", status=lambda o: -1.0), "FAIL", "status -1"),
    ("places not finite", set_columns("fix", lat=lambda o: np.nan), "FAIL", "no finite place"),
    ("frozen fix", set_columns("fix", lat=lambda o: np.where(frozen_steps(o, 70, 110), LATITUDE, o.lat),
                               lon=lambda o: np.where(frozen_steps(o, 70, 110), LONGITUDE, o.lon)), "WARN",
                               "the same place"),
    ("covariance tiny", set_columns("fix", cov_xx=lambda o: 1e-4, cov_yy=lambda o: 1e-4), "FAIL", "covariance.size"),
    ("covariance zero", set_columns("fix", cov_xx=lambda o: 0.0, cov_yy=lambda o: 0.0), "WARN", "all zero"),
    ("covariance constant", set_columns("fix", cov_xx=lambda o: 1.0, cov_yy=lambda o: 1.0), "WARN", "never changes"),
    ("HDOP^2", set_columns("fix", cov_xx=lambda o: np.round(o.cov_xx, 1) ** 2,
                           cov_yy=lambda o: np.round(o.cov_xx, 1) ** 2,
                           cov_zz=lambda o: 4.0 * np.round(o.cov_xx, 1) ** 2, cov_type=lambda o: 1.0), "WARN",
                           "HDOP^2"),
    ("rounded sigma", set_columns("fix", cov_xx=lambda o: np.round(o.cov_xx, 3)), "WARN", "sigma in place of sigma^2"),
    ("no covariance", set_columns("fix", cov_xx=lambda o: -1.0), "WARN", "negative"),
    ("fix frame empty", no_frame("fix"), "WARN", "frame_id is empty"),
    ("odometry frame empty", no_frame("odometry"), "WARN", "frame_id is empty"),
    ("two nodes map -> odom", two_publishers, "FAIL", "2 nodes broadcast map -> odom"),
    ("satellites weak", set_columns("satellites", strong=lambda o: 2.0), "WARN", "weak"),
    ("satellites of another time", set_columns("satellites", t=lambda o: o.t + 0.3), "WARN", "same stamp"),
    ("no residuals", set_columns("satellites", residuals=lambda o: 0.0), "WARN", "residuals"),
)


# What is told by the motion needs some windows; all else shows in some seconds.
NEED_MOTION = {"km/h in place of m/s", "mm/s", "mph", "dead encoder", "1.5 s ahead", "GPS time", "behind", "swapped",
               "radians",
               "robot's own frame", "NED", "reversed", "the same place", "covariance.size", "gaps"}


class FaultTest(unittest.TestCase):
    """Each fault is named, at its level, with something to change."""

    def test_faults(self):
        for what, change, level, words in FAULTS:
            with self.subTest(what):
                recording = drive(seconds=150.0 if words in NEED_MOTION else 40.0)
                change(recording)
                findings = examine(recording)
                named = [each for each in findings if each.level == level and words in each.check + ": " + each.text]
                self.assertTrue(named, "not named:\n" + said(findings))
                self.assertTrue(all(each.change for each in named), "nothing to change")
                self.assertNotIn("cannot be checked", said(findings))


class SigmaTest(unittest.TestCase):
    """sigma in place of sigma^2, by how it follows the satellites' geometry."""

    def findings(self, power, across=1.0):
        recording = drive(seconds=150.0)
        random = np.random.RandomState(5)
        recording.satellites.dop_xx = np.exp(random.normal(0.0, 0.5, len(recording.satellites)))
        recording.satellites.dop_yy = recording.satellites.dop_xx * np.exp(across * random.normal(0.0, 0.5, len(
            recording.satellites)))
        fix = recording.fix
        fix.cov_xx, fix.cov_yy = ((4.0 * dop) ** power for dop in (recording.satellites.dop_xx,
                                                                   recording.satellites.dop_yy))
        if not across:
            fix.cov_yy = fix.cov_xx
        return said(examine(recording), "WARN")

    def test_variances_pass(self):
        self.assertNotIn("covariance.sigma", self.findings(1.0))
        self.assertNotIn("covariance.sigma", self.findings(1.0, 0.0))

    def test_sigma_is_named(self):
        self.assertIn("sigma in place of sigma^2", self.findings(0.5))
        self.assertIn("sigma in place of sigma^2", self.findings(0.5, 0.0))


class OddInputTest(unittest.TestCase):
    def test_never_stumbles(self):
        """Not finite, one message, all the same, far apart, in another order."""
        values = itertools.cycle((np.nan, np.inf, -1e300, 0.0, 1e300))
        for kind in COLUMNS:
            for name in ("t", "received") + COLUMNS[kind]:
                value = next(values)
                recording = drive(seconds=40.0)
                setattr(getattr(recording, kind), name, np.full(len(getattr(recording, kind)), value))
                self.assertNotIn("cannot be checked", said(examine(recording)), (kind, name, value))
        for value in (np.nan, np.inf, -np.inf, 0.0, -1e300, 1e300):
            recording = drive(seconds=60.0)
            for kind in COLUMNS:
                for name in COLUMNS[kind]:
                    setattr(getattr(recording, kind), name, np.full(len(getattr(recording, kind)), value))
            self.assertNotIn("cannot be checked", said(examine(recording)), value)
        for count in (0, 1, 2, 3):
            recording = drive(seconds=40.0)
            for kind in COLUMNS:
                one = getattr(recording, kind)
                setattr(recording, kind, one.select(np.arange(len(one)) < count))
            self.assertNotIn("cannot be checked", said(examine(recording)), count)

    def test_wild_stamps_end(self):
        recording = drive(seconds=60.0)
        for kind in COLUMNS:
            one = getattr(recording, kind)
            one.t = np.where(np.arange(len(one)) % 7 == 3, 1e12 * np.arange(len(one)), one.t)
        self.assertNotIn("cannot be checked", said(examine(recording)))

    def test_an_empty_recording_fails(self):
        self.assertIn("FAIL topics.fix", said(examine(Recording("empty.bag"))))


class ModuleTest(unittest.TestCase):
    def test_find_lag(self):
        t = np.arange(0.0, 100.0, 0.1)
        random = np.random.RandomState(3)
        values = np.convolve(random.normal(0.0, 1.0, len(t) + 40), np.ones(41), "valid")
        for shift in (-7.3, -0.4, 0.0, 1.2, 9.0):
            lag = signals.find_lag(t, values, t + shift, -values, 20.0)
            self.assertAlmostEqual(shift, lag.lag, delta=0.06)
            self.assertLess(lag.correlation, -0.99)

    def test_fit_ignores_outliers(self):
        random = np.random.RandomState(4)
        p = np.cumsum(random.normal(1.0, 1.0, 40) + 1j * random.normal(0.0, 1.0, 40))
        q = 5.0 + 1.1 * p * np.exp(0.6j)
        q[5], q[20] = 500.0, -300.0j
        found = fits.fit(p, q, free_scale=True)
        self.assertAlmostEqual(0.6, found.rotation, delta=0.02)
        self.assertAlmostEqual(1.1, found.scale, delta=0.02)

    def test_windows_end_in_long_gaps(self):
        t = np.concatenate([np.arange(0.0, 60.0), 1e9 + np.arange(0.0, 60.0)])
        parts = fits.windows(t, t)
        self.assertTrue(parts)
        self.assertTrue(all(t[part][-1] - t[part][0] < 31.0 for part in parts))

    def test_imu_with_orientation_is_turned(self):
        recording = drive(seconds=20.0)
        imu = recording.imu  # lying on its side, and saying so
        imu.wy, imu.wz, imu.ay, imu.az = imu.wz, np.zeros(len(imu)), imu.az, np.zeros(len(imu))
        imu.qx, imu.qw, imu.orientation_cov = (np.full(len(imu), value)
                                               for value in (math.sqrt(0.5), math.sqrt(0.5), 0.0))
        rate, oriented = evidence.imu_yaw_rate(imu)
        self.assertTrue(oriented.all())
        np.testing.assert_allclose(rate, imu.wy, atol=1e-9)

    def test_imu_upside_down_is_turned_by_tf(self):
        recording = drive(seconds=60.0)
        imu = recording.imu
        imu.wz, imu.az = -imu.wz, -imu.az
        self.assertIn("FAIL imu.axes", said(examine(recording)))
        recording.transforms.add("base_link", "imu_link", (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), "/tf", True)
        findings = said(examine(recording))
        self.assertIn("PASS imu.axes", findings)
        self.assertIn("PASS imu.yaw_rate", findings)

    def test_topics_are_chosen(self):
        topics = [Topic("/ground_truth/odom", "nav_msgs/Odometry", 9000),
                  Topic("/wheel/odom", "nav_msgs/Odometry", 900),
                  Topic("/odometry/filtered", "nav_msgs/Odometry", 900),
                  Topic("/cmd_vel", "geometry_msgs/TwistStamped", 99),
                  Topic("/ublox/fix_velocity", "geometry_msgs/TwistWithCovarianceStamped", 9),
                  Topic("/gps/datum", "sensor_msgs/NavSatFix", 1), Topic("/ublox/fix", "sensor_msgs/NavSatFix", 9)]
        chosen = {kind: topic for kind, (topic, _) in choose(topics, {}).items()}
        self.assertEqual({"odometry": "/wheel/odom", "fix": "/ublox/fix", "velocity": "/ublox/fix_velocity"}, chosen)
        self.assertEqual("/odometry/filtered", choose(topics, {"odometry": "odometry/filtered"})["odometry"][0])

    def test_presets(self):
        for type_name, topic, preset in (
                ("ublox_msgs/NavSAT", "/ublox_gps/navsat", "ublox"),
                ("ublox_msgs/NavSAT", "/earth_gps/navsat", "ublox receiver_ns:=earth_gps"),
                ("ublox_msgs/NavSAT", "/navsat", "ublox receiver_ns:=/"), ("nmea_msgs/Sentence", "/nmea_sentence", "nmea"),
                ("gps_common/GPSFix", "/extended_fix", "gpsd"),
                ("gps_common/GPSFix", "/septentrio_gnss/gpsfix", "septentrio"),
                ("novatel_gps_msgs/Trackstat", "/trackstat", "novatel"),
                ("sensor_msgs/NavSatFix", "/mavros/global_position/raw/fix", "mavros")):
            recording = drive(seconds=20.0)
            recording.topics.append(Topic(topic, type_name, 5))
            found = [each for each in examine(recording) if each.check == "topics.receiver"]
            self.assertEqual(("localization.launch receiver:=" + preset,), found[0].change)

    def test_setup(self):
        told = setup.setup_of({"imm_ekf": {"base_link_frame": "/base", "antenna_offset": [0.3, 0]}})
        self.assertEqual(("base", (0.3, 0.0), True), (told.base_link_frame, told.antenna_offset, told.given_antenna))
        self.assertEqual("ukf", setup.setup_of({"occlusion": {}, "ukf": {"odom_frame": "o"}}).section)
        for other in ({"robot1": {"ukf": {"odom_frame": "o"}}}, {"/robot1/ukf": {"odom_frame": "o"}}):
            self.assertEqual("o", setup.setup_of(other).odom_frame)
        self.assertEqual(setup.DEFAULTS, setup.setup_of({"gps_bias": {}, "rate": {"a": 1}}))
        findings = examine(drive(seconds=20.0), told)
        self.assertIn("WARN frames.base_link_frame", said(findings))

    def test_json_and_page(self):
        recording = drive(seconds=60.0)
        findings, found = checks.examine(recording, setup.DEFAULTS)
        content = json.loads(text.as_json(recording, findings, 0))
        self.assertEqual(len(findings), len(content["findings"]))
        self.assertEqual("/odom", content["chosen"]["odometry"]["topic"])
        html = page.page(found, findings)
        self.assertEqual(2, html.count('src="data:image/png;base64,'))
        self.assertNotIn("http", html.replace("http-equiv", ""))
        headings = re.findall("<h2>(.*?)</h2>", html)
        self.assertEqual(sorted(set(headings)), sorted(headings), "a heading stands once")
        self.assertNotIn("times of findings", html)

    def test_page_marks_the_times_of_findings(self):
        recording = drive(seconds=60.0)
        recording.odometry = recording.odometry.select(abs(recording.odometry.t - T0 - 33.0) > 3.0)
        findings, found = checks.examine(recording, setup.DEFAULTS)
        gap = [each for each in page.timed(findings) if each.check == "stamps.odometry"][0]
        (begin, end), = gap.values["spans"]
        self.assertAlmostEqual(30.0, begin - T0, delta=0.2)
        self.assertAlmostEqual(36.0, end - T0, delta=0.2)
        self.assertIn("the longest 6.1 s at 30.0 s", gap.text)
        self.assertIn("times of findings", page.page(found, findings))

    def test_times_count_from_the_begin_of_the_record(self):
        recording = drive(seconds=60.0)
        self.assertEqual(recording.begin, recording.first_stamp())
        for stream in recording.streams():
            stream.received = stream.received + 1e5
        recording.begin, recording.end = recording.begin + 1e5, recording.end + 1e5
        self.assertAlmostEqual(T0, recording.first_stamp(), delta=1.0)

    def test_last_bin_of_the_rates_is_whole(self):
        for length in (0.0, 2.0, 61.3):
            recording = Recording("a", begin=T0, end=T0 + length)
            edges = page.bins(recording)
            self.assertAlmostEqual(max(length, 1e-3), edges[-1] - edges[0], delta=1e-6)
            self.assertLess(np.ptp(np.diff(edges)), 1e-6)


if __name__ == "__main__":
    unittest.main()
