#!/usr/bin/env python3
"""The report scripts on small synthetic inputs: pictures exist and show something, pages name everything."""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import matplotlib.image
import numpy as np

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "reports")
PNG_OF_PAPER = ("fig7_particles.png", "fig8_trajectories.png", "fig9_errors.png", "errors_over_seeds.png",
                "summary.png")


def run_script(name, *arguments):
    """Run a report script; its result with the texts it printed."""
    return subprocess.run([sys.executable, "-B", os.path.join(SCRIPTS, name)] + list(arguments),
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)


def write_csv(path, **columns):
    """Write the columns with a header."""
    rows = len(next(iter(columns.values())))
    table = np.column_stack([np.broadcast_to(values, rows) for values in columns.values()])
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")


def write_json(path, content):
    """Write the object."""
    with open(path, "w") as stream:
        json.dump(content, stream)


def write_text(path, text):
    """Write the file."""
    with open(path, "w", encoding="utf-8") as stream:
        stream.write(text)


def read_text(path):
    """The whole file."""
    with open(path, encoding="utf-8") as stream:
        return stream.read()


def drop_column(path, column):
    """Take one column out of a CSV file."""
    rows = [line.split(",") for line in read_text(path).splitlines()]
    index = rows[0].index(column)
    with open(path, "w") as stream:
        for row in rows:
            stream.write(",".join(row[:index] + row[index + 1:]) + "\n")


def write_trajectory(path, error, laps=3, scale=1.0):
    """A drive of three rounds on a circle of 15 m with an estimate that is off by `error`."""
    t = np.arange(0.0, 9.0 * laps, 0.1)
    angle = 2.0 * np.pi * t / 9.0
    x, y = scale * 15.0 * np.cos(angle), scale * 15.0 * np.sin(angle)
    shadow = (x < 0.0).astype(float)
    bias = -5.0 * shadow
    write_csv(path, t=t, lap=np.floor(t / 9.0), true_x=x, true_y=y, true_yaw=angle + np.pi / 2.0,
              est_x=x + error * np.sin(t), est_y=y + error, est_yaw=angle + np.pi / 2.0 + 0.1 * error,
              fix_x=x + bias, fix_y=y, in_shadow=shadow, bias_x=bias, bias_y=0.0, radius=-bias, ess=500.0)


def write_paper_input(directory):
    """Methods 'paper' with everything, 'conventional' diverged without particles, 'new_idea' with nulls."""
    data = os.path.join(directory, "data")
    os.makedirs(data)
    angles = np.arange(8) * np.pi / 4.0
    write_csv(os.path.join(data, "targets.csv"), x=15.0 * np.cos(angles), y=15.0 * np.sin(angles))
    for method, error, scale in (("paper", 0.2, 1.0), ("conventional", 4.0, 30.0), ("new_idea", 0.05, 1.0)):
        write_trajectory(os.path.join(data, "trajectory_" + method + ".csv"), error, scale=scale)
        t = np.arange(0.0, 20.0)
        write_csv(os.path.join(data, "errors_over_seeds_" + method + ".csv"), t=t,
                  position_rmse_m=error * (1.0 + t), position_p95_m=2.0 * error * (1.0 + t),
                  heading_rmse_rad=0.1 * error * (1.0 + t))
    write_csv(os.path.join(data, "snapshots_paper.csv"), snapshot=np.arange(2.0), t=np.array([1.0, 4.0]),
              true_x=np.array([10.0, -10.0]), true_y=3.0, true_yaw=1.0, est_x=np.array([10.1, -10.1]),
              est_y=3.1, est_yaw=1.0, fix_x=np.array([10.0, -15.0]), fix_y=3.0,
              radius=np.array([np.nan, 5.0]))
    generator = np.random.RandomState(1)
    write_csv(os.path.join(data, "particles_paper.csv"), snapshot=np.repeat([0.0, 1.0], 50),
              x=np.repeat([10.0, -10.0], 50) + generator.normal(0.0, 2.0, 100),
              y=3.0 + generator.normal(0.0, 2.0, 100), yaw=1.0, weight=generator.uniform(0.0, 1.0, 100))
    zone = {"position_rmse_m": 0.5, "position_p95_m": 1.0, "position_max_m": 2.0, "heading_rmse_rad": 0.02}
    empty = dict.fromkeys(zone)
    methods = {name: {"sun": values, "shadow": values, "diverged": 1, "cross_track_rmse_m": 0.3, "seeds": 30,
                      "runtime_s": None}
               for name, values in (("paper", zone), ("conventional", zone), ("new_idea", empty))}
    write_json(os.path.join(directory, "metrics.json"), {
        "command": "experiment --seeds 30 <quick>", "machine": "a computer",
        "conditions": {"noise_scale": 1e-6},
        "closed_loop": True, "seeds": [1, 2, 3], "laps": 3, "methods": methods})


