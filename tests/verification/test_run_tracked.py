"""Single bodies in history.csv: the places and velocities of the written states, places without periods, nothing of a body that the scene does not
have; the same on any ranks and through a restart."""
import os
import pathlib
import unittest

import numpy as np

from gravier_runs import differences, gravier, merged, run_case, write
from shaped_scenes import lattice, prepare, shaped_case
from small_scenes import G, INERTIA, Grain, Record, SmallScene, plane

PERIOD, STEPS = 1.0, 120
#: grains that enter one by one, the second of them with the identifier 2
FEED = {"scene": {"bodies": "none", "dimension": 2, "gravity": [0.0, -9.81], "material": None},
        "insertion": [{"name": "feed", "lower": [0.0, 0.0], "upper": [1.0, 1.0], "radius": 0.05, "rate": 60.0, "count": 2}],
        "solver": {"method": "nscdd"}, "decomposition": {"partition": "grid", "grid": [2, 1]}, "time": {"step": 1.0 / 512, "steps": 40}}


class Tracked(SmallScene):

    def fly(self, title, dimension, ranks=1, steps=STEPS, **groups):
        """Three grains under gravity in a periodic scene: the first crosses the period again and again, the second turns and falls through an
        outlet, the third is not asked for."""
        spin = 2.0 if dimension == 2 else [1.0, 2.0, 3.0]
        more = [0.25] * (dimension - 2)
        grains = [Grain([0.5, *more, 0.7], [9.0, *more, 1.0]), Grain([0.2, *more, 0.0], [-0.5, *more, 0.0], spin), Grain([0.8, *more, 0.4])]
        low = [0.0] * (dimension - 1)
        case = merged({"scene": {"period": [PERIOD, *[0.5] * (dimension - 2), 0.0], "rotation": True},
                       "solver": {"method": "nscdd"}, "decomposition": {"partition": "grid", "grid": [4, *[1] * (dimension - 1)]},
                       "output": {"every": 0, "tracked_bodies": [2, 1]}}, groups)
        outlet = {"shape": "outlet", "point": [*low, -0.2], "normal": [*low, 1.0], "name": "out"}
        return self.play(title, grains, [outlet], [*low, -10.0], steps, ranks, **case)

    def test_values(self):
        def check(dimension):
            record = self.fly(f"values {dimension}", dimension, output={"every": 1})
            history = record.run.history()
            names = ["x", "y", "vx", "vy", "omega"] if dimension == 2 else ["x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz"]
            self.assertEqual([name for name in history if name.startswith("body_")], [f"body_{name}:{k}" for k in (2, 1) for name in names])
            places = record.position + record.image * np.array([PERIOD, 0.5, 0.0][:dimension - 1] + [0.0])
            values = np.concatenate([places, record.all_velocities], axis=2)[1:]
            for body in (1, 2):
                columns = np.stack([history[f"body_{name}:{body}"] for name in names], axis=1)
                np.testing.assert_array_equal(columns, values[:, body - 1])
            self.assertGreater(history["body_x:1"][-1], 2.0 * PERIOD)
            self.assertEqual(history["left"][-1], 0)
            gone = np.isnan(history["body_x:2"])
            self.assertTrue(10 < np.argmax(gone) < STEPS and gone[np.argmax(gone):].all())
        self.both(check)

    def test_cell_that_shears(self):
        """A body that flies freely keeps its velocity and its way where it crosses the periods of a cell that shears, once the cell has begun."""
        def check(dimension):
            more = [0.25] * (dimension - 2)
            velocity = [0.3, 4.0, *[0.1] * (dimension - 2)]
            start = [0.5, 0.7, *more]
            record = self.play(f"shears {dimension}", [Grain(start, velocity)], [], [0.0] * dimension, STEPS, scene={
                "period": [PERIOD] * dimension, "cell_shear_rate": [2.0]}, output={"every": 0, "tracked_bodies": 1})
            history = record.run.history()
            self.assertGreater(history["body_y:1"][-1], 1.1 * PERIOD)
            for name in "xyz"[:dimension]:
                place, speed = history[f"body_{name}:1"], history[f"body_v{name}:1"]
                self.verify(f"free body in a cell that shears, {dimension}D", f"v{name} [m/s]", speed, speed[0], 1e-12)
                self.verify(f"free body in a cell that shears, {dimension}D", f"{name} [m]", place, place[0] + speed[0] * (history["time"] - history["time"][0]),
                            1e-12)
        self.both(check)

    def test_ranks_and_restart(self):
        """The same bits on two ranks, and where a run goes on from a checkpoint."""
        whole = self.fly("whole", 2).run.history()
        self.assertEqual(differences(*({name: value for name, value in history.items() if name.startswith("body_")} for history in
                                       (whole, self.fly("two", 2, ranks=2).run.history()))), [])
        first = self.fly("first", 2, steps=40, output={"every": 0, "checkpoint_every": 40}).run
        case = os.path.join(first.directory, "case.nml")
        write(case, pathlib.Path(case).read_text(encoding="ascii").replace("steps = 40", f"steps = {STEPS}"))
        again = gravier("--restart", "case.nml", directory=first.directory)
        self.assert_status(again, 0)
        history = again.history()
        for name in (name for name in whole if name.startswith("body_")):
            np.testing.assert_array_equal(history[name], whole[name])

    def test_entering(self):
        """A body that enters is found when it is there."""
        run = run_case(merged(FEED, {"output": {"tracked_bodies": [2]}}), directory=self.here("enters"))
        self.assert_status(run, 0)
        history = run.history()
        there = ~np.isnan(history["body_x:2"])
        np.testing.assert_array_equal(there, np.cumsum(history["entered"]) >= 2)
        self.assertTrue(0 < there.sum() < 40)


