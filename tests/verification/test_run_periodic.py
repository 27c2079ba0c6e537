"""Periodic cells, and scenes on one domain and on several: what is one scene gives one result, as far as the law has one."""
import os
import unittest

import h5py
import numpy as np

from gravier_runs import RunTestCase, differences, merged, run_case, write
from packings import settled_disks
from shaped_scenes import FLAT, bodies_csv, body
from small_scenes import G, Grain, SmallScene, floats, plane

LENGTH = 0.504
STEP = 1e-3


class Periodic(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        run = run_case({
            "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [20, 10], "radius_min": 0.008, "radius_max": 0.012,
                      "friction": 0.3, "period": [LENGTH, 0.0]},
            "time": {"step": STEP, "steps": 220}, "solver": {"tolerance": 1e-3, "max_iterations": 3000},
            "output": {"directory": ".", "every": 0, "final_bodies": True}}, directory=cls.scratch)
        if run.status != 0:
            raise AssertionError(f"the layer was not made: {run}")
        cls.layer = run.path("final_bodies.h5")
        cls.case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": cls.layer, "friction": 0.0},
            "time": {"step": STEP, "steps": 1},
            "solver": {"tolerance": 1e-10, "max_iterations": 100000, "warm_start": False},
            "output": {"directory": "results", "stress": True, "energy": True}}

    def test_flight_round_the_cell(self):
        """A grain that nothing meets crosses the cell of a scene with one and with three periodic axes many times."""
        for dimension, period in ((2, [0.3, 0.0]), (3, [0.3, 0.2, 0.25])):
            here = self.here(f"flight {dimension}")
            os.makedirs(here)
            place, speed = np.array([0.1, 0.1, 0.1])[:dimension], np.array([7.3, 0.1, -4.1])[:dimension]
            write(os.path.join(here, "one.csv"), ",".join(["id", *"xyz"[:dimension], "radius", *(f"v{a}" for a in "xyz"[:dimension])])
                  + "\n" + ",".join(map(str, [1, *place, 0.01, *speed])) + "\n")
            run = run_case({"scene": {"dimension": dimension, "bodies": "file", "bodies_file": "one.csv", "gravity": [0.0] * 3,
                                      "period": period},
                            "time": {"step": 1e-3, "steps": 400}, "output": {"directory": "results", "every": 100}}, directory=here)
            self.assert_status(run, 0)
            results = run.results()
            lengths = np.array(period)
            for step in (100, 200, 300, 400):
                x, image = results[f"/steps/{step}/bodies/position"][0], results[f"/steps/{step}/bodies/image"][0]
                np.testing.assert_allclose(x + image * lengths, place + speed * 1e-3 * step, rtol=0.0, atol=1e-12)
            self.assertGreater(abs(image[0]), 8)

    def test_a_layer_moved_by_half_a_period(self):
        """The same contacts, stress and velocities, wherever the cell is cut."""
        wanted = run_case(self.case, directory=self.here("as it is"))
        self.assert_status(wanted, 0)
        for title, shift in (("half", 0.5 * LENGTH), ("any", 0.137 * LENGTH)):
            here = self.here(f"moved {title}")
            os.makedirs(here)
            with h5py.File(self.layer) as old, h5py.File(os.path.join(here, "moved.h5"), "w") as new:
                for name in ("bodies", "walls", "box"):
                    old.copy(name, new)
                x = new["bodies/position"][:, 0] + shift
                new["bodies/position"][:, 0] = x - LENGTH * np.floor(x / LENGTH)
                # changed by hand on purpose
                del new["bodies/position"].attrs["checksum"]
            run = run_case(merged(self.case, {"scene": {"bodies_file": "moved.h5"},
                                              "decomposition": {"subdomains": 4}, "solver": {"method": "nscdd"}}), directory=here)
            self.assert_status(run, 0)
            self.assert_same_step(wanted, run, 1e-8)

    def test_subdomains_and_ranks(self):
        """Same bits on any number of ranks; the same step within the tolerance in any number of subdomains."""
        wanted = run_case(self.case, directory=self.here("one domain"))
        # a pair that belongs to its candidate is met with its antagonist as far beyond the side as a pair may be
        for partition, kind in (("grid", "dual"), ("metis", "dual"), ("grid", "primal")):
            for n in (2, 4, 7):
                case = merged(self.case, {"decomposition": {"subdomains": n, "partition": partition, "kind": kind},
                                          "solver": {"method": "nscdd"}})
                runs = [run_case(case, ranks, self.here(f"{partition} {kind} {n} {ranks}")) for ranks in (1, 2)]
                with self.subTest(partition, kind=kind, subdomains=n):
                    for run in runs:
                        self.assert_status(run, 0)
                    self.assertEqual(differences(runs[0].results(), runs[1].results()), [])
                    self.assertGreater(runs[0].history()["interface_bodies"][0], 0)
                    self.assert_same_step(wanted, runs[0], 1e-8)

    def assert_same_step(self, wanted, run, tolerance):
        """Pairs in contact, velocities, stress and kinetic energy of step 1, the last ones relative to their size."""
        first, second = wanted.results(), run.results()
        for name in ("candidate", "antagonist"):
            np.testing.assert_array_equal(first[f"/steps/1/contacts/{name}"], second[f"/steps/1/contacts/{name}"])
        # some pairs meet across the end of the cell
        x = dict(zip(first["/steps/1/bodies/id"], first["/steps/1/bodies/position"][:, 0]))
        across = [abs(x[i] - x[j]) > 0.5 * LENGTH for i, j in zip(first["/steps/1/contacts/candidate"],
                                                                 first["/steps/1/contacts/antagonist"]) if j in x]
        self.assertGreater(sum(across), 5)
        speed = np.abs(first["/steps/1/bodies/velocity"]).max()
        apart = np.abs(first["/steps/1/bodies/velocity"] - second["/steps/1/bodies/velocity"]).max()
        self.assertLess(apart, tolerance * max(speed, 9.81 * STEP) * 100)
        one, other = wanted.history(), run.history()
        for column in ("stress_xx", "stress_yy", "kinetic_energy", "dissipated_normal"):
            self.assertLess(abs(one[column][0] - other[column][0]), 1e-6 * max(abs(one["stress_yy"][0]), abs(one[column][0])), column)
        self.assertLess(abs(one["solid_fraction"][0] - other["solid_fraction"][0]), 1e-10)