def write_evaluation_input(directory):
    """Two runs on one data set, the first with raw fixes, one of them far away, and a run with one row."""
    data = os.path.join(directory, "data")
    os.makedirs(data)
    t = 1.6e9 + np.arange(200.0)
    x, y = np.arange(200.0), 20.0 * np.sin(np.arange(200.0) / 30.0)
    for name, error in (("town_switching", 1.0), ("town_ekf", 3.0)):
        position_error = error * (1.0 + np.sin(x / 7.0) ** 2)
        write_csv(os.path.join(data, "errors_" + name + ".csv"), t=t, position_error_m=position_error,
                  heading_error_rad=0.02 * np.cos(x / 9.0), est_x=x, est_y=y + position_error, truth_x=x,
                  truth_y=y,
                  sigma_m=error, nees=2.0)
    fix_error = np.where(x == 100.0, 5000.0, 8.0)
    write_csv(os.path.join(data, "fixes_town_switching.csv"), t=t, fix_x=x, fix_y=y + fix_error,
              error_m=fix_error)
    with open(os.path.join(data, "errors_short.csv"), "w") as stream:
        stream.write("t,position_error_m,heading_error_rad,est_x,est_y,truth_x,truth_y,sigma_m,nees\n"
                     "1,0.5,0.01,0,0.5,0,0,1,0.25\n")
    statistics = {"mean": 1.0, "sigma": 0.5, "rmse": 1.1, "median": 0.9, "p95": 2.0, "max": 3.0}
    run = {"samples": 200, "coverage": 0.98, "position_m": statistics, "heading_rad": statistics,
           "nees_mean": 2.1,
           "share_below_5m": 1.0, "share_below_10m": None}
    write_json(os.path.join(directory, "metrics.json"), {
        "command": "evaluate", "runs": {"town/switching": run, "town/ekf": run, "short": run}})


def without_pictures(page):
    """The page with its pictures' data cut out."""
    return re.sub(r"base64,[^\"]*", "base64,", page)


def write_track_input(directory, runs=None):
    """A track of three poses and a fix with a nasty reason; `runs` in place of those of metrics.json. The track's path."""
    one = [0.0, 1.0, 2.0]
    track = {"name": "town/switching", "localizer": "imm_ekf", "start": 1.6e9, "datum": [48.0, 11.0, 0.0],
             "estimate": dict.fromkeys(("t", "x", "y", "xx", "xy", "yy", "sigma", "speed"), one),
             "fixes": {"t": [1.0], "x": [1.0], "y": [2.0], "sigma": [3.0], "nis": [None], "nis_threshold": [9.2],
                       "decision": ["rejected_gate"], "reason": ["</script><b>"]},
             "states": {"t": [0.0], "state": ["tracking"], "healthy": [True], "reason": [""]},
             "truth": {"t": [], "x": [], "y": []}, "errors": {"t": [], "error": []},
             "fix_errors": {"t": [], "error": []}, "gaps": [], "gaps_of_fixes": [[0.0, 2.0]]}
    os.makedirs(os.path.join(directory, "data"), exist_ok=True)
    path = os.path.join(directory, "data", "track_town_switching.json")
    write_json(path, track)
    metrics_path = os.path.join(directory, "metrics.json")
    metrics = json.loads(read_text(metrics_path)) if os.path.exists(metrics_path) else {"command": "evaluate"}
    metrics["runs"] = metrics.get("runs", {}) if runs is None else runs
    metrics["order"] = ["town/switching"]
    metrics["tracks"] = {"town/switching": {
        "duration_s": 2.0, "longest_gap_of_fixes_s": 12.5, "sigma_m": {"median": None},
        "decisions": {"accepted": 2, "inflated": 1, "rejected_gate": 1, "unknown": 4}}}
    write_json(metrics_path, metrics)
    return path


