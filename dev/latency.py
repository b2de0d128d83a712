#!/usr/bin/env python3
"""How long a live localizer takes from a fix to the odometry/filtered that has it.

    dev/latency.py --localizer imm_ekf --seconds 30

On a master of its own: a robot drives straight ahead, with odometry at 50 Hz and fixes at 5 Hz. A fix goes out with the
stamp of the odometry that follows at once. Prints median, 99 % and largest time (ms) from sending to receiving: of fixes
and of the odometry between them, and, beside them, of a message of this program to itself, which is what rospy takes
alone, once for the way of each message.
"""
import argparse
import time

import fault_graph
import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix

SPEED_MPS = 2.0
RATE_HZ = 50
PER_FIX = 10
METRES_PER_DEGREE = 111320.0
WARM_UP_S = 15.0  # until the localizer has started


def odometry_at(stamp, x):
    message = Odometry()
    message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, "odom", "base_link"
    message.pose.pose.position.x, message.pose.pose.orientation.w = x, 1.0
    message.twist.twist.linear.x = SPEED_MPS
    return message


def fix_at(stamp, x):
    message = NavSatFix()
    message.header.stamp, message.header.frame_id = stamp, "gps"
    message.longitude = x / METRES_PER_DEGREE
    message.position_covariance = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0]
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_KNOWN
    return message


class Times:
    """When messages were sent, and how long each took (s), by what they are."""

    def __init__(self):
        self.sent, self.taken = {}, {}

    def send(self, publisher, message, kind):
        self.sent[kind.split()[0], message.header.stamp.to_nsec()] = (kind, time.perf_counter())
        publisher.publish(message)

    def receive(self, message, way):
        now = time.perf_counter()
        kind, sent = self.sent.pop((way, message.header.stamp.to_nsec()), (None, 0.0))
        if kind:
            self.taken.setdefault(kind, []).append(now - sent)

    def table(self):
        rows = ["%-28s %8s %8s %8s %8s" % ("ms", "median", "99 %", "largest", "count")]
        for kind, values in sorted(self.taken.items()):
            ordered = sorted(1e3 * value for value in values)
            rows.append("%-28s %8.2f %8.2f %8.2f %8d" % (kind, ordered[len(ordered) // 2],
                                                         ordered[int(0.99 * (len(ordered) - 1))], ordered[-1],
                                                         len(ordered)))
        return "\n".join(rows)


def drive(seconds, times):
    """Sends odometry and fixes for so long."""
    def end_of(topic, kind):
        return rospy.Publisher(topic, kind, queue_size=100, tcp_nodelay=True)

    odometry, fixes, own = end_of("odom", Odometry), end_of("gps/fix", NavSatFix), end_of("own", Odometry)
    subscribers = [rospy.Subscriber(topic, Odometry, times.receive, way, queue_size=100, tcp_nodelay=True)
                   for topic, way in (("odometry/filtered", "localizer:"), ("own", "rospy"))]
    ends = [odometry, fixes, own] + subscribers
    fault_graph.await_(lambda: all(end.get_num_connections() for end in ends), "the node")
    began = time.perf_counter()
    for step in range(int((WARM_UP_S + seconds) * RATE_HZ)):
        time.sleep(max(0.0, began + step / RATE_HZ - time.perf_counter()))
        if step == WARM_UP_S * RATE_HZ:
            times.taken.clear()
        stamp, x = rospy.Time.now(), SPEED_MPS * step / RATE_HZ
        kind = "localizer: odometry alone"
        if step % PER_FIX == 0:
            fixes.publish(fix_at(stamp, x))
            kind = "localizer: fix and odometry"
        times.send(odometry, odometry_at(stamp, x), kind)
        time.sleep(0.5 / RATE_HZ)
        times.send(own, odometry_at(stamp, x), "rospy alone")
    time.sleep(1.0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--localizer", default="imm_ekf")
    parser.add_argument("--seconds", type=float, default=30.0)
    options = parser.parse_args()
    master = fault_graph.Master()
    node = fault_graph.Node(options.localizer + "_node", "/localizer")
    try:
        rospy.init_node("latency", disable_signals=True)
        node.start(rospy)
        times = Times()
        drive(options.seconds, times)
        print(times.table())
    finally:
        node.end()
        master.close()


if __name__ == "__main__":
    main()
