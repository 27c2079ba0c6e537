"""Scenes whose bodies have shapes: what files say of them, what is refused in one line, and what runs give back: final_bodies.h5 to the
bit on any number of ranks, restarts of the same library only."""
import os
import shutil
import sys
import unittest

import h5py
import matplotlib.image
import numpy as np

from gravier_runs import SOURCE, RunTestCase, contents, differences, each, gravier, merged, namelist, run_case, write

import gravier as package
from gravier.shapes import axes_of

sys.path.insert(0, os.path.join(SOURCE, "drivers/plot"))
import gravier_plot  # noqa: E402
import packing_picture  # noqa: E402

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
# a tetrahedron that is written askew, a box, a cluster, a capsule
SOLIDS = """shape askew
hull 0 0 0  0.2 0.05 0  0.05 0.25 0.1
     0.1 0.1 0.3
shape box
box 0.2 0.1 0.3
shape cross
box 0.3 0.1 0.1
box 0.1 0.1 0.1  0 0.1 0
box 0.1 0.1 0.1  0 -0.1 0
shape pill
capsule 0 0 -0.1  0 0 0.1  0.05
"""
CORNERS = np.array([[0.0, 0.0, 0.0], [0.2, 0.05, 0.0], [0.05, 0.25, 0.1], [0.1, 0.1, 0.3]])
SOLID_BODIES = """id,x,y,z,shape,scale,radius,qw,qx,qy,qz
1,0,0,0,askew,,,,,,
2,1,0,0,askew,2,,0.5,0.5,0.5,0.5
3,2,0,0,box,,,1,0.1,0.2,0.3
4,3,0,0,cross,0.5,,0,1,0,0
5,4,0,0,pill,,,3,0,-4,0
6,5,0,0,,,0.1,1,0,0,1
"""
SOLID_CASE = merged(CASE, {"scene": {"dimension": 3, "gravity": [0.0, 0.0, 0.0]}})


def turned(point, angle):
    c, s = np.cos(angle), np.sin(angle)
    return point @ np.array([[c, s], [-s, c]])


def area(polygon):
    x, y = np.asarray(polygon).T
    return 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))


