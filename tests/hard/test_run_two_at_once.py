"""Programs that write to one place at the same time: one of them does its work, the others are refused in one line with status 2,
before anything is overwritten. Programs that write to places of their own do not disturb each other."""
import contextlib
import fcntl
import os
import shutil
import signal
import subprocess
import sys
import unittest
import unittest.mock

from gravier_runs import PROGRAMS, RunTestCase, each, gravier, merged, namelist, run_case, write
from killed_runs import Going

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import fault_trials  # noqa: E402

CASE = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [10, 8], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
    "time": {"step": 1e-3, "steps": 20},
    "solver": {"tolerance": 1e-2, "method": "nscdd"},
    "decomposition": {"subdomains": 2},
    "output": {"every": 5, "checkpoint_every": 5},
}
#: goes on until it is told to stop
LONG = merged(CASE, {"time": {"steps": 1000000}, "output": {"every": 1000000, "checkpoint_every": 0}})

#: a system whose files know no locks
SHIM = r"""
#include <errno.h>
#include <stdarg.h>
#include <sys/syscall.h>
#include <unistd.h>
int fcntl(int fd, int command, ...) {
  va_list list;
  va_start(list, command);
  long argument = va_arg(list, long);
  va_end(list);
  if (command == 6) { errno = ENOLCK; return -1; }
  return (int)syscall(SYS_fcntl, fd, command, argument);
}
"""


def files(directory):
    """Inode and content of every file by its name; those written aside come and go."""
    found = {}
    for name in sorted(os.listdir(directory)):
        if name.endswith(".part"):
            continue
        with open(os.path.join(directory, name), "rb") as file:
            found[name] = os.stat(file.fileno()).st_ino, file.read()
    return found