class Boundaries(SmallScene):
    """Boundaries of a finite extent act through the sides of the cell: a scene in the middle of the cell and the same scene moved
    until it lies across a side, or beyond it, go the same way."""
    length = 1.0

    def compare(self, title, dimension, grains, boundaries, gravity=None, steps=300, ranks=1, **groups):
        """Grains are (place, velocity, group), boundaries have a point or a pivot; the middle of the scene is x = 0.5."""
        def run(shift):
            way = shift * np.eye(dimension)[0]
            moved = [{**one, **{key: floats(np.array(one[key]) + np.append(way, [0.0] * (len(one[key]) - dimension)))
                                for key in ("point", "end", "pivot") if key in one}} for one in boundaries]
            period = {"scene": {"period": [self.length, 0.0, 0.0], "friction": 0.5, "skin": 0.004}}
            return self.play(f"{title} {dimension} {shift}", [Grain(np.array(place) + way, speed, radius=0.04, group=group)
                                                              for place, speed, group in grains],
                             moved, gravity, steps, ranks, output={"every": 10}, **merged(period, groups))
        wanted = run(0.0)
        for shift in (0.43, 2.5):
            record = run(shift)
            with self.subTest(title, dimension=dimension, shift=shift):
                apart = record.position - wanted.position
                apart[..., 0] -= shift
                apart[..., 0] -= self.length * np.round(apart[..., 0] / self.length)
                self.verify(f"{title} across a side, {dimension}D", "places [m]", apart, 0.0, 1e-9)
                self.verify(f"{title} across a side, {dimension}D", "speeds [m/s]", record.velocity, wanted.velocity, 1e-7)
                self.verify(f"{title} across a side, {dimension}D", "forces on it [N]", record.boundary["force"],
                            wanted.boundary["force"], 1e-5)
        # grains that are not glued come first; those that nothing stops and gravity does not move keep their velocity
        met = wanted.velocity[:, :sum(group == 0 for _, _, group in grains)]
        met = met - wanted.time[:, None, None] * (np.zeros(dimension) if gravity is None else np.array(gravity))
        self.assertGreater(np.ptp(met, axis=0).max(), 0.05)
        return wanted

    def test_glued_blade(self):
        """A blade of glued grains turns through the side and strikes grains on its way."""
        def check(dimension):
            rest = [0.0] * (dimension - 2)
            blade = [([0.5 + 0.08 * k, 0.0, *rest], None, 1) for k in range(-3, 4)]
            free = [([0.5 + x, y, *rest], None, 0) for x, y in ((0.2, 0.15), (-0.2, -0.15), (0.05, 0.2))]
            rate = [3.0] if dimension == 2 else [0.0, 0.0, 3.0]
            wanted = self.compare("glued blade", dimension, free + blade,
                                  [{"shape": "grains", "group": 1, "pivot": [0.5, 0.0, *rest], "rotation": rate}])
            # rigid, and where it should be
            angle = 3.0 * wanted.time
            for k in range(-3, 4):
                place = wanted.position[:, 6 + k] + self.length * np.pad(wanted.image[:, 6 + k, :1], ((0, 0), (0, dimension - 1)))
                self.verify("glued blade", "places of the turn [m]", place[:, :2],
                            np.column_stack([0.5 + 0.08 * k * np.cos(angle), 0.08 * k * np.sin(angle)]), 1e-12)
        self.both(check)

    def test_roller_of_glued_grains_about_the_periodic_axis(self):
        """A rough drum of glued grains along the whole cell turns about the periodic axis."""
        angles = np.arange(8) * np.pi / 4
        drum = [([x, 0.1 * np.cos(a), 0.1 * np.sin(a)], None, 1) for a in angles for x in np.arange(0.05, 1.0, 0.1)]
        wanted = self.compare("roller", 3, [([0.5, 0.02, 0.2], None, 0)] + drum,
                              [{"shape": "grains", "group": 1, "pivot": [0.3, 0.0, 0.0], "rotation": [2.0, 0.0, 0.0]}],
                              -G * np.eye(3)[2], steps=100)
        arm = np.hypot(wanted.position[:, 1:, 1], wanted.position[:, 1:, 2])
        self.verify("roller", "distance from the axis [m]", arm, 0.1, 1e-12)

    def test_segment(self):
        """Grains fall on a segment that lies across the side, slip to its ends and fall on."""
        free = [([0.5 + x, y], None, 0) for x, y in ((-0.12, 0.06), (0.02, 0.05), (0.14, 0.08))]
        self.compare("segment", 2, free, [{"shape": "segment", "point": [0.35, 0.03], "end": [0.65, -0.03]}], [0.0, -G])

    def test_turning_paddle(self):
        """A segment that turns about one of its ends and moves."""
        free = [([0.5 + x, y], None, 0) for x, y in ((0.1, 0.09), (0.0, 0.15), (-0.1, -0.1))]
        self.compare("paddle", 2, free, [{"shape": "segment", "point": [0.5, 0.0], "end": [0.7, 0.0], "rotation": [4.0],
                                          "velocity": [-0.2, 0.0]}])

    def test_circle(self):
        """Grains in a drum that turns."""
        free = [([0.5 + x, y], None, 0) for x, y in ((-0.2, 0.0), (0.0, -0.1), (0.15, 0.1))]
        self.compare("circle", 2, free, [{"shape": "circle", "point": [0.5, 0.0], "radius": 0.3, "rotation": [2.0]}], [0.0, -G],
                     ranks=2, solver={"method": "nscdd", "tolerance": 1e-13}, decomposition={"subdomains": 2})

    def test_rectangle(self):
        free = [([0.5 + x, y, z], None, 0) for x, y, z in ((-0.12, 0.1, 0.06), (0.02, 0.2, 0.05), (0.14, 0.3, 0.08))]
        self.compare("rectangle", 3, free, [{"shape": "rectangle", "point": [0.35, 0.0, 0.03], "edge_a": [0.3, 0.0, -0.06],
                                             "edge_b": [0.0, 0.4, 0.0]}], [0.0, 0.0, -G])

    def test_slot(self):
        """A slot between two plates that go round the cell: a sphere falls through, one rolls off an edge into it, and one slides along over
        the place where a plate meets itself, which nothing feels: a plate that begins elsewhere along the axis is the same."""
        free = [([0.5, 0.0, 0.1], None, 0), ([0.3, 0.075, 0.06], [0.0, -0.3, 0.0], 0), ([0.9, -0.2, 0.04], [2.0, 0.0, 0.0], 0)]

        def plates(start):
            return [{"shape": "rectangle", "point": [start, 0.05, 0.0], "edge_a": [1.0, 0.0, 0.0], "edge_b": [0.0, 0.4, 0.0]},
                    {"shape": "rectangle", "point": [start, -0.05, 0.0], "edge_a": [0.0, -0.4, 0.0], "edge_b": [1.0, 0.0, 0.0]}]
        found = [self.compare(f"slot {start}", 3, free, plates(start), [0.0, 0.0, -G]) for start in (0.0, 0.35)]
        place, other = (one.position + self.length * np.pad(one.image[..., :1], ((0, 0), (0, 0), (0, 2))) for one in found)
        self.verify("slot", "places [m]", place, other, 1e-9)
        self.assertTrue((place[-1, :2, 2] < -0.1).all(), place[-1])
        # the third stays on its plate, on which it slides and rolls
        self.verify("slot", "height of the sliding grain [m]", place[:, 2, 2], 0.04, 1e-5)
        self.assertGreater(place[-1, 2, 0], 1.2)

    def test_slot_on_ranks(self):
        """The same bits on one rank and on two."""
        free = [Grain(np.array([0.1 + 0.27 * i, y, 0.06 + 0.02 * i]), radius=0.04) for i in range(4) for y in (-0.1, 0.0, 0.1)]
        plates = [{"shape": "rectangle", "point": [0.2, side * 0.05, 0.0], "edge_a": [1.0, 0.0, 0.0], "edge_b": [0.0, side * 0.4, 0.0]}
                  for side in (1.0, -1.0)]
        runs = [self.play(f"slot on {ranks}", free, plates, [0.0, 0.0, -G], 150, ranks, solver={"method": "nscdd", "tolerance": 1e-4},
                          decomposition={"subdomains": 2}, scene={"period": [1.0, 0.0, 0.0], "friction": 0.5}, output={"every": 10})
                for ranks in (1, 2)]
        for name in ("position", "velocity", "image"):
            np.testing.assert_array_equal(getattr(runs[0], name), getattr(runs[1], name))
        # some are in the slot, others lie on the plates
        self.assertLess(runs[0].position[-1, :, 2].min(), -0.05)
        self.assertGreater(runs[0].position[-1, :, 2].max(), 0.03)

    def test_box_on_a_plate_round_the_cell(self):
        """A box of corners that slides over the place where a segment meets itself stays flat on it."""
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "shapes": "a.shapes", "friction": 0.2,
                          "period": [1.0, 0.0]}, "time": {"step": 1e-3, "steps": 200}, "solver": {"tolerance": 1e-10},
                "output": {"directory": "results", "every": 10}}
        runs = []
        for start in (0.0, 0.45):
            here = self.here(f"box {start}")
            os.makedirs(here)
            write(os.path.join(here, "a.shapes"), FLAT)
            write(os.path.join(here, "bodies.csv"), bodies_csv([body("square", [0.9, 0.05], velocity=[1.0, 0.0])]))
            plate = {"name": "plate", "shape": "segment", "point": [start, 0.0], "end": [start + 1.0, 0.0]}
            run = run_case(merged(case, {"boundary": [plate]}), directory=here)
            self.assert_status(run, 0)
            runs.append(run.results())
        for step in range(10, 201, 10):
            for name in ("position", "velocity"):
                found = [one[f"/steps/{step}/bodies/{name}"] for one in runs]
                np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-9)
            self.assertAlmostEqual(found[0][0, 1], 0.0, delta=1e-6)
            # over the end, too, it rests on two corners
            self.assertEqual(len(runs[0][f"/steps/{step}/contacts/candidate"]), 2)
        self.assertEqual(runs[0]["/steps/200/bodies/image"][0, 0], 1)

    def test_cylinders(self):
        """Across the periodic axis, and along it."""
        free = [([0.5 + x, y, z], None, 0) for x, y, z in ((-0.2, 0.0, 0.0), (0.0, 0.1, -0.1), (0.15, 0.2, 0.1))]
        for title, axis, rate in (("cylinder across", [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]), ("cylinder along", [1.0, 0.0, 0.0], [2.0, 0.0, 0.0])):
            self.compare(title, 3, free, [{"shape": "cylinder", "point": [0.5, 0.0, 0.0], "axis": axis, "radius": 0.3,
                                           "rotation": rate}], [0.0, 0.0, -G])


