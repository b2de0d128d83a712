#!/usr/bin/env python3
"""Figures 7, 8 and 9 of Nishida et al. (2013), the errors over many seeds, and a report of the experiment.

usage: plot_paper_experiment.py DIR

Reads DIR/metrics.json and, in DIR/data, targets.csv and for each method trajectory_<method>.csv,
snapshots_<method>.csv with particles_<method>.csv, and errors_over_seeds_<method>.csv (each optional for a
single method). If DIR/city holds what `evaluate` wrote of a drive, the page begins with it. Writes fig7_particles.png, fig8_trajectories.png, fig9_errors.png, errors_over_seeds.png,
summary.png and report.html into DIR.
"""

import os
import sys

# In a devel space this file runs through a wrapper in another directory; the module lies beside the source.
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import numpy as np  # noqa: E402
from matplotlib.ticker import MultipleLocator  # noqa: E402

import plot_evaluation  # noqa: E402
import report_common as common  # noqa: E402
from report_common import plt  # noqa: E402

PREFERRED_PANELS = ("paper", "switching", "conventional", "literal", "oracle")
MAX_PANELS = 4
VIEW_MARGIN_M = 12.0
CITY = "city"
LIVE = "live"
SNAPSHOT_HALF_WIDTHS_M = (8.0, 16.0, 32.0)  # the first that shows most of a panel
SHOWN_SHARE = 0.9  # of the particles
MEDIAN_S = 0.5  # of figure 9
SMALLEST_ERROR_M = 1e-3

# Figure 7 only: its estimate and fix are single marks on top of coloured particles.
ESTIMATE_COLOUR = "#0072b2"
FIX_COLOUR = "#d62728"

TARGET_COLUMNS = ("x", "y")
TRAJECTORY_COLUMNS = ("t", "lap", "true_x", "true_y", "true_yaw", "est_x", "est_y", "est_yaw", "fix_x",
                      "fix_y", "in_shadow")
SNAPSHOT_COLUMNS = ("snapshot", "t", "true_x", "true_y", "true_yaw", "est_x", "est_y", "est_yaw", "fix_x",
                    "fix_y", "radius")
PARTICLE_COLUMNS = ("snapshot", "x", "y", "yaw", "weight")
SEED_COLUMNS = ("t", "position_rmse_m", "position_p95_m", "heading_rmse_rad")


def read_per_method(directory, kind, methods, columns):
    """The tables DIR/data/<kind>_<method>.csv that exist and have rows, by method."""
    tables = {}
    for method in methods:
        path = os.path.join(directory, "data", kind + "_" + method + ".csv")
        table = common.read_optional_csv(path, columns)
        if table is not None and len(table):
            tables[method] = table
    return tables


def name_list(names):
    """The names for a caption."""
    return ", ".join(names) if names else "none"


def without(methods, tables):
    """A sentence on the methods that have no table; empty when all have one."""
    absent = [method for method in methods if method not in tables]
    return " No data for: {}.".format(name_list(absent)) if absent else ""


def distance_from_truth(state, x, y):
    """Along the axis on which it is larger."""
    return np.maximum(abs(x - state["true_x"]), abs(y - state["true_y"]))


def half_width(state, particles):
    """Of the window around the truth that shows estimate, fix and most particles, if one does."""
    wanted = [distance_from_truth(state, state[name + "_x"], state[name + "_y"]) for name in ("est", "fix")]
    if len(particles):
        wanted.append(np.quantile(distance_from_truth(state, particles["x"], particles["y"]), SHOWN_SHARE))
    fitting = [width for width in SNAPSHOT_HALF_WIDTHS_M if width > 1.05 * np.nanmax(wanted)]
    return fitting[0] if fitting else SNAPSHOT_HALF_WIDTHS_M[-1]


