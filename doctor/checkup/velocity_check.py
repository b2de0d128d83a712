"""The receiver's velocity against its own fixes: east and north, in m/s, not in the robot's frame."""

import numpy as np

from . import fits, motion_fit, signals
from .evidence import LEAST_WAY_M
from .finding import failed, passed, warned
from .units import SPEED_UNITS, name_of

LEAST_WINDOWS = 4
CONCENTRATED = 0.8         # length of the mean direction of the windows' rotations
GOOD_LEFT = 0.5            # of the extent that is left, at the most, for the fixes to say anything
GAIN, SURE = 0.4, 2.5      # of another reading, as in motion_fit
BODY_SHARE = 0.06          # of the speed that is to the side, at the most, in the robot's own frame
FORWARD_SHARE = 0.85       # of the velocities that point forward, in the robot's own frame
SCALE_WITHIN = 0.2
NED = "x is north and y is east (NED), a mirror image"


def check(evidence):
    """All findings of this family."""
    velocity = evidence.recording.velocity
    if velocity is None or len(velocity) < fits.LEAST_POINTS or evidence.velocities is None:
        return []
    findings = not_finite(velocity) + still(evidence) + directions(evidence) + declared(velocity)
    if any(finding.level == "FAIL" and finding.check in ("velocity.frame", "velocity.zero") for finding in findings):
        evidence.velocities = None  # the other checks do without
    return findings


def not_finite(velocity):
    """Messages with NaN or infinity."""
    bad = int(np.sum(~np.isfinite(velocity.vx + velocity.vy)))
    if not bad:
        return []
    return [warned("velocity.finite", "{}: {} of {} velocities are not finite and left out".format(
        velocity.topic, bad, len(velocity)), "nothing, if they are those without a fix", count=bad)]


def still(evidence):
    """A velocity that is always zero."""
    _, values = evidence.velocities
    if np.max(np.abs(values)) > 1e-6:
        return []
    topic = evidence.recording.velocity.topic
    if evidence.odometry_way() > LEAST_WAY_M:
        return [failed("velocity.zero", "{}: always zero, though the robot drives".format(topic),
                       "velocity_topic:= of the receiver's Doppler velocity; leave it out rather")]
    return [warned("velocity.zero", "{}: always zero".format(topic), "drive some metres")]


def integrated(t, velocity):
    """The velocity as a track, whose frame is that of the velocity."""
    return fits.Track(t, velocity, np.zeros(len(t)))


def directions(evidence):
    """Where the fixes go, seen from where the velocity points."""
    name, topic = "velocity.frame", evidence.recording.velocity.topic
    if evidence.fixes is None:
        return []
    vt, velocity = evidence.velocities
    usual = np.percentile(np.abs(velocity), 95)
    keep = np.abs(velocity) <= 3.0 * usual + 1.0
    vt, velocity = vt[keep], velocity[keep]
    t, q, _ = evidence.fixes
    track = integrated(vt, velocity)
    parts = [part for part in motion_fit.useful_windows(track, t, q, vt)
             if motion_fit.extent(q[part]) > 0.25 * LEAST_WAY_M]
    if len(parts) < LEAST_WINDOWS:
        return [passed(name, "{}: too little driving to compare it with the fixes".format(topic))]
    place = track.place_at(t)
    plain = motion_fit.read_unturned("as it is", place, t, q, parts)
    free = motion_fit.read("turned", "", track, t, q, parts)
    wrong = [motion_fit.read_unturned(what, factor * (np.conj(place) if what == NED else place), t, q, parts)
             for what, factor in ((NED, 1j), ("reversed", -1.0), ("turned by 90 degrees", 1j),
                                  ("turned by -90 degrees", -1j))]
    other = motion_fit.best_of(wrong)
    body = body_reading(evidence, vt, velocity, t, q, parts)
    values = dict(left=signals.median(plain.left))
    if body is not None and better(body, plain) and not better(other, body):
        return [failed(name, "{}: it is in the robot's own frame (x forward), not east and north: {:.0f} % of it is to "
                       "the side, and the fixes go elsewhere".format(topic, 100.0 * side_share(velocity)),
                       "localization.launch velocity_topic:= of a velocity in east and north (ENU)",
                       side_share=side_share(velocity), **values)]
    if better(other, plain):
        return [failed(name, "{}: {} against where the fixes go".format(topic, other.name),
                       "localization.launch velocity_topic:= of a velocity with x east and y north (ENU)", **values)]
    if better(free, plain) and signals.median(plain.left) > GOOD_LEFT:
        return turned(name, topic, free, values)
    if values["left"] > GOOD_LEFT:
        return [passed(name, "{}: the fixes are too rough to compare it with".format(topic), **values)]
    evidence.velocity_is_good = True
    east_north = passed(name, "{}: east and north, as the fixes move".format(topic), **values)
    return [east_north] + units(evidence, topic, plain)


