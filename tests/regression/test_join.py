"""Bodies added to a sample (gravier.join_bodies, gravier_join): numbers, columns, forces and walls of the file that it writes, overlaps that are
refused, tables in CSV as the program reads them, and a run that drops an intruder on a settled bed."""
import os
import unittest

import h5py
import numpy as np

from forked_scripts import script
from gravier_runs import ENVIRONMENT, SOURCE, RunTestCase, run_case, write
import gravier
import gravier.joined_bodies as joined
import gravier.linked_grains as linked
from gravier.bodies_table import BodiesTable

R = 0.01
#: a comment, blank lines, blanks, capitals, empty cells, planes among grains
TABLE = """# two disks between planes

ID, Y ,x,radius, vx,omega,Shape,nx,NY,group,material
7,0.5,0.25,0.1,,2.5,grain,,,0,
3,0.0,0.0,,,,plane,0,2,,

12,1.5,-0.25,0.2,-1.0e-1,,,,,0,1
4,0.0,2.0,0,0,0,Plane,-1,0,0,1
"""


class Tables(RunTestCase):

    def test_table(self):
        """A table in CSV has the numbers that the program finds in it, whether it is sealed or not."""
        os.makedirs(self.here("table"))
        path = write(self.here("table", "bodies.csv"), TABLE)
        run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "density": 100.0}, "time": {"step": 1e-3, "steps": 0},
                        "output": {"directory": "."}}, 1, self.here("table"))
        self.assert_status(run, 0)
        known = gravier.Run(self.here("table"))
        for sealed in (False, True):
            if sealed:
                gravier.seal(path)
            table = BodiesTable(path)
            bodies, walls = table.bodies(), table.boundaries()
            for name in ("id", "position", "radius", "velocity", "spin", "material"):
                np.testing.assert_array_equal(bodies[name], known.bodies()[name], err_msg=name)
            self.assertNotIn("mass", bodies)
            for name in ("id", "position", "normal"):
                np.testing.assert_array_equal(walls[name], known.boundaries()[name], err_msg=name)
        with open(path, encoding="ascii") as file:
            text = file.read()
        np.testing.assert_array_equal(BodiesTable(write(self.here("remark.csv"), "# größe\n" + text.partition("\n")[2])).bodies().radius, bodies.radius)
        write(path, text.replace("0.25,0.1", "0.35,0.1"))
        with self.assertRaisesRegex(gravier.ResultsError, "checksum in its first line is not that of what it holds"):
            BodiesTable(path)

    def test_refusals(self):
        for text, words in (("id,x,y\n1,0,0\n", "no column radius"), ("id,x,y,radius,size\n", "column size; expected each of"), ("id,x,y,radius,x\n", "column x; expected each of"),
                            ("id,x,y,radius\n1,0,0\n", "line 2: 3 cells; expected 4"), ("id,x,y,radius\n1,0,a,0.1\n", "line 2: y 'a'; expected a number"),
                            ("id,x,y,radius\n1.5,0,0,0.1\n", "line 2: id '1.5'; expected an integer"), ("id,x,y,radius\n1,0,0,\n", "line 2: radius ''; expected a number"),
                            ("id,x,y,radius\n1,0,0,-1\n", "line 2: radius -1; expected a number above 0"), ("id,x,y,radius\n1,inf,0,1\n", "x 'inf'; expected a number"),
                            ("id,x,y,radius\n", "no body"), ("\n# nothing\n", "no row"), ("id,x,y,radius,shape\n1,0,0,1,die\n", "shape die; expected grain or plane"),
                            ("id,x,y,radius,shape,nx,ny\n1,0,0,1,,,\n2,0,0,,plane,0,0\n", "line 3: a normal of 0"), ("id,x,y,radius\n1,é,0,1\n", "line 2: x 'é'; expected a number")):
            with self.subTest(text=text), self.assertRaisesRegex(gravier.ResultsError, words):
                table = BodiesTable(write(self.here("bad.csv"), text))
                self.assertIsNotNone((table.bodies(), table.boundaries()))


