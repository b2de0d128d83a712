#!/usr/bin/env python3
"""How honest the recommended localizer is in its first minute: every recording from many start times.

usage: compare_starts.py OUTPUT [--data DIR] [--docs FILE] [options]

DIR (default: $URBAN_GNSS_DATA) holds one folder a recording, as csv_to_bag reads it; those without truth.csv are left
out. Each recording is replayed from --starts times, evenly spaced, for --duration seconds, as if the robot had been
switched on then. A start is good if at least 88 % of the truth lies inside the 95 % ellipse. OUTPUT gets the bags and
starts.json. With --docs the table between the markers of that Markdown file is renewed.

The workspace must be sourced, or URBAN_GNSS_PROGRAMS be the folder of the built programs.
"""

import argparse
import json
import os
import statistics
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import recordings  # noqa: E402
import report_common as common  # noqa: E402

GOOD_SHARE = 0.88  # of the truth inside the 95 % ellipse


def start_times(length_s, duration_s, count):
    """When to start (s into a recording), so that each has its whole duration; one where it is too short for more."""
    free = length_s - duration_s
    if free < duration_s / 4.0 or count < 2:
        return [0.0]
    return [free * k / (count - 1) for k in range(count)]


def span_of(folder):
    """Length of a recording's odometry, s: replay counts from its first message."""
    times = common.read_csv(os.path.join(folder, "odom.csv"), ("stamp",))["stamp"]
    return float(times[-1] - times[0])


def replay_from(bag, start_s, options, path):
    """What replay says of a part of the bag; None where there was no estimate in it."""
    try:
        return recordings.replay(bag, path, options.localizer, "--start", str(start_s), "--duration",
                                 str(options.duration), *recordings.set_arguments(options))
    except common.ReportError as error:
        if "no estimate" in str(error):
            return None
        raise


def run_recording(name, options):
    """The runs of one recording, in the order of their starts; None where there was no estimate."""
    folder = os.path.join(options.output, name)
    os.makedirs(folder, exist_ok=True)
    bag = os.path.join(folder, "recording.bag")
    source = os.path.join(options.data, name)
    recordings.make_bag(source, bag)
    times = start_times(span_of(source), options.duration, options.starts)
    return [replay_from(bag, start, options, os.path.join(folder, "start_{}.json".format(k)))
            for k, start in enumerate(times)]


def inside_of(run):
    """Share of the truth inside the ellipse, or None."""
    return run["errors"]["inside_95"] if run and "errors" in run else None


def seconds(values):
    """Median and longest of times, for people; those that are never reached count as infinite."""
    times = sorted(float("inf") if value is None else value for value in values)
    show = lambda value: "never" if value == float("inf") else "{:.0f}".format(value)  # noqa: E731
    return "{} / {}".format(show(statistics.median_high(times)), show(times[-1])) if times else "–"


def row_of(name, runs):
    """The table's row for one recording."""
    shares = [share for share in map(inside_of, runs) if share is not None]
    mean = "{:.3f}".format(sum(shares) / len(shares)) if shares else "–"
    good = sum(share >= GOOD_SHARE for share in shares)
    return [name, str(len(runs)), str(len(shares)), str(good), mean,
            seconds([run["time_to_start_s"] for run in runs if run]),
            seconds([run["time_to_heading_s"] for run in runs if run])]


HEADER = ["recording", "starts", "scored", "good", "mean share inside", "first estimate, s", "heading of 10°, s"]


def total_of(rows):
    """The row of all recordings."""
    sums = [sum(int(row[column]) for row in rows) for column in (1, 2, 3)]
    share = "{:.1f} % good".format(100.0 * sums[2] / sums[1]) if sums[1] else "–"
    return ["all"] + [str(value) for value in sums] + [share, "", ""]


def compare(options):
    """Run everything; gives the path of the results."""
    results = recordings.for_each_recording(options, lambda name: run_recording(name, options))
    rows = [row_of(name, runs) for name, runs in results.items()]
    rows.append(total_of(rows))
    print(recordings.markdown(HEADER, rows))
    if options.docs:
        recordings.write_docs(options.docs, "starts", recordings.markdown(HEADER, rows))
    path = os.path.join(options.output, "starts.json")
    common.write_text(path, json.dumps(results, indent=1))
    return path


def main():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    recordings.add_arguments(parser, "folder for bags and results")
    parser.add_argument("--localizer", default="imm_ekf")
    parser.add_argument("--starts", type=int, default=20, help="a recording")
    parser.add_argument("--duration", type=float, default=90.0, help="s of each run")
    try:
        print(compare(parser.parse_args()))
    except common.ReportError as error:
        sys.exit("compare_starts: {}".format(error))


if __name__ == "__main__":
    main()
