"""The command-line programs end to end: the experiment, and a folder of CSV files through csv_to_bag, replay and evaluate.

URBAN_GNSS_PROGRAMS names the folder of the programs. Real recordings are taken from URBAN_GNSS_DATA; without it those
tests are skipped."""
import csv
import filecmp
import json
import math
import os
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree

import rosbag
import rospy

from programs import PACKAGE, PROGRAMS, run

RANDOM = ("--localizer", "particle_filter")  # the localizer that a seed matters to
DATA = os.environ.get("URBAN_GNSS_DATA", os.path.join(PACKAGE, "..", "shared", "data"))
ZONE_KEYS = {"position_rmse_m", "position_p95_m", "position_max_m", "heading_rmse_rad"}
METRES_A_DEGREE = 111194.0  # of latitude, at 45 degrees; good to a part in a thousand


def write_csv(path, header, rows):
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header.split(","))
        writer.writerows(rows)


def write_recording(folder):
    """A minute on a circle of 30 m at 3 m/s, with fixes whose error alternates by 1 m, and a tunnel of 10 s."""
    latitude, longitude = 45.0, 7.0
    stretch = math.cos(math.radians(latitude))
    truth, odom, gnss = [], [], []
    for k in range(601):
        t = k / 10
        angle = 0.1 * t
        x, y = 30.0 * math.sin(angle), 30.0 - 30.0 * math.cos(angle)
        stamp = "%.3f" % (5000.0 + t)
        odom.append([stamp, 3.0, 0.1])
        if k % 10 == 0:
            truth.append([stamp, x, y, 0.0, angle, 3.0])
            if not 300 < k < 400:
                error = 1.0 if k % 20 == 0 else -1.0
                gnss.append([stamp, latitude + (y + error) / METRES_A_DEGREE,
                             longitude + (x - error) / METRES_A_DEGREE / stretch, 0.0, "", "", "",
                             1.0, 0.0, 1.0, 4.0, 8, 1.0, 1.5])
    write_csv(os.path.join(folder, "odom.csv"), "stamp,v,yaw_rate", odom)
    write_csv(os.path.join(folder, "truth.csv"), "stamp,x,y,z,yaw,v", truth)
    write_csv(os.path.join(folder, "gnss.csv"),
              "stamp,lat_deg,lon_deg,alt_m,x,y,z,cov_xx,cov_xy,cov_yy,cov_zz,nsat,hdop,vdop", gnss)
    with open(os.path.join(folder, "meta.json"), "w") as file:
        json.dump({"origin": {"lat_deg": latitude, "lon_deg": longitude, "ellipsoid_height_m": 0.0}}, file)


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class ToolTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = scratch.name

    def path(self, *names):
        return os.path.join(self.directory, *names)

    def succeed(self, program, *arguments):
        done = run(program, *arguments)
        self.assertEqual(done.returncode, 0, done.stdout)
        return done.stdout

    def refuse(self, program, *arguments):
        done = run(program, *arguments)
        self.assertNotEqual(done.returncode, 0, done.stdout)
        return done.stdout

    def test_paper_experiment(self):
        self.succeed("paper_experiment", "--seeds", 2, "--laps", 1, "--noise-scale", 1e-6, "--bias-direction",
                     "negative_x", "--methods", "paper,oracle", "--json", self.path("m.json"), "--plots",
                     self.path("plots"))
        with open(self.path("m.json")) as file:
            methods = json.load(file)["methods"]
        self.assertEqual(set(methods), {"paper", "oracle"})
        for method in methods.values():
            self.assertEqual(method["seeds"], 2)
            self.assertLessEqual({"sun", "shadow", "diverged", "cross_track_rmse_m"}, set(method))
            for zone in ("sun", "shadow"):
                self.assertLessEqual(ZONE_KEYS, set(method[zone]))
        self.assertLess(methods["oracle"]["shadow"]["position_rmse_m"], 0.15)
        for name in ("fig7_particles.png", "fig8_trajectories.png", "fig9_errors.png", "report.html"):
            self.assertTrue(os.path.getsize(self.path("plots", name)) > 0, name)

    def test_paper_experiment_does_not_depend_on_threads(self):
        for jobs in (1, 3):
            self.succeed("paper_experiment", "--seeds", 3, "--laps", 1, "--methods", "paper", "--jobs", jobs, "--json",
                         self.path("%d.json" % jobs))
        results = []
        for jobs in (1, 3):
            with open(self.path("%d.json" % jobs)) as file:
                method = json.load(file)["methods"]["paper"]
            del method["cpu_s"]
            results.append(method)
        self.assertEqual(*results)

    def test_what_a_receiver_leaves_out_is_said(self):
        self.succeed("simulate", "--scenario", "building_pass", "--duration", 20, "--without-lidar", "--output",
                     self.path("a.bag"))
        said = self.succeed("replay", self.path("a.bag"), "--receiver", "ublox")
        self.assertIn("left out: gps/velocity gps/satellites", said)
        self.assertNotIn("left out: gps", self.succeed("replay", self.path("a.bag")))

    def test_misspelt_options_are_named(self):
        self.assertIn("--ouput: no such option; did you mean --output?",
                      self.refuse("evaluate", "a.bag", "--ouput", "b"))
        self.assertIn("--locliser: no such option; did you mean --localizer?",
                      self.refuse("replay", "a.bag", "--locliser=ukf"))
        said = self.refuse("simulate", "--scenario", "plaza", "--colour", "red")
        self.assertIn("--colour: no such option\n", said)
        self.assertIn("--help", said)

    def test_paper_experiment_refuses(self):
        self.assertNotIn("(read:", self.refuse("paper_experiment", "--methods", "paper", "--set", "gps_bias.x=1"))
        self.assertIn("no such method", self.refuse("paper_experiment", "--methods", "papers"))
        output = self.refuse("paper_experiment", "--set", "particle_filter.expert.ring_share=2", "--set",
                             "gps_bias.expert.bias_filter.shadow_sigm=1")
        self.assertIn("particle_filter.expert.ring_share = 2", output)
        self.assertIn("did you mean expert.bias_filter.shadow_sigma?", output)

    def test_recording_through_all_tools(self):
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        for name in ("a", "b"):
            self.succeed("replay", self.path("in.bag"), *RANDOM, "--output", self.path(name + ".bag"), "--tum",
                         self.path(name + ".tum"), "--json", self.path(name + ".json"), "--seed", 5)
        for kind in (".bag", ".tum", ".json"):
            self.assertTrue(filecmp.cmp(self.path("a" + kind), self.path("b" + kind), shallow=False), kind)
        self.succeed("replay", self.path("in.bag"), *RANDOM, "--tum", self.path("c.tum"), "--seed", 6)
        self.assertFalse(filecmp.cmp(self.path("a.tum"), self.path("c.tum"), shallow=False))

        with open(self.path("a.json")) as file:
            metrics = json.load(file)
        self.assertLess(metrics["errors"]["position_m"]["max"], 10.0)
        self.succeed("evaluate", self.path("a.bag"), "--truth", self.path("in.bag"), "--output", self.path("report"))
        with open(self.path("report", "metrics.json")) as file:
            runs = json.load(file)["runs"]
        self.assertEqual(set(runs), {"a/odometry/filtered", "a/gps/fix"}, "the raw fix is always beside the estimate")
        self.assertLess(runs["a/gps/fix"]["position_m"]["max"], 2.0)
        run_metrics = runs["a/odometry/filtered"]
        self.assertAlmostEqual(run_metrics["position_m"]["rmse"], metrics["errors"]["position_m"]["rmse"], places=3)
        self.assertTrue(os.path.exists(self.path("report", "report.html")))

        # About another datum the same places have other coordinates; the errors stay.
        self.succeed("replay", self.path("in.bag"), *RANDOM, "--datum", "45.001,6.999,0", "--json",
                     self.path("d.json"), "--tum", self.path("d.tum"), "--seed", 5)
        with open(self.path("d.json")) as file:
            self.assertLess(json.load(file)["errors"]["position_m"]["max"], 10.0)
        first, other = (open(self.path(name)).readlines()[-1].split() for name in ("a.tum", "d.tum"))
        self.assertAlmostEqual(float(first[2]) - float(other[2]), 111.2, delta=5.0)

    def test_tracks_without_a_ground_truth(self):
        """A bag of replay has all that the page needs: estimates, fixes, decisions, the datum."""
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        self.succeed("replay", self.path("in.bag"), "--output", self.path("out.bag"))
        said = self.succeed("evaluate", self.path("out.bag"), "--output", self.path("report"), *(
            part for kind in ("kml", "gpx", "geojson") for part in ("--" + kind, self.path("out." + kind))))
        self.assertRegex(said, r"out/odometry/filtered \(imm_ekf\): \d+ estimates")
        self.assertRegex(said, r"without a fix that was used: 1 \(longest 10\.\d s, from \d+\.\d s\)")
        with open(self.path("report", "metrics.json")) as file:
            metrics = json.load(file)
        track = metrics["tracks"]["out/odometry/filtered"]
        self.assertEqual(metrics["runs"], {})
        self.assertEqual(track["fixes"], 52)  # 61 without the 9 in the tunnel
        self.assertEqual(sum(track["decisions"].values()), 52)
        self.assertEqual(track["gaps_of_fixes"], 1)
        self.assertAlmostEqual(track["longest_gap_of_fixes_s"], 10.0, delta=1.01)
        self.assertAlmostEqual(track["speed_mps"]["median"], 3.0, delta=0.3)
        with open(self.path("report", "report.html"), encoding="utf-8") as file:
            self.assertIn("drawTracks(", file.read())
        self.assertEqual(metrics["order"], ["out/odometry/filtered"])
        with open(self.path("out.geojson")) as file:
            features = json.load(file)["features"]
        self.assertEqual([each["properties"]["kind"] for each in features], ["estimate"] + 52 * ["fix"])
        for each in features[1:]:
            longitude, latitude = each["geometry"]["coordinates"]
            self.assertAlmostEqual(latitude, 45.0, delta=0.001)
            self.assertAlmostEqual(longitude, 7.0, delta=0.001)
        for kind, tag, count in (("kml", "Point", 52), ("gpx", "trk", 2)):
            root = ElementTree.parse(self.path("out." + kind)).getroot()
            self.assertEqual(len([each for each in root.iter() if each.tag.endswith("}" + tag)]), count)

        self.assertIn("no ground truth on topic /truth",
                      self.refuse("evaluate", self.path("out.bag"), "--truth-topic", "/truth", "--gpx", self.path("x")))
        self.assertIn("540 estimates", self.succeed("evaluate", self.path("out.bag")))  # and writes nothing
        self.assertIn("none of the topics to evaluate is in it",
                      self.refuse("evaluate", self.path("in.bag"), "--estimate-topic", "x", "--gpx", self.path("x"),
                                  "--fix-topic", "none"))

    def test_parts_that_are_far_apart(self):
        """Two drives of different days are hardly one recording."""
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("a.bag"))
        for name, later_s in (("b.bag", 61), ("c.bag", 90000)):
            with rosbag.Bag(self.path("a.bag")) as first, rosbag.Bag(self.path(name), "w") as bag:
                for topic, message, time in first:
                    if hasattr(message, "header"):
                        message.header.stamp += rospy.Duration(later_s)
                    bag.write(topic, message, time + rospy.Duration(later_s))
        self.assertNotIn("are they one recording", self.succeed("replay", self.path("b.bag"), self.path("a.bag")))
        self.assertIn("c.bag begins 25.0 h after " + self.path("a.bag") + " ends: are they one recording?",
                      self.succeed("replay", self.path("c.bag"), self.path("a.bag")))

    def test_fixes_without_a_position_are_counted(self):
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("good.bag"))
        with rosbag.Bag(self.path("good.bag")) as good, rosbag.Bag(self.path("in.bag"), "w") as bag:
            for topic, message, time in good:
                if topic.endswith("gps/fix") and 5020.5 < time.to_sec() < 5024.5:
                    message.status.status = -1
                bag.write(topic, message, time)
        self.succeed("replay", self.path("in.bag"), "--output", self.path("out.bag"))
        said = self.succeed("evaluate", self.path("out.bag"), "--output", self.path("report"))
        self.assertIn("  48 fixes and 4 without a position:", said)
        with open(self.path("report", "data", "track_out_odometry_filtered.json")) as file:
            self.assertEqual(json.load(file)["fixes_without_position"], 4)

    def test_without_a_fix_it_is_not_healthy(self):
        """The states of a replay follow the time, as a live node's do, and not the fixes alone."""
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        self.succeed("replay", self.path("in.bag"), "--set", "expert.status.fix_timeout=4.0", "--output",
                     self.path("out.bag"))
        with rosbag.Bag(self.path("out.bag")) as bag:
            statuses = [status for _, status, _ in bag.read_messages("/status")]
        stamps = [status.header.stamp.to_sec() for status in statuses]
        self.assertLess(max(after - before for before, after in zip(stamps, stamps[1:])), 1.15)
        tunnel = [status for status in statuses if 5034.5 < status.header.stamp.to_sec() < 5039.5]
        self.assertEqual({(status.state_name, status.healthy) for status in tunnel}, {("dead reckoning", False)})
        self.assertRegex(tunnel[-1].reason, r"no fix was used for \d+ s")
        self.succeed("evaluate", self.path("out.bag"), "--output", self.path("report"))
        with open(self.path("report", "metrics.json")) as file:
            track = json.load(file)["tracks"]["out/odometry/filtered"]
        self.assertLess(track["healthy_share"], 0.9)  # 6 s of the 54 s since the start

    def test_replay_says_where_a_file_has_no_section_for_it(self):
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        with open(self.path("p.yaml"), "w") as file:
            file.write("ukf: {publish_tf: false}\n")
        self.assertIn("p.yaml: has no section imm_ekf, but ukf: nothing is taken from it",
                      self.succeed("replay", self.path("in.bag"), "--params", self.path("p.yaml")))
        self.assertNotIn("no section", self.succeed("replay", self.path("in.bag"), "--localizer", "ukf", "--params",
                                                    self.path("p.yaml")))

    def test_replay_refuses_a_file_that_the_node_refuses(self):
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        with open(self.path("p.yaml"), "w") as file:
            file.write("imm_ekf: {expert: {gps_bias: {bias_timeout: 1.0}}}\nukf: {mode: paper}\n")
        self.succeed("replay", self.path("in.bag"), "--params", self.path("p.yaml"))
        for content, faults in (
                ("direct_sigma: 8.0\nimm_ekf: {}\n",
                 ["p.yaml: direct_sigma stands outside of a section and is not read: write imm_ekf: {direct_sigma:"]),
                ("imm_efk: {direct_sigma: 8.0}\n", ["p.yaml: section imm_efk is not read; did you mean imm_ekf?"]),
                ("imm_ekf_node: {}\n", ["section imm_ekf_node is not read: the node is called imm_ekf"]),
                ("robot1: {imm_ekf: {direct_sigma: 8.0}}\n", ["section imm_ekf stands in a namespace"]),
                ("ukf: {mode: paper}\nimm_ekf: {direct_sigma: eight, antena_offset: [0, 0]}\n",
                 ["2 bad parameters", "direct_sigma = eight: must be a number",
                  "antena_offset: no such parameter; did you mean antenna_offset?"])):
            with open(self.path("p.yaml"), "w") as file:
                file.write(content)
            said = self.refuse("replay", self.path("in.bag"), "--params", self.path("p.yaml"))
            for fault in faults:
                self.assertIn(fault, said)

    def test_replay_with_a_wrong_topic_names_those_of_the_right_type(self):
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        with rosbag.Bag(self.path("no_odom.bag"), "w") as out, rosbag.Bag(self.path("in.bag")) as bag:
            for topic, message, time in bag.read_messages():
                if topic != "/odom":
                    out.write(topic, message, time)
        said = self.refuse("replay", self.path("in.bag"), "--fix-topic", "gps/fx")
        self.assertIn("(--fix-topic); did you mean /gps/fix?\nAll that it has:\n  /gps/datum", said)
        self.assertIn("did you mean /odom?", self.refuse("replay", self.path("in.bag"), "--odom-topic", "wheels"))
        self.assertIn("it has no geometry_msgs/TwistWithCovarianceStamped or geometry_msgs/TwistStamped\n",
                      self.refuse("replay", self.path("in.bag"), "--velocity-topic", "v"))
        self.assertIn("it has no nav_msgs/Odometry: --odom none makes the motion of what the receiver says",
                      self.refuse("replay", self.path("no_odom.bag")))

    def test_replay_as_printed(self):
        """The bias filter of `literal` runs on the fix itself: r-hat is then the distance from the datum."""
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))

        def replay(name, *settings):
            self.succeed("replay", self.path("in.bag"), *RANDOM, "--datum", "45,7,0", "--output", self.path(name),
                         "--json", self.path("out.json"), *(part for each in settings for part in ("--set", each)))
            with open(self.path("out.json")) as file:
                decisions = json.load(file)["decisions"]
            with rosbag.Bag(self.path(name)) as bag:
                radii = {bias.header.stamp.to_sec(): bias.radius for _, bias, _ in bag.read_messages("/gps/bias")}
            return radii, decisions

        literal, decisions = replay("literal.bag", "mode=literal")
        self.assertGreater(len(literal), 30)
        self.assertGreater(max(literal.values()), 40.0)  # the circle reaches 60 m
        self.assertEqual([name for name in decisions if name.startswith("rejected") and decisions[name]], [])
        self.assertLess(max(replay("paper.bag", "mode=paper")[0].values()), 20.0)
        self.assertLess(max(replay("other.bag", "mode=literal", "gps_bias.mode=paper")[0].values()), 40.0)
        conventional, decisions = replay("conventional.bag", "mode=conventional")
        self.assertEqual(conventional, {})
        self.assertEqual([name for name in decisions if name.startswith("rejected") and decisions[name]], [])

    def test_part_of_a_bag(self):
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        given = ("--set", "expert.start.initial_pose=[0.0, 0.0, 0.0]", "--set", "expert.start.initial_heading_sigma=0.1")
        self.succeed("replay", self.path("in.bag"), *given, "--start", 20, "--duration", 15, "--tum", self.path("out.tum"),
                     "--json", self.path("out.json"))
        with open(self.path("out.tum")) as file:
            stamps = [float(line.split()[0]) for line in file if not line.startswith("#")]
        self.assertAlmostEqual(stamps[0], 5020.0, delta=1.1)
        self.assertAlmostEqual(stamps[-1], 5035.0, delta=0.11)
        with open(self.path("out.json")) as file:
            metrics = json.load(file)
        self.assertAlmostEqual(metrics["time_to_start_s"], stamps[0] - 5020.0, delta=0.11)
        self.assertEqual(metrics["time_to_heading_s"], metrics["time_to_start_s"])
        self.assertIn("no message after --start", self.refuse("replay", self.path("in.bag"), "--start", 100))

    def test_kim_as_printed(self):
        """By the names of comparisons and by the parameter, the same."""
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        trajectories = set()
        for name, mode in (("ekf_as_printed", "standard_as_printed"), ("gated_ekf_as_printed", "gated_as_printed"),
                           ("complementary_ekf_as_printed", "compensated_as_printed")):
            self.succeed("replay", self.path("in.bag"), "--localizer", name, "--output", self.path("a.bag"), "--tum",
                         self.path("a.tum"))
            self.succeed("replay", self.path("in.bag"), "--localizer", "complementary_ekf", "--set", "mode=" + mode,
                         "--tum", self.path("b.tum"))
            self.assertTrue(filecmp.cmp(self.path("a.tum"), self.path("b.tum"), shallow=False), name)
            with rosbag.Bag(self.path("a.bag")) as bag:
                statuses = [status for _, status, _ in bag.read_messages("/status")]
            self.assertEqual({status.mode for status in statuses}, {mode})
            self.assertEqual({status.last_fix.nis_threshold for status in statuses if status.last_fix.nis_dof}, {7.81})
            with open(self.path("a.tum")) as file:
                trajectories.add(file.read())
        self.succeed("replay", self.path("in.bag"), "--localizer", "complementary_ekf", "--tum", self.path("b.tum"))
        with open(self.path("b.tum")) as file:
            self.assertNotIn(file.read(), trajectories)

    def test_maier_as_printed(self):
        """The UKF by the name of comparisons and by the parameter, the same; and another than ours."""
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        for name, arguments in (("a", ["ukf_as_printed", "--output", self.path("a.bag")]),
                                ("b", ["ukf", "--set", "mode=as_printed"]), ("c", ["ukf"])):
            self.succeed("replay", self.path("in.bag"), "--tum", self.path(name + ".tum"), "--localizer", *arguments)
        self.assertTrue(filecmp.cmp(self.path("a.tum"), self.path("b.tum"), shallow=False))
        self.assertFalse(filecmp.cmp(self.path("a.tum"), self.path("c.tum"), shallow=False))
        with rosbag.Bag(self.path("a.bag")) as bag:
            self.assertEqual({status.mode for _, status, _ in bag.read_messages("/status")}, {"as_printed"})

    def test_every_fix_gets_its_decision(self):
        """Also where two fixes are decided upon at once, between two messages of slow odometry."""
        write_recording(self.directory)
        with open(self.path("odom.csv")) as file:
            lines = file.readlines()
        with open(self.path("odom.csv"), "w") as file:
            file.writelines(lines[:1] + lines[16::20])  # every 2 s, between the fixes
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        self.succeed("replay", self.path("in.bag"), "--set", "expert.stamps.odometry_gap=5.0", "--set",
                     "expert.start.initial_pose=[0.0, 0.0, 0.0]", "--output", self.path("out.bag"), "--json", self.path("out.json"))
        with rosbag.Bag(self.path("out.bag")) as bag:
            stamps = [status.last_fix.stamp for _, status, _ in bag.read_messages("/status")]
        with open(self.path("out.json")) as file:
            decisions = json.load(file)["decisions"]
        fixes = [stamp for stamp in stamps if stamp.to_sec() > 0.0]  # a status by the time repeats the last one
        self.assertEqual(len(set(fixes)), sum(decisions.values()))
        self.assertGreater(len(set(fixes)), 40)

    def test_replay_refuses(self):
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        self.assertIn("/odom (nav_msgs/Odometry)", self.refuse("replay", self.path("in.bag"), "--fix-topic", "fix"))
        self.assertIn("on sky (--satellites-topic)", self.refuse("replay", self.path("in.bag"), "--satellites-topic", "sky"))
        self.assertIn("no such localizer", self.refuse("replay", self.path("in.bag"), "--localizer", "magic"))
        self.assertIn("no such bag", self.refuse("replay", self.path("absent.bag")))
        output = self.refuse("replay", self.path("in.bag"), *RANDOM, "--set", "expert.particle_count=0",
                             "--set", "expert.ring_shar=0.1", "--set", "gate_timeout=1")
        self.assertIn("particle_count = 0", output)
        self.assertIn("did you mean expert.ring_share?", output)
        self.assertIn("gate_timeout: no such parameter; it is expert.gate_timeout", output)
        output = self.refuse("replay", self.path("in.bag"), "--datum", "91,0,0")
        self.assertTrue(output.startswith("replay: --datum: 1 bad parameter"), output)
        self.assertIn("must be sensor_msgs/NavSatFix", self.refuse("replay", self.path("in.bag"), "--fix-topic", "tf"))
        self.assertIn("--fix-topic and --odom-topic are the same topic, odom",
                      self.refuse("replay", self.path("in.bag"), "--fix-topic", "odom"))

    def test_a_localizer_is_one_line_of_the_registry(self):
        """A dummy that nothing but its own file and one line knows: named, told, run and compared like the others."""
        write_recording(self.directory)
        self.succeed("csv_to_bag", self.directory, self.path("in.bag"))
        dummy = os.path.join(os.environ["URBAN_GNSS_TEST_PROGRAMS"], "replay_with_dummy")
        self.assertIn("dummy", self.succeed(dummy, "--list-variants").split())
        self.succeed(dummy, self.path("in.bag"), "--localizer", "dummy", "--set", "start_sigma=5.0", "--output",
                     self.path("out.bag"), "--json", self.path("out.json"))
        with open(self.path("out.json")) as file:
            result = json.load(file)
        self.assertEqual(result["localizer"], "dummy")
        self.assertGreater(result["estimates"], 300)
        self.assertLess(result["errors"]["position_m"]["median"], 10.0)  # dead reckoning from a start by fixes
        with rosbag.Bag(self.path("out.bag")) as bag:
            covariances = {message.pose.covariance[0] for _, message, _ in bag.read_messages("/odometry/filtered")}
            fixes = [message for _, message, _ in bag.read_messages("/gps/filtered")]
        self.assertEqual(covariances, {25.0})
        self.assertEqual(len(fixes), result["estimates"])
        self.assertEqual({fix.position_covariance[0] for fix in fixes}, {25.0})
        self.assertEqual({fix.altitude for fix in fixes}, {result["datum"][2]})
        self.assertLess(max(abs(fix.latitude - result["datum"][0]) for fix in fixes), 0.1)
        self.assertIn("start_sigma = -1", self.refuse(dummy, self.path("in.bag"), "--localizer", "dummy", "--set",
                                                      "start_sigma=-1"))
        self.assertIn("no such localizer", self.refuse("replay", self.path("in.bag"), "--localizer", "dummy"))

    def test_csv_to_bag_refuses(self):
        write_recording(self.directory)
        with open(self.path("odom.csv"), "a") as file:
            file.write("5060.1,fast,0.1\n")
        output = self.refuse("csv_to_bag", self.directory, self.path("in.bag"))
        self.assertIn("odom.csv", output)
        self.assertIn("603", output)
        os.remove(self.path("gnss.csv"))
        self.assertIn("gnss.csv", self.refuse("csv_to_bag", self.directory, self.path("in.bag")))

    def test_real_recordings_run_through(self):
        for name in ("hk_tst_20210517_ublox", "nagoya_20230711"):
            folder = os.path.join(DATA, name)
            if not os.path.isdir(folder):
                self.skipTest("no folder " + folder)
            with self.subTest(recording=name):
                self.succeed("csv_to_bag", folder, self.path("in.bag"))
                self.succeed("replay", self.path("in.bag"), "--tum", self.path("out.tum"), "--json", self.path("out.json"))
                with open(self.path("out.json")) as file:
                    metrics = json.load(file)
                self.assertGreater(metrics["errors"]["coverage"], 0.9)
                with open(self.path("out.tum")) as file:
                    self.assertTrue(all(math.isfinite(float(value)) for line in file for value in line.split()))


if __name__ == "__main__":
    unittest.main()