def write_bias_input(directory):
    """A drive with buildings between 40 and 60 s, where the fixes are 8 m off; a scenario without buildings."""
    t = np.arange(0.0, 100.0)
    between = (t >= 40.0) & (t <= 60.0)
    phase = np.where(t < 40.0, 0.0, np.where(between, 1.0, 2.0))
    phases = {name: {"position_mean_m": value, "position_max_m": 2.0 * value, "nees_mean": 3.0, "doubted_share": 0.25}
              for name, value in (("before", 1.0), ("between", 4.25), ("after", 1.5))}
    filters = ("standard", "gated", "compensated", "standard_as_printed", "gated_as_printed", "compensated_as_printed",
               "withheld")
    nowhere = dict(phases, between=dict.fromkeys(phases["between"]), after=dict.fromkeys(phases["after"]))
    scenarios = {place: {"fixes": row, "filters": {name: dict(row, settling_time_by_seed_s=times) for name in filters}}
                 for place, row, times in (("alley", phases, [0.0, 7.0]), ("field", nowhere, [None, None]))}
    for place, phase_there in (("alley", phase), ("field", 0.0)):
        data = os.path.join(directory, "data", place)
        os.makedirs(data)
        write_csv(os.path.join(data, "truth.csv"), t=t, x=3.0 * t, y=0.0, phase=phase_there)
        write_csv(os.path.join(data, "fixes.csv"), t=t, error_x=np.where(between, 8.0, np.sin(t)), error_y=np.cos(t))
        for name in filters:
            write_csv(os.path.join(data, "estimate_" + name + ".csv"), t=t, x=3.0 * t + 1.0, y=np.sin(t / 9.0),
                      error_m=1.0, sigma_m=0.7)
        for name in ("compensated", "compensated_as_printed"):
            write_csv(os.path.join(data, "bias_" + name + ".csv"), t=t, bias_x=np.where(between, 7.5, 0.0), bias_y=0.0,
                      sigma_x=1.0, sigma_y=1.0, significant=between, doubted=between)
    write_json(os.path.join(directory, "metrics.json"), {
        "command": "bias_experiment", "seeds": [1, 2], "scenario_order": ["alley", "field"], "scenarios": scenarios})


class ReportCase(unittest.TestCase):
    """A temporary input directory and checks that both reports share."""

    def setUp(self):
        """Make an empty directory."""
        self._temporary = tempfile.TemporaryDirectory()
        self.directory = os.path.join(self._temporary.name, "input")
        os.makedirs(self.directory)

    def tearDown(self):
        """Remove it."""
        self._temporary.cleanup()

    def path(self, *names):
        """A path in the input directory."""
        return os.path.join(self.directory, *names)

    def assert_succeeds(self, script):
        """The script exits with 0 and warns about nothing."""
        result = run_script(script, self.directory)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr, "")

    def assert_refuses(self, script, message):
        """The script exits with 1 and one line: its name, the message."""
        result = run_script(script, self.directory)
        self.assertEqual(result.returncode, 1)
        self.assertEqual(result.stderr, "{}: {}\n".format(os.path.splitext(script)[0], message))

    def assert_picture(self, name):
        """The picture has a legible size and many pixels that are coloured: text and axes are grey."""
        pixels = matplotlib.image.imread(self.path(name))
        self.assertGreater(min(pixels.shape[:2]), 200, name)
        rgb = pixels[..., :3].reshape(-1, 3)
        coloured = rgb[np.ptp(rgb, axis=1) > 0.2]
        self.assertGreater(len(coloured), 150, name)
        self.assertGreater(len(np.unique(np.rint(255.0 * rgb), axis=0)), 100, name)

    def has_colour(self, name, colour):
        """Whether pixels of exactly this colour (0 to 255) are in the picture."""
        pixels = np.rint(255.0 * matplotlib.image.imread(self.path(name))[..., :3])
        return bool(np.any(np.all(pixels == np.array(colour), axis=2)))


