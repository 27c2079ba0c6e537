"""Samples of grains with shapes: the same bytes on any number of ranks, shares, radii and masses as asked for, orientations that are all
as likely, grains that are clear of each other, settled and compacted samples that rest, and what is refused."""
import hashlib
import os
import re
import unittest

import h5py
import numpy as np

from gravier_runs import SOME_RANKS, RunTestCase, each, gravier, merged, namelist, write

DENSITY = 2000.0
SOLIDS = """shape die
cube 0.5
shape stone
random_hull 3 12 1.2 1 0.8
shape pill
capsule -1 0 0  1 0 0  0.5
shape spare
tetrahedron 1
"""
FLATS = """shape tile
regular 5 2
shape chip
random_hull 7 6 1.5 1
shape ell
polygon 0 0 2 0 2 1 0 1
polygon 0 1 1 1 1 2 0 2
"""
SPACE = {
    "scene": {"dimension": 3, "bodies": "sample", "density": DENSITY, "shapes": "a.shapes", "friction": 0.4},
    "sample": {"count": 800, "box": [0.3, 0.3], "radii": "uniform", "radius_min": 0.008, "radius_max": 0.012, "file": "sample.h5",
               "grain_shapes": "die, pill, stone, sphere", "grain_shares": [4.0, 2.0, 1.0, 1.0]},
    "time": {"step": 1e-3, "steps": 0},
    "solver": {"method": "nscdd", "tolerance": 1e-3, "max_iterations": 3000},
    "decomposition": {"subdomains": 4, "repartition_every": 100},
}
FEW = {"sample": {"count": 60, "box": [0.08, 0.08], "max_steps": 5000}}
PLANE = merged(SPACE, {"scene": {"dimension": 2}, "sample": {"count": 100, "box": 0.25, "max_steps": 5000, "preparation": "settled",
                                                            "grain_shapes": None, "grain_shares": None}})
CASES = {
    "loose": (SOLIDS, SPACE),
    "lattice": (SOLIDS, merged(SPACE, {"sample": {"arrangement": "lattice"}})),
    "settled": (SOLIDS, merged(SPACE, FEW, {"sample": {"preparation": "settled"}})),
    # with twice this step lids trap overlaps of some packings, which then do not come to rest: doc/samples.md
    "compacted": (SOLIDS, merged(SPACE, FEW, {"scene": {"friction": 0.0}, "time": {"step": 5e-4}, "sample": {
        "preparation": "compacted", "pressure": 1e4, "rest_tolerance": 1e-4}, "solver": {"method": "nlgs", "tolerance": 1e-5},
        "decomposition": {"subdomains": None, "repartition_every": None}})),
    "planar": (FLATS, PLANE),
}
#: steps of preparations that are compared on four ranks: grains meet, and subdomains are cut anew at step 100
BEGINNING = {"sample": {"max_steps": 120}}
CASES.update({f"{name}, beginning": (CASES[name][0], merged(CASES[name][1], BEGINNING)) for name in ("settled", "planar")})
#: numbers of ranks by case: a preparation to its end is compared on two, and so is the one in a single subdomain
RANKS = {name: SOME_RANKS for name in CASES} | {"planar, beginning": (1, 2, 4)} | {name: (1, 2) for name in ("settled", "compacted", "planar")}


def make(shapes, case, directory, ranks=1):
    os.makedirs(directory, exist_ok=True)
    write(os.path.join(directory, "a.shapes"), shapes)
    write(os.path.join(directory, "sample.nml"), namelist(case))
    return gravier("sample.nml", ranks=ranks, directory=directory, program="gravier_sample")


def bodies(run):
    """What stands below /bodies, and the names of the shapes."""
    with h5py.File(run.path("sample.h5")) as file:
        names = file["bodies/shape"].attrs["names"]
        found = {name: values[()] for name, values in file["bodies"].items()}
    return found, (names.decode() if isinstance(names, bytes) else str(names)).strip().split(",")


