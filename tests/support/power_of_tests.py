#!/usr/bin/python3
"""Measure the power of the tests: make small changes of the sources one by one, and see whether the tests that belong to them fail.

    python3 tests/support/power_of_tests.py [--only PATTERN] [--list] [--build DIR] [--jobs N] [--csv FILE]

The changes are those of changes.txt beside this file, whose head says how they are written. The tracked files are copied to a
scratch directory and built there, optimised and without warnings as errors; the tree itself is not touched. With --build DIR the
copy and its build are kept in DIR, and the next call builds only what differs; without it they are removed at the end.

The tests must pass without any change first. Then each change is made, what its tests need is built, they run, and the change is
undone. A test that fails finds the change, and so does one that needs more processor time than a generous multiple of what it took
before: it hangs. A change that does not compile, or whose old text is not exactly once in its file, is an error of the list.

Each change prints one line: found, MISSED or ERROR. The last line is the score. The exit status is 0 where at least 95 % of the
changes that were tried are found and the list has no error, 1 where fewer are found, and 2 where the list has an error or the tests fail without a
change. --only takes a regular expression that is looked for in names, files and tests; --list prints and checks the changes, and
builds nothing; --csv writes a table of the results.
"""
import argparse
import csv
import dataclasses
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
LIST = os.path.join(HERE, "changes.txt")
#: folders whose files may be changed
SOURCES = ("modules", "src", "drivers")
#: share of the changes that have to be found
GOAL = 0.95
#: a test hangs where a process of it takes so many seconds of a processor, and so many times what all of them took without the change
LEAST_LIMIT, TIMES = 20, 10


@dataclasses.dataclass
class Change:
    """An entry of the list."""
    name: str
    #: base name of the file, and the names of the tests as a regular expression
    file: str = ""
    tests: str = ""
    old: str = ""
    new: str = ""
    #: why no test finds it, where none does
    why: str = ""
    #: path in the tree
    path: str = ""


class ListError(Exception):
    """An entry of the list does not fit the sources: one line."""


def read_changes(path):
    """All entries of the list."""
    changes = []
    with open(path, encoding="utf-8") as lines:
        for number, line in enumerate(lines, 1):
            line = line.rstrip("\n")
            if not line.strip() or line.startswith("#"):
                continue
            if line.startswith("["):
                changes.append(Change(line.strip("[]")))
                continue
            if not changes:
                raise ListError(f"{path}:{number}: expected [name]")
            change = changes[-1]
            if line.startswith(("- ", "+ ")) or line == "+":
                side = "old" if line[0] == "-" else "new"
                before = getattr(change, side)
                setattr(change, side, (before + "\n" if before else "") + line[2:])
            elif line.split(":")[0] in ("file", "tests", "why"):
                key, value = line.split(":", 1)
                setattr(change, key, value.strip())
            else:
                raise ListError(f"{path}:{number}: expected file:, tests:, why:, - or +")
    return changes


