"""Synthetic drives for the tests of the doctor: clean ones, as a Recording or as a bag."""
import math
import os
import sys

import numpy as np

HERE = os.path.dirname(os.path.realpath(__file__))
sys.path[:0] = [os.path.join(HERE, "..", "..", folder) for folder in ("doctor", "reports")]
from checkup import checks, setup  # noqa: E402
from checkup.recording import COLUMNS, Recording, Stream, Topic, Transforms  # noqa: E402

T0 = 1.7e9
LATITUDE, LONGITUDE = 48.1, 11.5
METRES_A_DEGREE = 111194.0
TYPES = {"odometry": "nav_msgs/Odometry", "fix": "sensor_msgs/NavSatFix", "imu": "sensor_msgs/Imu",
         "velocity": "geometry_msgs/TwistWithCovarianceStamped", "satellites": "urban_gnss_localization/SatelliteArray"}
TOPICS = {"odometry": "/odom", "fix": "/gps/fix", "imu": "/imu/data", "velocity": "/gps/velocity",
          "satellites": "/gps/satellites"}
FRAMES = {"odometry": "odom", "fix": "gps", "imu": "imu_link", "velocity": "gps", "satellites": "gps"}


def stream(kind, t, columns, received=None):
    """A stream out of columns by name; the others are zero."""
    rows = np.zeros((len(t), 2 + len(COLUMNS[kind])))
    rows[:, 0], rows[:, 1] = t, t + 0.02 if received is None else received
    for name, values in columns.items():
        rows[:, 2 + COLUMNS[kind].index(name)] = values
    return Stream(kind, TOPICS[kind], rows, {FRAMES[kind]: len(t)}, {"base_link" if kind == "odometry" else "": len(t)})


def drive(seconds=240.0, seed=1, lever=(0.0, 0.0), parts=("odometry", "fix", "imu", "velocity", "satellites")):
    """A winding road with stops, turns to both sides: fixes of 0.5 m, wheels and gyroscope nearly perfect."""
    random = np.random.RandomState(seed)
    t = np.arange(0.0, seconds, 0.05)
    speed = np.clip(2.0 + 1.5 * np.sin(2.0 * np.pi * t / 37.0), 0.0, 3.0) * (t > 5.0)
    rate = (0.25 * np.sin(2.0 * np.pi * t / 29.0) + 0.1 * np.sin(2.0 * np.pi * t / 11.3) + 0.03) * (t > 5.0)
    yaw = np.cumsum(rate) * 0.05
    path = np.cumsum(speed * np.exp(1j * (yaw - 0.025 * rate))) * 0.05
    streams = {}
    if "odometry" in parts:
        streams["odometry"] = stream("odometry", T0 + t, {
            "x": path.real, "y": path.imag, "yaw": np.arctan2(np.sin(yaw), np.cos(yaw)), "quaternion_norm": 1.0,
            "vx": speed + random.normal(0.0, 0.01, len(t)), "wz": rate + random.normal(0.0, 0.005, len(t)),
            "twist_cov_x": 0.01})
    if "imu" in parts:
        streams["imu"] = stream("imu", T0 + t + 0.001, {
            "wz": rate + random.normal(0.0, 0.002, len(t)), "az": 9.81, "orientation_cov": -1.0})
    course = 0.7 + yaw  # the odometry starts with another heading than the map's
    place = path * np.exp(0.7j) + (lever[0] + 1j * lever[1]) * np.exp(1j * course)
    every = slice(0, None, 20)
    k = len(t[every])
    error = np.cumsum(random.normal(0.0, 0.1, k) + 1j * random.normal(0.0, 0.1, k))
    error -= np.mean(error)
    fix = place[every] + error + random.normal(0.0, 0.2, k) + 1j * random.normal(0.0, 0.2, k)
    variance = 1.0 + 0.3 * random.rand(k)
    if "fix" in parts:
        streams["fix"] = stream("fix", T0 + t[every], {
            "lat": LATITUDE + fix.imag / METRES_A_DEGREE,
            "lon": LONGITUDE + fix.real / METRES_A_DEGREE / math.cos(math.radians(LATITUDE)), "alt": 500.0,
            "cov_xx": variance, "cov_yy": variance, "cov_zz": 3.0 * variance, "cov_type": 2.0})
    if "velocity" in parts:
        velocity = speed * np.exp(1j * course)
        streams["velocity"] = stream("velocity", T0 + t[every], {
            "vx": velocity[every].real + random.normal(0.0, 0.05, k),
            "vy": velocity[every].imag + random.normal(0.0, 0.05, k), "cov_xx": 0.01, "cov_yy": 0.01})
    if "satellites" in parts:
        streams["satellites"] = stream("satellites", T0 + t[every], {
            "count": 14.0, "heard": 12.0, "strong": 9.0, "directions": 12.0, "residuals": 9.0})
    transforms = Transforms()
    transforms.add("odom", "base_link", (0.0,) * 6 + (1.0,), "/base", False)
    transforms.add("base_link", "gps", tuple(lever) + (1.0, 0.0, 0.0, 0.0, 1.0), "/tf", True)
    transforms.add("base_link", "imu_link", (0.0,) * 6 + (1.0,), "/tf", True)
    recording = Recording("drive.bag", [Topic(TOPICS[kind], TYPES[kind], len(each)) for kind, each in streams.items()],
                          streams, transforms, T0, T0 + seconds)
    recording.choices = {kind: (TOPICS[kind], "its usual name") for kind in streams}
    return recording


