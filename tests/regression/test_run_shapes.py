"""Scenes whose bodies have shapes: what files say of them, what is refused in one line, and what runs give back: final_bodies.h5 to the
bit on any number of ranks, restarts of the same library only."""
import os
import shutil
import unittest

import h5py
import numpy as np

from gravier_runs import RunTestCase, contents, differences, each, gravier, merged, namelist, run_case, write

SHAPES = """# bodies of the plane
shape brick
polygon -0.2 -0.1  0.2 -0.1  0.2 0.1  -0.2 0.1
shape ell
rounding 0.002
polygon 0 0  0.2 0  0.2 0.1  0 0.1
polygon 0 0.1  0.1 0.1  0.1 0.2  0 0.2
shape pill
capsule -0.1 0  0.1 0  0.05
"""
BODIES = """id,x,y,vx,omega,shape,scale,angle,radius,nx,ny
1,0.1,1.0,0.1,0.3,brick,0.7,0.5,,,
2,1.1,1.0,0,0,ell,,1.5,,,
3,2.1,1.0,0,0,,,,0.1,,
4,3.1,1.0,0,-0.2,pill,1.3,-2,,,
5,4.1,1.0,0,0,brick,,,0.3,,
9,0,0,,,plane,,,,0,1
"""
CASE = {
    "scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "shapes": "a.shapes", "friction": 0.3},
    "time": {"step": 1e-3, "steps": 0},
    "output": {"directory": "results", "final_bodies": True},
}


def changed(text, old, new):
    assert old in text
    return text.replace(old, new)


# title, keys of the case, library (None: no file), bodies, what the message must have
REFUSED = [
    ("no library file", {}, None, BODIES, ("a.shapes: cannot read this file: No such file",)),
    ("an empty library", {}, "# none\n", BODIES, ("a.shapes: no shapes: expected shape and a name",)),
    ("not convex", {}, changed(SHAPES, "0.2 0  0.2 0.1  0 0.1", "0.2 0  0.05 0.05  0 0.1"), BODIES,
     ("a.shapes: line 6: shape ell: a polygon that is not convex",)),
    ("no area", {}, changed(SHAPES, "0.2 0  0.2 0.1  0 0.1", "0.2 0  0.3 0"), BODIES, ("a.shapes: line 6: shape ell: a polygon without area",)),
    ("too round", {}, changed(SHAPES, "rounding 0.002", "rounding 0.06"), BODIES, ("a.shapes: line 6: shape ell: a rounding of",)),
    ("named twice", {}, changed(SHAPES, "shape pill", "shape ell"), BODIES, ("a.shapes: line 8: shape ell: expected a name that no shape",)),
    ("a name with a meaning", {}, changed(SHAPES, "shape pill", "shape disk"), BODIES, ("a.shapes: line 8: shape disk: expected another name",)),
    ("pieces of space", {}, changed(SHAPES, "capsule -0.1 0  0.1 0  0.05", "box 1 1 1"), BODIES,
     ('a.shapes: line 9: "box": expected shape, rounding, polygon, disk or capsule',)),
    ("shapes too large to reckon with", {}, SHAPES + "shape moon\ncapsule -1e30 0 1e30 0 1e30\n", BODIES,
     ("a.shapes: line 10: shape moon: a size of 2.00000000E+030", "expected a number from 1e-30 to 1e30")),
    ("an unknown shape", {}, SHAPES, changed(BODIES, "pill", "pile"), ("bodies.csv: line 5: column shape", '"pile"', "brick, ell, pill")),
    ("shapes without a library", {"scene": {"shapes": None}}, SHAPES, BODIES, ("bodies.csv: column scale is unknown in 2D",)),
    ("a library without a bodies file", {"scene": {"bodies": "lattice", "bodies_file": None, "lattice_count": [2, 2], "radius_min": 0.01,
                                                  "radius_max": 0.01}}, SHAPES, BODIES, ("shapes belongs to bodies = 'file'",)),
    ("no rotation", {"scene": {"rotation": False}}, SHAPES, BODIES,
     ("case.nml: &scene rotation = .false.: expected .true. where bodies have shapes",)),
    ("rolling friction", {"scene": {"rolling_friction": 0.1}}, SHAPES, BODIES,
     ("case.nml: rolling or pivoting friction: expected 0 where bodies have shapes",)),
    ("rolling friction of walls", {"scene": {"wall_rolling_friction": 0.1}}, SHAPES, BODIES,
     ("case.nml: rolling or pivoting friction: expected 0 where bodies have shapes",)),
]


