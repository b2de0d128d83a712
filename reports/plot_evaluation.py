#!/usr/bin/env python3
"""The tracks that `evaluate` has found, errors over time and error distributions, and a page of all of them.

usage: plot_evaluation.py DIR

Reads DIR/metrics.json; for each of its tracks DIR/data/track_<track>.json; for each of its runs, those with a truth,
DIR/data/errors_<run>.csv and, if there is one, DIR/data/fixes_<run>.csv. A slash in a name is an underscore in file
names. Runs are named <bag>/<topic>. Writes overview.png, trajectory_<run>.png and errors_<run>.png for each run,
cdf.png and report.html into DIR. The page needs no other file, and no network.
"""

import itertools
import os
import sys

# In a devel space this file runs through a wrapper in another directory; the module lies beside the source.
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import numpy as np  # noqa: E402

import report_common as common  # noqa: E402
import track_view  # noqa: E402
from report_common import plt  # noqa: E402

ERROR_COLUMNS = ("t", "position_error_m", "heading_error_rad", "est_x", "est_y", "truth_x", "truth_y",
                 "sigma_m", "nees")
FIX_COLUMNS = ("t", "fix_x", "fix_y", "error_m")

SMALLEST_MARGIN_M = 15.0
RELATIVE_MARGIN = 0.15
SMALLEST_ERROR_M = 1e-3
OVERVIEW_LEAST_M = 0.1
LONGEST_GAP_S = 5.0
FIX_TOPICS = ("fix", "fix_weighted")
USUAL_TOPICS = (("/odometry/filtered", ""), ("/gps/fix", ": raw fix"), ("/gps/fix_weighted", ": weighted fix"))
TRACK_COLOURS = ("#0072b2", "#8c510a", "#56b4e9", "#f781bf", "#7b4fd6", "#1f3a93")  # none of a decision's
USED = ("accepted", "inflated", "bias_compensated")  # decisions


class Run:
    """The data of one run; `label` is its name for people."""

    def __init__(self, directory, name, metrics):
        self.name = name
        self.metrics = metrics
        self.file_name = name.replace("/", "_")
        self.label, self.is_fix = label_of(name), name.rpartition("/")[2] in FIX_TOPICS
        data = os.path.join(directory, "data")
        self.errors = common.read_csv(os.path.join(data, "errors_" + self.file_name + ".csv"), ERROR_COLUMNS)
        self.fixes = common.read_optional_csv(os.path.join(data, "fixes_" + self.file_name + ".csv"),
                                              FIX_COLUMNS)

    def has_fixes(self):
        """Whether there is at least one raw fix."""
        return self.fixes is not None and len(self.fixes) > 0


def label_of(name):
    """The bag's stem where the topic is the usual one, with "raw fix" behind it where that is a fix's."""
    for end, replaced in USUAL_TOPICS:
        if name.endswith(end):
            return name[:-len(end)] + replaced
    return name


def read_runs(directory, metrics, path):
    """The runs of metrics.json, in its order; no two may share their files."""
    runs = []
    owners = {}
    for name, values in metrics.get("runs", {}).items():
        run = Run(directory, name, values)
        if run.file_name in owners:
            raise common.ReportError("{}: runs {} and {} have the same file names".format(
                path, owners[run.file_name], name))
        owners[run.file_name] = name
        runs.append(run)
    return runs


def run_colours(runs, tracks=()):
    """A colour for each run and track: that of a method of this name, or the next free one."""
    colours = {run.name: common.FIX_COLOUR for run in runs if run.is_fix}
    names = [run.name for run in runs] + list(tracks)
    for name in names:
        known = [part for part in name.split("/") if part in common.METHOD_COLOURS]
        if known and name not in colours:
            colours[name] = common.METHOD_COLOURS[known[0]]
    unused = [colour for colour in TRACK_COLOURS if colour not in colours.values()] or TRACK_COLOURS
    free = itertools.cycle(unused)
    colours.update((name, next(free)) for name in names if name not in colours)
    return colours


