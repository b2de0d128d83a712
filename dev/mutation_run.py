#!/usr/bin/env python3
"""Switches off, one after the other, what each line of docs/requirements.md promises, and sees a test fail.

    dev/mutation_run.py                    # all of dev/mutations.yaml, some minutes each dozen
    dev/mutation_run.py --only F7 F12      # these lines
    dev/mutation_run.py --write            # and the results into docs/requirements.md

Works on a copy of the tree in .workspace/mutations, with a build of its own; the first build takes as long as that of
scripts/setup.sh. Each test must pass before anything is changed. Exit code 1 where a mutation survives, does not
build, or its test fails without it.
"""
import argparse
import filecmp
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import yaml

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
MUTATIONS = "dev/mutations.yaml"
PAGE = "docs/requirements.md"
BEGIN = "<!-- written by dev/mutation_run.py --write -->"
PACKAGE = "urban_gnss_localization"
TEST_KINDS = ("gtest", "python", "rostest")
KEPT = ("HOME", "TERM", "LANG", "URBAN_GNSS_DATA")
GRACE_S = 30.0  # for an end after SIGINT
KILLED, SURVIVED, NO_BUILD, BROKEN = "killed", "SURVIVED", "did not build", "fails without it"


class Mutation:
    """One entry of mutations.yaml: a text of a file, what stands in its place, and the test that must then fail."""

    def __init__(self, line, entry):
        unknown = set(entry) - {"what", "file", "text", "mutant", "build"} - set(TEST_KINDS)
        kinds = [kind for kind in TEST_KINDS if kind in entry]
        if unknown or len(kinds) != 1:
            raise ValueError("{}: unknown keys {}, tests {}".format(line, sorted(unknown), kinds))
        self.line, self.kind, self.test = line, kinds[0], entry[kinds[0]]
        self.what, self.file, self.text, self.mutant = (entry[key] for key in ("what", "file", "text", "mutant"))
        self.build = entry.get("build", "all" if self.kind == "rostest" else "").split()

    def targets(self):
        """What make has to build."""
        return [self.test.split()[0] + "_tests"] if self.kind == "gtest" else self.build


def read_mutations(root):
    """All of mutations.yaml, in its order."""
    with open(os.path.join(root, MUTATIONS), encoding="utf-8") as file:
        return [Mutation(line, entry) for line, entries in yaml.safe_load(file).items() for entry in entries]


def files_of(root):
    """What belongs to the tree: all but what was built or computed."""
    names = set()
    for folder, folders, files in os.walk(root):
        folders[:] = [each for each in folders if each not in (".git", ".workspace", "__pycache__")]
        if folder == root and "results" in folders:
            folders.remove("results")
        names.update(os.path.relpath(os.path.join(folder, file), root) for file in files)
    return names


def copy_tree(root, copy):
    """Makes the copy what the tree is; leaves what is the same, so that it is not built again."""
    names = files_of(root)
    for name in names:
        source, target = os.path.join(root, name), os.path.join(copy, name)
        if os.path.isfile(target) and filecmp.cmp(source, target, shallow=False):
            continue
        os.makedirs(os.path.dirname(target), exist_ok=True)
        shutil.copy(source, target)
    for name in files_of(copy) - names:
        os.remove(os.path.join(copy, name))