def examine(recording, told=setup.DEFAULTS):
    """The findings."""
    with np.errstate(all="ignore"):
        return checks.examine(recording, told)[0]


def said(findings, level=None):
    """Checks and texts of the findings, of a level."""
    return "\n".join("{} {}: {}".format(each.level, each.check, each.text) for each in findings
                     if level is None or each.level == level)


def write_bag(path, recording):
    """A recording as a bag."""
    import rosbag
    import rospy
    from geometry_msgs.msg import TransformStamped, TwistWithCovarianceStamped
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, NavSatFix
    from tf2_msgs.msg import TFMessage
    messages = []

    def add(kind, one, k, message):
        message.header.stamp = rospy.Time.from_sec(one.t[k])
        message.header.frame_id = FRAMES[kind]
        messages.append((one.received[k], TOPICS[kind], message))

    for k in range(len(recording.odometry or ())):
        one, message = recording.odometry, Odometry(child_frame_id="base_link")
        message.pose.pose.position.x, message.pose.pose.position.y = one.x[k], one.y[k]
        q = message.pose.pose.orientation
        q.z, q.w = math.sin(0.5 * one.yaw[k]), math.cos(0.5 * one.yaw[k])
        message.twist.twist.linear.x, message.twist.twist.angular.z = one.vx[k], one.wz[k]
        add("odometry", one, k, message)
    for k in range(len(recording.imu or ())):
        message = Imu()
        message.angular_velocity.z, message.linear_acceleration.z = recording.imu.wz[k], recording.imu.az[k]
        message.orientation_covariance[0] = -1.0
        add("imu", recording.imu, k, message)
    for k in range(len(recording.fix or ())):
        one = recording.fix
        message = NavSatFix(latitude=one.lat[k], longitude=one.lon[k], altitude=500.0, position_covariance_type=2)
        message.position_covariance = [one.cov_xx[k], 0.0, 0.0, 0.0, one.cov_yy[k], 0.0, 0.0, 0.0, one.cov_zz[k]]
        add("fix", one, k, message)
    for k in range(len(recording.velocity or ())):
        message = TwistWithCovarianceStamped()
        message.twist.twist.linear.x, message.twist.twist.linear.y = recording.velocity.vx[k], recording.velocity.vy[k]
        add("velocity", recording.velocity, k, message)
    transforms = TFMessage()
    for parent, child in recording.transforms.publishers:
        transform = TransformStamped(child_frame_id=child)
        transform.header.frame_id, transform.transform.rotation.w = parent, 1.0
        transforms.transforms.append(transform)
    messages.append((T0, "/tf_static", transforms))
    with rosbag.Bag(path, "w") as bag:
        for received, topic, message in sorted(messages, key=lambda each: each[0]):
            bag.write(topic, message, rospy.Time.from_sec(received))
