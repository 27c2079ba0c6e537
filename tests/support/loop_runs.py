"""Loops of a user's own in tests: scripts on gravier.Simulation that run beside their cases, and all that a run has written."""
import os
import sys

import numpy as np

import forked_scripts
from gravier_runs import SOURCE, Run, RunTestCase, alone_environment, contents, differences, gravier, merged, namelist, write

os.environ["PYTHONPATH"] = os.pathsep.join([os.path.join(SOURCE, "drivers/python"), os.environ.get("PYTHONPATH", "")])

#: disks that fall to the ground beside a wall, in two subdomains
HEAP = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [8, 6], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
    "boundary": [{"name": "floor", "shape": "plane", "point": [0.0, -0.012], "normal": [0.0, 1.0]},
                 {"name": "left", "shape": "plane", "point": [-0.012, 0.0], "normal": [1.0, 0.0]}],
    "time": {"step": 1e-3, "steps": 60},
    "solver": {"method": "nscdd"},
    "decomposition": {"subdomains": 2},
    "output": {"directory": "results", "every": 20, "checkpoint_every": 30, "contacts": True, "energy": True, "trace": True},
}
BALLS = merged(HEAP, {"scene": {"dimension": 3, "lattice_count": [4, 3, 4]}, "boundary": [
    {"name": "floor", "shape": "plane", "point": [0.0, 0.0, -0.012], "normal": [0.0, 0.0, 1.0]}]})
#: what says who ran and how long
LEFT_OUT = ("@version", "@revision", "@command", "@host", "@date")
SCRIPT = """
import sys
import numpy as np
import gravier

case = "case.nml"
"""
LOOP = """
with gravier.Simulation(case, restart="--restart" in sys.argv) as s:
    while s.goes_on:
        s.step()
sys.exit(s.status)
"""


def written(directory):
    """All that a run has written, but for what names the program and tells seconds."""
    found = {}
    for name in ("results.h5", "checkpoint.h5"):
        if os.path.exists(os.path.join(directory, "results", name)):
            found.update({name + path: value for path, value in contents(os.path.join(directory, "results", name)).items()
                          if not path.endswith(LEFT_OUT)})
    for name in ("history.csv", "trace.csv"):
        path = os.path.join(directory, "results", name)
        if not os.path.exists(path):
            continue
        with open(path, encoding="ascii") as file:
            header, *rows = [line.rstrip("\n").split(",") for line in file]
        for k, column in enumerate(header):
            if "seconds" not in column:
                found[f"{name}/{column}"] = np.array([row[k] for row in rows])
    return found


class LoopTestCase(RunTestCase):
    """Scripts that run beside their cases."""

    def play(self, title, groups, script, *arguments, ranks=1, status=0):
        """Run a script beside a case."""
        directory = self.here(title)
        os.makedirs(directory, exist_ok=True)
        write(os.path.join(directory, "case.nml"), namelist(groups))
        write(os.path.join(directory, "loop.py"), SCRIPT + script)
        if ranks == 1:
            with alone_environment() as environment:
                done = forked_scripts.script("loop.py", *arguments, directory=directory, environment=environment)
            run = Run(directory, done.returncode if done.returncode >= 0 else 128 - done.returncode, done.stdout, done.stderr, "")
        else:
            run = gravier("loop.py", *arguments, ranks=ranks, directory=directory, program=sys.executable)
        self.assert_status(run, status)
        return run

    def same(self, one, other):
        first = written(one.directory)
        self.assertGreater(len(first), 20)
        self.assertEqual(differences(first, written(other.directory)), [])
