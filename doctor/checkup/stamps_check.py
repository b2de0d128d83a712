"""Stamps of each stream by itself: zero, twice the same, backwards, jumps, gaps, and the clock they are of."""

import numpy as np

from . import signals
from .finding import failed, passed, warned

ZERO_S = 1e-3               # earlier is no stamp
FEW = 0.01                  # share of messages that may be odd without being a habit
GAP_PERIODS = 5.0           # longer than so many periods is a gap ...
LEAST_GAP_S = {"odometry": 0.5, "imu": 0.5, "fix": 10.0, "velocity": 10.0, "satellites": 30.0}  # ... and than this
ODOMETRY_GAP_S = 2.0        # the parameter odometry_gap: after more the place is unknown and the localizer starts anew
GAP_SHARE = 0.05            # of the time: more is no accident
BACK_JUMP_S = 1.0           # the parameter time_jump: a clock that is set back by more starts everything anew
FAR_FUTURE_S = 4.2e9        # s, after 2100
UNIX_S = 1e9                # s, since 2001: smaller is no time of day


def check(evidence):
    """All findings of this family."""
    findings, origin = [], evidence.recording.first_stamp()
    for stream in evidence.recording.streams():
        found = faults_of(stream, origin)
        findings += found or [passed("stamps." + stream.kind, "{}: {} stamps in order, without gaps".format(
            stream.topic, len(stream)))]
    findings += epochs(evidence.recording)
    return findings


def faults_of(stream, origin):
    """What is wrong with the stamps of a stream; empty where nothing is. `origin`: from which times are counted."""
    name, topic, count = "stamps." + stream.kind, stream.topic, len(stream)
    finite = np.isfinite(stream.t)
    zero = int(np.sum(~finite | (stream.t < ZERO_S)))
    if zero > FEW * count:
        return [failed(name, "{}: {} of {} stamps are zero".format(topic, zero, count),
                       "in the driver: message.header.stamp = the time of the measurement", zero=zero)]
    findings = []
    if zero:
        findings.append(warned(name,
                               "{}: {} of {} stamps are zero; such messages are left out".format(topic, zero, count),
                               "in the driver: message.header.stamp = the time of the measurement", zero=zero))
    t = stream.t[finite & (stream.t >= ZERO_S)]
    if len(t) < 2:
        return findings
    findings += disorder(name, topic, t, count)
    findings += gaps(name, stream.kind, topic, t, origin)
    if np.any(t > FAR_FUTURE_S):
        findings.append(failed(name, "{}: stamps of {:.0f} s are no time".format(topic, np.max(t)),
                               "in the driver: seconds, not milli- or nanoseconds"))
    return findings


def disorder(name, topic, t, count):
    """Stamps that come twice, or go back."""
    findings = []
    steps = np.diff(t)
    spans = [(after, before) for before, after in zip(t[:-1], t[1:]) if after < before]
    same, back = int(np.sum(steps == 0.0)), int(np.sum(steps < 0.0))
    jumps = steps[steps < -BACK_JUMP_S]
    if same > FEW * count:
        findings.append(warned(name,
                               "{}: {} of {} stamps are those of the message before: the second is left out".format(
            topic, same, count), "one publisher on the topic, and a stamp for each measurement", repeated=same))
    if len(jumps) > max(3, FEW * count):
        findings.append(failed(name, "{}: stamps jump back {} times, by up to {:.1f} s".format(
            topic, len(jumps), -np.min(jumps)), "one publisher, one clock; not two recordings in one bag",
            back_jumps=len(jumps), spans=spans))
    elif back:
        findings.append(warned(name, "{}: {} stamps go back, by up to {:.2f} s".format(topic, back, -np.min(steps)),
                               "one publisher on the topic; an odd message is left out", back=back, spans=spans))
    return findings


def gaps(name, kind, topic, t, origin):
    """Times without messages."""
    t = np.sort(t)
    steps = np.diff(t)
    usual = signals.median(steps[steps > 0.0])
    if not usual > 0.0:
        return []
    limit = max(GAP_PERIODS * usual, LEAST_GAP_S[kind])
    long = np.flatnonzero(steps > limit)
    if not len(long):
        return []
    worst = long[np.argmax(steps[long])]
    text = "{}: {} gaps of more than {:.2g} s, the longest {:.1f} s at {:.1f} s".format(
        topic, len(long), limit, steps[worst], t[worst] - origin)
    values = dict(gaps=len(long), longest_s=float(steps[worst]), spans=list(zip(t[long], t[long + 1])))
    if kind == "odometry" and steps[worst] > ODOMETRY_GAP_S:
        share = float(np.sum(steps[long]) / max(t[-1] - t[0], 1e-9))
        finding = failed if share > GAP_SHARE else warned
        return [finding(name, text + ": there the place is lost, and the localizer starts anew",
                        "why the odometry stops: driver, network, or a bag recorded on a full disk",
                        "imm_ekf: {{expert: {{stamps: {{odometry_gap: {:.0f}.0}}}}}}  # only if it stood still".format(
                            np.ceil(steps[worst]) + 1), **values)]
    return [warned(name, text, "driver and network of " + topic, **values)]


def epochs(recording):
    """Clocks that count from another time."""
    starts = {stream.topic: signals.median(stream.t[stream.t > ZERO_S]) for stream in recording.streams()
              if np.any(stream.t > ZERO_S)}
    if len(starts) < 2:
        return []
    unix = [topic for topic, start in starts.items() if start > UNIX_S]
    uptime = [topic for topic, start in starts.items() if start <= UNIX_S]
    if unix and uptime:
        return [failed("stamps.epoch", "{} count(s) from another time ({:.0f} s) than {} ({:.0f} s)".format(
            ", ".join(uptime), starts[uptime[0]], ", ".join(unix), starts[unix[0]]),
            "in the driver of {}: ros::Time::now() or UTC, not seconds since its start or of the week".format(
                ", ".join(uptime)))]
    return []
