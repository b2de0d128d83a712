#!/usr/bin/env python3
"""Runs every benchmark, and writes what it measured into docs/results: benchmarks.json and the tables of benchmarks.md.

    make -C .workspace/build all benchmarks && . scripts/environment.sh
    dev/benchmarks.py [--repetitions 9] [--min-time 0.2] [--only REGEX] [--write]

What is compared stands in one run, in random order (--benchmark_enable_random_interleaving), so that a machine which
becomes slower meanwhile is slower for both. A figure is the median of the repetitions, of the processor's time. Without
--write the tables are printed only; with --only REGEX no tables are made.
"""
import argparse
import json
import os
import platform
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time

import campaign
import fault_graph

sys.path.append(os.path.join(campaign.ROOT, "reports"))
import recordings  # noqa: E402

PAGE = os.path.join(campaign.ROOT, "docs", "results", "benchmarks.md")
STORED = os.path.join(campaign.ROOT, "docs", "results", "data", "benchmarks.json")
PROGRAMS = ("particle_filter", "occlusion", "imm_ekf", "ukf", "complementary_ekf", "lidar")
DRIVE_S = 400.0
UNITS_S = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}

# Work, its benchmark, what is wanted in seconds (None: no goal of its own), what a user would take instead.
PARTICLES = (
    ("predict and weigh 10 000 particles, bicycle", "BM_PredictAndWeigh/10000/0", 10000 / 120e6,
     (("structs, `std::normal_distribution`", "BM_PredictAndWeighStructs/10000/0"),)),
    ("the same, 1 000 000", "BM_PredictAndWeigh/1000000/0", 1e6 / 120e6,
     (("structs, `std::normal_distribution`", "BM_PredictAndWeighStructs/1000000/0"),)),
    ("resampling 10 000, systematic", "BM_Resampling/10000/1", 0.1e-3,
     (("`std::discrete_distribution`", "BM_ResamplingDiscreteDistribution/10000"),)),
    ("the same, multinomial", "BM_Resampling/10000/0", None,
     (("`std::discrete_distribution`", "BM_ResamplingDiscreteDistribution/10000"),)),
    ("sample size, heaviest cluster, mean, covariance of 100 000", "BM_Estimate/100000", 5e-3, ()),
    ("the paper's step with ring and clusters, 1000", "BM_PaperStep/1000", None, ()),
    ("the same, 10 000", "BM_PaperStep/10000", None, ()),
    ("the same, 100 000", "BM_PaperStep/100000", None, ()),
    ("switching filter: a step with one plausible particle", "BM_SwitchingStep", None, ()),
    ("the same: a prediction with all 100", "BM_SwitchingMoveAll", None, ()),
    ("the same: a correction with all 100", "BM_SwitchingCorrectAll", None, ()),
    ("bias Kalman filter: a step", "BM_BiasKalmanStep", None, ()),
)
OCCLUSION = (
    ("40 rays in 1.5 M points, on a drive", "BM_Trace40Voxel/1", 20e-6,
     (("PCL's octree", "BM_Trace40PclOctree/1"), ("OctoMap", "BM_Trace40OctoMap/1"))),
    ("the same at 25 places far apart, the map not in the cache", "BM_Trace40Voxel/0", 30e-6,
     (("PCL's octree", "BM_Trace40PclOctree/0"), ("OctoMap", "BM_Trace40OctoMap/0"))),
    ("a cloud of 120 000 points cut and inserted", "BM_AddCloud120k/0", 3e-3, ()),
    ("the same, and aligned before", "BM_AddCloud120k/1", 10e-3, ()),
    ("a scan of 20 000 points inserted: empty map", "BM_InsertScan20k/0", None, ()),
    ("the same: map of the city", "BM_InsertScan20k/1", None, ()),
    ("search made of 42 000 points, 22 500 questions for the nearest", "BM_NearestOurGrid", None,
     (("PCL's kd-tree", "BM_NearestPclKdTree"), ("nanoflann", "BM_NearestNanoflann"))),
    ("a scan of 20 000 points aligned: good guess", "BM_AlignScan20k/0/0", None,
     (("PCL's ICP", "BM_AlignScan20k/1/0"),)),
    ("the same: poor guess", "BM_AlignScan20k/0/1", None, (("PCL's ICP", "BM_AlignScan20k/1/1"),)),
    ("the same: with clutter", "BM_AlignScan20k/0/2", None, (("PCL's ICP", "BM_AlignScan20k/1/2"),)),
    ("`occlusion_node`, a cloud of 120 000 points at 10 Hz, all in", "occlusion_node", 8e-3, ()),
    ("simulated lidar, 100 buildings: a scan of a spinning one", "BM_Scan/1", None, ()),
    ("the same: half a turn of a rotating scanner", "BM_Scan/2", None, ()),
)
FILTERS = (
    ("interacting models (`imm_ekf`): a prediction", "BM_ImmEkfMove", 0.25e-6, ()),
    ("the same: a correction", "BM_ImmEkfCorrect", 1.2e-6, ()),
    ("the same: with 12 ranges", "BM_ImmEkfCorrectWithRanges/12", None, ()),
    ("the same: with 40 ranges", "BM_ImmEkfCorrectWithRanges/40", 10e-6, ()),
    ("of it, ranges solved anew: 12 satellites", "BM_RangeFix/12", None, ()),
    ("the same: 40", "BM_RangeFix/40", None, ()),
    ("UKF: a prediction", "BM_UkfMove", None, ()),
    ("the same: a correction", "BM_UkfCorrect", None, ()),
    ("complementary EKF: a prediction", "BM_Predict", None, ()),
    ("the same: a correction", "BM_Correct/1", None, ()),
    ("`replay` of a drive of 400 s, with an output bag", "replay with a bag", DRIVE_S / 3000.0, ()),
    ("the same, without one", "replay", None, ()),
    ("from a fix to its `odometry/filtered`, live, wall time: median", "fix to odometry", 0.3e-3,
     (("a node that only repeats odometry", "repeater"),)),
    ("the same, 99 %", "fix to odometry, 99 %", 2e-3, (("a node that only repeats odometry", "repeater, 99 %"),)),
)
TABLES = {"particles": PARTICLES, "occlusion": OCCLUSION, "filters": FILTERS}