def tracked_files():
    """Paths of the tree, relative to its root."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, stdout=subprocess.PIPE, check=True).stdout.decode()
    return [name for name in names.split("\0") if name and os.path.isfile(os.path.join(ROOT, name))]


def find_fault(change, places):
    """What is wrong with an entry, or nothing; its path is set."""
    if not (change.file and change.tests and change.old):
        return "file:, tests: and - are needed"
    if re.search(r"\s", change.tests):
        return "no test has a blank in its name: | stands between two"
    paths = places.get(change.file, [])
    if len(paths) != 1:
        return f"{len(paths)} files are called {change.file}"
    change.path = paths[0]
    with open(os.path.join(ROOT, change.path), encoding="utf-8") as source:
        count = source.read().count(change.old)
    if count != 1:
        return f"the old text is {count} times in {change.path}"
    if change.new == change.old:
        return "nothing changes"
    return ""


def check_list(changes, files):
    """Faults of all entries by name; paths are set."""
    places = {}
    for path in files:
        if path.split("/")[0] in SOURCES:
            places.setdefault(os.path.basename(path), []).append(path)
    faults = {}
    for change in changes:
        fault = find_fault(change, places)
        if sum(other.name == change.name for other in changes) > 1:
            fault = "two changes have this name"
        if fault:
            faults[change.name] = fault
    return faults


def copy_tree(files, target):
    """Bring a copy of the tracked files up to date; what is the same keeps its time, and what is gone is removed."""
    for name in files:
        there = os.path.join(target, name)
        with open(os.path.join(ROOT, name), "rb") as source:
            content = source.read()
        if os.path.isfile(there):
            with open(there, "rb") as old:
                if old.read() == content:
                    continue
        os.makedirs(os.path.dirname(there), exist_ok=True)
        shutil.copyfile(os.path.join(ROOT, name), there)
        shutil.copymode(os.path.join(ROOT, name), there)
    known = set(files)
    for folder, _, names in os.walk(target):
        for name in names:
            path = os.path.join(folder, name)
            if os.path.relpath(path, target) not in known:
                os.remove(path)


def processor_time():
    """Seconds of a processor that all programs called so far have taken."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class Workshop:
    """The copy of the tree, its build and its tests."""

    def __init__(self, directory, jobs):
        self.source = os.path.join(directory, "source")
        self.build = os.path.join(directory, "build")
        self.jobs = str(jobs)
        #: targets by name of the test
        self.targets = {}
        #: seconds of a processor that each test takes
        self.usual = {}

    def configure(self):
        """Configure the build, and list its tests; those of `./gravier test long` are not among them."""
        self.call(["cmake", "-G", "Ninja", "-S", self.source, "-B", self.build, "-DCMAKE_BUILD_TYPE=Release", "-DGRAVIER_TESTS=ON",
                   "-DGRAVIER_WERROR=OFF"])
        listed = subprocess.run(["ctest", "--show-only=json-v1"], cwd=self.build, stdout=subprocess.PIPE, check=True).stdout
        programs = os.path.join(self.build, "tests", "bin", "")
        for test in json.loads(listed)["tests"]:
            if any(p["name"] == "LABELS" and "long" in p["value"] for p in test.get("properties", [])):
                continue
            named = [os.path.basename(word) for word in re.split(r"[|;\s]", " ".join(test.get("command", []))) if word.startswith(programs)]
            if "command" not in test:
                # ctest lists no command of a program that is not built yet and runs without a launcher
                named = ["test_" + re.sub(r"_np\d$", "", test["name"])]
            # scripts run the programs of users
            self.targets[test["name"]] = named or ["src/all", "drivers/all"]

    def call(self, command):
        """Run a tool that must not fail."""
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        if done.returncode != 0:
            raise ListError(f"{' '.join(command[:2])} failed: {done.stdout.decode(errors='replace')[-2000:]}")

    def chosen(self, pattern):
        """Names of the tests of a pattern."""
        return [name for name in self.targets if re.search(pattern, name)]

    def make(self, tests):
        """Build what tests need: whether it compiles, and the last words of the compiler."""
        targets = sorted({target for test in tests for target in self.targets[test]})
        done = subprocess.run(["ninja", "-C", self.build, "-j", self.jobs] + targets, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              check=False)
        errors = [line for line in done.stdout.decode(errors="replace").splitlines() if "rror:" in line]
        return done.returncode == 0, (errors or ["no message"])[0]

    def passes(self, tests):
        """Whether all of these tests pass; with a limit of processor time where it is known what they take."""
        known = [self.usual[test] for test in tests if test in self.usual]
        limit = int(max([LEAST_LIMIT] + [TIMES*seconds for seconds in known])) if known else resource.RLIM_INFINITY

        def restrict():
            # each process of a test by itself; what waits for a message takes time too
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))

        command = ["ctest", "-j", self.jobs, "--stop-on-failure", "--no-tests=error", "-R", f"^({'|'.join(tests)})$"]
        return subprocess.run(command, cwd=self.build, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False,
                              preexec_fn=restrict).returncode == 0

    def run_unchanged(self, tests):
        """Run each test without a change, and keep what it takes: names of those that fail."""
        failed = []
        for test in tests:
            start = processor_time()
            if not self.passes([test]):
                failed.append(test)
            self.usual[test] = processor_time() - start
        return failed

    def try_change(self, change):
        """Make a change, run its tests, undo it: 'found', 'MISSED' or 'ERROR' and a remark."""
        path = os.path.join(self.source, change.path)
        with open(path, encoding="utf-8") as source:
            whole = source.read()
        tests = self.chosen(change.tests)
        try:
            with open(path, "w", encoding="utf-8") as source:
                source.write(whole.replace(change.old, change.new))
            compiles, words = self.make(tests)
            if not compiles:
                return "ERROR", f"it does not compile: {words}"
            return ("MISSED", change.why) if self.passes(tests) else ("found", "")
        finally:
            with open(path, "w", encoding="utf-8") as source:
                source.write(whole)


