#!/usr/bin/env python3
"""Trajectories, errors over time and error distributions of evaluated runs, and a report of all of them.

usage: plot_evaluation.py DIR

Reads DIR/metrics.json and, for each of its runs, DIR/data/errors_<run>.csv and, if there is one,
DIR/data/fixes_<run>.csv; a slash in the name of a run is an underscore in file names. Runs are named
<data set>/<method>. Writes trajectory_<run>.png and errors_<run>.png for each run, cdf.png and
report.html into DIR.
"""

import os
import sys

# In a devel space this file runs through a wrapper in another directory; the module lies beside the source.
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import numpy as np  # noqa: E402

import report_common as common  # noqa: E402
from report_common import plt  # noqa: E402

ERROR_COLUMNS = ("t", "position_error_m", "heading_error_rad", "est_x", "est_y", "truth_x", "truth_y",
                 "sigma_m", "nees")
FIX_COLUMNS = ("t", "fix_x", "fix_y", "error_m")

SMALLEST_MARGIN_M = 15.0
RELATIVE_MARGIN = 0.15
SMALLEST_ERROR_M = 1e-3
LONGEST_GAP_S = 5.0


class Run:
    """The data of one run; `group` is its name up to the last slash, `method` the rest."""

    def __init__(self, directory, name, metrics):
        self.name = name
        self.metrics = metrics
        self.file_name = name.replace("/", "_")
        self.group, _, self.method = name.rpartition("/")
        data = os.path.join(directory, "data")
        self.errors = common.read_csv(os.path.join(data, "errors_" + self.file_name + ".csv"), ERROR_COLUMNS)
        self.fixes = common.read_optional_csv(os.path.join(data, "fixes_" + self.file_name + ".csv"),
                                              FIX_COLUMNS)

    def has_fixes(self):
        """Whether there is at least one raw fix."""
        return self.fixes is not None and len(self.fixes) > 0


def read_runs(directory, metrics, path):
    """The runs of metrics.json, in its order; no two may share their files."""
    runs = []
    owners = {}
    for name, values in common.require_object(metrics, "runs", path).items():
        run = Run(directory, name, values)
        if run.file_name in owners:
            raise common.ReportError("{}: runs {} and {} have the same file names".format(
                path, owners[run.file_name], name))
        owners[run.file_name] = name
        runs.append(run)
    return runs


def run_colours(runs):
    """A colour for each run: that of its method."""
    colours = common.method_colours(list(dict.fromkeys(run.method for run in runs)))
    return {run.name: colours[run.method] for run in runs}


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
    axes.plot(est_x, est_y, color=colour, linewidth=1.3, marker=marker_for(est_x), label="estimate")
    notes.append((count_outside(errors["est_x"], errors["est_y"], limits), len(errors), "estimates"))
    axes.set_aspect("equal")
    axes.set_xlim(limits[0], limits[1])
    axes.set_ylim(limits[2], limits[3])
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(run.name, fontsize=11)
    common.light_grid(axes)
    common.legend_beside(axes)
    common.save_figure(figure, path)
    outside = ["{} of {} {}".format(count, total, what) for count, total, what in notes if count]
    return "Trajectory of {}.{}".format(
        run.name, " Outside the view: {}.".format(" and ".join(outside)) if outside else "")


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
    top.set_title(run.name, fontsize=11)
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


def draw_distributions(axes, runs, colours):
    """The distributions of the position errors of a group of runs, and of their raw fixes."""
    for run in runs:
        values, share = distribution(run.errors["position_error_m"])
        axes.plot(values, share, drawstyle="steps-post", color=colours[run.name], linewidth=1.6,
                  label=run.method)
    sources = distinct_fixes(runs)
    for run in sources:
        values, share = distribution(run.fixes["error_m"])
        alone = len(sources) == 1
        axes.plot(values, share, drawstyle="steps-post", linestyle="--", linewidth=1.3,
                  color="#777777" if alone else colours[run.name],
                  label="raw fixes" if alone else "raw fixes, " + run.method)
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.02)
    common.plain_ticks(axes.xaxis)
    common.light_grid(axes)


def lower_end(runs):
    """Where the axis of errors begins: the smallest 1 % quantile of all runs; none without data."""
    samples = [common.finite(run.errors["position_error_m"]) for run in runs]
    quantiles = [np.percentile(values, 1.0) for values in samples if len(values)]
    return 0.9 * max(min(quantiles), SMALLEST_ERROR_M) if quantiles else None


