"""Do the streams agree on the time: by the time of arrival, and by the motion that each of them saw."""

import numpy as np

from . import fits, motion_fit, signals
from .evidence import LEAST_WAY_M
from .finding import PASS, failed, passed, warned

AHEAD_S = 0.3          # a message cannot arrive before it was measured; clocks that are set by NTP differ by less
FAIL_AHEAD_S = 0.9
DRIFT_S = 0.3          # a delay that grows by more is no latency
LATE_S = 0.5           # later than this after its stamp is more than a receiver needs
ANOTHER_EPOCH_S = 86400.0
AUTO_DELAY_S = 2.5     # by these fits, which are off by some tenths, up to here auto is better than a number
FAR_S = 3.0            # the most that a localizer allows for by itself is 2 s
NAMED_OFFSETS = ((18.0, "GPS time instead of UTC: 18 leap seconds"), (37.0, "TAI instead of UTC: 37 leap seconds"),
                 (19.0, "TAI instead of GPS time"))
NAMED_WITHIN_S, NAMED_WITHIN_MOTION_S = 0.7, 2.5  # fixes may be late besides
IMU_WARN_S, IMU_FAIL_S = 0.25, 0.8   # yaw rates of good recordings differ by up to 0.4 s (smoothed odometry)
IMU_SURE = 0.6                       # correlation
IMU_GAIN = 1.1                       # of what is left unexplained, by the lag
MOTION_WARN_S = 0.7                  # receivers that smooth are off by up to 0.6 s
# A lag is true where it makes the fit clearly better (by so much of its logarithm) in some windows, and hardly ever
# worse. Good recordings have lags below 0.5 s, or true ones.
MATTERS = 0.1
HELPS_WARN, HELPS_FAIL = 4, 6          # windows
HURTS_SHARE = 0.35                     # of those in which it helps
COARSE = np.arange(-25.0, 25.01, 1.0)
FINE = np.arange(-1.5, 1.51, 0.1)
HALVES_AGREE_S, HALVES_AGREE_SHARE = 1.3, 0.15  # or this of the lag
FOLLOWS = 0.5                       # of the motion that may be left, with the lag
WINDOWS = 40


def check(evidence):
    """All findings of this family but those that need a velocity that points where it should."""
    return arrivals(evidence) + imu_lag(evidence) + receiver_lag(evidence, "fix", evidence.track())


def check_velocity(evidence):
    """The clock of the receiver's velocity; and that of the fixes by the velocity, which is better than wheels."""
    if not evidence.velocity_is_good:
        return []
    findings = receiver_lag(evidence, "velocity", evidence.track())
    t, velocity = evidence.velocities
    by_velocity = receiver_lag(evidence, "fix", fits.Track(t, velocity, np.zeros(len(t))), evidence.recording.velocity)
    return findings + [finding for finding in by_velocity if finding.level != PASS]


def named(offset, within=NAMED_WITHIN_S):
    """What an offset usually is; empty where it has no name."""
    for value, name in NAMED_OFFSETS:
        if abs(abs(offset) - value) < within:
            return " ({})".format(name)
    return ""


def arrivals(evidence):
    """Stamps against the time of arrival, beside those of the odometry (or of the stream with most messages)."""
    recording = evidence.recording
    delays = {stream.kind: (stream, signals.median((stream.received - stream.t)[stream.t > 0.0]))
              for stream in recording.streams() if np.any(stream.t > 0.0) and stream.kind != "satellites"}
    if not delays:
        return []
    reference = "odometry" if "odometry" in delays else max(delays, key=lambda kind: len(delays[kind][0]))
    base = delays[reference][1]
    findings = []
    if all(abs(delay) < 1e-6 for _, delay in delays.values()):
        return [passed("clocks.arrival", "the bag's times are the stamps themselves: nothing to compare")]
    for stream, _ in delays.values():
        findings += runaway(stream)
    for kind, (stream, delay) in delays.items():
        name, offset = "clocks." + kind, delay - base
        change = ("synchronize the clocks: chrony or ntp on both computers, and the receiver's stamps in UTC",)
        if abs(offset) > ANOTHER_EPOCH_S:
            continue  # stamps_check tells
        if kind == reference:
            if abs(delay) > FAR_S:
                findings.append(warned(name, "{}: stamps and times of arrival differ by {:.1f} s{}".format(
                    stream.topic, delay, named(delay)), "fine if the bag was made anew from another; else " + change[0],
                    arrival_s=delay))
        elif offset < -AHEAD_S:
            finding = failed if offset < -FAIL_AHEAD_S else warned
            if finding is failed:
                evidence.shift(kind, -offset)  # so that the other checks see past it
            findings.append(finding(name,
                                    "{}: stamps are {:.2f} s ahead of those of {}, by the times of arrival{}".format(
                stream.topic, -offset, delays[reference][0].topic, named(offset)), *change, arrival_s=offset))
        elif offset > LATE_S:
            finding = failed if offset > FAR_S else warned
            findings.append(finding(name, "{}: messages arrive {:.2f} s after their stamps, {} {:.2f} s: {}{}".format(
                stream.topic, delay, delays[reference][0].topic, base,
                "a slow driver, or a clock that is behind", named(offset)), *change, arrival_s=offset))
    return findings or [passed("clocks.arrival",
                               "stamps and times of arrival agree between the streams, to {:.2f} s".format(
        max(abs(delay - base) for _, delay in delays.values())))]