class PaperExperimentTest(ReportCase):
    """plot_paper_experiment.py."""

    SCRIPT = "plot_paper_experiment.py"

    def setUp(self):
        """Write the input."""
        super().setUp()
        write_paper_input(self.directory)

    def test_pictures_show_something(self):
        """All five pictures are made, no partial files stay behind, and 'paper' has its own colour."""
        self.assert_succeeds(self.SCRIPT)
        for name in PNG_OF_PAPER:
            self.assert_picture(name)
        self.assertEqual(sorted(os.listdir(self.directory)),
                         sorted(PNG_OF_PAPER + ("data", "metrics.json", "report.html")))
        self.assertTrue(self.has_colour("summary.png", (0x00, 0x72, 0xb2)))
        self.assertFalse(self.has_colour("summary.png", (0xaa, 0x33, 0x77)))

    def test_page_names_methods_pictures_and_conditions(self):
        """The page is complete, escaped, shows absent numbers as such, says who leaves the view."""
        self.assert_succeeds(self.SCRIPT)
        page = read_text(self.path("report.html"))
        for text in ("paper", "conventional", "new_idea") + PNG_OF_PAPER:
            self.assertIn(text, page)
        self.assertIn("experiment --seeds 30 &lt;quick&gt;", page)
        self.assertIn("a computer", page)
        self.assertIn("noise_scale", page)
        self.assertIn("<td>\u2013</td>", page)
        self.assertIn("beyond it go: conventional.", page)
        self.assertNotIn("nan", without_pictures(page))

    def test_page_leads_to_that_of_the_live_drive(self):
        """Where there is one."""
        self.assert_succeeds(self.SCRIPT)
        self.assertNotIn("live/report.html", read_text(self.path("report.html")))
        os.mkdir(self.path("live"))
        write_text(self.path("live", "report.html"), "")
        self.assert_succeeds(self.SCRIPT)
        self.assertIn('<a href="live/report.html">', read_text(self.path("report.html")))

    def test_method_without_data_is_said(self):
        """A method of the metrics without a trajectory does not vanish silently."""
        os.remove(self.path("data", "trajectory_new_idea.csv"))
        self.assert_succeeds(self.SCRIPT)
        self.assertIn("No data for: new_idea.", read_text(self.path("report.html")))

    def test_without_snapshots(self):
        """Figure 7 is optional."""
        os.remove(self.path("data", "snapshots_paper.csv"))
        self.assert_succeeds(self.SCRIPT)
        self.assertFalse(os.path.exists(self.path("fig7_particles.png")))
        self.assertNotIn("fig7_particles.png", read_text(self.path("report.html")))

    def test_header_without_rows_counts_as_no_data(self):
        """A file with only a header is no error."""
        path = self.path("data", "trajectory_new_idea.csv")
        header = read_text(path).splitlines()[0]
        with open(path, "w") as stream:
            stream.write(header + "\n")
        self.assert_succeeds(self.SCRIPT)
        self.assertIn("No data for: new_idea.", read_text(self.path("report.html")))

    def test_missing_column_is_named(self):
        """The file and the column are in the message."""
        path = self.path("data", "trajectory_conventional.csv")
        drop_column(path, "est_yaw")
        self.assert_refuses(self.SCRIPT, path + ": missing column est_yaw")

    def test_missing_targets(self):
        """A missing file is named."""
        os.remove(self.path("data", "targets.csv"))
        self.assert_refuses(self.SCRIPT, self.path("data", "targets.csv") + ": No such file or directory")

    def test_no_trajectory_at_all(self):
        """Without any trajectory there is no report."""
        for method in ("paper", "conventional", "new_idea"):
            os.remove(self.path("data", "trajectory_" + method + ".csv"))
        result = run_script(self.SCRIPT, self.directory)
        self.assertEqual(result.returncode, 1)
        self.assertIn("no trajectory_<method>.csv", result.stderr)

    def test_metrics_that_are_no_json(self):
        """Broken metrics are named."""
        with open(self.path("metrics.json"), "w") as stream:
            stream.write('{"methods": nan}')
        result = run_script(self.SCRIPT, self.directory)
        self.assertEqual(result.returncode, 1)
        self.assertIn("metrics.json: not valid JSON", result.stderr)

    def test_usage(self):
        """Without a directory: the usage and exit code 2."""
        result = run_script(self.SCRIPT)
        self.assertEqual(result.returncode, 2)
        self.assertIn("usage: plot_paper_experiment DIR", result.stderr)


