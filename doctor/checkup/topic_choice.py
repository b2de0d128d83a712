"""Which topic of a bag or a graph is the odometry, the fix, ...: by type, and by name where several have it."""

import re

from .messages import READERS
from .recording import KINDS

# Names of the package first: with these no remapping is needed.
DEFAULT_NAMES = {"odometry": "odom", "fix": "gps/fix", "velocity": "gps/velocity", "imu": "imu/data",
                 "satellites": "gps/satellites"}
LAUNCH_ARGUMENTS = {"odometry": "odom_topic", "fix": "fix_topic", "velocity": "velocity_topic", "imu": "imu_topic",
                    "satellites": "satellites_topic"}
# Same type, other meaning: truths, estimates, commands, set-up.
NOT_MEANT = {
    "odometry": r"truth|reference|/gt\b|filtered|estimate|ekf|ukf|amcl|\bmap\b|navsat|gps|gnss|global|fused|visual|"
                r"vio|lidar|icp|laser|loam|slam",
    "fix": r"datum|filtered|weighted|truth|reference|global_position/global|rtk_base|goal|origin",
    "velocity": r"cmd|command|setpoint|truth|reference|wheel|odom|base_vel|joy|target",
    "imu": r"mag|temp|truth|filtered_acc",
    "satellites": r"truth",
}
PREFERRED = {
    "odometry": r"wheel|odom",
    "fix": r"fix|gps|gnss|nav",
    "velocity": r"fix_velocity|gps.*vel|gnss.*vel|(^|/)vel$",
    "imu": r"data$|imu$",
    "satellites": r"satellites|navsat",
}
TYPES_BEST_FIRST = {"satellites": ("urban_gnss_localization/SatelliteArray", "ublox_msgs/NavSAT",
                                   "gps_common/GPSStatus", "gps_common/GPSFix")}


def same_name(one, other):
    """Whether two names of topics differ by a leading slash at the most."""
    return one.lstrip("/") == other.lstrip("/")


def is_of_kind(topic, kind):
    """Whether a topic's type can be read as this kind of stream."""
    return READERS.get(topic.type, ("",))[0] == kind


def rank(topic, kind):
    """Greater is better."""
    best_types = TYPES_BEST_FIRST.get(kind, ())
    by_type = -best_types.index(topic.type) if topic.type in best_types else 0
    name = topic.name.lower()
    return (by_type, same_name(topic.name, DEFAULT_NAMES[kind]), not re.search(NOT_MEANT[kind], name),
            bool(re.search(PREFERRED[kind], name)), topic.count)


def choose(topics, wanted):
    """{kind: (topic, how it was chosen)}. `wanted` has the topics that were asked for by kind, None for the others.

    A topic that was asked for is chosen though it is missing or of another type: the checks say so.
    """
    chosen = {}
    for kind in KINDS:
        if wanted.get(kind):
            found = [topic.name for topic in topics if same_name(topic.name, wanted[kind])]
            chosen[kind] = (found[0] if found else wanted[kind], "asked for")
            continue
        candidates = sorted((topic for topic in topics if is_of_kind(topic, kind) and topic.count > 0),
                            key=lambda topic: rank(topic, kind), reverse=True)
        # A velocity or an odometry with another meaning is worse than none.
        candidates = [topic for topic in candidates if not re.search(NOT_MEANT[kind], topic.name.lower())]
        if not candidates:
            continue
        best = candidates[0]
        if same_name(best.name, DEFAULT_NAMES[kind]):
            how = "its usual name"
        elif len(candidates) > 1:
            how = "found by type, before " + ", ".join(topic.name for topic in candidates[1:])
        else:
            how = "found by type"
        chosen[kind] = (best.name, how)
    return chosen
