"""Pours onto mesh walls have the same bits on any number of ranks and through restarts: disks, balls and bodies with shapes, walls that
turn and swing, subdomains that bodies cross, periods, sleep; a checkpoint of another mesh is refused. Polygons run on four ranks too; all of them do in
`./gravier test long`."""
import os
import unittest

import numpy as np

from gravier_runs import LONG, RunTestCase, contents, differences, each, gravier, merged, namelist, run_case, write
from mesh_scenes import floor, quadrangles, stl_text, write_line
from shaped_scenes import body, lattice, prepare, shaped_case

COUNTS = {2: (6, 5), 3: (3, 3, 3)}
BASE = {
    "scene": {"friction": 0.3},
    "time": {"step": 2e-3, "steps": 160},
    "solver": {"method": "nscdd", "tolerance": 1e-2, "max_iterations": 2000},
    "decomposition": {"subdomains": 6, "partition": "metis", "repartition_every": 40},
    "output": {"every": 20, "energy": True, "structure": True, "stress": True, "boundary_forces": True, "final_bodies": True},
}
SWING = "time,vx,omega\n0,0,0\n0.1,0.3,0.4\n0.2,-0.3,-0.4\n0.3,0.2,0.3\n"
SLEEP = {"time": {"step": 4e-3, "steps": 300}, "output": {"every": 55},
         "solver": {"sleeping": True, "sleep_after": 6, "sleep_speed": 3.0, "criterion": "residual", "tolerance": 1e-3}}


def bowl():
    """Triangles of a bowl with a flat bottom, wide enough for the bodies of a lattice."""
    angle = 2.0 * np.pi * np.arange(17) / 16
    return quadrangles(np.array([[[0.3 + radius * np.cos(t), 0.3 + radius * np.sin(t), height] for t in angle]
                                 for radius, height in ((0.01, 0.0), (0.2, 0.0), (0.5, 0.3), (0.8, 1.2))]))


