"""localizer_experiment end to end: a short drive, its JSON."""
import json
import os
import subprocess
import tempfile
import unittest

PROGRAM = os.path.join(os.environ.get("URBAN_GNSS_PROGRAMS", ""), "localizer_experiment")


@unittest.skipUnless(os.path.exists(PROGRAM), "no programs in URBAN_GNSS_PROGRAMS")
class LocalizerExperimentTest(unittest.TestCase):
    def run_tool(self, *arguments):
        return subprocess.run([PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              universal_newlines=True)

    def test_short_drive(self):
        localizers = "paper,gated_ekf,ukf,ukf+occlusion"
        results = []
        with tempfile.TemporaryDirectory() as directory:
            for jobs in ("1", "2"):
                file = os.path.join(directory, jobs + ".json")
                done = self.run_tool("--scenarios", "building_pass", "--localizers", localizers, "--seeds", "2",
                                     "--duration", "40", "--jobs", jobs, "--json", file)
                self.assertEqual(done.returncode, 0, done.stdout)
                with open(file) as stream:
                    results.append(json.load(stream)["scenarios"])
        self.assertEqual(results[0], results[1], "threads change nothing")
        drive = results[0]["building_pass"]
        self.assertEqual(set(drive), set(localizers.split(",")))
        for name, summary in drive.items():
            self.assertEqual(len(summary["rmse_by_seed_m"]), 2, name)
            self.assertLess(summary["rmse_m"], 10.0, name)  # the car park is open
            self.assertGreater(summary["coverage"], 0.5, name)
            self.assertEqual(summary["diverged"], 0, name)

    def test_set_reaches_the_localizer(self):
        with tempfile.TemporaryDirectory() as directory:
            errors = []
            for sigma in ("0.0", "0.5"):
                file = os.path.join(directory, sigma)
                done = self.run_tool("--scenarios", "open_sky", "--localizers", "ukf", "--seeds", "1", "--duration",
                                     "30", "--set", "ukf.speed_scale_sigma=" + sigma, "--json", file)
                self.assertEqual(done.returncode, 0, done.stdout)
                with open(file) as stream:
                    errors.append(json.load(stream)["scenarios"]["open_sky"]["ukf"]["rmse_m"])
            self.assertNotEqual(*errors)

    def test_faults(self):
        with tempfile.TemporaryDirectory() as directory:
            file = os.path.join(directory, "faults.json")
            done = self.run_tool("--faults", "--scenarios", "open_sky", "--localizers", "ukf", "--seeds", "1",
                                 "--duration", "45", "--fault-onset", "30", "--json", file)
            self.assertEqual(done.returncode, 0, done.stdout)
            with open(file) as stream:
                faults = json.load(stream)["scenarios"]["open_sky"]
        self.assertRegex(done.stdout, r"(?m)^dead_encoder +ukf ")
        self.assertLess(faults["none"]["ukf"]["worst_m"], 5.0)
        self.assertGreater(faults["pose_30m_off"]["ukf"]["worst_m"], 25.0)
        self.assertEqual(len(faults["pose_30m_off"]["ukf"]["by_seed"]), 1)

    def test_as_printed(self):
        """The UKF of Maier and Kleiner, and their occlusion in front of it, by name and one parameter."""
        names = ["ukf", "ukf_as_printed", "ukf_as_printed+occlusion"]
        with tempfile.TemporaryDirectory() as directory:
            file = os.path.join(directory, "a.json")
            done = self.run_tool("--scenarios", "building_pass", "--localizers", ",".join(names), "--seeds", "1",
                                 "--duration", "25", "--set", "occlusion.mode=as_printed", "--json", file)
            self.assertEqual(done.returncode, 0, done.stdout)
            with open(file) as stream:
                errors = json.load(stream)["scenarios"]["building_pass"]
        self.assertEqual(len({errors[name]["rmse_m"] for name in names}), 3, errors)

    def test_refuses(self):
        for arguments, text in ((("--localizers", "kalman"), "kalman"), (("--set", "ukf.student_dov=1"), "student_dov"),
                                (("--set", "kalman.gain=1"), "SECTION"), (("--set", "gain=1"), "SECTION"),
                                (("--scenarios", "nowhere"), "nowhere")):
            done = self.run_tool("--scenarios", "open_sky", "--seeds", "1", "--duration", "5", *arguments)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertIn(text, done.stdout)


if __name__ == "__main__":
    unittest.main()
