"""Findings as lines for people, and as JSON."""

import json

from .checks import count
from .finding import FAIL, PASS, family
from .recording import KINDS

COLOURS = {"PASS": "\033[32m", "WARN": "\033[33m", "FAIL": "\033[31m"}
FAMILIES = {"topics": "Topics", "stamps": "Stamps", "clocks": "Clocks", "frames": "Frames", "imu": "IMU",
            "odometry": "Odometry", "velocity": "Velocity of the receiver", "fix": "Fixes", "covariance": "Covariance",
            "antenna": "Antenna", "satellites": "Satellites"}
# What a recording cannot do without, though it may be elsewhere.
MISSING = {"topics.odometry": "no odometry", "topics.fix": "no fixes"}


def lines_of(recording, findings, coloured=False, quiet=False):
    """The report, a line an entry."""
    lines = ["doctor: {}, {:.0f} s".format(recording.name, recording.duration())]
    for kind in KINDS:
        if kind in recording.choices:
            lines.append("  {:<11} {} ({})".format(kind + ":", *recording.choices[kind]))
    for name in ordered_families(findings):
        shown = [finding for finding in findings if family(finding) == name and not (quiet and finding.level == PASS)]
        if shown:
            lines.append(FAMILIES.get(name, name))
        for finding in shown:
            level = COLOURS[finding.level] + finding.level + "\033[0m" if coloured else finding.level
            lines.append("  {}  {}: {}".format(level, finding.check, finding.text))
            lines += ["          -> " + change for change in finding.change]
    lines.append(summary(findings))
    return lines


def ordered_families(findings):
    """Families that occur, in the usual order, then others."""
    found = {family(finding) for finding in findings}
    return [name for name in FAMILIES if name in found] + sorted(found - set(FAMILIES))


def summary(findings):
    """The last line."""
    numbers = count(findings)
    text = "{} FAIL, {} WARN, {} PASS".format(numbers["FAIL"], numbers["WARN"], numbers["PASS"])
    failed = [finding.check for finding in findings if finding.level == FAIL]
    missing = [MISSING[finding.check] for finding in findings if finding.check in MISSING and
               finding.level != FAIL and finding.values.get("is_missing")]
    return ("summary: " + text + (": " + ", ".join(dict.fromkeys(failed)) if failed else "") +
            ("; " + " and ".join(missing) + " in it" if missing else ""))


def plain(value):
    """A value that JSON has."""
    if isinstance(value, dict):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [plain(each) for each in value]
    if isinstance(value, bool) or value is None or isinstance(value, (int, str)):
        return value
    value = float(value)
    return value if value - value == 0.0 else None  # neither NaN nor infinite


def as_json(recording, findings, exit_code):
    """The report for programs."""
    return json.dumps(plain({
        "recording": recording.name,
        "duration_s": recording.duration(),
        "topics": [dict(name=each.name, type=each.type, count=each.count) for each in recording.topics],
        "chosen": {kind: dict(topic=topic, how=how) for kind, (topic, how) in recording.choices.items()},
        "findings": [dict(check=each.check, level=each.level, text=each.text, change=list(each.change),
                          values=each.values)
                     for each in findings],
        "summary": count(findings),
        "exit_code": exit_code}), indent=2, ensure_ascii=False, sort_keys=False) + "\n"
