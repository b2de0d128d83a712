"""What dev/soak.py makes of memory and arrivals, and a short run of it.

URBAN_GNSS_PROGRAMS names the folder of the programs."""
import json
import os
import subprocess
import sys
import tempfile
import types
import unittest
from unittest import mock

import test_tools

DEV = os.path.join(test_tools.PACKAGE, "dev")
sys.path.insert(0, DEV)
import soak  # noqa: E402

SECONDS = 8


def stamped(seconds):
    stamp = types.SimpleNamespace(to_nsec=lambda: int(seconds * 1e9))
    return types.SimpleNamespace(header=types.SimpleNamespace(stamp=stamp), last_fix=types.SimpleNamespace(stamp=stamp))


class SoakTest(unittest.TestCase):
    def test_summary_and_slope(self):
        self.assertEqual(soak.summary(range(1000, 0, -1)), {"count": 1000, "median": 501, "p99": 991, "max": 1000})
        self.assertEqual(soak.summary([])["count"], 0)
        self.assertAlmostEqual(soak.slope([(x, 7.0 + 0.5 * x) for x in range(10)]), 0.5)
        self.assertEqual(soak.slope([(1.0, 3.0)]), 0.0)

    def test_what_a_decision_waited_for(self):
        delays = soak.Delays()
        arrivals = [(0.0, delays.on_odometry, 1.0), (0.1, delays.on_estimate, 1.0), (0.2, delays.on_fix, 1.05),
                    (0.3, delays.on_odometry, 1.1), (0.7, delays.on_satellites, 1.05), (1.5, delays.on_weighted, 1.05),
                    (3.1, delays.on_status, 1.05), (3.2, delays.on_status, 1.05)]
        for time_s, take, stamp_s in arrivals:
            with mock.patch("time.monotonic", lambda time_s=time_s: time_s):
                take(stamped(stamp_s))
        report = delays.report()
        self.assertEqual(report["fix to decision"]["count"], 1)
        self.assertAlmostEqual(report["fix to decision"]["max"], 2900.0)
        self.assertAlmostEqual(report["odometry to estimate"]["max"], 100.0)
        self.assertAlmostEqual(report["odometry to estimate"]["deadline"], 100.0)
        for part, expected_ms in zip(soak.PARTS, (100.0, 400.0, 800.0, 1600.0)):
            self.assertAlmostEqual(report["waits"][part], expected_ms, msg=part)

    def test_memory_that_grows_and_nodes_that_end_are_faults(self):
        report = {"wall_s": 3600.0, "ended": {}, "nodes": {"ukf_node": {"slope_mb_per_h": 30.0}}}
        self.assertEqual(soak.faults_of(report, 10.0), ["the memory of ukf_node grows by 30.0 MB an hour"])
        self.assertEqual(soak.faults_of(dict(report, wall_s=60.0), 10.0), [], "too short to tell")
        self.assertEqual(soak.faults_of(dict(report, ended={"ukf_node": "signal SIGSEGV"}), 50.0),
                         ["ukf_node has ended: signal SIGSEGV"])

    @unittest.skipUnless(test_tools.PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
    def test_a_short_run(self):
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "soak.json")
            done = subprocess.run([sys.executable, "-B", os.path.join(DEV, "soak.py"), "--seconds", str(SECONDS),
                                   "--json", file], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  universal_newlines=True, timeout=240.0, check=False)
            self.assertEqual(done.returncode, 0, done.stdout)
            with open(file) as stream:
                report = json.load(stream)
        self.assertEqual(set(report["nodes"]), {"simulator_node", "occlusion_node", "imm_ekf_node"})
        for node in report["nodes"].values():
            self.assertGreater(node["last_mb"], 5.0)
        for name in ("odometry to estimate", "fix to decision"):
            self.assertGreater(report["delays_ms"][name]["count"], SECONDS)


if __name__ == "__main__":
    unittest.main()
