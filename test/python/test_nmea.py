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
import tempfile
import time
import unittest

import test_tools

PROGRAMS = os.environ.get("URBAN_GNSS_PROGRAMS", "")
PACKAGE = os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", ".."))
DATA = os.environ.get("URBAN_GNSS_DATA", os.path.join(PACKAGE, "..", "shared", "data"))
LOGS = os.path.join(DATA, "nmea")
DRIVE = os.path.join(DATA, "mtv_f9k_nmea")

DEGREE_DIGITS = 1e-9   # gpsd writes nine decimals
HEIGHT_DIGITS = 1e-3
METRES_A_DEGREE = 111194.0  # of latitude

# What differs, by log; docs/receivers/nmea.md has the table and the reasons. All else is equal, and no SKY is different.
FIXES = {
    "beidou-bd": {"equal": 4, "equal, gpsd without time": 1},
    "bt451": {"equal": 12, "equal, gpsd without time": 1, "more than gpsd": 2},
    "bundg_zeus_9": {"equal": 49, "another sentence's place": 98, "equal, gpsd without time": 1, "more than gpsd": 1},
    "garmin25lp": {"equal": 1, "2-D": 9},
    "geos-1m": {"equal": 6, "equal, gpsd without time": 1},
    "haicom-305N": {"equal": 66, "2-D": 1, "equal, gpsd without time": 1},
    "myguide-3100": {"geoid": 8, "more than gpsd": 1},
    "nl2008u": {"equal": 9},
    "quectel-eg25-g": {"equal": 23},
    "ublox-8": {"equal": 72},
    "ublox-neo-m8l": {"geoid": 189},
    "ublox-zed-f9p-nmea": {"equal": 29},
}
# Lists of satellites; one of bundg_zeus_9 is of the group of GSV that the log's end cuts off.
LISTS = {"beidou-bd": 2, "bt451": 13, "bundg_zeus_9": 146, "garmin25lp": 20, "geos-1m": 9, "haicom-305N": 27,
         "myguide-3100": 13, "nl2008u": 9, "quectel-eg25-g": 60, "ublox-8": 72, "ublox-neo-m8l": 19,
         "ublox-zed-f9p-nmea": 29}
BINARY = "ublox-neo-m8l"  # its log is u-blox's protocol; gpsd's translation into NMEA is in the .chk


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
    return result


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class NmeaTest(unittest.TestCase):
    def logs(self):
        if not os.path.isdir(LOGS):
            self.skipTest("no recordings in " + LOGS)
        for name in FIXES:
            log = os.path.join(LOGS, "gpsd_%s.log" % name)
            yield name, log, log + ".chk"

    def test_fixes_are_those_of_gpsd(self):
        for name, log, chk in self.logs():
            with self.subTest(log=name):
                self.assertEqual(compare_fixes(decode(chk if name == BINARY else log), chk), FIXES[name])

    def test_satellites_are_those_of_gpsd(self):
        for name, _, chk in self.logs():
            with self.subTest(log=name):
                counts = compare_skies(decode(chk, "--by-lines"), chk)
                self.assertEqual(counts["different"], 0)
                self.assertEqual(counts["lists"], LISTS[name])
                self.assertEqual(counts["lists that no SKY equals"], 1 if name == "bundg_zeus_9" else 0)

    def test_sentences_with_arrival_stamps_give_the_same(self):
        """As on a topic. There solutions of before the first date count too, and the last one does not wait."""
        for name, log, chk in self.logs():
            with self.subTest(log=name):
                by_time = decode(chk if name == BINARY else log)
                by_arrival = [each for each in decode(chk, "--by-lines")][-len(by_time):]
                self.assertEqual([content(each) for each in by_time], [content(each) for each in by_arrival])

    def test_the_tables_of_a_drive(self):
        """mtv_f9k_nmea: fixes and satellites of the log are those of the tables that were made of it by others."""
        if not os.path.isdir(DRIVE):
            self.skipTest("no recording in " + DRIVE)
        solutions = {float(each["fix"]["stamp"]): each for each in decode(os.path.join(DRIVE, "receiver.nmea"),
                                                                         "--nmea-date", "1970-01-01")}
        fixes = read_table("gnss.csv")
        for row in fixes:
            fix = solutions[float(row["stamp"])]["fix"]
            self.assertAlmostEqual(fix["lat"], float(row["lat_deg"]), delta=DEGREE_DIGITS)
            self.assertAlmostEqual(fix["lon"], float(row["lon_deg"]), delta=DEGREE_DIGITS)
            self.assertAlmostEqual(fix["alt"], float(row["alt_m"]), delta=HEIGHT_DIGITS)
        self.assertEqual(len(fixes), 1653)
        self.assertLessEqual(len(solutions) - len(fixes), 1)  # one GGA has a wrong checksum; its RMC is right

        strengths = collections.Counter()
        for row in read_table("sats.csv"):
            satellites = {each["name"]: each for each in solutions[float(row["stamp"])]["satellites"]["satellites"]}
            satellite = satellites[row["sat"]]
            self.assertAlmostEqual(satellite["az"], math.degrees(float(row["az"])), delta=1e-3)
            self.assertAlmostEqual(satellite["el"], math.degrees(float(row["el"])), delta=1e-3)
            if satellite["cn0"] == (float(row["cn0"]) if row["cn0"] else None):
                strengths["equal"] += 1
            else:  # the table has the first signal only, and takes sentences with a wrong checksum
                strengths["of a sentence that is refused" if row["cn0"] else "only another signal is tracked"] += 1
        self.assertEqual(strengths, {"equal": 60605, "only another signal is tracked": 768,
                                     "of a sentence that is refused": 17})


