#!/usr/bin/env python3
"""Damages the files that the tools read, runs the tools on them, and counts what goes wrong.

usage: damage_campaign.py [--cases 1300] [--seconds S] [--seed 1] [--only KIND] [--keep DIR]

Each case is one whole small input (a bag, a .pcd, a CSV, a scenario, …) with one kind of damage: bits turned over, cut
off, words that are huge, numbers that are none, another file's bytes. The same seed gives the same files. A tool may do
its work all the same, or refuse with a line that names the file. Everything else is a fault: a signal, a hang, a
message without the file's name, a Python traceback, remains beside an output, a number that is not finite in its results, an
input that has changed. Exits with 1 where there was one; --keep has the files of these. With --seconds it ends early.

The workspace must be sourced; URBAN_GNSS_PROGRAMS may be the folder of the built programs.
"""
import argparse
import collections
import concurrent.futures
import hashlib
import json
import math
import os
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time

import campaign
import damage_inputs

LONGEST_S = 40.0
NUMBERS = ("nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "0", "-1", "-0.0", "4294967296", "9223372036854775808",
           "1" * 400, "1e", "0x10", "", " ", "1,5", "\u0661")
WORDS = (0, 1, 0x7f, 0xff, 0xffff, 0x7fffffff, 0x80000000, 0xfffffff0, 0xffffffff, 0x10000000)
NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


# --- damage: functions of random numbers and bytes, which give other bytes

def flip_bits(numbers, data):
    damaged = bytearray(data)
    for _ in range(numbers.choice((1, 1, 2, 8, 64))):
        damaged[numbers.randrange(len(damaged))] ^= 1 << numbers.randrange(8)
    return bytes(damaged)


def cut_off(numbers, data):
    return data[:numbers.choice((0, 1, 13, numbers.randrange(len(data)), numbers.randrange(len(data)), len(data) - 1))]


def cut_out(numbers, data):
    begin = numbers.randrange(len(data))
    return data[:begin] + data[begin + numbers.choice((1, 4, 16, 1000)):]


def repeat(numbers, data):
    begin = numbers.randrange(len(data))
    piece = data[begin:begin + numbers.choice((1, 8, 100, 5000))]
    return data[:begin] + piece * numbers.choice((2, 2, 50)) + data[begin:]


def overwrite(numbers, data):
    begin, size = numbers.randrange(len(data)), numbers.choice((1, 4, 16, 256, 4096))
    filling = numbers.choice((b"\x00", b"\xff", b"\n", b"[", b" ", None))
    middle = bytes(numbers.randrange(256) for _ in range(size)) if filling is None else filling * size
    return data[:begin] + middle[:len(data) - begin] + data[begin + size:]


def huge_word(numbers, data):
    damaged = bytearray(data)
    begin = numbers.randrange(max(1, len(damaged) - 8))
    damaged[begin:begin + 4] = struct.pack("<I", numbers.choice(WORDS))
    return bytes(damaged)


def length_word(numbers, data):
    """A word that is small, as lengths and counts are."""
    places = [k for k in range(0, len(data) - 4) if data[k + 1:k + 4] == b"\x00\x00\x00" and data[k]]
    if not places:
        return huge_word(numbers, data)
    begin = numbers.choice(places)
    return data[:begin] + struct.pack("<I", numbers.choice(WORDS)) + data[begin + 4:]


def odd_number(numbers, data):
    found = list(NUMBER.finditer(data))
    if not found:
        return flip_bits(numbers, data)
    match = numbers.choice(found)
    return data[:match.start()] + numbers.choice(NUMBERS).encode() + data[match.end():]


