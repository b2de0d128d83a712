"""Yaw rates of odometry and IMU: against each other, against the receiver's motion, and which of them is wrong."""

import numpy as np

from . import motion_fit, signals
from .finding import failed, passed, warned
from .motion_fit import IN_ODOM_FRAME
from .units import RATE_UNITS, rate_name_of

TURNING_RAD_S = 0.05
LEAST_TURNING = 20        # samples; less turning says nothing
CORRELATED = 0.6          # the two yaw rates; on good recordings 0.67 (Segway, 1 Hz) to 1.0
UNRELATED = 0.3
SAME_WITHIN = 0.3         # of the factor between them: wheels that slip in turns are off by so much
BIAS_RAD_S = 0.01         # 0.6 deg/s: learnt by the filter, but slowly
GREAT_RATE_RAD_S = 8.0    # faster than any robot turns for long: degrees
SMALL_RAD_S = 1e-9
# What makes good of a reading.
FACTORS = {"in degrees": motion_fit.DEGREE, "reversed": -1.0, "reversed and in degrees": -motion_fit.DEGREE}
SIDEWAYS_MPS, SIDEWAYS_SHARE = 0.1, 0.05


def check(evidence):
    """All findings of this family."""
    readings = motion_fit.readings_of(evidence)
    choose_source(evidence, readings)
    if evidence.twist_is_wrong:
        return once(pair(evidence, {}) + impossible(evidence, "odometry") + impossible(evidence, "imu"))
    if moves_in_odom_frame(evidence, readings):
        # Then the ways say nothing of the yaw rates.
        return [failed("odometry.frame", "{}: fixes move as if the twist were in the odometry's frame "
                       "(header.frame_id), not in the robot's".format(evidence.recording.odometry.topic),
                       "in the driver: twist in child_frame_id, x forward")] + pair(evidence, {})
    by_receiver = {source: best_reading(readings, source) for source in ("odometry", "imu")}
    findings = pair(evidence, by_receiver)
    for source in ("odometry", "imu"):
        findings += against_receiver(evidence, source, by_receiver[source])
        findings += impossible(evidence, source)
        if by_receiver[source] and by_receiver[source][0] in FACTORS:
            evidence.correct_yaw_rate(source, FACTORS[by_receiver[source][0]])  # so that the other checks see past it
    findings += bias(evidence)
    return once(findings)


def moves_in_odom_frame(evidence, readings):
    """Whether the twist has a part to the side, and fits the receiver best if it is not turned by the heading."""
    if not readings or not np.mean(np.abs(evidence.motion[1].imag) > SIDEWAYS_MPS) > SIDEWAYS_SHARE:
        return False
    unturned = next(reading for reading in readings if reading.name == IN_ODOM_FRAME)
    best = motion_fit.best_of(readings)
    return motion_fit.clearly_better(unturned, readings[0]) and not motion_fit.clearly_better(best, unturned)


def once(findings):
    """Of findings of one check, the first of the gravest."""
    kept = {}
    for finding in findings:
        old = kept.get(finding.check)
        if old is None or ("PASS", "WARN", "FAIL").index(finding.level) > ("PASS", "WARN", "FAIL").index(old.level):
            kept[finding.check] = finding
    return list(kept.values())


def best_reading(readings, source):
    """(name of the reading that is clearly better than the plain one or None, its gain); None without readings."""
    own = [reading for reading in readings if reading.source == source]
    if not own:
        return None
    plain = own[0]
    best = motion_fit.best_of(own)
    if best is not plain and motion_fit.clearly_better(best, plain):
        return best.name, motion_fit.gain(best, plain)
    # Or the plain one is clearly better than being reversed: then it is known to be right.
    reverse = next(reading for reading in own if reading.name == "reversed")
    return ("as it is" if motion_fit.clearly_better(plain, reverse) else None), motion_fit.gain(plain, reverse)


