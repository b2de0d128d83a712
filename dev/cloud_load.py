#!/usr/bin/env python3
"""Whether occlusion_node keeps up with a lidar: clouds of a street canyon that a robot drives along, at a fixed rate.

    roslaunch urban_gnss_localization occlusion.launch &
    dev/cloud_load.py --points 120000 --rate 10 --seconds 30

Prints how many clouds were sent, how many the node has taken, put into its map and dropped, and its CPU time. The exit
status is 1 where clouds were lost without a word.
"""
import argparse
import os
import re
import sys
import time
import xmlrpc.client

import numpy
import rospy
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import NavSatFix, NavSatStatus, PointCloud2, PointField
from tf2_msgs.msg import TFMessage

LIDAR_HEIGHT_M = 2.0
SPEED_MPS = 5.0
FIX_PERIOD_S = 0.2
COUNTS = ("clouds received", "clouds in the map", "clouds dropped", "alignments tried", "alignments accepted")


def rays(count, generator):
    """Directions of a lidar's rays, 3 x count."""
    azimuth = generator.uniform(-numpy.pi, numpy.pi, count)
    elevation = generator.uniform(-0.3, 0.8, count)
    return numpy.stack([numpy.cos(elevation) * numpy.cos(azimuth), numpy.cos(elevation) * numpy.sin(azimuth),
                        numpy.sin(elevation)])


def street_points(directions, x):
    """What the rays meet from `x`: the ground, walls of 20 m at 10 m on either side, and every 15 m a pilaster that
    stands out by 2 m, so that scans can be aligned along the street. float32, count x 3; NaN where a ray meets
    nothing."""
    ahead = numpy.where(numpy.abs(directions[0]) < 1e-3, 1e-3, directions[0])
    across = numpy.maximum(numpy.abs(directions[1]), 1e-3)
    reach = numpy.minimum(10.0 / across, LIDAR_HEIGHT_M / numpy.maximum(-directions[2], 1e-3))
    beside = (x + ahead * 8.0 / across) / 15.0  # where the ray is as far out as the pilasters
    pilaster = 15.0 * numpy.where(ahead > 0.0, numpy.ceil(beside), numpy.floor(beside))
    reach = numpy.minimum(reach, (pilaster - x) / ahead)
    points = directions * reach
    points[:, (reach > 90.0) | (points[2] > 20.0)] = numpy.nan
    return points.T.astype(numpy.float32)


def to_cloud(points, stamp):
    message = PointCloud2(height=1, width=len(points), point_step=12, row_step=12 * len(points), is_dense=False)
    message.header.stamp, message.header.frame_id = stamp, "lidar"
    message.fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate("xyz")]
    message.data = points.tobytes()
    return message


def transform(parent, child, stamp, x=0.0, z=0.0):
    message = TransformStamped()
    message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, parent, child
    message.transform.translation.x, message.transform.translation.z = x, z
    message.transform.rotation.w = 1.0
    return message


def fix_at(stamp):
    fix = NavSatFix()
    fix.header.stamp, fix.header.frame_id = stamp, "gps"
    fix.status.status = NavSatStatus.STATUS_FIX
    fix.latitude, fix.longitude, fix.altitude = 48.1374, 11.5755, 520.0
    fix.position_covariance = [9.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 25.0]
    fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_KNOWN
    return fix


def cpu_seconds(pid):
    with open("/proc/%d/stat" % pid) as stream:
        fields = re.sub(r"^.*\) ", "", stream.read()).split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=120000)
    parser.add_argument("--rate", type=float, default=10.0, help="Hz")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--node", default="/occlusion")
    options = parser.parse_args()

    rospy.init_node("cloud_load")
    status = {}

    def on_diagnostics(message):
        for entry in message.status:
            if entry.name == options.node.strip("/") + ": occlusion":
                status.update({value.key: value.value for value in entry.values})

    rospy.Subscriber("/diagnostics", DiagnosticArray, on_diagnostics)
    clouds = rospy.Publisher("points", PointCloud2, queue_size=100)
    fixes = rospy.Publisher("gps/fix", NavSatFix, queue_size=10)
    tf = rospy.Publisher("tf", TFMessage, queue_size=100)
    static = tf2_ros.StaticTransformBroadcaster()
    zero = rospy.Time()
    static.sendTransform([transform("map", "odom", zero), transform("base_link", "lidar", zero, z=LIDAR_HEIGHT_M),
                          transform("base_link", "gps", zero, z=LIDAR_HEIGHT_M)])
    end = time.monotonic() + 20.0
    while clouds.get_num_connections() == 0 or not status:
        if time.monotonic() > end:
            sys.exit("no node %s takes clouds" % options.node)
        time.sleep(0.1)
    pid = xmlrpc.client.ServerProxy(rospy.get_master().lookupNode(options.node)[2]).getPid("/cloud_load")[2]

    before = {name: int(status[name]) for name in COUNTS}
    directions = rays(options.points, numpy.random.default_rng(1))
    began, cpu, sent, fixed, late = time.monotonic(), cpu_seconds(pid), 0, 0, 0
    while sent < options.rate * options.seconds and not rospy.is_shutdown():
        due = began + sent / options.rate
        late += time.monotonic() > due + 1.0 / options.rate
        time.sleep(max(0.0, due - time.monotonic()))
        stamp = rospy.Time.now()
        x = SPEED_MPS * sent / options.rate
        tf.publish(TFMessage([transform("odom", "base_link", stamp, x=x)]))
        clouds.publish(to_cloud(street_points(directions, x), stamp))
        if sent / options.rate >= fixed * FIX_PERIOD_S:
            fixes.publish(fix_at(stamp))
            fixed += 1
        sent += 1
    elapsed, cpu = time.monotonic() - began, cpu_seconds(pid) - cpu
    time.sleep(3.0)  # for the last diagnostics
    counts = {name: int(status[name]) - before[name] for name in COUNTS}
    lost = sent - counts["clouds in the map"] - counts["clouds dropped"]
    print("sent: %d clouds of %d points in %.1f s (%.1f Hz), %d of them late" % (sent, options.points, elapsed,
                                                                               sent / elapsed, late))
    for name in COUNTS:
        print("%s: %d" % (name, counts[name]))
    print("CPU time of the node: %.1f ms a cloud, %.0f %% of a core" % (1e3 * cpu / sent, 100.0 * cpu / elapsed))
    sys.exit("%d clouds neither in the map nor reported as dropped" % lost if lost > 0 else 0)


if __name__ == "__main__":
    main()
