"""Samples made by gravier_sample: the same bytes on any number of ranks, grains that do not overlap, radii of the distribution
asked for, settled and compacted samples that rest, and what is refused."""
import hashlib
import os
import re
import unittest

import h5py
import numpy as np

from gravier_runs import SOME_RANKS, RunTestCase, each, gravier, merged, namelist, write

DENSITY = 2500.0
BASE = {
    "scene": {"dimension": 2, "bodies": "sample", "density": DENSITY},
    "sample": {"count": 400, "box": 0.5, "radii": "uniform", "radius_min": 0.008, "radius_max": 0.012, "file": "sample.h5"},
    "time": {"step": 1e-3, "steps": 0},
}
SPHERES = {"scene": {"dimension": 3}, "sample": {"count": 400, "box": [0.12, 0.12]}}
SOLVED = {
    "scene": {"friction": 0.3, "alert_distance": 0.003},
    "sample": {"count": 150, "box": 0.25, "solid_fraction": 0.5, "max_steps": 5000},
    "solver": {"method": "nscdd", "tolerance": 1e-3, "max_iterations": 3000},
    "decomposition": {"subdomains": 4, "repartition_every": 100},
}
PRESSURE = 1000.0
CASES = {
    "lattice": merged(BASE, {"sample": {"arrangement": "lattice"}}),
    "loose": merged(BASE, {"sample": {"solid_fraction": 0.45}}),
    "volume": merged(BASE, SPHERES, {"sample": {"radii": "uniform_volume", "radius_min": 0.004, "solid_fraction": 0.25}}),
    "log_normal": merged(BASE, {"sample": {"radii": "log_normal", "radius_mean": 0.01, "radius_deviation": 0.1,
                                           "radius_min": 0.007, "radius_max": 0.014}}),
    "table": merged(BASE, {"sample": {"radii": "table", "radius_min": None, "radius_max": None, "radius_table": "radii.csv"}}),
    "periodic": merged(BASE, SPHERES, {"scene": {"period": [0.13, 0.14, 0.15], "period_origin": [-1.0, 2.0, 0.5]}, "sample": {
        "box": None, "radii": "single", "radius": 0.007, "radius_min": None, "radius_max": None}}),
    "settled": merged(BASE, SOLVED, {"sample": {"preparation": "settled"}}),
    "compacted": merged(BASE, SOLVED, {"scene": {"friction": 0.0}, "sample": {"preparation": "compacted", "pressure": PRESSURE}}),
    "pressed": merged(BASE, SOLVED, SPHERES, {"scene": {"period": [0.12, 0.0, 0.0], "wall_friction": 0.0}, "sample": {
        "count": 100, "preparation": "compacted", "pressure": 2e4, "solid_fraction": 0.3}, "solver": {"tolerance": 1e-4}}),
}
UNPREPARED = [name for name, case in CASES.items() if "preparation" not in case["sample"]]
#: steps of preparations that are compared on four ranks: grains meet, and subdomains are cut anew at step 100
BEGINNING = {"sample": {"max_steps": 120}}
CASES.update({f"{name}, beginning": merged(CASES[name], BEGINNING) for name in ("settled", "compacted", "pressed")})
#: numbers of ranks by case: a preparation to its end is compared on two, for one of each kind; what is loose and a beginning on four, and
#: more in `./gravier test long`
RANKS = {name: SOME_RANKS for name in CASES} | {name: (1, 2, 4) for name in ("loose", "compacted, beginning")} | {"settled": (1, 2), "compacted": (1, 2), "pressed": (1,)}
WHOLE = [name for name in CASES if not name.endswith("beginning")]


def make(name, directory, ranks=1):
    """Make the sample of CASES, or of an input given, in a directory."""
    os.makedirs(directory, exist_ok=True)
    write(os.path.join(directory, "radii.csv"), "radius,share\n0.006,3\n0.012,1\n")
    write(os.path.join(directory, "sample.nml"), namelist(CASES.get(name, name) if isinstance(name, str) else name))
    return gravier("sample.nml", ranks=ranks, directory=directory, program="gravier_sample")