def draw_snapshot(axes, state, particles):
    """One panel of figure 7; gives the coloured particles for the colour bar."""
    width = half_width(state, particles)
    axes.axvspan(-1e4, 0.0, color=common.SHADOW_COLOUR, zorder=0)
    weight = particles["weight"]
    largest = np.max(weight) if len(weight) and np.max(weight) > 0.0 else 1.0
    order = np.argsort(weight)
    points = axes.scatter(particles["x"][order], particles["y"][order], c=weight[order] / largest, s=7,
                          cmap="viridis_r", vmin=0.0, vmax=1.0, linewidths=0, alpha=0.8, zorder=2)
    if np.isfinite(state["radius"]):
        axes.add_patch(plt.Circle((state["est_x"], state["est_y"]), state["radius"], fill=False,
                                  color=ESTIMATE_COLOUR, linewidth=1.2, linestyle="--", zorder=3))
    axes.quiver(state["true_x"], state["true_y"], np.cos(state["true_yaw"]), np.sin(state["true_yaw"]),
                angles="xy", scale_units="xy", scale=0.4 * SNAPSHOT_HALF_WIDTHS_M[0] / width, width=0.012, color=common.TRUTH_COLOUR, zorder=5)
    axes.plot(state["est_x"], state["est_y"], "o", color=ESTIMATE_COLOUR, markeredgecolor="white",
              markersize=7, zorder=6)
    axes.plot(state["fix_x"], state["fix_y"], "X", color=FIX_COLOUR, markeredgecolor="white",
              markersize=8, zorder=4)

    axes.set_aspect("equal")
    step = 5.0 * width / SNAPSHOT_HALF_WIDTHS_M[0]
    axes.xaxis.set_major_locator(MultipleLocator(step))
    axes.yaxis.set_major_locator(MultipleLocator(step))
    axes.set_xlim(state["true_x"] - width, state["true_x"] + width)
    axes.set_ylim(state["true_y"] - width, state["true_y"] + width)
    note_what_is_outside(axes, state, particles, width)
    common.light_grid(axes)
    return points


def note_what_is_outside(axes, state, particles, width):
    """Say in the panel what its window of this half width does not show."""
    def is_outside(x, y):
        return distance_from_truth(state, x, y) > width
    outside = [name for name in ("estimate", "fix")
               if is_outside(state[name[:3] + "_x"], state[name[:3] + "_y"])]
    lost = int(np.sum(is_outside(particles["x"], particles["y"])))
    if lost:
        outside.append("{} particles".format("all" if lost == len(particles) else lost))
    if outside:
        axes.text(0.03, 0.03, "outside: " + ", ".join(outside), transform=axes.transAxes, fontsize=8,
                  zorder=7, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5})


def figure7_legend(figure):
    """What the marks of figure 7 mean, above the panels."""
    handles = [
        plt.Line2D([], [], color=common.TRUTH_COLOUR, marker=r"$\rightarrow$", markersize=14,
                   linestyle="none", label="true pose"),
        plt.Line2D([], [], color=ESTIMATE_COLOUR, marker="o", linestyle="none", label="estimate"),
        plt.Line2D([], [], color=FIX_COLOUR, marker="X", linestyle="none", label="GPS fix"),
        plt.Line2D([], [], color=ESTIMATE_COLOUR, linestyle="--",
                   label=r"radius $\hat{r}$ around the estimate"),
        plt.Rectangle((0, 0), 1, 1, color=common.SHADOW_COLOUR, label="shadow area"),
    ]
    figure.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.47, 1.0), ncol=len(handles),
                  frameon=False)