def choose_source(evidence, readings):
    """The yaw rate whose track fits the receiver better, for all other checks."""
    plain = {reading.source: reading for reading in readings if reading.name == "as it is"}
    if "imu" in plain and motion_fit.gain(plain["imu"], plain["odometry"])[0] > 0.0:
        evidence.yaw_source = "imu"
    elif "imu" in evidence.tracks and not plain:
        evidence.yaw_source = "imu"


def rates_of(evidence):
    """The two yaw rates at the times of the odometry, shifted to where they agree best; None without both."""
    if evidence.motion is None or evidence.imu_rate is None:
        return None
    t, _, rate = evidence.motion
    imu_t, imu_rate = evidence.imu_rate
    half = 0.5 * signals.period(t)
    lag = signals.find_lag(t - half, rate, imu_t, imu_rate, 25.0)
    if lag is None:
        return None
    shift = lag.lag if abs(lag.correlation) > CORRELATED else 0.0
    grid, step = signals.common_grid(t, imu_t, 0.1)
    if len(grid) < LEAST_TURNING:
        return None
    odometry, first = signals.resample(t - half, rate, grid, step)
    imu, second = signals.resample(imu_t - shift, imu_rate, grid, step)
    both = first & second
    return odometry[both], imu[both], lag


def pair(evidence, by_receiver):
    """The IMU's yaw rate against the odometry's."""
    found = rates_of(evidence)
    if found is None:
        return []
    odometry, imu, lag = found
    if len(imu) and np.max(np.abs(imu)) < SMALL_RAD_S and np.max(np.abs(odometry)) > TURNING_RAD_S:
        return [failed("imu.yaw_rate", "{}: the yaw rate is always zero, though the odometry turns".format(
            evidence.recording.imu.topic), "localization.launch use_imu:=false, or correct the driver")]
    turning = int(np.sum(np.abs(odometry) > TURNING_RAD_S)), int(np.sum(np.abs(imu) > TURNING_RAD_S))
    if max(turning) < LEAST_TURNING or len(imu) < LEAST_TURNING:
        return [passed("imu.yaw_rate", "too few turns to compare the yaw rates of odometry and IMU")]
    size = float(np.std(imu) / max(np.std(odometry), SMALL_RAD_S))
    if abs(lag.correlation) < CORRELATED:
        return unrelated(evidence, odometry, imu, lag, size)
    slope = float(np.sum(odometry * imu) / max(np.sum(odometry ** 2 if size >= 1.0 else imu ** 2), 1e-12))
    slope = slope if size >= 1.0 else 1.0 / slope if abs(slope) > 1e-9 else 0.0
    values = dict(imu_over_odometry=slope, correlation=lag.correlation)
    return judge(evidence, slope, values, by_receiver)


def judge(evidence, slope, values, by_receiver):
    """What a factor between IMU and odometry means, and whose fault it is."""
    imu, odometry = evidence.recording.imu.topic, evidence.recording.odometry.topic
    unit = rate_name_of(abs(slope))
    reversed_sign = slope < 0.0
    if not reversed_sign and abs(np.log(slope)) < np.log(1.0 + SAME_WITHIN):
        return [passed("imu.yaw_rate", "{}: the yaw rate is {:.3f} times the odometry's".format(imu, slope), **values)]
    text = "the yaw rate of {} is {:.3g} times that of {}".format(imu, slope, odometry)
    if not reversed_sign and unit is None and 0.5 < slope < 2.0:
        return [warned("imu.yaw_rate", text + ": wheels that slip in turns, or a wrong track width",
                       "the base's parameter wheel_separation", **values)]
    if unit == RATE_UNITS[0][1] and not reversed_sign:
        return [failed("imu.yaw_rate", text + ": the IMU is in degrees per second", *imu_change("degrees"), **values)]
    if unit == RATE_UNITS[1][1] and not reversed_sign:
        return [failed("odometry.yaw_rate", text + ": the odometry's yaw rate is in degrees per second",
                       "in the driver: twist.angular.z in rad/s", **values)]
    guilty = who_is_wrong(evidence, by_receiver)
    if reversed_sign and guilty == "imu":
        return [failed("imu.yaw_rate", text + ": NED axes or upside down" + gravity_hint(evidence),
                       *imu_change("reversed"), **values)]
    if reversed_sign and guilty == "odometry":
        return [failed("odometry.yaw_rate", text + ": the odometry's yaw rate has the reversed sign",
                       "in the driver: twist.angular.z positive to the left", **values)]
    if reversed_sign:
        return [failed("imu.yaw_rate", text + ": the IMU has NED axes or is upside down, or the odometry's yaw rate "
                       "has the reversed sign" + gravity_hint(evidence), *imu_change("reversed"), **values)]
    return [failed("imu.yaw_rate" if guilty != "odometry" else "odometry.yaw_rate", text
                   + (": " + unit if unit else ""),
                   "in the drivers: angular_velocity.z and twist.angular.z in rad/s", **values)]