def volume(dimension, radius):
    return np.pi * radius**2 if dimension == 2 else 4.0 / 3.0 * np.pi * radius**3


class Bodies:
    """A bodies file."""

    def __init__(self, path):
        with h5py.File(path) as file:
            self.id, self.position, self.radius, self.mass, self.velocity = (
                file["bodies/" + name][()] for name in ("id", "position", "radius", "mass", "velocity"))
            self.point = file["walls/point"][()] if "walls" in file else np.zeros((0, 2))
            self.normal = file["walls/normal"][()] if "walls" in file else np.zeros((0, 2))
            self.period = file["box/period"][()] if "box" in file else np.zeros(self.position.shape[1])
            self.origin = file["box/origin"][()] if "box" in file else None
        self.dimension = self.position.shape[1]

    def deepest(self):
        """Largest overlap of two grains, and of a grain and a wall; negative where there is none."""
        apart = self.position[:, None, :] - self.position[None, :, :]
        for d in range(self.dimension):
            if self.period[d] > 0:
                apart[..., d] -= self.period[d] * np.round(apart[..., d] / self.period[d])
        overlap = self.radius[:, None] + self.radius[None, :] - np.linalg.norm(apart, axis=2)
        np.fill_diagonal(overlap, -1.0)
        deepest = overlap.max()
        for point, normal in zip(self.point, self.normal):
            deepest = max(deepest, (self.radius - (self.position - point) @ normal).max())
        return deepest