def volume(polygons):
    """Within a closed surface."""
    return sum(np.dot(points[0], np.cross(points[k], points[k + 1])) for points in polygons for k in range(1, len(points) - 1)) / 6.0


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
     ('a.shapes: line 9: "box": expected shape, rounding, polygon, disk, capsule, regular or random_hull',)),
    ("shapes too large to reckon with", {}, SHAPES + "shape moon\ncapsule -1e30 0 1e30 0 1e30\n", BODIES,
     ("a.shapes: line 10: shape moon: a size of 2.00000000E+30", "expected a number from 1e-30 to 1e30")),
    ("an unknown shape", {}, SHAPES, changed(BODIES, "pill", "pile"), ("bodies.csv: line 5: column shape", '"pile"', "brick, ell, pill")),
    ("shapes without a library", {"scene": {"shapes": None}}, SHAPES, BODIES, ("bodies.csv: column scale is unknown in 2D",)),
    ("a library without a bodies file", {"scene": {"bodies": "lattice", "bodies_file": None, "lattice_count": [2, 2], "radius_min": 0.01,
                                                  "radius_max": 0.01}}, SHAPES, BODIES, ("shapes belongs to bodies = 'file', 'sample' or 'none'",)),
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

    def test_there_and_back_of_a_run(self):
        """Bodies that have fallen onto each other: what two ranks leave is what one leaves, and is where the next run begins."""
        rows = [f"{k + 1},{0.12 * (k % 4) + 0.07 * (k // 4 % 2)},{0.12 + 0.13 * (k // 4)},0,0,{('brick', 'ell', 'pill', '')[k % 4]},"
                f"{'' if k % 4 == 3 else 0.2 + 0.003 * k},{0.7 * k},{0.04 if k % 4 == 3 else ''},," for k in range(16)]
        bodies = "\n".join([BODIES.splitlines()[0], *rows, "99,0,0,,,plane,,,,0,1", ""])
        case = merged(CASE, {"time": {"steps": 250}, "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 2}, "output": {"every": 250}})
        runs = [run_case(case, ranks, self.prepare(f"fall {ranks}", bodies=bodies)) for ranks in (1, 2)]
        for run in runs:
            self.assert_status(run, 0)
        self.assertGreater(runs[0].history()["contacts"][-1], 10)
        first, second = (contents(run.path("results", "final_bodies.h5")) for run in runs)
        self.assertEqual(differences(first, second), [])
        found = runs[0].results()
        for name in ("radius", "shape", "orientation", "position", "velocity", "mass"):
            self.assertEqual(first[f"/bodies/{name}"].ravel().tolist(), found[f"/steps/250/bodies/{name}"].ravel().tolist(), name)
        directory = self.prepare("rise")
        shutil.copy(runs[0].path("results", "final_bodies.h5"), os.path.join(directory, "bodies.h5"))
        again = run_case(merged(CASE, {"scene": {"bodies_file": "bodies.h5"}}), 2, directory)
        self.assert_status(again, 0)
        self.assertEqual(differences(first, contents(again.path("results", "final_bodies.h5"))), [])

    def test_outlines(self):
        """The package gives the polygons of the file of shapes, about the centre of mass, turned and scaled; their area gives the mass."""
        run = run_case(CASE, 1, self.prepare("outlines"))
        self.assert_status(run, 0)
        results = package.Run(run.path("results"))
        shapes, bodies, outlines = results.shapes(), results.bodies(), results.outlines()
        self.assertEqual([shape.name for shape in shapes], ["brick", "ell", "pill"])
        self.assertEqual([len(shape.pieces) for shape in shapes], [1, 2, 1])
        self.assertAlmostEqual(shapes[1].pieces[0].rounding * shapes[1].size, 0.002, places=15)
        np.testing.assert_allclose(shapes[0].inertia[0] * shapes[0].size**2, (0.4**2 + 0.2**2) / 12.0, rtol=1e-13)
        brick = 0.7 * np.array([[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]])
        np.testing.assert_allclose(outlines[0][0], [0.1, 1.0] + turned(brick, 0.5), atol=1e-14)
        ell = np.array([[0.0, 0.1], [0.1, 0.1], [0.1, 0.2], [0.0, 0.2]]) - [0.25 / 3.0, 0.25 / 3.0]
        np.testing.assert_allclose(outlines[1][1], [1.1, 1.0] + turned(ell, 1.5), atol=1e-14)
        areas = np.array([sum(area(polygon) for polygon in polygons) for polygons in outlines])
        # circles have 48 sides
        np.testing.assert_allclose(2500.0 * areas, bodies.mass, rtol=4e-3)
        np.testing.assert_allclose(2500.0 * areas[[0, 1, 4]], bodies.mass[[0, 1, 4]], rtol=1e-13)
        for centre, radius, polygons in zip(bodies.position, bodies.radius, outlines):
            self.assertLess(np.linalg.norm(np.concatenate(polygons) - centre, axis=1).max(), radius * (1.0 + 1e-14))

    def test_solids(self):
        """In space: corners are where the file of shapes has them, about the centre of mass, turned by the quaternion of the table; what
        a run leaves is where the next one begins, to the bit; surfaces are closed and hold the volume of the mass."""
        directory = self.prepare("solids", SOLIDS, SOLID_BODIES)
        run = run_case(SOLID_CASE, 1, directory)
        self.assert_status(run, 0)
        results = package.Run(run.path("results"))
        bodies, outlines = results.bodies(), results.outlines()
        corners = CORNERS - CORNERS.mean(axis=0)
        for k, expected in ((0, corners), (1, 2.0 * corners[:, [2, 0, 1]] + [1.0, 0.0, 0.0])):
            found = np.unique(np.concatenate(outlines[k]).round(12), axis=0)
            np.testing.assert_allclose(found, np.unique(expected.round(12), axis=0), atol=1e-11)
        volumes = np.array([volume([points - centre for points in polygons]) for centre, polygons in zip(bodies.position, outlines)])
        np.testing.assert_allclose(2500.0 * volumes[:4], bodies.mass[:4], rtol=1e-12)
        np.testing.assert_allclose(2500.0 * volumes[4:], bodies.mass[4:], rtol=0.07)
        np.testing.assert_allclose(np.linalg.norm(bodies.orientation, axis=1), 1.0, rtol=1e-15)
        expected = contents(run.path("results", "final_bodies.h5"))
        for ranks in (1, 2):
            directory = self.prepare(f"solids back {ranks}", SOLIDS, SOLID_BODIES)
            shutil.copy(run.path("results", "final_bodies.h5"), os.path.join(directory, "bodies.h5"))
            again = run_case(merged(SOLID_CASE, {"scene": {"bodies_file": "bodies.h5"}}), ranks, directory)
            self.assert_status(again, 0)
            self.assertEqual(differences(expected, contents(again.path("results", "final_bodies.h5"))), [])
        # by hand, in the axes of the file of shapes
        with h5py.File(self.here("solids back 1", "bodies.h5"), "r+") as file:
            file["bodies/orientation"].attrs["axes"] = "written"
            file["bodies/orientation"].attrs.pop("checksum", None)
            file["bodies/orientation"][1] = [0.5, 0.5, 0.5, 0.5]
        by_hand = merged(SOLID_CASE, {"scene": {"bodies_file": "bodies.h5"}})
        again = run_case(by_hand, 1, self.here("solids back 1"))
        self.assert_status(again, 0)
        for radius, text in ((-3.0, "-3.00000000E+00"), (float("nan"), "NaN")):
            with h5py.File(self.here("solids back 1", "bodies.h5"), "r+") as file:
                file.pop("bodies/scale", None)
                file["bodies/radius"][0] = radius
                file["bodies/radius"].attrs.pop("checksum", None)
                number = file["bodies/id"][0]
            self.assert_refused(run_case(by_hand, 1, self.here("solids back 1")),
                                (f"bodies.h5: /bodies/radius: id {number}: {text}, but 0 or a number above 0 was expected",))
        np.testing.assert_allclose(package.Run(again.path("results")).bodies().orientation[1], bodies.orientation[1], atol=1e-15)

    def test_pictures(self):
        """gravier_plot fills what a body covers, and nothing beside it; pictures of both dimensions are drawn."""
        run = run_case(merged(CASE, {"output": {"vtk": True}}), 1, self.prepare("pictures"))
        self.assert_status(run, 0)
        results = package.Run(run.path("results"))
        for colour in ("speed", "radius", "subdomain", "none"):
            options = gravier_plot.parse(["packing", run.path("results"), "--colour", colour])
            options.chains = False
            figure = packing_picture.draw_packing(results, None, options)
            drawn = next(one for one in figure.axes[0].collections if isinstance(one, packing_picture.PolyCollection))
            polygons = [path.vertices[:-1] for path in drawn.get_paths()]
            expected = [points for outline in results.outlines() for points in outline]
            self.assertEqual(len(polygons), len(expected))
            for found, points in zip(polygons, expected):
                np.testing.assert_array_equal(found, points)
            if colour == "speed":
                # a colour for each polygon: both pieces of body 2 have that of body 2
                speeds = np.linalg.norm(results.bodies().velocity, axis=1)
                values = np.asarray(drawn.get_array())
                np.testing.assert_allclose(values / values[0], (speeds / speeds[0])[[0, 1, 1, 2, 3, 4]])
            gravier_plot.plt.close(figure)
        solid = run_case(SOLID_CASE, 1, self.prepare("solid pictures", SOLIDS, SOLID_BODIES))
        for one in (run, solid):
            gravier_plot.main(["packing", one.path("results"), "--out", one.path("picture.png")])
            self.assertGreater(matplotlib.image.imread(one.path("picture.png"))[..., :3].std(), 0.01)
            gravier_plot.main(["packing", one.path("results", "final_bodies.h5"), "--out", one.path("sample.png")])

    def test_contact_points(self):
        """Contacts of a brick at rest on the ground are at its lower corners, each with half its weight."""
        bodies = "id,x,y,shape,nx,ny\n1,0,0.1,brick,,\n9,0,0,plane,0,1\n"
        run = run_case(merged(CASE, {"time": {"steps": 30}}), 1, self.prepare("points", bodies=bodies))
        self.assert_status(run, 0)
        results = package.Run(run.path("results"))
        contacts = results.contacts()
        place = contacts.point[np.argsort(contacts.point[:, 0])]
        np.testing.assert_allclose(place, [[-0.2, 0.0], [0.2, 0.0]], atol=1e-4)
        segments, force = results.chains()
        np.testing.assert_allclose(segments[:, 0], [[0.0, 0.1]] * 2, atol=1e-4)
        weight = 2500.0 * 0.08 * 9.81
        np.testing.assert_allclose(force, weight / 2.0, rtol=2e-2)
        # sum of f l/(d V), by hand
        np.testing.assert_allclose(results.pressure(), weight * 0.1 / (2.0 * 0.08), rtol=2e-2)

    def test_inertia(self):
        """The kinetic energy of bodies that fly and turn is that of their masses and moments of inertia, scaled as they are."""
        bodies = "id,x,y,vx,omega,shape,scale\n1,0,0,0,3,brick,0.5\n2,1,0,2,0,pill,\n3,2,0,0,7,pill,2\n"
        run = run_case(merged(CASE, {"scene": {"gravity": [0.0, 0.0, 0.0]}, "time": {"steps": 1}}), 1, self.prepare("inertia", bodies=bodies))
        self.assert_status(run, 0)
        mass = 2500.0 * np.array([0.2 * 0.1, 0.02 + np.pi * 0.05**2, 4.0 * (0.02 + np.pi * 0.05**2)])
        # a rectangle and two half disks, whose centres of mass are 4 r/(3 pi) from their flat sides
        r, length = 0.1, 0.4
        pill = 2500.0 * (2.0 * r * length * (length**2 + 4.0 * r**2) / 12.0 + np.pi * r**4 / 2.0 + np.pi * r**2 * length**2 / 4.0
                         + 4.0 * r**3 * length / 3.0)
        expected = 0.5 * (mass[0] * (0.2**2 + 0.1**2) / 12.0 * 3.0**2 + mass[1] * 2.0**2 + pill * 7.0**2)
        np.testing.assert_allclose(run.history()["kinetic_energy"], expected, rtol=1e-12)
        # in space about each of the axes of a box, turned somehow
        for axis, moment in enumerate((0.1**2 + 0.3**2, 0.2**2 + 0.3**2, 0.2**2 + 0.1**2)):
            spin = axes_of(np.array([[0.5, 0.1, 0.7, 0.5]]))[0][:, axis]
            bodies = f"id,x,y,z,shape,scale,qw,qx,qy,qz,wx,wy,wz\n1,0,0,0,box,2,0.5,0.1,0.7,0.5,{','.join(map(str, spin))}\n"
            run = run_case(merged(SOLID_CASE, {"time": {"steps": 1}}), 1, self.prepare(f"inertia {axis}", SOLIDS, bodies))
            self.assert_status(run, 0)
            np.testing.assert_allclose(run.history()["kinetic_energy"], 0.5 * 2500.0 * 0.006 * 8.0 * moment * 4.0 / 12.0, rtol=1e-9)

    def test_thin_bodies(self):
        """Slabs and planks that are too fast for their thickness are counted and warned of, as is a slab that a spring lets through."""
        head = "id,x,y,z,shape,vz,radius\n1,0,0,0,slab,0,\n2,0,0,0.11,slab,"
        flat = "id,x,y,shape,vy,radius\n1,0,0,slab,0,\n2,0,0.05,slab,-3,\n"
        solid = {"scene": {"dimension": 3, "friction": 0.0, "gravity": [0, 0, 0]}}
        spring = {"scene": {"friction": 0.0, "gravity": [0, 0]}, "material": [{"name": "m"}],
                  "law": [{"materials": "m", "kind": "elastic", "normal_stiffness": 1e5}]}
        fast = "in step 1 the way of 1 grain, of an end that turns, or of a boundary towards it, is longer than half of the thickness"
        deep = "by a quarter of a thickness and more"
        for name, shape, bodies, more, steps, words in (
                ("slab", "box 1 1 0.01", head + "-15,\n", merged(solid, {"scene": {"restitution": 0.5}}), (1e-3, 20), (fast, deep)),
                ("plank", "box 0.12 0.024 0.008", head + "-4,\n", solid, (5e-3, 15), (fast, deep)),
                ("slow plank", "box 0.12 0.024 0.008", head + "-0.7,\n", solid, (5e-3, 15), ()),
                ("spring", "polygon -0.5 -0.005  0.5 -0.005  0.5 0.005  -0.5 0.005", flat, spring, (1e-4, 600), (deep,))):
            with self.subTest(name):
                directory = self.prepare(f"thin {name}", f"shape slab\n{shape}\n", bodies)
                case = merged(merged(CASE, more), {"time": {"step": steps[0], "steps": steps[1]}})
                run = run_case(case, 1, directory)
                self.assert_status(run, 0)
                self.assertEqual(run.history()["fast"].tolist(), [float(fast in words)] * steps[1])
                for word in (fast, deep):
                    self.assertEqual(word in run.stdout, word in words, word)
                check = gravier("--check", "case.nml", directory=directory)
                self.assertEqual(fast in check.stdout, fast in words)

    def test_brick_over_a_row_of_bricks(self):
        """A brick with restitution and without friction keeps its velocity over the joints of bricks that are glued: it comes near their sides, which
        others hide, and does not meet them. A look ahead stopped it there."""
        shape = "shape brick\n{}polygon -0.025 -0.02  0.025 -0.02  0.025 0.02  -0.025 0.02\n"
        rows = "id,x,y,vx,vy,omega,shape,group\n1,0.06,0.02,1,0,0,brick,0\n" + "".join(f"{k + 2},{0.05 * k},-0.02,0,0,0,brick,1\n" for k in range(16))
        for rounding, restitution, step in (("", 0.5, 4e-3), ("", 1.0, 1e-3), ("rounding 0.001\n", 0.1, 2e-3)):
            with self.subTest(rounding=rounding, restitution=restitution):
                directory = self.prepare(f"row {len(rounding)} {restitution}", shape.format(rounding), rows)
                run = run_case(merged(CASE, {"scene": {"restitution": restitution, "friction": 0.0, "gravity": [0.0, -9.81]}, "time": {"step": step, "steps": int(0.5 / step)},
                                             "boundary": {"shape": "grains", "group": 1, "name": "row"}, "output": {"every": 0, "energy": True}}), 1, directory)
                self.assert_status(run, 0)
                energy = run.history()["kinetic_energy"]
                self.assertGreater(energy[-1], 0.99 * energy[0])

    def test_soft_balls(self):
        """A disk that a soft spring lets through a segment, or through another disk, is warned of, and its run is in doubt; a plane stops it, and no harder
        spring lets it in."""
        soft = {"scene": {"gravity": [0.0, 0.0]}, "material": [{"name": "m"}],
                "law": [{"materials": "m", "kind": "elastic", "normal_stiffness": 1e3}], "time": {"step": 1e-4, "steps": 400}, "output": {"every": 0}}
        ground = {"segment": {"shape": "segment", "point": [1.0, 0.0], "end": [-1.0, 0.0]}, "plane": {"shape": "plane", "normal": [0.0, 1.0]}}
        words = "1 contact overlaps by a quarter of a thickness and more in step "
        for name, more, told in (("segment", {}, True), ("plane", {}, False), ("pair", {}, True), ("hard", {"law": [{**soft["law"][0], "normal_stiffness": 1e7}]}, False)):
            bodies = "id,x,y,radius,vy\n1,0,0.051,0.05,-3\n" + ("2,0,-0.05,0.05,0\n" if name in ("pair", "hard") else "")
            case = merged(merged(CASE, soft), {**more, "boundary": [{"material": "m", **ground[name]}] if name in ground else []})
            case["scene"].pop("shapes", None)
            directory = self.here(f"soft {name}")
            os.makedirs(directory)
            write(os.path.join(directory, case["scene"]["bodies_file"]), bodies)
            run = run_case(case, 1, directory)
            self.assert_status(run, 0)
            self.assertEqual(words in run.stdout, told, name)
            results = package.Run(run.path("results"))
            self.assertEqual(results.verdict(), "converged with doubts" if told else "converged", name)
            self.assertEqual("bodies were pressed into each other by a quarter of a thickness and more, and may have come out on the other side"
                             in results.doubts(), told, name)

    def test_pressure_across_a_period(self):
        """Three bricks stacked across the side of a period have the pressures and the chains that they have in its middle. Each contact has
        two segments but for those with the ground."""
        shape = "shape brick\npolygon -0.01 -0.006 0.01 -0.006 0.01 0.006 -0.01 0.006\n"
        for key, more in (("period", [0.06, 0.0]), ("period(1)", 0.06)):
            found = []
            for shift in (0.0, 0.03):
                places = [(0.057 + shift) % 0.06, (0.003 + shift) % 0.06, (0.057 + shift) % 0.06]
                rows = "".join(f"{k + 1},{x!r},{0.006 + 0.012 * k!r},brick,,\n" for k, x in enumerate(places))
                directory = self.prepare(f"period {key} {shift}", shape, "id,x,y,shape,nx,ny\n" + rows + "4,0,0,plane,0,1\n")
                run = run_case(merged(CASE, {"scene": {key: more, "friction": 0.5, "gravity": [0.0, -9.81]}, "time": {"step": 1e-3, "steps": 20}, "output": {"every": 20, "contacts": True},
                                             "solver": {"accuracy": 1e-6, "tolerance": 1e-7}}), 1, directory)
                self.assert_status(run, 0)
                results = package.Run(run.path("results"))
                found.append(results.pressure())
                self.assertEqual(len(results.chains()[0]), 10)
            np.testing.assert_allclose(found[0], found[1], rtol=1e-4)
            np.testing.assert_allclose(found[0][2], found[0][0] / 5.0, rtol=1e-4)

    def test_ends_that_turn_fast(self):
        """A needle that turns by half a radian in a step passes through another one: it is counted and warned of; by 0.004 rad it is not."""
        needles = "id,x,y,shape,angle,omega,radius\n1,0,0,rod,-1.5,50,\n2,1.5,0,rod,0,0,\n"
        for step, counts in ((1e-2, True), (8e-5, False)):
            directory = self.prepare(f"needles {step}", "shape rod\nrounding 0.002\npolygon -1 -0.01 1 -0.01 1 0.01 -1 0.01\n", needles)
            run = run_case(merged(CASE, {"scene": {"gravity": [0, 0]}, "time": {"step": step, "steps": 5}}), 1, directory)
            self.assert_status(run, 0)
            self.assertEqual(run.history()["fast"].tolist(), [float(counts)] * 5)
            self.assertEqual("of an end that turns, or of a boundary towards it, is longer than half of the thickness" in run.stdout, counts)

    def test_thin_start(self):
        """What overlaps by more than half of the half thickness of a slab is refused."""
        bodies = "id,x,y,shape\n1,0,0,slab\n2,0,0.0{},slab\n"
        for height, status in (("08", 0), ("07", 2)):
            directory = self.prepare(f"thin start {height}", "shape slab\npolygon -0.5 -0.005  0.5 -0.005  0.5 0.005  -0.5 0.005\n",
                                     bodies.format(height))
            run = run_case(CASE, 1, directory)
            self.assert_status(run, status)
            if status == 2:
                self.assertIn("bodies 1 and 2 overlap by 60.0 % of half of the smaller thickness", run.stderr)

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
                self.assert_refused(run, ("case.nml: contents of a.shapes are not those with which results/checkpoint.h5 was written: expected the file as it was then",))


if __name__ == "__main__":
    unittest.main()
