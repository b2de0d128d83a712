#!/usr/bin/env python3
"""Figure 6 of Kim et al. from the runs of bias_experiment, and the table of its errors.

usage: plot_bias_experiment.py DIR

Reads DIR/metrics.json and DIR/data/<scenario>/{truth,fixes,estimate_<filter>,bias_compensated}.csv, of the first seed.
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
FILTERS = ("standard", "gated", "compensated", "standard_as_printed", "gated_as_printed", "withheld")
# Those that are drawn.
COLOURS = {"standard": "#d55e00", "gated": "#e69f00", "compensated": "#0072b2", "withheld": "#8a8a8a"}


def read(directory, name, columns):
    """The table DIR/<name>.csv."""
    return common.read_csv(os.path.join(directory, name + ".csv"), columns)


def shade_between(axes, truth):
    """The time between the buildings."""
    inside = truth["t"][truth["phase"] == 1]
    if len(inside):
        axes.axvspan(inside[0], inside[-1], color=common.SHADOW_COLOUR, zorder=0)


def draw(directory, path, seed):
    """The figure of one drive."""
    truth = read(directory, "truth", ("t", "x", "y", "phase"))
    fixes = read(directory, "fixes", ("t", "error_x", "error_y"))
    bias = read(directory, "bias_compensated", ("t", "bias_x", "bias_y", "sigma_x", "sigma_y", "doubted"))
    estimates = {name: read(directory, "estimate_" + name, ("t", "x", "y", "error_m", "sigma_m")) for name in COLOURS}

    figure = plt.figure(figsize=(11, 12))
    grid = figure.add_gridspec(4, 1, height_ratios=(1.5, 1.0, 0.9, 0.9), hspace=0.32)
    track = figure.add_subplot(grid[0])
    track.set_title("seed {}".format(seed), loc="left", fontsize=10)
    at = [np.interp(fixes["t"], truth["t"], truth[axis]) for axis in ("x", "y")]
    track.plot(at[0] + fixes["error_x"], at[1] + fixes["error_y"], ".", markersize=2.5, color=common.FIX_COLOUR,
               label="fix")
    for name in COLOURS:
        track.plot(estimates[name]["x"], estimates[name]["y"], color=COLOURS[name], linewidth=1.2, label=name)
    track.plot(truth["x"], truth["y"], color=common.TRUTH_COLOUR, linewidth=1.0, label="truth")
    track.set_aspect("equal", adjustable="datalim")
    track.set_xlabel("east, m")
    track.set_ylabel("north, m")

    error = figure.add_subplot(grid[1])
    shade_between(error, truth)
    error.plot(fixes["t"], np.hypot(fixes["error_x"], fixes["error_y"]), ".", markersize=2.0,
               color=common.FIX_COLOUR, label="fix")
    for name in COLOURS:
        error.plot(estimates[name]["t"], estimates[name]["error_m"], color=COLOURS[name], linewidth=1.2, label=name)
    error.plot(estimates["compensated"]["t"], 2.0 * estimates["compensated"]["sigma_m"], ":",
               color=COLOURS["compensated"], linewidth=1.0, label="its 2 sigma")
    top = max(np.nanmax(np.hypot(fixes["error_x"], fixes["error_y"])),
              max(np.nanpercentile(estimates[name]["error_m"], 99.0) for name in COLOURS))
    error.set_ylim(0.0, 1.1 * top)
    error.set_ylabel("position error, m")

    for row, axis in ((2, "x"), (3, "y")):
        axes = figure.add_subplot(grid[row], sharex=error)
        shade_between(axes, truth)
        is_open = bias["doubted"] > 0.0
        estimate = np.where(is_open, bias["bias_" + axis], np.nan)
        sigma = bias["sigma_" + axis]
        axes.plot(fixes["t"], fixes["error_" + axis], color=common.FIX_COLOUR, linewidth=1.0, label="true error of the fix")
        axes.fill_between(bias["t"], estimate - 2.0 * sigma, estimate + 2.0 * sigma, color=COLOURS["compensated"],
                          alpha=0.15, linewidth=0)
        axes.plot(bias["t"], estimate, color=COLOURS["compensated"], linewidth=1.2, label="estimated bias, 2 sigma")
        axes.set_ylim(1.8 * np.nanmin(fixes["error_" + axis]) - 2.0, 1.8 * np.nanmax(fixes["error_" + axis]) + 2.0)
        axes.set_ylabel(("east" if axis == "x" else "north") + ", m")
        common.light_grid(axes)
        common.legend_beside(axes)
    axes.set_xlabel("time, s")
    for axes in (track, error):
        common.light_grid(axes)
        common.legend_beside(axes)
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
            settling(row) if name == "compensated" else ""))
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
    with open(os.path.join(directory, "table.md"), "w", encoding="utf-8") as stream:
        stream.write("\n".join(parts))
    return "{}: fig6_*.png, table.md".format(directory)


if __name__ == "__main__":
    common.run_main(make_report)
