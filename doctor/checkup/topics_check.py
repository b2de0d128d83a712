"""Are the topics there, fast enough, and of types that a localizer takes; and which receiver preset fits."""

import re

from . import signals
from .finding import failed, passed, warned
from .topic_choice import LAUNCH_ARGUMENTS, same_name, DEFAULT_NAMES

NEEDED = ("odometry", "fix")
TYPES = {"odometry": "nav_msgs/Odometry", "fix": "sensor_msgs/NavSatFix",
         "velocity": "geometry_msgs/TwistWithCovarianceStamped or TwistStamped", "imu": "sensor_msgs/Imu",
         "satellites": "urban_gnss_localization/SatelliteArray"}
NAMES = {"odometry": "odometry", "fix": "fixes", "velocity": "the receiver's velocity", "imu": "IMU",
         "satellites": "satellites"}
# Slower than this is slow: odometry below 5 Hz smears turns, fixes below 0.2 Hz leave the filter alone for long.
SLOWEST_HZ = {"odometry": 5.0, "fix": 0.2, "velocity": 0.2, "imu": 10.0, "satellites": 0.0}
# Types of drivers, by preset of localization.launch.
PRESETS = (
    ("ublox", r"^ublox_msgs/(Nav|Rxm)"),
    ("novatel", r"^novatel_(gps|oem7)_msgs/"),
    ("septentrio", r"^septentrio_gnss_driver(_ros)?/|^septentrio_gnss_driver/"),
    ("nmea", r"^nmea_msgs/"),
    ("gpsd", r"^gps_common/GPS(Fix|Status)$|^gps_msgs/GPS"),
)
# Where receiver_node looks for the driver's topics (receivers/receiver_presets.cpp); the others' have none.
PRESET_NAMESPACES = {"ublox": "ublox_gps", "septentrio": "septentrio_gnss", "mavros": "mavros"}
BETTER_WITH = {
    "velocity": "the heading would be known within seconds of driving, and dead wheels would be noticed",
    "imu": "turns would be known better than by wheels",
    "satellites": "reflected signals could be left out",
}


def check(evidence):
    """All findings of this family."""
    recording = evidence.recording
    findings = [stream_finding(recording, kind) for kind in NAMES]
    findings += preset_findings(recording)
    findings += [warned("topics.reading", text, "rosbag reindex, or record anew") for text in recording.trouble]
    return [finding for finding in findings if finding]


def remedy(recording, kind):
    """The launch argument for a topic that does not have its usual name; none for a driver's own messages."""
    topic = recording.choices.get(kind, ("", ""))[0]
    if not topic or same_name(topic, DEFAULT_NAMES[kind]):
        return ()
    if any(same_name(each.name, topic) and each.type.split("/")[-1] not in TYPES[kind] for each in recording.topics):
        return ()
    return ("localization.launch {}:={}".format(LAUNCH_ARGUMENTS[kind], topic),)


def stream_finding(recording, kind):
    """Whether one stream is there, and how fast."""
    name = "topics." + kind
    stream = getattr(recording, kind)
    topic, how = recording.choices.get(kind, ("", ""))
    if topic and stream is None:
        known = [each for each in recording.topics if same_name(each.name, topic)]
        if known:
            return failed(name, "{} has the type {}, not {}".format(topic, known[0].type, TYPES[kind]),
                          "localization.launch {}:=TOPIC of the type {}".format(LAUNCH_ARGUMENTS[kind], TYPES[kind]))
        return failed(name, "{} was asked for and is not there".format(topic), available(recording))
    if stream is None or len(stream) == 0:
        return missing(recording, kind, topic)
    rate = 1.0 / signals.period(stream.t) if len(stream) > 1 and signals.period(stream.t) > 0.0 else 0.0
    received = signals.period(stream.received)
    if rate == 0.0 and received > 0.0:
        rate = 1.0 / received
    text = "{}: {} messages on {} ({}), {:.3g} Hz".format(NAMES[kind], len(stream), topic, how, rate)
    if len(stream) < 3:
        return warned(name, text + ": too few to say anything of them", *remedy(recording, kind), rate_hz=rate)
    if rate < 0.95 * SLOWEST_HZ[kind]:
        return warned(name, text + ": slow, {:g} Hz or more are better".format(SLOWEST_HZ[kind]),
                      "a higher rate in the driver's parameters", *remedy(recording, kind), rate_hz=rate)
    return passed(name, text, rate_hz=rate)._replace(change=remedy(recording, kind))


