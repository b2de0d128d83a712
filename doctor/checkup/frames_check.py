"""frame_ids, and the transforms that a localizer will miss."""

import numpy as np

from .evidence import imu_yaw_rate
from .finding import failed, passed, warned


def check(evidence):
    """All findings of this family."""
    recording, setup = evidence.recording, evidence.setup
    findings = message_frames(recording, setup)
    findings += odom_tf(recording, setup)
    findings += sensor_tf(recording, setup)
    findings += map_tf(recording, setup)
    return findings


def message_frames(recording, setup):
    """The frame_ids in the headers."""
    findings = []
    for stream in recording.streams():
        name = "frames." + stream.kind
        slashed = sorted(frame for frame in list(stream.frames) + list(stream.child_frames) if frame.startswith("/"))
        if slashed:
            findings.append(warned(name, "{}: {} has a leading slash, which tf2 does not know; it is left out".format(
                stream.topic, ", ".join(slashed)), "frame_id: {}".format(slashed[0].lstrip("/")), frames=slashed))
        if len(stream.frames) > 1:
            findings.append(warned(name, "{}: frame_id changes between {}: two publishers?".format(
                stream.topic, ", ".join(repr(frame) for frame in sorted(stream.frames))),
                "one publisher on " + stream.topic, frames=sorted(stream.frames)))
        if not stream.frame() and stream.kind not in ("satellites", "velocity"):
            findings.append(warned(name, "{}: frame_id is empty or missing{}".format(
                stream.topic, ": the antenna's place cannot come from tf" if stream.kind == "fix" else
                ": how it is mounted cannot come from tf" if stream.kind == "imu" else ""),
                *empty_frame_change(stream.kind, setup), frames=[""]))
    findings += odometry_frames(recording.odometry, setup)
    return findings or [passed("frames.names", "frame_ids are there, the same in all messages, as the parameters say")]


def empty_frame_change(kind, setup):
    """What to do about a message without a frame."""
    if kind == "fix":
        return ("the driver's parameter frame_id: gps, and tf {} -> gps".format(setup.base_link_frame),
                "{}: {{antenna_offset: [X, Y]}}  # m, or this".format(setup.section))
    if kind == "odometry":
        return ("header.frame_id: {}".format(setup.odom_frame),)
    return ("the driver's parameter frame_id: imu_link, and tf {} -> imu_link".format(setup.base_link_frame),)


def odometry_frames(odometry, setup):
    """The odometry's two frames against the parameters."""
    if odometry is None or not len(odometry):
        return []
    findings = []
    frame, child = odometry.frame().lstrip("/"), odometry.child_frame().lstrip("/")
    if frame and frame != setup.odom_frame:
        findings.append(warned("frames.odom_frame", "{}: frame_id is {}, odom_frame is {}: map -> odom would hang in "
                               "the air".format(odometry.topic, frame, setup.odom_frame),
                               "localization.launch odom_frame:={}".format(frame), frame=frame))
    if not child:
        findings.append(warned("frames.base_link_frame", "{}: child_frame_id is empty or missing: whose twist it is is "
                               "not said".format(odometry.topic), "child_frame_id: {}".format(setup.base_link_frame)))
    elif child != setup.base_link_frame:
        findings.append(warned("frames.base_link_frame", "{}: child_frame_id is {}, base_link_frame is {}".format(
            odometry.topic, child, setup.base_link_frame), "localization.launch base_link_frame:={}".format(child),
            frame=child))
    return findings


def odom_tf(recording, setup):
    """odom -> base_link must come from the robot's odometry."""
    odometry, tf = recording.odometry, recording.transforms
    if odometry is None or not len(odometry):
        return []
    frame = odometry.frame().lstrip("/") or setup.odom_frame
    child = odometry.child_frame().lstrip("/") or setup.base_link_frame
    if not tf.publishers:
        return [warned("frames.tf_odom", "no tf in it: {} -> {} cannot be checked".format(frame, child),
                       "record.launch records /tf and /tf_static")]
    if not tf.connected(frame, child):
        return [warned("frames.tf_odom",
                       "nobody broadcasts {} -> {}: map -> odom alone does not place the robot".format(
            frame, child), "the odometry's driver: publish_odom_tf: true (or its own name for that)")]
    return [passed("frames.tf_odom", "tf leads from {} to {}".format(frame, child))]


def sensor_tf(recording, setup):
    """Where antenna and IMU are."""
    findings = []
    base = setup.base_link_frame
    if recording.odometry is not None and recording.odometry.child_frame():
        base = recording.odometry.child_frame().lstrip("/")
    for stream in (recording.fix, recording.imu):
        if stream is None or not len(stream) or not stream.frame():
            continue
        frame = stream.frame().lstrip("/")
        if frame == base or recording.transforms.connected(base, frame):
            findings.append(passed("frames.tf_" + stream.kind, "tf leads from {} to {}, the frame of {}".format(
                base, frame, stream.topic)))
        elif stream.kind == "fix" and setup.given_antenna:
            findings.append(passed("frames.tf_fix", "no tf from {} to {}; antenna_offset is given".format(base, frame)))
        elif stream.kind == "imu" and np.mean(imu_yaw_rate(stream)[1]) > 0.9:
            findings.append(passed("frames.tf_imu", "no tf from {} to {}; the messages have an orientation".format(
                base, frame)))
        else:
            what = ("the antenna is taken to be at {}".format(base) if stream.kind == "fix" else
                    "it is taken to have its z axis up")
            change = ["in a launch file: <node pkg=\"tf2_ros\" type=\"static_transform_publisher\" name=\"{}_tf\" "
                      "args=\"X Y Z 0 0 0 {} {}\"/>".format(stream.kind, base, frame)]
            if stream.kind == "fix":
                change.insert(0, "{}: {{antenna_offset: [X, Y]}}  # m; or a tf:".format(setup.section))
            findings.append(warned("frames.tf_" + stream.kind, "no tf from {} to {}, the frame of {}: {}".format(
                base, frame, stream.topic, what), *change))
    return findings


def map_tf(recording, setup):
    """map -> odom is the localizer's, and of one publisher."""
    edge = (setup.map_frame, setup.odom_frame)
    publishers = sorted(recording.transforms.publishers.get(edge, ()))
    parents = sorted(parent for parent, child in recording.transforms.publishers if child == setup.odom_frame)
    if len(publishers) > 1:
        return [failed("frames.tf_map", "{} nodes broadcast {} -> {}: {}".format(
            len(publishers), edge[0], edge[1], ", ".join(publishers)),
            "{}: {{publish_tf: false}}  # or stop the other".format(setup.section), publishers=publishers)]
    if parents and parents != [setup.map_frame]:
        return [warned("frames.tf_map", "{} already has the parent {}: a frame has only one".format(
            setup.odom_frame, ", ".join(parents)), "localization.launch map_frame:={}, or publish_tf:=false".format(
                parents[0]))]
    if publishers and not recording.is_live:
        return [warned("frames.tf_map",
                       "the recording has {} -> {} already: beside a localizer there would be two".format(
            *edge), "replay.launch tf_topics:='' , or localization.launch publish_tf:=false")]
    return []
