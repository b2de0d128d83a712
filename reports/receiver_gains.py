#!/usr/bin/env python3
"""What a receiver's velocity and satellites are worth: the tables of docs/receivers.

usage: receiver_gains.py OUTPUT [--data DIR] [--docs DIR] [options]

The recommended localizer is replayed with its defaults on the drives of PAGES, with and without these sources. DIR of
--data (default: $URBAN_GNSS_DATA) holds one folder a recording, as csv_to_bag reads it. OUTPUT gets bags and runs. With
--docs the tables between the markers of that folder's pages are renewed.

The workspace must be sourced, or URBAN_GNSS_PROGRAMS be the folder of the built programs.
"""

import argparse
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import recordings  # noqa: E402
import report_common as common  # noqa: E402
from compare_localizers import ABLATED, RAW_FIX, run_recording  # noqa: E402

NO_VELOCITY, NO_SATELLITES = ["--velocity-topic", ""], ["--satellites-topic", ""]
BOTH, VELOCITY, SATELLITES, NEITHER = "velocity, and satellites with residuals", "velocity", "satellites", "neither"
OPTIONS = {BOTH: [], VELOCITY: NO_SATELLITES, SATELLITES: NO_VELOCITY, NEITHER: NO_VELOCITY + NO_SATELLITES}

# The recordings of each page, as its table calls them, and the rows of it.
PAGES = {
    "ublox": ({"hk_tst_20210517_ublox": "M8T, 786 s", "hk_tst_20190428_ublox": "M8, 484 s"}, tuple(OPTIONS)),
    "novatel": ({"hk_tst_20210517_novatel": "Tsim Sha Tsui, 786 s",
                 "hk_kowloonbay_20211203_novatel": "Kowloon Bay, 2426 s"}, tuple(OPTIONS)),
    "mavros": ({"golfcart_tamu_1": "campus cart, 260 s"}, (VELOCITY, NEITHER)),
}


def cell(score):
    """Median and 95 % of the position error in m, for people."""
    return "{:.1f}, {:.1f}".format(score.percentile(50), score.percentile(95))


def table(page, results):
    """The Markdown table of a page, of the errors by recording and row."""
    named, rows = PAGES[page]
    lines = [["", "Option of `replay`"] + list(named.values())]
    for row in rows:
        option = " ".join(part or '""' for part in OPTIONS[row])
        lines.append([row, "`{}`".format(option) if option else ""] + [cell(results[name][row]) for name in named])
    lines.append(["the fixes themselves", ""] + [cell(results[name][RAW_FIX]) for name in named])
    text = ["| " + " | ".join(line) + " |" for line in lines]
    return "\n".join(text[:1] + ["|" + "---|" * len(lines[0])] + text[1:])


def measure(options):
    """The errors by recording and row."""
    methods = {row: ["--localizer", ABLATED] + option for row, option in OPTIONS.items()}
    return recordings.for_each_recording(options, lambda name: run_recording(
        options.data, options.output, name, methods, recordings.set_arguments(options))[0])


def main():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    recordings.add_arguments(parser, "folder for bags and runs")
    options = parser.parse_args()
    options.recordings = options.recordings or [name for named, _ in PAGES.values() for name in named]
    try:
        results = measure(options)
        for page, (named, _) in PAGES.items():
            if not set(named) <= set(results):
                continue
            print(table(page, results))
            if options.docs:
                recordings.write_docs(os.path.join(options.docs, page + ".md"), "gains", table(page, results))
    except common.ReportError as error:
        sys.exit("receiver_gains: {}".format(error))


if __name__ == "__main__":
    main()