def plot_figure7(path, snapshots, particles):
    """Particles around the true state at a few instants: a row for each of four methods, a column per instant."""
    methods = choose_panels([method for method in snapshots if method in particles])
    if not methods:
        return False
    columns = max(len(snapshots[method]) for method in methods)
    figure, grid = plt.subplots(len(methods), columns, squeeze=False,
                                figsize=(3.2 * columns + 0.8, 3.35 * len(methods)), constrained_layout=True)
    figure7_legend(figure)
    points = None
    for row, method in zip(grid, methods):
        for axes, state in zip(row, snapshots[method]):
            own = particles[method][particles[method]["snapshot"] == state["snapshot"]]
            points = draw_snapshot(axes, state, own)
            axes.set_title("{} after {:.1f} s".format(method, state["t"]), fontsize=10)
        for axes in row[len(snapshots[method]):]:
            axes.set_axis_off()
        row[0].set_ylabel("y [m]")
    for axes in grid[-1]:
        axes.set_xlabel("x [m]")
    figure.colorbar(points, ax=grid.ravel().tolist(), shrink=0.7,
                    label="weight / largest weight in the panel")
    common.save_figure(figure, path)
    return True


def choose_panels(methods):
    """At most four methods, those of the paper first."""
    preferred = [method for method in PREFERRED_PANELS if method in methods]
    return (preferred + [method for method in methods if method not in preferred])[:MAX_PANELS]


def last_lap(trajectory):
    """The rows of the last lap and its ordinal when there are three laps or more; else all rows and None.

    A lap that has barely begun when the run ends does not count.
    """
    laps = np.unique(trajectory["lap"])
    counts = np.array([np.sum(trajectory["lap"] == lap) for lap in laps])
    begun = np.flatnonzero(counts >= 0.1 * np.mean(counts))
    if len(begun) < 3:
        return trajectory, None
    lap = laps[begun[-1]]
    return trajectory[trajectory["lap"] == lap], int(lap - laps[0]) + 1


def outside_view(trajectory, prefix, limits):
    """Which positions of the truth ("true") or estimate ("est") are outside (x_min, x_max, y_min, y_max)."""
    x, y = trajectory[prefix + "_x"], trajectory[prefix + "_y"]
    return (x < limits[0]) | (x > limits[1]) | (y < limits[2]) | (y > limits[3])


def leaves_view(trajectory, limits):
    """Whether the truth or the estimate leaves the window."""
    return any(np.any(outside_view(trajectory, prefix, limits)) for prefix in ("true", "est"))


def rows_to_show(trajectory, limits):
    """The last lap and how to call it; all laps when the robot is out of the view in the whole last one."""
    shown, lap = last_lap(trajectory)
    if lap is None:
        return shown, ""
    if np.all(outside_view(shown, "true", limits)):
        return trajectory, ", all laps"
    return shown, ", lap {}".format(lap)


def draw_trajectory(axes, trajectory, targets, limits, colour):
    """One panel of figure 8."""
    axes.axvspan(limits[0], 0.0, color=common.SHADOW_COLOUR, zorder=0, label="shadow area (x < 0)")
    axes.plot(trajectory["fix_x"], trajectory["fix_y"], ".", color=common.FIX_COLOUR, markersize=2.5,
              zorder=1, label="GPS fixes")
    axes.plot(trajectory["true_x"], trajectory["true_y"], color=common.TRUTH_COLOUR, linewidth=4.0,
              alpha=0.3, zorder=2, label="truth")
    axes.plot(trajectory["est_x"], trajectory["est_y"], color=colour, linewidth=1.3, zorder=3)
    axes.plot(targets["x"], targets["y"], "+", color=common.TARGET_COLOUR, markersize=11, markeredgewidth=2,
              linestyle="none", zorder=4, label="targets")
    axes.set_aspect("equal")
    axes.set_xlim(limits[0], limits[1])
    axes.set_ylim(limits[2], limits[3])
    common.light_grid(axes)