class EvaluationTest(ReportCase):
    """plot_evaluation.py."""

    SCRIPT = "plot_evaluation.py"

    def setUp(self):
        """Write the input."""
        super().setUp()
        write_evaluation_input(self.directory)

    def test_pictures_show_something(self):
        """Two pictures for each run and the distributions."""
        self.assert_succeeds(self.SCRIPT)
        self.assert_picture("cdf.png")
        self.assert_picture("overview.png")
        for run in ("town_switching", "town_ekf", "short"):
            self.assert_picture("trajectory_" + run + ".png")
            self.assert_picture("errors_" + run + ".png")

    def test_page_names_runs_and_pictures(self):
        """Each run is in the tables and has its pictures; fixes outside the view are counted."""
        self.assert_succeeds(self.SCRIPT)
        page = read_text(self.path("report.html"))
        for text in ("town/switching", "town/ekf", "short", "cdf.png", "trajectory_town_ekf.png",
                     "errors_town_switching.png", "1 of 200 raw fixes"):
            self.assertIn(text, page)
        self.assertIn("<td>98.0</td>", page)
        self.assertIn("<td>57.30</td>", page)
        self.assertNotIn("nan", without_pictures(page))

    def test_raw_fixes_are_beside_the_estimates(self):
        """They have a row, and no pictures of their own."""
        for kind, source in (("errors", "town_ekf"), ("fixes", "town_switching")):
            shutil.copy(self.path("data", kind + "_" + source + ".csv"), self.path("data", kind + "_town_gps_fix.csv"))
        metrics = json.loads(read_text(self.path("metrics.json")))
        metrics["runs"]["town/gps/fix"] = metrics["runs"]["town/ekf"]
        write_json(self.path("metrics.json"), metrics)
        self.assert_succeeds(self.SCRIPT)
        self.assertIn("</span>town: raw fix</td>", read_text(self.path("report.html")))
        self.assertFalse(os.path.exists(self.path("trajectory_town_gps_fix.png")))

    def test_run_without_samples(self):
        """A file with only a header gives a page that says so."""
        path = self.path("data", "errors_short.csv")
        header = read_text(path).splitlines()[0]
        with open(path, "w") as stream:
            stream.write(header + "\n")
        self.assert_succeeds(self.SCRIPT)
        self.assertIn("This run has no samples.", read_text(self.path("report.html")))

    def test_missing_column_is_named(self):
        """The file and the column are in the message."""
        path = self.path("data", "errors_town_ekf.csv")
        drop_column(path, "sigma_m")
        self.assert_refuses(self.SCRIPT, path + ": missing column sigma_m")

    def test_missing_column_of_optional_file_is_named(self):
        """An optional file must be right when it is there."""
        path = self.path("data", "fixes_town_switching.csv")
        drop_column(path, "error_m")
        self.assert_refuses(self.SCRIPT, path + ": missing column error_m")

    def test_row_with_too_few_cells(self):
        """A truncated file is named."""
        path = self.path("data", "errors_town_ekf.csv")
        with open(path, "a") as stream:
            stream.write("1,2,3\n")
        result = run_script(self.SCRIPT, self.directory)
        self.assertEqual(result.returncode, 1)
        self.assertIn(path, result.stderr)
        self.assertEqual(len(result.stderr.splitlines()), 1)

    def test_runs_with_the_same_file_names(self):
        """'town/ekf' and 'town_ekf' would overwrite each other."""
        metrics = json.loads(read_text(self.path("metrics.json")))
        metrics["runs"]["town_ekf"] = metrics["runs"]["town/ekf"]
        write_json(self.path("metrics.json"), metrics)
        self.assert_refuses(self.SCRIPT, self.path("metrics.json") +
                            ": runs town/ekf and town_ekf have the same file names")

    def test_missing_runs(self):
        """Metrics with neither runs nor tracks are refused."""
        write_json(self.path("metrics.json"), {"command": "evaluate"})
        self.assert_refuses(self.SCRIPT, self.path("metrics.json") + ": neither runs nor tracks")

    def test_page_needs_no_other_file(self):
        """Nothing of it is fetched, from beside it or from elsewhere."""
        write_track_input(self.directory)
        self.assert_succeeds(self.SCRIPT)
        page = without_pictures(read_text(self.path("report.html")))
        self.assertEqual(8, page.count('src="data:image/png;base64,'))
        self.assertEqual([], re.findall(r'(?:src|href)="(?!data:)[^"]*"|https?://|@import|url\(|fetch\(', page))

    def test_tracks_without_truth(self):
        """A page with the map and a table, and without pictures."""
        write_track_input(self.directory, {})
        self.assert_succeeds(self.SCRIPT)
        page = read_text(self.path("report.html"))
        for text in ("<title>Tracks</title>", "drawTracks(", "\\u003c/script>", "<td>75.0</td>", "<td>12.5</td>"):
            self.assertIn(text, page)
        self.assertNotIn("<img", page)
        self.assertEqual(1, page.count("</script>"))

    def test_broken_track_is_named(self):
        """The file and what is missing are in the message."""
        path = write_track_input(self.directory, {})
        track = json.loads(read_text(path))
        del track["fixes"]["decision"]
        write_json(path, track)
        self.assert_refuses(self.SCRIPT, path + ": missing list fixes.decision")