def missing(recording, kind, topic):
    """A stream that is not there."""
    name = "topics." + kind
    what = "no messages on {}".format(topic) if topic else "no topic of the type {}".format(TYPES[kind])
    if kind in NEEDED:
        preset = receiver_argument(recording) if kind == "fix" else None
        # A bag may hold only a part of what the robot has; a live graph without it does not work.
        finding = failed if recording.is_live or not recording.streams() else warned
        text = ("no fixes: {}; without them nothing is localized" if kind == "fix" else
                "no odometry: {}; a localizer needs it, or replay --odom none").format(what)
        return finding(name, text, "localization.launch " + preset if preset else available(recording),
                       is_missing=preset is None)
    if kind == "imu" or preset_of(recording) is None:
        return warned(name, "{}: {}; with it {}".format(NAMES[kind], what, BETTER_WITH[kind]),
                      "localization.launch {}:=TOPIC, if the robot has one".format(LAUNCH_ARGUMENTS[kind]))
    return warned(name, "no {} as such, but the receiver's own messages are there".format(NAMES[kind]),
                  "localization.launch " + receiver_argument(recording))


def available(recording):
    """What there is instead."""
    names = [each.name for each in recording.topics if each.count > 0]
    shown = ", ".join(names[:12]) + (" ..." if len(names) > 12 else "")
    return "topics that are there: " + (shown or "none")


def preset_of(recording):
    """The receiver preset for the types of messages; None where none of them is a driver's."""
    if any(re.search(r"(^|/)mavros/global_position/raw/", each.name) for each in recording.topics):
        return "mavros"
    types = [each.type for each in recording.topics if each.count > 0]
    for preset, pattern in PRESETS:
        if any(re.search(pattern, each) for each in types):
            if preset == "gpsd" and any("septentrio" in each.name.lower() for each in recording.topics):
                return "septentrio"
            return preset
    return None


def is_of_driver(type_name):
    """Whether it is a type of message of a receiver's driver."""
    return any(re.search(pattern, type_name) for _, pattern in PRESETS)


def receiver_argument(recording):
    """The launch arguments for the preset, with the namespace of the driver's topics; None where there is no driver."""
    preset = preset_of(recording)
    if preset is None:
        return None
    names = [each.name.strip("/") for each in recording.topics if each.count > 0 and is_of_driver(each.type)]
    if preset == "mavros":
        names = [each.name.strip("/").replace("/global_position/raw", "") for each in recording.topics
                 if "/global_position/raw/" in each.name]
    namespace = names[0].rpartition("/")[0] if names else ""
    if namespace == PRESET_NAMESPACES.get(preset, ""):
        return "receiver:={}".format(preset)
    return "receiver:={} receiver_ns:={}".format(preset, namespace or "/")


def preset_findings(recording):
    """Which preset fits, and a fix that is no receiver's."""
    findings = []
    preset = preset_of(recording)
    if preset:
        types = sorted({each.type for each in recording.topics if is_of_driver(each.type)}) or ["mavros's topics"]
        findings.append(warned("topics.receiver", "messages of a receiver's driver are there ({}{}): its preset takes "
                               "fixes, velocity and satellites of them".format(", ".join(types[:3]),
                                                                               " ..." if len(types) > 3 else ""),
                               "localization.launch " + receiver_argument(recording), preset=preset))
    fix_topic = recording.choices.get("fix", ("", ""))[0]
    if re.search(r"global_position/global$|gps/filtered$", fix_topic):
        findings.append(failed("topics.fused", "{} is an estimate that is already fused, not the receiver's fix".format(
            fix_topic), "localization.launch fix_topic:={}".format(
                re.sub(r"global$", "raw/fix", fix_topic) if fix_topic.endswith("global") else "TOPIC of the receiver")))
    return findings
