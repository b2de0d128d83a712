#!/usr/bin/env python3
"""Tables I and II and figures 5 to 7 of Maier and Kleiner (2010), on the simulated scenarios or a bag, in one command.

Runs occlusion_experiment and writes OUT/metrics.json, OUT/tables.md, OUT/fig5.png, fig6.png, fig7.png and
OUT/report.html. With --bag it runs replay --occlusion on a recording instead, once with each model; arguments after
-- go to replay. With --no-run it draws what is in OUT already. The workspace must be sourced, or
URBAN_GNSS_PROGRAMS be the folder of the built programs.
"""
import argparse
import os
import subprocess
import sys

# In a devel space this file runs through a wrapper in another directory; the module lies beside the source.
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import numpy as np  # noqa: E402

import occlusion_bag  # noqa: E402
import report_common as common  # noqa: E402
from report_common import plt  # noqa: E402

SCENARIOS = ["campus_loop", "building_pass", "downtown_grid", "open_sky"]
MODELS = ("conventional", "paper", "soft")
CLASSIFYING = ("paper", "soft")
EXPECTED_NEES = 2.0
DEGREES = 180.0 / np.pi
BAD_FIX_M = 6.0
SIGMA_CROP_M = 20.0  # as the paper's figure 5
GOOD_COLOUR = "#009e73"
BAD_COLOUR = "#d62728"
ERROR_COLOUR = "#1f3a93"
FIX_COLUMNS = ("t", "x", "y", "error", "sigma_claimed") + tuple(
    "{}_{}".format(what, model) for model in MODELS for what in ("sigma", "good"))
TRAJECTORY_COLUMNS = ("t", "x", "y", "yaw")


def run_experiment(out, options):
    """Run the program; exit with its last line where it fails."""
    programs = os.environ.get("URBAN_GNSS_PROGRAMS")
    name = "occlusion_experiment"
    command = [os.path.join(programs, name)] if programs else ["rosrun", "urban_gnss_localization", name]
    command += ["--scenarios", ",".join(options.scenarios), "--seeds", str(options.seeds), "--first-seed",
                str(options.first_seed), "--json", os.path.join(out, "metrics.json"), "--series",
                os.path.join(out, "data")]
    if options.duration:
        command += ["--duration", str(options.duration)]
    done = subprocess.run(command + options.arguments, stdout=subprocess.DEVNULL)
    if done.returncode != 0:
        raise common.ReportError("{} failed".format(" ".join(command)))


def cell(content, *keys, scale=1.0, digits=2):
    """A number of the metrics as text."""
    return common.format_number(scale * common.number(content, *keys), digits)


def percent(share):
    """A share for a table; an en dash when there is none."""
    return "{:.1f} %".format(100.0 * share) if np.isfinite(share) else "–"


def spread(content, name, scale=1.0, digits=2):
    """Mean and standard deviation as text; empty where there are none."""
    unit = "_rad" if name == "heading" else "_m"
    if not np.isfinite(common.number(content, name + "_mean" + unit)):
        return ""
    return " ± ".join(cell(content, name + which + unit, scale=scale, digits=digits) for which in ("_mean", "_sigma"))


def change(row, base, key):
    """By how much of `base` the row is above it, as text."""
    ratio = common.number(row, key) / common.number(base, key) - 1.0
    return "{:+.0f} %".format(100.0 * ratio) if np.isfinite(ratio) else "–"


def table_1(scenarios):
    """Classification of good and bad fixes with the confusion matrix."""
    header = ("scenario, model", "fixes", "right", "good called good", "good called bad", "bad called good",
              "bad called bad")
    rows = []
    for scenario, content in scenarios.items():
        for model in CLASSIFYING:
            c = content["classification"].get(model)
            if not c:
                continue
            counts = [common.number(c, key) for key in ("good_called_good", "good_called_bad", "bad_called_good",
                                                        "bad_called_bad")]
            good, bad = counts[0] + counts[1], counts[2] + counts[3]
            shares = [percent(count / whole if whole else np.nan)
                      for count, whole in zip(counts, (good, good, bad, bad))]
            rows.append(["{}, {}".format(scenario, model), "{:.0f}".format(good + bad),
                         percent(common.number(c, "correct"))] + shares)
    return header, rows