@unittest.skipUnless(PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
class ReplayTest(unittest.TestCase):
    """A recording whose fixes are in a bag, and the same fixes as a log of NMEA."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        test_tools.write_recording(self.folder)
        self.bag = self.file("drive.bag")
        done = test_tools.run("csv_to_bag", self.folder, self.bag)
        self.assertEqual(done.returncode, 0, done.stdout)

    def file(self, name):
        return os.path.join(self.folder, name)

    def write_log(self, with_date=True):
        """A sentence that is cut and one that is wrong stand between the others."""
        with open(self.file("gnss.csv"), newline="") as table, open(self.file("drive.nmea"), "w") as log:
            for row in csv.DictReader(table):
                clock = time.strftime("%H%M%S.00", time.gmtime(float(row["stamp"])))
                place = "%s,N,%s,E" % (angle(row["lat_deg"], 2), angle(row["lon_deg"], 3))
                log.write(sentence("GNGGA,%s,%s,1,08,1.0,%.3f,M,0.0,M,," % (clock, place, float(row["alt_m"]))))
                log.write("$GNGGA,%s,%s\r\n" % (clock, place))
                log.write(sentence("GNGST,%s,1.0,,,,1.0,1.0,2.0" % clock))
                log.write(sentence("GNGST,%s,1.0,,,,9.0,9.0,9.0" % clock).replace("9.0", "8.0", 1))
                if with_date:
                    log.write(sentence("GNZDA,%s,01,01,1970,00,00" % clock))  # RMC's year has two digits
        return self.file("drive.nmea")

    def replay(self, *options):
        done = test_tools.run("replay", self.bag, "--json", self.file("out.json"), *options)
        if done.returncode != 0:
            return done.stdout
        with open(self.file("out.json")) as file:
            return json.load(file)

    def test_a_log_is_as_good_as_the_bags_fixes(self):
        of_bag = self.replay()
        of_log = self.replay("--nmea", self.write_log())
        self.assertEqual(of_log["decisions"], of_bag["decisions"])
        # The bag's stamps are a few nanoseconds off, so that a fix comes before or after the odometry of its time.
        self.assertAlmostEqual(of_log["estimates"], of_bag["estimates"], delta=1)
        for key in ("median", "p95", "max"):
            self.assertAlmostEqual(of_log["errors"]["position_m"][key], of_bag["errors"]["position_m"][key], delta=0.2)

    def test_the_day_of_a_log_without_a_date(self):
        of_bag = self.replay()
        log = self.write_log(with_date=False)
        self.assertEqual(self.replay("--nmea", log, "--nmea-date", "1970-01-01")["decisions"], of_bag["decisions"])
        self.assertEqual(self.replay("--nmea", log)["decisions"], of_bag["decisions"])  # the same day, with a warning
        self.assertIn("nothing is of the same time", self.replay("--nmea", log, "--nmea-date", "2020-02-07"))
        self.assertIn("is no date", self.replay("--nmea", log, "--nmea-date", "07.02.2020"))

    def test_a_log_without_a_bag(self):
        done = test_tools.run("replay", "--nmea", self.write_moving_log(), "--odom", "none", "--json",
                              self.file("alone.json"))
        self.assertEqual(done.returncode, 0, done.stdout)
        with open(self.file("alone.json")) as file:
            metrics = json.load(file)
        self.assertEqual(metrics["receiver"]["fixes"], 60)
        self.assertGreater(metrics["estimates"], 30)
        self.assertIn("needs a bag with odometry", test_tools.run("replay", "--nmea", self.file("drive.nmea")).stdout)

    def write_moving_log(self):
        """A minute northwards at 5 m/s."""
        with open(self.file("drive.nmea"), "w") as log:
            for k in range(60):
                clock = time.strftime("%H%M%S.00", time.gmtime(40000 + k))
                place = "%s,N,%s,E" % (angle(45.0 + 5.0 * k / METRES_A_DEGREE, 2), angle(7.0, 3))
                log.write(sentence("GNRMC,%s,A,%s,%.3f,0.0,070220,,,A" % (clock, place, 5.0 * 3600.0 / 1852.0)))
                log.write(sentence("GNGGA,%s,%s,1,08,1.0,300.0,M,0.0,M,," % (clock, place)))
        return self.file("drive.nmea")

    def test_what_is_no_log(self):
        self.assertIn("cannot be read", self.replay("--nmea", self.file("absent.nmea")))
        self.assertIn("no sentence", self.replay("--nmea", self.bag))


def angle(degrees, digits):
    whole, minutes = divmod(60.0 * float(degrees), 60.0)
    return "%0*d%011.8f" % (digits, whole, minutes)


def sentence(body):
    checksum = 0
    for character in body:
        checksum ^= ord(character)
    return "$%s*%02X\r\n" % (body, checksum)


def content(solution):
    """All but the stamps."""
    return {kind: {key: value for key, value in line.items() if key != "stamp"} for kind, line in solution.items()}


def read_table(name):
    with open(os.path.join(DRIVE, name), newline="") as file:
        return list(csv.DictReader(file))


if __name__ == "__main__":
    unittest.main()
