#!/usr/bin/env python3
"""The live complementary_ekf_node: gps/bias with covariance and decision, the mode changed while it runs, bad parameters,
a clock that jumps back."""
import math
import os
import subprocess
import sys
import unittest

import dynamic_reconfigure.client
import rospy
import rostest
from std_srvs.srv import Empty
from urban_gnss_localization.msg import FixDecision

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import drive  # noqa: E402

BIAS_M = 8.0  # of the drive's fixes, for a quarter of the time


class ComplementaryEkfTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.graph = drive.Graph("complementary_ekf/status", listeners=1)
        cls.drive = drive.Drive()
        cls.client = dynamic_reconfigure.client.Client("complementary_ekf", timeout=20.0)
        cls.started_with = cls.client.get_configuration()["mode"]

    def run_in(self, mode):
        """Drives once more; gives the estimates and what gps/bias said."""
        self.assertEqual(self.client.update_configuration({"mode": mode})["mode"], mode)
        rospy.ServiceProxy("complementary_ekf/reset", Empty)()
        first = len(self.graph.biases)
        outputs = self.graph.feed(self.drive.messages)
        fixes = sum(topic == "gps/fix" for topic, _ in self.drive.messages)
        # A bias goes out with the next estimate; none follows the last fix.
        self.graph._await(lambda: len(self.graph.biases) >= first + fixes - 1, 5.0, "a bias for each fix")
        return outputs, self.graph.biases[first:]

    def test_reconfigure_starts_from_the_parameter(self):
        self.assertEqual(self.started_with, "gated")

    def test_mode_is_changed_live(self):
        errors = {}
        for mode in ("standard", "gated", "compensated", "standard_as_printed", "gated_as_printed",
                     "compensated_as_printed"):
            outputs, biases = self.run_in(mode)
            decisions = [bias.fix.decision for bias in biases]
            errors[mode] = drive.rmse(outputs, self.drive.truth)
            self.assertEqual(self.graph.status.mode, mode)
            self.assertEqual(FixDecision.REJECTED_GATE in decisions, mode.startswith("gated"), mode)
            self.assertEqual(FixDecision.BIAS_COMPENSATED in decisions, mode.startswith("compensated"), mode)
            self.assertEqual({bias.fix.nis_threshold for bias in biases if bias.fix.nis_threshold > 0.0} == {7.81},
                             mode.endswith("as_printed"), mode)
        self.assertLess(errors["compensated"], errors["standard"])
        self.assertLess(errors["compensated_as_printed"], errors["standard_as_printed"])

    def test_bias_is_published_with_its_covariance(self):
        _, biases = self.run_in("compensated")
        start = self.drive.messages[0][1].header.stamp.to_sec()
        inside = [b for b in biases if 30.0 < b.header.stamp.to_sec() - start < 38.0]
        after = [b for b in biases if b.header.stamp.to_sec() - start > 55.0]
        self.assertTrue(inside and after)
        for bias in inside:
            self.assertEqual(bias.header.frame_id, "map")
            sigma = math.sqrt(bias.covariance[0])
            self.assertTrue(0.1 < sigma < 5.0, sigma)
            self.assertLess(abs(bias.bias.x - BIAS_M), 4.0 * sigma)
            self.assertAlmostEqual(bias.radius, math.hypot(bias.bias.x, bias.bias.y))
        # It is only three of its standard deviations; a single fix may say otherwise.
        self.assertGreater(sum(bias.in_shadow for bias in inside), 0.8 * len(inside))
        self.assertFalse(any(bias.in_shadow for bias in after))

    def test_status_tells_the_bias(self):
        self.run_in("standard")
        self.assertEqual(self.graph.status.bias_radius, 0.0)

    def test_unknown_mode_is_refused(self):
        self.client.update_configuration({"mode": "standard"})
        self.assertEqual(self.client.update_configuration({"mode": "bold"})["mode"], "standard")

    def test_clock_that_jumps_back_resets_everything(self):
        """The clock jumps back, the graph starts anew and does the same again."""
        first, _ = self.run_in("compensated")
        second = self.graph.feed(self.drive.messages)
        worst = max(math.hypot(a[1] - b[1], a[2] - b[2]) for a, b in zip(drive.poses(first), drive.poses(second)))
        self.assertEqual(len(first), len(second))
        self.assertLess(worst, 1e-6)

    def test_bad_parameters_stop_the_node_with_all_faults(self):
        done = subprocess.run(["rosrun", "urban_gnss_localization", "complementary_ekf_node", "__name:=tested", "_mode:=bold",
                               "_expert/detector/gate_probability:=1.5", "_expert/close_coun:=3"], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, universal_newlines=True, timeout=30)
        self.assertEqual(done.returncode, 1, done.stdout)
        for fault in ("standard, gated, compensated", "gate_probability = 1.5", "did you mean expert.close_count?"):
            self.assertIn(fault, done.stdout)
        rospy.delete_param("tested")


if __name__ == "__main__":
    rospy.init_node("test_complementary_ekf")
    rostest.rosrun("urban_gnss_localization", "test_complementary_ekf", ComplementaryEkfTest)