class Domains(RunTestCase):
    """600 disks that still settle, on one domain and on several."""

    def test_velocities_stress_and_energy(self):
        packing = settled_disks(self.scratch, steps=250)
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": packing, "friction": 0.0},
                "time": {"step": STEP, "steps": 1}, "solver": {"tolerance": 1e-10, "max_iterations": 100000, "warm_start": False},
                "output": {"directory": "results", "stress": True, "energy": True}}
        wanted = run_case(case, directory=self.here("one"))
        self.assert_status(wanted, 0)
        for title, change in (("grid", {"subdomains": 6}), ("metis", {"subdomains": 9, "partition": "metis"})):
            run = run_case(merged(case, {"decomposition": change, "solver": {"method": "nscdd"}}), 2, self.here(title))
            with self.subTest(title):
                self.assert_status(run, 0)
                first, second = (r.results()["/steps/1/bodies/velocity"] for r in (wanted, run))
                self.assertLess(np.abs(first - second).max(), 1e-6 * np.abs(first).max())
                one, other = wanted.history(), run.history()
                for column in ("stress_xx", "stress_yy", "pressure", "kinetic_energy", "dissipated_normal"):
                    self.assertLess(abs(one[column][0] - other[column][0]), 1e-6 * abs(one[column][0]), column)


