#!/usr/bin/env python3
"""Spoils a good bag with one fault, so that `doctor` can be seen to name it.

usage: spoil_bag.py FAULT IN.bag OUT.bag [--pose]

With --pose the odometry's pose is integrated anew from the spoilt twist, as by a driver that has the fault in its
wheels. `spoil_bag.py --list` names the faults. Topics are taken by their types, as `doctor` takes them.

`spoil_bag.py --table IN.bag` spoils a bag with each of them, runs doctor on it, and prints a table of what it said.
"""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile

import rosbag
import rospy

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..", "doctor"))
from checkup.bag_reader import topics_of  # noqa: E402
from checkup.topic_choice import choose  # noqa: E402

DOCTOR = os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..", "doctor", "doctor")
GAP_S = 6.0
DEAD_S = 60.0
DROP = object()


def yaw_of(q):
    """Heading of a quaternion."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def scale_speed(factor):
    """A fault of the odometry's speed."""
    def change(message, _):
        message.twist.twist.linear.x *= factor
        message.twist.twist.linear.y *= factor
    return change


def scale_rate(factor):
    """A fault of the odometry's yaw rate."""
    def change(message, _):
        message.twist.twist.angular.z *= factor
    return change


def twist_in_odom_frame(message, _):
    twist, yaw = message.twist.twist.linear, yaw_of(message.pose.pose.orientation)
    twist.x, twist.y = (twist.x * math.cos(yaw) - twist.y * math.sin(yaw),
                        twist.x * math.sin(yaw) + twist.y * math.cos(yaw))


def twist_zero(message, _):
    message.twist.twist.linear.x = message.twist.twist.linear.y = message.twist.twist.angular.z = 0.0


def pose_zero(message, _):
    pose = message.pose.pose
    pose.position.x = pose.position.y = 0.0
    pose.orientation.x = pose.orientation.y = pose.orientation.z = pose.orientation.w = 0.0


def gap(message, share):
    return DROP if 0.5 < share.of_time and share.seconds - 0.5 * share.total < GAP_S else None


def dead_encoder(message, share):
    if 0.4 < share.of_time and share.seconds - 0.4 * share.total < DEAD_S:
        message.twist.twist.linear.x = 0.0


def unsigned(message, _):
    message.twist.twist.linear.x = abs(message.twist.twist.linear.x)


def odom_frame(message, _):
    message.header.frame_id = ""


def shift(seconds):
    """Another clock: only the stamps."""
    def change(message, _):
        message.header.stamp += rospy.Duration(seconds)
    return change


def stamp_zero(message, _):
    message.header.stamp = rospy.Time(0)


def since_start(message, share):
    message.header.stamp = rospy.Time.from_sec(max(0.001, 100.0 + share.seconds))


def frame_empty(message, _):
    message.header.frame_id = ""


def latlon_swapped(message, _):
    message.latitude, message.longitude = message.longitude, message.latitude


def scale_place(factor):
    """Another unit of latitude and longitude."""
    def change(message, _):
        message.latitude *= factor
        message.longitude *= factor
    return change


def sigma_for_variance(message, _):
    message.position_covariance = [math.copysign(math.sqrt(abs(each)), each) for each in message.position_covariance]


def set_covariance(value, kind=2):
    """A covariance that is made up."""
    def change(message, _):
        message.position_covariance = [value, 0.0, 0.0, 0.0, value, 0.0, 0.0, 0.0, value]
        message.position_covariance_type = kind
    return change


def status_never(message, _):
    message.status.status = -1


def imu_degrees(message, _):
    rate = message.angular_velocity
    rate.x, rate.y, rate.z = (math.degrees(each) for each in (rate.x, rate.y, rate.z))


def imu_ned(message, _):
    # Forward, right, down; the orientation (if there is one) from north, clockwise.
    for vector in (message.angular_velocity, message.linear_acceleration):
        vector.y, vector.z = -vector.y, -vector.z
    if message.orientation_covariance[0] != -1.0:
        q = message.orientation
        yaw = 0.5 * math.pi - yaw_of(q)
        q.x = q.y = 0.0
        q.z, q.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)


