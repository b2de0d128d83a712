"""The odometry by itself: does its pose move as its twist says, in the robot's frame and in the usual units."""

import numpy as np

from . import signals
from .evidence import LEAST_WAY_M, stamps
from .finding import failed, passed, warned
from .units import SPEED_UNITS, name_of, rate_name_of

STEP_S = 0.5           # over which pose and twist are compared: long enough for odometry of 100 Hz with rounded poses
MOVING_MPS = 0.1
TURNING_RAD_S = 0.05
LEAST_SAMPLES = 10
SAME_WITHIN = 0.15     # factor between pose and twist that no unit explains; filters of drivers smooth one of them
CONCENTRATED = 0.9     # length of the mean direction
REVERSE_SHARE = 0.9    # of the way: who drives backwards so much has a wrong sign
SIDEWAYS_MPS, SIDEWAYS_SHARE = 0.1, 0.05
SPINS_RAD = 1.0        # in a step: no way to compare ways any more


def check(evidence):
    """All findings of this family."""
    odometry = evidence.recording.odometry
    if odometry is None or len(odometry) < LEAST_SAMPLES or evidence.motion is None:
        return []
    findings = not_finite(odometry)
    steps = pose_steps(odometry)
    findings += pose_and_twist(odometry, steps)
    evidence.twist_is_wrong = any("frame" in each.text for each in findings if each.level == "FAIL")
    findings += direction(evidence, odometry)
    findings += sideways(evidence, odometry)
    findings += declared(odometry)
    return findings


def not_finite(odometry):
    """Messages with NaN or infinity in the twist."""
    bad = int(np.sum(~np.isfinite(odometry.vx + odometry.vy + odometry.wz)))
    if not bad:
        return []
    return [(failed if bad > 0.01 * len(odometry) else warned)(
        "odometry.finite",
        "{}: the twist of {} of {} messages is not finite".format(odometry.topic, bad, len(odometry)),
        "in the driver: no NaN; leave a message out rather", count=bad)]


class Steps:
    """Pose and twist over steps of STEP_S: means of the same times."""

    def __init__(self, velocity, world_velocity, rate, pose_velocity, pose_rate, yaw_known):
        self.velocity, self.world_velocity, self.rate = velocity, world_velocity, rate  # of the twist
        self.pose_velocity, self.pose_rate = pose_velocity, pose_rate                   # of the pose, in its frame
        self.yaw_known = yaw_known


def pose_steps(odometry):
    """Steps; None where there are too few poses."""
    yaw_known = bool(np.mean(odometry.quaternion_norm > 0.5) > 0.9)
    yaw = odometry.yaw if yaw_known else np.zeros(len(odometry))
    t, x, y, yaw, vx, vy, wz = signals.in_order(stamps(odometry), odometry.x, odometry.y, yaw, odometry.vx, odometry.vy,
                                                odometry.wz)
    if len(t) < LEAST_SAMPLES:
        return None
    size = max(1, int(round(STEP_S / signals.period(t))))
    dt = t[size:] - t[:-size]
    good = (dt > 0.0) & (dt < 4.0 * max(STEP_S, signals.period(t)))
    yaw = np.unwrap(yaw)

    def means(rate):
        # A value holds since the message before it.
        integral = np.cumsum(rate * np.diff(t, prepend=t[0]))
        return ((integral[size:] - integral[:-size]) / dt)[good]

    place = x + 1j * y
    velocity = vx + 1j * vy
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    middle = np.concatenate([[yaw[0]], middle])
    pose_velocity = ((place[size:] - place[:-size]) / dt)[good]
    pose_rate = ((yaw[size:] - yaw[:-size]) / dt)[good]
    return Steps(means(velocity), means(velocity * np.exp(1j * middle)), means(wz), pose_velocity, pose_rate, yaw_known)


def pose_and_twist(odometry, steps):
    """Whether pose and twist tell the same motion."""
    if steps is None:
        return []
    name, topic = "odometry.pose_and_twist", odometry.topic
    speed, pose_speed = np.abs(steps.velocity), np.abs(steps.pose_velocity)
    moves, pose_moves = speed > MOVING_MPS, pose_speed > MOVING_MPS
    turns, pose_turns = np.abs(steps.rate) > TURNING_RAD_S, np.abs(steps.pose_rate) > TURNING_RAD_S
    if np.sum(pose_moves) >= LEAST_SAMPLES and np.max(speed) < 1e-6 and np.max(np.abs(steps.rate)) < 1e-6:
        return [failed(name, "{}: the twist is zero, though the pose moves: pose only".format(topic),
                       "in the driver: twist.linear.x and twist.angular.z of the wheels")]
    if np.sum(pose_moves) >= LEAST_SAMPLES and np.max(speed) < 1e-6:
        return [failed(name, "{}: the twist's speed is zero, though the pose moves at up to {:.1f} m/s".format(
            topic, np.percentile(pose_speed, 98)), "in the driver: twist.linear.x of the wheels")]
    if np.sum(moves) >= LEAST_SAMPLES and np.max(pose_speed) < 1e-6:
        return [warned(name, "{}: the pose stays where it is, though the twist moves: twist only; tf is then of no "
                       "use".format(topic), "in the driver: integrate the pose, and broadcast odom -> base_link")]
    findings = []
    both = moves & pose_moves & (np.maximum(np.abs(steps.pose_rate), np.abs(steps.rate)) * STEP_S < SPINS_RAD)
    if np.sum(both) >= LEAST_SAMPLES:
        findings += speeds(name, topic, steps, both)
    turning = turns & pose_turns if np.sum(turns & pose_turns) >= LEAST_SAMPLES else None
    if turning is not None and steps.yaw_known:
        findings += rates(name, topic, steps, turning)
    elif steps.yaw_known and np.sum(pose_turns) >= 2 * LEAST_SAMPLES and np.max(np.abs(steps.rate)) < 1e-6:
        findings.append(failed(name, "{}: the twist's yaw rate is zero, though the pose turns".format(topic),
                               "in the driver: twist.angular.z"))
    if findings or np.sum(both) < LEAST_SAMPLES:
        return findings
    return [passed(name, "{}: pose and twist tell the same motion".format(topic))]


