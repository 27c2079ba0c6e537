"""bodies.vtkhdf and contacts.vtkhdf: what they hold is what results.h5 holds, the same bytes on any number of ranks; a run that is
killed before any write, or while it writes, leaves them readable, a restart goes on with them. They are read with h5py and, where a
python3 with vtk is found ($GRAVIER_VTK_PYTHON, or the one that runs this), with VTK's own reader."""
import os
import random
import signal
import subprocess
import sys
import time
import unittest

import h5py
import numpy as np

from gravier_runs import SOURCE, RunTestCase, each, gravier, merged, run_case, write
from killed_runs import Going, compile_shim

import gravier as package  # the runs above have put it on the path

NAMES = ("bodies.vtkhdf", "contacts.vtkhdf")
KINDS = ("Vertices", "Lines", "Polygons", "Strips")
# single precision, of coordinates and speeds of about 1
SINGLE = 2e-7
DISKS = {"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [8, 7], "radius_min": 0.008, "radius_max": 0.012,
                   "friction": 0.3},
         "time": {"step": 1e-3, "steps": 120},
         "solver": {"method": "nscdd", "tolerance": 1e-2},
         "decomposition": {"subdomains": 4},
         "output": {"directory": "results", "every": 30, "vtk": True}}
SPHERES = merged(DISKS, {"scene": {"dimension": 3, "lattice_count": [4, 4, 4], "gravity": [1.0, 0.0, -9.81]}})


LIBRARY = {2: """shape tile
polygon 0 0  0.03 0  0.03 0.02  0 0.02
shape ell
polygon 0 0  0.02 0  0.02 0.01  0 0.01
polygon 0 0.01  0.01 0.01  0.01 0.03  0 0.03
shape pill
capsule -0.01 0  0.01 0  0.008
""", 3: """shape block
box 0.03 0.02 0.01
shape tetra
hull 0.01 0.01 0.01  0.01 -0.01 -0.01  -0.01 0.01 -0.01  -0.01 -0.01 0.01
shape pill
capsule 0 0 -0.01  0.002 0 0.01  0.008
shape pair
box 0.02 0.01 0.01
box 0.01 0.01 0.02  0 0.01 0
"""}
TILES = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "shapes": "a.shapes", "friction": 0.3},
         "time": {"step": 1e-3, "steps": 120},
         "output": {"directory": "results", "every": 30, "vtk": True, "checkpoint_every": 10}}
# without gravity nothing falls
BLOCKS = merged(TILES, {"scene": {"dimension": 3, "gravity": [0.0, 0.0, 0.0]}})


def write_shapes(directory, case):
    """A library and twenty bodies in a row, which turn; every fifth is a disk or a sphere. Nothing is written for a lattice."""
    os.makedirs(directory, exist_ok=True)
    if case["scene"]["bodies"] != "file":
        return
    d = case["scene"]["dimension"]
    names = [line.split()[1] for line in LIBRARY[d].splitlines() if line.startswith("shape")]
    rows = ["id,shape,scale,radius," + ("x,y,angle,omega,nx,ny" if d == 2 else "x,y,z,qw,qx,qy,qz,wx,wy,wz,nx,ny,nz")]
    for k in range(20):
        what = ",,0.01" if k % 5 == 4 else f"{names[k % len(names)]},{1.0 + 0.02 * k},"
        # in the plane every other one falls onto that before it
        rows.append(f"{k + 1},{what}," + (f"{0.1 * (k // 2)},{0.035 + 0.065 * (k % 2)},{0.3 * k},{k % 3},," if d == 2
                                          else f"{0.1 * k},0,0.1,1,{0.1 * k},0.2,{-0.05 * k},1,{k % 3},0.5,,,"))
    rows.append("99,plane,,," + ("0,0,,,0,1" if d == 2 else "0,0,0,,,,,,,,0,0,1"))
    write(os.path.join(directory, "bodies.csv"), "\n".join(rows) + "\n")
    write(os.path.join(directory, "a.shapes"), LIBRARY[d])


