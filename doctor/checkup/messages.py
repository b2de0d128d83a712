"""Rows of the streams out of ROS messages, by the names of their fields: no message package is imported."""

import math

import numpy as np

from .recording import STRONG_DBHZ

LEAST_RANGES = 5       # one more than unknowns
MOST_CONDITION = 1e6   # of the normal matrix: beyond it there is no fix
UNKNOWN_DILUTION = (float("nan"), float("nan"))


def seconds(stamp):
    """A ROS time in s."""
    return stamp.secs + 1e-9 * stamp.nsecs


def yaw_of(q):
    """The heading of a quaternion, rad; NaN where it is none."""
    if not q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w > 0.0:
        return float("nan")
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def odometry(message, received):
    """nav_msgs/Odometry."""
    pose, twist = message.pose.pose, message.twist.twist
    q = pose.orientation
    norm = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
    return (seconds(message.header.stamp), received, pose.position.x, pose.position.y, yaw_of(q), norm,
            twist.linear.x, twist.linear.y, twist.angular.z, message.pose.covariance[0], message.pose.covariance[35],
            message.twist.covariance[0], message.twist.covariance[35])


def fix(message, received):
    """sensor_msgs/NavSatFix."""
    cov = message.position_covariance
    return (seconds(message.header.stamp), received, message.latitude, message.longitude, message.altitude,
            message.status.status, cov[0], cov[1], cov[4], cov[8], message.position_covariance_type)


def velocity(message, received):
    """geometry_msgs/TwistWithCovarianceStamped or TwistStamped."""
    has_covariance = hasattr(message.twist, "covariance")
    linear = message.twist.twist.linear if has_covariance else message.twist.linear
    cov = (message.twist.covariance[0], message.twist.covariance[7]) if has_covariance else (0.0, 0.0)
    return (seconds(message.header.stamp), received, linear.x, linear.y, linear.z) + cov


def imu(message, received):
    """sensor_msgs/Imu."""
    w, a, q = message.angular_velocity, message.linear_acceleration, message.orientation
    return (seconds(message.header.stamp), received, w.x, w.y, w.z, a.x, a.y, a.z, q.x, q.y, q.z, q.w,
            message.orientation_covariance[0], message.angular_velocity_covariance[0])


def satellites(message, received):
    """urban_gnss_localization/SatelliteArray."""
    all_of = message.satellites
    return (seconds(message.header.stamp), received, len(all_of), sum(1 for each in all_of if each.cn0 > 0.0),
            sum(1 for each in all_of if each.cn0 >= STRONG_DBHZ),
            sum(1 for each in all_of if math.isfinite(each.azimuth) and math.isfinite(each.elevation)),
            sum(1 for each in all_of if math.isfinite(each.pseudorange_residual))) + dilution(all_of)


def dilution(all_of):
    """Squared dilution of precision, east and north, of the satellites in the fix as far as that is known; else NaN."""
    known = [each for each in all_of if math.isfinite(each.azimuth) and math.isfinite(each.elevation)
             and each.cn0 > 0.0]
    for chosen in ([each for each in known if math.isfinite(each.pseudorange_residual)],
                   [each for each in known if each.used == 1], known):
        if len(chosen) >= LEAST_RANGES:
            break
    else:
        return UNKNOWN_DILUTION
    azimuth, elevation = (np.array([getattr(each, name) for each in chosen]) for name in ("azimuth", "elevation"))
    level = np.cos(elevation)
    design = np.column_stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation),
                              np.ones(len(chosen))])
    normal = design.T @ design
    if np.linalg.cond(normal) > MOST_CONDITION:
        return UNKNOWN_DILUTION
    inverse = np.linalg.inv(normal)
    return float(inverse[0, 0]), float(inverse[1, 1])


def nav_sat(message, received):
    """ublox_msgs/NavSAT, which has no header: the time of its receipt stands for its stamp."""
    heard = [each for each in message.sv if each.cno > 0]
    return (received, received, len(message.sv), len(heard), sum(1 for each in heard if each.cno >= STRONG_DBHZ),
            sum(1 for each in heard if abs(each.elev) <= 90), sum(1 for each in heard if each.prRes != 0)) + \
        UNKNOWN_DILUTION


def gps_status(message, received):
    """gps_common/GPSStatus, or the status in a gps_common/GPSFix."""
    status = getattr(message, "status", message)
    status = status if hasattr(status, "satellite_visible_snr") else message
    snr = status.satellite_visible_snr
    return (seconds(message.header.stamp), received, len(snr), sum(1 for each in snr if each > 0),
            sum(1 for each in snr if each >= STRONG_DBHZ), len(status.satellite_visible_azimuth), 0) + UNKNOWN_DILUTION


# What is understood: (kind, function that makes the row) by type.
READERS = {
    "nav_msgs/Odometry": ("odometry", odometry),
    "sensor_msgs/NavSatFix": ("fix", fix),
    "geometry_msgs/TwistWithCovarianceStamped": ("velocity", velocity),
    "geometry_msgs/TwistStamped": ("velocity", velocity),
    "sensor_msgs/Imu": ("imu", imu),
    "urban_gnss_localization/SatelliteArray": ("satellites", satellites),
    "ublox_msgs/NavSAT": ("satellites", nav_sat),
    "gps_common/GPSStatus": ("satellites", gps_status),
    "gps_common/GPSFix": ("satellites", gps_status),
}
TF_TYPES = ("tf2_msgs/TFMessage", "tf/tfMessage")


def frames_of(message):
    """frame_id and child_frame_id; empty where the message has none."""
    header = getattr(message, "header", None)
    return getattr(header, "frame_id", ""), getattr(message, "child_frame_id", "")


def add_transforms(transforms, message, publisher, is_static):
    """The edges of a tf message."""
    for each in message.transforms:
        p, q = each.transform.translation, each.transform.rotation
        transforms.add(each.header.frame_id, each.child_frame_id, (p.x, p.y, p.z, q.x, q.y, q.z, q.w), publisher,
                       is_static)
