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
from package_programs import program  # noqa: E402
from report_common import plt  # noqa: E402

SCENARIOS = ["campus_loop", "building_pass", "downtown_grid", "open_sky"]
AS_PRINTED = "_as_printed"  # ends the names of the models in the paper's own setting
OURS = ("conventional", "paper", "soft")
PRINTED = ("conventional_as_printed", "paper_as_printed")
MODELS = OURS + PRINTED
SETTINGS = {"our setting": OURS, "as printed": PRINTED}
CLASSIFYING = ("paper", "soft", "paper_as_printed")
EXPECTED_NEES = 2.0
DEGREES = 180.0 / np.pi
BAD_FIX_M = 6.0
SIGMA_CROP_M = 20.0  # as the paper's figure 5
GOOD_COLOUR = "#009e73"
BAD_COLOUR = "#d62728"
ERROR_COLOUR = "#1f3a93"
# Table I of the paper: fixes, right, good called good and bad, bad called good and bad.
PAPER_TABLE_1 = {"Log 014": (1486, 0.793, 0.79, 0.21, 0.21, 0.79),
                 "Log 042": (695, 0.730, 0.69, 0.31, 0.14, 0.86),
                 "Log 022": (2171, 0.787, 0.84, 0.16, 0.36, 0.64)}
# Table II of the paper: position mean, sigma and maximum (m), orientation mean and sigma (rad).
PAPER_TABLE_2 = {"Log 014": {"odometry": (31.05, 17.49, 95.29, 0.35, 0.37),
                             "conventional": (7.09, 9.19, 39.06, 0.29, 0.35), "paper": (4.36, 3.76, 19.01, 0.21, 0.30)},
                 "Log 042": {"odometry": (55.24, 30.10, 116.90, 0.47, 0.53),
                             "conventional": (4.63, 4.98, 22.21, 0.34, 0.65), "paper": (2.90, 1.74, 10.70, 0.30, 0.64)},
                 "Log 022": {"odometry": (53.10, 34.14, 116.90, 0.28, 0.42),
                             "conventional": (5.90, 7.76, 37.85, 0.28, 0.45), "paper": (4.65, 4.77, 37.58, 0.25, 0.45)}}
TABLE_2_KEYS = ("position_mean_m", "position_sigma_m", "position_max_m", "heading_mean_rad", "heading_sigma_rad")
FIX_COLUMNS = ("t", "x", "y", "error", "sigma_claimed") + tuple(
    "{}_{}".format(what, model) for model in MODELS for what in ("sigma", "good"))
TRAJECTORY_COLUMNS = ("t", "x", "y", "yaw")


def run_experiment(out, options):
    """Run the program; exit with its last line where it fails."""
    command = program("occlusion_experiment")
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
    return "{:+.1f} %".format(100.0 * ratio) if np.isfinite(ratio) else "–"


def base_of(model):
    """The conventional model of the same setting."""
    return "conventional" + (AS_PRINTED if model.endswith(AS_PRINTED) else "")


def table_1(scenarios):
    """Classification of good and bad fixes with the confusion matrix; the paper's own in italics."""
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
    rows += [["*printed: {}*".format(log), "{}".format(values[0])] + [percent(share) for share in values[1:]]
             for log, values in PAPER_TABLE_1.items()]
    return header, rows


def row_of_table_2(scenario, name, t, base):
    """A row; `base`: what the change is against, None: nothing."""
    return [scenario, name, spread(t, "position"), change(t, base, "position_mean_m") if base else "",
            cell(t, "position_max_m", digits=1), spread(t, "heading", DEGREES),
            change(t, base, "heading_mean_rad") if base else ""]


def table_2(scenarios):
    """Errors of the Gaussian UKF with each model's covariances, changes against the conventional ones of the setting;
    the paper's own in italics."""
    header = ("scenario", "covariances", "position, m", "change", "max, m", "orientation, deg", "change")
    rows = []
    for scenario, content in scenarios.items():
        trajectories = content["trajectory"]
        for name in ("odometry",) + MODELS:
            if name not in trajectories:
                continue
            base = trajectories.get(base_of(name)) if name in CLASSIFYING else None
            rows.append(row_of_table_2(scenario, "odometry alone" if name == "odometry" else name, trajectories[name],
                                       base))
    for log, values in PAPER_TABLE_2.items():
        printed = {name: dict(zip(TABLE_2_KEYS, row)) for name, row in values.items()}
        for name, t in printed.items():
            base = printed["conventional"] if name == "paper" else None
            rows.append(row_of_table_2("*printed: {}*".format(log), name, t, base))
    return header, rows


def table_student_t(scenarios):
    """Errors of the Student-t UKF with each model's covariances."""
    header = ("scenario", "covariances", "position, m", "orientation, deg")
    rows = []
    for scenario, content in scenarios.items():
        for model in OURS:
            robust = content["trajectory_student_t"].get(model, {})
            rows.append([scenario, model, spread(robust, "position"), spread(robust, "heading", DEGREES)])
    return header, rows