def in_words(seconds):
    """Three digits and a unit."""
    for unit, of_s in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)):
        if seconds >= 0.9995 * of_s or unit == "ns":
            number = seconds / of_s
            return "{:.{}f} {}".format(number, 0 if number >= 99.95 else 1 if number >= 9.995 else 2, unit)
    return None


def two_digits(ratio):
    return "{:.{}f}".format(ratio, 2 if ratio < 0.995 else 1 if ratio < 9.95 else 0)


def benchmark_of(name):
    """What is no Google Benchmark is named by its row."""
    return "`{}`".format(name) if name.startswith("BM_") else ""


def table_of(rows, results):
    """As lines of markdown: what is wanted and missed is said, and below it what a user would take instead."""
    lines = ["| Work | Median | Wanted | Benchmark |", "|---|---|---|---|"]
    for work, name, goal, others in rows:
        ours = results[name]["median_s"]
        wanted = "" if goal is None else in_words(goal) + ("" if ours <= goal else ", **missed**")
        lines.append("| {} | {} | {} | {} |".format(work, in_words(ours), wanted, benchmark_of(name)))
        for label, other in others:
            theirs = results[other]["median_s"]
            lines.append("| – {} | {}, × {} | | {} |".format(label, in_words(theirs), two_digits(theirs / ours),
                                                              benchmark_of(other)))
    return "\n".join(lines)


def machine_in_words(machine):
    """A sentence for the page."""
    return ("{processor}, {cores} cores, {system}, `{build_type}`,\n{compiler};\nload at the start {load:.1f}; {date}; "
            "medians of {repetitions} repetitions.").format(**machine)


def of_page(page, stored):
    """The page with the tables of the stored results."""
    parts = {name: table_of(rows, stored["results"]) for name, rows in TABLES.items()}
    parts["machine"] = "```sh\n{}\n```\n\n{}".format(stored["command"], machine_in_words(stored["machine"]))
    for name, text in parts.items():
        page = recordings.replace_between(page, name, text, PAGE)
    return page


def output_of(*command):
    return subprocess.run(command, stdout=subprocess.PIPE, check=True, universal_newlines=True).stdout.strip()


def describe_machine(repetitions):
    """What the figures depend on."""
    with open("/proc/cpuinfo", encoding="utf-8") as stream:
        found = re.search(r"model name\s*: (.*)", stream.read())
    with open("/etc/os-release", encoding="utf-8") as stream:
        system = re.search(r'PRETTY_NAME="(.*)"', stream.read())[1]
    with open(os.path.join(campaign.ROOT, ".workspace", "build", "CMakeCache.txt"), encoding="utf-8") as stream:
        cache = stream.read()
    compiler = re.search(r"CMAKE_CXX_COMPILER:\w+=(.*)", cache)[1]
    return {"processor": found[1] if found else platform.machine(), "cores": os.cpu_count(), "system": system,
            "compiler": output_of(compiler, "--version").splitlines()[0],
            "build_type": re.search(r"CMAKE_BUILD_TYPE:\w+=(.*)", cache)[1], "load": os.getloadavg()[0],
            "date": time.strftime("%Y-%m-%d"), "repetitions": repetitions}


def summary(seconds):
    ordered = sorted(seconds)
    return {"median_s": statistics.median(ordered), "least_s": ordered[0], "most_s": ordered[-1]}