class ShapedSamples(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        jobs = [(name, ranks) for name in CASES for ranks in RANKS[name]]
        runs = each(lambda name, ranks: make(*CASES[name], os.path.join(cls.scratch, f"{name}-{ranks}"), ranks), jobs)
        cls.runs = dict(zip(jobs, runs))

    def test_same_bytes_on_any_ranks(self):
        for name in CASES:
            digests = set()
            for ranks in RANKS[name]:
                self.assert_status(self.runs[name, ranks], 3 if name.endswith("beginning") else 0)
                with open(self.runs[name, ranks].path("sample.h5"), "rb") as file:
                    digests.add(hashlib.sha256(file.read()).hexdigest())
            self.assertEqual(len(digests), 1, name)

    def test_shares(self):
        """Each share within four standard deviations; the shape that is not named does not appear."""
        found, names = bodies(self.runs["loose", 1])
        self.assertEqual(names, ["die", "stone", "pill", "spare"])
        for number, share in ((1, 4 / 8), (3, 2 / 8), (2, 1 / 8), (0, 1 / 8), (4, 0.0)):
            self.assertLessEqual(abs(np.mean(found["shape"] == number) - share), 4 * np.sqrt(share * (1 - share) / 800), number)
        found, names = bodies(self.runs["planar", 1])
        self.assertEqual(set(found["shape"]), {1, 2, 3})

    def test_radii_and_masses(self):
        """Radii are those of the balls that hold the grains, whatever the lengths in the file of shapes; volumes follow from them."""
        found, _ = bodies(self.runs["loose", 1])
        self.assertTrue(np.all((found["radius"] >= 0.008) & (found["radius"] <= 0.012)))
        die, pill, ball = (found["shape"] == number for number in (1, 3, 0))
        np.testing.assert_allclose(found["mass"][die], DENSITY * 8 / 3**1.5 * found["radius"][die]**3, rtol=1e-12)
        # size 1.5: a cylinder of length 2 and radius 0.5, and a ball
        np.testing.assert_allclose(found["mass"][pill], DENSITY * (0.5 * np.pi + np.pi / 6) * (found["radius"][pill] / 1.5)**3, rtol=1e-12)
        np.testing.assert_allclose(found["mass"][ball], DENSITY * 4 / 3 * np.pi * found["radius"][ball]**3, rtol=1e-12)
        np.testing.assert_allclose(found["scale"][die], found["radius"][die] / 0.5, rtol=1e-12)

    def test_orientations(self):
        """Unit quaternions, evenly over the sphere: the mean of q q^T is a quarter of the identity within five standard deviations; balls
        do not turn. Angles in the plane are even over the turn."""
        found, _ = bodies(self.runs["loose", 1])
        turn, ball = found["orientation"], found["shape"] == 0
        np.testing.assert_allclose(np.linalg.norm(turn, axis=1), 1.0, atol=1e-15)
        np.testing.assert_array_equal(turn[ball], [[1.0, 0.0, 0.0, 0.0]] * np.count_nonzero(ball))
        turn = turn[~ball]
        mean = turn.T @ turn / len(turn)
        # variances over the sphere: q1^2 has 1/8 - 1/16, q1 q2 has 1/24
        self.assertLess(np.abs(np.diag(mean) - 0.25).max(), 5 * np.sqrt(1 / 16 / len(turn)))
        self.assertLess(np.abs(mean - np.diag(np.diag(mean))).max(), 5 * np.sqrt(1 / 24 / len(turn)))
        self.assertEqual(len(np.unique(turn, axis=0)), len(turn))
        run = make(FLATS, merged(PLANE, {"sample": {"preparation": "none", "max_steps": None, "count": 1000}}), self.here("angles"))
        self.assert_status(run, 0)
        angle = bodies(run)[0]["orientation"].ravel()
        self.assertTrue(np.all((angle > 0) & (angle < 2 * np.pi)))
        for k in (1, 2, 3):
            self.assertLess(abs(np.mean(np.exp(1j * k * angle))), 5 / np.sqrt(1000))

    def test_grains_are_clear_of_each_other(self):
        for name in ("loose", "lattice"):
            found, _ = bodies(self.runs[name, 1])
            apart = np.linalg.norm(found["position"][:, None] - found["position"][None], axis=2)
            np.fill_diagonal(apart, 1.0)
            self.assertGreater((apart - found["radius"][:, None] - found["radius"]).min(), -1e-12, name)

    def test_seed(self):
        """Another seed gives other shapes and orientations."""
        first, _ = bodies(self.runs["loose", 1])
        run = make(SOLIDS, merged(SPACE, {"sample": {"seed": 2}}), self.here("seed"))
        self.assert_status(run, 0)
        other, _ = bodies(run)
        self.assertTrue(np.any(other["shape"] != first["shape"]))
        both = (other["shape"] > 0) & (first["shape"] > 0)
        self.assertTrue(np.all(np.any(other["orientation"][both] != first["orientation"][both], axis=1)))

    def test_prepared_samples_rest(self):
        """A run from the bodies file of a settled sample, with the same file of shapes, does not fall any further; planes bear the pressure
        on a compacted one."""
        for name in ("settled", "planar"):
            shapes, case = CASES[name]
            made = self.runs[name, 1]
            found, _ = bodies(made)
            case = merged(case, {"scene": {"bodies": "file", "bodies_file": made.path("sample.h5"), "shapes": "a.shapes"},
                                 "time": {"steps": 50}, "output": {"directory": "out", "every": 0}})
            del case["sample"]
            os.makedirs(self.here(name), exist_ok=True)
            write(self.here(name, "a.shapes"), shapes)
            write(self.here(name, "case.nml"), namelist(case))
            run = gravier("case.nml", ranks=2, directory=self.here(name))
            self.assert_status(run, 0)
            energy = run.history("out")["kinetic_energy"] / np.sum(found["mass"]) / (9.81 * 0.01)
            self.assertLess(energy.max(), 1e-4, name)
            moved = run.results("out")["/steps/50/bodies/position"] - found["position"]
            self.assertLess(np.abs(moved).max(), 0.1 * 0.01, name)
        shares = [float(text) for text in re.findall(r"^pressure +([\d.]+) of", self.runs["compacted", 1].stdout, re.M)]
        self.assertEqual(len(shares), 6)
        self.assertLess(np.abs(np.array(shares) - 1.0).max(), 0.05)

    def test_coordination(self):
        """The log of a sample has the pairs of bodies that bear forces, a grain, and in brackets the points in which these pairs touch."""
        for name, ranks in (("settled", 1), ("settled", 2), ("planar", 1), ("planar", 2)):
            made = self.runs[name, ranks]
            with h5py.File(made.path("sample.h5")) as file:
                grains, candidate, antagonist = len(file["bodies/id"]), file["contacts/candidate"][()], file["contacts/antagonist"][()]
            pairs, number = np.unique(np.stack([candidate, antagonist], axis=1), axis=0, return_counts=True)
            self.assertGreater(number.max(), 1)
            ends = 1 + (pairs[:, 1] > 0)
            said = re.search(r"^sample .* coordination ([\d.]+) \(([\d.]+) points of contact a grain\), largest", made.stdout, re.M)
            self.assertAlmostEqual(float(said[1]), ends.sum() / grains, delta=6e-4, msg=(name, ranks))
            self.assertAlmostEqual(float(said[2]), (ends * number).sum() / grains, delta=6e-4, msg=(name, ranks))

    def test_program_starts_from_the_same_sample(self):
        """gravier with bodies = 'sample' has the grains of the bodies file."""
        os.makedirs(self.here("direct"), exist_ok=True)
        write(self.here("direct", "a.shapes"), SOLIDS)
        write(self.here("direct", "case.nml"), namelist(merged(SPACE, {"output": {"directory": "out"}})))
        run = gravier("case.nml", ranks=2, directory=self.here("direct"))
        self.assert_status(run, 0)
        found, results = bodies(self.runs["loose", 1])[0], run.results("out")
        for name in ("position", "radius", "shape", "orientation"):
            np.testing.assert_array_equal(results["/steps/0/bodies/" + name], found[name])

    def test_refused(self):
        """One line, status 2, no bodies file."""
        refused = {
            "name": ({"sample": {"grain_shapes": "die, dice"}}, "&sample grain_shapes: 'dice': expected sphere or one of the shapes of "
                     "a.shapes, die, stone, pill, spare"),
            "disk": ({"sample": {"grain_shapes": "disk"}}, "&sample grain_shapes: 'disk': expected sphere or one of"),
            "no file": ({"scene": {"shapes": None}}, "&sample grain_shapes = 'die, pill, stone, sphere': expected shapes of &scene"),
            "missing": ({"scene": {"shapes": "b.shapes"}}, "b.shapes: cannot read this file"),
            "shares": ({"sample": {"grain_shapes": "die"}}, "expected a share above 0 for each of the 1 grain_shapes"),
            "turning": ({"scene": {"rotation": False}, "sample": {"preparation": "settled"}}, "&scene rotation = .false.: expected .true."),
        }
        for name, (change, text) in refused.items():
            with self.subTest(name):
                case = merged(SPACE, change)
                if name in ("name", "disk"):
                    del case["sample"]["grain_shares"]
                run = make(SOLIDS, case, self.here("refused-" + name), ranks=2)
                self.assert_status(run, 2)
                self.assertIn(text, run.stderr)
                self.assertEqual(len(run.stderr.splitlines()), 1)
                self.assertFalse(any(file.endswith((".h5", ".log")) for file in os.listdir(run.directory)))


if __name__ == "__main__":
    unittest.main()