class MeshRanks(RunTestCase):

    def lay_out(self, title, dimension, shapes, *parts):
        """A directory with bodies and a mesh, and the case."""
        periodic = any("period" in part.get("scene", {}) for part in parts)
        rows = lattice(COUNTS[dimension], spacing=0.19, height=0.1 if periodic else 0.3)
        if not shapes:
            rows = [body("grain", [row[axis] for axis in "xyz"[:dimension]], velocity=[0.1] * dimension, radius=0.05 + 0.003 * (k % 7))
                    for k, row in enumerate(rows)]
        directory = prepare(self.here(title), dimension, rows)
        moving = {}
        if dimension == 2:
            write_line(os.path.join(directory, "wall.csv"), [(-1.0, 1.5), (-0.2, 0.4), (0.0, 0.0), (0.55, -0.05), (1.0, 0.0), (1.3, 0.5), (2.2, 1.5)])
            write(os.path.join(directory, "swing.csv"), SWING)
            moving = {"table": "swing.csv", "pivot": [0.5, 0.5]}
        else:
            mesh = floor(6, 0.57, 3, shift=(0.57, 0.57, 0.0)) if periodic else bowl()
            write(os.path.join(directory, "wall.stl"), stl_text(mesh))
            moving = {} if periodic else {"rotation": [0.0, 0.0, 2.0], "pivot": [0.3, 0.3, 0.0]}
        wall = {"name": "wall", "shape": "mesh", "file": "wall.csv" if dimension == 2 else "wall.stl", **moving}
        case = shaped_case(dimension, [wall], BASE, *parts)
        if not shapes:
            del case["scene"]["shapes"]
        return directory, case

    def state(self, run):
        """All that a run leaves and that is no time on the clock."""
        found = {name: value for name, value in run.results().items() if not name.startswith("/run@")}
        found.update({name: value for name, value in run.history().items() if not name.endswith("_seconds")})
        found.update({f"final{name}": value for name, value in contents(run.path("results", "final_bodies.h5")).items()
                      if not name.startswith("/run@")})
        return found

    def play(self, title, dimension, shapes, ranks, *parts):
        directory, case = self.lay_out(f"{title} {dimension} {shapes} {ranks}", dimension, shapes, *parts)
        run = run_case(case, ranks, directory)
        self.assertIn(run.status, (0, 3), str(run))
        return run

    def compare(self, title, dimension, shapes, *parts):
        runs = each(lambda ranks: self.play(title, dimension, shapes, ranks, *parts), [(1,), (2,)] + [(4,)] * (LONG or dimension == 2 and shapes))
        for run in runs[1:]:
            self.assertEqual(differences(self.state(runs[0]), self.state(run)), [], f"{title} {dimension}")
        self.assertGreater(runs[0].history()["contacts"].max(), 20)
        force = np.array([value for name, value in runs[0].results().items() if name.endswith("/boundaries/force")])
        self.assertGreater(np.abs(force).max(), 1.0)
        return runs[0]

    def test_ranks(self):
        for dimension in (2, 3):
            for shapes in (False, True):
                with self.subTest(dimension=dimension, shapes=shapes):
                    self.compare("ranks", dimension, shapes)

    def test_periodic(self):
        run = self.compare("periodic", 3, True, {"scene": {"period": [1.14, 1.14, 0.0], "gravity": [-6.0, -3.0, -9.0]},
                                                 "decomposition": {"partition": "grid"}})
        self.assertTrue(np.any(run.results()["/steps/160/bodies/image"] != 0))

    def test_sleeping(self):
        """Contacts on a mesh at rest sleep."""
        for shapes in (False, True):
            with self.subTest(shapes=shapes):
                directory, case = self.lay_out(f"asleep {shapes}", 3, shapes, SLEEP, {"decomposition": {"subdomains": 2}, "scene": {"friction": 0.6, "rolling_friction": None if shapes else 0.3}})
                for key in ("rotation", "pivot"):
                    del case["boundary"][0][key]
                runs = []
                for ranks in (1, 2):
                    runs.append(run_case(case, ranks, directory))
                    self.assertIn(runs[-1].status, (0, 3), str(runs[-1]))
                    runs[-1].kept = self.state(runs[-1])
                self.assertEqual(differences(runs[0].kept, runs[1].kept), [])
                self.assertGreater(runs[1].history()["sleeping"].max(), 5)

    def test_restart(self):
        for dimension, shapes, stop in ((2, False, 83), (3, True, 110)):
            with self.subTest(dimension=dimension, shapes=shapes):
                part = {"output": {"checkpoint_every": stop, "vtk": True}}
                straight = self.play("straight", dimension, shapes, 2, part)
                directory, case = self.lay_out(f"stopped {dimension}", dimension, shapes, part)
                stopped = run_case(merged(case, {"time": {"steps": stop}}), 1, directory)
                self.assertIn(stopped.status, (0, 3), str(stopped))
                write(os.path.join(directory, "case.nml"), namelist(case))
                again = gravier("--restart", "case.nml", ranks=4 if LONG else 2, directory=directory)
                self.assertIn(again.status, (0, 3), str(again))
                there, here = self.state(straight), self.state(again)
                for found in (there, here):
                    # the least scale is by the duration of the run, which the stopped one had shorter
                    del found["velocity_scale"]
                here = {name: value for name, value in here.items() if not name.startswith(f"/steps/{stop}/") and name.split("@")[0] != f"/steps/{stop}"}
                self.assertEqual(differences(there, here), [])
                pictures = [contents(run.path("results", "boundaries.vtkhdf")) for run in (straight, again)]
                # the stopped run has a state at its end
                self.assertEqual(len(pictures[0]["/VTKHDF/Steps/Values"]) + 1, len(pictures[1]["/VTKHDF/Steps/Values"]))
                name = "wall.csv" if dimension == 2 else "wall.stl"
                with open(os.path.join(directory, name), encoding="ascii") as file:
                    text = file.read()
                write(os.path.join(directory, name), text.replace("1.5", "1.6") if dimension == 2 else text.replace("0.0\n", "0.001\n", 1))
                other = gravier("--restart", "case.nml", ranks=2, directory=directory)
                self.assert_status(other, 2)
                self.assertIn(f"contents of {name}", other.stderr)


if __name__ == "__main__":
    unittest.main()