def table_2(scenarios):
    """Errors of the Gaussian UKF with each model's covariances; the changes are against the conventional ones."""
    header = ("scenario", "covariances", "position, m", "change", "max, m", "orientation, deg", "change")
    rows = []
    for scenario, content in scenarios.items():
        base = content["trajectory"].get("conventional")
        for name in ("odometry",) + MODELS:
            t = content["trajectory"].get(name)
            if not t:
                continue
            is_improved = name in CLASSIFYING
            rows.append([scenario, name if name != "odometry" else "odometry alone", spread(t, "position"),
                         change(t, base, "position_mean_m") if is_improved else "", cell(t, "position_max_m", digits=1),
                         spread(t, "heading", DEGREES),
                         change(t, base, "heading_mean_rad") if is_improved else ""])
    return header, rows


def table_student_t(scenarios):
    """Errors of the Student-t UKF with each model's covariances."""
    header = ("scenario", "covariances", "position, m", "orientation, deg")
    rows = []
    for scenario, content in scenarios.items():
        for model in MODELS:
            robust = content["trajectory_student_t"].get(model, {})
            rows.append([scenario, model, spread(robust, "position"), spread(robust, "heading", DEGREES)])
    return header, rows


def table_nees(scenarios):
    """NEES of the fix error over its expectation."""
    header = ("scenario", "claimed by the receiver") + MODELS
    rows = [[scenario] + [cell(content, "fix_nees", name, "mean", scale=1.0 / EXPECTED_NEES)
                          for name in ("claimed",) + MODELS]
            for scenario, content in scenarios.items()]
    return header, rows


def table_fixes(scenarios):
    """What the models say of a bag's fixes."""
    header = ("bag, model", "fixes", "called bad", "weighed by the map", "σ median, m", "σ 95 %, m")
    rows = [["{}, {}".format(bag, model), str(f["fixes"]), percent(f["bad"]), percent(f["with_map"]),
             cell(f, "sigma_median_m"), cell(f, "sigma_p95_m")]
            for bag, content in scenarios.items() for model, f in content["fixes"].items()]
    return header, rows


def table_satellites(scenarios):
    """What the map says of a bag's satellites, against C/N0 and the true line of sight."""
    header = ("bag, run", "judged", "blocked", "C/N0 free, dB-Hz", "C/N0 blocked, dB-Hz", "direct called free",
              "hidden called blocked")
    rows = [["{}, {}".format(bag, model), str(s["judged"]), percent(common.number(s, "blocked")),
             cell(s, "cn0_free_dbhz", digits=1), cell(s, "cn0_blocked_dbhz", digits=1),
             percent(common.number(s, "direct_called_free")), percent(common.number(s, "hidden_called_blocked"))]
            for bag, content in scenarios.items() for model, s in content["satellites_of"].items()]
    return header, rows


def tables_of(scenarios):
    """The tables for which there is something, with their titles."""
    candidates = (
        ("classification", "Table I: good and bad fixes, told apart at {:g} m".format(BAD_FIX_M), table_1),
        ("trajectory", "Table II: errors of the Gaussian UKF; change: against the conventional covariances", table_2),
        ("trajectory_student_t", "Errors of the Student-t UKF", table_student_t),
        ("fix_nees", "Mean NEES of the fixes' errors over its expectation", table_nees),
        ("fixes", "What the models say of the fixes", table_fixes),
        ("satellites_of", "What the map says of the satellites", table_satellites))
    return [(title, make(scenarios)) for key, title, make in candidates
            if all(key in content for content in scenarios.values())]


