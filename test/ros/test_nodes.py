#!/usr/bin/env python3
"""Each node by itself: bad parameters stop it with every fault listed; an interrupt ends it cleanly; it says what it
waits for."""
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import rospy
import rostest
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

NODES = {
    "particle_filter_node": (["_expert/ring_share:=2.0", "_expert/particle_count:=0", "_modus:=paper", "_mode:=papers"],
                             ["ring_share = 2", "particle_count = 0", "did you mean mode?", "literal, paper, conventional"]),
    "switching_particle_filter_node": (["_expert/merge_distance:=-1.0", "_seed:=2", "_expert/ranges/range_sigma_min:=9.0"],
                                       ["merge_distance = -1", "seed: no such parameter; it is expert.seed",
                                        "range_sigma_min"]),
    "imm_ekf_node": (["_expert/bias/jump_share:=2.0", "_mode:=switching", "_fast_bias_time:=1.0"],
                     ["jump_share = 2", "mode: no such parameter", "it is expert.bias.fast_bias_time"]),
    "ukf_node": (["_outliers:=all", "_expert/ukf_alpha:=0.0"], ["student_t, gate, none", "ukf_alpha = 0"]),
    "gps_bias_node": (["_expert/bias_filter/shadow_sigma:=-1.0", "_expert/bias_filter/bias_input:=residuals", "_gate:=0.5"],
                      ["shadow_sigma = -1", "residual, position", "gate: no such parameter"]),
    "occlusion_node": (["_expert/voxels/voxel_size:=-1.0", "_model:=best", "_modell:=soft"],
                       ["voxel_size = -1", "conventional, paper, soft", "did you mean model?"]),
    "comparison_node": (["_window:=0.0", "_plot_width:=9", "_localizer:=ukf"],
                        ["window = 0", "plot_width = 9", "did you mean localizers?"]),
    "simulator_node": (["_expert/target_count:=1", "_expert/interval:=0.0", "_datum:=[95.0, 0.0, 0.0]"],
                       ["target_count = 1", "interval = 0", "datum"]),
    "gpsd_node": (["_port:=0", "_hots:=robot", "_stamps:=gps", "_expert/settle_time:=9.0"],
                  ["port = 0", "did you mean host?", "arrival, utc", "settle_time = 9"]),
    "waypoint_controller_node": (["_speed:=fast", "_targets:=[1.0, 2.0, 3.0]"],
                                 ["speed = fast: must be a number", "targets"]),
}


# Of each node that waits for something: arguments, and what it says.
WAITING = {
    "particle_filter_node": ([], "waiting for odometry"),
    "gps_bias_node": ([], "waiting for"),
    "occlusion_node": ([], "waiting for fixes"),
    "waypoint_controller_node": (["_targets:=[1.0, 2.0]"], "waiting for an estimate"),
    "comparison_node": ([], "waiting for the truth"),
    "receiver_node": (["_receiver:=ublox"], "no message of the receiver"),
    "gpsd_node": (["_port:=1"], "no gpsd at"),
}


def command(node, *arguments):
    return ["rosrun", "urban_gnss_localization", node, "__name:=tested_" + node, *arguments]