def try_all(changes, directory, arguments, table):
    """Try all changes: numbers of results by word."""
    workshop = Workshop(directory, arguments.jobs)
    copy_tree(tracked_files(), workshop.source)
    workshop.configure()
    for change in changes:
        if not workshop.chosen(change.tests):
            raise ListError(f"{change.name}: no test has a name like {change.tests}")
    needed = sorted({test for change in changes for test in workshop.chosen(change.tests)})
    print(f"{len(changes)} changes, {len(needed)} tests: building and running them without a change", flush=True)
    compiles, words = workshop.make(needed)
    if not compiles:
        raise ListError(f"the tree does not compile: {words}")
    failed = workshop.run_unchanged(needed)
    if failed:
        raise ListError(f"these tests fail without a change: {' '.join(failed)}")
    numbers = {"found": 0, "MISSED": 0, "ERROR": 0}
    for change in changes:
        start = time.monotonic()
        result, remark = workshop.try_change(change)
        seconds = time.monotonic() - start
        numbers[result] += 1
        print(f"{result:7}{seconds:6.0f} s  {change.file}: {change.name}  ({change.tests})" + (f": {remark}" if remark else ""), flush=True)
        if table:
            table.writerow([change.name, change.file, change.tests, result.lower(), f"{seconds:.1f}", remark])
    return numbers


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description="Measure the power of the tests by small changes of the sources.")
    parser.add_argument("--only", default="", metavar="PATTERN", help="changes with this in the name, the file or the tests")
    parser.add_argument("--list", action="store_true", help="print and check the changes, build nothing")
    parser.add_argument("--build", metavar="DIR", help="keep the copy and its build here, and use them again")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes that build and test (default: 1)")
    parser.add_argument("--csv", metavar="FILE", help="write a table of the results")
    arguments = parser.parse_args()
    try:
        changes = read_changes(LIST)
        faults = check_list(changes, tracked_files())
        changes = [c for c in changes if any(re.search(arguments.only, text) for text in (c.name, c.file, c.tests))]
        if arguments.list:
            for change in changes:
                print(f"{change.file}: {change.name}  ({change.tests})")
            print(f"{len(changes)} changes of {len({c.path for c in changes})} files")
        for name, fault in faults.items():
            print(f"ERROR  {name}: {fault}")
        if faults or arguments.list:
            return 2 if faults else 0
        if not changes:
            raise ListError(f"no change has {arguments.only} in it")
        directory = os.path.abspath(arguments.build) if arguments.build else tempfile.mkdtemp(prefix="power_of_tests")
        stream = open(arguments.csv, "w", encoding="utf-8", newline="") if arguments.csv else None
        try:
            table = csv.writer(stream) if stream else None
            if table:
                table.writerow(["change", "file", "tests", "result", "seconds", "remark"])
            numbers = try_all(changes, directory, arguments, table)
        finally:
            if stream:
                stream.close()
            if not arguments.build:
                shutil.rmtree(directory, ignore_errors=True)
    except ListError as reason:
        print(f"ERROR  {reason}")
        return 2
    tried = numbers["found"] + numbers["MISSED"]
    print(f"found {numbers['found']} of {tried} changes, {100*numbers['found']/max(1, tried):.1f} %; {numbers['ERROR']} errors of the list")
    if numbers["ERROR"]:
        return 2
    return 0 if numbers["found"] >= GOAL*tried else 1


if __name__ == "__main__":
    sys.exit(main())
