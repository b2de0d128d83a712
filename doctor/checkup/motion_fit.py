"""Which reading of odometry and IMU explains the receiver best, and how well: units, signs, axes, frames, scale.

Each reading (yaw rate in degrees, reversed, ...) is integrated to a track, and the track is laid over the fixes,
turned, shifted and scaled freely in each window. The reading that leaves least is what the sensors mean.
"""

from collections import namedtuple

import numpy as np

from . import fits, signals

DEGREE = np.pi / 180.0
IN_ODOM_FRAME = "twist in the odometry's frame"
# Another reading is right only where it explains more by this (mean of the logarithm of what is left), surely (mean
# over its standard error), in most windows. On good recordings a wrong reading has gains of -0.1 to -4; see
# docs/doctor.md.
LEAST_GAIN = 0.3
LEAST_SURENESS = 2.5
LEAST_SHARE = 0.7
LEAST_WINDOWS = 4
SLOWEST_VELOCITY_S = 1.1  # between velocities that can be integrated
TURNING_SHARE = 0.3       # of the windows: the others are mostly straight and would say nothing of a yaw rate
LEAST_TURNING, MOST_TURNING = 8, 40  # windows
GOOD_FIT = 0.35           # of the window's extent that is left, for its scale to count

# `left`: what each window leaves, as a share of its extent; `scale` of each; `rotation` of each; `middle` its time.
Reading = namedtuple("Reading", "name source left scale rotation middle")


def useful_windows(track, t, q, covered_t):
    """Windows in which the track and the receiver both move."""
    parts = fits.windows(t, covered_t)
    return [part for part in parts if extent(q[part]) > 1.0 and
            track.way_at(t[part.stop - 1]) - track.way_at(t[part.start]) > 1.0]


def most_turning(track, t, parts):
    """The windows with most turning. Which they are does not depend on the unit or the sign of the yaw rate."""
    turning = [float(np.std(track.yaw_at(t[part]))) for part in parts]
    count = int(np.clip(TURNING_SHARE * len(parts), LEAST_TURNING, MOST_TURNING))
    best = sorted(range(len(parts)), key=lambda k: turning[k], reverse=True)[:count]
    return [parts[k] for k in sorted(best)]


def extent(places):
    """How far places are from their middle, m (rms)."""
    return float(np.sqrt(np.mean(np.abs(places - np.mean(places)) ** 2)))


def read(name, source, track, t, q, parts):
    """How a track fits places in each window."""
    all_fits = fits.window_fits(track, t, q, parts, free_scale=True)
    left = np.array([np.median(np.abs(each.residuals)) / max(extent(q[part]), 1e-6)
                     for each, part in zip(all_fits, parts)])
    return Reading(name, source, left, np.array([each.scale for each in all_fits]),
                   np.array([each.rotation for each in all_fits]), np.array([np.mean(t[part]) for part in parts]))


def read_unturned(name, p, t, q, parts):
    """As read(), of places p whose axes are those of q: without a rotation, which would hide what is to be seen."""
    lefts, scales = [], []
    for part in parts:
        pc, qc, weights = p[part] - np.median(p[part]), q[part] - np.median(q[part]), np.ones(part.stop - part.start)
        for _ in range(fits.ITERATIONS):
            pc = pc - np.sum(weights * pc) / np.sum(weights)
            qc = qc - np.sum(weights * qc) / np.sum(weights)
            power = np.sum(weights * np.abs(pc) ** 2)
            scale = max(float(np.sum(weights * np.real(np.conj(pc) * qc)) / power), 0.0) if power > 0.0 else 0.0
            size = np.abs(qc - scale * pc)
            weights = 1.0 / (1.0 + (size / max(np.median(size), 1e-6)) ** 2)
        lefts.append(np.median(size) / max(extent(q[part]), 1e-6))
        scales.append(scale)
    return Reading(name, "", np.array(lefts), np.array(scales), np.zeros(len(parts)), np.array(
        [np.mean(t[part]) for part in parts]))


def readings_of(evidence):
    """All readings of the motion against the receiver's, the plain ones first; empty where there is nothing to compare.

    The receiver's velocity is taken where it is known to be good, else the fixes.
    """
    if not evidence.tracks or (evidence.fixes is None and not evidence.velocity_is_good):
        return []
    odometry_t, velocity, rate = evidence.motion
    plain = evidence.tracks["odometry"]
    by_velocity = evidence.velocity_is_good and signals.period(evidence.velocities[0]) < SLOWEST_VELOCITY_S
    if not by_velocity and evidence.fixes is None:
        return []
    if by_velocity:
        # Its integral: smoother than fixes, and without their jumps.
        velocity_t, values = evidence.velocities
        t, q = velocity_t, fits.Track(velocity_t, values, np.zeros(len(values))).place
    else:
        t, q = evidence.fixes[:2]
    parts = useful_windows(plain, t, q, odometry_t)
    if by_velocity:
        parts = [part for part in parts if np.max(np.diff(t[part])) < fits.LONGEST_GAP_S]
    if len(parts) < 2:
        return []
    parts = most_turning(evidence.tracks.get("imu", plain), t, parts)

    found = [read("as it is", "odometry", plain, t, q, parts)]
    others = [("in degrees", rate * DEGREE), ("reversed", -rate), ("reversed and in degrees", -rate * DEGREE)]
    found += [read(name, "odometry", fits.Track(odometry_t, velocity, other), t, q, parts) for name, other in others]
    fixed = fits.Track(odometry_t, velocity, np.zeros_like(rate))
    found.append(read(IN_ODOM_FRAME, "odometry", fixed, t, q, parts))
    imu = evidence.imu_rate_at(odometry_t)
    if imu is not None:
        for name, other in (("as it is", imu), ("in degrees", imu * DEGREE), ("reversed", -imu),
                            ("reversed and in degrees", -imu * DEGREE)):
            found.append(read(name, "imu", fits.Track(odometry_t, velocity, other), t, q, parts))
    return found


def gain(one, other):
    """How much better reading `one` explains the receiver than `other`: mean gain, and how sure it is."""
    logs = np.log(np.maximum(other.left, 1e-6) / np.maximum(one.left, 1e-6))
    if len(logs) < LEAST_WINDOWS:
        return 0.0, 0.0
    error = max(float(np.std(logs)), 0.05) / np.sqrt(len(logs))
    return float(np.mean(logs)), float(np.mean(logs)) / error


def clearly_better(one, other):
    """Whether reading `one` explains the receiver clearly better than `other`."""
    size, sureness = gain(one, other)
    return size > LEAST_GAIN and sureness > LEAST_SURENESS and np.mean(one.left < other.left) >= LEAST_SHARE


def best_of(readings):
    """The reading that leaves least; the first of equals."""
    return min(readings, key=lambda reading: np.mean(np.log(np.maximum(reading.left, 1e-6))))
