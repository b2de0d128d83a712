"""What was recorded, as arrays: the only thing that the checks see. Nothing here knows ROS.

Times are seconds as the messages have them: `t` from the header, `received` from the bag or the clock on arrival.
"""

from collections import Counter, namedtuple

import numpy as np

from . import signals

# Columns of each kind of stream, beside t and received. SI units, radians, degrees for latitude and longitude.
COLUMNS = {
    "odometry": ("x", "y", "yaw", "quaternion_norm", "vx", "vy", "wz", "pose_cov_x", "pose_cov_yaw", "twist_cov_x",
                 "twist_cov_yaw"),
    "fix": ("lat", "lon", "alt", "status", "cov_xx", "cov_xy", "cov_yy", "cov_zz", "cov_type"),
    "velocity": ("vx", "vy", "vz", "cov_xx", "cov_yy"),
    "imu": ("wx", "wy", "wz", "ax", "ay", "az", "qx", "qy", "qz", "qw", "orientation_cov", "rate_cov"),
    # Numbers of satellites with each; and the variances of east and north for ranges of 1 m (the squares of their DOP).
    "satellites": ("count", "heard", "strong", "directions", "residuals", "dop_xx", "dop_yy"),
}
KINDS = tuple(COLUMNS)
STRONG_DBHZ = 35.0  # C/N0 of a signal in line of sight; reflected ones are mostly weaker

Topic = namedtuple("Topic", "name type count")


class Stream:
    """The messages of one topic, a column an array."""

    def __init__(self, kind, topic, rows, frames=(), child_frames=()):
        table = np.array(rows, dtype=float).reshape(len(rows), 2 + len(COLUMNS[kind]))
        self.kind = kind
        self.topic = topic
        self.t = table[:, 0]
        self.received = table[:, 1]
        self.frames = Counter(frames)
        self.child_frames = Counter(child_frames)
        for index, name in enumerate(COLUMNS[kind]):
            setattr(self, name, table[:, 2 + index])

    def __len__(self):
        return len(self.t)

    def frame(self):
        """The frame_id of most messages; empty where they have none."""
        return self.frames.most_common(1)[0][0] if self.frames else ""

    def child_frame(self):
        """The child_frame_id of most messages; empty where they have none."""
        return self.child_frames.most_common(1)[0][0] if self.child_frames else ""

    def select(self, mask):
        """The stream with the chosen messages only."""
        rows = np.column_stack([self.t, self.received] + [getattr(self, name) for name in COLUMNS[self.kind]])
        return Stream(self.kind, self.topic, rows[mask], self.frames, self.child_frames)


class Transforms:
    """The edges of the tf tree: who broadcasts them, and where the static ones are."""

    def __init__(self):
        self.publishers = {}  # (parent, child): names of nodes
        self.static = {}      # (parent, child): (x, y, z, qx, qy, qz, qw)
        self.slashed = set()  # names with a leading slash, which tf2 does not take

    def add(self, parent, child, pose, publisher, is_static):
        """One transform of a message."""
        for name in (parent, child):
            if name.startswith("/"):
                self.slashed.add(name)
        edge = (parent.lstrip("/"), child.lstrip("/"))
        self.publishers.setdefault(edge, set()).add(publisher)
        if is_static:
            self.static[edge] = tuple(pose)

    def connected(self, first, second):
        """Whether a chain of transforms leads from one frame to the other."""
        reached, todo = {first}, [first]
        while todo:
            frame = todo.pop()
            for parent, child in self.publishers:
                for one, other in ((parent, child), (child, parent)):
                    if one == frame and other not in reached:
                        reached.add(other)
                        todo.append(other)
        return second in reached

    def static_pose(self, base, frame):
        """x, y, z and quaternion of `frame` in `base`; None where it is no static transform of one step."""
        return self.static.get((base, frame))


class Recording:
    """The streams of one robot: at most one of each kind; None where there is none."""

    def __init__(self, name, topics=(), streams=None, transforms=None, begin=0.0, end=0.0, is_live=False):
        self.name = name
        self.topics = list(topics)           # of Topic: all that there are
        self.transforms = transforms or Transforms()
        self.begin, self.end = begin, end    # s, of the record
        self.is_live = is_live
        self.choices = {}                    # kind: (topic, how it was chosen)
        self.trouble = []                    # what went wrong while reading
        for kind in KINDS:
            setattr(self, kind, (streams or {}).get(kind))

    def duration(self):
        """s, of the record."""
        return max(self.end - self.begin, 0.0)

    def first_stamp(self):
        """The stamp that a message at the begin would have: `begin`, unless it was recorded anew at another time."""
        delays = [signals.median(stream.received - stream.t) for stream in self.streams() if stream.received.any()]
        delay = signals.median(delays) if delays else 0.0
        return self.begin - (delay if abs(delay) > self.duration() else 0.0)

    def streams(self):
        """Those that there are and that have messages."""
        return [stream for stream in (getattr(self, kind) for kind in KINDS) if stream is not None and len(stream)]
