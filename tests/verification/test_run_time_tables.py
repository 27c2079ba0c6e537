"""Tables against time that jump or turn within steps: steps take means, so that ways and impulses are those of the tables."""
import os
import unittest

import numpy as np

from gravier_runs import differences, each, merged, run_case, write
from small_scenes import Grain, SmallScene, bodies_csv, floats, plane
from time_tables import TimeTable

MASS = 0.7
#: a square wave of 4 Hz whose jumps take a tenth of a step of 1 ms
SQUARE = [0.0, 0.125, 0.1251, 0.2499, 0.25]
#: a pulse of a twentieth of such a step, and rest
PULSE = [0.0, 0.01342, 0.01344, 0.01347, 0.02]
#: a cycle shorter than such a step
SHORT = [0.0, 0.2e-3, 0.25e-3, 0.7e-3]
STEP = 1e-3


def wave(height):
    return [height, height, -height, -height, height]


class TimeTables(SmallScene):
    step = STEP

    def history_of(self, title, table, boundary, steps, **groups):
        """history.csv of a grain far from a boundary that a table drives."""
        directory = self.here(title)
        os.makedirs(directory)
        write(os.path.join(directory, "bodies.csv"), bodies_csv([Grain([9.0, 9.0])]))
        write(os.path.join(directory, "drive.csv"), table.text)
        run = run_case(merged({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "gravity": [0.0, 0.0]},
                               "boundary": [{"name": "wall", "table": "drive.csv", "table_repeats": table.repeats, **boundary}],
                               "time": {"step": self.step, "steps": steps}, "output": {"directory": "results", "every": steps, "boundary_forces": True}}, groups),
                       directory=directory)
        self.assert_status(run, 0)
        self.turns = "turns within steps" in run.stdout
        self.assertEqual("warning" in run.stdout, self.turns, run.stdout)
        return run.history()

    def test_ways(self):
        """The way of a plane after any number of steps is that of its table: the mean of its integrals half a step before and after the end of the step."""
        for title, times, speeds, repeats, steps, turns in (
                ("square wave", SQUARE, wave(0.1), True, 10100, False), ("pulses", PULSE, [0.0, 0.0, 7.0, 0.0, 0.0], True, 3007, True),
                ("cycles within steps", SHORT, [1.0, 2.0, -4.0, 1.0], True, 1000, True), ("sudden start", [0.0, 1e-5, 5.0], [0.0, 1.0, 1.0], False, 300, False),
                ("late start", [0.0305, 0.0306, 0.07, 0.1], [-0.5, 1.0, 1.0, 0.0], False, 300, False)):
            table = TimeTable(times, {"vx": speeds}, repeats)
            found = self.history_of(f"ways, {title}", table, plane([0.0, 0.0], [0.0, 1.0]), steps)["position_x:wall"]
            ways = table.ways("vx", STEP, steps)[1:]
            self.verify(f"way by a table, {title}", "way [m]", found, ways, 1e-9 * np.abs(ways).max())
            self.assertEqual(self.turns, turns, title)
            if title in ("square wave", "sudden start"):
                # far from jumps it is the integral itself
                self.verify(f"way by a table, {title}", "way at the end [m]", found[-1], table.integral("vx", [STEP * steps])[0], 1e-9 * abs(found[-1]))

    def test_ways_by_velocities_at_the_end(self):
        """With theta = 1 the way is off by half a step times the change of the velocity since the start, and by no more after 40 cycles."""
        table = TimeTable(SQUARE, {"vx": wave(0.1)}, True)
        found = self.history_of("theta", table, plane([0.0, 0.0], [0.0, 1.0]), 10200, time={"theta": 1.0})["position_x:wall"]
        rates = table.rates("vx", STEP, 10200)
        self.verify("way by a table, theta = 1", "way [m]", found, table.ways("vx", STEP, 10200)[1:] + 0.5 * STEP * (rates[1:] - rates[0]), 1e-11)
        self.verify("way by a table, theta = 1", "way after 40 cycles and a half [m]", found[10099], table.integral("vx", [10.1])[0], 1e-11)

    def test_angles(self):
        """A plane that a table turns to and fro: its angle is the integral of the table."""
        table = TimeTable(SQUARE, {"omega": wave(2.0)}, True)
        record = self.play("angles", [Grain([90.0, 90.0])], [plane([0.0, 0.0], [0.0, 1.0], table="drive.csv", table_repeats=True)], steps=2060,
                           files={"drive.csv": table.text}, output={"every": 10})
        normal = record.boundary["normal"][:, 0]
        angle = table.ways("omega", STEP, 2060)[::10]
        self.verify("angle by a table", "angle [rad]", np.arctan2(-normal[:, 0], normal[:, 1]), angle, 1e-11)

    def test_work(self):
        """A plane that a table begins to turn pushes a disk far from its pivot: it does the work that the disk has as energy, and nothing is dissipated."""
        table = TimeTable([0.0, 0.0105, 0.0106], {"omega": [0.0, 0.0, 0.2]})
        record = self.play("work", [Grain([0.0, 0.05], radius=0.05, mass=MASS)], [plane([0.0, 0.0], [0.0, 1.0], pivot=[-10.0, 0.0], table="drive.csv")], steps=12,
                           files={"drive.csv": table.text}, output={"energy": True})
        history, energy = record.run.history(), 0.5 * MASS * 2.0**2
        self.verify("work of a boundary that a table turns", "work of the boundary [J]", history["boundary_work"][-1], energy, 1e-3 * energy)
        self.verify("work of a boundary that a table turns", "dissipated energy [J]", history["dissipated_normal"][-1], 0.0, 1e-6 * energy)

    def test_forces(self):
        """A free boundary has the momentum of the integral of its force, whatever pulses lie within steps."""
        for title, times, forces, repeats, steps in (("square wave", SQUARE, wave(10.0), True, 5000), ("pulses", PULSE, [0.0, 0.0, 700.0, -10.0, 0.0], True, 1000),
                                                     ("one pulse", [0.5002, 0.5003, 0.5004], [0.0, 5e3, 0.0], False, 600),
                                                     ("cycles within steps", SHORT, [1.0, 20.0, -3.0, 1.0], True, 500)):
            table = TimeTable(times, {"fx": forces}, repeats)
            found = self.history_of(f"forces, {title}", table, {"shape": "segment", "point": [0.0, -5.0], "end": [1.0, -5.0], "free": [True, False], "mass": MASS},
                                    steps)["position_x:wall"]
            speed = np.concatenate([[0.0], table.integral("fx", STEP * np.arange(1, steps + 1))]) / MASS
            way = 0.5 * STEP * np.cumsum(speed[1:] + speed[:-1])
            self.verify(f"force by a table, {title}", "way [m]", found, way, 1e-9 * np.abs(way).max())

    def test_pressures(self):
        """A lid on which a table presses in pulses has the impulse of pressure and area; before a table begins its first row counts."""
        table = TimeTable([0.02, 0.0301, 0.0302, 0.0303], {"pressure": [300.0, 300.0, 9000.0, 0.0]})
        found = self.history_of("pressure", table, plane([0.0, 9.5], [0.0, -1.0], free=[False, True], mass=500.0), 100, scene={"period": [20.0, 0.0]})["position_y:wall"]
        speed = -20.0 * np.concatenate([[0.0], table.integral("pressure", STEP * np.arange(1, 101))]) / 500.0
        self.verify("pressure by a table", "place [m]", found - 9.5, 0.5 * STEP * np.cumsum(speed[1:] + speed[:-1]), 1e-11)

    def test_gravity(self):
        """A grain has the velocity of the integral of gravity; history.csv has the means that acted."""
        def check(dimension):
            table = TimeTable(PULSE, {name: factor * np.array([0.0, 0.0, 300.0, -100.0, 0.0]) for name, factor in zip(("gx", "gy", "gz")[:dimension], (1.0, -2.0, 3.0))},
                              True)
            record = self.play(f"gravity {dimension}", [Grain([0.0] * dimension)], steps=400, scene={"gravity_table": "g.csv", "gravity_table_repeats": True},
                               files={"g.csv": table.text}, output={"every": 20})
            names = list(table.columns)
            times = STEP * np.arange(0, 401, 20)
            speed = np.transpose([table.integral(name, times) for name in names])
            self.verify(f"gravity by a table, {dimension}D", "velocity [m/s]", record.velocity[:, 0], speed, 1e-11)
            written = [record.run.history()[f"gravity_{name[1]}"] for name in names]
            np.testing.assert_allclose(written, [table.loads(name, STEP, 400) for name in names], rtol=0, atol=1e-9)
        self.both(check)

    def test_constants_beside_columns(self):
        """Constants along and about other axes than those of the columns stay in force; one that a column replaces is refused."""
        def check(dimension):
            axes = np.eye(dimension)
            keys = {"table": "drive.csv", "velocity": floats(0.25 * axes[1]), "rotation": [0.5] if dimension == 2 else [0.0, 0.0, 0.5]}
            table = TimeTable([0.0, 0.01], {"vx": [2.0, 2.0]} if dimension == 2 else {"vx": [2.0, 2.0], "wx": [0.0, 0.0]})
            record = self.play(f"beside {dimension}", [Grain(9.0 * axes[0])], [plane(-axes[1], axes[1], **keys)], steps=10, files={"drive.csv": table.text})
            self.verify(f"constants beside columns, {dimension}D", "velocity [m/s]", record.boundary["velocity"][1:, 0, :dimension], 2.0 * axes[0] + 0.25 * axes[1], 1e-15)
            angle = 0.5 * record.time
            self.verify(f"constants beside columns, {dimension}D", "angle [rad]", np.arctan2(-record.boundary["normal"][:, 0, 0], record.boundary["normal"][:, 0, 1]),
                        angle, 1e-13)
        self.both(check)
        directory = self.here("replaced")
        os.makedirs(directory)
        write(os.path.join(directory, "drive.csv"), TimeTable([0.0], {"vx": [2.0], "wz": [1.0]}).text)
        run = run_case({"scene": {"dimension": 3, "bodies": "lattice", "lattice_count": [1, 1, 1], "radius_min": 0.05, "radius_max": 0.05},
                        "boundary": [{"name": "plate", **plane([0.0, -1.0, 0.0], [0.0, 1.0, 0.0]), "table": "drive.csv", "rotation": [0.0, 1.0, 0.5]}],
                        "time": {"step": STEP, "steps": 1}}, directory=directory)
        self.assert_status(run, 2)
        self.assertEqual(run.stderr, "gravier: error: case.nml: &boundary 'plate' rotation: 5.000E-01 about z: expected 0, since the column wz of drive.csv replaces it\n")

    def test_strains(self):
        """A periodic cell that a table shears to and fro: its shear is the integral of the rate, but for the first half step, in which it starts from rest."""
        table = TimeTable(SQUARE, {"shear_rate_xy": wave(1.0)}, True)
        directory = self.here("strains")
        os.makedirs(directory)
        write(os.path.join(directory, "bodies.csv"), bodies_csv([Grain([0.2, 0.2]), Grain([0.6, 0.6])]))
        write(os.path.join(directory, "cell.csv"), table.text)
        run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "gravity": [0.0, 0.0], "period": [0.9, 0.9],
                                  "cell_table": "cell.csv", "cell_table_repeats": True},
                        "time": {"step": STEP, "steps": 2060}, "output": {"directory": "results", "every": 2060}}, directory=directory)
        self.assert_status(run, 0)
        self.assertNotIn("warning", run.stdout)
        shear = table.ways("shear_rate_xy", STEP, 2060)[1:] - 0.5 * STEP * table.rates("shear_rate_xy", STEP, 0)[0]
        self.verify("shear by a table", "shear", run.history()["cell_shear_xy"], shear, 1e-11)

    def test_bits_and_energy(self):
        """Disks on a floor that jumps to and fro, under a lid on which pulses press and gravity that comes in pulses: the same bits on more ranks, after a
        restart between two jumps and with more steps, and a balance of energies that closes."""
        disks = [Grain([0.1 * i + 0.05 * (j % 2), 0.05 + 0.0867 * j], radius=0.05) for j in range(4) for i in range(8)]
        tables = {"floor.csv": TimeTable([0.0, 0.0101, 0.0102, 0.0203, 0.0204], {"vx": wave(0.2)}, True), "g.csv": TimeTable(PULSE, {"gy": [-9.0, -9.0, -900.0, -9.0, -9.0]}, True),
                  "lid.csv": TimeTable(SHORT, {"fy": [-10.0, -90.0, -10.0, -10.0]}, True)}
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "period": [0.8, 0.0], "friction": 0.4, "gravity_table": "g.csv", "gravity_table_repeats": True},
                "boundary": [{"name": "floor", **plane([0.0, 0.0], [0.0, 1.0]), "table": "floor.csv", "table_repeats": True},
                             {"name": "lid", **plane([0.0, 0.361], [0.0, -1.0]), "free": [False, True], "mass": 2.0, "table": "lid.csv", "table_repeats": True}],
                "time": {"step": STEP, "steps": 60}, "solver": {"method": "schwarz"}, "decomposition": {"subdomains": 3},
                "output": {"directory": "results", "every": 60, "energy": True, "checkpoint_every": 31}}

        def run_in(title, ranks, *ends):
            directory = self.here(title)
            os.makedirs(directory)
            write(os.path.join(directory, "bodies.csv"), bodies_csv(disks))
            for name, table in tables.items():
                write(os.path.join(directory, name), table.text)
            for k, steps in enumerate(ends):
                run = run_case(merged(case, {"time": {"steps": steps}}), ranks, directory, ["--restart"] if k > 0 else [])
                self.assert_status(run, 0)
            return run
        runs = each(run_in, [("one rank", 1, 60), ("three ranks", 3, 60), ("restart", 1, 31, 60)])
        first = runs[0].results()
        for run in runs[1:]:
            found = run.results()
            for value in ("bodies/position", "bodies/velocity", "boundaries/position", "boundaries/velocity", "contacts/impulse"):
                self.assertEqual(differences({value: first[f"/steps/60/{value}"]}, {value: found[f"/steps/60/{value}"]}), [], run.directory)
        history = runs[0].history()
        self.assertGreater(np.abs(np.diff(history["boundary_work"])).max(), 1e-3)
        scale = sum(np.abs(history[name]).max() for name in ("kinetic_energy", "load_work", "boundary_work", "dissipated_normal", "dissipated_friction"))
        self.assertLess(np.abs(history["energy_error"]).max(), 1e-12 * scale)


if __name__ == "__main__":
    unittest.main()
