"""decode_nmea against what gpsd makes of the same sentences, on recorded logs; skipped without URBAN_GNSS_DATA.

A `.chk` has the sentences of a log, each followed by what gpsd reports then: TPV (fix) and SKY (satellites). gpsd reports
a solution while it grows, so the last report of a time is the whole one, and those before it may have less."""
import bisect
import collections
import csv
import datetime
import json
import math
import os
import subprocess
import unittest

PROGRAMS = os.environ.get("URBAN_GNSS_PROGRAMS", "")
PACKAGE = os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", ".."))
DATA = os.environ.get("URBAN_GNSS_DATA", os.path.join(PACKAGE, "..", "shared", "data"))
LOGS = os.path.join(DATA, "nmea")
DRIVE = os.path.join(DATA, "mtv_f9k_nmea")

DEGREE_DIGITS = 1e-9   # gpsd writes nine decimals
HEIGHT_DIGITS = 1e-3
METRES_A_DEGREE = 111194.0  # of latitude

# Per log: how many of gpsd's fixes (times with mode 2 or 3) and SKYs are equal, of how many; and why others differ.
# docs/receivers/nmea.md has the reasons.
EXPECTED = {
}


def decode(path, *options):
    """Solutions in their order: dicts with the lines of decode_nmea, by their class."""
    text = subprocess.run([os.path.join(PROGRAMS, "decode_nmea"), path, *options], check=True, stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, universal_newlines=True, timeout=60).stdout
    solutions = []
    for line in text.splitlines():
        entry = json.loads(line)
        if entry["class"] == "fix":
            solutions.append({})
        solutions[-1][entry["class"]] = entry
    return solutions


def seconds(text):
    return datetime.datetime.strptime(text, "%Y-%m-%dT%H:%M:%S.%fZ").replace(tzinfo=datetime.timezone.utc).timestamp()


def read_reports(path):
    """The reports of a .chk with the number of the line that they stand on."""
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            if line.startswith("{"):
                yield number, json.loads(line)


def difference(fix, tpv):
    """What differs between two fixes: "equal", or the reason."""
    north = (fix["lat"] - tpv["lat"]) * METRES_A_DEGREE
    east = (fix["lon"] - tpv["lon"]) * METRES_A_DEGREE * math.cos(math.radians(fix["lat"]))
    if max(abs(fix["lat"] - tpv["lat"]), abs(fix["lon"] - tpv["lon"])) > DEGREE_DIGITS:
        return "another sentence's place" if math.hypot(north, east) < 3.5 else "place"
    height = tpv.get("altHAE") if tpv["mode"] == 3 else None
    if fix["alt"] is None or height is None:
        return "equal" if fix["alt"] == height else "2-D" if fix["alt"] is None else "height"
    if abs(fix["alt"] - height) <= HEIGHT_DIGITS:
        return "equal"
    above_sea = min(abs(fix["alt"] - tpv["altMSL"] - geoid) for geoid in (0.0, tpv["geoidSep"]))
    return "geoid" if above_sea <= 0.006 else "height"


def compare_fixes(solutions, chk):
    """Counts: the times with a fix in gpsd by what differs; and those of ours that gpsd lacks."""
    reports, dateless = {}, []
    for _, report in read_reports(chk):
        if report["class"] == "TPV" and report["mode"] >= 2:
            if "time" in report:
                reports[round(seconds(report["time"]), 3)] = report
            else:
                dateless.append(report)
    ours = {round(float(each["fix"]["stamp"]), 3): each["fix"] for each in solutions if each["fix"]["has_fix"]}
    result = collections.Counter()
    for time, report in reports.items():
        result["missing" if time not in ours else difference(ours[time], report)] += 1
    for time in set(ours) - set(reports):
        known = any(difference(ours[time], each) == "equal" for each in dateless)
        result["equal, gpsd without time" if known else "more than gpsd"] += 1
    return dict(result)


def merged(satellites):
    """gpsd lists each signal; the first counts, else the strongest of the others. Direction None where it has none."""
    directions, signals = {}, collections.defaultdict(list)
    for each in satellites:
        if not each.get("svid"):
            continue
        key = (each["gnssid"], each["svid"])
        if "az" in each and "el" in each:
            directions[key] = (each["az"], each["el"])
        signals[key].append((each.get("sigid", 0), each.get("ss", 0.0)))
    return {key: (directions.get(key), min(each)[1] or max(cn0 for _, cn0 in each)) for key, each in signals.items()}


def ours_as_sky(epoch):
    result = {}
    for each in epoch["satellites"]:
        known = each["az"] is not None and each["el"] is not None
        direction = (round(each["az"], 6), round(each["el"], 6)) if known else None
        result[(each["gnssid"], each["svid"])] = (direction, each["cn0"] or 0.0)
    return result


def compare_skies(solutions, chk):
    """Counts of gpsd's SKYs with satellites, and how many of our lists one of them is equal to.

    gpsd reports a sky while it grows: such a part may lack satellites and signals that ours has, nothing else. A SKY is
    of the solution that was open, or of the next where the receiver sends GSV first."""
    starts = [round(float(each["fix"]["stamp"]) * 1e9) for each in solutions]
    result, whole = collections.Counter(), set()
    for number, report in read_reports(chk):
        if report["class"] != "SKY" or not report.get("satellites"):
            continue
        sky = merged(report["satellites"])
        last = bisect.bisect_right(starts, number) - 1
        candidates = {i: ours_as_sky(solutions[i]["satellites"]) for i in (last, last + 1)
                      if 0 <= i < len(solutions) and "satellites" in solutions[i]}
        equal = [i for i, ours in candidates.items() if sky == ours]
        part = any(all(key in ours and ours[key][0] == direction and cn0 in (0.0, ours[key][1])
                       for key, (direction, cn0) in sky.items()) for ours in candidates.values())
        result["equal" if equal else "part" if part else "different"] += 1
        whole.update(equal)
    lists = {i for i, each in enumerate(solutions) if each.get("satellites", {}).get("satellites")}
    result["lists"] = len(lists)
    result["lists that no SKY equals"] = len(lists - whole)
    return dict(result)
