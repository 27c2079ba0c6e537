"""The contact problem of a step as a file of FCLIB: the solution that the run found solves it, gravier_fclib reads it and finds the
same velocities, and it does not depend on ranks and subdomains. Restitution, drives and prescribed motion are in it."""
import csv
import unittest

import h5py
import numpy as np

from gravier_runs import SOME_RANKS, RunTestCase, gravier, merged, run_case
from shaped_scenes import box, lattice, prepare, shaped_case

STEP = 60
CASE = {
    "scene": {"bodies": "lattice", "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3, "restitution": 0.2,
              "wall_friction": 0.5},
    "boundary": {"shape": "plane", "normal": [0.0, 1.0, 0.0], "point": [0.0, 0.002, 0.0], "velocity": [0.3, 0.0, 0.0]},
    "time": {"step": 1e-3, "steps": STEP},
    "solver": {"method": "nscdd", "tolerance": 1e-9, "max_iterations": 20000, "acceleration": "momentum"},
    "output": {"directory": "results", "every": 0, "fclib_step": STEP, "final_bodies": True},
}
DISKS = merged(CASE, {"scene": {"dimension": 2, "lattice_count": [10, 12]}})
SPHERES = merged(CASE, {"scene": {"dimension": 3, "lattice_count": [4, 4, 4]},
                        "boundary": {"normal": [0.0, 0.0, 1.0], "point": [0.0, 0.0, 0.002]}})
FRICTIONLESS = merged(SPHERES, {"scene": {"friction": 0.0, "wall_friction": 0.0}})


def matrix(group):
    """Dense, from either compressed form."""
    m, n, kind = (int(group[name][0]) for name in ("m", "n", "nz"))
    start, place, value = group["p"][:], group["i"][:], group["x"][:]
    dense = np.zeros((m, n))
    for line in range(len(start) - 1):
        for k in range(start[line], start[line + 1]):
            at = (line, place[k]) if kind == -2 else (place[k], line)
            dense[at] += value[k]
    return dense


class Dump:

    def __init__(self, path):
        self.path = path
        with h5py.File(self.path) as file:
            problem = file["fclib_global"]
            self.dimension = int(problem["spacedim"][0])
            self.m, self.h = matrix(problem["M"]), matrix(problem["H"])
            self.f, self.w, self.mu = (problem["vectors"][name][:] for name in "f w mu".split())
            self.v, self.r, self.u = (file["solution"][name][:] for name in "vru")


