"""The good streams of the live campaign, and the nodes that take them."""
import math
import os
import random
import sys
import tempfile

import rospy
from dynamic_reconfigure.msg import Config, StrParameter
from dynamic_reconfigure.srv import ReconfigureRequest
from geometry_msgs.msg import (Point, PoseWithCovarianceStamped, Twist, TwistStamped, TwistWithCovarianceStamped)
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, NavSatFix
from tf2_msgs.msg import TFMessage
from urban_gnss_localization import srv
from urban_gnss_localization.msg import GpsBias

import campaign
from fault_graph import Node

sys.path.insert(0, os.path.join(campaign.ROOT, "test", "ros"))
import drive  # noqa: E402
import street  # noqa: E402

START_S = 100000.0
TF_EVERY = 5
SECOND = "two/"  # namespace of the second of two nodelets


class Stream:
    """Messages of one moment after another. Stamps (`now`) may jump; the robot (`driven`) does not."""

    period = 1.0 / drive.ODOM_RATE_HZ
    steps = 5           # of a case
    warm_steps = 400
    simulated_time = False

    def __init__(self, name, seed):
        self.name = name
        self.noise = random.Random(seed)
        self.now, self.driven, self.index = START_S, 0.0, 0
        self.frame = "odom"

    def step(self):
        """[(topic, message)] of the next moment."""
        self.now += self.period
        self.driven += self.period
        self.index += 1
        clock = [("/clock", Clock(self.stamp()))] if self.simulated_time else []
        return clock + [(topic if topic.startswith("/") else self.name + "/" + topic, self.make(topic))
                        for topic in self.topics()]

    def stamp(self, later_s=0.0):
        return rospy.Time.from_sec(max(0.0, self.now + later_s))

    def topics(self):
        """That have a message now."""
        raise NotImplementedError

    def make(self, topic, later_s=0.0):
        """A good message of the topic, without the namespace, or of /tf, /tf_static, /clock."""
        make = {"odom": self.odometry, "gps/fix": self.fix, "imu/data": self.imu, "gps/velocity": self.velocity,
                "gps/satellites": street.make_satellites, "initialpose": self.pose, "gps/datum": self.datum,
                "gps/bias": self.bias, "odometry/filtered": self.estimate, "/tf": self.transform, "/clock": Clock,
                "/tf_static": self.static, "points": self.cloud, "cmd_vel": lambda stamp: Twist()}
        return make[topic](self.stamp(later_s))

    def turned(self):
        return self.driven * drive.SPEED / drive.RADIUS

    def truth(self):
        """x, y and yaw about drive.DATUM."""
        turned = self.turned()
        return drive.RADIUS * math.sin(turned), -drive.RADIUS * math.cos(turned), turned

    def odometry(self, stamp):
        return drive.make_odometry(stamp, self.turned(), self.noise)

    def fix(self, stamp):
        x, y, _ = self.truth()
        message = drive.make_fix(stamp, x + self.noise.gauss(0, 1.0), y + self.noise.gauss(0, 1.0))
        message.header.frame_id = "gps"
        return message

    def imu(self, stamp):
        message = Imu()
        message.header.stamp, message.header.frame_id = stamp, "imu"
        message.orientation.w = 1.0
        message.orientation_covariance[0] = -1.0
        message.angular_velocity.z = drive.SPEED / drive.RADIUS + self.noise.gauss(0, 0.005)
        message.linear_acceleration.z = 9.81
        return message

    def velocity(self, stamp):
        turned = self.turned()
        message = self.velocity_type()
        message.header.stamp = stamp
        twist = message.twist.twist if isinstance(message, TwistWithCovarianceStamped) else message.twist
        twist.linear.x = drive.SPEED * math.cos(turned) + self.noise.gauss(0, 0.1)
        twist.linear.y = drive.SPEED * math.sin(turned) + self.noise.gauss(0, 0.1)
        if isinstance(message, TwistWithCovarianceStamped):
            message.twist.covariance[0] = message.twist.covariance[7] = 0.01
        return message

    velocity_type = TwistWithCovarianceStamped

    def pose(self, stamp):
        x, y, yaw = self.truth()
        message = PoseWithCovarianceStamped()
        message.header.stamp, message.header.frame_id = stamp, "map"
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        for i in (0, 7, 35):
            message.pose.covariance[i] = 0.25
        return message

    def datum(self, stamp):
        message = NavSatFix()
        message.header.stamp, message.header.frame_id = stamp, "map"
        message.latitude, message.longitude, message.altitude = drive.DATUM
        return message

    def bias(self, stamp):
        message = GpsBias(radius=0.1)
        message.header.stamp, message.header.frame_id = stamp, "map"
        message.covariance = [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0]
        message.fix.stamp, message.fix.decision = stamp, 1
        return message

    def estimate(self, stamp):
        message = Odometry()
        message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, "map", "base_link"
        message.pose = self.pose(stamp).pose
        return message

    def transform(self, stamp):
        return TFMessage([street.to_transform(stamp, "odom", "base_link")])

    @staticmethod
    def static(_):
        zero = rospy.Time()
        return TFMessage([street.to_transform(zero, "base_link", child, height)
                          for child, height in (("gps", 1.0), ("imu", 0.5), ("lidar", street.LIDAR_HEIGHT_M))])

    @staticmethod
    def cloud(stamp):
        return street.to_cloud(stamp, street.wall(10.0, spacing=2.0))

    def requests(self):
        """{service's name, without the namespace: a good request}."""
        latitude, longitude, altitude = drive.DATUM
        return {"set_pose": srv.SetPoseRequest(self.pose(self.stamp())),
                "datum": srv.SetDatumRequest(latitude, longitude, altitude),
                "toLL": srv.ToLLRequest(Point(10.0, 20.0, 0.0)),
                "fromLL": srv.FromLLRequest(latitude, longitude, altitude),
                "toLLArray": srv.ToLLArrayRequest([Point(10.0, 20.0, 0.0), Point()]),
                "fromLLArray": srv.FromLLArrayRequest([latitude] * 2, [longitude] * 2, [altitude] * 2),
                "save_map": srv.SaveMapRequest(os.path.join(tempfile.gettempdir(), "fault_campaign.pcd"), True),
                "set_parameters": ReconfigureRequest(Config(strs=[StrParameter("mode", "compensated")]))}