def imu_change(what):
    """What to do about an IMU."""
    return ("in the IMU's driver: " + ("angular_velocity in rad/s" if what == "degrees" else
                                       "axes of REP-103 (x forward, y left, z up), e.g. use_enu_frame: true"),
            "or tf base_link -> its frame with roll 3.1416, where it is upside down" if what != "degrees" else
            "or its calibration",
            "localization.launch use_imu:=false  # until then")


def who_is_wrong(evidence, by_receiver):
    """"imu" or "odometry", by the receiver, else by gravity and the odometry's pose; None where nothing tells."""
    verdicts = {source: found[0] for source, found in by_receiver.items() if found and found[0]}
    wrong = [source for source, verdict in verdicts.items() if verdict != "as it is"]
    right = [source for source, verdict in verdicts.items() if verdict == "as it is"]
    if len(wrong) == 1:
        return wrong[0]
    if len(right) == 1:
        return "odometry" if right[0] == "imu" else "imu"
    if gravity_hint(evidence):
        return "imu"
    return None


def gravity_hint(evidence):
    """Words for an accelerometer that feels gravity from above; empty else."""
    imu = evidence.recording.imu
    down = signals.median(imu.az)
    return " (linear_acceleration.z is {:.1f} m/s^2 at rest, where z up has +9.8)".format(down) if down < -5.0 else ""


def unrelated(evidence, odometry, imu, lag, size):
    """Yaw rates that have nothing to do with each other."""
    topic = evidence.recording.imu.topic
    values = dict(correlation=lag.correlation)
    others = other_axes(evidence)
    if others:
        axis, correlation = others
        return [failed("imu.yaw_rate", "{}: its z axis is not vertical: turns show in angular_velocity.{} (correlation "
                       "{:.2f}, z {:.2f})".format(topic, axis, correlation, lag.correlation),
                       "tf base_link -> {} as it is mounted, or an orientation in the messages".format(
                           evidence.recording.imu.frame() or "its frame"),
                       "localization.launch use_imu:=false  # until then", **values)]
    if abs(lag.correlation) > UNRELATED or min(np.std(odometry), np.std(imu)) < 0.5 * TURNING_RAD_S:
        return [warned("imu.yaw_rate", "yaw rates of {} and {} agree badly (correlation {:.2f})".format(
            topic, evidence.recording.odometry.topic, lag.correlation),
            "compare rostopic echo of both while it turns on the spot", **values)]
    return [warned("imu.yaw_rate", "yaw rates of {} and {} have nothing to do with each other (correlation {:.2f}): an "
                   "axis that is not vertical, another clock, or slipping wheels".format(
                       topic, evidence.recording.odometry.topic, lag.correlation),
                   "compare rostopic echo of both while it turns on the spot", **values)]