class Forces(SmallScene):
    """Forces and moments of all contacts on tracked bodies."""

    def names(self, dimension):
        return (["fx", "fy"], ["mz"]) if dimension == 2 else (["fx", "fy", "fz"], ["mx", "my", "mz"])

    def columns(self, history, body, names):
        return np.stack([history[f"body_{name}:{body}"] for name in names], axis=1)

    def balance(self, record, body, gravity, scale, **more):
        """The force and, of disks and spheres, the moment change the momentum of a free body, to rounding; its number is that of the body."""
        history, dimension, grain = record.run.history(), record.dimension, more.get("grain")
        forces, moments = self.names(dimension)
        velocity = np.diff(record.velocity[:, body - 1], axis=0)
        mass = grain.mass if grain else more["mass"]
        self.verify(more["case"], "force on a body [N]", self.columns(history, body, forces), mass * (velocity / self.step - gravity), 1e-9 * scale)
        inertia = INERTIA[dimension] * mass * grain.radius**2 if grain else more.get("inertia")
        if inertia:
            spin = np.diff(record.spin[:, body - 1], axis=0)
            self.verify(more["case"], "moment on a body [N m]", self.columns(history, body, moments), inertia * spin / self.step, 1e-9 * scale)

    def test_rest(self):
        """Grains at rest on a floor weigh m g, without and with friction."""
        def check(dimension):
            for friction in (0.0, 0.5):
                low = [0.0] * (dimension - 1)
                record = self.play(f"rest {dimension} {friction}", [Grain([*low, 0.05]), Grain([0.4, *low[1:], 0.05], mass=1.1)], [plane([*low, 0.0], [*low, 1.0])],
                                   [*low, -G], 20, scene={"friction": friction}, output={"every": 0, "tracked_bodies": [2, 1], "tracked_forces": True})
                history = record.run.history()
                forces, moments = self.names(dimension)
                # without friction bodies do not turn
                moments = moments if friction else []
                self.assertEqual([name for name in history if name[:6] in ("body_f", "body_m")], [f"body_{name}:{k}" for k in (2, 1) for name in forces + moments])
                for body, mass in ((1, 0.7), (2, 1.1)):
                    self.verify(f"grain at rest, {dimension}D", "force of the floor [N]", self.columns(history, body, forces), mass * G * np.eye(dimension)[-1], 1e-10)
                    if moments:
                        self.verify(f"grain at rest, {dimension}D", "moment of the floor [N m]", self.columns(history, body, moments), 0.0, 1e-12)
        self.both(check)

    def test_pulled_through(self):
        """A grain that is glued to a boundary is pulled through others, which adhere and resist rolling: its force is that of the boundary, and its moment
        is not known. The momentum of a free grain among others changes by its force and moment."""
        def check(dimension):
            low = [0.0] * (dimension - 1)
            rng = np.random.default_rng(7)
            counts = [6, 3] if dimension == 2 else [5, 3, 3]
            places = [0.101 * (np.array(index) + 0.5) for index in np.ndindex(*counts)]
            grains = [Grain(place + rng.uniform(-5e-4, 5e-4, dimension), material=2) for place in places]
            probe, free = len(grains) + 1, 5
            grains.append(Grain([-0.1, *[0.15] * (dimension - 2), 0.06], radius=0.06, group=1, material=2))
            walls = [plane([0.0] * dimension, np.eye(dimension)[-1], friction=0.3)]
            laws = {"friction": 0.4, "rolling_friction": 0.1, **({"pivoting_friction": 0.05} if dimension == 3 else {})}
            walls.append({"name": "probe", "shape": "grains", "group": 1, "velocity": [1.0, *low]})
            record = self.play(f"pulled {dimension}", grains, walls, [*low, -G], 128, files={},
                               scene=laws, material=[{"name": "wall"}, {"name": "wet"}],
                               law=[{"materials": ["wet"], "kind": "adhesive", "adhesion": 2.0, "adhesion_range": 1e-3, **laws}],
                               solver={"criterion": "velocity_error", "tolerance": 1e-2},
                               output={"every": 1, "boundary_forces": True, "tracked_bodies": [free, probe], "tracked_forces": True})
            history = record.run.history()
            forces, moments = self.names(dimension)
            found = self.columns(history, probe, forces)
            scale = np.abs(found).max()
            self.assertGreater(scale, 5.0)
            self.verify(f"grain that is pulled, {dimension}D", "force of its boundary [N]", found,
                        np.stack([history[f"force_{axis}:probe"] for axis in "xyz"[:dimension]], axis=1), 1e-9 * scale)
            self.assertTrue(np.isnan(self.columns(history, probe, moments)).all())
            self.assertGreater(np.abs(self.columns(history, free, moments)).max(), 1e-3)
            self.balance(record, free, -G * np.eye(dimension)[-1], scale, grain=grains[free - 1], case=f"grain among others, {dimension}D")
        self.both(check)

    def test_shapes(self):
        """The momentum of bodies with shapes changes by the forces on them, and the angular momentum of a square by their moment."""
        for dimension in (2, 3):
            with self.subTest(dimension=dimension):
                counts = [3, 3] if dimension == 2 else [2, 2, 2]
                floors = [plane([0.0] * dimension, np.eye(dimension)[-1])]
                directory = prepare(self.here(f"shapes {dimension}"), dimension, lattice(counts))
                case = shaped_case(dimension, floors, {"scene": {"friction": 0.4}, "time": {"step": self.step, "steps": 128},
                                                       "output": {"every": 1, "contacts": False, "tracked_bodies": [1, 2], "tracked_forces": True}})
                run = run_case(case, 1, directory)
                self.assert_status(run, 0)
                record = Record(run, lattice(counts), dimension)
                gravity = -9.81 * np.eye(dimension)[-1]
                for body in (1, 2):
                    row = run.results()["/steps/1/bodies/id"] == body
                    mass = run.results()["/steps/1/bodies/mass"][row][0]
                    scale = np.abs(self.columns(run.history(), body, self.names(dimension)[0])).max()
                    self.assertGreater(scale, mass)
                    # a square of the library has sides of a tenth of its scale, that of its radius
                    side = 0.1 * lattice(counts)[0].get("scale", 0.0)
                    self.balance(record, body, gravity, scale, case=f"body {body} with a shape, {dimension}D", mass=mass,
                                 inertia=mass * side**2 / 6.0 if dimension == 2 and body == 1 else None)

    def intruder(self, name, ranks=1, steps=160, **groups):
        """A large disk falls into others in a scene of four subdomains, of which several share it."""
        grains = [Grain([0.06 + 0.11 * i, 0.06 + 0.11 * j], radius=0.05) for i in range(10) for j in range(3)]
        grains.append(Grain([0.55, 0.52], [0.3, -2.0], 5.0, radius=0.16, mass=6.0))
        walls = [plane([0.0, 0.0], [0.0, 1.0]), plane([0.0, 0.0], [1.0, 0.0]), plane([1.12, 0.0], [-1.0, 0.0])]
        case = merged({"scene": {"friction": 0.4}, "solver": {"method": "nscdd", "criterion": "velocity_error", "tolerance": 1e-2, "warm_start": True}, "decomposition": {"partition": "grid", "grid": [4, 1]},
                       "output": {"every": 0, "tracked_bodies": [31, 14], "tracked_forces": True}}, groups)
        return self.play(name, grains, walls, [0.0, -G], steps, ranks, **case), grains

    def test_ranks_and_restart(self):
        """Forces on a body that several subdomains share have the same bits on any ranks and where a run goes on, and its momentum changes by them."""
        record, grains = self.intruder("whole", output={"every": 1})
        whole = record.run.history()
        self.balance(record, 31, np.array([0.0, -G]), np.abs(whole["body_fy:31"]).max(), grain=grains[30], case="disk that subdomains share")
        self.assertGreater(np.count_nonzero(whole["body_fy:31"]), 50)
        chosen = [name for name in whole if name.startswith("body_")]
        for ranks, steps in ((2, 160), (4, 80)):
            other = self.intruder(f"on {ranks}", ranks, steps)[0].run.history()
            self.assertGreater(np.count_nonzero(other["body_fy:31"]), 30)
            self.assertEqual(differences({name: whole[name][:steps] for name in chosen}, {name: other[name] for name in chosen}), [])
        first = self.intruder("first", steps=80, output={"checkpoint_every": 40})[0].run
        case = os.path.join(first.directory, "case.nml")
        text = pathlib.Path(case).read_text(encoding="ascii").replace("steps = 80", "steps = 160")
        write(case, text.replace("tracked_forces = .true.", "tracked_forces = .false."))
        again = gravier("--restart", "case.nml", directory=first.directory)
        self.assert_status(again, 2)
        self.assertIn("a column body_fx:31: &output tracked_forces = .false., but .true. was expected", again.stderr)
        write(case, text)
        again = gravier("--restart", "case.nml", directory=first.directory)
        self.assert_status(again, 0)
        history = again.history()
        for name in chosen:
            np.testing.assert_array_equal(history[name], whole[name])

    def test_sleeping(self):
        """Bodies that sleep keep the forces that bear their weight, on any ranks: those of a column of disks, each its own weight."""
        column = [Grain([0.0, 0.05 + 0.1 * k], mass=1.0 + k) for k in range(4)]
        found = []
        for ranks in (1, 2):
            record = self.play(f"sleeping on {ranks}", column, [plane([0.0, 0.0], [0.0, 1.0])], [0.0, -G], 120, ranks, scene={"friction": 0.3},
                               solver={"method": "nscdd", "criterion": "velocity_error", "tolerance": 1e-3, "sleeping": True, "warm_start": True}, decomposition={"partition": "grid", "grid": [1, 2]},
                               output={"every": 0, "tracked_bodies": [1, 3], "tracked_forces": True})
            history = record.run.history()
            self.assertEqual(history["sleeping"][-1], 4)
            for body, mass in ((1, 1.0), (3, 3.0)):
                self.verify("disk that sleeps", "force on it [N]", history[f"body_fy:{body}"][60:], mass * G, 2e-2 * G)
            found.append({name: values for name, values in history.items() if name.startswith("body_")})
        self.assertEqual(differences(*found), [])


if __name__ == "__main__":
    unittest.main()
