#!/usr/bin/env python3
"""Lets simulator, occlusion_node and a localizer run for a long time, and says what that does to memory and delays.

usage: soak.py [--seconds 3600] [--factor 1.0] [--scenario downtown_grid] [--localizer imm_ekf] [--json FILE]

A robot drives the route of a scenario with a lidar, again and again, on a master of its own; the localizer takes the
weighted fixes. Printed are, for each node, its memory (first, last, greatest, and the slope of the second half), its
share of a core and whether it is still there; the delays from odometry to estimate and from fix to decision, by the
arrival of the messages here; of the late ones, what they waited for; and what came too late. A deadline is missed where
an estimate takes longer than the interval of the odometry, or a decision longer than that of the fixes. Exits with 1
where a node has ended, or its memory goes on growing by more than --slope MB an hour (not judged below 1200 s).

--seconds are of the simulation, --factor is how many of them are in a second. On a machine with other work start it with
`nice -n -10` as root, for else the delays are those of the other work. The workspace must be sourced;
URBAN_GNSS_PROGRAMS may be the folder of the built programs.
"""
import argparse
import collections
import json
import math
import os
import signal
import sys
import threading
import time

import yaml

import campaign
import fault_graph

SAMPLE_S = 5.0      # of wall time, between two looks at the memory
LEAST_S = 1200.0    # of wall time, for a slope
LATE_SHARE = 0.01   # of the decisions, of which is said what they waited for
TICKS = os.sysconf("SC_CLK_TCK")
PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6
COUNTS = ("clouds received", "clouds in the map", "clouds dropped", "alignments tried", "alignments accepted",
          "callbacks that failed", "odd stamps left out")
PARTS = ("odometry after the fix", "satellites", "occlusion_node", "localizer")


def summary(values):
    """Median, 99 % and maximum; of nothing NaN."""
    ordered = sorted(values)
    if not ordered:
        return {"count": 0, "median": math.nan, "p99": math.nan, "max": math.nan}
    at = lambda share: ordered[min(len(ordered) - 1, int(share * len(ordered)))]  # noqa: E731
    return {"count": len(ordered), "median": at(0.5), "p99": at(0.99), "max": ordered[-1]}


def slope(points):
    """Of the line through [(x, y)] with the least squares; 0 of fewer than two."""
    if len(points) < 2:
        return 0.0
    middle_x, middle_y = (sum(values) / len(points) for values in zip(*points))
    spread = sum((x - middle_x) ** 2 for x, _ in points)
    return sum((x - middle_x) * (y - middle_y) for x, y in points) / spread if spread > 0.0 else 0.0


class Process:
    """What the system says of a node."""

    def __init__(self, node):
        self.node, self.memory = node, []  # [(s, MB)]
        self.begin_cpu = self.cpu_s()

    def cpu_s(self):
        with open("/proc/%d/stat" % self.node.process.pid) as stream:
            fields = stream.read().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS

    def look(self, now):
        with open("/proc/%d/statm" % self.node.process.pid) as stream:
            self.memory.append((now, int(stream.read().split()[1]) * PAGE_MB))
        self.used_s = self.cpu_s() - self.begin_cpu

    def report(self, seconds):
        second_half = [(x, y) for x, y in self.memory if x > self.memory[-1][0] / 2]
        megabytes = [y for _, y in self.memory]
        return {"first_mb": megabytes[0], "last_mb": megabytes[-1], "max_mb": max(megabytes),
                "slope_mb_per_h": 3600.0 * slope(second_half), "cores": self.used_s / seconds,
                "ended": self.node.crash()}