def break_gaps(t, *columns):
    """The time and the columns with a NaN in each longer gap, so that no line bridges it."""
    if len(t) < 3:
        return (t,) + columns
    steps = np.diff(t)
    gaps = np.flatnonzero(steps > max(LONGEST_GAP_S, 10.0 * float(np.median(steps)))) + 1
    return tuple(np.insert(values, gaps, np.nan) for values in (t,) + columns)


def marker_for(values):
    """A marker where a line would show nothing: a single sample."""
    return "o" if len(values) == 1 else ""


def view_limits(errors):
    """The window (x_min, x_max, y_min, y_max) around the truth, or if there is none the estimate; or None."""
    for prefix in ("truth", "est"):
        x, y = common.finite(errors[prefix + "_x"]), common.finite(errors[prefix + "_y"])
        if len(x) and len(y):
            margin = max(SMALLEST_MARGIN_M, RELATIVE_MARGIN * max(np.ptp(x), np.ptp(y)))
            return np.min(x) - margin, np.max(x) + margin, np.min(y) - margin, np.max(y) + margin
    return None


def count_outside(x, y, limits):
    """How many points lie outside the window."""
    return int(np.sum((x < limits[0]) | (x > limits[1]) | (y < limits[2]) | (y > limits[3])))


def figure_size(limits):
    """A figure that fits the shape of the window, width and height at most 9 and 8 inches."""
    width, height = limits[1] - limits[0], limits[3] - limits[2]
    scale = min(9.0 / width, 8.0 / height)
    return max(5.0, scale * width), max(3.2, scale * height)


def plot_trajectory(path, run, colour):
    """Truth, estimate and raw fixes; gives the caption."""
    errors = run.errors
    limits = view_limits(errors) or (-1.0, 1.0, -1.0, 1.0)
    figure, axes = plt.subplots(figsize=figure_size(limits))
    notes = []
    if run.has_fixes():
        axes.plot(run.fixes["fix_x"], run.fixes["fix_y"], ".", color=common.FIX_COLOUR, markersize=3,
                  alpha=0.7, label="raw fixes")
        notes.append((count_outside(run.fixes["fix_x"], run.fixes["fix_y"], limits), len(run.fixes),
                      "raw fixes"))
    _, truth_x, truth_y, est_x, est_y = break_gaps(errors["t"], errors["truth_x"], errors["truth_y"],
                                                   errors["est_x"], errors["est_y"])
    axes.plot(truth_x, truth_y, color=common.TRUTH_COLOUR, linewidth=1.6, marker=marker_for(truth_x),
              label="truth")
    if not run.is_fix:
        axes.plot(est_x, est_y, color=colour, linewidth=1.3, marker=marker_for(est_x), label="estimate")
        notes.append((count_outside(errors["est_x"], errors["est_y"], limits), len(errors), "estimates"))
    axes.set_aspect("equal")
    axes.set_xlim(limits[0], limits[1])
    axes.set_ylim(limits[2], limits[3])
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.set_title("Where {} was".format(run.label), fontsize=11)
    common.light_grid(axes)
    common.legend_beside(axes)
    common.save_figure(figure, path)
    outside = ["{} of {} {}".format(count, total, what) for count, total, what in notes if count]
    return "Trajectory of {}.{}".format(
        run.label, " Outside the view: {}.".format(" and ".join(outside)) if outside else "")


