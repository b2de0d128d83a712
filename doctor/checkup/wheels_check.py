"""The wheels against the receiver: unit and scale of the speed, dead encoders, slip, a speed without its sign."""

import numpy as np

from . import fits, motion_fit, signals
from .evidence import LEAST_WAY_M
from .finding import failed, passed, warned
from .units import SPEED_UNITS, name_of

SCALE_WARN, SCALE_FAIL = 0.03, 0.25   # wheels of good recordings are off by up to 8 %
GOOD_FIT = 0.3             # of a window's extent that is left, for its scale to count
LEAST_SCALES = 3
SURE = 3.0                 # standard errors
MOVING_MPS = 0.7           # of the receiver's velocity: noise and reflections give less at rest
DEAD_SHARE = 0.1           # of the receiver's speed: the wheels stand
DEAD_S = 3.0               # for so long at a stretch
FIX_SPAN_S = 8.0           # between fixes of which a velocity is made
WARN_S, WARN_SHARE = 5.0, 0.01   # in all; poor receivers jump while the robot stands, up to 0.8 % of the time
FAIL_S, FAIL_SHARE = 10.0, 0.05
BACK_RAD = 2.4             # between motion and heading: backwards
BACK_S = 3.0
BIAS_RAD_S = 0.01


def check(evidence):
    """All findings of this family."""
    if evidence.motion is None:
        return []
    return speed(evidence) + dead(evidence) + unsigned(evidence) + drift(evidence)


def scales_by_fixes(evidence):
    """Receiver's way over the odometry's, in windows where the fixes follow the track: values."""
    track = evidence.track()
    if evidence.fixes is None or track is None:
        return np.empty(0)
    t, q, _ = evidence.fixes
    parts = [part for part in motion_fit.useful_windows(track, t, q, track.t)
             if motion_fit.extent(q[part]) > 0.25 * LEAST_WAY_M]
    if not parts:
        return np.empty(0)
    reading = motion_fit.read("", "", track, t, q, parts)
    good = reading.left < GOOD_FIT
    if np.sum(good) >= 8:  # the better half: straight, and with few reflections
        good &= reading.left <= signals.median(reading.left)
    return reading.scale[good]


def scales_by_velocity(evidence):
    """Receiver's speed over the odometry's, in stretches of 5 s in which both move."""
    if evidence.velocities is None:
        return np.empty(0)
    t, velocity = evidence.velocities
    odometry_t, own, _ = evidence.motion
    begin, end = max(t[0], odometry_t[0]), min(t[-1], odometry_t[-1])
    grid = np.arange(begin, end, 5.0)
    if len(grid) < 2:
        return np.empty(0)
    receiver, first = signals.resample(t, np.abs(velocity), grid, 5.0)
    wheels, second = signals.resample(odometry_t, np.abs(own), grid, 5.0)
    moving = first & second & (receiver > MOVING_MPS)
    moving &= wheels > 0.3 * np.percentile(wheels[moving], 90) if moving.any() else False
    moving &= wheels > 1e-3
    return receiver[moving] / wheels[moving]


def speed(evidence):
    """Unit and scale of the odometry's speed."""
    found = {"the fixes": scales_by_fixes(evidence), "the receiver's velocity": scales_by_velocity(evidence)}
    found = {name: values for name, values in found.items() if len(values) >= LEAST_SCALES}
    if not found:
        return []
    topic = evidence.recording.odometry.topic
    factors = {name: 1.0 / signals.median(values) for name, values in found.items()}
    errors = {name: signals.robust_sigma(values) / np.sqrt(len(values)) + 0.003 for name, values in found.items()}
    # Fixes are places, and cannot have a wrong unit: theirs is the word where the two differ by far.
    by = min(found, key=lambda name: errors[name])
    if len(found) == 2 and abs(np.log(factors["the fixes"] / factors["the receiver's velocity"])) > np.log(1.2):
        by = "the fixes"
    factor, error = factors[by], errors[by]
    values = dict(speed_over_receiver=factor, sigma=error, by=by)
    text = "{}: the speed is {:.3f} times that of {} (+- {:.3f})".format(topic, factor, by, error * factor)
    unit = name_of(factor, SPEED_UNITS)
    sure = abs(np.log(factor)) > SURE * error
    spread = signals.robust_sigma(np.log(np.maximum(found[by], 1e-9)))
    if sure and abs(np.log(factor)) > np.log(1.0 + SCALE_FAIL) and spread < 0.5:
        finding = failed if len(found[by]) >= 2 * LEAST_SCALES or unit else warned
        return [finding("odometry.speed", text + (": " + unit if unit else ": unit or counts per turn"),
                        "in the driver: twist.linear.x in m/s; the base's wheel_radius * {:.3f}".format(1.0 / factor),
                        **values)]
    if sure and abs(factor - 1.0) > SCALE_WARN and spread < 0.5:
        return [warned("odometry.speed", text + ": the wheels' circumference; it is learnt",
                       "the base's parameter wheel_radius (or its multiplier) * {:.3f}".format(1.0 / factor),
                       **values)]
    return [passed("odometry.speed", text, **values)]


