"""Runs of the program: write an input file, run gravier under MPI in a directory of its own, read what it wrote.

The environment names the program (GRAVIER_BIN_DIR) and the launcher (MPIEXEC); by hand, from the source tree:
    GRAVIER_BIN_DIR=build/release/bin PYTHONPATH=tests/support /usr/bin/python3 -m unittest discover -s tests/regression
"""
import concurrent.futures
import contextlib
import glob
import itertools
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

import numpy as np

from forked_scripts import script
from results_contents import Results, contents, steps_of  # noqa: F401

SOURCE = os.environ.get("GRAVIER_SOURCE_DIR", os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..")))
sys.path.insert(0, os.path.join(SOURCE, "drivers/python"))
from gravier import namelist  # noqa: E402
PROGRAMS = os.path.abspath(os.environ.get("GRAVIER_BIN_DIR", os.path.join(SOURCE, "build/release/bin")))
GRAVIER = os.path.join(PROGRAMS, "gravier")
MPIEXEC = os.environ.get("MPIEXEC", "mpiexec")
#: a file system in memory, and the bytes that must be free there for runs to write to it: each state that a run writes waits for the disk
#: twice. TMPDIR names another place
MEMORY, ROOM = "/dev/shm", 2**32
if "TMPDIR" not in os.environ and os.access(MEMORY, os.W_OK) and shutil.disk_usage(MEMORY).free > ROOM:
    tempfile.tempdir = MEMORY
#: whether all variants run, as in `./gravier test long`, where the suite runs a few of them
LONG = os.environ.get("GRAVIER_LONG", "0") == "1"
#: numbers of ranks on which runs have the same bits: on four where there are two cores a run takes ten times what it takes on one
SOME_RANKS = (1, 2, 4) if LONG else (1, 2)
only_long = unittest.skipUnless(LONG, "a part of ./gravier test long")
#: numbers of the runs of this process
RUNS = itertools.count()
#: seconds after which a run that does not end is taken for one that hangs, on whatever machine, with whatever else to do
PATIENCE = 900
ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1", "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMPI_MCA_hwloc_base_binding_policy": "none", "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1",
    # messages within one machine; a search for networks would take longer than most runs
    "OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "vader,self",
    # ranks are not bound to processors, whose caches and distances would take half of the start of a program to find out
    "HWLOC_COMPONENTS": "no_os,stop",
    # nor are displays and accelerators looked for, whose libraries (OpenCL, X11) each start of MPI would load
    "HWLOC_PLUGINS_PATH": "/nowhere",
    # after a rank that failed the launcher would wait seconds for ranks that have left
    "OMPI_MCA_odls_base_sigkill_timeout": "0",
}
#: bytes of a file that a program without a launcher may write: one that goes on for ever must not fill the disk
LONGEST_FILE = 2**28
#: of a program without a launcher: Open MPI starts no daemon and only what one rank needs, in a sixth of the time, and the rank does not
#: give up its processor at each message to itself, which beside other programs takes thirty times as long
ALONE = {"OMPI_MCA_ess_singleton_isolated": "1", "OMPI_MCA_btl": "self", "OMPI_MCA_pml": "ob1", "OMPI_MCA_coll": "basic,libnbc,self",
         "OMPI_MCA_mpi_yield_when_idle": "0"}


def how_often(words):
    """The number of `never`, `once`, `twice` or `N times`, as a log says it."""
    rare = {"never": 0, "once": 1, "twice": 2}
    return rare[words] if words in rare else int(words.removesuffix(" times"))


class Run:
    """What a run left: status of the launcher, text of the ranks and of the launcher, files in `directory`."""

    def __init__(self, directory, status, stdout, stderr, launcher):
        self.directory, self.status, self.stdout, self.stderr, self.launcher = directory, status, stdout, stderr, launcher
        #: file that `results` has read, by name, time of its last change and size; and what is in it
        self._read, self._found = None, None

    def path(self, *names):
        return os.path.join(self.directory, *names)

    def results(self, directory="results"):
        """What is in results.h5, read once as long as the file stays as it is."""
        path = self.path(directory, "results.h5")
        state = os.stat(path)
        if self._read != (path, state.st_mtime_ns, state.st_size):
            self._found = Results(path)
            self._read = path, state.st_mtime_ns, state.st_size
        return self._found

    def history(self, directory="results"):
        return read_csv(self.path(directory, "history.csv"))

    def trace(self, directory="results"):
        return read_csv(self.path(directory, "trace.csv"))

    def __str__(self):
        return "\n".join([f"in {self.directory}: status {self.status}", self.stdout[-3000:], self.stderr[-3000:],
                          self.launcher[-3000:]])