class TwoAtOnce(RunTestCase):

    def assert_refused(self, run, pattern=r"another program writes here: "):
        self.assert_status(run, 2)
        self.assertEqual(run.stderr.count("\n"), 1, run.stderr)
        self.assertRegex(run.stderr, r"^gravier\w*: error: \S+: " + pattern)

    def going(self, name, ranks=1, case=LONG):
        run = Going(case, ranks, self.here(name))
        self.addCleanup(run.end)
        self.addCleanup(run.send, signal.SIGKILL)
        run.wait_for_rows(2)
        return run

    def test_places_that_are_taken(self):
        """Each program waits some seconds for its place and takes no processor meanwhile, so that all of them wait at once."""
        checks = (self.second_run, self.ranks_that_outlive_their_launcher, self.lock_that_a_crash_has_left, self.lock_without_a_name,
                  self.other_programs)
        each(lambda check: check(), [(check,) for check in checks], workers=len(checks))

    def second_run(self):
        """Begun anew or as a restart, on one and on two ranks, and under another spelling of the directory."""
        run = self.going("second")
        results = os.path.join(run.directory, "results")
        # it keeps its locks while it is stopped, and takes no processor from those that wait for them
        run.send(signal.SIGSTOP)
        before = files(results)

        def second(ranks, directory, *options):
            name = f"other_{ranks}{len(options)}.nml"
            write(os.path.join(run.directory, name), namelist(merged(CASE, {"output": {"directory": directory}})))
            return gravier(*options, name, ranks=ranks, directory=run.directory)

        # each waits some seconds
        for refused in each(second, [(1, "results"), (2, "./results/../results"), (1, "results", "--restart")], workers=3):
            self.assert_refused(refused, r"another program writes here: gravier case\.nml, process \d+; expected a place")
        self.assertEqual(files(results), before)
        run.send(signal.SIGCONT)
        run.send(signal.SIGTERM)
        status, said = run.end()
        self.assertEqual(status, 4, said)
        self.assertIn("interrupted *** by SIGTERM", said)
        self.assertNotIn(".gravier.lock", os.listdir(results))

    def ranks_that_outlive_their_launcher(self):
        """A rank that is left holds the second byte of the lock: a run waits while it goes, and is refused where it stays."""
        directory = self.here("outlived")
        path = os.path.join(directory, "results", ".gravier.lock")
        os.makedirs(os.path.dirname(path))
        rank = subprocess.Popen([sys.executable, "-c", "import fcntl, sys, time\nfile = open(sys.argv[1], 'w+')\n"
                                 "file.write('elsewhere\\ngravier case.nml, process 77\\n')\nfile.flush()\n"
                                 "fcntl.lockf(file, fcntl.LOCK_SH, 1, 1)\nprint('held', flush=True)\n"
                                 "sys.stdin.readline()\ntime.sleep(1.5)\n", path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.addCleanup(rank.communicate)
        self.assertEqual(rank.stdout.readline(), "held\n")
        self.assert_refused(run_case(CASE, 1, directory))
        self.assertEqual(os.listdir(os.path.dirname(path)), [".gravier.lock"])
        rank.stdin.write("\n")
        rank.stdin.flush()
        self.assert_status(run_case(CASE, 2, directory), 0)

    def lock_that_a_crash_has_left(self):
        """A lock file that nobody holds is no obstacle; one that another machine holds is named with the line that clears it."""
        directory = self.here("it's left")
        path = os.path.join(directory, "results", ".gravier.lock")
        os.makedirs(os.path.dirname(path))
        write(path, "elsewhere\ngravier case.nml, process 77\n")
        self.assert_status(run_case(CASE, 2, directory), 0)
        self.assertFalse(os.path.exists(path))
        write(path, "elsewhere\ngravier case.nml, process 77\n")
        with open(path, "rb+") as file:
            fcntl.lockf(file, fcntl.LOCK_EX)
            refused = run_case(merged(CASE, {"output": {"directory": os.path.dirname(path)}}), 1, directory)
            self.assert_status(refused, 2)
            self.assertIn("gravier case.nml, process 77 on elsewhere; if that one is no more, this clears its lock: rm ", refused.stderr)
            line = refused.stderr.split("clears its lock: ")[1].split("; expected")[0]
            subprocess.run(line, shell=True, check=True)
            self.assert_status(run_case(CASE, 2, directory), 0)

    def lock_without_a_name(self):
        """A lock file that is held and is empty."""
        directory = self.here("nameless")
        path = os.path.join(directory, "results", ".gravier.lock")
        os.makedirs(os.path.dirname(path))
        write(path, "")
        with open(path, "rb+") as file:
            fcntl.lockf(file, fcntl.LOCK_EX)
            self.assertIn("another program writes here, results/.gravier.lock is locked", run_case(CASE, 1, directory).stderr)

    def other_programs(self):
        """Of two samples in one file, of two studies and of two sets of FCLIB problems in one directory one is refused; samples in
        different files are made side by side."""
        directory = self.here("others")
        os.makedirs(directory)
        fault_trials.write_sample(directory, "sample.nml", "grains.h5", 50)
        fault_trials.write_sample(directory, "other.nml", "other.h5", 50)
        problem = fault_trials.write_fclib(directory)
        taken = ((".grains.h5.lock", "gravier_sample", ["sample.nml"]), ("out/.gravier.lock", "gravier_fclib", ["--write", "out", problem]),
                 (".table.csv.lock", "gravier_fclib", ["--csv", "table.csv", problem]),
                 (".profile.csv.lock", "gravier_fclib", ["--profile", "profile.csv", problem]),
                 ("columns/.gravier.lock", "gravier_columns", ["--count", "4", "--subdomains", "2"]),
                 (".error.csv.lock", "gravier_error", [fault_trials.write_error_case(directory)]),
                 ("study/.gravier.lock", "gravier_accuracy", [fault_trials.write_study(directory)]),
                 (".bench.csv.lock", "gravier_bench", ["--csv", "bench.csv"]))
        with contextlib.ExitStack() as held:
            for lock, _, _ in taken:
                path = os.path.join(directory, lock)
                os.makedirs(os.path.dirname(path), exist_ok=True)
                fcntl.lockf(held.enter_context(open(path, "wb+")), fcntl.LOCK_EX)
            before = {folder: names for folder, _, names in os.walk(directory)}
            # each waits some seconds
            runs = each(lambda _, program, arguments: gravier(*arguments, program=program, directory=directory), taken, workers=len(taken))
            for run in runs:
                self.assert_refused(run, "another program writes here, ")
            self.assertEqual({folder: sorted(names) for folder, _, names in os.walk(directory)},
                             {folder: sorted(names) for folder, names in before.items()})
            self.assert_status(gravier("other.nml", program="gravier_sample", directory=directory), 0)

    def test_runs_of_their_own(self):
        """Runs in places of their own that begin and end beside each other, without a launcher: none of them says or loses anything,
        though Open MPI has one directory for all of them."""
        case = namelist(merged(CASE, {"time": {"steps": 40}}))
        environment = {key: value for key, value in os.environ.items() if not key.startswith("OMPI_MCA_")}
        environment["OMPI_MCA_orte_tmpdir_base"] = self.here("session")
        os.makedirs(self.here("session"))

        def run(number):
            directory = self.here(f"own_{number}")
            os.makedirs(directory)
            write(os.path.join(directory, "case.nml"), case)
            return subprocess.run([os.path.join(PROGRAMS, "gravier"), "case.nml"], cwd=directory, env=environment, text=True,
                                  stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)

        for ended in each(run, [(number,) for number in range(72)], workers=12):
            self.assertEqual(ended.stderr, "")
            self.assertEqual(ended.returncode, 0)

    def test_files_of_a_run_alone(self):
        """A run leaves no files but its own, and the next one removes what MPI leaves of a run that is killed. Paths may be as long as MPI
        takes them; longer ones are refused before there is a directory."""
        own = ["checkpoint.h5", "history.csv", "results.h5", "run.log"]
        name = "d" * (200 - len("/checkpoint.h5.part") - len(self.here("")))
        for ranks in (1, 2):
            self.assert_status(run_case(merged(CASE, {"output": {"directory": self.here(name)}}), ranks, self.here("far")), 0)
            self.assertEqual(sorted(os.listdir(self.here(name))), own)
            run = run_case(merged(CASE, {"output": {"directory": self.here(name + "d")}}), ranks, self.here("far"))
            self.assert_status(run, 2)
            self.assertEqual(run.stderr, f"gravier: error: case.nml: &output directory: {self.here(name)}d/checkpoint.h5.part: a path of 201 characters; "
                             "MPI opens files with up to 200: expected a path from a directory that is nearer\n")
            self.assertFalse(os.path.exists(self.here(name + "d")))
        directory = self.here("killed alone")
        os.makedirs(directory)
        write(os.path.join(directory, "long.nml"), namelist(LONG))
        process = subprocess.Popen([os.path.join(PROGRAMS, "gravier"), "long.nml"], cwd=directory, stdout=subprocess.PIPE, text=True)
        for line in process.stdout:
            if line.split()[:1] == ["2"]:
                break
        process.kill()
        process.communicate()
        self.assert_status(run_case(CASE, 1, directory), 0)
        self.assertEqual(sorted(os.listdir(os.path.join(directory, "results"))), own)

    def test_no_locks(self):
        """A lock file that cannot be one is an error; a file system without locks is warned of."""
        directory = self.here("no locks")
        os.makedirs(os.path.join(directory, "results", ".gravier.lock"))
        for ranks in (1, 2):
            run = run_case(CASE, ranks, directory)
            self.assert_status(run, 4)
            self.assertIn("results/.gravier.lock: cannot lock this file: Is a directory", run.stderr)
        os.rmdir(os.path.join(directory, "results", ".gravier.lock"))
        source, library = write(self.here("shim.c"), SHIM), self.here("shim.so")
        subprocess.run([shutil.which("cc") or "gcc", "-shared", "-fPIC", "-o", library, source], check=True)
        with unittest.mock.patch.dict(os.environ, {"LD_PRELOAD": library}):
            run = run_case(CASE, 2, directory)
        self.assert_status(run, 0)
        self.assertIn("warning     the file system of results keeps no locks: a second run there is not refused\n", run.stdout)

    def test_files_that_are_replaced_are_seen(self):
        """Whatever replaces or removes a file of a run, the run does not end as if nothing had happened."""
        for name, change in (("results.h5", "replace"), ("history.csv", "replace"), ("run.log", "remove"), ("results.h5", "remove"),
                             ("step_1.hdf5", "replace")):
            with self.subTest(file=name, change=change):
                run = self.going(f"{change} {name}", 2, merged(LONG, {"output": {"fclib_step": 1}}))
                path = os.path.join(run.directory, "results", name)
                if change == "replace":
                    shutil.copy(path, path + ".copy")
                    os.rename(path + ".copy", path)
                else:
                    os.remove(path)
                run.send(signal.SIGTERM)
                status, said = run.end()
                self.assertEqual(status, 4, said)
                self.assertIn(f"results/{name}: the file that was written under this name is not there any more", said)
                self.assertIn("lost        *** files of this run in results", said)
                self.assertNotIn("interrupted ***", said)
                self.assertNotIn("finished ", said)



if __name__ == "__main__":
    unittest.main()
