"""A synthetic drive, and a driver that feeds it to the live graph message by message.

The driver publishes one odometry message or fix at a time and waits for what the graph answers, so that a test does not
depend on the speed of the machine: no sleeping, no message that overtakes another.
"""
import math
import random
import threading
import time

import rospy
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix, NavSatStatus
from urban_gnss_localization.msg import GpsBias, LocalizationStatus

DATUM = (48.1374, 11.5755, 520.0)
START = (0.0, -40.0, 0.0)
ODOM_RATE_HZ = 20
FIX_EVERY = 10
SPEED = 5.0
RADIUS = 40.0
EARTH_RADIUS = 6378137.0
ECCENTRICITY_2 = 6.69437999014e-3


def to_geodetic(east, north):
    """Latitude and longitude (deg) of a point within some hundred metres of the datum; exact to centimetres."""
    latitude = math.radians(DATUM[0])
    w2 = 1.0 - ECCENTRICITY_2 * math.sin(latitude) ** 2
    meridian = EARTH_RADIUS * (1.0 - ECCENTRICITY_2) / w2 ** 1.5 + DATUM[2]
    parallel = (EARTH_RADIUS / math.sqrt(w2) + DATUM[2]) * math.cos(latitude)
    return DATUM[0] + math.degrees(north / meridian), DATUM[1] + math.degrees(east / parallel)


def yaw_of(orientation):
    return 2.0 * math.atan2(orientation.z, orientation.w)


class Drive:
    """Rounds on a circle of RADIUS, with a fix of 1 m that a reflection biases by 8 m for a quarter of the time."""

    def __init__(self, seconds=60.0, start_time=1000.0, seed=1):
        noise = random.Random(seed)
        yaw_rate = SPEED / RADIUS
        self.messages = []  # (topic, message), in the order of the stamps
        self.truth = {}     # stamp in ns -> (x, y, yaw)
        for k in range(int(seconds * ODOM_RATE_HZ) + 1):
            t = k / ODOM_RATE_HZ
            stamp = rospy.Time.from_sec(start_time + t)
            turned = yaw_rate * t
            x, y = RADIUS * math.sin(turned), -RADIUS * math.cos(turned)
            self.truth[stamp.to_nsec()] = (x, y, turned)
            odom = make_odometry(stamp, turned, noise)
            self.messages.append(("odom", odom))
            if k % FIX_EVERY == 0 and k > 0:
                bias = 8.0 if 0.4 * seconds < t < 0.65 * seconds else 0.0
                self.messages.append(("gps/fix", make_fix(stamp, x + bias + noise.gauss(0, 1.0),
                                                          y + noise.gauss(0, 1.0))))


def make_odometry(stamp, turned, noise):
    """Of a robot that has turned by that many radians on its circle."""
    odom = Odometry()
    odom.header.stamp = stamp
    odom.header.frame_id = "odom"
    odom.child_frame_id = "base_link"
    odom.pose.pose.position.x = RADIUS * math.sin(turned)
    odom.pose.pose.position.y = RADIUS * (1.0 - math.cos(turned))
    odom.pose.pose.orientation = Quaternion(0.0, 0.0, math.sin(turned / 2), math.cos(turned / 2))
    odom.twist.twist.linear.x = SPEED + noise.gauss(0.0, 0.05)
    odom.twist.twist.angular.z = SPEED / RADIUS + noise.gauss(0.0, 0.01)
    return odom


def make_fix(stamp, east, north):
    fix = NavSatFix()
    fix.header.stamp = stamp
    fix.header.frame_id = "base_link"
    fix.status.status = NavSatStatus.STATUS_FIX
    fix.latitude, fix.longitude = to_geodetic(east, north)
    fix.altitude = DATUM[2]
    fix.position_covariance = [1.0, 0, 0, 0, 1.0, 0, 0, 0, 4.0]
    fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    return fix


class Graph:
    """The live graph: publishes, waits for the answer, keeps what came back."""

    TIMEOUT_S = 5.0

    def __init__(self, status_topic="particle_filter/status", listeners=2):
        """`listeners`: how many nodes take odometry and fixes."""
        self.changed = threading.Condition()
        self.outputs = []
        self.biases = []
        self.status = None
        self.last_stamp = None
        self.publishers = {
            "odom": rospy.Publisher("odom", Odometry, queue_size=100, tcp_nodelay=True),
            "gps/fix": rospy.Publisher("gps/fix", NavSatFix, queue_size=100, tcp_nodelay=True),
        }
        rospy.Subscriber("odometry/filtered", Odometry, self._on_output, queue_size=1000, tcp_nodelay=True)
        rospy.Subscriber("gps/bias", GpsBias, self._on_bias, queue_size=1000, tcp_nodelay=True)
        rospy.Subscriber(status_topic, LocalizationStatus, self._on_status, queue_size=1000, tcp_nodelay=True)
        # The filter and the bias node take odometry and fixes; the bias node and this test take the estimate.
        self._await(lambda: all(p.get_num_connections() >= listeners for p in self.publishers.values()), 20.0,
                    "the nodes to subscribe")

    def _notify(self, action):
        with self.changed:
            action()
            self.changed.notify_all()

    def _on_output(self, message):
        self._notify(lambda: self.outputs.append(message))

    def _on_bias(self, message):
        self._notify(lambda: self.biases.append(message))

    def _on_status(self, message):
        self._notify(lambda: setattr(self, "status", message))

    def _await(self, condition, timeout, what):
        with self.changed:
            end = time.monotonic() + timeout
            while not condition():
                left = end - time.monotonic()
                if left <= 0.0:
                    raise AssertionError("waited %.0f s for %s" % (timeout, what))
                self.changed.wait(min(left, 0.05))

    def feed(self, messages, expect_answer=lambda topic, message: True):
        """Publishes each message and waits for its answer: an estimate at the odometry's stamp, a decision about the
        fix. `expect_answer` names the messages that get one. A clock that was set back is believed at the third
        message of odometry; the answers of the first come then. Returns the estimates."""
        first = len(self.outputs)
        was_set_back = self.last_stamp is not None and messages[0][1].header.stamp < self.last_stamp - rospy.Duration(1)
        for index, (topic, message) in enumerate(messages):
            self.publishers[topic].publish(message)
            if not expect_answer(topic, message) or (was_set_back and index < 2):
                continue
            stamp = self.last_stamp = message.header.stamp
            if topic == "odom":
                self._await(lambda: self.outputs and self.outputs[-1].header.stamp == stamp, self.TIMEOUT_S,
                            "the estimate at %s" % stamp)
            else:
                self._await(lambda: self.status is not None and self.status.last_fix.stamp == stamp, self.TIMEOUT_S,
                            "the decision about the fix at %s" % stamp)
        return self.outputs[first:]


def poses(outputs):
    return [(o.header.stamp.to_nsec(), o.pose.pose.position.x, o.pose.pose.position.y, yaw_of(o.pose.pose.orientation))
            for o in outputs]


def rmse(outputs, truth):
    squares = [(x - truth[stamp][0]) ** 2 + (y - truth[stamp][1]) ** 2 for stamp, x, y, _ in poses(outputs)]
    return math.sqrt(sum(squares) / len(squares))


def all_finite(outputs):
    return all(math.isfinite(value) for o in outputs
               for value in [o.pose.pose.position.x, o.pose.pose.position.y, yaw_of(o.pose.pose.orientation),
                             *o.pose.covariance, *o.twist.covariance])