class RobotStream(Stream):
    """All that a localizer takes."""

    def topics(self):
        due = ["odom", "imu/data"] + (["/tf"] if self.index % TF_EVERY == 0 else [])
        if self.index % drive.FIX_EVERY == 0:
            due += ["gps/velocity", "gps/satellites", "gps/fix"]
        return due


class PlainStream(RobotStream):
    """The same with velocities without a covariance."""

    velocity_type = TwistStamped


class StreetStream(Stream):
    """A robot that stands in a street, with a lidar."""

    period = street.PERIOD_S
    steps = 4
    warm_steps = 10

    def topics(self):
        return ["/tf", "odometry/filtered", "imu/data", "points", "gps/satellites", "gps/fix"]

    def fix(self, stamp):
        return street.make_fix(stamp)


class TwoStreetsStream(StreetStream):
    """The same for two, each on topics of its own."""

    def topics(self):
        own = [topic for topic in super().topics() if not topic.startswith("/")]
        return super().topics() + [SECOND + topic for topic in own]

    def make(self, topic, later_s=0.0):
        return super().make(topic[len(SECOND):] if topic.startswith(SECOND) else topic, later_s)


class EstimateStream(Stream):
    """What a controller takes."""

    steps = 5
    warm_steps = 20

    def topics(self):
        return ["odometry/filtered"] + (["gps/datum"] if self.index % 20 == 1 else [])


class ComparisonStream(Stream):
    """The truth and two estimates."""

    steps = 5
    warm_steps = 20

    def topics(self):
        return ["ground_truth/odom", "one/odometry/filtered", "two/odometry/filtered"]

    def make(self, topic, later_s=0.0):
        return super().make("odometry/filtered" if topic in self.topics() else topic, later_s)


class CommandStream(Stream):
    """What the simulated robot takes."""

    steps = 5
    warm_steps = 20

    def topics(self):
        return ["cmd_vel"]

    def make(self, topic, later_s=0.0):
        message = super().make(topic, later_s)
        if topic == "cmd_vel":
            message.linear.x, message.angular.z = 1.0, 0.1
        return message