def imu_on_its_side(message, _):
    for vector in (message.angular_velocity, message.linear_acceleration):
        vector.y, vector.z = vector.z, -vector.y
    message.orientation_covariance = [-1.0] + [0.0] * 8


def velocity_of(message):
    """The linear part, with or without covariance."""
    return message.twist.twist.linear if hasattr(message.twist, "covariance") else message.twist.linear


def velocity_in_body(message, _):
    linear = velocity_of(message)
    linear.x, linear.y = math.hypot(linear.x, linear.y), 0.0


def velocity_ned(message, _):
    linear = velocity_of(message)
    linear.x, linear.y, linear.z = linear.y, linear.x, -linear.z


def scale_velocity(factor):
    """Another unit of the receiver's velocity."""
    def change(message, _):
        linear = velocity_of(message)
        linear.x, linear.y = linear.x * factor, linear.y * factor
    return change


# Fault: (kind of stream, what is done to each message, words by which doctor names it).
FAULTS = {
    "yaw_rate_degrees": ("odometry", scale_rate(180.0 / math.pi), "degrees per second"),
    "yaw_rate_reversed": ("odometry", scale_rate(-1.0), "reversed"),
    "speed_kmh": ("odometry", scale_speed(3.6), "km/h"),
    "speed_mph": ("odometry", scale_speed(2.23694), "mph"),
    "speed_mm": ("odometry", scale_speed(1000.0), "mm/s"),
    "speed_reversed": ("odometry", scale_speed(-1.0), "reversed"),
    "speed_half": ("odometry", scale_speed(0.5), "half"),
    "speed_unsigned": ("odometry", unsigned, "without sign"),
    "twist_in_odom_frame": ("odometry", twist_in_odom_frame, "frame"),
    "twist_zero": ("odometry", twist_zero, "twist is zero"),
    "pose_zero": ("odometry", pose_zero, "twist only"),
    "odometry_gap": ("odometry", gap, "gaps of"),
    "odometry_stamp_zero": ("odometry", stamp_zero, "stamps are zero"),
    "dead_encoder": ("odometry", dead_encoder, "dead encoder"),
    "odom_frame_empty": ("odometry", odom_frame, "frame_id is empty"),
    "imu_degrees": ("imu", imu_degrees, "degrees per second"),
    "imu_ned": ("imu", imu_ned, "NED"),
    "imu_on_its_side": ("imu", imu_on_its_side, "not vertical"),
    "imu_clock": ("imu", shift(1.0), "ahead of"),
    "imu_since_start": ("imu", since_start, "another time"),
    "fix_ahead": ("fix", shift(1.5), "ahead of"),
    "fix_gps_time": ("fix", shift(18.0), "GPS time"),
    "fix_stamp_zero": ("fix", stamp_zero, "stamps are zero"),
    "fix_frame_empty": ("fix", frame_empty, "frame_id is empty"),
    "fix_swapped": ("fix", latlon_swapped, "swapped"),
    "fix_e7": ("fix", scale_place(1e7), "10^7"),
    "fix_radians": ("fix", scale_place(math.pi / 180.0), "radians"),
    "fix_status_never": ("fix", status_never, "status -1"),
    "sigma_for_variance": ("fix", sigma_for_variance, "sigma in place"),
    "covariance_tiny": ("fix", set_covariance(1e-4), "scatters by"),
    "covariance_zero": ("fix", set_covariance(0.0), "all zero"),
    "velocity_in_body": ("velocity", velocity_in_body, "robot's own frame"),
    "velocity_ned": ("velocity", velocity_ned, "NED"),
    "velocity_kmh": ("velocity", scale_velocity(3.6), "km/h"),
    "velocity_reversed": ("velocity", scale_velocity(-1.0), "reversed"),
    "velocity_clock": ("velocity", shift(-2.0), "after their stamps"),
}
# Those after whose name the time of receipt is the stamp, too: as in a bag made of tables.
BOTH_TIMES = "_both_times"


class Share:
    """How far into the bag a message is."""

    def __init__(self, seconds, total):
        self.seconds, self.total, self.of_time = seconds, total, seconds / max(total, 1e-9)