def runs(t, mask, least_s):
    """(begin, end) of the stretches of at least `least_s` in which the mask holds at every sample."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    found = []
    for begin, end in zip(edges[::2], edges[1::2]):
        if end - begin >= 3 and t[end - 1] - t[begin] >= least_s:
            found.append((float(t[begin]), float(t[end - 1])))
    return found


def receiver_motion(evidence):
    """(times, velocities of the receiver, least speed that is no noise): its own, or from fixes far enough apart."""
    if evidence.velocities is not None:
        t, velocity = evidence.velocities
        return t, velocity, MOVING_MPS
    if evidence.fixes is None:
        return None
    t, q, sigma = evidence.fixes
    span = max(FIX_SPAN_S, 3.0 * signals.period(t))
    grid = np.arange(t[0] + span, t[-1] - span, 0.5 * span)
    if len(grid) < 4:
        return None
    covered = signals.gaps_mask(t, grid - 0.5 * span, span) & signals.gaps_mask(t, grid + 0.5 * span, span)
    places = [np.interp(grid + half, t, q.real) + 1j * np.interp(grid + half, t, q.imag)
              for half in (-0.5 * span, 0.5 * span)]
    jitter = signals.median(np.abs(np.diff(q, 2))) if len(q) > 3 else 0.0
    noise = max(jitter, 0.5 * signals.median(sigma) if np.isfinite(sigma).any() else 0.0, 0.5)
    velocity = (places[1] - places[0]) / span
    return grid[covered], velocity[covered], max(MOVING_MPS, 4.0 * noise / span)


def dead(evidence):
    """Wheels that stand while the receiver moves, and the other way round."""
    found = receiver_motion(evidence)
    if found is None:
        return []
    t, velocity, least = found
    odometry_t, own, _ = evidence.motion
    inside = signals.gaps_mask(odometry_t, t, 2.0) if len(odometry_t) > 1 else np.zeros(len(t), bool)
    t, velocity = t[inside], velocity[inside]
    if len(t) < 4:
        return []
    # The faster of some seconds: the receiver's velocity may come late.
    wheels = np.max([np.abs(np.interp(t + shift, odometry_t, np.abs(own))) for shift in (-2.0, -1.0, 0.0, 1.0)], axis=0)
    speed_of = np.abs(velocity)
    believable = speed_of < 3.0 * np.percentile(speed_of, 95)
    standing = runs(t, believable & (speed_of > least) & (wheels < DEAD_SHARE * speed_of), DEAD_S)
    total = sum(end - begin for begin, end in standing)
    moving = float(np.sum(speed_of > least)) * signals.period(t)
    topic = evidence.recording.odometry.topic
    if total > max(WARN_S, WARN_SHARE * moving):
        text = "{}: the wheels stand for {:.0f} s while the receiver moves (from {:.0f} s on): a dead encoder, " \
            "slipping wheels, or reflections".format(topic, total, standing[0][0] - evidence.recording.first_stamp())
        enough = max(FAIL_S, FAIL_SHARE * moving) * (1.0 if evidence.velocities is not None else 2.0)
        finding = failed if total > enough else warned
        return [finding("odometry.wheels", text, "encoder and cable; {} takes the receiver's speed meanwhile, where it "
                        "has one (velocity_topic:=)".format(evidence.setup.section), standing_s=total, spans=standing)]
    if evidence.velocities is None:
        return [passed("odometry.wheels", "{}: the wheels turn where the fixes move".format(topic))]
    spinning = runs(t, (np.interp(t, odometry_t, np.abs(own)) > 2.0 * MOVING_MPS)
                    & (speed_of < DEAD_SHARE * np.interp(t, odometry_t, np.abs(own))), DEAD_S)
    total = sum(end - begin for begin, end in spinning)
    if total > max(WARN_S, WARN_SHARE * moving):
        return [warned("odometry.wheels", "{}: the wheels turn for {:.0f} s while the receiver stands (from {:.0f} s "
                       "on): slipping wheels, or a receiver that holds its place".format(
                           topic, total, spinning[0][0] - evidence.recording.first_stamp()),
                       "the receiver's static hold off; else wheels with more grip", spinning_s=total, spans=spinning)]
    return [passed("odometry.wheels", "{}: the wheels turn where the receiver moves".format(topic))]


def unsigned(evidence):
    """A speed that stays positive where the robot drives backwards."""
    found, track = receiver_motion(evidence), evidence.track()
    if found is None or track is None:
        return []
    t, velocity, least = found
    own = track.velocity_at(t)
    moving = (np.abs(velocity) > least) & (np.abs(own) > 0.5 * least) & (t > track.t[0]) & (t < track.t[-1])
    t, velocity, own = t[moving], velocity[moving], own[moving]
    if len(t) < 10:
        return []
    angle = velocity * np.conj(own)
    angle = angle / np.abs(angle)
    # The heading of the track, by all that is within a minute: a few seconds of reversing do not rule it.
    usual = np.array([np.sum(angle[max(0, k - 60):k + 61]) for k in range(len(t))])
    off = np.abs(np.angle(angle * np.conj(usual)))
    stretches = [(begin, end) for begin, end in runs(t, off > BACK_RAD, BACK_S) if end - begin < 0.3 * (t[-1] - t[0])]
    total = sum(end - begin for begin, end in stretches)
    if total <= 0.0:
        return []
    return [warned("odometry.unsigned", "{}: for {:.1f} s (from {:.0f} s on) the receiver moves against the heading: a "
                   "speed without sign while reversing, or reflections".format(
                       evidence.recording.odometry.topic, total, stretches[0][0] - evidence.recording.first_stamp()),
                   "in the driver: twist.linear.x negative when reversing", backwards_s=total, spans=stretches)]


def drift(evidence):
    """Bias of the yaw rates by the heading that fixes ask for over the drive."""
    if evidence.fixes is None:
        return []
    t, q, _ = evidence.fixes
    findings = []
    for source, track in sorted(evidence.tracks.items()):
        parts = [part for part in motion_fit.useful_windows(track, t, q, track.t)
                 if motion_fit.extent(q[part]) > 0.25 * LEAST_WAY_M]
        all_fits = fits.window_fits(track, t, q, parts)
        left = np.array([signals.median(np.abs(each.residuals)) / max(motion_fit.extent(q[part]), 1e-6)
                         for each, part in zip(all_fits, parts)])
        good = np.flatnonzero(left < GOOD_FIT) if len(left) else []
        if len(good) < 6:
            continue
        middle = np.array([np.mean(t[parts[k]]) for k in good])
        steps = signals.wrap(np.diff([all_fits[k].rotation for k in good])) / np.diff(middle)
        near = np.diff(middle) < 3.0 * fits.WINDOW_S
        if np.sum(near) < 6:
            continue
        # The track turns by its bias; the rotation that fits takes it back.
        value, error = -signals.median(steps[near]), signals.robust_sigma(steps[near]) / np.sqrt(np.sum(near))
        topic = (evidence.recording.odometry if source == "odometry" else evidence.recording.imu).topic
        name = "{}.yaw_rate_bias".format(source)
        text = "{}: bias of the yaw rate {:+.4f} +- {:.4f} rad/s, by the fixes".format(topic, value, error)
        values = dict(bias_rad_s=value, sigma=error)
        if abs(value) > BIAS_RAD_S and abs(value) > SURE * error:
            findings.append(warned(name, text, "calibrate the gyroscope at rest" if source == "imu" else
                                   "wheels of the same size, or an IMU on imu_topic:=; the filter learns it", **values))
        else:
            findings.append(passed(name, text, **values))
    return findings