def speeds(name, topic, steps, both):
    """Speed and direction of the twist against the pose's."""
    findings = []
    pose, twist = steps.pose_velocity[both], steps.velocity[both]
    ratio = signals.median(np.abs(twist) / np.abs(pose))
    unit = name_of(ratio, SPEED_UNITS)
    values = dict(speed_ratio=ratio)
    if unit or abs(np.log(ratio)) > np.log(1.0 + SAME_WITHIN):
        finding = failed if unit or abs(np.log(ratio)) > np.log(1.3) else warned
        findings.append(finding(name, "{}: the twist's speed is {:.3g} times the pose's{}".format(
            topic, ratio, ": " + unit if unit else ""), "in the driver: twist.linear.x in m/s", **values))
    if not steps.yaw_known:
        return findings
    # The direction of the motion: with the robot's heading (right), or without (a twist in the odometry's frame).
    in_body = pose * np.conj(steps.world_velocity[both])
    in_odom = pose * np.conj(twist)
    body, odom = (np.mean(each / np.maximum(np.abs(each), 1e-9)) for each in (in_body, in_odom))
    values = dict(body=abs(body), odom=abs(odom))
    if abs(body) > CONCENTRATED and abs(np.angle(body)) > 2.6:
        findings.append(failed(name, "{}: the twist's speed has the reversed sign of the pose's motion".format(topic),
                               "in the driver: twist.linear.x positive forward", **values))
    elif abs(odom) > CONCENTRATED and abs(np.angle(odom)) < 0.3 and np.real(body) < 0.85 * np.real(odom):
        findings.append(failed(name, "{}: the twist is in the odometry's frame (header.frame_id), not in the robot's "
                               "(child_frame_id)".format(topic),
                               "in the driver: turn the twist by minus the pose's yaw, so that linear.x is forward",
                               **values))
    elif np.real(body) < 0.7:
        findings.append(warned(name,
                               "{}: the pose does not move where heading and twist point (mean cosine {:.2f})".format(
            topic, np.real(body)), "in the driver: twist in the robot's frame, x forward; yaw of the pose", **values))
    return findings


def rates(name, topic, steps, turning):
    """Yaw rate of the twist against the pose's."""
    ratio = signals.median(steps.rate[turning] / steps.pose_rate[turning])
    agree = np.mean(np.sign(steps.rate[turning]) == np.sign(steps.pose_rate[turning]))
    unit = rate_name_of(abs(ratio))
    values = dict(rate_ratio=ratio)
    if ratio < 0.0 and agree < 0.2:
        return [failed(name, "{}: the twist's yaw rate has the reversed sign of the pose's{}".format(
            topic, ", and is {:.3g} times it".format(-ratio) if unit else ""),
            "in the driver: twist.angular.z positive to the left", **values)]
    if unit or abs(np.log(max(abs(ratio), 1e-6))) > np.log(1.0 + SAME_WITHIN):
        finding = failed if unit or abs(np.log(max(abs(ratio), 1e-6))) > np.log(1.5) else warned
        return [finding(name, "{}: the twist's yaw rate is {:.3g} times the pose's{}".format(
            topic, ratio, ": " + unit if unit else ""), "in the driver: twist.angular.z in rad/s", **values)]
    return []


def direction(evidence, odometry):
    """A robot that drives backwards all the time."""
    t, velocity, _ = evidence.motion
    dt = np.minimum(np.diff(t, prepend=t[0]), 1.0)
    forward, way = velocity.real * dt, float(np.sum(np.abs(velocity) * dt))
    if way < LEAST_WAY_M:
        return []
    share = float(-np.sum(forward[forward < 0.0]) / max(np.sum(np.abs(forward)), 1e-9))
    values = dict(reverse_share=share)
    straight = np.sum(np.abs(forward)) > 0.5 * way
    if share > REVERSE_SHARE and straight:
        return [failed("odometry.direction",
                       "{}: {:.0f} % of the way is backwards: the speed's sign is reversed".format(
            odometry.topic, 100.0 * share), "in the driver: twist.linear.x positive forward", **values)]
    return [passed("odometry.direction", "{}: {:.0f} m forward, {:.0f} m backwards".format(
        odometry.topic, np.sum(forward[forward > 0.0]), np.sum(-forward[forward < 0.0])), **values)]


def sideways(evidence, odometry):
    """A speed to the side: a holonomic base, or another frame."""
    _, velocity, _ = evidence.motion
    share = float(np.mean(np.abs(velocity.imag) > SIDEWAYS_MPS))
    if share < SIDEWAYS_SHARE:
        return []
    return [warned("odometry.sideways", "{}: linear.y is more than {} m/s in {:.0f} % of the messages: a holonomic "
                   "base, or a twist that is not in the robot's frame".format(odometry.topic, SIDEWAYS_MPS,
                                                                              100.0 * share),
                   "localization.launch robot:=holonomic", "or in the driver: twist in child_frame_id", share=share)]


def declared(odometry):
    """The covariance of the twist."""
    if np.all(odometry.twist_cov_x == -1.0):
        return [warned("odometry.covariance", "{}: the twist's covariance is -1: it says that it has no twist".format(
            odometry.topic), "in the driver: the variance of twist.linear.x, e.g. 0.01")]
    return []