def better(one, other):
    """Whether one reading explains the fixes clearly better."""
    gain, sureness = motion_fit.gain(one, other)
    return gain > GAIN and sureness > SURE


def side_share(velocity):
    """Median of the part to the side (y) in the speed."""
    speed = np.abs(velocity)
    moving = speed > max(0.3, 0.2 * np.percentile(speed, 90))
    return signals.median(np.abs(velocity.imag[moving]) / speed[moving]) if moving.any() else 1.0


def body_reading(evidence, vt, velocity, t, q, parts):
    """The velocity turned by the robot's heading, as it must be if it is in the robot's frame; None if it cannot be."""
    track = evidence.track()
    if side_share(velocity) > BODY_SHARE or np.mean(velocity.real >= -0.1) < FORWARD_SHARE or track is None:
        return None
    turned_velocity = velocity * np.exp(1j * track.yaw_at(vt))
    return motion_fit.read("robot's frame", "velocity", integrated(vt, turned_velocity), t, q, parts)


def turned(name, topic, free, values):
    """Another angle between the velocity and the way of the fixes."""
    good = free.left < GOOD_LEFT
    mean = np.mean(np.exp(1j * free.rotation[good])) if good.any() else 0.0
    angle = float(np.angle(mean))
    values = dict(values, angle_rad=angle, concentration=float(abs(mean)))
    if abs(mean) < CONCENTRATED:
        return [warned(name, "{}: fixes move in other directions than it says, each time another".format(topic),
                       "is it in the robot's frame, or smoothed? velocity_topic:= of one in east and north", **values)]
    return [failed(name, "{}: turned by {:.0f} degrees against where the fixes go".format(topic, np.degrees(angle)),
                   "velocity_topic:= of a velocity with x east and y north, not in the frame of odometry or robot",
                   **values)]


def units(evidence, topic, plain):
    """Its size by the fixes."""
    good = plain.left < 0.3
    if np.sum(good) < LEAST_WINDOWS:
        return []
    factor = 1.0 / signals.median(plain.scale[good])
    error = signals.robust_sigma(plain.scale[good]) / np.sqrt(np.sum(good))
    unit = name_of(factor, SPEED_UNITS[:10])
    values = dict(velocity_over_fixes=factor)
    if abs(np.log(factor)) > max(np.log(1.0 + SCALE_WITHIN), 3.0 * error):
        evidence.velocities = (evidence.velocities[0], evidence.velocities[1] / factor)  # for the other checks
        return [(failed if unit else warned)("velocity.speed", "{}: {:.3g} times as fast as the fixes move{}".format(
            topic, factor, ": " + unit if unit else ""), "in the driver: m/s", **values)]
    return [passed("velocity.speed", "{}: {:.3f} times as fast as the fixes move".format(topic, factor), **values)]


def declared(velocity):
    """Its covariance."""
    covariance = velocity.cov_xx[np.isfinite(velocity.cov_xx)]
    if len(covariance) and np.all(covariance <= 0.0):
        return [warned("velocity.covariance", "{}: declares no covariance; 0.3 m/s is taken".format(velocity.topic),
                       "imm_ekf: {expert: {velocity: {velocity_sigma_default: 0.3}}}  # what it has, if you know")]
    return []