def run_benchmarks(program, options, folder):
    """{name: summary} of one program."""
    output = os.path.join(folder, program + ".json")
    command = campaign.program(program + "_benchmark") + [
        "--benchmark_repetitions=%d" % options.repetitions, "--benchmark_min_time=%g" % options.min_time,
        "--benchmark_enable_random_interleaving=true", "--benchmark_out=" + output, "--benchmark_out_format=json"]
    if options.only:
        command.append("--benchmark_filter=" + options.only)
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, universal_newlines=True)
    if done.returncode != 0 or not os.path.exists(output) or os.path.getsize(output) == 0:
        if options.only:
            return {}
        sys.exit("benchmarks.py: %s: %s" % (command[0], done.stderr.strip()))
    with open(output, encoding="utf-8") as stream:
        runs = json.load(stream)["benchmarks"]
    times = {}
    for run in runs:
        if run["run_type"] == "iteration":
            times.setdefault(run["run_name"].split("/repeats:")[0], []).append(run["cpu_time"] * UNITS_S[run["time_unit"]])
    return {name: summary(seconds) for name, seconds in times.items()}


def children_seconds():
    """The processor's, of all programs that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run_replay(options, folder):
    """How long the tool takes as a whole, from its start to its end."""
    drive, output = os.path.join(folder, "drive.bag"), os.path.join(folder, "out.bag")
    subprocess.run(campaign.program("simulate") + ["--scenario", "campus_loop", "--duration", "%g" % DRIVE_S,
                                                   "--without-lidar", "--output", drive],
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
    seconds = {"replay with a bag": [], "replay": []}
    for _ in range(options.repetitions):
        for name, arguments in (("replay with a bag", ["--output", output]), ("replay", [])):
            began = children_seconds()
            subprocess.run(campaign.program("replay") + [drive] + arguments,
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
            seconds[name].append(children_seconds() - began)
    return {name: summary(values) for name, values in seconds.items()}


def run_occlusion_node(seconds=12):
    """The processor's time of the node for a cloud, by dev/cloud_load.py beside it."""
    master = fault_graph.Master()
    try:
        with subprocess.Popen(campaign.program("occlusion_node") + ["__name:=occlusion"],
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as node:
            try:
                output = output_of(sys.executable, os.path.join(campaign.ROOT, "dev", "cloud_load.py"),
                                   "--points", "120000", "--rate", "10", "--seconds", "%d" % seconds)
            finally:
                node.terminate()
    finally:
        master.close()
    return {"occlusion_node": summary([1e-3 * float(re.search(r"node: ([\d.]+) ms a cloud", output)[1])])}


def run_latency(seconds=60):
    """From a fix to the estimate that has it, by dev/latency.py, and through a node that only repeats odometry."""
    output = output_of(sys.executable, os.path.join(campaign.ROOT, "dev", "latency.py"), "--seconds", "%d" % seconds)
    results = {}
    for name, label in (("fix to odometry", "localizer: fix and odometry"), ("repeater", "repeater: odometry")):
        median, late = re.search(re.escape(label) + r" +([\d.]+) +([\d.]+)", output).groups()
        results[name], results[name + ", 99 %"] = summary([1e-3 * float(median)]), summary([1e-3 * float(late)])
    return results


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=9)
    parser.add_argument("--min-time", type=float, default=0.2, help="of a repetition, s (default 0.2)")
    parser.add_argument("--only", metavar="REGEX", help="benchmarks whose name has it; prints them, writes nothing")
    parser.add_argument("--write", action="store_true", help="into docs/results")
    options = parser.parse_args()
    if options.only and options.write:
        parser.error("--only leaves out what the tables need: not with --write")
    # The programs themselves: rosrun takes longer to find one than some take to run.
    os.environ.setdefault("URBAN_GNSS_PROGRAMS",
                          os.path.join(campaign.ROOT, ".workspace", "devel", "lib", "urban_gnss_localization"))
    machine, results = describe_machine(options.repetitions), {}
    with tempfile.TemporaryDirectory() as folder:
        steps = [(program, lambda program=program: run_benchmarks(program, options, folder)) for program in PROGRAMS]
        if not options.only:
            steps += [("replay", lambda: run_replay(options, folder)), ("occlusion_node", run_occlusion_node),
                      ("latency", run_latency)]
        for i, (name, step) in enumerate(steps):
            print("[%d/%d] %s" % (i + 1, len(steps), name), file=sys.stderr)
            results.update(step())
    if options.only:
        for name, result in results.items():
            print("{}: {} ({} to {})".format(name, *(in_words(result[key]) for key in ("median_s", "least_s", "most_s"))))
        return
    command = " ".join(["dev/benchmarks.py"] + sys.argv[1:])
    stored = {"command": command, "machine": machine, "results": results}
    for name, rows in TABLES.items():
        print("\n" + table_of(rows, results))
    if options.write:
        with open(PAGE, encoding="utf-8") as stream:
            page = of_page(stream.read(), stored)
        with open(STORED, "w", encoding="utf-8") as stream:
            json.dump(stored, stream, indent=1, sort_keys=True)
            stream.write("\n")
        with open(PAGE, "w", encoding="utf-8") as stream:
            stream.write(page)


if __name__ == "__main__":
    main()