class Delays:
    """When messages came, by their stamps."""

    def __init__(self):
        self.lock = threading.Lock()
        self.odometry, self.fixes, self.epochs = {}, {}, {}
        self.waiting = collections.OrderedDict()   # fixes until odometry goes on: {stamp: True}
        self.odometry_after, self.weighted = {}, {}
        self.estimates, self.decisions = [], []    # s
        self.late = []                             # (s, {part: s})
        self.intervals = {"odometry": [], "fixes": []}
        self.first, self.last = {}, {}

    def note(self, kind, stamp):
        self.first.setdefault(kind, stamp)
        if kind in self.last:
            self.intervals[kind].append(stamp - self.last[kind])
        self.last[kind] = stamp

    def simulated_s(self):
        return (self.last["odometry"] - self.first["odometry"]) * 1e-9

    def on_odometry(self, message):
        now, stamp = time.monotonic(), message.header.stamp.to_nsec()
        with self.lock:
            self.odometry[stamp] = now
            self.note("odometry", stamp)
            for fix in [fix for fix in self.waiting if fix <= stamp]:
                self.odometry_after[fix] = now
                del self.waiting[fix]

    def on_estimate(self, message):
        now = time.monotonic()
        with self.lock:
            came = self.odometry.pop(message.header.stamp.to_nsec(), None)
            if came is not None:
                self.estimates.append(now - came)

    def on_fix(self, message):
        now, stamp = time.monotonic(), message.header.stamp.to_nsec()
        with self.lock:
            self.fixes[stamp] = now
            self.note("fixes", stamp)
            if self.last.get("odometry", -1) >= stamp:
                self.odometry_after[stamp] = now
            else:
                self.waiting[stamp] = True

    def on_satellites(self, message):
        with self.lock:
            self.epochs[message.header.stamp.to_nsec()] = time.monotonic()

    def on_weighted(self, message):
        with self.lock:
            self.weighted[message.header.stamp.to_nsec()] = time.monotonic()

    def on_status(self, message):
        now, stamp = time.monotonic(), message.last_fix.stamp.to_nsec()
        with self.lock:
            came = self.fixes.pop(stamp, None)
            if came is None:
                return  # said before
            self.decisions.append(now - came)
            ready = max(came, self.odometry_after.pop(stamp, came))
            complete = max(ready, self.epochs.pop(stamp, ready))
            weighted = max(complete, self.weighted.pop(stamp, complete))
            self.late.append((now - came, dict(zip(PARTS, (ready - came, complete - ready, weighted - complete,
                                                           now - weighted)))))

    def report(self, factor=1.0):
        """Delays in milliseconds of wall time; so are the deadlines."""
        with self.lock:
            result = {}
            for name, values, kind in (("odometry to estimate", self.estimates, "odometry"),
                                       ("fix to decision", self.decisions, "fixes")):
                steps = sorted(self.intervals[kind])
                deadline = steps[len(steps) // 2] * 1e-9 / factor if steps else math.inf
                result[name] = {key: value if key == "count" else 1e3 * value
                                for key, value in summary(values).items()}
                result[name].update(deadline=1e3 * deadline, missed=sum(value > deadline for value in values))
            worst = sorted(self.late, key=lambda each: each[0])[-max(1, int(LATE_SHARE * len(self.late))):]
            result["waits"] = {part: 1e3 * sum(parts[part] for _, parts in worst) / max(1, len(worst))
                               for part in PARTS}
            return result


def write_rounds(options, folder):
    """The scenario with a route that leads back to its begin, as a file."""
    name = options.scenario if "/" in options.scenario else os.path.join(campaign.ROOT, "scenarios",
                                                                        options.scenario + ".yaml")
    with open(name) as stream:
        scenario = yaml.safe_load(stream)
    scenario["route"]["loop"] = True
    scenario["duration"] = options.seconds + 600.0
    if "start_time" in scenario:
        scenario["start_time"] = scenario["start_time"].strftime("%Y-%m-%dT%H:%M:%SZ")
    file = os.path.join(folder, os.path.basename(name))
    with open(file, "w") as stream:
        yaml.safe_dump(scenario, stream)
    return file


def nodes_of(options, scenario):
    simulator = {"field": "city", "scenario": scenario, "follow_route": True, "real_time_factor": options.factor,
                 "start_delay": 3.0, "expert/wait_for_command": False, "expert/publish_clock": False}
    return [fault_graph.Node("occlusion_node", "/occlusion", {"body_radius": 3.5}),  # the simulated car's bonnet
            fault_graph.Node(options.localizer + "_node", "/" + options.localizer,
                             remaps={"gps/fix": "gps/fix_weighted"}),
            fault_graph.Node("simulator_node", "/simulator", simulator)]


def subscribe(rospy, options, delays, counts):
    from diagnostic_msgs.msg import DiagnosticArray
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import NavSatFix
    from urban_gnss_localization.msg import LocalizationStatus, SatelliteArray

    def on_diagnostics(message):
        for status in message.status:
            for value in status.values:
                if value.key in COUNTS:
                    counts[status.name + ": " + value.key] = int(value.value)

    rospy.Subscriber("/diagnostics", DiagnosticArray, on_diagnostics, queue_size=100)
    for topic, kind, take in (("odom", Odometry, delays.on_odometry), ("gps/fix", NavSatFix, delays.on_fix),
                              ("odometry/filtered", Odometry, delays.on_estimate),
                              ("gps/satellites", SatelliteArray, delays.on_satellites),
                              ("gps/fix_weighted", NavSatFix, delays.on_weighted),
                              (options.localizer + "/status", LocalizationStatus, delays.on_status)):
        rospy.Subscriber(topic, kind, take, queue_size=1000, tcp_nodelay=True)


def run(options):
    """The report of a run."""
    master = fault_graph.Master()
    nodes = nodes_of(options, write_rounds(options, master.logs))
    try:
        import rospy
        rospy.init_node("soak", disable_signals=True, disable_rosout=True, log_level=rospy.FATAL)
        delays, counts = Delays(), {}
        subscribe(rospy, options, delays, counts)
        for node in nodes:
            node.start(rospy)
        fault_graph.await_(lambda: delays.estimates or not all(node.is_alive() for node in nodes), "an estimate")
        processes = [Process(node) for node in nodes if node.is_alive()]
        begin = time.monotonic()
        end = begin + options.seconds / options.factor
        while time.monotonic() < end and all(node.is_alive() for node in nodes):
            for process in processes:
                process.look(time.monotonic() - begin)
            time.sleep(max(0.0, min(SAMPLE_S, end - time.monotonic())))
        seconds = time.monotonic() - begin
        return {"wall_s": seconds, "simulated_s": delays.simulated_s(), "delays_ms": delays.report(options.factor), "counts": counts,
                "nodes": {process.node.program: process.report(seconds) for process in processes},
                "ended": {node.program: node.crash() for node in nodes if not node.is_alive()}}
    finally:
        for node in nodes:
            if node.is_alive():
                node.end(signal.SIGINT)
        master.close()


def show(report):
    """For people, as Markdown."""
    lines = ["%.0f s of the simulation in %.0f s" % (report["simulated_s"], report["wall_s"]), ""]
    rows = [[name] + ["%.1f" % each[key] for key in ("first_mb", "last_mb", "max_mb", "slope_mb_per_h")] +
            ["%.2f" % each["cores"]] for name, each in report["nodes"].items()]
    lines += [campaign.table_of(("node", "memory first, MB", "last", "greatest", "slope, MB/h", "cores"), rows), ""]
    rows = [[name, each["count"]] + ["%.1f" % each[key] for key in ("median", "p99", "max", "deadline")] +
            [each["missed"]] for name, each in report["delays_ms"].items() if "median" in each]
    lines += [campaign.table_of(("delay, ms", "count", "median", "99 %", "greatest", "deadline", "missed"), rows), ""]
    lines.append("The slowest 1 %% of the decisions waited for: %s" % ", ".join(
        "%s %.1f ms" % each for each in report["delays_ms"]["waits"].items()))
    lines += ["%s: %d" % each for each in sorted(report["counts"].items())]
    return "\n".join(lines + ["%s ended: %s" % each for each in report["ended"].items()])


def faults_of(report, most_slope):
    """What is wrong, as sentences."""
    faults = ["%s has ended: %s" % each for each in report["ended"].items()]
    if report["wall_s"] < LEAST_S:
        return faults
    return faults + ["the memory of %s grows by %.1f MB an hour" % (name, each["slope_mb_per_h"])
                     for name, each in report["nodes"].items() if each["slope_mb_per_h"] > most_slope]


def main():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3600.0, help="of the simulation")
    parser.add_argument("--factor", type=float, default=1.0, help="seconds of the simulation in a second, at the most")
    parser.add_argument("--scenario", default="downtown_grid", help="a name of scenarios/ without .yaml, or a file")
    parser.add_argument("--localizer", default="imm_ekf")
    parser.add_argument("--slope", type=float, default=10.0, help="MB an hour, by which memory may grow")
    parser.add_argument("--json", help="file for the report")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(2))  # and no node is left behind
    report = run(options)
    print(show(report))
    if options.json:
        with open(options.json, "w") as stream:
            json.dump(report, stream, indent=1)
    faults = faults_of(report, options.slope)
    for fault in faults:
        print(fault)
    sys.stdout.flush()
    os._exit(1 if faults else 0)  # rospy's threads


if __name__ == "__main__":
    main()