class FclibStep(RunTestCase):

    def dump(self, case, name, ranks=1, step=STEP):
        case = merged(case, {"time": {"steps": step}, "output": {"fclib_step": step}})
        run = run_case(case, ranks=ranks, directory=self.here(name))
        self.assert_status(run, 0)
        return Dump(run.path("results", f"step_{step}.hdf5"))

    def check(self, case, name, step=STEP):
        dump = self.dump(case, name, step=step)
        self.assertGreater(len(dump.mu), 20)
        # the dynamics and the velocities of the contacts hold to rounding
        scale = np.abs(dump.m @ dump.v).max()
        np.testing.assert_allclose(dump.m @ dump.v, dump.h @ dump.r + dump.f, atol=1e-12 * scale)
        np.testing.assert_allclose(dump.h.T @ dump.v + dump.w, dump.u, atol=1e-12 * np.abs(dump.v).max())
        r, u = dump.r.reshape(-1, dump.dimension), dump.u.reshape(-1, dump.dimension)
        # Signorini and Coulomb as far as the tolerance of the run goes: r_n u_n = 0, and power lost in sliding at the bound
        size = np.abs(r).max() * np.abs(u).max()
        self.assertLess(np.abs(r[:, 0] * u[:, 0]).max(), 1e-6 * size)
        sliding = np.linalg.norm(u[:, 1:], axis=1)
        lost = np.sum(r[:, 1:] * u[:, 1:], axis=1)
        np.testing.assert_allclose(lost, -dump.mu * r[:, 0] * sliding, atol=1e-6 * size)
        self.assertGreaterEqual(r[:, 0].min(), 0.0)
        # gravier_fclib solves it, and finds these velocities; impulses of disks and spheres on each other are not unique
        run = gravier("--tolerance", "1e-9", "--write", "solved", dump.path, program="gravier_fclib", directory=self.here(name))
        self.assert_status(run, 0)
        with h5py.File(run.path("solved", f"step_{step}.hdf5")) as file:
            found = file["solution/r"][:]
        # from the impulses in the file, which meet the tolerance, nothing is left to do
        run = gravier("--warm", "--tolerance", "1e-4", "--csv", "warm.csv", dump.path, program="gravier_fclib", directory=self.here(name))
        self.assert_status(run, 0)
        with open(run.path("warm.csv"), newline="", encoding="ascii") as file:
            self.assertEqual((run.stderr, [row["sweeps"] for row in csv.DictReader(file)]), ("", ["1"]))
        velocity = np.linalg.solve(dump.m, dump.h @ found + dump.f)
        self.assertLess(np.abs(velocity - dump.v)[: len(dump.v)].max(), 1e-3 * np.abs(dump.v).max())
        return dump

    def test_attraction(self):
        """Attractions are loads of the problem; its impulses are those of Coulomb's law."""
        law = {"materials": ["grain"], "kind": "adhesive", "friction": 0.3, "adhesion": 20.0, "adhesion_range": 5e-4}
        self.check(merged(DISKS, {"material": [{"name": "grain"}], "law": [law]}), "attraction")

    def test_disks(self):
        dump = self.check(DISKS, "disks")
        # restitution and the moving plane are in w
        self.assertGreater(np.abs(dump.w).max(), 0.25)

    def test_spheres(self):
        self.check(SPHERES, "spheres")

    def test_without_friction(self):
        dump = self.check(FRICTIONLESS, "frictionless")
        self.assertEqual(np.abs(dump.mu).max(), 0.0)

    def shaped(self, dimension):
        """A pour of bodies with shapes; its files must be where it runs."""
        counts, spacing = ((6, 7), 0.17) if dimension == 2 else ((3, 3, 3), 0.19)
        walls = box(counts, spacing)
        walls[-1]["velocity"] = [0.3, 0.0, 0.0]
        return shaped_case(dimension, walls, {
            "scene": {"friction": 0.3}, "solver": merged(CASE, {"solver": {"method": "newton", "acceleration": None}})["solver"],
            "output": {"final_bodies": True}}), lattice(counts, spacing=spacing)

    def test_shapes(self):
        """Bodies with shapes have an inertia that is a matrix, and pairs several points."""
        for dimension in (2, 3):
            case, rows = self.shaped(dimension)
            prepare(self.here(f"shapes{dimension}"), dimension, rows)
            dump = self.check(case, f"shapes{dimension}", 180)
            off = dump.m - np.diag(np.diag(dump.m))
            self.assertEqual(np.abs(off).max() > 0.0, dimension == 3)
            np.testing.assert_array_equal(off, off.T)
            self.assertGreater(np.linalg.eigvalsh(dump.m).min(), 0.0)

    def test_any_ranks_and_subdomains(self):
        for case, name in ((DISKS, "disks"), (SPHERES, "spheres"), (self.shaped(2), "shapes2"), (self.shaped(3), "shapes3")):
            rows = None
            if isinstance(case, tuple):
                case, rows = case
            dimension = case["scene"]["dimension"]
            case = merged(case, {"decomposition": {"subdomains": 4}})
            for number in SOME_RANKS:
                if rows:
                    prepare(self.here(f"{name}{number}"), dimension, rows)
            step = 180 if rows else STEP
            first = self.dump(case, f"{name}1", step=step)
            for ranks in SOME_RANKS[1:]:
                other = self.dump(case, f"{name}{ranks}", ranks=ranks, step=step)
                for values in "m h f w mu v r u".split():
                    np.testing.assert_array_equal(getattr(other, values), getattr(first, values), err_msg=values)
            # one step from the same state: bodies, contacts, masses, loads and H do not know the subdomains
            packing = self.here(f"{name}1", "results", "final_bodies.h5")
            case = merged(case, {"scene": {"bodies": "file", "bodies_file": packing, "lattice_count": None, "radius_min": None,
                                           "radius_max": None}})
            for part in ("whole", "parts"):
                if rows:
                    prepare(self.here(f"{name}{part}"), dimension, rows)
            whole = self.dump(merged(case, {"decomposition": {"subdomains": 1}}), f"{name}whole", step=1)
            parts = self.dump(case, f"{name}parts", step=1)
            self.assertGreater(len(whole.mu), 20)
            for values in "m h f w mu".split():
                np.testing.assert_array_equal(getattr(parts, values), getattr(whole, values), err_msg=values)


if __name__ == "__main__":
    unittest.main()
