"""Do the streams agree on the time: by the time of arrival, and by the motion that each of them saw."""

import numpy as np

from . import fits, signals
from .evidence import LEAST_WAY_M
from .finding import failed, passed, warned

AHEAD_S = 0.3          # a message cannot arrive before it was measured; clocks that are set by NTP differ by less
LATE_S = 0.5           # later than this after its stamp is more than a receiver needs
FAR_S = 3.0            # the most that a localizer allows for by itself is 2 s
NAMED_OFFSETS = ((18.0, "GPS time instead of UTC: 18 leap seconds"), (37.0, "TAI instead of UTC: 37 leap seconds"),
                 (19.0, "TAI instead of GPS time"))
NAMED_WITHIN_S = 0.7
IMU_WARN_S, IMU_FAIL_S = 0.25, 0.8   # yaw rates of good recordings differ by up to 0.4 s (smoothed odometry)
IMU_SURE = 0.6                       # correlation
MOTION_WARN_S = 0.5                  # receivers that smooth are off by up to 0.4 s
# Mean gain of the best lag over none, in standard errors over windows. Good recordings reach 2.6, at lags below 0.5 s.
SURE, VERY_SURE = 2.0, 4.0
COARSE = np.arange(-25.0, 25.01, 1.0)
FINE = np.arange(-1.5, 1.51, 0.1)
HALVES_AGREE_S = 0.8
WINDOWS = 40


def check(evidence):
    """All findings of this family."""
    return arrivals(evidence.recording) + imu_lag(evidence) + receiver_lag(evidence, "velocity") + \
        receiver_lag(evidence, "fix")


def named(offset):
    """What an offset usually is; empty where it has no name."""
    for value, name in NAMED_OFFSETS:
        if abs(abs(offset) - value) < NAMED_WITHIN_S:
            return " ({})".format(name)
    return ""


def arrivals(recording):
    """Stamps against the time of arrival, beside those of the odometry (or of the stream with most messages)."""
    delays = {stream.kind: (stream, signals.median((stream.received - stream.t)[stream.t > 0.0]))
              for stream in recording.streams() if np.any(stream.t > 0.0) and stream.kind != "satellites"}
    if not delays:
        return []
    reference = "odometry" if "odometry" in delays else max(delays, key=lambda kind: len(delays[kind][0]))
    base = delays[reference][1]
    findings = []
    if all(abs(delay) < 1e-6 for _, delay in delays.values()):
        return [passed("clocks.arrival", "the bag's times are the stamps themselves: nothing to compare")]
    for kind, (stream, delay) in delays.items():
        name, offset = "clocks." + kind, delay - base
        change = ("synchronize the clocks: chrony or ntp on both computers, and the receiver's stamps in UTC",)
        if kind == reference:
            if abs(delay) > FAR_S:
                findings.append(warned(name, "{}: stamps and times of arrival differ by {:.1f} s{}".format(
                    stream.topic, delay, named(delay)), "fine if the bag was made anew from another; else " + change[0],
                    arrival_s=delay))
        elif offset < -AHEAD_S:
            finding = failed if offset < -1.0 else warned
            findings.append(finding(name, "{}: stamps are {:.2f} s ahead of those of {}, by the times of arrival{}".format(
                stream.topic, -offset, delays[reference][0].topic, named(offset)), *change, arrival_s=offset))
        elif offset > LATE_S:
            finding = failed if offset > FAR_S else warned
            findings.append(finding(name, "{}: messages arrive {:.2f} s after their stamps, {} {:.2f} s: {}{}".format(
                stream.topic, delay, delays[reference][0].topic, base,
                "a slow driver, or a clock that is behind", named(offset)), *change, arrival_s=offset))
    return findings or [passed("clocks.arrival", "stamps and times of arrival agree between the streams, to {:.2f} s".format(
        max(abs(delay - base) for _, delay in delays.values())))]