class Samples(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        jobs = [(name, ranks) for name in CASES for ranks in RANKS[name]]
        runs = each(lambda name, ranks: make(name, cls.place(name, ranks), ranks), jobs)
        cls.runs = dict(zip(jobs, runs))

    @classmethod
    def place(cls, name, ranks):
        return os.path.join(cls.scratch, f"{name}-{ranks}")

    def bodies(self, name):
        return Bodies(self.runs[name, 1].path("sample.h5"))

    def test_same_bytes_on_any_ranks(self):
        for name in CASES:
            digests = set()
            for ranks in RANKS[name]:
                self.assert_status(self.runs[name, ranks], 0 if name in WHOLE else 3)
                with open(self.runs[name, ranks].path("sample.h5"), "rb") as file:
                    digests.add(hashlib.sha256(file.read()).hexdigest())
            self.assertEqual(len(digests), 1, name)

    def test_bodies(self):
        for name in WHOLE:
            case = CASES[name]
            with self.subTest(name):
                bodies = self.bodies(name)
                self.assert_finite(vars(bodies))
                np.testing.assert_array_equal(bodies.id, np.arange(1, case["sample"]["count"] + 1))
                np.testing.assert_allclose(bodies.mass, DENSITY * volume(bodies.dimension, bodies.radius), rtol=1e-12)
                self.assertFalse(bodies.velocity.any())

    def test_planes(self):
        """The floor and the sides of each axis that is not periodic; a lid on compacted samples only."""
        for name, number in (("lattice", 3), ("loose", 3), ("volume", 5), ("periodic", 0), ("settled", 3), ("compacted", 4),
                             ("pressed", 4)):
            self.assertEqual(len(self.bodies(name).point), number, name)

    def test_unprepared_grains_do_not_overlap(self):
        for name in UNPREPARED:
            self.assertLess(self.bodies(name).deepest(), 1e-12, name)

    def test_box(self):
        """The height that solid_fraction gives is that of the sides of the box."""
        bodies = self.bodies("periodic")
        np.testing.assert_array_equal(bodies.period, [0.13, 0.14, 0.15])
        np.testing.assert_array_equal(bodies.origin, [-1.0, 2.0, 0.5])
        self.assertTrue(np.all(bodies.position >= bodies.origin) and np.all(bodies.position < bodies.origin + bodies.period))
        # grains reach over the sides
        self.assertTrue(np.all(bodies.position.min(axis=0) < bodies.origin + 0.007))
        bodies = self.bodies("loose")
        height = np.sum(volume(2, bodies.radius)) / (0.45 * 0.5)
        self.assertLessEqual((bodies.position[:, 1] + bodies.radius).max(), height)
        self.assertGreater((bodies.position[:, 1] + bodies.radius).max(), 0.95 * height)

    def test_radii(self):
        """Means of 400 draws are within four standard deviations of a mean, s/20."""
        radius = self.bodies("loose").radius
        self.assert_between(radius, 0.008, 0.012)
        self.assertLess(abs(radius.mean() - 0.01), 4 * 0.004 / np.sqrt(12) / 20)
        radius = self.bodies("volume").radius
        self.assert_between(radius, 0.004, 0.012)
        # as many in number below r as (1 - (a/r)^2)/(1 - (a/b)^2) says: the median is at sqrt(9/5) a
        self.assertLess(abs(np.mean(radius < 0.004 * np.sqrt(1.8)) - 0.5), 4 * 0.5 / 20)
        radius = self.bodies("log_normal").radius
        self.assert_between(radius, 0.007, 0.014)
        self.assertLess(abs(np.log(radius / 0.01).mean()), 4 * 0.1 / 20)
        self.assertLess(abs(np.log(radius / 0.01).std() - 0.1), 4 * 0.1 / np.sqrt(2) / 20)
        radius = self.bodies("table").radius
        self.assertEqual(set(radius), {0.006, 0.012})
        self.assertLess(abs(np.mean(radius < 0.01) - 0.75), 4 * np.sqrt(0.75 * 0.25) / 20)
        self.assertEqual(set(self.bodies("periodic").radius), {0.007})

    def assert_between(self, radius, least, most):
        self.assertTrue(np.all((radius >= least) & (radius <= most)))

    def test_seed_changes_the_sample(self):
        run = make(merged(CASES["loose"], {"sample": {"seed": 2}}), self.here("seed"))
        self.assert_status(run, 0)
        self.assertGreater(np.abs(Bodies(run.path("sample.h5")).radius - self.bodies("loose").radius).max(), 1e-4)

    def test_settled_sample_rests(self):
        """Read in parallel, the sample does not fall any further: the mean energy of a grain stays below 1e-4 m g R, that of a
        fall through 1e-4 R."""
        bodies = self.bodies("settled")
        self.assertLess(bodies.deepest(), 0.02 * 0.01)
        case = merged(SOLVED, {
            "scene": {"bodies": "file", "bodies_file": self.runs["settled", 1].path("sample.h5")},
            "time": {"step": 1e-3, "steps": 50}, "output": {"directory": "out", "every": 0}})
        del case["sample"]
        os.makedirs(self.here("rest"), exist_ok=True)
        write(self.here("rest", "case.nml"), namelist(case))
        run = gravier("case.nml", ranks=2, directory=self.here("rest"))
        self.assert_status(run, 0)
        energy = run.history("out")["kinetic_energy"] / np.sum(bodies.mass) / (9.81 * 0.01)
        self.assertLess(energy.max(), 1e-4)
        moved = run.results("out")["/steps/50/bodies/position"] - bodies.position
        self.assertLess(np.abs(moved).max(), 0.1 * 0.01)

    def test_compacted_sample_bears_the_pressure(self):
        """Each plane bears the pressure within 5 %, and the planes do not move on where another run pushes them."""
        bodies = self.bodies("compacted")
        self.assertLess(bodies.deepest(), 0.02 * 0.01)
        for name, planes in (("compacted", 4), ("pressed", 4)):
            shares = [float(text) for text in re.findall(r"^pressure +([\d.]+) of", self.runs[name, 1].stdout, re.M)]
            self.assertEqual(len(shares), planes)
            self.assertLess(np.abs(np.array(shares) - 1.0).max(), 0.05, name)
        self.assertLess(self.bodies("pressed").deepest(), 0.02 * 0.01)
        size = bodies.point.max(axis=0)
        filled = np.sum(volume(2, bodies.radius)) / np.prod(size)
        # random close packing of disks is 0.82 to 0.84 without the room that planes take
        self.assertGreater(filled, 0.77)
        stated = float(re.search(r"solid fraction ([\d.]+)", self.runs["compacted", 1].stdout)[1])
        self.assertAlmostEqual(stated, filled, delta=1e-4)
        wide, diameters = re.search(r"^size +(.*) m, (.*) mean diameters$", self.runs["compacted", 1].stdout, re.M).groups()
        np.testing.assert_allclose([float(text) for text in wide.split(" x ")], size, rtol=1e-3)
        np.testing.assert_allclose([float(text) for text in diameters.split(" x ")], size / (2 * bodies.radius.mean()), atol=0.06)
        self.check_pushed(bodies, size)

    def check_pushed(self, bodies, size):
        """Without its planes, between planes of the input file that have the mass and the load of the preparation."""
        directory = self.here("pushed")
        os.makedirs(directory, exist_ok=True)
        with open(os.path.join(directory, "bodies.csv"), "w", encoding="ascii") as file:
            file.write("id,x,y,radius\n")
            for k, (x, y) in enumerate(bodies.position):
                file.write(f"{k + 1},{float(x)!r},{float(y)!r},{float(bodies.radius[k])!r}\n")
        case = merged(SOLVED, {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "friction": 0.0, "gravity": [0.0, 0.0]},
            "time": {"step": 1e-3, "steps": 50}, "output": {"directory": "out", "every": 0}})
        del case["sample"]
        text = namelist(case)
        for axis, force in ((0, PRESSURE * size[1]), (1, PRESSURE * size[0])):
            normal, push = [0.0, 0.0], [0.0, 0.0]
            normal[axis], push[axis] = 1.0, -force
            text += namelist({"boundary": {"shape": "plane", "normal": normal, "point": [0.0, 0.0]}})
            text += namelist({"boundary": {
                "shape": "plane", "normal": [-c for c in normal], "point": [float(c) for c in size], "mass": 10.0,
                "free": [axis == 0, axis == 1], "force": [float(c) for c in push]}})
        write(os.path.join(directory, "case.nml"), text)
        run = gravier("case.nml", ranks=2, directory=directory)
        self.assert_status(run, 0)
        moved = run.results("out")["/steps/50/bodies/position"] - bodies.position
        # 1000 N on 10 kg alone would move a plane by 0.12 m in 50 ms
        self.assertLess(np.abs(moved).max(), 0.1 * 0.01)

    def test_program_starts_from_the_same_sample(self):
        """gravier with bodies = 'sample' has the grains of the bodies file."""
        os.makedirs(self.here("direct"), exist_ok=True)
        write(self.here("direct", "case.nml"), namelist(merged(CASES["loose"], {"output": {"directory": "out"}})))
        run = gravier("case.nml", ranks=2, directory=self.here("direct"))
        self.assert_status(run, 0)
        bodies, results = self.bodies("loose"), run.results("out")
        np.testing.assert_array_equal(results["/steps/0/bodies/position"], bodies.position)
        np.testing.assert_array_equal(results["/steps/0/bodies/radius"], bodies.radius)

    def test_not_at_rest(self):
        """A sample that gives up says so, is written with its velocities, and ends with status 3."""
        run = make(merged(CASES["settled"], {"sample": {"max_steps": 30}}), self.here("falling"))
        self.assert_status(run, 3)
        self.assertIn("NOT AT REST after 30 steps", run.stdout)
        # 30 ms of free fall for the grains that touch nothing
        self.assertAlmostEqual(Bodies(run.path("sample.h5")).velocity[:, 1].min(), -9.81 * 0.03, delta=1e-12)
        run = make(merged(CASES["compacted"], {"sample": {"max_steps": 25}}), self.here("waiting"))
        self.assert_status(run, 3)
        run = make(merged(CASES["settled"], {"solver": {"max_iterations": 10, "tolerance": 1e-12, "on_failure": "discard"}}),
                   self.here("failing"))
        self.assert_status(run, 3)
        self.assertFalse(os.path.exists(run.path("sample.h5")))

    def test_words_of_the_command_line(self):
        for arguments, status, text in ((("--help",), 0, "usage: gravier_sample"), (("--version",), 0, "Gravier "),
                                        ((), 2, "expected one input file"), (("--check",), 2, "unknown option --check"),
                                        (("a", "b"), 2, "expected one input file"), (("none.nml",), 2, "none.nml")):
            run = gravier(*arguments, ranks=2, directory=self.scratch, program="gravier_sample")
            self.assert_status(run, status)
            self.assertIn(text, run.stderr if status else run.stdout)
            self.assertLessEqual(len(run.stderr.splitlines()), 1)

    def test_refused(self):
        """One line, status 2, no bodies file."""
        lattice = {"scene": {"bodies": "lattice", "lattice_count": [3, 3], "radius_min": 0.1, "radius_max": 0.1}}
        refused = {
            "lattice": (merged(BASE, lattice) | {"sample": {}}, "bodies = 'lattice': expected 'sample'"),
            "ending": (merged(BASE, {"sample": {"file": "sample.csv"}}), "&sample file = 'sample.csv': expected a name with"),
            "dense": (merged(BASE, {"sample": {"solid_fraction": 0.59, "count": 100}}), "solid fraction"),
            "narrow": (merged(BASE, {"sample": {"box": 0.01}}), "&sample box"),
            "nowhere": (merged(BASE, {"sample": {"file": "sample.nml/sample.h5"}}), "expected a file in a directory"),
            "table": (merged(CASES["table"], {"sample": {"radius_table": "missing.csv"}}), "missing.csv"),
            "closed": (merged(CASES["periodic"], {"sample": {"preparation": "compacted", "pressure": 1.0}}),
                       "&sample preparation = 'compacted': expected another one where every axis is periodic, or a run with &scene cell_pressure from "
                       "a sample with preparation = 'none', which compacts the cell, and &output final_bodies, which writes it"),
            "tilted": (merged(CASES["settled"], {"scene": {"gravity_table": "gravity.csv"}}),
                       "&scene gravity_table = 'gravity.csv': expected none where preparation = 'settled'"),
        }
        del refused["lattice"][0]["sample"]
        for name, (case, text) in refused.items():
            with self.subTest(name):
                run = make(case, self.here("refused-" + name), ranks=2)
                self.assert_status(run, 2)
                self.assertIn(text, run.stderr)
                self.assertEqual(len(run.stderr.splitlines()), 1)
                self.assertFalse(any(file.endswith((".h5", ".log")) for file in os.listdir(run.directory)))

    def test_files_of_others_stay(self):
        """A sample and its log are replaced, and an empty file; no other file is, whichever of the two names it has."""
        small = merged(BASE, {"sample": {"count": 60}})
        directory = self.here("others")
        for _ in range(2):
            self.assert_status(make(small, directory, ranks=2), 0)
        own = sorted(name for name in os.listdir(directory) if name.startswith("sample.") and not name.endswith(".nml"))
        self.assertEqual(own, ["sample.h5", "sample.log"])
        # a file without the attribute, the bodies file of another program, and what is no HDF5 at all
        for name, made_by in (("sample.h5", None), ("sample.h5", "gravier"), ("sample.h5", ""), ("sample.log", "")):
            with self.subTest(name, made_by=made_by):
                path = os.path.join(directory, name)
                if made_by == "":
                    write(path, "mine\n")
                else:
                    with h5py.File(path, "w") as file:
                        file["mine"] = [1.0, 2.0]
                        if made_by:
                            file.attrs["made_by"] = made_by
                with open(path, "rb") as file:
                    before = file.read()
                run = make(small, directory)
                self.assert_status(run, 2)
                self.assertIn("of another kind or origin, which is not replaced; expected the name of no file", run.stderr)
                self.assertIn(f"there is a file {name} ", run.stderr)
                self.assertEqual(len(run.stderr.splitlines()), 1)
                with open(path, "rb") as file:
                    self.assertEqual(file.read(), before)
                write(path, "")
                self.assert_status(make(small, directory), 0)


if __name__ == "__main__":
    unittest.main()
