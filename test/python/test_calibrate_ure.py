"""calibrate_ure end to end: what it refuses, and what it finds in simulated and recorded receivers.

URBAN_GNSS_PROGRAMS names the folder of the programs. Real recordings are taken from URBAN_GNSS_DATA; without it those
tests are skipped."""
import functools
import operator
import os
import re
import subprocess
import tempfile
import unittest

import yaml

import programs
from programs import PACKAGE, PROGRAMS

DATA = os.environ.get("URBAN_GNSS_DATA", os.path.join(PACKAGE, "..", "shared", "data"))
STATIC = os.path.join(DATA, "hk_tst_20200603_static")
STANDING = """
datum: [48.0, 11.0, 500.0]
start_time: 2026-05-04T09:00:00Z
duration: 900
imu: {rate: 0}
route: {speed: 1, waypoints: [[0, 0], {at: [1, 0], stop: 2000}, [2, 0]]}
"""


def run(program, *arguments):
    return programs.run(program, *arguments, stderr=subprocess.PIPE)


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class CalibrateUreTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        scenario = os.path.join(cls.scratch.name, "standing.yaml")
        with open(scenario, "w") as file:
            file.write(STANDING)
        cls.standing = os.path.join(cls.scratch.name, "standing.bag")
        cls.moving = os.path.join(cls.scratch.name, "moving.bag")
        for name, bag in ((scenario, cls.standing), ("building_pass", cls.moving)):
            done = run("simulate", "--scenario", name, "--without-lidar", "--output", bag)
            assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def succeed(self, *arguments):
        done = run("calibrate_ure", *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done

    def refuse(self, *arguments):
        done = run("calibrate_ure", *arguments)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertEqual(done.stdout, "")
        return done.stderr

    def test_its_yaml_has_the_parameters_of_the_occlusion_node(self):
        done = self.succeed(self.standing)
        found = yaml.safe_load(done.stdout)
        self.assertTrue(0.2 < found["sigma_ure"] < 6.0, done.stdout)
        covariance = found["expert"]["covariance"]
        # The simulated antenna: 43.4 dB-Hz at 37 degrees in the open, of which 1 % are some 4 dB weaker; 9 dB more at the
        # zenith than at the horizon.
        self.assertAlmostEqual(covariance["nlos_cn0"], 39.4, delta=2.0)
        self.assertAlmostEqual(covariance["nlos"]["nlos_cn0_rise"], 9.0, delta=3.0)
        with open(os.path.join(PACKAGE, "config", "occlusion.yaml")) as file:
            known = yaml.safe_load(file)
        self.assertLessEqual(set(found), set(known))
        self.assertLessEqual(set(covariance), set(known["expert"]["covariance"]))
        self.assertLessEqual(set(covariance["nlos"]), set(known["expert"]["covariance"]["nlos"]))

    def test_the_file_is_what_would_be_on_standard_output(self):
        path = os.path.join(self.scratch.name, "new", "receiver.yaml")
        done = self.succeed(self.standing, "--yaml", path)
        self.assertEqual(done.stdout, "")
        with open(path) as file:
            by_file = yaml.safe_load(file)
        self.assertEqual(by_file, yaml.safe_load(self.succeed(self.standing).stdout))

    def test_a_receiver_that_moves_is_refused(self):
        self.assertIn("not stationary", self.refuse(self.moving))

    def test_a_topic_that_is_not_there_is_named(self):
        self.assertIn("0 lists of satellites", self.refuse(self.standing, "--satellites-topic", "nothing"))
        self.assertIn("--fix-topic", self.refuse(self.standing, "--fix-topic", "nothing"))
        self.assertIn("no such bag", self.refuse(os.path.join(self.scratch.name, "none.bag")))

    def test_too_few_fixes_are_refused(self):
        self.assertIn("at least 30 are needed", self.refuse(self.standing, "--duration", "4"))
        self.assertIn("an HDOP above", self.refuse(self.standing, "--max-hdop", "0.2"))

    def log_of(self, *sentences):
        """A file of NMEA sentences, each with its checksum."""
        path = os.path.join(self.scratch.name, "receiver.nmea")
        with open(path, "w") as file:
            for sentence in sentences:
                file.write("${}*{:02X}\r\n".format(sentence, functools.reduce(operator.xor, sentence.encode())))
        return path

    def test_a_log_that_says_nothing_of_the_receiver_is_refused(self):
        log = self.log_of(*["GPTXT,01,01,02,ANTSTATUS=OK"] * 20)
        self.assertIn("no fix", self.refuse("--nmea", log))

    def test_fixes_without_an_altitude_are_fixes(self):
        log = self.log_of(*["GPRMC,1200{:02d}.00,A,4807.038,N,01131.000,E,0.0,0.0,230320,,,A".format(second)
                            for second in range(50)])
        self.assertIn("satellites", self.refuse("--nmea", log))

    @unittest.skipUnless(os.path.isdir(STATIC), "no recording " + STATIC)
    def test_a_recorded_receiver(self):
        bag = os.path.join(self.scratch.name, "static.bag")
        self.assertEqual(run("csv_to_bag", STATIC, bag).returncode, 0)
        done = self.succeed(bag)
        self.assertIn("is the sky free?", done.stderr)  # it is not: Hong Kong
        self.assertIn("by 986 fixes", done.stderr)
        self.assertTrue(0.2 < yaml.safe_load(done.stdout)["sigma_ure"] < 60.0, done.stdout)
        self.assertTrue(re.search(r"C/N0 by \d+ signals", done.stderr), done.stderr)


if __name__ == "__main__":
    unittest.main()
