#!/usr/bin/env python3
"""Figure 6 of Kim et al. from the runs of bias_experiment, and the table of its errors.

usage: plot_bias_experiment.py DIR

Reads DIR/metrics.json and DIR/data/<scenario>/{truth,fixes,estimate_<filter>,bias_<filter>}.csv, of the first seed.
Writes fig6_<scenario>.png for each scenario and table.md into DIR.
"""

import os
import sys

# In a devel space this file runs through a wrapper in another directory; the module lies beside the source.
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import numpy as np  # noqa: E402

import report_common as common  # noqa: E402
from report_common import plt  # noqa: E402

PHASES = ("before", "between", "after")
FILTERS = ("standard", "gated", "compensated", "standard_as_printed", "gated_as_printed", "compensated_as_printed",
           "withheld")
COLOURS = {"standard": "#d55e00", "gated": "#e69f00", "compensated": "#0072b2", "withheld": "#8a8a8a",
           "standard_as_printed": "#d55e00", "compensated_as_printed": "#0072b2"}
# What is drawn above each other: the two filters of the paper's figure as printed, and those of this package.
GROUPS = (("as printed", ("standard_as_printed", "compensated_as_printed")),
          ("as read here", ("standard", "gated", "compensated", "withheld")))
COMPENSATED = ("compensated_as_printed", "compensated")  # by group


def read(directory, name, columns):
    """The table DIR/<name>.csv."""
    return common.read_csv(os.path.join(directory, name + ".csv"), columns)


def shade_between(axes, truth):
    """The time between the buildings."""
    inside = truth["t"][truth["phase"] == 1]
    if len(inside):
        axes.axvspan(inside[0], inside[-1], color=common.SHADOW_COLOUR, zorder=0)


def draw_track(axes, title, truth, fixes, estimates):
    """Figure 6: truth, fixes and the trajectories of some filters."""
    axes.set_title(title, loc="left", fontsize=10)
    at = [np.interp(fixes["t"], truth["t"], truth[axis]) for axis in ("x", "y")]
    axes.plot(at[0] + fixes["error_x"], at[1] + fixes["error_y"], ".", markersize=2.5, color=common.FIX_COLOUR,
              label="fix")
    for name, estimate in estimates.items():
        axes.plot(estimate["x"], estimate["y"], color=COLOURS[name], linewidth=1.2, label=name)
    axes.plot(truth["x"], truth["y"], color=common.TRUTH_COLOUR, linewidth=1.0, label="truth")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")


def draw_error(axes, title, truth, fixes, estimates, compensated):
    """Position errors over time, with two standard deviations of the compensated filter."""
    axes.set_title(title, loc="left", fontsize=10)
    shade_between(axes, truth)
    size = np.hypot(fixes["error_x"], fixes["error_y"])
    axes.plot(fixes["t"], size, ".", markersize=2.0, color=common.FIX_COLOUR, label="fix")
    for name, estimate in estimates.items():
        axes.plot(estimate["t"], estimate["error_m"], color=COLOURS[name], linewidth=1.2, label=name)
    axes.plot(estimates[compensated]["t"], 2.0 * estimates[compensated]["sigma_m"], ":",
              color=COLOURS[compensated], linewidth=1.0, label="its 2 sigma")
    top = max(np.nanmax(size), max(np.nanpercentile(each["error_m"], 99.0) for each in estimates.values()))
    axes.set_ylim(0.0, 1.1 * top)
    axes.set_ylabel("position error, m")


def draw_bias(axes, axis, truth, fixes, biases):
    """The estimated bias along one axis, where its filter is open, and the true error of the fix."""
    shade_between(axes, truth)
    axes.plot(fixes["t"], fixes["error_" + axis], color=common.FIX_COLOUR, linewidth=1.0, label="true error of the fix")
    for name, style, label in (("compensated", "-", "estimated bias, 2 sigma"),
                               ("compensated_as_printed", "--", "the same as printed")):
        bias = biases[name]
        estimate = np.where(bias["doubted"] > 0.0, bias["bias_" + axis], np.nan)
        if style == "-":
            axes.fill_between(bias["t"], estimate - 2.0 * bias["sigma_" + axis], estimate + 2.0 * bias["sigma_" + axis],
                              color=COLOURS[name], alpha=0.15, linewidth=0)
        axes.plot(bias["t"], estimate, style, color=COLOURS[name], linewidth=1.2, label=label)
    axes.set_ylim(1.8 * np.nanmin(fixes["error_" + axis]) - 2.0, 1.8 * np.nanmax(fixes["error_" + axis]) + 2.0)
    axes.set_ylabel(("east" if axis == "x" else "north") + ", m")