class Shapes(RunTestCase):

    def prepare(self, name, shapes=SHAPES, bodies=BODIES):
        directory = self.here(name)
        os.makedirs(directory, exist_ok=True)
        if shapes is not None:
            write(os.path.join(directory, "a.shapes"), shapes)
        write(os.path.join(directory, "bodies.csv"), bodies)
        return directory

    def test_refused(self):
        def refuse(k, ranks):
            _, keys, shapes, bodies, _ = REFUSED[k]
            return run_case(merged(CASE, keys), ranks, self.prepare(f"refused {k} {ranks}", shapes, bodies))
        jobs = [(k, ranks) for k in range(len(REFUSED)) for ranks in (1, 2)]
        for (k, ranks), run in zip(jobs, each(refuse, jobs, workers=6)):
            with self.subTest(REFUSED[k][0], ranks=ranks):
                self.assert_refused(run, REFUSED[k][-1])
                self.assertFalse(os.path.exists(run.path("results")))

    def assert_refused(self, run, words):
        self.assert_status(run, 2)
        self.assertEqual(run.stderr.count("\n"), 1, run.stderr)
        self.assertTrue(run.stderr.startswith("gravier: error: "), run.stderr)
        for word in words:
            self.assertIn(word, run.stderr)

    def test_what_is_read(self):
        """Radii, masses and orientations are those of the file and of the shapes in it."""
        run = run_case(CASE, 1, self.prepare("read"))
        self.assert_status(run, 0)
        found = run.results()
        np.testing.assert_array_equal(found["/steps/0/bodies/shape"], [1, 2, 0, 3, 1])
        np.testing.assert_array_equal(found["/steps/0/bodies/orientation"], [[0.5], [1.5], [0.0], [-2.0], [0.0]])
        ell = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.0, 0.1], [0.0, 0.2], [0.1, 0.2]])
        ell_centre = (0.02 * np.array([0.1, 0.05]) + 0.01 * np.array([0.05, 0.15])) / 0.03
        sizes = np.hypot(0.2, 0.1), np.linalg.norm(ell - ell_centre, axis=1).max(), 0.15
        np.testing.assert_allclose(found["/steps/0/bodies/radius"], [0.7 * sizes[0], sizes[1], 0.1, 1.3 * sizes[2], 0.3], rtol=1e-14)
        areas = np.array([0.08 * 0.7**2, 0.03, np.pi * 0.01, (0.02 + np.pi * 0.05**2) * 1.3**2, 0.08 * 0.09 / sizes[0]**2])
        np.testing.assert_allclose(found["/steps/0/bodies/mass"], 2500.0 * areas, rtol=1e-14)

    def test_there_and_back(self):
        """What a run leaves is where the next one begins, to the bit, on any number of ranks."""
        first = run_case(CASE, 1, self.prepare("there 1"))
        self.assert_status(first, 0)
        with h5py.File(first.path("results", "final_bodies.h5")) as file:
            self.assertEqual(file["bodies/shape"].attrs["names"].decode(), "brick,ell,pill")
            np.testing.assert_allclose(file["bodies/scale"][:2], [0.7, 1.0], rtol=1e-15)
        expected = contents(first.path("results", "final_bodies.h5"))
        for ranks in (1, 2):
            directory = self.prepare(f"back {ranks}")
            shutil.copy(first.path("results", "final_bodies.h5"), os.path.join(directory, "bodies.h5"))
            run = run_case(merged(CASE, {"scene": {"bodies_file": "bodies.h5"}}), ranks, directory)
            self.assert_status(run, 0)
            self.assertEqual(differences(expected, contents(run.path("results", "final_bodies.h5"))), [])

    def test_restart_of_another_library(self):
        """A library that changed in one number is another scene; one that is written in another way is the same."""
        case = merged(CASE, {"time": {"steps": 1}, "output": {"checkpoint_every": 1}})
        directory = self.prepare("restart")
        self.assert_status(run_case(case, 1, directory), 0)
        for text, status in ((changed(SHAPES, "0.002", "0.0020"), 0), (changed(SHAPES, "0.002", "0.0021"), 2),
                             (changed(SHAPES, "shape ell", "shape elk"), 2)):
            write(os.path.join(directory, "a.shapes"), text)
            write(os.path.join(directory, "bodies.csv"), BODIES.replace("ell", "elk") if "elk" in text else BODIES)
            write(os.path.join(directory, "case.nml"), namelist(case))
            run = gravier("--restart", "case.nml", ranks=2, directory=directory)
            if status == 0:
                self.assert_status(run, 0)
            else:
                self.assert_refused(run, ("case.nml: the scene is not that of", "contents of a.shapes, digest", "expected contents of a.shapes"))


if __name__ == "__main__":
    unittest.main()