def gravier(*arguments, ranks=1, directory=".", program="gravier"):
    """Run `gravier ARGUMENTS`, or another program, on so many ranks: one runs by itself, several under a launcher, which takes twice as
    long to start them. A run not over after PATIENCE is ended and is an error: one rank waits for another that has left, or a loop does
    not end."""
    command = [os.path.join(PROGRAMS, program), *arguments]
    if ranks > 1:
        return launched(command, ranks, directory)
    with alone_environment() as environment:
        process = subprocess.Popen(command, cwd=directory, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE)
        stdout, stderr = wait_for_end(process, command, ranks)
    # a signal that ended it as a shell counts it
    status = process.returncode if process.returncode >= 0 else 128 - process.returncode
    return Run(directory, status, stdout.decode(errors="replace"), stderr.decode(errors="replace"), "")


def quick_launcher(directory):
    """A launcher, for MPIEXEC, that starts programs on one rank by themselves, in a sixth of the time, as scripts that ask for one rank get it."""
    alone = " ".join(f"{name}={value}" for name, value in {**ALONE, "OMPI_MCA_orte_tmpdir_base": f'"{directory}"'}.items())
    path = write(os.path.join(directory, "launcher"), f"""#!/bin/sh
[ "$1 $2" = "-n 1" ] || exec "{MPIEXEC}" "$@"
shift 2
exec env {alone} "$@"
""")
    os.chmod(path, 0o755)
    return path


