"""Runs that are killed: by signals from outside, or just before a write to a file, with a shim between the program and the system that
is compiled here."""
import os
import shutil
import signal
import subprocess
import time

from gravier_runs import ENVIRONMENT, GRAVIER, MPIEXEC, PATIENCE, namelist, write

# a process that dies just before its n-th write to a file whose path holds a text
SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>
static void count(int fd) {
  static long n = 0;
  char link[64], path[4096];
  snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  ssize_t length = readlink(link, path, sizeof path - 1);
  if (length < 0) return;
  path[length] = 0;
  if (strstr(path, getenv("DIES_ON")) && ++n == atol(getenv("DIES_AT"))) kill(getpid(), SIGKILL);
}
#define WRITES_AT(name) ssize_t name(int fd, const void *buffer, size_t n, off_t at) { \
  static ssize_t (*next)(int, const void *, size_t, off_t); \
  if (!next) next = (ssize_t (*)(int, const void *, size_t, off_t))dlsym(RTLD_NEXT, #name); \
  count(fd); return next(fd, buffer, n, at); }
WRITES_AT(pwrite)
WRITES_AT(pwrite64)
"""


class Going:
    """A run that goes on while it is looked at; its ranks are this process's grandchildren, each known by its id."""

    def __init__(self, groups, ranks, directory, options=(), shim=None):
        os.makedirs(directory, exist_ok=True)
        write(os.path.join(directory, "case.nml"), namelist(groups))
        self.directory, self.ranks = directory, ranks
        for name in os.listdir(directory):
            if name.startswith("pid."):
                os.remove(os.path.join(directory, name))
        script = 'echo $$ >pid.$$.part; mv pid.$$.part pid.$$; '
        if shim:
            library, rank, count, *name = shim
            script += f'if [ "${{OMPI_COMM_WORLD_RANK:-$PMI_RANK}}" = {rank} ]; then export LD_PRELOAD={library} DIES_AT={count} '\
                      f'DIES_ON={(name or ["results.h5"])[0]}; fi; '
        # what ranks that are killed leave of their shared memory goes with the directory
        environment = {**ENVIRONMENT, "OMPI_MCA_btl_vader_backing_directory": os.path.abspath(directory), **os.environ}
        self.process = subprocess.Popen([MPIEXEC, "-n", str(ranks), "sh", "-c", script + 'exec "$0" "$@"', GRAVIER, *options,
                                         "case.nml"], cwd=directory, env=environment, stdin=subprocess.DEVNULL,
                                        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def wait_for(self, condition, what, timeout=PATIENCE, pause=0.002):
        end = time.monotonic() + timeout
        while not condition():
            if self.process.poll() is not None or time.monotonic() > end:
                self.process.terminate()
                raise AssertionError(f"{self.directory}: {what} did not come: {self.process.communicate()[0]}")
            time.sleep(pause)

    def pids(self):
        names = [name for name in os.listdir(self.directory) if name.startswith("pid.") and name.count(".") == 1]
        return [int(name[4:]) for name in names]

    def rows(self):
        try:
            with open(os.path.join(self.directory, "results", "history.csv"), encoding="ascii") as file:
                return file.read().count("\n") - 1
        except FileNotFoundError:
            return -1

    def wait_for_rows(self, n):
        self.wait_for(lambda: len(self.pids()) == self.ranks and self.rows() >= n, f"step {n}")

    def send(self, number, ranks=None):
        for pid in self.pids()[:ranks]:
            try:
                os.kill(pid, number)
            except ProcessLookupError:
                pass

    def end(self, timeout=PATIENCE):
        """Status and what was said."""
        try:
            said = self.process.communicate(timeout=timeout)[0]
        except subprocess.TimeoutExpired:
            self.send(signal.SIGKILL)
            self.process.kill()
            raise AssertionError(f"{self.directory}: did not end in {timeout} s: {self.process.communicate()[0]}") from None
        return self.process.returncode, said


def compile_shim(directory, text=SHIM):
    """Path of a shim as a library."""
    library, source = os.path.join(directory, "shim.so"), write(os.path.join(directory, "shim.c"), text)
    compiler = shutil.which("cc") or shutil.which("gcc")
    if not compiler:
        raise AssertionError("a C compiler is needed for this test")
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    return library