def imu_lag(evidence):
    """Yaw rates of odometry and IMU against each other."""
    if evidence.motion is None or evidence.imu_rate is None:
        return []
    t, _, rate = evidence.motion
    imu_t, imu_rate = evidence.imu_rate
    half = 0.5 * signals.period(t)  # a message tells of the time before it
    lag = signals.find_lag(t - half, rate, imu_t, imu_rate, COARSE[-1])
    if lag is None or abs(lag.correlation) < IMU_SURE or lag.support * max(signals.period(t), 0.05) < 10.0:
        return []
    offset, tolerance = lag.lag, 0.25 * signals.period(t)
    text = "by the yaw rates, stamps of {} are {:.2f} s {} those of {} (correlation {:.2f}, {:.2f} as they are)".format(
        evidence.recording.imu.topic, abs(offset), "ahead of" if offset > 0 else "behind",
        evidence.recording.odometry.topic, abs(lag.correlation), abs(lag.at_zero))
    change = "one clock for both: ros::Time::now() at the measurement in both drivers, or chrony between the computers"
    values = dict(lag_s=offset, correlation=lag.correlation)
    gains = abs(lag.correlation) - abs(lag.at_zero) > 0.02
    if abs(offset) > IMU_FAIL_S + tolerance and gains:
        return [failed("clocks.imu_motion", text + named(offset), change, "or localization.launch use_imu:=false", **values)]
    if abs(offset) > IMU_WARN_S + tolerance and gains:
        return [warned("clocks.imu_motion", text, change, **values)]
    return [passed("clocks.imu_motion", "yaw rates of odometry and IMU agree in time, to {:.2f} s".format(abs(offset)),
                   **values)]


def receiver_lag(evidence, kind):
    """The receiver's motion against the track of the odometry."""
    data = evidence.velocities if kind == "velocity" else evidence.fixes
    track = evidence.track()
    if data is None or track is None or track.way[-1] < 3.0 * LEAST_WAY_M:
        return []
    t, q = data[:2]
    found = motion_lag(track, t, q, kind == "velocity")
    if found is None:
        return []
    lag, sureness, agrees = found
    stream = getattr(evidence.recording, kind)
    text = "by the motion, stamps of {} are {:.1f} s {} those of {}".format(
        stream.topic, abs(lag), "ahead of" if lag > 0 else "behind", evidence.recording.odometry.topic)
    name, values = "clocks.{}_motion".format(kind), dict(lag_s=lag, sureness=sureness)
    if abs(lag) <= MOTION_WARN_S:
        return [passed(name, "{} and odometry agree in time, to {:.1f} s by the motion".format(stream.topic, abs(lag)),
                       **values)]
    if sureness < SURE or not agrees:
        return [passed(name, "the motion does not tell whether {} and odometry agree in time".format(stream.topic),
                       **values)]
    if lag > 0:
        text += ": fixes come late and have the time of their arrival"  if kind == "fix" else ": it comes late"
    change = ["the driver's stamps: the time of the measurement, in UTC"]
    if abs(lag) <= FAR_S:
        change.append("imm_ekf: {{expert: {{fix_delay: {:.1f}}}}}  # or leave it at auto, which finds up to 2 s".format(lag))
        return [warned(name, text, *change, **values)]
    finding = failed if sureness > VERY_SURE else warned
    return [finding(name, text + named(lag), *change, **values)]


def motion_lag(track, t, q, of_velocity):
    """(lag s, how sure, whether halves of the drive agree) by the windows with most change of motion."""
    if of_velocity:
        usual = np.percentile(np.abs(q), 98)
        t, q = t[np.abs(q) <= 2.0 * usual + 1.0], q[np.abs(q) <= 2.0 * usual + 1.0]
    inside = (t >= track.t[0]) & (t <= track.t[-1])
    t, q = t[inside], q[inside]
    parts = fits.windows(t, track.t)
    parts = [part for part in parts if track.way_at(t[part.stop - 1]) - track.way_at(t[part.start]) > LEAST_WAY_M]
    if len(parts) < 4:
        return None
    parts = fits.most_excited(track, t, parts, WINDOWS)
    spread = fits.spread_of(fits.window_fits(track, t, q, parts, 0.0, of_velocity))

    def costs(lags):
        return np.array([fits.cost(fits.window_fits(track, t, q, parts, lag, of_velocity), spread) for lag in lags])

    coarse = costs(COARSE)
    rough = COARSE[np.argmin(np.mean(coarse, axis=1))]
    lags = rough + FINE
    fine = costs(lags)
    best = int(np.argmin(np.mean(fine, axis=1)))
    halves = [lags[np.argmin(np.mean(fine[:, begin::2], axis=1))] for begin in (0, 1)]
    none = costs([0.0])[0]
    advantage = none - fine[best]
    error = np.std(advantage) / np.sqrt(0.5 * len(parts))  # windows overlap by half
    sureness = float(np.mean(advantage) / max(error, 1e-9))
    return float(lags[best]), sureness, bool(abs(halves[0] - halves[1]) <= HALVES_AGREE_S)
