#!/usr/bin/env python3
"""How far the defaults can be trusted on drives on which they were not chosen.

usage: leave_one_out.py OUTPUT [--data DIR] [--docs FILE] [options]

DIR (default: $URBAN_GNSS_DATA) holds one folder a recording, as csv_to_bag reads it; those without truth.csv are left
out. The recommended localizer is replayed on every recording with every set of GRID. For each drive the set that does
best on all others is chosen; the table has what this set does on the drive left out, beside the defaults. All receivers
of a drive are one. OUTPUT gets the bags and leave_one_out.json. With --docs the table between the markers of that
Markdown file is renewed.

The workspace must be sourced, or URBAN_GNSS_PROGRAMS be the folder of the built programs.
"""

import argparse
import itertools
import json
import math
import os
import re
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import recordings  # noqa: E402
import report_common as common  # noqa: E402

LOCALIZER = "imm_ekf"
GRID = {"expert.common_error.common_error_share": (0.45, 0.55, 0.7),
        "expert.fix_noise.fix_scale_lag": (4.0, 8.0, 15.0),
        "expert.fix_noise.first_fix_scale": (2.0, 2.5, 3.0)}


def drive_of(recording):
    """The drive of a recording: its name up to the date, where it has one; receivers of one drive share it."""
    dated = re.match(r".*?\d{8}", recording)
    return dated.group(0) if dated else recording


def cost(errors):
    """What is to be small: log median + log 95 % + |log of NEES over its expectation|."""
    position = errors["position_m"]
    return math.log(position["median"]) + math.log(position["p95"]) + abs(math.log(errors["position_nees_mean"] / 2.0))


def sets():
    """Every set of parameters, as NAME=VALUE; the empty one are the defaults."""
    return [()] + [tuple("{}={}".format(*pair) for pair in zip(GRID, values))
                   for values in itertools.product(*GRID.values())]


def run_recording(name, options):
    """The errors of one recording by the set of parameters."""
    folder = os.path.join(options.output, name)
    os.makedirs(folder, exist_ok=True)
    bag, path = os.path.join(folder, "recording.bag"), os.path.join(folder, "errors.json")
    recordings.make_bag(os.path.join(options.data, name), bag)
    found = {}
    for chosen in sets():
        arguments = [part for text in chosen for part in ("--set", text)]
        report = recordings.replay(bag, path, LOCALIZER, *arguments, *recordings.set_arguments(options))
        found[chosen] = report["errors"]
    return found


def choose(results, left_out):
    """The set with the least mean cost over all drives but one; every drive counts alike."""
    def mean_cost(chosen):
        drives = {}
        for name, found in results.items():
            if drive_of(name) != left_out:
                drives.setdefault(drive_of(name), []).append(cost(found[chosen]))
        return sum(sum(costs) / len(costs) for costs in drives.values()) / max(1, len(drives))

    return min((chosen for chosen in sets() if chosen), key=mean_cost)


def text_of(errors):
    """Median / 95 %, share inside the ellipse and NEES, for people."""
    position = errors["position_m"]
    return "{:.1f} / {:.1f}, {:.2f}, {:.2f}".format(position["median"], position["p95"], errors["inside_95"],
                                                    errors["position_nees_mean"] / 2.0)


def table(results):
    """Header and rows: what the set chosen on the other drives does on the one left out."""
    header = ["recording", "set of the others", "left out", "with the defaults"]
    rows = []
    for name, found in results.items():
        chosen = choose(results, drive_of(name))
        rows.append([name, ", ".join(text.split("=")[1] for text in chosen), text_of(found[chosen]),
                     text_of(found[()])])
    return header, rows


def main():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    recordings.add_arguments(parser, "folder for bags and leave_one_out.json")
    options = parser.parse_args()
    try:
        results = recordings.for_each_recording(options, lambda name: run_recording(name, options))
        with open(os.path.join(options.output, "leave_one_out.json"), "w", encoding="utf-8") as stream:
            json.dump({name: [{"set": chosen, "errors": errors} for chosen, errors in found.items()]
                       for name, found in results.items()}, stream, indent=1)
        lines = recordings.markdown(*table(results))
        print(lines)
        if options.docs:
            recordings.write_docs(options.docs, "leave one out", lines)
    except common.ReportError as error:
        sys.exit("leave_one_out: {}".format(error))


if __name__ == "__main__":
    main()