def vtk_python():
    """A python3 that can read VTKHDF; None where there is none."""
    for python in (os.environ.get("GRAVIER_VTK_PYTHON"), sys.executable):
        if python and os.path.exists(python):
            test = ("import numpy, vtkmodules.vtkIOHDF; from vtkmodules.vtkCommonCore import vtkVersion; "
                    "assert (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()) >= (9, 4)")
            if subprocess.run([python, "-c", test], capture_output=True, check=False).returncode == 0:
                return python
    return None


def read(path):
    """Steps of a file by their numbers: {"time", "points", "corners" (points of each cell), fields}."""
    steps = {}
    with h5py.File(path) as file:
        root, when = file["VTKHDF"], file["VTKHDF/Steps"]
        group = "PointData" if len(root["PointData"] if "PointData" in root else ()) else "CellData"
        kind = next(k for k, name in enumerate(KINDS) if root[f"{name}/NumberOfCells"][:].any())
        cells = root[KINDS[kind]]
        for k in range(int(when.attrs["NSteps"])):
            first, number = int(when["PointOffsets"][k]), int(root["NumberOfPoints"][k])
            rows, before = int(cells["NumberOfCells"][k]), int(when["CellOffsets"][k, kind])
            offsets = cells["Offsets"][before + k:before + k + rows + 1]
            assert (offsets[0], offsets[-1]) == (0, number) and int(cells["NumberOfConnectivityIds"][k]) == number
            start = int(when["ConnectivityIdOffsets"][k, kind])
            assert np.array_equal(cells["Connectivity"][start:start + number], np.arange(number))
            steps[int(file["step"][k])] = {"time": when["Values"][k], "points": root["Points"][first:first + number],
                                           "corners": np.diff(offsets)}
            for name, values in root[group].items():
                offset = int(when[f"{group}Offsets/{name}"][k])
                steps[int(file["step"][k])][name] = values[offset:offset + rows]
    return steps