def plot_figure8(path, trajectories, targets, colours):
    """Truth, estimate and fixes of up to four methods; gives the sentences for the caption."""
    methods = choose_panels(list(trajectories))
    limits = (np.min(targets["x"]) - VIEW_MARGIN_M, np.max(targets["x"]) + VIEW_MARGIN_M,
              np.min(targets["y"]) - VIEW_MARGIN_M, np.max(targets["y"]) + VIEW_MARGIN_M)
    columns = min(2, len(methods))
    rows = (len(methods) + 1) // 2
    figure, grid = plt.subplots(rows, columns, squeeze=False, sharex=True, sharey=True,
                                figsize=(5.4 * columns, 5.5 * rows), constrained_layout=True)
    clipped = []
    for axes, method in zip(grid.ravel(), methods):
        shown, laps = rows_to_show(trajectories[method], limits)
        draw_trajectory(axes, shown, targets, limits, colours[method])
        title = method + laps
        if leaves_view(shown, limits):
            clipped.append(method)
            title += " (leaves the view)"
        axes.set_title(title, fontsize=11)
        axes.tick_params(labelbottom=True, labelleft=True)
    for axes in grid.ravel()[len(methods):]:
        axes.set_axis_off()
    for axes in grid[:, 0]:
        axes.set_ylabel("y [m]")
    for axes in grid.ravel()[max(0, len(methods) - columns):len(methods)]:
        axes.set_xlabel("x [m]")
    estimates = [plt.Line2D([], [], color=colours[method], label="estimate, " + method)
                 for method in methods]
    handles = grid[0, 0].get_legend_handles_labels()[0] + estimates
    figure.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncol=4, frameon=False)
    common.save_figure(figure, path)
    return figure8_caption(methods, clipped)


def figure8_caption(methods, clipped):
    """What figure 8 shows and what it leaves out."""
    caption = ("Trajectories of the truth, the estimate and the GPS fixes of one seed ({}), as the paper's "
               "Fig. 8; the last lap where there are three or more, unless it is out of the view.".format(
                   name_list(methods)))
    if clipped:
        caption += (" The view is clipped to the targets \u00b1 {:g} m; beyond it go: {}.".format(
            VIEW_MARGIN_M, name_list(clipped)))
    return caption


def end_of_time_axis(tables):
    """The last time to show: that of the longest run, but not more than twice the median one."""
    ends = [np.max(table["t"]) for table in tables.values()]
    return min(max(ends), 2.0 * float(np.median(ends)))


def shade_shadow(axes, trajectory):
    """Shade the times at which the truth is in the shadow."""
    axes.fill_between(trajectory["t"], 0.0, 1.0, where=trajectory["in_shadow"] > 0.5,
                      transform=axes.get_xaxis_transform(), color=common.SHADOW_COLOUR, linewidth=0, zorder=0)


def heading_axis(axes):
    """An axis of signed degrees that shows both one degree and half a turn."""
    axes.set_yscale("symlog")
    ticks = (-180, -30, -10, -3, -1, 0, 1, 3, 10, 30, 180)
    axes.set_yticks(ticks)
    axes.set_yticklabels([str(tick) for tick in ticks])
    axes.minorticks_off()
    low, high = axes.get_ylim()
    axes.set_ylim(max(min(low, -3.5), -250.0), min(max(high, 3.5), 250.0))


def running_median(t, values, seconds):
    """Of a window about each sample, which shows lines that noise would hide. Angles must not wrap within it."""
    if len(t) < 3:
        return values
    half = int(0.5 * seconds / max(float(np.median(np.diff(t))), 1e-6))
    padded = np.pad(np.asarray(values, dtype=float), half, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)


