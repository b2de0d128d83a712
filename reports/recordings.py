"""What the reports about recordings share: the folder of recordings, the programs that run them, tables in docs/."""

import concurrent.futures
import json
import os
import subprocess
import sys

import report_common as common
from package_programs import program

NEEDED = ("gnss.csv", "odom.csv", "truth.csv", "meta.json")
LONGEST_LINE = 120  # characters, in docs/


def add_arguments(parser, output_help):
    """The arguments that these reports have in common."""
    parser.add_argument("output", help=output_help)
    parser.add_argument("--data", default=os.environ.get("URBAN_GNSS_DATA"), help="default: $URBAN_GNSS_DATA")
    parser.add_argument("--docs", help="Markdown file whose tables are renewed, e.g. docs/results/recordings.md")
    parser.add_argument("--recordings", nargs="+", default=[], help="default: all with truth")
    parser.add_argument("--set", action="append", default=[], dest="overrides", metavar="NAME=VALUE",
                        help="a parameter for every run; repeatable")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="recordings at once")


def set_arguments(options):
    """The options of replay for the parameters of --set."""
    return [part for text in options.overrides for part in ("--set", text)]


def for_each_recording(options, run):
    """What `run` gives for each recording that was asked for, by its name; several at once, with progress."""
    names = find_recordings(options.data, options.recordings)
    results = {}
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        futures = {name: pool.submit(run, name) for name in names}
        for done, (name, future) in enumerate(futures.items(), 1):
            results[name] = future.result()
            print("{}/{} {}".format(done, len(names), name), file=sys.stderr)
    return results


def call(*command):
    """Run a program and give its output; a failure ends everything with its last line."""
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)
    except OSError as error:
        raise common.ReportError("{}: {}".format(command[0], error.strerror))
    if done.returncode != 0:
        lines = (done.stderr.strip() or done.stdout.strip() or "failed without a word").splitlines()
        raise common.ReportError("{}: {}".format(os.path.basename(command[0]), lines[-1]))
    return done.stdout


def replay(bag, path, localizer, *arguments):
    """What replay says of a run; it stays in the file `path`."""
    call(*program("replay"), bag, "--localizer", localizer, "--json", path, *arguments)
    with open(path, encoding="utf-8") as stream:
        return json.load(stream)


def find_recordings(directory, chosen):
    """Names of the folders that can be evaluated, in alphabetical order."""
    if not directory or not os.path.isdir(directory):
        raise common.ReportError("{}: no folder of recordings (--data or URBAN_GNSS_DATA)".format(directory or "?"))
    found = sorted(name for name in os.listdir(directory)
                   if all(os.path.isfile(os.path.join(directory, name, file)) for file in NEEDED))
    for name in chosen:
        if name not in found:
            raise common.ReportError("{}: no recording {} with {}".format(directory, name, ", ".join(NEEDED)))
    found = [name for name in found if not chosen or name in chosen]
    if not found:
        raise common.ReportError("{}: no recording with {}".format(directory, ", ".join(NEEDED)))
    return found


def make_bag(folder, bag):
    """Convert a recording, unless that has been done since it changed."""
    files = [os.path.join(folder, name) for name in os.listdir(folder)]
    if os.path.exists(bag) and os.path.getmtime(bag) > max(os.path.getmtime(file) for file in files):
        return
    call(*program("csv_to_bag"), folder, bag)


def markdown(header, rows):
    """The table as Markdown: several, each with the first column, where one had lines longer than LONGEST_LINE."""
    tables, begin = [], 1
    while begin < len(header):
        end = begin + 1
        while end < len(header) and is_narrow(part(header, rows, begin, end + 1)):
            end += 1
        tables.append("\n".join(part(header, rows, begin, end)))
        begin = end
    return "\n\n".join(tables)


def part(header, rows, begin, end):
    """The lines of a Markdown table of the first column and those from `begin` up to `end`."""
    head = header[:1] + header[begin:end]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(["`" + row[0] + "`"] + row[begin:end]) + " |" for row in rows]


def is_narrow(lines):
    """Whether no line is longer than the pages of docs/ allow."""
    return max(len(line) for line in lines) <= LONGEST_LINE


def replace_between(text, name, content, path):
    """The text with what stands between the markers of `name` replaced."""
    begin, end = "<!-- {} -->".format(name), "<!-- end of {} -->".format(name)
    if text.count(begin) != 1 or text.count(end) != 1 or text.index(begin) > text.index(end):
        raise common.ReportError("{}: needs the markers {} and {}, each once".format(path, begin, end))
    head, rest = text.split(begin)
    return head + begin + "\n" + content + "\n" + end + rest.split(end)[1]


def write_docs(path, name, content):
    """Renew one table of a Markdown file."""
    try:
        with open(path, encoding="utf-8") as stream:
            text = replace_between(stream.read(), name, content, path)
    except OSError as error:
        raise common.ReportError("{}: {}".format(path, error.strerror))
    common.write_text(path, text)