def plot_errors(path, run, colour):
    """Position error with the filter's own one-sigma band, and heading error, over time."""
    errors = run.errors
    start = errors["t"][0] if len(errors) else 0.0
    t, position, heading, sigma = break_gaps(errors["t"] - start, errors["position_error_m"],
                                             errors["heading_error_rad"], errors["sigma_m"])
    figure, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(9.5, 5.6))
    top.fill_between(t, 0.0, sigma, color=colour, alpha=0.22, linewidth=0,
                     label=r"1 $\sigma$ of the estimate")
    top.plot(t, position, color=colour, linewidth=1.0, marker=marker_for(t), label="position error")
    known = common.finite(position)
    top.set_ylim(0.0, 1.05 * max(np.max(known), SMALLEST_ERROR_M) if len(known) else 1.0)
    top.set_ylabel("position error [m]")
    top.set_title("How far off {} was".format(run.label), fontsize=11)
    bottom.axhline(0.0, color="#888888", linewidth=0.8)
    bottom.plot(t, common.line_degrees(heading), color=colour, linewidth=1.0, marker=marker_for(t))
    bottom.set_ylabel("heading error [deg]")
    bottom.set_xlabel("time since the start [s]")
    for axes in (top, bottom):
        common.light_grid(axes)
    common.legend_beside(top)
    figure.subplots_adjust(hspace=0.08)
    common.save_figure(figure, path)


def distribution(values):
    """Sorted finite values and the share of values up to each, the first one also with a share of 0."""
    values = np.sort(np.maximum(common.finite(values), SMALLEST_ERROR_M))
    if not len(values):
        return values, values
    return np.insert(values, 0, values[0]), np.arange(len(values) + 1) / len(values)


def distinct_fixes(runs):
    """The raw fixes' errors of the runs, each set once, with the run it came from."""
    distinct = []
    for run in runs:
        if run.has_fixes() and not any(np.array_equal(run.fixes["error_m"], other.fixes["error_m"])
                                       for other in distinct):
            distinct.append(run)
    return distinct


def lower_end(runs):
    """Where the axis of errors begins: the smallest 1 % quantile of all runs; none without data."""
    samples = [common.finite(run.errors["position_error_m"]) for run in runs]
    quantiles = [np.percentile(values, 1.0) for values in samples if len(values)]
    return 0.9 * max(min(quantiles), SMALLEST_ERROR_M) if quantiles else None


def raw_fixes(runs):
    """(label, series of fixes) of each set of raw fixes, once."""
    sources = distinct_fixes(runs)
    return [("raw fix" if len(sources) == 1 else "raw fix, " + run.label, run.fixes) for run in sources]


def plot_distributions(path, runs, colours):
    """The distributions of the position errors, and of the raw fixes'."""
    figure, axes = plt.subplots(figsize=(8.5, 4.6))
    for run in runs:
        if run.is_fix and run.has_fixes():
            continue
        values, share = distribution(run.errors["position_error_m"])
        axes.plot(values, share, drawstyle="steps-post", color=colours[run.name], linewidth=1.6, label=run.label)
    for style, (label, fixes) in zip(("--", ":", "-.") * len(runs), raw_fixes(runs)):
        values, share = distribution(fixes["error_m"])
        axes.plot(values, share, drawstyle="steps-post", linestyle=style, linewidth=1.3, color="#777777", label=label)
    axes.set_xscale("log")
    axes.set_xlim(left=lower_end(runs))
    axes.set_ylim(0.0, 1.02)
    common.plain_ticks(axes.xaxis, (1.0, 2.0, 5.0))
    common.light_grid(axes)
    axes.set_ylabel("share of the time with a smaller error")
    axes.set_xlabel("position error [m]")
    common.legend_beside(axes)
    common.save_figure(figure, path)


