#!/usr/bin/env python3
"""Every localizer on every real recording: tables, plots and the tables of docs/results/recordings.md.

usage: compare_localizers.py OUTPUT [--data DIR] [--docs FILE] [options]

DIR (default: $URBAN_GNSS_DATA) holds one folder a recording, as csv_to_bag reads it; those without truth.csv are left
out. OUTPUT gets the bags, the runs, one figure a recording, metrics.json and report.html. With --docs the tables between
the markers of that Markdown file are renewed, and its figures are written beside it.

The workspace must be sourced, or URBAN_GNSS_PROGRAMS be the folder of the built programs.
"""

import argparse
import json
import math
import os
import re
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import numpy as np  # noqa: E402

import report_common as common  # noqa: E402
from package_programs import program  # noqa: E402
from recordings import (NEEDED, add_arguments, call, for_each_recording, make_bag, markdown,  # noqa: E402, F401
                        replace_between, set_arguments, write_docs)
from report_common import plt  # noqa: E402

ESTIMATE = "odometry/filtered"
RAW_FIX = "raw fix"

COLOURS = dict(common.METHOD_COLOURS, **{RAW_FIX: common.FIX_COLOUR})

# What an information is worth: the method that does best without it.
ABLATED = "imm_ekf"
ABLATIONS = {
    "odometry errors as states": ["speed_scale_sigma=0.0", "expert.odometry.speed_scale_walk=0.0",
                                  "expert.odometry.yaw_rate_bias_sigma=0.0", "expert.odometry.yaw_rate_bias_walk=0.0"],
    "formal covariance": ["use_fix_covariance=false", "direct_sigma=10.0", "expert.shadow_sigma=10.0"],
    "half belief in its ups and downs": ["expert.fix_noise.fix_covariance_weight=1.0"],
    "learnt scale": ["expert.fix_noise.fix_scale_rate=0.0"],
    "formal covariance, learnt scale": ["use_fix_covariance=false", "direct_sigma=10.0", "expert.shadow_sigma=10.0",
                                        "expert.fix_noise.fix_scale_rate=0.0"],
    "ranges of the fix": ["expert.ranges.use_ranges=false"],
    "velocity of the receiver": ["expert.velocity.use_gps_velocity=false"],
    "heavy tails of the velocity": ["expert.velocity_noise.velocity_dof=1.0e+9"],
    "correlation of errors": ["expert.fix_noise.correlation_time=0.0", "expert.fix_noise.correlation_distance=0.0"],
    "learnt quality of the odometry": ["expert.odometry_quality.wander_share=0.0"],
    "heavy tails": ["expert.bias.student_dof=1.0e+9"],
    "outliers": ["expert.bias.outlier_share=0.0"],
    "heavy tails, outliers": ["expert.bias.student_dof=1.0e+9", "expert.bias.outlier_share=0.0"],
    "biased modes": ["expert.bias.direct_time=1.0e+15"],
}

DIVERGED_M = 100.0
DIVERGED_S = 30.0
SMALLEST_ERROR_M = 0.1


class Scores:
    """The errors of one method on one recording; `summary` is what replay says of them."""

    def __init__(self, t, error, summary=None):
        self.summary = summary or {}
        known = np.isfinite(error)
        self.t, self.error = np.asarray(t)[known], np.asarray(error)[known]

    def percentile(self, percent):
        """The error below which `percent` of the samples lie; NaN without samples."""
        return float(np.percentile(self.error, percent)) if len(self.error) else float("nan")

    def has_diverged(self):
        """Whether the error stayed above DIVERGED_M for DIVERGED_S."""
        since = None
        for t, error in zip(self.t, self.error):
            if error <= DIVERGED_M:
                since = None
                continue
            since = t if since is None else since
            if t - since >= DIVERGED_S:
                return True
        return False

    def cell(self):
        """median / 95 % / maximum as text; the maximum in whole metres, but never rounded to below the 95 %."""
        if not len(self.error):
            return "–"
        most = self.percentile(100)
        p95 = "{:.1f}".format(self.percentile(95))
        digits = 0 if float("{:.0f}".format(most)) >= float(p95) else 1
        text = "{:.1f} / {} / {:.{}f}".format(self.percentile(50), p95, most, digits)
        return text + (" †" if self.has_diverged() else "")


def find_variants():
    """The names under which the registry's localizers are compared."""
    return call(*program("replay"), "--list-variants").split()


def file_name(method):
    """The method's name as that of a file."""
    return re.sub(r"\W+", "_", method)