def plot_figure9(path, all_trajectories, colours):
    """Position and heading error of one seed over time; gives the sentences for the caption."""
    trajectories = {method: all_trajectories[method] for method in choose_panels(list(all_trajectories))}
    figure, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(10.5, 7.0))
    end = end_of_time_axis(trajectories)
    first = next(iter(trajectories))
    for axes in (top, bottom):
        shade_shadow(axes, trajectories[first])
        common.light_grid(axes)
    for depth, (method, rows) in enumerate(trajectories.items()):
        above = 3.0 - 0.01 * depth
        position = np.hypot(rows["est_x"] - rows["true_x"], rows["est_y"] - rows["true_y"])
        heading = common.line_degrees(rows["est_yaw"] - rows["true_yaw"])
        top.plot(rows["t"], np.maximum(running_median(rows["t"], position, MEDIAN_S), SMALLEST_ERROR_M),
                 color=colours[method], linewidth=1.5, zorder=above, label=method)
        bottom.plot(rows["t"], running_median(rows["t"], heading, MEDIAN_S), color=colours[method], linewidth=1.3,
                    zorder=above)
    top.set_yscale("log")
    common.plain_ticks(top.yaxis)
    top.set_ylabel("position error [m]")
    heading_axis(bottom)
    bottom.set_ylabel("heading error [deg]")
    bottom.set_xlabel("time [s]")
    bottom.set_xlim(0.0, end)
    common.legend_beside(top)
    figure.subplots_adjust(hspace=0.08)
    common.save_figure(figure, path)

    caption = ("Error of the position (logarithmic) and of the heading (linear within \u00b12 degrees, "
               "logarithmic beyond) of the same seed over time, as the paper's Fig. 9; medians over {:g} s. Shaded: "
               "{} is in the shadow; the other methods drive their own way and reach it at their own times.".format(
                   MEDIAN_S, first))
    if len(trajectories) < len(all_trajectories):
        caption += " Not drawn: {}.".format(name_list([m for m in all_trajectories if m not in trajectories]))
    longer = [method for method, rows in trajectories.items() if np.max(rows["t"]) > end]
    if longer:
        caption += " The time axis ends at {:.0f} s; longer runs: {}.".format(end, name_list(longer))
    return caption


def plot_errors_over_seeds(path, tables, colours):
    """Position RMSE, its 95 % quantile and heading RMSE over the seeds against time."""
    if not tables:
        return False
    figure, axes = plt.subplots(3, 1, sharex=True, figsize=(10.5, 8.5))
    quantities = (("position_rmse_m", 1.0, "position RMSE [m]"), ("position_p95_m", 1.0, "position 95 % [m]"),
                  ("heading_rmse_rad", 180.0 / np.pi, "heading RMSE [deg]"))
    for panel, (column, scale, label) in zip(axes, quantities):
        for method, rows in tables.items():
            panel.plot(rows["t"], np.maximum(scale * rows[column], SMALLEST_ERROR_M), color=colours[method],
                       linewidth=1.1, label=method)
        panel.set_yscale("log")
        common.plain_ticks(panel.yaxis)
        panel.set_ylabel(label)
        common.light_grid(panel)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(0.0, end_of_time_axis(tables))
    common.legend_beside(axes[0])
    figure.subplots_adjust(hspace=0.08)
    common.save_figure(figure, path)
    return True


def plot_summary(path, methods, colours):
    """RMSE in the sun and in the shadow as bars, with the diverged seeds as text."""
    names = list(methods)
    figure, axes = plt.subplots(figsize=(9.0, 1.2 + 0.62 * len(names)))
    values = {zone: [common.number(methods[name], zone, "position_rmse_m") for name in names]
              for zone in ("sun", "shadow")}
    known = [value for zone in values.values() for value in zone if np.isfinite(value) and value > 0.0]
    left = 10.0 ** np.floor(np.log10(min(known))) / 2.0 if known else 0.01
    right = 1.8 * max(known) if known else 1.0
    for row, name in enumerate(names):
        draw_bar(axes, row - 0.19, values["sun"][row], left, common.lighter(colours[name]))
        draw_bar(axes, row + 0.19, values["shadow"][row], left, colours[name])
        axes.text(1.02, row, diverged_text(methods[name]), transform=axes.get_yaxis_transform(), va="center",
                  fontsize=9)
    axes.set_xscale("log")
    axes.set_xlim(left, right)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_yticks(range(len(names)))
    axes.set_yticklabels(names)
    common.plain_ticks(axes.xaxis)
    axes.set_xlabel("position RMSE [m]")
    handles = [plt.Rectangle((0, 0), 1, 1, color=common.lighter("#666666"), label="sun"),
               plt.Rectangle((0, 0), 1, 1, color="#666666", label="shadow")]
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncol=2, frameon=False)
    axes.text(1.02, 1.0, "diverged seeds", transform=axes.transAxes, va="bottom", fontsize=9,
              fontweight="bold")
    common.light_grid(axes)
    common.save_figure(figure, path)