def plot_overview(path, runs, colours, title):
    """All runs and the raw fixes: a map beside the errors over time."""
    shown = [run for run in runs if not run.is_fix] or runs
    figure, (left, right) = plt.subplots(1, 2, figsize=(14.0, 4.6), gridspec_kw={"width_ratios": (1.15, 1.2), "wspace": 0.15})
    start = min((run.errors["t"][0] for run in shown if len(run.errors)), default=0.0)
    for label, fixes in raw_fixes(runs):
        left.plot(fixes["fix_x"], fixes["fix_y"], ".", color=common.FIX_COLOUR, markersize=2.5)
        right.plot(fixes["t"] - start, np.maximum(fixes["error_m"], OVERVIEW_LEAST_M), ".", color=common.FIX_COLOUR,
                   markersize=2.5, label=label)
    longest = max(shown, key=lambda run: len(run.errors))
    t, truth_x, truth_y = break_gaps(longest.errors["t"], longest.errors["truth_x"], longest.errors["truth_y"])
    left.plot(truth_x, truth_y, color=common.TRUTH_COLOUR, linewidth=2.0)
    for run in shown:
        t, x, y, error = break_gaps(run.errors["t"] - start, run.errors["est_x"], run.errors["est_y"],
                                    run.errors["position_error_m"])
        left.plot(x, y, color=colours[run.name], linewidth=1.1)
        right.plot(t, np.maximum(error, OVERVIEW_LEAST_M), color=colours[run.name], linewidth=1.2, label=run.label)
    right.plot([], [], color=common.TRUTH_COLOUR, linewidth=2.0, label="truth")
    limits = view_limits(longest.errors)
    if limits:
        left.set_xlim(limits[0], limits[1])
        left.set_ylim(limits[2], limits[3])
    left.set_aspect("equal", adjustable="box")
    left.set_xlabel("east [m]")
    left.set_ylabel("north [m]")
    right.set_yscale("log")
    common.plain_ticks(right.yaxis, (1.0, 2.0, 5.0))
    right.set_xlabel("time [s]")
    right.set_ylabel("position error [m]")
    for axes in (left, right):
        common.light_grid(axes)
    left.set_title(title, fontsize=12)
    right.set_title("How far off", fontsize=12)
    common.legend_beside(right)
    common.save_figure(figure, path)


STATISTICS = ("mean", "sigma", "rmse", "median", "p95", "max")
STATISTIC_LABELS = ("mean", "\u03c3", "RMSE", "median", "95 %", "max")


def position_row(run):
    """Position errors of one run as text."""
    def cell(*keys, digits=2, scale=1.0):
        return common.format_number(scale * common.number(run.metrics, *keys), digits)
    return ((run.label, cell("samples", digits=0), cell("coverage", digits=1, scale=100.0))
            + tuple(cell("position_m", statistic) for statistic in STATISTICS)
            + (cell("share_below_5m", digits=1, scale=100.0), cell("share_below_10m", digits=1, scale=100.0),
               cell("nees_mean")))


def heading_row(run):
    """Heading errors of one run in degrees as text."""
    degrees = 180.0 / np.pi
    return (run.label,) + tuple(
        common.format_number(degrees * common.number(run.metrics, "heading_rad", statistic))
        for statistic in STATISTICS)


def add_tables(page, runs, colours):
    """The tables of all runs."""
    page.heading("Position errors [m]")
    page.table(("run", "samples", "coverage [%]") + STATISTIC_LABELS
               + ("< 5 m [%]", "< 10 m [%]", "mean NEES"),
               [position_row(run) for run in runs], colours)
    page.paragraph("Coverage: share of the truth's samples that have an estimate. NEES: squared error in "
                   "units of the estimate's own covariance, of x, y and yaw: 3 is honest, more is an estimate that is "
                   "worse than it claims.")
    page.heading("Heading errors [deg]")
    page.table(("run",) + STATISTIC_LABELS, [heading_row(run) for run in runs], colours)


def read_tracks(directory, metrics):
    """What the page draws of each track, in the order in which `evaluate` was given them."""
    return [track_view.read_track(os.path.join(directory, "data", "track_" + name.replace("/", "_") + ".json"))
            for name in metrics.get("order", metrics.get("tracks", {}))]