def run_recording(data, output, recording, methods, overrides):
    """Run and score every method on one recording; the errors by method, the raw fixes among them."""
    folder = os.path.join(output, recording)
    os.makedirs(folder, exist_ok=True)
    bag = os.path.join(folder, "recording.bag")
    make_bag(os.path.join(data, recording), bag)
    runs = []
    for method, arguments in methods.items():
        runs.append(os.path.join(folder, file_name(method) + ".bag"))
        call(*program("replay"), bag, "--output", runs[-1], "--json", summary_file(folder, method), *arguments,
             *overrides)
    call(*program("evaluate"), *runs, bag, "--truth", bag, "--output", folder, "--no-plots")
    for run in runs:
        os.remove(run)
    return read_scores(folder, methods)


def summary_file(folder, method):
    """Where replay writes what it says of a run."""
    return os.path.join(folder, file_name(method) + ".json")


def read_summary(folder, method):
    """The errors that replay found itself."""
    with open(summary_file(folder, method), encoding="utf-8") as stream:
        return json.load(stream).get("errors", {})


def read_scores(folder, methods):
    """The error series that evaluate wrote; also where the robot was."""
    scores, tracks = {}, {}
    for method in methods:
        stem = file_name(method) + "_"
        errors = common.read_csv(os.path.join(folder, "data", "errors_" + stem + ESTIMATE.replace("/", "_") + ".csv"),
                                 ("t", "position_error_m", "est_x", "est_y", "truth_x", "truth_y"))
        scores[method] = Scores(errors["t"], errors["position_error_m"], read_summary(folder, method))
        tracks[method] = errors
    fixes = common.read_csv(os.path.join(folder, "data", "errors_recording_gps_fix.csv"),
                            ("t", "position_error_m", "est_x", "est_y"))
    scores[RAW_FIX] = Scores(fixes["t"], fixes["position_error_m"])
    tracks[RAW_FIX] = (fixes["est_x"], fixes["est_y"])
    return scores, tracks


def plot_recording(path, title, scores, tracks):
    """Trajectories beside the errors over time."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(13.0, 4.6), gridspec_kw={"width_ratios": (1.0, 1.5)})
    longest = max((track for name, track in tracks.items() if name != RAW_FIX), key=len)
    x, y = common.finite(longest["truth_x"]), common.finite(longest["truth_y"])
    left.plot(tracks[RAW_FIX][0], tracks[RAW_FIX][1], ".", color=common.FIX_COLOUR, markersize=2)
    for name, track in tracks.items():
        if name != RAW_FIX:
            left.plot(track["est_x"], track["est_y"], color=COLOURS.get(name), linewidth=0.9)
    left.plot(longest["truth_x"], longest["truth_y"], color=common.TRUTH_COLOUR, linewidth=1.2)
    if len(x):
        margin = max(15.0, 0.1 * max(np.ptp(x), np.ptp(y)))
        left.set_xlim(np.min(x) - margin, np.max(x) + margin)
        left.set_ylim(np.min(y) - margin, np.max(y) + margin)
    left.set_aspect("equal", adjustable="datalim")
    left.set_xlabel("east [m]")
    left.set_ylabel("north [m]")
    for name, score in scores.items():
        marker = {"linestyle": "", "marker": ".", "markersize": 2} if name == RAW_FIX else {"linewidth": 1.1}
        right.plot(score.t, np.maximum(score.error, SMALLEST_ERROR_M), color=COLOURS.get(name), label=name, **marker)
    right.set_yscale("log")
    common.plain_ticks(right.yaxis)
    right.set_xlabel("time [s]")
    right.set_ylabel("position error [m]")
    figure.suptitle(title, fontsize=11)
    for axes in (left, right):
        common.light_grid(axes)
    common.legend_beside(right)
    common.save_figure(figure, path)


def plot_overview(path, results, methods):
    """Median and 95 % of every method on every recording."""
    figure, axes = plt.subplots(figsize=(11.0, 4.2))
    names = [RAW_FIX] + list(methods)
    width = 0.8 / len(names)
    for i, name in enumerate(names):
        places = np.arange(len(results)) - 0.4 + (i + 0.5) * width
        median = np.array([scores[name].percentile(50) for scores in results.values()])
        upper = np.array([scores[name].percentile(95) for scores in results.values()])
        axes.vlines(places, median, upper, color=COLOURS.get(name), linewidth=2.0)
        axes.plot(places, median, "o", color=COLOURS.get(name), markersize=3.5, label=name)
    axes.set_yscale("log")
    common.plain_ticks(axes.yaxis)
    axes.set_xticks(np.arange(len(results)))
    axes.set_xticklabels([name.replace("_", "\n", 1) for name in results], rotation=35, ha="right", fontsize=7)
    axes.set_ylabel("position error [m], median to 95 %")
    common.light_grid(axes)
    common.legend_beside(axes)
    common.save_figure(figure, path)


def table(results, methods):
    """Header and rows of the comparison."""
    header = ["recording"] + [RAW_FIX] + list(methods)
    rows = [[name] + [scores[method].cell() for method in header[1:]] for name, scores in results.items()]
    return header, rows


def honesty(results):
    """Header and rows of how the covariance of the recommended localizer fits its errors; beside it, the share inside
    the ellipses of the others."""
    others = [method for method in next(iter(results.values()), {}) if method not in (ABLATED, RAW_FIX)]
    header = ["recording", "median / 95 % / max", "inside 95 %", "NEES / 2", "beyond protection"] + others
    rows = []
    for name, scores in results.items():
        if ABLATED not in scores:
            continue
        found = scores[ABLATED].summary
        values = [found.get(key) for key in ("inside_95", "position_nees_mean", "beyond_protection")]
        if None in values:
            continue
        rows.append([name, scores[ABLATED].cell(), "{:.3f}".format(values[0]), "{:.2f}".format(values[1] / 2.0),
                     "{:.2f} %".format(100.0 * values[2])] + [inside(scores.get(other)) for other in others])
    return header, rows


def inside(score):
    """The share of the truth inside the 95 % ellipse, for people."""
    share = score.summary.get("inside_95") if score else None
    return "–" if share is None else "{:.2f}".format(share)


def ratios(results, method, reference):
    """Geometric means over the recordings of median and 95 % of a method against another's."""
    logs = [[math.log(scores[method].percentile(p) / scores[reference].percentile(p)) for p in (50, 95)]
            for scores in results.values()]
    return [math.exp(float(np.nanmean(column))) for column in zip(*logs)]