class Copy:
    """The copy with its build."""

    def __init__(self, folder, jobs, timeout_s):
        self.folder, self.jobs, self.timeout_s = folder, jobs, timeout_s
        self.build_folder = os.path.join(folder, ".workspace", "build")
        self.devel = os.path.join(folder, ".workspace", "devel")
        self.environment = {name: os.environ[name] for name in os.environ
                            if name in KEPT or name.startswith("CCACHE")}
        self.environment.update(PATH="/usr/bin:/bin:/usr/sbin:/sbin", PYTHONDONTWRITEBYTECODE="1",
                                ROS_HOME=os.path.join(folder, ".workspace", "ros"),
                                URBAN_GNSS_PROGRAMS=os.path.join(self.devel, "lib", PACKAGE),
                                URBAN_GNSS_TEST_PROGRAMS=os.path.join(self.build_folder, "test_programs"))

    def run(self, command, where="."):
        """Exit code and output; None as code where it did not end in time."""
        shell = ["bash", "-c", '. scripts/environment.sh; cd "$1"; shift; exec "$@"', "bash", where] + command
        with tempfile.TemporaryFile("w+", errors="replace") as output:  # no pipe: nodes that are left would keep it open
            process = subprocess.Popen(shell, cwd=self.folder, env=self.environment, stdout=output,
                                       stderr=subprocess.STDOUT, start_new_session=True)
            code = self.wait(process)
            output.seek(0)
            return code, output.read()

    def wait(self, process):
        """Its exit code; None where it was ended, because it took too long."""
        try:
            return process.wait(self.timeout_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGINT)  # rostest ends its nodes
        try:
            process.wait(GRACE_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        return None

    def configure(self):
        """Once."""
        if os.path.exists(os.path.join(self.build_folder, "Makefile")):
            return
        code, output = self.run(["cmake", "-S", ".", "-B", self.build_folder, "-DCATKIN_DEVEL_PREFIX=" + self.devel,
                                 "-DCATKIN_ENABLE_TESTING=ON", "-DCMAKE_LINK_DEPENDS_NO_SHARED=ON"])
        if code != 0:
            sys.exit(output)

    def make(self, targets):
        """Whether they were built; and the compiler's output."""
        if not targets:
            return True, ""
        while True:  # the first build may take longer than a test may
            code, output = self.run(["make", "-C", self.build_folder, "-j" + str(self.jobs)] + targets)
            if code is not None:
                return code == 0, output

    def test(self, mutation):
        """Whether the test passed, and its output. A test that is skipped or not there does not pass."""
        if mutation.kind == "gtest":
            room, name = mutation.test.split()
            program = os.path.join(self.devel, "lib", PACKAGE, room + "_tests")
            code, output = self.run([program, "--gtest_filter=" + name])
            return code == 0 and re.search(r"\[  PASSED  \] [1-9]", output) and "SKIPPED" not in output, output
        if mutation.kind == "python":
            code, output = self.run(["/usr/bin/python3", "-B", "-m", "unittest", mutation.test], "test/python")
            return code == 0 and "skipped" not in output, output
        code, output = self.run(["rostest", os.path.join("test/ros", mutation.test)])
        return code == 0, output


class Change:
    """A mutation in the copy, for as long as it lasts."""

    def __init__(self, copy, mutation):
        self.path = os.path.join(copy.folder, mutation.file)
        with open(self.path, encoding="utf-8") as file:
            self.original = file.read()
        if self.original.count(mutation.text) != 1:
            sys.exit("{}: {}: the text stands {} times: {}".format(
                mutation.line, mutation.file, self.original.count(mutation.text), mutation.text))
        self.changed = self.original.replace(mutation.text, mutation.mutant)

    def write(self, text):
        with open(self.path, "w", encoding="utf-8") as file:
            file.write(text)

    def __enter__(self):
        self.write(self.changed)

    def __exit__(self, *_):
        self.write(self.original)


def judge(copy, mutation, passed_before, logs):
    """One of the four results. `passed_before`: the tests that were seen to pass, which it adds to."""
    log = open(os.path.join(logs, "{}_{}.log".format(mutation.line, os.path.basename(mutation.file))), "a")
    with log:
        if (mutation.kind, mutation.test) not in passed_before:
            is_built, output = copy.make(mutation.targets())
            log.write(output)
            if is_built:
                is_built, output = copy.test(mutation)
                log.write(output)
            if not is_built:
                return BROKEN
            passed_before.add((mutation.kind, mutation.test))
        with Change(copy, mutation):
            log.write("==== {} ====\n".format(mutation.mutant))
            is_built, output = copy.make(mutation.targets())
            log.write(output)
            if not is_built:
                return NO_BUILD
            passed, output = copy.test(mutation)
            log.write(output)
            return SURVIVED if passed else KILLED


def row(mutation, result):
    """Of the table, as in docs/requirements.md."""
    return "| {} | {} | `{}` | {} |".format(mutation.line, mutation.what, mutation.test, result)


HEADER = "| | switched off | test that must fail | |\n|---|---|---|---|"


def write_results(root, mutations, results):
    """Puts the table at the end of the page. A mutation without a result keeps the row that it has there."""
    path = os.path.join(root, PAGE)
    with open(path, encoding="utf-8") as file:
        text, _, before = file.read().partition(BEGIN)
    rows = []
    for mutation in mutations:
        result = results.get(mutation)
        known = [line for line in before.splitlines() if line.startswith(row(mutation, "").rstrip(" |"))]
        rows += [row(mutation, result)] if result else known[:1]
    with open(path, "w", encoding="utf-8") as file:
        file.write(text + "\n".join([BEGIN, "", HEADER] + rows) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="F7", help="lines of the requirements; default: all")
    parser.add_argument("--write", action="store_true", help="write the results into " + PAGE)
    parser.add_argument("--jobs", type=int, default=2, help="of make (default: 2)")
    parser.add_argument("--timeout", type=float, default=600.0, help="s, of a test (default: 600)")
    arguments = parser.parse_args()
    mutations = read_mutations(ROOT)
    lines = {each.line for each in mutations}
    for line in arguments.only or []:
        if line not in lines:
            parser.error("no mutation of " + line)
    folder = os.path.join(ROOT, ".workspace", "mutations")
    logs = os.path.join(folder, ".workspace", "logs")
    shutil.rmtree(logs, ignore_errors=True)
    os.makedirs(logs)
    copy_tree(ROOT, folder)
    copy = Copy(folder, arguments.jobs, arguments.timeout)
    copy.configure()
    print(HEADER, flush=True)
    passed_before, results = set(), {}
    for mutation in mutations:
        if arguments.only and mutation.line not in arguments.only:
            continue
        since = time.time()
        results[mutation] = judge(copy, mutation, passed_before, logs)
        print("{} {:.0f} s".format(row(mutation, results[mutation]), time.time() - since), flush=True)
        if arguments.write:
            write_results(ROOT, mutations, results)
    killed = list(results.values()).count(KILLED)
    print("\n{} of {} mutations killed; logs in {}".format(killed, len(results), os.path.relpath(logs)))
    return 0 if killed == len(results) else 1


if __name__ == "__main__":
    sys.exit(main())