def other_axes(evidence):
    """(axis, correlation) where x or y of the IMU turns with the odometry; None else."""
    imu = evidence.recording.imu
    t, _, rate = evidence.motion
    found = []
    for axis in "xy":
        lag = signals.find_lag(t, rate, imu.t, getattr(imu, "w" + axis), 2.0)
        if lag is not None:
            found.append((abs(lag.correlation), axis, lag.correlation))
    best = max(found, default=(0.0, "", 0.0))
    return (best[1], best[2]) if best[0] > CORRELATED else None


def against_receiver(evidence, source, found):
    """The yaw rate by the way that the receiver saw."""
    if found is None or found[0] is None:
        return []
    topic = (evidence.recording.odometry if source == "odometry" else evidence.recording.imu).topic
    reading, (size, sureness) = found
    name, values = source + ".yaw_rate", dict(reading=reading, gain=size, sureness=sureness)
    if reading == "as it is":
        return [passed(name, "{}: turns as the fixes do".format(topic), **values)]
    if reading == IN_ODOM_FRAME:
        return [warned(name, "{}: the fixes go straighter than this yaw rate".format(topic),
                       "compare with an IMU; wheels that slip?", **values)]
    text = {"in degrees": "in degrees per second", "reversed": "of the reversed sign",
            "reversed and in degrees": "of the reversed sign and in degrees per second"}[reading]
    if reading != "reversed" and signals.robust_sigma(evidence.motion[2]) < TURNING_RAD_S and source == "odometry" and \
            np.percentile(np.abs(evidence.motion[2]), 99) < 1.0:
        # A yaw rate that turns hardly anyway: noise that is left out, not another unit.
        return [warned(name, "{}: the fixes go straighter than this yaw rate".format(topic),
                       "compare with an IMU; wheels that slip?", **values)]
    change = imu_change("degrees" if "degrees" in reading else "reversed") if source == "imu" else \
        ("in the driver: twist.angular.z in rad/s, positive to the left",)
    return [failed(name, "{}: fixes turn as if its yaw rate were {}".format(topic, text), *change, **values)]


def impossible(evidence, source):
    """Yaw rates that no robot has for long."""
    data = evidence.motion if source == "odometry" else evidence.imu_rate
    if data is None:
        return []
    rate = np.abs(data[-1])
    stream = evidence.recording.odometry if source == "odometry" else evidence.recording.imu
    great = float(np.mean(rate > GREAT_RATE_RAD_S))
    if great > 0.02:
        return [failed(source + ".yaw_rate", "{}: the yaw rate is above {:.0f} rad/s in {:.0f} % of the messages: "
                       "degrees per second?".format(stream.topic, GREAT_RATE_RAD_S, 100.0 * great),
                       *(imu_change("degrees") if source == "imu" else ("in the driver: twist.angular.z in rad/s",)),
                       share=great)]
    single = int(np.sum(rate > GREAT_RATE_RAD_S))
    if single:
        return [warned(source + ".spikes", "{}: {} single yaw rates above {:.0f} rad/s, up to {:.1f}".format(
            stream.topic, single, GREAT_RATE_RAD_S, np.max(rate)), "a filter in the driver", count=single)]
    return []


def bias(evidence):
    """Yaw rate at rest, and against the IMU over the drive."""
    findings = []
    if evidence.imu_rate is not None and evidence.motion is not None:
        t, velocity, _ = evidence.motion
        imu_t, rate = evidence.imu_rate
        speed = np.interp(imu_t, t, np.abs(velocity))
        turning = np.abs(np.interp(imu_t, t, evidence.motion[2]))
        still = (speed < 0.02) & (turning < 0.02) & (np.abs(rate) < 0.3)
        if np.sum(still) > 50:
            offset = float(np.median(rate[still]))
            finding = warned if abs(offset) > BIAS_RAD_S else passed
            change = ("the IMU's calibration at rest",) if abs(offset) > BIAS_RAD_S else ()
            findings.append(finding("imu.bias", "{}: the yaw rate at rest is {:+.4f} rad/s".format(
                evidence.recording.imu.topic, offset), *change, bias_rad_s=offset))
    return findings
