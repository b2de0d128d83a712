"""occlusion_experiment end to end: a short drive, the tables in its JSON."""
import json
import os
import subprocess
import tempfile
import unittest

PROGRAMS = os.environ.get("URBAN_GNSS_PROGRAMS", "")
PROGRAM = os.path.join(PROGRAMS, "occlusion_experiment")


@unittest.skipUnless(os.path.exists(PROGRAM), "no programs in URBAN_GNSS_PROGRAMS")
class OcclusionExperimentTest(unittest.TestCase):
    def run_tool(self, *arguments):
        return subprocess.run([PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              universal_newlines=True)

    def test_short_drive(self):
        with tempfile.TemporaryDirectory() as directory:
            files = [os.path.join(directory, name) for name in ("a.json", "b.json")]
            for file in files:
                done = self.run_tool("--scenarios", "building_pass", "--seeds", "1", "--duration", "30", "--json", file)
                self.assertEqual(done.returncode, 0, done.stdout)
                self.assertIn("Table II", done.stdout)
            with open(files[0]) as a, open(files[1]) as b:
                tables = json.load(a)["scenarios"]["building_pass"]
                self.assertEqual(tables, json.load(b)["scenarios"]["building_pass"], "the same seed, the same tables")
        for model in ("paper", "soft", "paper_as_printed"):
            table = tables["classification"][model]
            total = sum(table[name] for name in ("good_called_good", "good_called_bad", "bad_called_good",
                                                 "bad_called_bad"))
            self.assertGreater(total, 100)
            right = table["good_called_good"] + table["bad_called_bad"]
            self.assertAlmostEqual(table["correct"], right / total)
            # The car park is open: nearly all fixes are good, and a map is there soon.
            self.assertGreater(table["correct"], 0.8)
            self.assertGreater(table["with_map"], 0.5)
        self.assertEqual(set(tables["trajectory"]), {"odometry", "conventional", "paper", "soft",
                                                     "conventional_as_printed", "paper_as_printed"})
        # 3.75 m for a range in their setting, 1.2 m in ours: a fix's covariance is that much larger.
        nees = tables["fix_nees"]
        self.assertAlmostEqual(nees["conventional"]["mean"] / nees["conventional_as_printed"]["mean"],
                               (3.75 / 1.2)**2)

    def test_parameters_of_both_settings(self):
        """--set changes our setting and theirs; --ukf-set has no effect on what is as printed, but for what is open."""
        def tables_with(*arguments):
            with tempfile.TemporaryDirectory() as directory:
                file = os.path.join(directory, "a.json")
                done = self.run_tool("--scenarios", "building_pass", "--seeds", "1", "--duration", "20", "--json", file,
                                     *arguments)
                self.assertEqual(done.returncode, 0, done.stdout)
                with open(file) as stream:
                    return json.load(stream)["scenarios"]["building_pass"]
        plain = tables_with()
        tables = tables_with("--set", "sigma_ure=2.4", "--ukf-set", "expert.odometry.motion_noise_factor=1.0")
        self.assertAlmostEqual(plain["fix_nees"]["conventional"]["mean"],
                               4.0 * tables["fix_nees"]["conventional"]["mean"])
        self.assertAlmostEqual(tables["fix_nees"]["conventional"]["mean"],
                               tables["fix_nees"]["conventional_as_printed"]["mean"])
        self.assertNotEqual(plain["trajectory"]["conventional"], tables["trajectory"]["conventional"])
        tables = tables_with("--ukf-set", "outliers=gate")
        self.assertEqual(plain["trajectory"]["conventional_as_printed"],
                         tables["trajectory"]["conventional_as_printed"])

    def test_refuses(self):
        self.assertNotEqual(self.run_tool("--scenarios", "nowhere", "--seeds", "1").returncode, 0)
        done = self.run_tool("--scenarios", "open_sky", "--seeds", "1", "--set", "sigma_urre=1")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("sigma_urre", done.stdout)


if __name__ == "__main__":
    unittest.main()