def runaway(stream):
    """A clock that runs faster or slower than that of the computer which recorded."""
    delay = (stream.received - stream.t)[stream.t > 0.0]
    tenth = len(delay) // 10
    if tenth < 5:
        return []
    drift = signals.median(delay[-tenth:]) - signals.median(delay[:tenth])
    if not DRIFT_S < abs(drift) < ANOTHER_EPOCH_S:
        return []
    return [warned("clocks.drift", "{}: the delay between stamps and arrival changes by {:+.2f} s from the first to "
                                   "the last "
                   "tenth: its clock runs away, or was set meanwhile".format(stream.topic, drift),
                   "synchronize the clocks: chrony or ntp, and not by a jump while it drives", drift_s=drift)]


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
    # What is left unexplained, without and with the lag.
    without, within = 1.0 - lag.at_zero ** 2, max(1.0 - lag.correlation ** 2, 1e-6)
    gains = without / within > IMU_GAIN
    if abs(offset) > IMU_FAIL_S + tolerance and gains and (lag.unique or abs(offset) < FAR_S):
        return [failed("clocks.imu_motion", text + named(offset), change, "or localization.launch use_imu:=false",
                       **values)]
    if abs(offset) > IMU_WARN_S + tolerance and gains:
        return [warned("clocks.imu_motion", text, change, **values)]
    return [passed("clocks.imu_motion", "yaw rates of odometry and IMU agree in time, to {:.2f} s".format(abs(offset)),
                   **values)]


def receiver_lag(evidence, kind, track, source=None):
    """The receiver's motion against a track: that of the odometry, or of another stream."""
    data = evidence.velocities if kind == "velocity" else evidence.fixes
    if data is None or track is None or track.way[-1] < 3.0 * LEAST_WAY_M:
        return []
    t, q = data[:2]
    found = motion_lag(track, t, q, kind == "velocity")
    if found is None:
        return []
    lag, helps, hurts, agrees = found
    reference = (source or evidence.recording.odometry).topic
    stream = getattr(evidence.recording, kind)
    text = "by the motion, stamps of {} are {:.1f} s {} those of {}".format(
        stream.topic, abs(lag), "ahead of" if lag > 0 else "behind", reference)
    name, values = "clocks.{}_motion".format(kind), dict(lag_s=lag, helps=helps, hurts=hurts)
    if abs(lag) <= MOTION_WARN_S:
        return [passed(name, "{} and {} agree in time, to {:.1f} s by the motion".format(
            stream.topic, reference, abs(lag)),
                       **values)]
    if kind == "fix" and abs(lag) > FAR_S and mirror_fits_better(track, t, q, lag):
        return []  # turns to and fro: the fixes are mirrored, which fix_check tells, and not late
    if helps < HELPS_WARN or hurts > HURTS_SHARE * helps or not agrees:
        return [passed(name, "the motion does not tell whether {} and {} agree in time".format(
            stream.topic, reference),
                       **values)]
    if lag > 0:
        text += ": fixes come late and have the time of their arrival"  if kind == "fix" else ": it comes late"
    change = ["the driver's stamps: the time of the measurement, in UTC"]
    if abs(lag) <= FAR_S:
        change.append("or nothing: fix_delay is found by itself (auto), up to 2 s" if 0.0 < lag < AUTO_DELAY_S else
                      "imm_ekf: {{expert: {{fix_delay: {:.1f}}}}}  # auto finds up to 2 s".format(lag))
        return [warned(name, text, *change, **values)]
    evidence.shift(kind, lag)  # so that the other checks see past it
    finding = failed if helps >= HELPS_FAIL else warned
    return [finding(name, text + named(lag, NAMED_WITHIN_MOTION_S), *change, **values)]


def mirror_fits_better(track, t, q, lag):
    """Whether a mirror image of the fixes without a lag fits the track better than the fixes with it."""
    parts = motion_fit.most_turning(track, t, motion_fit.useful_windows(track, t, q, track.t))
    late, mirrored = (motion_fit.read("", "", track, *series, parts) for series in ((t - lag, q), (t, np.conj(q))))
    return motion_fit.gain(mirrored, late)[0] > 0.0


def motion_lag(track, t, q, of_velocity):
    """(lag s, in how many windows it helps, in how many it hurts, whether it can be believed).

    Looked at are the windows with most change of motion. It is believed where two halves of them find the same, and the
    motion is explained with it.
    """
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
    # Wheels that are off by some per cent would hide a delay.
    scales = [each.scale for each in fits.window_fits(track, t, q, parts, 0.0, of_velocity)]
    if 0.8 < signals.median(scales) < 1.25:
        q = q / signals.median(scales)
    spread = fits.spread_of(fits.window_fits(track, t, q, parts, 0.0, of_velocity))

    def costs(lags):
        return np.array([fits.cost(fits.window_fits(track, t, q, parts, lag, of_velocity), spread) for lag in lags])

    coarse = costs(COARSE)
    rough = COARSE[np.argmin(np.mean(coarse, axis=1))]
    lags = rough + FINE
    fine = costs(lags)
    best = int(np.argmin(np.mean(fine, axis=1)))
    halves = [lags[np.argmin(np.mean(fine[:, begin::2], axis=1))] for begin in (0, 1)]
    advantage = costs([0.0])[0] - fine[best]
    found = fits.window_fits(track, t, q, parts, lags[best], of_velocity)
    left = [np.median(np.abs(each.residuals)) / max(size(q[part], of_velocity), 1e-6)
            for each, part in zip(found, parts)]
    follows = signals.median(left) < FOLLOWS
    within = max(HALVES_AGREE_S, HALVES_AGREE_SHARE * abs(lags[best]))
    agrees = bool(abs(halves[0] - halves[1]) <= within and follows)
    return float(lags[best]), int(np.sum(advantage > MATTERS)), int(np.sum(advantage < -MATTERS)), agrees


def size(q, of_velocity):
    """How much there is to explain: the extent of places, or the size of velocities."""
    return float(np.sqrt(np.mean(np.abs(q if of_velocity else q - np.mean(q)) ** 2)))
