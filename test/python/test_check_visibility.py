"""The program check_visibility: a wall of points whose verdicts are known, and the recorded city blocks.

URBAN_GNSS_PROGRAMS names the folder of the programs. Real recordings are taken from URBAN_GNSS_DATA; without it those
tests are skipped."""
import json
import math
import os
import subprocess
import tempfile
import unittest

PROGRAMS = os.environ.get("URBAN_GNSS_PROGRAMS", "")
PACKAGE = os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", ".."))
DATA = os.environ.get("URBAN_GNSS_DATA", os.path.join(PACKAGE, "..", "shared", "data"))


def write_wall(path):
    """North of the origin, 20 m away, 60 m wide and 20 m high, a point each 1 m."""
    points = ["%d 20 %d" % (x, z) for x in range(-30, 31) for z in range(0, 21)]
    with open(path, "w") as file:
        file.write("# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH %d\nHEIGHT 1\n"
                   "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS %d\nDATA ascii\n%s\n" % (len(points), len(points), "\n".join(points)))


def write_table(path, labels=True):
    """All round the compass; the wall's roof is seen at 45 degrees due north."""
    rows = []
    for azimuth in range(0, 360, 5):
        for elevation in range(5, 90, 8):
            az, el = math.radians(azimuth), math.radians(elevation)
            mask = 0.0
            if math.cos(az) > 0.0 and 20.0 * abs(math.tan(az)) <= 30.0:
                mask = math.atan2(20.0, 20.0 / math.cos(az))
            rows.append("100,0,0,0,G01,%.6f,%.6f,%.6f,%d,%s,1,40" % (az, el, mask, el < mask, "1" if labels else ""))
    with open(path, "w") as file:
        file.write("stamp,x,y,z,sat,az,el,mask_el,blocked_by_model,label_nlos,received,cn0\n" + "\n".join(rows) + "\n")
    return len(rows)


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class CheckVisibilityTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = scratch.name
        self.map, self.table = self.path("wall.pcd"), self.path("table.csv")
        write_wall(self.map)
        self.rows = write_table(self.table)

    def path(self, name):
        return os.path.join(self.directory, name)

    def run_tool(self, *arguments):
        return subprocess.run([os.path.join(PROGRAMS, "check_visibility"), *map(str, arguments)], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, universal_newlines=True, timeout=300)

    def check(self, map_path, table, *arguments):
        done = self.run_tool("--map", map_path, "--table", table, "--json", self.path("out.json"), *arguments)
        self.assertEqual(done.returncode, 0, done.stdout)
        with open(self.path("out.json")) as file:
            return json.load(file)

    def test_points_that_are_too_close_are_refused_by_the_files_name(self):
        with tempfile.TemporaryDirectory() as folder:
            wall, table = os.path.join(folder, "wall.pcd"), os.path.join(folder, "sky.csv")
            with open(wall, "w") as file:
                file.write("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 40\nDATA ascii\n" + "".join(
                    "%g 20 %g\n" % (1e-4 * (k % 7), 1e-4 * (k // 7)) for k in range(40)))
            write_table(table)
            done = subprocess.run([os.path.join(PROGRAMS, "check_visibility"), "--map", wall, "--table", table],
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertIn(wall + ": its points are 0.0001", done.stdout)
            self.assertIn("--resolution tells another", done.stdout)

    def test_wall(self):
        result = self.check(self.map, self.table, "--compare")
        self.assertAlmostEqual(result["spacing_m"], 1.0, places=3)
        self.assertEqual(result["agreement_off_edge"], 1.0)
        self.assertGreater(result["agreement"], 0.99)
        self.assertGreater(result["us_per_ray"], 0.0)
        self.assertEqual(sum(result["confusion"].values()), self.rows)
        self.assertGreater(result["confusion"]["blocked_as_blocked"], 50)
        self.assertGreater(result["confusion"]["free_as_free"], 400)
        # Labelled as out of sight throughout: the verdicts "blocked" are right.
        blocked = result["confusion"]["blocked_as_blocked"] + result["confusion"]["free_as_blocked"]
        self.assertEqual(result["label_nlos"]["rows"], self.rows)
        self.assertAlmostEqual(result["label_nlos"]["agreement"], blocked / self.rows, places=9)
        self.assertEqual(set(result["tracers"]), {"voxel", "kdtree", "kdtree_growing"})
        self.assertGreater(result["tracers"]["kdtree"]["agreement_with_voxel"], 0.95)

    def test_tracers_one_by_one(self):
        for tracer in ("voxel", "kdtree", "kdtree_growing"):
            result = self.check(self.map, self.table, "--tracer", tracer)
            self.assertEqual(result["tracer"], tracer)
            self.assertGreater(result["agreement_off_edge"], 0.95)

    def test_without_labels(self):
        write_table(self.table, labels=False)
        result = self.check(self.map, self.table)
        self.assertIsNone(result["label_nlos"]["agreement"])
        self.assertEqual(result["label_nlos"]["rows"], 0)

    def test_refuses(self):
        def refuse(map_path, table, *arguments):
            done = self.run_tool("--map", map_path, "--table", table, *arguments)
            self.assertNotEqual(done.returncode, 0, done.stdout)
            return done.stdout

        self.assertIn("absent.pcd", refuse(self.path("absent.pcd"), self.table))
        self.assertIn("magic", refuse(self.map, self.table, "--tracer", "magic"))
        self.assertIn("table.csv", refuse(self.table, self.table))
        with open(self.table, "a") as file:
            file.write("100,0,0,0,G01,0.1,0.2,0.3,2,,1,40\n")
        output = refuse(self.map, self.table)
        self.assertIn("blocked_by_model", output)
        self.assertIn(":%d" % (self.rows + 2), output)
        with open(self.table, "w") as file:
            file.write("stamp,x,y,z,az,el\n1,0,0,0,0,1\n")
        self.assertIn("no column blocked_by_model", refuse(self.map, self.table))

    def test_city_blocks(self):
        for block, table, least in (("tst", "tst_ublox", 0.995), ("kowloonbay", "kowloonbay_novatel", 0.99)):
            map_path = os.path.join(DATA, "ray", block + "_walls_1m.pcd")
            if not os.path.exists(map_path):
                self.skipTest("no file " + map_path)
            for thinning in ((), ("--thin", 1.5), ("--thin", 2)):
                with self.subTest(block=block, thinning=thinning):
                    result = self.check(map_path, os.path.join(DATA, "ray", table + "_oracle.csv"), *thinning)
                    self.assertGreaterEqual(result["agreement"], least)
                    self.assertGreaterEqual(result["agreement_off_edge"], 0.99)


if __name__ == "__main__":
    unittest.main()