def draw(directory, path, seed):
    """The figure of one drive."""
    truth = read(directory, "truth", ("t", "x", "y", "phase"))
    fixes = read(directory, "fixes", ("t", "error_x", "error_y"))
    biases = {name: read(directory, "bias_" + name, ("t", "bias_x", "bias_y", "sigma_x", "sigma_y", "doubted"))
              for name in COMPENSATED}
    figure = plt.figure(figsize=(11, 18))
    grid = figure.add_gridspec(6, 1, height_ratios=(1.5, 1.5, 1.0, 1.0, 0.9, 0.9), hspace=0.35)
    first_error = None
    for row, ((title, names), compensated) in enumerate(zip(GROUPS, COMPENSATED)):
        estimates = {name: read(directory, "estimate_" + name, ("t", "x", "y", "error_m", "sigma_m")) for name in names}
        track = figure.add_subplot(grid[row])
        draw_track(track, "{}, seed {}".format(title, seed), truth, fixes, estimates)
        error = figure.add_subplot(grid[2 + row], sharex=first_error)
        draw_error(error, title, truth, fixes, estimates, compensated)
        first_error = first_error or error
    for row, axis in ((4, "x"), (5, "y")):
        draw_bias(figure.add_subplot(grid[row], sharex=first_error), axis, truth, fixes, biases)
    for axes in figure.axes:
        common.light_grid(axes)
        common.legend_beside(axes)
    figure.axes[-1].set_xlabel("time, s")
    common.save_figure(figure, path)


def settling(row):
    """How long the bias took to become insignificant in the slowest drive, and in how many it did not."""
    times = row["settling_time_by_seed_s"]
    settled = [time for time in times if time is not None]
    if not settled:
        return ""
    left = len(times) - len(settled)
    return "at most {:.0f}".format(max(settled)) + (", {} not".format(left) if left else "")


def table_of(scenario):
    """The errors of one scenario as a table of Markdown."""
    lines = ["Mean error and NEES: before / between / after the buildings. Settled: time from leaving the buildings until",
             "the bias is insignificant, in the slowest drive.",
             "",
             "| | mean error, m | max between, m | NEES (3) | doubted between, % | settled, s |",
             "|---|---|---|---|---|---|"]
    rows = [("fixes", scenario["fixes"])] + [(name, scenario["filters"][name]) for name in FILTERS]
    for name, row in rows:
        means = " / ".join(common.format_number(common.number(row, phase, "position_mean_m")) for phase in PHASES)
        nees = " / ".join(common.format_number(common.number(row, phase, "nees_mean"), 1) for phase in PHASES)
        lines.append("| {} | {} | {} | {} | {} | {} |".format(
            name, means, common.format_number(common.number(row, "between", "position_max_m"), 1),
            nees if name != "fixes" else "", common.format_number(
                100.0 * common.number(row, "between", "doubted_share"), 1) if name != "fixes" else "",
            settling(row) if name in COMPENSATED else ""))
    return "\n".join(lines)


def make_report(directory):
    """Write the figures and the table; gives the sentence that says where they are."""
    path = os.path.join(directory, "metrics.json")
    metrics = common.read_json(path)
    scenarios = common.require_object(metrics, "scenarios", path)
    parts = []
    for name in metrics.get("scenario_order", scenarios):
        draw(os.path.join(directory, "data", name), os.path.join(directory, "fig6_{}.png".format(name)),
             metrics["seeds"][0])
        parts.append("## {}\n\n{}\n".format(name, table_of(scenarios[name])))
    common.write_text(os.path.join(directory, "table.md"), "\n".join(parts))
    return "{}: fig6_*.png, table.md".format(directory)


if __name__ == "__main__":
    common.run_main(make_report)