def draw_bar(axes, y, value, left, colour):
    """One bar of the summary from the left border, with its value; a text where there is no value."""
    if not np.isfinite(value):
        axes.text(left * 1.05, y, "no value", va="center", fontsize=8, color="#777777")
        return
    axes.barh(y, value, height=0.36, color=colour)
    axes.text(max(value, left) * 1.04, y, "{:.3g}".format(value), va="center", fontsize=8)


def diverged_text(method):
    """Diverged seeds of all seeds, as '3 of 30'."""
    diverged = common.format_number(common.number(method, "diverged"), 0)
    return "{} of {}".format(diverged, common.format_number(common.number(method, "seeds"), 0))


TABLE_HEADER = ("method", "seeds", "diverged", "sun RMSE [m]", "shadow RMSE [m]", "shadow 95 % [m]",
                "shadow max [m]", "sun heading RMSE [deg]", "shadow heading RMSE [deg]",
                "cross-track RMSE [m]")


def table_row(name, method):
    """The numbers of one method as text."""
    def cell(*keys, digits=2, scale=1.0):
        return common.format_number(scale * common.number(method, *keys), digits)
    degrees = 180.0 / np.pi
    return (name, cell("seeds", digits=0), cell("diverged", digits=0), cell("sun", "position_rmse_m"),
            cell("shadow", "position_rmse_m"), cell("shadow", "position_p95_m"),
            cell("shadow", "position_max_m"),
            cell("sun", "heading_rmse_rad", scale=degrees), cell("shadow", "heading_rmse_rad", scale=degrees),
            cell("cross_track_rmse_m"))


def introduction(metrics):
    """What was simulated, in a sentence or two."""
    loop = {True: "the robot is steered by each method's own estimate (closed loop)",
            False: "all methods see the same drive (open loop)"}.get(metrics.get("closed_loop"), "")
    seeds = metrics.get("seeds")
    parts = ["The simulation of section 4 of Nishida et al. (2013): a robot passes eight targets, and GPS is "
             "biased where x < 0 (shadow)."]
    details = [loop] if loop else []
    if np.isfinite(common.number(metrics, "laps")):
        details.append("{:g} laps".format(common.number(metrics, "laps")))
    if isinstance(seeds, list):
        details.append("{} seeds".format(len(seeds)))
    if details:
        parts.append("Here " + ", ".join(details) + ".")
    return " ".join(parts)


def in_order(methods, order):
    """The methods in the order in which they were asked for, where the metrics say it."""
    known = [name for name in order or [] if name in methods]
    return {name: methods[name] for name in known + [name for name in methods if name not in known]}


def metrics_of_city(directory):
    return os.path.join(directory, CITY, "metrics.json")


def add_live_drive(page, directory):
    """To the page of the drive of the nodes, where demo.sh has made one."""
    if os.path.exists(os.path.join(directory, LIVE, "report.html")):
        page.link(LIVE + "/report.html", "The same field, driven live by the nodes")


def add_city(page, directory):
    """A drive through a simulated city, where demo.sh has made one: the first screen."""
    path = metrics_of_city(directory)
    if not os.path.exists(path):
        return
    runs = common.require_object(common.read_json(path), "runs", path)
    rows = []
    for name, run in runs.items():
        label = plot_evaluation.label_of(name)
        if label.endswith(": raw fix"):
            if any(row[0] == "raw fix" for row in rows):
                continue
            label = "raw fix"
        rows.append((label,) + tuple(common.format_number(common.number(run, "position_m", key))
                                     for key in ("median", "p95", "max")))
    page.heading("A drive through a simulated city")
    page.image(CITY + "/overview.png", "The recommended localizer imm_ekf beside ekf, a plain EKF that uses every fix "
               "(complementary_ekf, mode: standard), and the raw fix, on the same odometry, IMU and receiver.")
    page.link(CITY + "/report.html", "The drive on a map that can be zoomed, with what became of each fix")
    page.table(("position error [m]", "median", "95 %", "max"), sorted(rows, key=lambda row: row[0] == "raw fix"))
    page.heading("The paper's field")