class PoseIntegrator:
    """Places from the twist, as a driver makes them."""

    def __init__(self):
        self.last, self.x, self.y, self.yaw = None, 0.0, 0.0, 0.0

    def apply(self, message, stamp):
        """Gives the message the pose that its twist leads to."""
        dt = 0.0 if self.last is None else min(max(stamp - self.last, 0.0), 1.0)
        self.last = stamp
        twist = message.twist.twist
        middle = self.yaw + 0.5 * twist.angular.z * dt
        self.x += (twist.linear.x * math.cos(middle) - twist.linear.y * math.sin(middle)) * dt
        self.y += (twist.linear.x * math.sin(middle) + twist.linear.y * math.cos(middle)) * dt
        self.yaw += twist.angular.z * dt
        message.pose.pose.position.x, message.pose.pose.position.y = self.x, self.y
        q = message.pose.pose.orientation
        q.x = q.y = 0.0
        q.z, q.w = math.sin(0.5 * self.yaw), math.cos(0.5 * self.yaw)


def spoil(fault, source, target, with_pose=False):
    """Copies a bag with the fault in it. Raises ValueError where the bag has no such stream."""
    both = fault.endswith(BOTH_TIMES)
    kind, change, _ = FAULTS[fault[:-len(BOTH_TIMES)] if both else fault]
    with rosbag.Bag(source) as bag:
        chosen = choose(topics_of([bag]), {})
        if kind not in chosen:
            raise ValueError("{}: has no {}".format(source, kind))
        topic = chosen[kind][0]
        begin, end = bag.get_start_time(), bag.get_end_time()
        integrator = PoseIntegrator() if with_pose and kind == "odometry" else None
        with rosbag.Bag(target, "w") as out:
            for name, message, stamp in bag.read_messages():
                if name == topic:
                    before = message.header.stamp
                    if change(message, Share(stamp.to_sec() - begin, end - begin)) is DROP:
                        continue
                    if integrator:
                        integrator.apply(message, stamp.to_sec())
                    if both:
                        stamp += message.header.stamp - before
                out.write(name, message, stamp)


def judge(fault, source, folder):
    """(level, check, text) of the finding that names a fault of a bag; None for each where there is none."""
    target, report = os.path.join(folder, "spoilt.bag"), os.path.join(folder, "report.json")
    spoil(fault, source, target)
    subprocess.run([sys.executable, "-B", DOCTOR, target, "--json", report], stdout=subprocess.DEVNULL, check=False)
    with open(report, encoding="utf-8") as stream:
        findings = json.load(stream)["findings"]
    named = [each for each in findings if each["level"] != "PASS" and FAULTS[fault][2] in each["text"]]
    best = min(named, key=lambda each: each["level"], default={"level": None, "check": None, "text": None})
    return best["level"], best["check"], best["text"]


def print_table(source):
    """A row a fault that the bag can have."""
    print("| fault | said | check |\n|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for fault in FAULTS:
            try:
                level, check, _ = judge(fault, source, folder)
            except ValueError:
                continue
            check = "`{}`".format(check) if check else "–"
            print("| `{}` | {} | {} |".format(fault, level or "–", check), flush=True)


def main():
    """The program."""
    if sys.argv[1:] == ["--list"]:
        print("\n".join(FAULTS))
        return
    if len(sys.argv) == 3 and sys.argv[1] == "--table":
        print_table(sys.argv[2])
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fault",
                        help="a name of --list, with {} also its times of receipt are changed".format(BOTH_TIMES))
    parser.add_argument("source")
    parser.add_argument("target")
    parser.add_argument("--pose", action="store_true", help="integrate the pose from the spoilt twist")
    options = parser.parse_args()
    if options.fault not in FAULTS and options.fault[:-len(BOTH_TIMES)] not in FAULTS:
        parser.error("{} is none of: {}".format(options.fault, ", ".join(FAULTS)))
    try:
        spoil(options.fault, options.source, options.target, options.pose)
    except (ValueError, OSError, rosbag.ROSBagException) as error:
        sys.exit("spoil_bag.py: {}".format(error))


if __name__ == "__main__":
    main()