def odd_line(numbers, data):
    lines = data.split(b"\n")
    k = numbers.randrange(len(lines))
    lines[k:k + 1] = numbers.choice(([], [lines[k], lines[k]], [b""], [b"," * 30], [b"\xef\xbb\xbf" + lines[k]],
                                     [lines[k] + b",1,2"], [b"a" * 100000], [lines[k][:len(lines[k]) // 2]],
                                     [b"- " * 300], [b"{" * 3000], [b"*x"], [b"<<: *x"], [b"\x00" * 20]))
    return b"\n".join(lines)


def other_order(numbers, data):
    """Whole lines, but elsewhere: mostly in the head of the file."""
    lines = data.split(b"\n")
    last = len(lines) if numbers.random() < 0.3 else min(len(lines), 12)
    line = lines.pop(numbers.randrange(last))
    lines.insert(numbers.randrange(min(last, len(lines)) + 1), line)
    return b"\n".join(lines)


def other_spaces(numbers, data):
    """Lines of spaces, other line ends, other spaces between words."""
    lines = data.split(b"\n")
    k = numbers.randrange(len(lines) if numbers.random() < 0.3 else min(len(lines), 12))
    space = numbers.choice((b" ", b"\t", b"\r", b"\v", b"\f", b"\x00", b"\xc2\xa0"))
    if numbers.random() < 0.5:
        lines.insert(k, space * numbers.choice((1, 3)))
    elif space == b"\r":
        lines = [line + b"\r" for line in lines]
    else:
        lines[k] = lines[k].replace(b" ", space)
    return b"\n".join(lines)


def another_file(numbers, data):
    return numbers.choice((b"", b"\n", b"text\n", b"#ROSBAG V2.0\n", b"#ROSBAG V1.2\n", bytes(range(256)) * 8,
                           b"# .PCD v0.7\n", b"\x00" * 5000, b"[" * 20000, b"a: " * 5000, data[::-1]))


ANY = (flip_bits, cut_off, cut_out, repeat, overwrite)
OF_TEXT = ANY + (odd_number, odd_number, odd_number, odd_line, odd_line, other_order, other_spaces, another_file)
OF_BINARY = ANY + (huge_word, length_word, length_word, length_word, another_file)


def damages_of(case):
    """The kinds of damage that suit a file; the head of a binary .pcd is text."""
    if case.name.endswith(".bag"):
        return OF_BINARY
    return OF_TEXT + OF_BINARY if "binary" in case.name else OF_TEXT


# --- one run

def program(name):
    """The command that starts one of the package's programs."""
    if name == "doctor":
        return [sys.executable, "-B", os.path.join(campaign.ROOT, "doctor", "doctor")]
    return campaign.program(name)


def digests(folder):
    """What is in the files of a folder."""
    found = {}
    for name in sorted(os.listdir(folder)):
        with open(os.path.join(folder, name), "rb") as stream:
            found[name] = hashlib.sha1(stream.read()).hexdigest()
    return found


def not_finite(value):
    """Whether JSON has a number that is not finite."""
    if isinstance(value, dict):
        return any(map(not_finite, value.values()))
    if isinstance(value, list):
        return any(map(not_finite, value))
    return isinstance(value, float) and not math.isfinite(value)


def bad_results(folder):
    """What is wrong with the results, or nothing."""
    for place, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(place, name)
            if ".part-" in name:
                return "remains"
            if name.endswith(".json"):
                with open(path, encoding="utf-8") as stream:
                    if not_finite(json.load(stream)):
                        return "not finite"
            if name == "o.tum":
                with open(path, encoding="utf-8") as stream:
                    if re.search(r"nan|inf", stream.read()):
                        return "not finite"
    return None


def judge(case, inputs, results):
    """Run the tool; (verdict, what it said)."""
    command = program(case.command[0]) + [word.replace("{}", inputs).replace("OUT", results)
                                          for word in case.command[1:]]
    before = digests(inputs)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, preexec_fn=campaign.limit_memory,
                               cwd=results)
    try:
        said = process.communicate(timeout=LONGEST_S)[0].decode(errors="replace")
    except subprocess.TimeoutExpired:
        process.kill()
        return "hang", process.communicate()[0].decode(errors="replace")
    if process.returncode < 0:
        return "signal " + signal.Signals(-process.returncode).name, said
    if "Traceback (most recent" in said:
        return "traceback", said
    if digests(inputs) != before:
        return "input changed", said
    trouble = bad_results(results)
    if trouble:
        return trouble, said
    if process.returncode == 0:
        return "worked", said
    return ("refused" if names_the_file(case, inputs, said, process.returncode) else "nameless"), said


def names_the_file(case, inputs, said, code):
    """Whether the refusal tells what it is about."""
    if case.command[0] == "doctor" and code == 1:
        return True  # it says what is wrong with the robot
    lines = [line for line in re.split(r"[\n\r]", said) if line.strip()]
    # A run may also end without an estimate, and says what it waits for.
    return bool(lines) and (case.name in lines[-1] or case.name in said and inputs in said
                            or re.search(r"no estimate: .*\w", lines[-1]) is not None)


def run_case(number, case, sources, seed, keep):
    """Damage, run, judge."""
    numbers = random.Random("%d %d" % (seed, number))
    damage = numbers.choice(damages_of(case))
    with tempfile.TemporaryDirectory(prefix="damage_") as folder:
        inputs, results = os.path.join(folder, "in"), os.path.join(folder, "out")
        shutil.copytree(sources, inputs)
        os.mkdir(results)
        path = os.path.join(inputs, case.name)
        with open(path, "rb") as stream:
            data = stream.read()
        with open(path, "wb") as stream:
            stream.write(damage(numbers, data))
        verdict, said = judge(case, inputs, results)
        if keep and verdict not in ("worked", "refused"):
            kept = os.path.join(keep, "%05d_%s_%s" % (number, re.sub(r"\W+", "_", verdict), case.name))
            os.makedirs(keep, exist_ok=True)
            shutil.copy(path, kept)
            with open(kept + ".txt", "w", encoding="utf-8") as stream:
                stream.write("%s, %s: %s\n%s" % (case.kind, damage.__name__, verdict, said[-3000:]))
    return case, damage.__name__, verdict, said


def run(count, seed, seconds=None, only="", keep=None, jobs=2, report=print):
    """All cases, the kinds in turn; {kind: {verdict: count}} and the faults, one text each."""
    table, faults = {}, []
    end = time.monotonic() + seconds if seconds else None
    with tempfile.TemporaryDirectory(prefix="damage_") as sources:
        cases = [case for case in damage_inputs.write_all(sources) if only in case.kind]
        with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
            def one(number):
                if end and time.monotonic() > end:
                    return None
                return run_case(number, cases[number % len(cases)], sources, seed, keep)
            for number, done in enumerate(pool.map(one, range(count))):
                if done is None:
                    continue
                case, damage, verdict, said = done
                table.setdefault(case.kind, collections.Counter())[verdict] += 1
                if verdict not in ("worked", "refused"):
                    faults.append("case %d (%s, %s): %s\n  %s" % (
                        number, case.kind, damage, verdict, said.strip()[-300:].replace("\n", "\n  ")))
                    report(faults[-1])
    return table, faults


def show(table):
    """The table as lines of text."""
    verdicts = sorted({verdict for counts in table.values() for verdict in counts})
    total = sum(table.values(), collections.Counter())
    rows = [[kind, sum(counts.values())] + [counts[verdict] for verdict in verdicts]
            for kind, counts in list(table.items()) + [("all", total)]]
    return campaign.table_of(["input", "cases"] + verdicts, rows)


def main():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=1300)
    parser.add_argument("--seconds", type=float, help="end after this time")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="kinds of input that have this in their name")
    parser.add_argument("--keep", metavar="DIR", help="keep the files of faults here")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    table, faults = run(options.cases, options.seed, options.seconds, options.only, options.keep, options.jobs)
    print(show(table))
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