class Joined(RunTestCase):

    def bed(self, name, ids, places, **more):
        """A bodies file of grains of radius R with two walls and a force."""
        places = np.array(places, dtype=float)
        path, d = self.here(f"{name}.h5"), places.shape[1]
        with h5py.File(path, "w") as file:
            columns = {"id": ids, "position": places, "radius": np.full(len(ids), R), **more}
            for key, values in columns.items():
                file[f"bodies/{key}"] = values
            file["walls/id"], file["walls/point"] = [500, 40], np.zeros((2, d))
            file["walls/normal"] = np.eye(d)[[-1, 0]]
            file["contacts/candidate"], file["contacts/antagonist"] = [ids[0]], [-1]
            file["contacts/normal"] = file["contacts/force"] = np.eye(d)[[-1]]
            file["contacts/boundaries"] = np.array([b"wall 500"])
        return path

    def test_numbers_and_columns(self):
        """The first file keeps what it has; bodies of the others come behind its largest number, those of walls included, with the defaults of what
        their files do not say."""
        first = self.bed("first", [3, 9], [[R, R], [3 * R, R]], velocity=[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], mass=[0.5, 0.25], group=[0, 4])
        second = self.bed("second", [3, 9, 12], [[R, 9 * R], [3 * R, 9 * R], [5 * R, 9 * R]], mass=[1.0, 2.0, 3.0])
        ball = write(self.here("ball.csv"), f"id,x,y,radius,vy,material\n1,{7 * R},{R},{R},-2.0,3\n")
        out = self.here("new/out.h5")
        for _ in range(2):
            rows = gravier.join_bodies([first, second, ball], out, shift=[0.0, 2 * R], density=7800.0)
        self.assertEqual([rows[name].tolist() for name in ("first", "last", "walls", "forces", "near")], [[3, 501, 504], [9, 503, 504], [0, 2, 0], [0, 1, 0], [0, 0, 0]])
        with h5py.File(out) as file, h5py.File(first) as old:
            found = {name: values[()] for name, values in file["bodies"].items()}
            np.testing.assert_array_equal(found["id"], [3, 9, 501, 502, 503, 504])
            np.testing.assert_allclose(found["position"] / R, [[1, 1], [3, 1], [1, 11], [3, 11], [5, 11], [7, 3]], rtol=1e-12)
            np.testing.assert_allclose(found["mass"], [0.5, 0.25, 1.0, 2.0, 3.0, 7800.0 * np.pi * R**2], rtol=1e-12)
            np.testing.assert_array_equal(found["velocity"], [[1, 2, 3], [4, 5, 6], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, -2, 0]])
            np.testing.assert_array_equal(found["group"], [0, 4, 0, 0, 0, 0])
            np.testing.assert_array_equal(found["material"], [1, 1, 1, 1, 1, 3])
            self.assertEqual(sorted(file), ["bodies", "contacts", "walls"])
            for group in ("walls", "contacts"):
                for name, values in old[group].items():
                    np.testing.assert_array_equal(file[f"{group}/{name}"][()], values[()])
        self.assertEqual(gravier.BodiesFile(out).bodies().id[-1], 504)

    def test_above(self):
        """Each file comes above all before it, in space too, and the one below stays."""
        first = self.bed("low", [1], [[R, R, R]])
        gravier.join_bodies([first, first, first], self.here("tower.h5"), above=0.5 * R)
        np.testing.assert_allclose(gravier.BodiesFile(self.here("tower.h5")).bodies().position[:, 2] / R, [1.0, 3.5, 6.0], rtol=1e-12)

    def test_overlaps_are_those_of_all_pairs(self):
        """Spheres at random in a sheared period: the deepest overlap of two files is that of all pairs of images, whatever the number of pairs at a time."""
        rng = np.random.default_rng(11)
        tables = [{"position": rng.uniform(0.0, 1.0, (n, 3)), "radius": rng.uniform(0.01, 0.05, n)} for n in (300, 200)]
        edges = np.array([[1.0, 0.0, 0.0], [0.3, 1.0, 0.0]])
        ways = [a * edges[0] + b * edges[1] for a in (-1, 0, 1) for b in (-1, 0, 1)]
        known = []
        for way in ways:
            distance = np.linalg.norm(tables[0]["position"][:, None] + way - tables[1]["position"], axis=2)
            depth = tables[0]["radius"][:, None] + tables[1]["radius"] - distance
            known += [(depth[i, j], i, j) for i, j in zip(*np.nonzero(depth > 0.01))]
        self.assertGreater(len(known), 30)
        most = linked.MOST_PAIRS
        try:
            for linked.MOST_PAIRS in (1, 97, 2000000):
                found = sorted(zip(*joined._overlaps(*tables, ways, 0.01)))
                self.assertEqual([pair[1:] for pair in found], [pair[1:] for pair in sorted(known)])
                np.testing.assert_allclose([pair[0] for pair in found], [pair[0] for pair in sorted(known)], rtol=1e-9)
        finally:
            linked.MOST_PAIRS = most

    def test_refusals(self):
        """One line each; no file is written, and those that are there stay."""
        bed = self.bed("bed", [1, 2], [[R, R], [3 * R, R]])
        with h5py.File(self.bed("periodic", [1], [[0.1 * R, R]]), "a") as file:
            file["box/period"], file["box/origin"] = [10 * R, 0.0], [0.0, 0.0]
        heavy = self.bed("heavy", [1], [[5 * R, R]], mass=[1.0])
        deep = self.bed("deep", [5, 6], [[2.5 * R, 2.5 * R], [1.5 * R, 1.0 * R]])
        edge = self.bed("edge", [1], [[9.5 * R, R]])
        space = self.bed("space", [1], [[R, R, R]])
        low = self.bed("low", [8], [[9 * R, 0.5 * R]])
        write(self.here("mine.h5"), "mine")
        out = self.here("refused.h5")
        for files, options, words in (
                ([bed], {}, "1 bodies files; expected two at least"), ([bed, space], {}, "space.h5: bodies in 3D; expected 2D"),
                ([bed, deep], {}, r"deep.h5: body 6 overlaps body 1 of .*bed.h5 by 0.015 m, the deepest of 3 overlaps; expected bodies apart"),
                ([bed, low], {}, r"low.h5: body 8 reaches 0.005 m behind wall 500 of .*bed.h5"), ([bed, heavy], {}, r"bed.h5: no masses; expected masses in all files"),
                ([self.here("periodic.h5"), edge], {}, r"edge.h5: body 1 overlaps body 1 of .*periodic.h5 by 0.014 m, the deepest of 1 overlap;"),
                ([bed, self.here("periodic.h5")], {}, "periodic.h5: periods of another size"), ([bed, deep], {"shift": [1.0]}, "shift .*expected 2 numbers"),
                ([bed, deep], {"overlap": -1.0}, "overlap -1: expected"), ([bed, deep], {"density": 0.0}, "density 0: expected"), ([bed, deep], {"above": np.nan}, "above nan: expected"),
                ([bed, self.here("no.h5")], {}, "no.h5: no such file"), ([bed, self.here("no.csv")], {}, "no.csv: No such file or directory"),
                ([bed, self.here("mine.h5")], {}, "mine.h5: cannot read this file")):
            with self.subTest(words=words), self.assertRaisesRegex(gravier.ResultsError, words):
                gravier.join_bodies(files, out, **options)
        self.assertFalse(os.path.exists(out))
        # as much as is allowed
        gravier.join_bodies([bed, deep], out, overlap=0.0151)
        for place, words in ((bed, "this file is read"), (deep, "this file is read"), (self.here("mine.h5"), "another kind or origin"), (self.here("out.csv"), "ends in .h5")):
            with self.subTest(place=place), self.assertRaisesRegex(gravier.ResultsError, words):
                gravier.join_bodies([bed, deep], place, overlap=0.0151)

    def test_shapes(self):
        """Shapes are numbered by common names; where enclosing balls meet, that is told; axes of orientations have to be of one kind."""
        paths = []
        for name, names, axes, place in (("dice", "die,long", "principal", 0.0), ("stones", "flat,die", "principal", 1.9 * R), ("written", "die", None, 9 * R)):
            paths.append(self.bed(name, [1, 2], [[R + place, R, R], [3 * R + place, 9 * R, R]], mass=[1.0, 1.0], shape=[1, 2 if "," in names else 0],
                                  orientation=[[1.0, 0.0, 0.0, 0.0], [0.8, 0.6, 0.0, 0.0]], scale=[0.5, 0.5]))
            with h5py.File(paths[-1], "a") as file:
                file["bodies/shape"].attrs["names"] = np.bytes_(names)
                if axes:
                    file["bodies/orientation"].attrs["axes"] = np.bytes_(axes)
        sphere = write(self.here("sphere.csv"), f"id,x,y,z,radius,mass\n1,{15 * R},{R},{R},{R},2.0\n")
        out = self.here("shapes.h5")
        rows = gravier.join_bodies([paths[0], paths[1], sphere], out)
        self.assertEqual(rows.near.tolist(), [0, 2, 0])
        with h5py.File(out) as file:
            np.testing.assert_array_equal(file["bodies/shape"][()], [1, 2, 3, 1, 0])
            self.assertEqual((file["bodies/shape"].attrs["names"], file["bodies/orientation"].attrs["axes"]), (b"die,long,flat", b"principal"))
            np.testing.assert_array_equal(file["bodies/orientation"][()][[1, 3, 4]], [[0.8, 0.6, 0.0, 0.0]] * 2 + [[1.0, 0.0, 0.0, 0.0]])
            self.assertNotIn("scale", file["bodies"])
        with self.assertRaisesRegex(gravier.ResultsError, "dice.h5: orientations of principal axes, .*written.h5: orientations of written axes; expected one kind"):
            gravier.join_bodies([paths[0], paths[2]], out)

    def test_intruder(self):
        """A heavy disk is put above a settled bed: all forces of the bed start the run, the bed does not stir before it is struck, and the disk falls."""
        os.makedirs(self.here("fall"))
        sample = {"scene": {"bodies": "sample", "friction": 0.4, "alert_distance": 1e-3},
                  "sample": {"preparation": "settled", "count": 80, "radii": "uniform", "radius_min": 0.004, "radius_max": 0.006, "box": 0.1, "solid_fraction": 0.5,
                             "file": "bed.h5"}, "time": {"step": 1e-3, "steps": 0}}
        gravier.run(sample, self.here("fall"), program="gravier_sample")
        write(self.here("fall", "ball.csv"), "id,x,y,radius\n1,0.05,0.0,0.015\n")
        tool = os.path.join(SOURCE, "drivers/join/gravier_join.py")
        done = script(tool, "bed.h5", "ball.csv", "--above", "0.02", "--density", "7800", "--out", "with_ball.h5", directory=self.here("fall"), environment=ENVIRONMENT)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(done.stdout, "bed.h5: bodies 1 to 80\nball.csv: body 84\nwith_ball.h5\n")
        case = {"scene": {"bodies": "file", "bodies_file": "with_ball.h5", "friction": 0.4, "alert_distance": 1e-3}, "time": {"step": 5e-4, "steps": 300},
                "output": {"directory": "results", "every": 100, "tracked_bodies": [84]}}
        run = run_case(case, 1, self.here("fall"))
        self.assert_status(run, 0)
        self.assertRegex(run.stdout, r"start +from forces of the bodies file: (\d+) of its \1 contacts touch in the first step, with 100.0 % of its normal forces")
        found = gravier.Run(self.here("fall", "results"))
        history, start = found.history(), found.bodies(0)
        falls = history.time <= 0.06
        place = start.position[-1]
        np.testing.assert_allclose(history["body_y:84"][falls], place[1] - 0.5 * 9.81 * history.time[falls]**2, atol=1e-3 * R)
        moved = np.linalg.norm(found.bodies(100).position - start.position, axis=1)[:-1]
        self.assertLess(moved.max(), 1e-3 * R)
        # it is struck and lies in the bed
        self.assertLess(history["body_y:84"][-1], place[1] - 0.02)
        self.assertGreater(np.linalg.norm(found.bodies(300).position - start.position, axis=1)[:-1].max(), 1e-3)
        for arguments, words in ((["--shift", "0", "-1e-3"], r"ball.csv: body 1 .*"), (["--shift", "0"], r"shift \[0.0\]: expected 2 numbers"), (["--density", "-1"], "expected a number > 0"),
                                 (["--above", "x"], "expected a number"),
                                 (["--above", "0.02", "--out", "/proc/q.h5"], "/proc/q.h5: No such file or directory; expected a file that can be written")):
            before = os.path.getmtime(self.here("fall", "with_ball.h5"))
            done = script(tool, "bed.h5", "ball.csv", "--out", "with_ball.h5", "--density", "7800", *arguments, directory=self.here("fall"), environment=ENVIRONMENT)
            self.assertEqual((done.returncode, done.stdout, os.path.getmtime(self.here("fall", "with_ball.h5"))), (2, "", before))
            self.assertRegex(done.stderr, rf"^gravier_join: error: .*{words}.*\n$")


if __name__ == "__main__":
    unittest.main()
