"""A street with a wall on one side and a robot that stands in it, for the occlusion node: clouds, satellites, fixes and
tf with stamps of their own, published epoch by epoch. Each epoch waits for what the nodes make of the one before, so that
a test does not depend on the speed of the machine.
"""
import math
import struct
import threading
import time

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import NavSatFix, NavSatStatus, PointCloud2, PointField
from tf2_msgs.msg import TFMessage
from urban_gnss_localization.msg import Satellite, SatelliteArray, Visibility

PERIOD_S = 0.2
CLAIMED = [4.0, 1.0, 0.0, 1.0, 9.0, 0.0, 0.0, 0.0, 16.0]
LIDAR_HEIGHT_M = 2.0
# Name: azimuth and elevation (deg), C/N0 (dB-Hz). The wall in the north hides N1 and N2, which are received weakly.
SKY = {1: (0, 30, 24), 2: (20, 35, 25), 3: (0, 80, 45), 4: (90, 30, 44), 5: (180, 30, 46), 6: (200, 35, 45),
       7: (270, 45, 45), 8: (160, 25, 44)}
NORTH, SOUTH = (1, 2), (5, 6, 8)


def wall(y, height=20.0, spacing=0.4):
    """Points of a wall along the x axis, in the lidar's frame."""
    return [(-40.0 + spacing * i, y, spacing * k - LIDAR_HEIGHT_M)
            for i in range(int(80.0 / spacing) + 1) for k in range(int(height / spacing) + 1)]


def to_cloud(stamp, points, names=("x", "y", "z")):
    message = PointCloud2(height=1, width=len(points), point_step=4 * len(names), is_dense=False)
    message.header.stamp, message.header.frame_id = stamp, "lidar"
    message.row_step = message.point_step * message.width
    message.fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate(names)]
    message.data = b"".join(struct.pack("<%df" % len(names), *point[:len(names)]) for point in points)
    return message


def to_transform(stamp, parent, child, height=0.0, yaw=0.0):
    message = TransformStamped()
    message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, parent, child
    message.transform.translation.z = height
    message.transform.rotation.z, message.transform.rotation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return message


def is_at_least(matrix, floor):
    """Whether `matrix` - `floor` (rows of 2x2) has no negative eigenvalue, but for rounding."""
    a, b, c = matrix[0] - floor[0], matrix[1] - floor[1], matrix[3] - floor[3]
    return 0.5 * (a + c) - math.hypot(0.5 * (a - c), b) >= -1e-6 * (matrix[0] + matrix[3])


def horizontal(fix):
    return [fix.position_covariance[i] for i in (0, 1, 3, 4)]


def make_satellites(stamp):
    message = SatelliteArray()
    message.header.stamp, message.header.frame_id = stamp, "gps"
    for svid, (azimuth, elevation, cn0) in SKY.items():
        message.satellites.append(Satellite(svid=svid, name="G%02d" % svid, azimuth=math.radians(azimuth),
                                            elevation=math.radians(elevation), cn0=cn0, tracked=True,
                                            used=Satellite.USED, pseudorange_residual=float("nan")))
    return message


def make_fix(stamp):
    fix = NavSatFix()
    fix.header.stamp, fix.header.frame_id = stamp, "gps"
    fix.status.status = NavSatStatus.STATUS_FIX
    fix.latitude, fix.longitude, fix.altitude = 48.1374, 11.5755, 520.0
    fix.position_covariance = CLAIMED
    fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_KNOWN
    return fix


class Street:
    """`nodes`: namespaces of the occlusion nodes that take its messages."""

    TIMEOUT_S = 30.0

    def __init__(self, nodes, start_s=1000.0):
        self.time_s = start_s
        self.last_fed_s = start_s
        self.news = threading.Condition()
        self.weighted = {node: {} for node in nodes}
        self.visibilities = {node: {} for node in nodes}
        self.publishers = {name: rospy.Publisher(name, kind, queue_size=100, tcp_nodelay=True)
                           for name, kind in (("points", PointCloud2), ("gps/satellites", SatelliteArray),
                                              ("gps/fix", NavSatFix), ("tf", TFMessage))}
        self.static = tf2_ros.StaticTransformBroadcaster()
        zero = rospy.Time()
        self.static.sendTransform([to_transform(zero, "turned_map", "map", yaw=math.pi),
                                   to_transform(zero, "map", "odom"),
                                   to_transform(zero, "base_link", "lidar", LIDAR_HEIGHT_M),
                                   to_transform(zero, "base_link", "gps", LIDAR_HEIGHT_M)])
        for node in nodes:
            for topic, kind, store in (("gps/fix_weighted", NavSatFix, self.weighted[node]),
                                       ("gps/visibility", Visibility, self.visibilities[node])):
                rospy.Subscriber(node + "/" + topic, kind, self._on_message, store, queue_size=1000, tcp_nodelay=True)
        ends = list(self.publishers.values()) + [self.static.pub_tf]  # a node that has no static transform yet makes no map
        self.await_(lambda: all(end.get_num_connections() >= len(nodes) for end in ends), "the nodes to subscribe")

    def _on_message(self, message, store):
        with self.news:
            store[message.header.stamp.to_nsec()] = message
            self.news.notify_all()

    def await_(self, condition, what):
        end = time.monotonic() + self.TIMEOUT_S
        with self.news:
            while not condition():
                if time.monotonic() > end:
                    raise AssertionError("waited %.0f s for %s" % (self.TIMEOUT_S, what))
                self.news.wait(0.05)

    def feed(self, epochs, cloud=None, satellites=True, tf=True, lag=1):
        """Publishes `epochs` epochs with these points of a cloud (None: no cloud) and waits until each node has
        answered all but the last `lag`, which may wait for what comes after them. After a jump of the stamps a node
        believes the third. Returns the stamps (ns) of those that were answered."""
        stamps = []
        has_jumped = not 0.0 <= self.time_s - self.last_fed_s <= 1.0
        for index in range(epochs):
            self.time_s += PERIOD_S
            stamp = rospy.Time.from_sec(self.time_s)
            if tf:
                self.publishers["tf"].publish(TFMessage([to_transform(stamp, "odom", "base_link")]))
            if cloud is not None:
                self.publishers["points"].publish(to_cloud(stamp, cloud))
            if satellites:
                self.publishers["gps/satellites"].publish(make_satellites(stamp))
            self.publishers["gps/fix"].publish(make_fix(stamp))
            stamps.append(stamp.to_nsec())
            self.last_fed_s = self.time_s
            if has_jumped and index < 3:
                continue
            for due in stamps[:-lag][-1:]:
                self.await_(lambda: all(due in store for stores in (self.weighted, self.visibilities)
                                        for store in stores.values()), "the fix at %d" % due)
        return stamps[:-lag]

    def transform_of(self, later_s):
        """A transform alone, with a stamp that many seconds after the last epoch's."""
        stamp = rospy.Time.from_sec(self.time_s + later_s)
        self.publishers["tf"].publish(TFMessage([to_transform(stamp, "odom", "base_link")]))

    def burst(self, clouds, points):
        """Clouds of one moment, without anything else."""
        for i in range(clouds):
            self.publishers["points"].publish(to_cloud(rospy.Time.from_sec(self.time_s + 0.01 + 1e-4 * i), points))


def by_svid(visibility):
    return {satellite.svid: satellite for satellite in visibility.satellites}