class NodesTest(unittest.TestCase):
    def test_bad_parameters_stop_the_node_with_all_faults(self):
        for node, (parameters, faults) in NODES.items():
            with self.subTest(node=node):
                done = subprocess.run(command(node, *parameters), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                      universal_newlines=True, timeout=30)
                self.assertEqual(done.returncode, 1, done.stdout)
                for fault in faults:
                    self.assertIn(fault, done.stdout)
                rospy.delete_param("tested_" + node)

    def test_bad_scenario_stops_the_simulator_with_all_faults(self):
        def refuse(*arguments):
            done = subprocess.run(command("simulator_node", "_field:=city", *arguments), stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, universal_newlines=True, timeout=30)
            self.assertEqual(done.returncode, 1, done.stdout)
            rospy.delete_param("tested_simulator_node")
            return done.stdout

        with tempfile.TemporaryDirectory() as directory:
            scenario = os.path.join(directory, "bad.yaml")
            with open(scenario, "w") as file:
                file.write("receiver: {rate: 99}\n"
                           "buildings:\n"
                           "  - {name: bank, box: {center: [0, 0], size: [9, 9]}, roof: 5}\n"
                           "route: {waypoints: [[0, 0], [50, 0]], sped: 3}\n")
            output = refuse("_scenario:=" + scenario)
            for fault in ("bad.yaml:1: receiver.rate = 99", "start (0, 0) is inside bank",
                          "bad.yaml:4: route.sped: no such parameter; did you mean speed?"):
                self.assertIn(fault, output)
            self.assertIn("absent.yaml: no such file", refuse("_scenario:=" + os.path.join(directory, "absent.yaml")))
        self.assertIn("scenario: a city needs the file of a scenario", refuse())
        self.assertIn("did you mean follow_route?", refuse("_scenario:=x", "_follow_rout:=true"))

    def test_geographic_and_map_targets_do_not_mix(self):
        rospy.set_param("tested_waypoint_controller_node", {"targets": [1.0, 2.0], "geographic": [[48.1, 11.5]]})
        done = subprocess.run(command("waypoint_controller_node"), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              universal_newlines=True, timeout=30)
        rospy.delete_param("tested_waypoint_controller_node")
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIn("give all as targets or all as geographic", done.stdout)

    def test_interrupt_ends_the_node_cleanly(self):
        for node in NODES:
            with self.subTest(node=node):
                process = subprocess.Popen(command(node, "_expert/publish_clock:=false") if node == "simulator_node"
                                           else command(node), start_new_session=True, stdout=subprocess.PIPE,
                                           stderr=subprocess.STDOUT, universal_newlines=True)
                self.addCleanup(process.kill)
                deadline = rospy.Time.now() + rospy.Duration(20.0)
                while "/tested_" + node not in self.node_names():
                    self.assertLess(rospy.Time.now(), deadline, node + " did not come up")
                os.killpg(process.pid, signal.SIGINT)
                output, _ = process.communicate(timeout=15)
                self.assertEqual(process.returncode, 0, output)
                for word in ("Segmentation", "terminate called", "FATAL"):
                    self.assertNotIn(word, output)

    @staticmethod
    def node_names():
        publishers, subscribers, _ = rospy.get_master().getSystemState()[2]
        return {name for _, names in publishers + subscribers for name in names}

    def test_says_what_it_waits_for(self):
        """Every node that waits, within some seconds, without any input."""
        processes = {}
        for node, (arguments, _) in WAITING.items():
            processes[node] = subprocess.Popen(command(node, *arguments), start_new_session=True,
                                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                               universal_newlines=True)
            self.addCleanup(os.killpg, processes[node].pid, signal.SIGKILL)
            too_late = threading.Timer(60.0, os.killpg, (processes[node].pid, signal.SIGKILL))
            too_late.start()
            self.addCleanup(too_late.cancel)
        for node, (_, awaited) in WAITING.items():
            with self.subTest(node=node):
                self.assertTrue(any(awaited in line for line in processes[node].stdout), "it ended without a word")

    def test_the_simulated_robot_stays_where_an_absurd_command_finds_it(self):
        odometry = []
        rospy.Subscriber("odom", Odometry, odometry.append, queue_size=1000)
        publisher = rospy.Publisher("cmd_vel", Twist, queue_size=10)
        process = subprocess.Popen(command("simulator_node", "_expert/publish_clock:=false",
                                           "_expert/wait_for_command:=false"), start_new_session=True)
        self.addCleanup(os.killpg, process.pid, signal.SIGKILL)
        deadline = time.monotonic() + 20.0
        while not odometry or not publisher.get_num_connections():
            self.assertLess(time.monotonic(), deadline, "no odometry")
            time.sleep(0.05)
        for value in (sys.float_info.max, -1e300, 1e4, math.inf, math.nan):
            for odd in (Twist(linear=Vector3(x=value)), Twist(angular=Vector3(z=value))):
                publisher.publish(odd)
                seen = len(odometry)
                while len(odometry) < seen + 4:
                    self.assertLess(time.monotonic(), deadline, "no odometry after %g" % value)
                    time.sleep(0.01)
                for message in odometry[seen:]:
                    numbers = (message.pose.pose.position.x, message.pose.pose.position.y, message.twist.twist.linear.x,
                               *message.pose.covariance, *message.twist.covariance)
                    self.assertTrue(all(math.isfinite(number) and abs(number) < 1e7 for number in numbers), value)


if __name__ == "__main__":
    rospy.init_node("test_nodes")
    rostest.rosrun("urban_gnss_localization", "test_nodes", NodesTest)