def make_report(directory):
    """Make all figures and the page; gives the path of the page."""
    metrics_path = os.path.join(directory, "metrics.json")
    metrics = common.read_json(metrics_path)
    methods = in_order(common.require_object(metrics, "methods", metrics_path), metrics.get("method_order"))
    targets = common.read_csv(os.path.join(directory, "data", "targets.csv"), TARGET_COLUMNS)
    if not len(targets):
        raise common.ReportError("{}: no rows".format(os.path.join(directory, "data", "targets.csv")))
    trajectories = read_per_method(directory, "trajectory", methods, TRAJECTORY_COLUMNS)
    if not trajectories:
        raise common.ReportError("{}: no trajectory_<method>.csv with rows for any method".format(
            os.path.join(directory, "data")))
    snapshots = read_per_method(directory, "snapshots", methods, SNAPSHOT_COLUMNS)
    particles = read_per_method(directory, "particles", methods, PARTICLE_COLUMNS)
    over_seeds = read_per_method(directory, "errors_over_seeds", methods, SEED_COLUMNS)
    colours = common.method_colours(list(methods))

    def output(name):
        return os.path.join(directory, name)

    has_city = os.path.exists(metrics_of_city(directory))
    page = common.HtmlPage("{}he experiment of Nishida et al. (2013)".format(
        "A drive through a city, and t" if has_city else "T"), directory)
    add_city(page, directory)
    page.paragraph(introduction(metrics))
    add_live_drive(page, directory)
    page.heading("Results")
    page.table(TABLE_HEADER, [table_row(name, method) for name, method in methods.items()], colours)
    page.paragraph("Errors over all seeds, those that diverged included. A seed has diverged when its "
                   "position error exceeds 5 m at some time, unless the conditions below say otherwise. "
                   "Cross-track: distance of the true position from the path through the targets.")
    plot_summary(output("summary.png"), methods, colours)
    page.image("summary.png",
               "RMSE of the position in the sun and in the shadow (logarithmic), and the diverged seeds.")

    page.heading("Fig. 7: particles")
    if plot_figure7(output("fig7_particles.png"), snapshots, particles):
        page.image("fig7_particles.png",
                   "Particles around the true state at a few instants, as the paper's Fig. 7, in windows around the "
                   "truth of \u00b1{:g} m or more. In the shadow the paper's filter expects the fix at the "
                   "distance r\u0302 from the robot.".format(SNAPSHOT_HALF_WIDTHS_M[0]))
    else:
        page.paragraph("No method has snapshots of its particles.")

    page.heading("Fig. 8: trajectories")
    page.image("fig8_trajectories.png",
               plot_figure8(output("fig8_trajectories.png"), trajectories, targets, colours))

    page.heading("Fig. 9: errors of one seed")
    page.image("fig9_errors.png",
               plot_figure9(output("fig9_errors.png"), trajectories, colours)
               + without(methods, trajectories))

    page.heading("Errors over all seeds")
    if plot_errors_over_seeds(output("errors_over_seeds.png"), over_seeds, colours):
        page.image("errors_over_seeds.png",
                   "RMSE and 95 % quantile of the position error and RMSE of the heading error over the "
                   "seeds at each time (logarithmic)." + without(methods, over_seeds))
    else:
        page.paragraph("No method has errors over the seeds.")

    page.provenance(metrics, without=("methods",))
    page.save(output("report.html"))
    return output("report.html")


if __name__ == "__main__":
    common.run_main(make_report)
