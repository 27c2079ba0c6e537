"""Velocity, spin and power of boundaries in history.csv against scenes whose answer is known, and the works of all boundaries against those of the energy balance."""
import unittest

import numpy as np

from gravier_runs import gravier, write
from small_scenes import G, Grain, SmallScene, floats, plane

RADIUS, MASS = 0.05, 0.3
POWER = {"boundary_power": True, "boundary_forces": True, "boundary_moments": True, "energy": True}


class BoundaryPower(SmallScene):

    def check_work(self, history, step):
        """What boundaries give to the grains is the work on boundaries less what those that forces move keep."""
        given = sum(np.cumsum(values) for name, values in history.items() if name.startswith("power:")) * step
        kept = history["kinetic_boundaries"] - history["kinetic_boundaries"][0]
        self.assertGreater(np.abs(history["boundary_work"]).max(), 0.0)
        np.testing.assert_allclose(given - given[0], history["boundary_work"] - history["boundary_work"][0] - kept, rtol=0, atol=1e-12 * np.abs(history["boundary_work"]).max())

    def test_shear_wall(self):
        """A belt gives a block that slides on it mu m g u, until both go together."""
        def check(dimension):
            mu, up = 0.4, np.eye(dimension)[-1]
            belt = 0.8 * (np.array([1.0, 0.0]) if dimension == 2 else np.array([0.6, -0.8, 0.0]))
            record = self.play(f"belt {dimension}", [Grain(RADIUS * up, radius=RADIUS, mass=MASS)],
                               [plane(0 * up, up, velocity=floats(belt), friction=mu, name="belt")], -G * up, 150, scene={"rotation": False}, output=POWER)
            history, case = record.run.history(), f"block on a belt, {dimension}D"
            slides = history["time"] < 0.8 / (mu * G) - 2 * self.step
            self.assertTrue(slides.any() and not slides.all())
            self.verify(case, "power while it slides [W]", history["power:belt"][slides], mu * MASS * G * 0.8, 1e-10)
            self.verify(case, "power afterwards [W]", history["power:belt"][history["time"] > 0.8 / (mu * G) + 2 * self.step], 0.0, 1e-9)
            for d, axis in enumerate("xyz"[:dimension]):
                np.testing.assert_array_equal(history[f"velocity_{axis}:belt"], belt[d])
            for axis in "z" if dimension == 2 else "xyz":
                np.testing.assert_array_equal(history[f"spin_{axis}:belt"], 0.0)
            self.check_work(history, self.step)
        self.both(check)

    def test_drum(self):
        """A drum that turns gives the moment on the grains times its spin: at first mu m g R Omega of a disk at rest at its lowest point, with rolling friction its moment besides. A
        point away from the pivot moves with the lever."""
        ring, rate = 0.4, 3.0
        for rolling in (0.0, 0.1):
            laws = {"friction": 0.3, **({"rolling_friction": rolling} if rolling else {})}
            drum = {"shape": "circle", "point": [0.0, 0.0], "radius": ring, "rotation": rate, "name": "drum", **laws}
            record = self.play(f"drum {rolling}", [Grain([0.0, -(ring - RADIUS)], radius=RADIUS, mass=MASS)], [drum], (0, -G), 400, scene=laws, output=POWER)
            history = record.run.history()
            case = f"disk in a drum, rolling friction {rolling:g}"
            if not rolling:
                self.verify(case, "power of the first step [W]", history["power:drum"][0], 0.3 * MASS * G * ring * rate, 1e-9)
            whole = np.abs(history["power:drum"]).max()
            self.verify(case, "power [W]", history["power:drum"], -rate * history["moment_z:drum"], 2e-3 * whole)
            np.testing.assert_array_equal(history["spin_z:drum"], rate)
            self.check_work(history, self.step)
        arm = {"shape": "segment", "point": [0.5, 0.0], "end": [1.0, 0.0], "pivot": [0.0, 0.0], "rotation": rate, "velocity": [0.2, 0.0], "name": "arm"}
        history = self.play("arm", [Grain([0.0, 5.0], radius=RADIUS)], [arm], (0, 0), 100, output=POWER).run.history()
        way = np.array([history[f"position_{axis}:arm"] for axis in "xy"])
        lever = way - np.array([0.2 * history["time"], 0.0 * history["time"]])
        speed = np.array([history[f"velocity_{axis}:arm"] for axis in "xy"])
        self.verify("arm that turns", "velocity of its point [m/s]", speed, [0.2 - rate * lever[1], rate * lever[0]], 1e-12)

    def test_piston(self):
        """A piston that its weight pulls down falls freely with no power. In the steps in which it meets a grain on the floor it gives its mean speed times what it loses of its
        momentum and the impulse of its weight, and nothing at rest."""
        heavy = 2.0
        up = np.array([0.0, 1.0])
        piston = plane([0.0, 2 * RADIUS + 0.02], -up, free=[False, True], force=[0.0, -heavy * G], mass=heavy, name="piston")
        record = self.play("piston", [Grain(RADIUS * up, radius=RADIUS, mass=MASS)], [plane(0 * up, up, name="floor"), piston], -G * up, 200, output=POWER)
        history = record.run.history()
        meets = int(np.argmax(history["power:piston"] > 0.0))
        fall = slice(0, meets)
        self.assertGreater(meets, 5)
        self.verify("piston that falls", "velocity [m/s]", history["velocity_y:piston"][fall], -G * history["time"][fall], 1e-12)
        self.verify("piston that falls", "power [W]", history["power:piston"][fall], 0.0, 1e-15)
        speed = -history["velocity_y:piston"]
        before, after = speed[:-1], speed[1:]
        self.verify("piston that meets a grain", "power [W]", history["power:piston"][1:], heavy * (before - after + G * self.step) * 0.5 * (before + after) / self.step, 1e-8)
        self.assertGreater(history["power:piston"].sum() * self.step, 0.9 * 0.5 * heavy * speed[meets - 1]**2)
        self.verify("piston at rest", "power [W]", history["power:piston"][meets + 5:], 0.0, 1e-8)
        self.check_work(history, self.step)

    def test_removed(self):
        """A boundary that is removed neither moves nor works."""
        up = np.array([0.0, 1.0])
        lift = plane(0 * up, up, velocity=[0.0, 0.3], name="lift", remove_at=30.5 * self.step)
        history = self.play("removed", [Grain(RADIUS * up, radius=RADIUS, mass=MASS)], [lift], -G * up, 60, output=POWER).run.history()
        gone = history["force_y:lift"] == 0.0
        self.assertEqual((gone[10], gone[-20]), (False, True))
        self.verify("grain on a lift", "power [W]", history["power:lift"][10:29], 0.3 * MASS * G, 1e-9)
        np.testing.assert_array_equal(history["power:lift"][gone], 0.0)
        np.testing.assert_array_equal(history["velocity_y:lift"][-20:], 0.0)
        np.testing.assert_array_equal(history["velocity_y:lift"][:29], 0.3)

    def test_same_bits(self):
        """Columns are the same on two ranks and through a restart, and works those of the balance, with moments against rolling and pivoting."""
        rng = np.random.default_rng(4)
        places = np.array([[x, y, z] for x in range(3) for y in range(2) for z in range(3)]) * 2.05 * RADIUS + rng.uniform(-0.001, 0.001, (18, 3)) + [0.0, 0.0, RADIUS + 0.002]
        grains = [Grain(place, rng.uniform(-0.3, 0.3, 3), radius=RADIUS, mass=MASS) for place in places]
        laws = {"friction": 0.5, "rolling_friction": 0.2, "pivoting_friction": 0.1}
        drum = {"name": "drum", "shape": "cylinder", "axis": [0.0, 0.0, 1.0], "point": [0.1, 0.05, 0.0], "radius": 0.35, "rotation": [0.0, 0.0, 4.0], **laws}
        walls = [plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], name="floor", **{**laws, "rotation": [0.0, 0.0, 2.0], "velocity": [0.1, 0.0, 0.0]}), drum,
                 plane([0.0, 0.0, 0.45], [0.0, 0.0, -1.0], name="lid", free=[False, False, True], force=[0.0, 0.0, -20.0], mass=1.5)]
        more = {"scene": laws, "solver": {"method": "nscdd", "tolerance": 1e-3, "criterion": "residual", "max_iterations": 500}, "decomposition": {"subdomains": 3}}
        found = {}
        for title, ranks in (("one", 1), ("two", 2)):
            found[title] = self.play(title, grains, walls, [0.0, 0.0, -G], 120, ranks, output=POWER, **more).run
        half = self.play("half", grains, walls, [0.0, 0.0, -G], 60, output={**POWER, "checkpoint_every": 60}, **more).run
        with open(half.path("case.nml")) as file:
            text = file.read()
        write(half.path("case.nml"), text.replace("steps = 60", "steps = 120"))
        found["half"] = gravier("--restart", "case.nml", ranks=2, directory=half.directory)
        self.assert_status(found["half"], 0)
        first = found["one"].history()
        self.check_work(first, self.step)
        for title in ("two", "half"):
            other = found[title].history()
            self.assertEqual(list(other), list(first))
            for name, values in first.items():
                if not name.endswith("_seconds"):
                    np.testing.assert_array_equal(other[name], values, name)


if __name__ == "__main__":
    unittest.main()