class BiasExperimentTest(ReportCase):
    """plot_bias_experiment.py."""

    SCRIPT = "plot_bias_experiment.py"

    def setUp(self):
        """Write the input."""
        super().setUp()
        write_bias_input(self.directory)

    def test_pictures_show_something(self):
        """A picture for each scenario, with the time between the buildings shaded where there are any."""
        self.assert_succeeds(self.SCRIPT)
        for name in ("fig6_alley.png", "fig6_field.png"):
            self.assert_picture(name)
            self.assertTrue(self.has_colour(name, (0x00, 0x72, 0xb2)), name)
        self.assertTrue(self.has_colour("fig6_alley.png", (0xe6, 0xe9, 0xf0)))
        self.assertFalse(self.has_colour("fig6_field.png", (0xe6, 0xe9, 0xf0)))

    def test_table(self):
        """A row for the fixes and each filter; what does not exist is a dash."""
        self.assert_succeeds(self.SCRIPT)
        alley, field = read_text(self.path("table.md")).split("## field")
        self.assertIn("| compensated | 1.00 / 4.25 / 1.50 | 8.5 | 3.0 / 3.0 / 3.0 | 25.0 | at most 7 |", alley)
        self.assertIn("| fixes | 1.00 / 4.25 / 1.50 | 8.5 |  |  |  |", alley)
        for name in ("standard", "gated", "standard_as_printed", "gated_as_printed", "compensated_as_printed", "withheld"):
            self.assertIn("| {} |".format(name), alley)
        self.assertIn("| compensated | 1.00 / \u2013 / \u2013 | \u2013 | 3.0 / \u2013 / \u2013 |", field)
        self.assertNotIn("nan", field)

    def test_bias_that_does_not_settle_is_said(self):
        """Among others that settle it is not lost."""
        metrics = json.loads(read_text(self.path("metrics.json")))
        metrics["scenarios"]["alley"]["filters"]["compensated"]["settling_time_by_seed_s"] = [3.0, None]
        write_json(self.path("metrics.json"), metrics)
        self.assert_succeeds(self.SCRIPT)
        self.assertIn("at most 3, 1 not", read_text(self.path("table.md")))

    def test_missing_column_is_named(self):
        """The file and the column are in the message."""
        path = self.path("data", "alley", "bias_compensated.csv")
        drop_column(path, "sigma_y")
        self.assert_refuses(self.SCRIPT, path + ": missing column sigma_y")


if __name__ == "__main__":
    unittest.main()