def markdown(header, rows):
    """A table for docs/."""
    lines = ["| " + " | ".join(header) + " |", "|---" * len(header) + "|"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def plot_figure5(path, fixes):
    """Error of the fixes against the models' standard deviations over time, a panel per scenario."""
    figure, panels = plt.subplots(len(fixes), 1, figsize=(10.5, 2.3 * len(fixes)), squeeze=False)
    for axes, (scenario, rows) in zip(panels[:, 0], fixes.items()):
        axes.fill_between(rows["t"], 0.0, rows["error"], color="#c9d3ea", linewidth=0)
        axes.plot(rows["t"], rows["error"], color=ERROR_COLOUR, linewidth=0.9, label="error of the fix")
        for model, style in (("conventional", "-"), ("paper", ":"), ("soft", "-")):
            if not np.isfinite(rows["sigma_" + model]).any():
                continue
            axes.plot(rows["t"], np.minimum(rows["sigma_" + model], SIGMA_CROP_M), style, linewidth=1.2,
                      color=MODEL_COLOURS[model], label="σ {}".format(model))
        axes.axhline(BAD_FIX_M, color="#888888", linewidth=0.7, linestyle="--")
        axes.set_ylim(0.0, SIGMA_CROP_M * 1.05)
        if len(rows):
            axes.set_xlim(rows["t"][0], rows["t"][-1])
        axes.set_ylabel("m")
        axes.set_title(scenario, fontsize=10, loc="left")
        common.light_grid(axes)
    panels[-1, 0].set_xlabel("time [s]")
    common.legend_beside(panels[0, 0])
    figure.subplots_adjust(hspace=0.45)
    common.save_figure(figure, path)


def map_panels(truths):
    """A figure with an axes of equal scales for each scenario, two a row; of an odd number the flattest has its own."""
    panel_width, panel_height, least_height, margin = 5.6, 3.9, 1.8, 0.8  # inches
    flatness = {s: np.ptp(t["x"]) / max(np.ptp(t["y"]), 1.0) if len(t) else 1.0 for s, t in truths.items()}
    alone = [max(flatness, key=flatness.get)] if len(truths) % 2 else []
    paired = [s for s in truths if s not in alone]
    rows = [paired[k:k + 2] for k in range(0, len(paired), 2)] + ([alone] if alone else [])
    heights = [margin + np.clip(max(2.0 * panel_width / len(row) / flatness[s] for s in row), least_height, panel_height)
               for row in rows]
    figure = plt.figure(figsize=(2.0 * panel_width, sum(heights)), constrained_layout=True)
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    panels = {s: figure.add_subplot(grid[k // 2, k % 2]) for k, s in enumerate(paired)}
    panels.update({s: figure.add_subplot(grid[-1, :]) for s in alone})
    for scenario, axes in panels.items():
        axes.set_aspect("equal", adjustable="datalim")  # fills its place, however flat the drive
        axes.set_title(scenario, fontsize=10, loc="left")
        axes.set_xlabel("east [m]")
        axes.set_ylabel("north [m]")
        common.light_grid(axes)
    return figure, panels


def draw_truth(axes, truth, width):
    """The true trajectory, where it is known."""
    if len(truth):
        axes.plot(truth["x"], truth["y"], color="#f0c000", linewidth=width, zorder=1, label="true trajectory")


def plot_figure6(path, fixes, truths):
    """The fixes, green where the soft model calls them good and red where bad, on the true trajectory. Of a bag without
    the soft model, the last that it has.
    """
    figure, panels = map_panels({s: truths[s] for s in fixes})
    for scenario, axes in panels.items():
        rows = fixes[scenario]
        model = next(m for m in reversed(MODELS) if np.isfinite(rows["sigma_" + m]).any())
        draw_truth(axes, truths[scenario], 2.5)
        for good, colour, label in ((1, GOOD_COLOUR, "called good"), (0, BAD_COLOUR, "called bad")):
            chosen = rows["good_" + model] == good
            axes.plot(rows["x"][chosen], rows["y"][chosen], ".", color=colour, markersize=2.5, zorder=3 - good,
                      label=label)
    legend = next(iter(panels.values())).legend(fontsize=8, loc="best")
    for handle in legend.get_lines():
        handle.set_markersize(8)
    common.save_figure(figure, path)


def plot_figure7(path, truths, estimates):
    """The trajectories of the UKF with the conventional and the soft covariances."""
    figure, panels = map_panels(truths)
    for scenario, axes in panels.items():
        draw_truth(axes, truths[scenario], 3.0)
        for model in ("conventional", "paper", "soft"):
            rows = estimates[scenario][model]
            if len(rows):
                axes.plot(rows["x"], rows["y"], color=MODEL_COLOURS[model], linewidth=1.0, label=model)
    next(iter(panels.values())).legend(fontsize=8, loc="best")
    common.save_figure(figure, path)


MODEL_COLOURS = common.method_colours(MODELS)


def make_report(out):
    """Tables, figures and page from what the program wrote into `out`; gives the path of the page."""
    metrics = common.read_json(os.path.join(out, "metrics.json"))
    scenarios = common.require_object(metrics, "scenarios", "metrics.json")
    data = os.path.join(out, "data")

    def trajectory(scenario, name):
        return common.read_csv(os.path.join(data, "trajectory_{}_{}.csv".format(scenario, name)), TRAJECTORY_COLUMNS)
    fixes = {s: common.read_csv(os.path.join(data, "fixes_{}.csv".format(s)), FIX_COLUMNS) for s in scenarios}
    truths = {s: trajectory(s, "truth") for s in scenarios}
    estimates = {s: {model: trajectory(s, model) for model in MODELS} for s in scenarios}
    plot_figure5(os.path.join(out, "fig5.png"), fixes)
    # A map without a bad fix shows nothing.
    shown = [s for s in scenarios if np.any(fixes[s]["error"] > BAD_FIX_M)] or list(scenarios)
    plot_figure6(os.path.join(out, "fig6.png"), {s: fixes[s] for s in shown}, truths)
    plot_figure7(os.path.join(out, "fig7.png"), {s: truths[s] for s in shown}, estimates)

    seeds = metrics.get("seeds", [])
    page = common.HtmlPage("Occlusion: covariances of fixes and what a UKF makes of them")
    where = ("on the bag {}.".format(metrics["bag"]) if "bag" in metrics else
             "on simulated scenarios, {} seeds; the figures show seed {}.".format(len(seeds),
                                                                                  seeds[0] if seeds else "–"))
    page.paragraph("Maier and Kleiner (2010), Improved GPS Sensor Model, " + where)
    text = []
    for title, (header, rows) in tables_of(scenarios):
        page.heading(title)
        page.table(header, rows)
        text.append("### {}\n\n{}".format(title, markdown(header, rows)))
    page.heading("Figures")
    page.image("fig5.png", "As figure 5: error of the fixes and standard deviations of the models, cut at "
               "{:g} m; dashed: {:g} m, from which a fix is bad.".format(SIGMA_CROP_M, BAD_FIX_M))
    page.image("fig6.png", "As figure 6: fixes that the soft model calls good (green) and bad (red).")
    page.image("fig7.png", "As figure 7: the UKF's trajectories with each model's covariances.")
    page.provenance(metrics, ("scenarios",))
    with open(os.path.join(out, "tables.md"), "w", encoding="utf-8") as stream:
        stream.write("\n".join(text))
    page.save(os.path.join(out, "report.html"))
    return os.path.join(out, "report.html")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", help="folder to write")
    parser.add_argument("--scenarios", default=",".join(SCENARIOS), type=lambda text: text.split(","))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--duration", type=float, help="s to simulate at most")
    parser.add_argument("--bag", help="a recording with point clouds (docs/occlusion.md), in place of scenarios")
    parser.add_argument("--recorded", action="store_true",
                        help="the bag has gps/fix_weighted, gps/visibility and odometry/filtered: report these")
    parser.add_argument("--odom-topic", default="odom", help="of the bag")
    parser.add_argument("--truth-topic", default="ground_truth/odom",
                        help="of the bag: nav_msgs/Odometry in the map frame; without it there are no errors")
    parser.add_argument("--no-run", action="store_true", help="draw what is there")
    parser.epilog = "What stands after -- is passed on to occlusion_experiment, or to replay."
    given = sys.argv[1:]
    end = given.index("--") if "--" in given else len(given)  # argparse would take the rest for options of its own
    options = parser.parse_args(given[:end])
    options.arguments = given[end + 1:]
    try:
        if options.bag:
            occlusion_bag.prepare(options.out, MODELS, options)
        elif not options.no_run:
            os.makedirs(options.out, exist_ok=True)
            run_experiment(options.out, options)
        print(make_report(options.out))
    except common.ReportError as error:
        print("occlusion_report: {}".format(error), file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