class Rig:
    """Nodes that stand together on one stream, and the topics by which they answer it."""

    def __init__(self, name, stream, nodes, answers, commands=(), finds_place=False, only=None):
        self.name, self.stream_type, self.nodes = name, stream, nodes
        self.answers = answers          # {topic: "stamp", "late" (but the last), "count"}
        self.commands = set(commands)   # topics by which a user changes what the node knows
        self.finds_place = finds_place  # it has an estimate to be judged
        self.only = only                # kinds of cases, or all


def localizer(name, stream=RobotStream, parameters=None, others=(), only=None, rig=None):
    rig = rig or name
    nodes = [Node(name + "_node", "/%s/localizer" % rig, dict(parameters or {}, datum=list(drive.DATUM)))]
    return Rig(rig, stream, nodes + list(others), {"/%s/odometry/filtered" % rig: "stamp"},
               ("/%s/initialpose" % rig, "/%s/gps/datum" % rig, "/tf_static"), True, only)


def all_rigs():
    """In the order in which they are run: those with few cases first, who leave their time to the others."""
    class SimulatedRobot(RobotStream):
        simulated_time = True

    class SimulatedStreet(StreetStream):
        simulated_time = True

    class SimulatedEstimates(EstimateStream):
        simulated_time = True

    clock = ("clock", "stream")
    targets = {"geographic": [[48.15, 11.60], [48.16, 11.55]], "first_target": 0, "switch_distance": 20.0}

    def occlusion(name, stream, only=None):
        nodelet = Node("nodelet", "/%s/nodelet" % name, {"expert/sky_plot_size": 60},
                       ("standalone", "urban_gnss_localization/occlusion"), "nodelet",
                       {topic: "nodelet/" + topic for topic in ("gps/fix_weighted", "gps/visibility")})
        node = Node("occlusion_node", "/%s/node" % name, {"expert/sky_plot_size": 60})
        return Rig(name, stream, [node, nodelet],
                   {"/%s/%sgps/fix_weighted" % (name, space): "late" for space in ("", "nodelet/")}, ("/tf_static",),
                   only=only)

    def one_manager():
        """Two nodelets in one process. Loaders without a bond: their nodelets are the manager's, and have no topics
        beside their own. They are not ended, as nobody would load the nodelets anew."""
        manager = "/one_manager/manager"
        load = ("load", "urban_gnss_localization/occlusion", manager, "--no-bond")
        loaders = [Node("nodelet", "/one_manager/%sloader" % space, {"expert/sky_plot_size": 60}, load, "nodelet")
                   for space in ("", SECOND)]
        return Rig("one_manager", TwoStreetsStream,
                   [Node("nodelet", manager, arguments=("manager",), package="nodelet")] + loaders,
                   {"/one_manager/%sgps/fix_weighted" % space: "late" for space in ("", SECOND)}, ("/tf_static",),
                   only=("field", "stream", "service"))

    def controller(name, stream, only=None):
        return Rig(name, stream, [Node("waypoint_controller_node", "/%s/controller" % name, targets)],
                   {"/%s/cmd_vel" % name: "count"}, ("/%s/gps/datum" % name,), only=only)

    return [
        controller("controller", EstimateStream),
        Rig("comparison", ComparisonStream,
            [Node("comparison_node", "/comparison/comparison", {"localizers": "one two", "plot_rate": 20.0})],
            {"/comparison/error_plot": "stamp"}),
        Rig("simulator", CommandStream,
            [Node("simulator_node", "/simulator/simulator", {"real_time_factor": 10.0, "expert/publish_clock": False})],
            {"/simulator/odom": "count"}),
        localizer("imm_ekf", SimulatedRobot, only=clock, rig="imm_ekf_sim_time"),
        occlusion("occlusion_sim_time", SimulatedStreet, clock),
        controller("controller_sim_time", SimulatedEstimates, clock),
        localizer("imm_ekf"),
        localizer("particle_filter", parameters={"expert/particle_count": 200, "expert/particle_cloud_rate": 1.0},
                  others=[Node("gps_bias_node", "/particle_filter/gps_bias", {"localizer": "localizer"})]),
        occlusion("occlusion", StreetStream),
        one_manager(),
        localizer("complementary_ekf", PlainStream),
        localizer("ukf"),
        localizer("switching_particle_filter", parameters={"expert/particle_cloud_rate": 1.0}),
    ]
