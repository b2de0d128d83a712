"""The installed tree by itself: sourced alone, in an empty environment and folder, it runs replay and the demo, and
names nothing of the source or build tree. URBAN_GNSS_INSTALL names it; URBAN_GNSS_SOURCE and URBAN_GNSS_BUILD the others."""
import glob
import json
import os
import subprocess
import tempfile
import unittest

INSTALL = os.environ["URBAN_GNSS_INSTALL"]
FORBIDDEN = [os.environ["URBAN_GNSS_SOURCE"], os.environ["URBAN_GNSS_BUILD"]]
PACKAGE = "urban_gnss_localization"


class InstalledTreeTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.directory = folder.name

    def run_installed(self, command, seconds=120):
        environment = {"HOME": self.directory, "PATH": "/usr/bin:/bin", "LANG": "C.UTF-8", "ROS_HOME": self.directory,
                       "ROS_HOSTNAME": "localhost"}
        ros = "/opt/ros/noetic/setup.bash"
        source = ". {}\n".format(ros) if os.path.exists(ros) else ""
        # By lines: of `. setup.bash && roslaunch &` $! would be a shell, and the nodes outlive it.
        done = subprocess.run(["bash", "-c", source + ". {}/setup.bash\n".format(INSTALL) + command],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True,
                              env=environment, cwd=self.directory, timeout=seconds)
        self.assertEqual(done.returncode, 0, command + "\n" + done.stdout)
        return done.stdout

    def test_the_package_is_found_in_the_installed_tree(self):
        self.assertEqual(self.run_installed("rospack find " + PACKAGE).strip(), os.path.join(INSTALL, "share", PACKAGE))

    def test_simulate_replay_evaluate(self):
        rosrun = "rosrun {} ".format(PACKAGE)
        self.run_installed(rosrun + "simulate --scenario open_sky --duration 60 --without-lidar --output drive.bag")
        self.run_installed(rosrun + "replay drive.bag --output out.bag --json out.json")
        with open(os.path.join(self.directory, "out.json")) as file:
            self.assertLess(json.load(file)["errors"]["position_m"]["median"], 5.0)
        self.assertIn("summary: 0 FAIL", self.run_installed(rosrun + "doctor drive.bag --html doctor.html"))
        self.run_installed(rosrun + "evaluate out.bag --truth drive.bag --output results")
        self.assertTrue(glob.glob(os.path.join(self.directory, "results", "*.png")), "the reports' scripts are installed")
        self.run_installed(rosrun + "evaluate out.bag --output tracks --kml out.kml")
        self.assertGreater(os.path.getsize(os.path.join(self.directory, "tracks", "report.html")), 50000)
        self.assertIn("usage: watch", self.run_installed(rosrun + "watch --help"))

    def test_the_demo_runs(self):
        """The live graph of the paper's field, until the filter has published some poses."""
        self.run_installed("roslaunch -p 11399 {} demo.launch rviz:=false real_time_factor:=2 > launch.txt 2>&1 & launch=$!; "
                           "export ROS_MASTER_URI=http://localhost:11399; "
                           "timeout 60 bash -c 'until rostopic list > topics 2> /dev/null; do sleep 0.5; done; "
                           "rostopic echo -n 20 /odometry/filtered > poses'; status=$?; "
                           "kill -TERM $launch; wait $launch; exit $status".format(PACKAGE))
        with open(os.path.join(self.directory, "poses")) as file:
            self.assertEqual(file.read().count("child_frame_id"), 20)

    def test_nothing_names_the_source_or_build_tree(self):
        """Scripts and configuration; in a program the path of a source file is but the place of a log message."""
        named = []
        for folder, _, names in os.walk(INSTALL):
            for name in names:
                path = os.path.join(folder, name)
                if name.endswith(".pyc"):
                    continue
                with open(path, "rb") as file:
                    content = file.read()
                if content.startswith(b"\x7fELF"):
                    continue
                content = content.replace(os.fsencode(INSTALL), b"")
                named += [path for tree in FORBIDDEN if os.fsencode(tree) + b"/" in content]
        self.assertEqual(named, [])

    def test_programs_find_their_libraries(self):
        """Without the build tree on the loader's path."""
        for program in glob.glob(os.path.join(INSTALL, "lib", PACKAGE, "*_node")):
            listed = self.run_installed("ldd " + program)
            self.assertNotIn("not found", listed)
            self.assertNotIn(FORBIDDEN[1], listed.replace(INSTALL, ""))


if __name__ == "__main__":
    unittest.main()