def plot_distributions(path, runs, colours):
    """The distributions of the position errors: one panel for each group of runs."""
    groups = list(dict.fromkeys(run.group for run in runs))
    columns = min(2, len(groups))
    rows = (len(groups) + columns - 1) // columns
    figure, grid = plt.subplots(rows, columns, squeeze=False, sharex=True, sharey=True,
                                figsize=(7.5 if columns == 1 else 12.5, 4.4 * rows))
    handles = {}
    for axes, group in zip(grid.ravel(), groups):
        draw_distributions(axes, [run for run in runs if run.group == group], colours)
        axes.set_title(group, fontsize=11)
        axes.tick_params(labelbottom=True)
        for handle, label in zip(*axes.get_legend_handles_labels()):
            handles.setdefault(label, handle)
    for axes in grid.ravel()[len(groups):]:
        axes.set_axis_off()
    for axes in grid[:, 0]:
        axes.set_ylabel("share of errors up to x")
    for axes in grid.ravel()[max(0, len(groups) - columns):len(groups)]:
        axes.set_xlabel("position error [m]")
    grid[0, 0].set_xlim(left=lower_end(runs))
    common.legend_beside(grid[0, -1], handles=list(handles.values()), labels=list(handles))
    figure.subplots_adjust(hspace=0.25, wspace=0.06)
    common.save_figure(figure, path)


STATISTICS = ("mean", "sigma", "rmse", "median", "p95", "max")
STATISTIC_LABELS = ("mean", "\u03c3", "RMSE", "median", "95 %", "max")


def position_row(run):
    """Position errors of one run as text."""
    def cell(*keys, digits=2, scale=1.0):
        return common.format_number(scale * common.number(run.metrics, *keys), digits)
    return ((run.name, cell("samples", digits=0), cell("coverage", digits=1, scale=100.0))
            + tuple(cell("position_m", statistic) for statistic in STATISTICS)
            + (cell("share_below_5m", digits=1, scale=100.0), cell("share_below_10m", digits=1, scale=100.0),
               cell("nees_mean")))


def heading_row(run):
    """Heading errors of one run in degrees as text."""
    degrees = 180.0 / np.pi
    return (run.name,) + tuple(
        common.format_number(degrees * common.number(run.metrics, "heading_rad", statistic))
        for statistic in STATISTICS)


def add_tables(page, runs, colours):
    """The tables of all runs."""
    page.heading("Position errors [m]")
    page.table(("run", "samples", "coverage [%]") + STATISTIC_LABELS
               + ("< 5 m [%]", "< 10 m [%]", "mean NEES"),
               [position_row(run) for run in runs], colours)
    page.paragraph("Coverage: share of the truth's samples that have an estimate. NEES: squared error in "
                   "units of the estimate's own covariance; a consistent estimate has the number of its "
                   "dimensions on average.")
    page.heading("Heading errors [deg]")
    page.table(("run",) + STATISTIC_LABELS, [heading_row(run) for run in runs], colours)


def make_report(directory):
    """Make all figures and the page; gives the path of the page."""
    metrics_path = os.path.join(directory, "metrics.json")
    metrics = common.read_json(metrics_path)
    runs = read_runs(directory, metrics, metrics_path)
    colours = run_colours(runs)

    def output(name):
        return os.path.join(directory, name)

    page = common.HtmlPage("Evaluation against the truth")
    add_tables(page, runs, colours)
    page.heading("Distribution of the position errors")
    plot_distributions(output("cdf.png"), runs, colours)
    page.image("cdf.png", "Share of the position errors up to a value (logarithmic); dashed: the raw fixes.")
    for run in runs:
        page.heading(run.name)
        if not len(run.errors):
            page.paragraph("This run has no samples.")
        trajectory, errors = "trajectory_" + run.file_name + ".png", "errors_" + run.file_name + ".png"
        page.image(trajectory, plot_trajectory(output(trajectory), run, colours[run.name]))
        plot_errors(output(errors), run, colours[run.name])
        page.image(errors, "Position error with the estimate's own 1 \u03c3 (shaded), and heading error.")
    page.provenance(metrics, without=("runs",))
    page.save(output("report.html"))
    return output("report.html")


if __name__ == "__main__":
    common.run_main(make_report)