class Jammed(RunTestCase):
    """33 disks in a triangular lattice that a box just holds, under a lid with 50 N: nothing can move, and the law leaves the forces on
    the sides open. Methods agree on velocities and on what balance imposes, and not on the rest."""

    def test_forces_that_are_not_unique(self):
        n, r = 6, 0.01
        places = [(r * (1 + 2 * i + j % 2), r * (1 + np.sqrt(3) * j)) for j in range(n) for i in range(n - j % 2)]
        write(self.here("jammed.csv"), "id,x,y,radius\n" + "\n".join(f"{k},{x!r},{float(y)!r},{r}" for k, (x, y) in enumerate(places, 1)) + "\n")
        top = r * (2 + np.sqrt(3) * (n - 1))
        case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": self.here("jammed.csv"), "friction": 0.5},
            "boundary": [{"name": "floor", **plane([0, 0], [0, 1])}, {"name": "left", **plane([0, 0], [1, 0])},
                         {"name": "right", **plane([2 * n * r, 0], [-1, 0])},
                         {"name": "lid", **plane([0, top], [0, -1], free=[False, True], mass=1e-3, force=[0.0, -50.0])}],
            "time": {"step": STEP, "steps": 1},
            "solver": {"tolerance": 1e-12, "max_iterations": 200000, "warm_start": False},
            "output": {"directory": "results", "boundary_forces": True}}
        side = []
        for method, subdomains in (("nlgs", 1), ("nscdd", 4)):
            run = run_case(merged(case, {"solver": {"method": method}, "decomposition": {"subdomains": subdomains}}),
                           directory=self.here(method))
            self.assert_status(run, 0)
            history = {name: column[0] for name, column in run.history().items()}
            # a residual of 1e-12 in units of the largest load, 50 N
            self.assertLess(np.abs(run.results()["/steps/1/bodies/velocity"]).max(), 1e-9)
            self.assertLess(abs(history["force_y:lid"] - 50.0), 1e-8)
            self.assertLess(abs(history["force_x:left"] + history["force_x:right"] + history["force_x:floor"]
                                + history["force_x:lid"]), 1e-8)
            weight = 9.81 * 2500 * np.pi * r ** 2 * len(places)
            self.assertLess(abs(sum(history[f"force_y:{name}"] for name in ("floor", "left", "right", "lid")) + weight), 1e-8)
            side.append(history["force_x:right"])
        self.assertGreater(abs(side[1] - side[0]), 1.0)


if __name__ == "__main__":
    unittest.main()