class Pictures(RunTestCase):

    def check_against_results(self, directory):
        """Bodies, forces and gaps of all steps are those of results.h5."""
        run = package.Run(directory)
        bodies, contacts = (read(os.path.join(directory, name)) for name in NAMES)
        self.assertEqual(sorted(bodies), list(run.steps))
        known = [step for step in run.steps if run.contacts(step) is not None]
        touching = [step for step in known if len(run.contacts(step)) > 0]
        self.assertEqual(sorted(contacts), [step for step in known if step >= touching[0]])
        d, h = run.dimension, run.time_step()
        for step in run.steps:
            found, expected = bodies[step], run.bodies(step)
            self.assertEqual(found["time"], run.time(step))
            self.assertTrue(np.array_equal(found["id"], expected.id))
            for name, values in (("points", expected.position), ("velocity", expected.velocity)):
                self.assertLess(np.abs(found[name][:, :d] - values).max(), SINGLE)
                self.assertTrue(np.all(found[name][:, d:] == 0.0))
            self.assertLess(np.abs(found["radius"] - expected.radius).max(), SINGLE)
            self.assertLess(np.abs(found["mass"] - expected.mass).max(), SINGLE * expected.mass.max())
            self.assertTrue(np.array_equal(found["material"], expected.material))
            self.assertLess(np.abs(found["spin"][:, 2:] - expected.spin[:, -1:]).max(), 1e-4 * max(np.abs(expected.spin).max(), 1.0))
            self.assertEqual(set(found["subdomain"]) - {1, 2, 3, 4}, set())
            if step not in contacts:
                continue
            found, expected = contacts[step], run.contacts(step)
            largest = max(expected.impulse.max(initial=0.0) / h, 1e-9)
            self.assertLess(np.abs(found["normal_force"] - expected.impulse[:, 0] / h).max(), SINGLE * largest)
            tangential = np.linalg.norm(expected.impulse[:, 1:], axis=1) / h
            self.assertLess(np.abs(found["tangential_force"] - tangential).max(), SINGLE * largest)
            self.assertLess(np.abs(found["gap"] - expected.gap).max(), SINGLE)
            idle, on_cone = expected.impulse[:, 0] <= 0.0, tangential >= 0.3 * (1.0 - 1e-5) * expected.impulse[:, 0] / h
            self.assertTrue(np.all((found["status"] == 0) == idle))
            self.assertTrue(np.all(found["status"][~idle & ~on_cone] == 1))
            # places are those of the middle of the step
            segments, _ = run.chains(step)
            self.assertLess(np.abs(found["points"].reshape(-1, 2, 3)[:, :, :d] - segments).max(), h * 5.0)
        self.assertGreater(np.count_nonzero(contacts[run.steps[-1]]["status"] == 1), 10)

    def test_what_they_hold(self):
        for title, case in (("2D", DISKS), ("3D", SPHERES)):
            runs = each(run_case, [(case, ranks, self.here(f"{title} {ranks}")) for ranks in (1, 2, 3)])
            for run in runs:
                self.assert_status(run, 0)
                for name in NAMES:
                    with open(runs[0].path("results", name), "rb") as first, open(run.path("results", name), "rb") as other:
                        self.assertEqual(first.read(), other.read(), f"{title}: {name}")
            self.check_against_results(runs[0].path("results"))
            if title == "2D":
                self.assertEqual(set(package.Run(runs[0].path("results")).subdomain()), {1, 2, 3, 4})

    def test_periodic_scene(self):
        """No line crosses a periodic scene: all are as long as two disks at most."""
        run = run_case(merged(DISKS, {"scene": {"period": [0.21, 0.0], "gravity": [2.0, -9.81]}}), 2, self.here("periodic"))
        self.assert_status(run, 0)
        lines = read(run.path("results", NAMES[1]))[120]["points"].reshape(-1, 2, 3)
        self.assertLess(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).max(), 0.03)
        # and some reach over the edge
        self.assertTrue((lines[:, :, 0] < 0.0).any() or (lines[:, :, 0] > 0.21).any())

    def test_off(self):
        run = run_case(merged(DISKS, {"output": {"vtk": None}, "time": {"steps": 2}}), 1, self.here("off"))
        self.assertEqual([name for name in os.listdir(run.path("results")) if "vtk" in name], [])

    def test_kills_and_restarts(self):
        """Killed before one write after the other of either file, on one or two ranks: whole steps, as of the run that nothing
        stopped, in either file; and the restart ends with the same steps."""
        library = compile_shim(self.scratch)
        case = merged(DISKS, {"time": {"steps": 6}, "solver": {"max_iterations": 10, "tolerance": 0.1},
                              "output": {"every": 1, "checkpoint_every": 2}})
        run_case(case, 1, self.here("straight"))
        straight = {name: read(self.here("straight", "results", name)) for name in NAMES}

        def killed(name, ranks, count):
            directory = self.here(f"killed {NAMES.index(name)} {count}")
            status, said = Going(case, ranks, directory, shim=(library, 0, count, name)).end()
            self.assertNotIn(status, (0, 1, 2, 3), f"not killed at write {count}: {said}")
            whole = self.check_steps(directory, straight)
            self.vtk_reads([os.path.join(directory, "results", one) for one in NAMES], optional=True)
            again = gravier("--restart", "case.nml", ranks=3 - ranks, directory=directory)
            self.assertIn(again.status, (0, 3), str(again))
            self.assertEqual(self.check_steps(directory, straight), [len(straight[one]) for one in NAMES])
            return whole

        whole = each(killed, [(NAMES[k % 2], 1 + k % 2, count) for k, count in enumerate([175, 200, 221, 240, 262, 301, 353, 420])])
        self.assertGreater(len({tuple(counts) for counts in whole}), 3, whole)

    def test_kills_around_writes(self):
        """Killed at random from outside while either file is being written, on 1 and 2 ranks in turn: whole steps, as of the run that
        nothing stopped, to h5py and to VTK's own reader."""
        # many more steps than a run is given time for
        case = merged(DISKS, {"time": {"steps": 400}, "solver": {"max_iterations": 10, "tolerance": 0.1},
                              "output": {"every": 1, "checkpoint_every": 0}})
        seconds = np.median(run_case(merged(case, {"time": {"steps": 80}}), 1, self.here("whole")).history()["wall_seconds"])
        straight = {name: read(self.here("whole", "results", name)) for name in NAMES}
        draw = random.Random(5)

        def last_write(path):
            """When a file changed last, under its name or before it has one [ns]."""
            return max((os.stat(one).st_mtime_ns for one in (path, path + ".part") if os.path.exists(one)), default=0)

        def killed(number, row, share):
            directory = self.here(f"around {number}")
            run = Going(case, 1 + number % 2, directory)
            path = os.path.join(directory, "results", NAMES[number // 2 % 2])
            run.wait_for_rows(row)
            # a write of the file begins; until the next one all others of a step are under way
            before = last_write(path)
            run.wait_for(lambda: last_write(path) != before, "a write", pause=5e-4)
            time.sleep(share * seconds)
            run.send(signal.SIGKILL)
            status, said = run.end()
            self.assertNotIn(status, (0, 1, 2, 3), f"not killed after step {row}: {said}")
            return self.check_steps(directory, straight)

        moments = [(k, draw.randrange(1, 10), draw.random()) for k in range(14)]
        counts = each(killed, moments)
        self.assertGreater(len({tuple(count) for count in counts}), 5, counts)
        self.vtk_reads([self.here(f"around {k}", "results", name) for k, _, _ in moments for name in NAMES], optional=True)

    def check_steps(self, directory, straight):
        """How many steps each file has; they are those of the run that nothing stopped."""
        counts = []
        for name in NAMES:
            path = os.path.join(directory, "results", name)
            steps = read(path) if os.path.exists(path) else {}
            self.assertEqual(list(steps), list(straight[name])[:len(steps)])
            with h5py.File(path) if steps else open(os.devnull, encoding="ascii") as file:
                # readers may go by the number of times
                times = len(file["VTKHDF/Steps/Values"]) if steps else 0
                self.assertIn(times - len(steps), (0, 1))
            for step, fields in steps.items():
                for field, values in fields.items():
                    self.assertTrue(np.array_equal(values, straight[name][step][field]), f"{path}: {field} of step {step}")
            counts.append(len(steps))
        return counts

    def vtk_reads(self, paths, optional=False):
        """What VTK's reader finds is what h5py finds."""
        python = vtk_python()
        paths = [path for path in paths if os.path.exists(path)]
        if python is None and not optional:
            raise unittest.SkipTest("NO VTK: its own reader was not tried; pip install vtk (9.4 at least), or set GRAVIER_VTK_PYTHON")
        if python is None or not paths:
            return
        command = [python, os.path.join(SOURCE, "tests/support/read_vtk.py"), *paths]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode < 0:
            # the process of VTK ended by a signal once in some hundred calls ("munmap_chunk(): invalid pointer"), and valgrind finds
            # nothing in it: what is wrong with a file ends the second call, too
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, "ERR" in done.stderr), (0, False), done.stderr[-2000:])
        for path in paths:
            steps = list(read(path).values())
            with np.load(path + ".npz") as found:
                # VTK tells no time of a file with one step
                if len(steps) > 1:
                    self.assertIn(len(found["times"]) - len(steps), (0, 1))
                    self.assertTrue(np.array_equal(found["times"][:len(steps)], [step["time"] for step in steps]))
                for k, step in enumerate(steps):
                    for field, values in step.items():
                        if field != "time":
                            self.assertTrue(np.array_equal(found[f"{k} {field}"], values), f"{path}: {field} of step {k}")
                    self.assertTrue(np.array_equal(found[f"{k} cells"], np.arange(len(step["points"]))))

    def test_the_reader_of_vtk(self):
        for title, case in (("2D", DISKS), ("3D", SPHERES), ("shapes in 2D", TILES), ("shapes in 3D", BLOCKS)):
            directory = self.here(f"read {title}")
            write_shapes(directory, case)
            run = run_case(case, 2, directory)
            self.assert_status(run, 0)
            self.vtk_reads([run.path("results", name) for name in NAMES if os.path.exists(run.path("results", name))])

    def test_polygons(self):
        """Bodies with shapes: the polygons of the package, which come from results.h5, where they have sharp corners, and points of
        circles and spheres; the same bytes on any number of ranks; a run that goes on from a checkpoint writes what it would have."""
        for title, case in (("2D", TILES), ("3D", BLOCKS)):
            runs = []
            for ranks in (1, 2, 3):
                directory = self.here(f"polygons {title} {ranks}")
                write_shapes(directory, case)
                if ranks == 3:
                    half = merged(case, {"time": {"steps": case["time"]["steps"] // 2}})
                    self.assert_status(run_case(half, 2, directory), 0)
                runs.append(run_case(case, ranks, directory, ("--restart",)))
                self.assert_status(runs[-1], 0)
            self.check_polygons(runs[0].path("results"))
            first, second, third = (run.path("results", NAMES[0]) for run in runs)
            with open(first, "rb") as one, open(second, "rb") as other:
                self.assertEqual(one.read(), other.read(), title)
            straight = read(first)
            for step, fields in read(third).items():
                for field, values in fields.items():
                    self.assertTrue(np.array_equal(values, straight[step][field]), f"{field} of step {step} after a restart")
            self.assertEqual(list(read(third)), list(straight))

    def check_polygons(self, directory):
        run = package.Run(directory)
        shapes = [None, *run.shapes()]
        bodies = read(os.path.join(directory, NAMES[0]))
        self.assertEqual(list(bodies), list(run.steps))
        for step, found in bodies.items():
            expected, outlines = run.bodies(step), run.outlines(step)
            polygons = np.split(found["points"], np.cumsum(found["corners"])[:-1])
            for k, number in enumerate(expected.id):
                rows = np.flatnonzero(found["id"] == number)
                self.assertTrue(np.array_equal(rows, np.arange(rows[0], rows[0] + len(rows))), "a body in one place")
                for name in ("radius", "mass", "shape", "material"):
                    self.assertLess(np.abs(found[name][rows] - expected[name][k]).max(), SINGLE * max(1.0, expected[name][k]))
                own = [polygons[row][:, :run.dimension] for row in rows]
                pieces = shapes[expected.shape[k]].pieces if expected.shape[k] else []
                if pieces and all(len(piece.corner) > 2 for piece in pieces):
                    self.assertEqual([len(points) for points in own], [len(points) for points in outlines[k]])
                    self.assertLess(np.abs(np.concatenate(own) - np.concatenate(outlines[k])).max(), 4 * SINGLE)
                elif not pieces:
                    distance = np.linalg.norm(np.concatenate(own) - expected.position[k], axis=1)
                    self.assertLess(np.abs(distance - expected.radius[k]).max(), 4 * SINGLE)
                else:
                    # between the same bounds along each axis, but for the sides of circles
                    bounds = [np.array([np.concatenate(one).min(axis=0), np.concatenate(one).max(axis=0)]) for one in (own, outlines[k])]
                    self.assertLess(np.abs(bounds[0] - bounds[1]).max(), 0.05 * expected.radius[k])
            self.assertEqual(set(found["id"]), set(expected.id))
        self.assertTrue(np.all(run.subdomain() == 1))
        # contacts reach from centre to centre, or to the ground, in the middle of a step in which all are slow
        for step, found in read(os.path.join(directory, NAMES[1])).items() if run.dimension == 2 else ():
            bodies, contacts = run.bodies(step), run.contacts(step)
            centre = {number: place for number, place in zip(bodies.id, bodies.position)}
            for ends, one, other, point in zip(found["points"].reshape(-1, 2, 3), contacts.candidate, contacts.antagonist, contacts.point):
                self.assertLess(np.abs(ends[0, :2] - centre[one]).max(), 1e-3)
                self.assertLess(np.abs(ends[1, :2] - (centre[other] if other in centre else point)).max(), 1e-3)


if __name__ == "__main__":
    unittest.main()