def table_nees(scenarios):
    """NEES of the fix error over its expectation."""
    models = tuple(m for m in MODELS if any(m in content["fix_nees"] for content in scenarios.values()))
    header = ("scenario", "claimed by the receiver") + models
    rows = [[scenario] + [cell(content, "fix_nees", name, "mean", scale=1.0 / EXPECTED_NEES)
                          for name in ("claimed",) + models]
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
        ("trajectory", "Table II: errors of the UKF; change: against the setting's conventional model", table_2),
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


def models_in(fixes):
    """The models that weighed the fixes: of a bag perhaps not all."""
    return [m for m in MODELS if any(np.isfinite(rows["sigma_" + m]).any() for rows in fixes.values())]


def settings_of(models):
    """The settings with those of their models that are there."""
    settings = {setting: [m for m in those if m in models] for setting, those in SETTINGS.items()}
    return {setting: those for setting, those in settings.items() if those}


def plot_figure5(path, fixes):
    """Error of the fixes and the models' standard deviations over time: a row per scenario, a column per setting."""
    settings = settings_of(models_in(fixes))
    figure, panels = plt.subplots(len(fixes), len(settings), figsize=(12.0, 2.3 * len(fixes)), squeeze=False,
                                  sharey=True)
    for row, (scenario, rows) in zip(panels, fixes.items()):
        for axes, (setting, models) in zip(row, settings.items()):
            axes.fill_between(rows["t"], 0.0, rows["error"], color="#c9d3ea", linewidth=0)
            axes.plot(rows["t"], rows["error"], color=ERROR_COLOUR, linewidth=0.9, label="error of the fix")
            for model in models:
                axes.plot(rows["t"], np.minimum(rows["sigma_" + model], SIGMA_CROP_M), linewidth=1.2,
                          linestyle=":" if model == "paper" else "-", color=colour_of(model),
                          label="σ " + model.replace(AS_PRINTED, ""))
            axes.axhline(BAD_FIX_M, color="#888888", linewidth=0.7, linestyle="--")
            axes.set_ylim(0.0, SIGMA_CROP_M * 1.05)
            if len(rows):
                axes.set_xlim(rows["t"][0], rows["t"][-1])
            axes.set_title("{}, {}".format(scenario, setting), fontsize=10, loc="left")
            common.light_grid(axes)
        row[0].set_ylabel("m")
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    common.legend_beside(panels[0, -1], handles=panels[0, 0].get_legend_handles_labels()[0])
    figure.subplots_adjust(hspace=0.45, wspace=0.06)
    common.save_figure(figure, path)


def map_panels(truths, columns, width):
    """A figure with maps of equal scales, a row for each scenario; axes by scenario and column. `width`: of one, in."""
    margin, tallest = 0.5, 4.0  # inches
    tall = {s: np.ptp(t["y"]) / max(np.ptp(t["x"]), 1.0) if len(t) else 1.0 for s, t in truths.items()}
    heights = [margin + min(tallest, max(width * tall[s], 1.2)) for s in truths]
    figure, panels = plt.subplots(len(truths), len(columns), figsize=(width * len(columns), sum(heights)),
                                  squeeze=False, sharex="row", sharey="row", constrained_layout=True,
                                  gridspec_kw={"height_ratios": heights})
    by_place = {}
    for row, (scenario, truth) in zip(panels, truths.items()):
        for axes, column in zip(row, columns):
            axes.set_aspect("equal")
            axes.set_title("{}, {}".format(scenario, column), fontsize=9, loc="left")
            if len(truth):
                axes.plot(truth["x"], truth["y"], color="#f0c000", linewidth=2.5, zorder=1, label="true trajectory")
            common.light_grid(axes)
            by_place[scenario, column] = axes
        row[0].set_ylabel("north [m]")
    for axes in panels[-1]:
        axes.set_xlabel("east [m]")
    return figure, by_place


def legend_above(figure, panels):
    """Of what the first panel shows."""
    handles = next(iter(panels.values())).get_legend_handles_labels()[0]
    return figure.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncol=len(handles),
                         frameon=False)


def plot_figure6(path, fixes, truths):
    """The fixes, green where a model calls them good and red where bad, on the true trajectory; a column per model."""
    figure, panels = map_panels({s: truths[s] for s in fixes}, models_in(fixes), 3.2)
    for (scenario, model), axes in panels.items():
        rows = fixes[scenario]
        for good, colour, label in ((1, GOOD_COLOUR, "called good"), (0, BAD_COLOUR, "called bad")):
            chosen = rows["good_" + model] == good
            axes.plot(rows["x"][chosen], rows["y"][chosen], ".", color=colour, markersize=2.0, zorder=3 - good,
                      label=label)
    for handle in legend_above(figure, panels).get_lines():
        handle.set_markersize(8)
    common.save_figure(figure, path)


def plot_figure7(path, truths, estimates):
    """The trajectories of the UKF with each model's covariances; a column per setting."""
    settings = settings_of([m for m in MODELS if any(len(estimates[s][m]) for s in truths)])
    figure, panels = map_panels(truths, list(settings), 5.6)
    for (scenario, setting), axes in panels.items():
        for model in settings[setting]:
            rows = estimates[scenario][model]
            axes.plot(rows["x"], rows["y"], color=colour_of(model), linewidth=1.0, label=model.replace(AS_PRINTED, ""))
    legend_above(figure, panels)
    common.save_figure(figure, path)


def colour_of(model):
    """The same in both settings."""
    return MODEL_COLOURS[model.replace(AS_PRINTED, "")]


MODEL_COLOURS = common.method_colours(OURS)


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
    page = common.HtmlPage("Occlusion: covariances of fixes and what a UKF makes of them", out)
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
    page.image("fig6.png", "As figure 6: fixes that each model calls good (green) and bad (red).")
    page.image("fig7.png", "As figure 7: the UKF's trajectories with each model's covariances.")
    page.provenance(metrics, ("scenarios",))
    common.write_text(os.path.join(out, "tables.md"), "\n".join(text))
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