def ablate(results):
    """Header and rows of what each source of information is worth."""
    header = ["without", "median", "95 %"] + list(results)
    rows = []
    for name in [ABLATED] + list(ABLATIONS):
        change = ratios(results, name, ABLATED)
        rows.append([name if name != ABLATED else "nothing"]
                    + ["{:+.0f} %".format(100.0 * (ratio - 1.0)) for ratio in change]
                    + [scores[name].cell() for scores in results.values()])
    return header, rows


def compare(options):
    """Run everything; gives the path of the page."""
    if options.ablation:
        methods = {ABLATED: ["--localizer", ABLATED]}
        methods.update({name: methods[ABLATED] + [part for text in changes for part in ("--set", text)]
                        for name, changes in ABLATIONS.items()})
    else:
        methods = {name: ["--localizer", name] for name in options.methods or find_variants()}
    runs = for_each_recording(options, lambda name: run_recording(options.data, options.output, name, methods,
                                                                  set_arguments(options)))
    results = {name: scores for name, (scores, _) in runs.items()}
    tracks = {name: recorded for name, (_, recorded) in runs.items()}
    return write_report(options, methods, results, tracks)


def write_report(options, methods, results, tracks):
    """Figures, page and Markdown; gives the path of the page."""
    title = "What each source of information is worth" if options.ablation else "Localizers on real recordings"
    header, rows = ablate(results) if options.ablation else table(results, methods)
    page = common.HtmlPage(title, options.output)
    page.table(header, rows)
    page.paragraph("Median / 95 % / maximum of the horizontal error in metres at the truth's stamps; † diverged: more "
                   "than {:.0f} m for {:.0f} s on end.".format(DIVERGED_M, DIVERGED_S))
    if not options.ablation:
        plot_overview(os.path.join(options.output, "overview.png"), results, methods)
        page.image("overview.png", "Median (dot) to 95 % of the position error.")
    for name, scores in results.items():
        picture = name + ".png"
        plot_recording(os.path.join(options.output, picture), name, scores, tracks[name])
        page.heading(name)
        page.image(picture, "Black: truth; dots: raw fixes.")
    page.heading("How this was made")
    page.listing(" ".join(["compare_localizers.py"] + sys.argv[1:]))
    page.save(os.path.join(options.output, "report.html"))
    if options.docs:
        write_docs(options.docs, "ablation" if options.ablation else "comparison", markdown(header, rows))
        if not options.ablation:
            write_docs(options.docs, "honesty", markdown(*honesty(results)))
            plot_overview(os.path.join(os.path.dirname(options.docs) or ".", "real_data.png"), results, methods)
    return os.path.join(options.output, "report.html")


def main():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_arguments(parser, "folder for bags, runs, figures and the report")
    parser.add_argument("--methods", nargs="+", help="names of replay --list-variants; default: all")
    parser.add_argument("--ablation", action="store_true", help="the recommended localizer without each of its "
                        "sources of information, instead of all localizers")
    try:
        print(compare(parser.parse_args()))
    except common.ReportError as error:
        sys.exit("compare_localizers: {}".format(error))


if __name__ == "__main__":
    main()
