"""The IMU by itself: what it says that it has, where gravity is, its unit of acceleration."""

import numpy as np

from . import signals
from .evidence import imu_yaw_rate
from .finding import failed, passed, warned

GRAVITY_MPS2 = 9.81
VERTICAL_SHARE = 0.8   # of gravity that must be along z for the axis to be called vertical (37 degrees)
LEAST = 10             # messages


def check(evidence):
    """All findings of this family."""
    imu = evidence.recording.imu
    if imu is None or len(imu) < LEAST:
        return []
    findings = []
    if np.mean(imu.rate_cov == -1.0) > 0.5:
        findings.append(warned("imu.rate", "{}: angular_velocity_covariance[0] is -1: it says that it has no yaw rate, "
                               "and is not used".format(imu.topic), "in the driver: the variance, e.g. 0.0004, or 0"))
    bad = int(np.sum(~np.isfinite(imu.wx + imu.wy + imu.wz)))
    if bad:
        findings.append((failed if bad > 0.01 * len(imu) else warned)(
            "imu.finite", "{}: the yaw rate of {} of {} messages is not finite".format(imu.topic, bad, len(imu)),
            "in the driver: leave a message out rather than NaN"))
    return findings + gravity(evidence, imu)


def gravity(evidence, imu):
    """Where the accelerometer feels the ground to be."""
    force = np.array([signals.median(imu.ax), signals.median(imu.ay), signals.median(imu.az)])
    size = float(np.linalg.norm(force))
    if not np.isfinite(size) or size < 0.5:
        return []
    findings = []
    if 0.8 < size < 1.2:
        findings.append(warned("imu.acceleration",
                               "{}: gravity is {:.2f}: in g in place of m/s^2".format(imu.topic, size),
                               "in the driver: m/s^2; localizers do not use it"))
    _, oriented = imu_yaw_rate(imu)
    along = force / size
    axis = "xyz"[int(np.argmax(np.abs(along)))]
    values = dict(up=[round(float(value), 3) for value in along])
    frame = imu.frame().lstrip("/")
    turned = frame and (evidence.setup.base_link_frame == frame or evidence.recording.transforms.connected(
        evidence.setup.base_link_frame, frame))
    if along[2] > VERTICAL_SHARE:
        return findings + [passed("imu.axes", "{}: z points up".format(imu.topic), **values)]
    if np.mean(oriented) > 0.9:
        return findings + [passed("imu.axes", "{}: {} is vertical, not z up; its orientation says so".format(
            imu.topic, axis), **values)]
    if along[2] < -VERTICAL_SHARE:
        what = "z points down: NED axes or upside down"
    else:
        sign = "-" if along["xyz".index(axis)] < 0 else "+"
        what = "the z axis is not vertical: gravity is along {}{}".format(sign, axis)
    mounted = evidence.imu_mounting()
    if turned and mounted and not is_level(mounted):
        return findings + [passed("imu.axes", "{}: {}; tf from {} says so".format(
            imu.topic, what, evidence.setup.base_link_frame), **values)]
    return findings + [failed("imu.axes", "{}: {}, and neither its orientation nor tf says so".format(imu.topic, what),
                              "in the driver: axes of REP-103 (x forward, y left, z up)",
                              "or tf {} -> {} as it is mounted".format(
                                  evidence.setup.base_link_frame, frame or "imu_link"),
                              "localization.launch use_imu:=false  # until then", **values)]


def is_level(pose):
    """Whether a mounting leaves the z axis up."""
    _, _, _, x, y, _, _ = pose
    return 1.0 - 2.0 * (x * x + y * y) > VERTICAL_SHARE