def wait_for_end(process, command, ranks):
    """What a run leaves on its two outputs."""
    try:
        return process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        # a launcher ends its ranks when it is told to stop
        process.terminate()
        try:
            process.communicate(timeout=10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
        raise AssertionError(f"{' '.join(command)} on {ranks} ranks did not end in {PATIENCE} s") from None


def launched(command, ranks, directory):
    """A run under the launcher."""
    # the ranks write their standard error and status to files, apart from what the launcher has to say about a failure; each
    # run has its own names, since several may share a directory
    own = f"rank.{os.getpid()}_{next(RUNS)}"
    rank = f'"$0" "$@" 2>{own}.$$.stderr; status=$?; echo $status >{own}.$$.status; exit $status'
    process = subprocess.Popen([MPIEXEC, "-n", str(ranks), "sh", "-c", rank, *command], cwd=directory,
                               env={**ENVIRONMENT, **os.environ}, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE)
    stdout, launcher = wait_for_end(process, command, ranks)
    said = {}
    for name in sorted(glob.glob(os.path.join(glob.escape(directory), own + ".*"))):
        with open(name, "rb") as file:
            said.setdefault(name.rsplit(".", 1)[1], []).append(file.read().decode(errors="replace"))
        os.remove(name)
    status, stderr = process.returncode, "".join(said.get("stderr", []))
    if not 0 <= status <= 4:
        # a rank that crashed, or the launcher itself: Open MPI 4.1 sometimes does when several ranks leave with an error
        status = max((int(text) for text in said.get("status", []) if text), default=status)
    return Run(directory, status, stdout.decode(errors="replace"), stderr, launcher.decode(errors="replace"))


class Said:
    """What a program left that ran by itself: status, or "a hang", and texts."""

    def __init__(self, status, stdout, stderr):
        self.status, self.stdout, self.stderr = status, stdout, stderr


@contextlib.contextmanager
def alone_environment():
    """The environment of a program that runs without a launcher."""
    # programs that run at once each have a session directory of their own: all of them would be number 0 of job 0 there
    session = tempfile.mkdtemp(prefix="gravier-alone-")
    try:
        yield {**ENVIRONMENT, **os.environ, **ALONE, "OMPI_MCA_orte_tmpdir_base": session}
    finally:
        shutil.rmtree(session, ignore_errors=True)


def alone(command, directory, seconds=20):
    """Run a program by itself, on one rank and without a launcher, for so many seconds of processor time: of wall time it may take ten
    times as much, since a machine may be busy with other things. Signals that end it are in its status, with a minus."""
    with alone_environment() as environment:
        return _ended(command, directory, environment, seconds)


def _ended(command, directory, environment, seconds):
    with subprocess.Popen(command, cwd=directory, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE) as process:
        resource.prlimit(process.pid, resource.RLIMIT_CPU, (seconds, seconds))
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (LONGEST_FILE, LONGEST_FILE))
        try:
            texts = process.communicate(timeout=10 * seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            return Said("a hang", "", "")
    if process.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return Said("a hang", "", "")
    return Said(process.returncode, *(text.decode(errors="replace") for text in texts))


def merged(*parts):
    """Input groups, later ones changing keys of earlier ones; a key of value None is left out. A list of groups takes the
    place of an earlier one."""
    groups = {}
    for part in parts:
        for group, keys in part.items():
            if isinstance(keys, list):
                groups[group] = keys
            else:
                groups.setdefault(group, {}).update(keys)
    return {group: keys if isinstance(keys, list) else {key: value for key, value in keys.items() if value is not None}
            for group, keys in groups.items()}


def run_case(groups, ranks=1, directory=".", options=()):
    """Write `groups` to case.nml in `directory` (made if need be) and run it there."""
    os.makedirs(directory, exist_ok=True)
    write(os.path.join(directory, "case.nml"), namelist(groups))
    return gravier(*options, "case.nml", ranks=ranks, directory=directory)


def write(path, text):
    with open(path, "wb") as file:
        file.write(text if isinstance(text, bytes) else text.encode())
    return path


def read_cells(path):
    """A table as {column: array of texts}; every line must be whole."""
    with open(path, encoding="ascii") as file:
        text = file.read()
    if not text.endswith("\n"):
        raise AssertionError(f"{path}: the last line is not whole")
    header, *rows = text.splitlines()
    names = header.split(",")
    cells = [row.split(",") for row in rows]
    if any(len(row) != len(names) for row in cells):
        raise AssertionError(f"{path}: a row has not as many cells as the header")
    return {name: np.array([row[k] for row in cells], dtype=str) for k, name in enumerate(names)}


def read_csv(path):
    """A table as {column: array of numbers}; every line must be whole."""
    return {name: cells.astype(float) for name, cells in read_cells(path).items()}


def differences(first, second):
    """Names of what differs between two dictionaries of arrays, in presence, type, shape or any bit. What restarts have run does not count, since two ways to
    the same states have different ones."""
    def key(value):
        value = np.asarray(value)
        return value.dtype.str, value.shape, value.tobytes() if value.dtype.kind != "O" else value.tolist()
    return sorted(name for name in set(first) | set(second) if "/run/restarts/" not in name
                  if name not in first or name not in second or key(first[name]) != key(second[name]))


def each(function, arguments, workers=2):
    """Results of function(*a) for each a of a list, some side by side."""
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        return list(pool.map(lambda a: function(*a), arguments))


class RunTestCase(unittest.TestCase):
    """A test class with one scratch directory, and checks of how a run ended."""

    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.mkdtemp(prefix="gravier-")
        cls.addClassCleanup(shutil.rmtree, cls.scratch, ignore_errors=True)

    def here(self, *names):
        return os.path.join(self.scratch, *names)

    def assert_status(self, run, status):
        self.assertEqual(run.status, status, str(run))

    def assert_finite(self, arrays):
        for name, value in arrays.items():
            if np.asarray(value).dtype.kind == "f":
                self.assertTrue(np.all(np.isfinite(value)), f"{name} has NaN or infinity")


class StudyTestCase(RunTestCase):
    """Runs of a study, a script in drivers/studies."""

    #: path of the script
    study = ""

    def run_study(self, *arguments):
        environment = {**ENVIRONMENT, **os.environ, "GRAVIER_BIN_DIR": PROGRAMS, "MPIEXEC": MPIEXEC}
        return script(self.study, *arguments, directory=self.scratch, environment=environment)
