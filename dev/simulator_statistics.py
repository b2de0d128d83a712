#!/usr/bin/env python3
"""How the simulated receiver does in the scenarios, over several seeds, as the tables of docs/results/simulation.md.

The workspace must be sourced, or URBAN_GNSS_PROGRAMS be the folder of the built programs.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile

SCENARIOS = ["open_sky", "building_pass", "campus_loop", "downtown_grid", "tunnel"]
CLASSES = ["direct", "multipath", "nlos", "blocked"]


def simulate(scenario, seed, overrides, directory):
    file = os.path.join(directory, "run.json")
    programs = os.environ.get("URBAN_GNSS_PROGRAMS")
    program = [os.path.join(programs, "simulate")] if programs else ["rosrun", "urban_gnss_localization", "simulate"]
    command = program + ["--scenario", scenario, "--seed", str(seed), "--without-lidar", "--json", file]
    for override in overrides:
        command += ["--set", override]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, universal_newlines=True)
    if done.returncode != 0:
        sys.exit(done.stderr.strip().splitlines()[-1])
    with open(file) as stream:
        return json.load(stream)


def mean(values):
    known = [v for v in values if v is not None]
    return statistics.mean(known) if known else float("nan")


def span(values):
    known = [v for v in values if v is not None]
    return "%.1f (%.1f–%.1f)" % (mean(known), min(known), max(known)) if known else "–"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenarios", nargs="*", default=SCENARIOS, help="default: %s" % " ".join(SCENARIOS))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--set", action="append", default=[], dest="overrides", metavar="SECTION.NAME=VALUE")
    options = parser.parse_args()
    runs = {}
    with tempfile.TemporaryDirectory() as directory:
        for scenario in options.scenarios:
            runs[scenario] = [simulate(scenario, seed, options.overrides, directory)
                              for seed in range(1, options.seeds + 1)]
            print("%s done" % scenario, file=sys.stderr)

    print("| Scenario | with a fix, % | error median, m | 95 %, m | correlation time, s | claimed σ, m | NEES |")
    print("|---|---|---|---|---|---|---|")
    for scenario, of_seed in runs.items():
        print("| `%s` | %.1f | %s | %s | %s | %.1f | %.1f |" % (
            os.path.splitext(os.path.basename(scenario))[0], 100.0 * mean([r["availability"] for r in of_seed]),
            span([r["error_m"]["median"] for r in of_seed]), span([r["error_m"]["p95"] for r in of_seed]),
            span([r["correlation_time_s"] for r in of_seed]), mean([r["claimed_sigma_m"]["median"] for r in of_seed]),
            mean([r["nees_mean"] for r in of_seed])))
    print()
    print("| Scenario | path class | share, % | range error median, m | 95 % of its size, m | C/N0 median, dB-Hz |")
    print("|---|---|---|---|---|---|")
    for scenario, of_seed in runs.items():
        for name in CLASSES:
            classes = [r["path_classes"][name] for r in of_seed]
            share = sum(c["count"] for c in classes) / sum(
                c["count"] for r in of_seed for c in r["path_classes"].values())
            numbers = [mean([c["range_error_m"]["median"] for c in classes]),
                       mean([c["absolute_range_error_m"]["p95"] for c in classes]),
                       mean([c["cn0_dbhz"]["median"] for c in classes])]
            print("| `%s` | %s | %.1f | %s |" % (os.path.splitext(os.path.basename(scenario))[0], name, 100.0 * share,
                                                 " | ".join("–" if n != n else "%.1f" % n for n in numbers)))


if __name__ == "__main__":
    main()