# Quantity, keys, digits, factor.
TRACK_ROWS = (("time [s]", ("duration_s",), 1, 1.0), ("way [m]", ("distance_m",), 0, 1.0),
              ("claimed \u03c3, median [m]", ("sigma_m", "median"), 2, 1.0),
              ("claimed \u03c3, 95 % [m]", ("sigma_m", "p95"), 2, 1.0),
              ("speed, mean [m/s]", ("speed_mps", "mean"), 1, 1.0), ("speed, max [m/s]", ("speed_mps", "max"), 1, 1.0),
              ("gaps of the estimate", ("gaps",), 0, 1.0), ("the longest [s]", ("longest_gap_s",), 1, 1.0),
              ("fixes", ("fixes",), 0, 1.0), ("of them used [%]", ("used_share",), 1, 100.0),
              ("longest time without a used fix [s]", ("longest_gap_of_fixes_s",), 1, 1.0),
              ("NIS, median", ("nis", "median"), 2, 1.0), ("NIS above its threshold [%]", ("nis_above_threshold",), 1, 100.0),
              ("healthy [% of the time]", ("healthy_share",), 1, 100.0))


def used_share(decisions):
    """The share of the fixes with a decision that were used; NaN without one."""
    judged = sum(count for decision, count in decisions.items() if decision != "unknown")
    return sum(decisions.get(decision, 0) for decision in USED) / judged if judged else float("nan")


def track_table(tracks):
    """Header and rows: what is known of each track, a column each."""
    known = {name: dict(track, used_share=used_share(track.get("decisions", {}))) for name, track in tracks.items()}
    rows = [[label] + [common.format_number(factor * common.number(track, *keys), digits) for track in known.values()]
            for label, keys, digits, factor in TRACK_ROWS]
    return ["track"] + list(known), rows


def add_track_part(page, tracks, metrics, colours):
    """The map, and a table of what is known without a truth."""
    track_view.add_tracks(page, tracks, colours)
    page.table(*track_table(metrics["tracks"]))
    page.paragraph("\u03c3: of the position, along the worse direction. NIS: squared innovation of a fix in units of its "
                   "expected covariance.")


def pictured(runs):
    """The runs with pictures of their own: not the raw fixes, which are in those of the estimates."""
    return [run for run in runs if not run.is_fix] or runs


def add_error_part(page, runs, colours, output):
    """Tables, distributions and pictures of runs with a truth."""
    by_label = {run.label: colours[run.name] for run in runs}
    plot_overview(output("overview.png"), runs, colours, "Where the robot was")
    page.image("overview.png", "Left: map. Right: position errors over time (logarithmic, cut at {:g} m).".format(
        OVERVIEW_LEAST_M))
    add_tables(page, runs, by_label)
    page.heading("Distribution of the position errors")
    plot_distributions(output("cdf.png"), runs, colours)
    page.image("cdf.png", "Share of the position errors up to a value (logarithmic); grey: the raw fixes.")
    for run in pictured(runs):
        page.heading(run.label)
        if not len(run.errors):
            page.paragraph("This run has no samples.")
        trajectory, errors = "trajectory_" + run.file_name + ".png", "errors_" + run.file_name + ".png"
        page.image(trajectory, plot_trajectory(output(trajectory), run, colours[run.name]))
        plot_errors(output(errors), run, colours[run.name])
        page.image(errors, "Position error with the estimate's own 1 \u03c3 (shaded), and heading error.")


def make_report(directory):
    """Make all figures and the page; gives the path of the page."""
    metrics_path = os.path.join(directory, "metrics.json")
    metrics = common.read_json(metrics_path)
    runs = read_runs(directory, metrics, metrics_path)
    tracks = read_tracks(directory, metrics)
    if not runs and not tracks:
        raise common.ReportError("{}: neither runs nor tracks".format(metrics_path))
    colours = run_colours(runs, metrics.get("tracks", {}))

    def output(name):
        return os.path.join(directory, name)

    page = common.HtmlPage("Evaluation against the truth" if runs else "Tracks", directory)
    if tracks:
        add_track_part(page, tracks, metrics, colours)
    if runs:
        add_error_part(page, runs, colours, output)
    page.provenance(metrics, without=("runs", "tracks", "order"))
    page.save(output("report.html"))
    return output("report.html")


if __name__ == "__main__":
    common.run_main(make_report)
