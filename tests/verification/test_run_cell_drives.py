"""What moves periodic cells against time, and cells that go on from bodies files."""
import os
import shutil
import unittest

import h5py
import numpy as np

from gravier_runs import merged, run_case, write
from cell_runs import LATTICE, STEP, CellTestCase
from small_scenes import Grain, bodies_csv
from time_tables import TimeTable

import gravier


class CellDrives(CellTestCase):

    def test_table(self):
        """Rates and stresses against time: the cell has the means of rates about the end of each step, and of stresses over it. A table of constants is the keys that have them, and a
        run goes on with its table after a restart."""
        rows = "time,shear_rate_xy,pressure_y\n9,0.2,1\n"
        constant = {"scene": {"cell_shear_rate": None, "cell_pressure": None, "cell_table": "cell.csv"}}
        wanted = self.lattice("keys", {}).results()
        for name, steps in (("constants", (60,)), ("restarted table", (33, 60))):
            here = self.here(name)
            os.makedirs(here)
            write(os.path.join(here, "cell.csv"), rows)
            for k, until in enumerate(steps):
                run = run_case(merged(LATTICE, constant, {"time": {"steps": until}, "output": {"checkpoint_every": 33}}), directory=here,
                               options=["--restart"] if k > 0 else [])
                self.assert_status(run, 0)
            for value in ("bodies/position", "bodies/velocity", "cell/edge", "cell/velocity", "contacts/impulse"):
                np.testing.assert_array_equal(run.results()["/steps/60/" + value], wanted["/steps/60/" + value], err_msg=f"{name} {value}")
        write(os.path.join(here, "cell.csv"), rows.replace("9,0.2", "9,0.3"))
        run = run_case(merged(LATTICE, constant, {"time": {"steps": 70}, "output": {"checkpoint_every": 33}}), directory=here, options=["--restart"])
        self.assert_status(run, 2)
        self.assertIn("contents of cell.csv are not those with which ", run.stderr)
        # a table that repeats is the same table written out
        states = []
        for name, periods in (("repeated table", 1), ("table written out", 5)):
            here = self.here(name)
            os.makedirs(here)
            text = "time,shear_rate_xy,pressure_y\n0,0.0,1.0\n"
            for k in range(periods):
                text += f"{2 * k + 1},0.2,1.5\n{2 * k + 2},0.0,1.0\n"
            write(os.path.join(here, "cell.csv"), text)
            run = run_case(merged(LATTICE, constant, {"scene": {"cell_table_repeats": periods == 1}, "time": {"step": 0.125, "steps": 60}}), directory=here)
            self.assert_status(run, 0)
            states.append(run.results())
        for value in ("bodies/position", "cell/edge", "cell/velocity"):
            np.testing.assert_array_equal(states[0]["/steps/60/" + value], states[1]["/steps/60/" + value], err_msg=value)
        self.assertGreater(np.abs(states[0]["/steps/60/cell/velocity"]).max(), 0.01)
        # without contacts
        here = self.here("table of rates")
        os.makedirs(here)
        grains = [Grain([0.2, 0.2, 0.3], radius=0.01, mass=2.0), Grain([0.7, 0.6, 0.5], radius=0.01, mass=3.0)]
        write(os.path.join(here, "grains.csv"), bodies_csv(grains))
        table = TimeTable([0.0, 0.1, 0.2], {"pressure_z": [3.0, 3.0, 0.0], "shear_rate_yz": [1.5, -1.5, -1.5],
                                            "shear_stress_xy": [0.4, -0.4, 0.0], "strain_rate_x": [-0.5, 0.5, 0.5]})
        write(os.path.join(here, "cell.csv"), table.text)
        run = run_case({"scene": {"dimension": 3, "bodies": "file", "bodies_file": "grains.csv", "gravity": [0.0] * 3, "period": [1.0, 1.5, 0.8],
                                  "cell_table": "cell.csv", "cell_inertia": 0.25},
                        "time": {"step": STEP, "steps": 40}, "output": {"directory": "results", "every": 1}}, directory=here)
        self.assert_status(run, 0)
        found = run.results()
        rate_yz, rate_x = (table.rates(name, STEP, 40)[1:] for name in ("shear_rate_yz", "strain_rate_x"))
        stress, pressure = (table.loads(name, STEP, 40) for name in ("shear_stress_xy", "pressure_z"))
        state = [(np.diag([1.0, 1.5, 0.8]), np.zeros((3, 3)))]
        state += [tuple(found[f"/steps/{step}/cell/{value}"] for value in ("edge", "velocity")) for step in range(1, 41)]
        for k in range(40):
            (edge, velocity), (next_edge, next_velocity) = state[k:k + 2]
            # places of the middle of the step, where its velocities are found
            middle = edge + 0.5 * STEP * velocity
            before, now = (np.linalg.solve(middle, rates).T for rates in (velocity, next_velocity))
            np.testing.assert_allclose([now[1, 2], now[0, 0], now[1, 1]], [rate_yz[k], rate_x[k], 0.0], rtol=0, atol=1e-12)
            volume = np.prod(np.diag(middle))
            for component, force in (((0, 1), stress[k]), ((2, 2), -pressure[k])):
                inertia = 0.25 * 5.0 * middle[component[1], component[1]]**2
                self.assertAlmostEqual(now[component] - before[component], STEP * volume * force / inertia, delta=1e-12)
            np.testing.assert_allclose(next_edge, middle + 0.5 * STEP * next_velocity, rtol=0, atol=1e-12)
        self.assertIn("\ncell        lengths [m]: x 1.000E+00, y 1.500E+00, z 8.000E-01; moved by strain_rate_x of the table, pressure_z of the table, "
                      "shear_stress_xy of the table, shear_rate_yz of the table\n", run.stdout)
        history = run.history()
        last = {name: f"{history[f'cell_{name}'][-1]:.3E}" for name in ("strain_x", "strain_y", "strain_z", "shear_xy", "shear_xz", "shear_yz")}
        self.assertIn("\ncell        since the start of the scene strained by x {strain_x}, y {strain_y}, z {strain_z} and sheared by xy {shear_xy}, "
                      "xz {shear_xz}, yz {shear_yz}\n".format(**last), run.stdout)
        for axis, name in enumerate("xyz"):
            lengths = np.array([edge[axis, axis] for edge, _ in state])
            np.testing.assert_allclose(history[f"cell_strain_{name}"], np.log(lengths[1:] / lengths[0]), rtol=0, atol=1e-14)
        # a shear is the integral of its rate: of that at the start of each half of a step
        rates = [np.linalg.solve(edge, velocity).T[1, 2] for edge, velocity in state]
        np.testing.assert_allclose(history["cell_shear_yz"], np.cumsum(0.5 * STEP * (np.array(rates[:-1]) + rate_yz)), rtol=0, atol=1e-12)
        # a packing under a pressure that is doubled
        here = self.here("doubled")
        os.makedirs(here)
        write(os.path.join(here, "cell.csv"), "time,pressure_x,pressure_y\n0,1,1\n15,1,1\n16,2,2\n")
        run = run_case(merged(LATTICE, constant, {"scene": {"seed": 2}, "time": {"steps": 400}, "output": {"every": 0}}), directory=here)
        self.assert_status(run, 0)
        history = run.history()
        for since, until, held in ((12.0, 15.0, 1.0), (30.0, 40.0, 2.0)):
            late = (history["time"] > since) & (history["time"] <= until)
            for component in ("xx", "yy"):
                self.assertAlmostEqual(np.mean(history[f"stress_{component}"][late]), held, delta=0.05 * held)

    def test_refused_tables(self):
        """What a table may not have is refused by one line, and ups and downs within steps are warned of."""
        here = self.here("tables")
        os.makedirs(here)
        columns = "time strain_rate_x strain_rate_y shear_rate_xy pressure_x pressure_y shear_stress_xy"
        plain = {"scene": {"cell_shear_rate": None, "cell_pressure": None, "cell_table": "cell.csv"}}
        for table, groups, message in (
                ("time,pressure_y\n0,-1\n", {}, "cell.csv: column pressure_y: -1.000E+00: expected pressures >= 0"),
                ("time,strain_rate_y,pressure_y\n0,1,1\n", {}, "cell.csv: columns strain_rate_y and pressure_y: expected one of them"),
                ("time,shear_rate_xy,shear_stress_xy\n0,1,1\n", {}, "cell.csv: columns shear_rate_xy and shear_stress_xy: expected one of them"),
                ("time,shear_rate_yz\n0,1\n", {}, f"cell.csv: column shear_rate_yz is unknown here; known are {columns}"),
                ("time,shear_rate_xy\n0,1\n", {"scene": {"cell_shear_stress": [0.1]}},
                 "cell.csv: column shear_rate_xy: expected none, since a key of &scene moves this component of the cell"),
                ("time,pressure_x\n0,1\n", {"scene": {"cell_strain_rate": [0.1]}},
                 "cell.csv: column pressure_x: expected none, since a key of &scene moves this component of the cell"),
                ("time,pressure_x\n0,1\n", {"time": {"stop_cell_shear": [0.5]}},
                 "case.nml: &time stop_cell_shear: expected 0 for components of the cell that neither a key of &scene nor cell.csv moves"),
                ("time,pressure_y\n0,1\n", {"scene": {"period": [7.6, 0.0]}},
                 "case.nml: &scene cell_strain_rate, or a stress in its place: expected a period along y"),
                ("time,shear_rate_xy\n0,1\n", {"scene": {"period": [7.6, 0.0]}},
                 "case.nml: &scene cell_shear_rate, or a stress in its place: expected a period along y"),
                ("time,pressure_y\n0,1\n", {"solver": {"method": "newton"}},
                 "case.nml: &solver method = 'newton': expected another method where stresses drive the periodic cell")):
            write(os.path.join(here, "cell.csv"), table)
            run = run_case(merged(LATTICE, plain, groups), directory=here, options=["--check"])
            self.assert_status(run, 2)
            self.assertEqual(run.stderr, f"gravier: error: {message}\n")
        write(os.path.join(here, "cell.csv"), "time,shear_rate_xy\n" + "".join(f"{0.01 * k},{(-1)**k}\n" for k in range(600)))
        run = run_case(merged(LATTICE, plain), directory=here, options=["--check"])
        self.assert_status(run, 0)
        self.assertRegex(run.stdout, r"warning     &scene cell_table = 'cell.csv' turns within steps: they keep \d+ % of its ups and downs")

    def test_states_of_a_cell_that_moves(self):
        """A cell in the middle of its motion goes on from a bodies file, that of the run or one of gravier.write_bodies, where its edges and
        their velocities are: the same places after as many steps, and tangential springs as far stretched. Where nothing moves it any longer, its grains keep their velocities beside
        its own."""
        packing = {"scene": {"bodies": "lattice", "lattice_count": [6, 6], "radius_min": 0.4, "radius_max": 0.6, "density": 1.0, "gravity": [0.0, 0.0],
                             "overlap_projection": False, "period": [7.6, 7.6], "cell_shear_rate": [0.3], "cell_pressure": [0.0, 1.0]},
                   "time": {"step": 0.05, "steps": 160}, "solver": {"criterion": "residual", "tolerance": 1e-12, "max_iterations": 50000},
                   "output": {"directory": "results", "every": 10, "final_bodies": True, "final_forces": True}}
        space = {"scene": {"dimension": 3, "lattice_count": [4, 7, 4], "gravity": [0.0] * 3, "period": [5.1, 8.9, 5.1], "list_steps": 0.0,
                           "cell_shear_rate": [0.3, 0.0, 0.2], "cell_pressure": [0.0, 1.0, 0.0], "cell_strain_rate": [-0.03, 0.0, 0.0]},
                 "time": {"steps": 120}}
        springs = {"scene": {"wall_material": "m"}, "material": [{"name": "m"}], "time": {"step": 0.02, "steps": 800},
                   "law": [{"materials": ["m"], "kind": "elastic", "normal_stiffness": 300.0, "friction": 0.4}]}
        for name, case in (("plane", packing), ("space", merged(packing, space)), ("springs", merged(packing, springs))):
            split = case["time"]["steps"] - 10
            whole = run_case(case, directory=self.here(f"whole {name}"))
            first = run_case(merged(case, {"time": {"steps": split}}), directory=self.here(f"first {name}"))
            for run in (whole, first):
                self.assert_status(run, 0)
            wanted, file = whole.results(), first.path("results", "final_bodies.h5")
            written = self.here(f"written {name}.h5")
            gravier.write_bodies(gravier.Run(first.path("results")), written)
            cell = gravier.BodiesFile(file).cell()
            np.testing.assert_array_equal(cell.edge, wanted[f"/steps/{split}/cell/edge"])
            np.testing.assert_array_equal(cell.velocity, wanted[f"/steps/{split}/cell/velocity"])
            self.assertGreater(np.abs(cell.edge[1, 0]), 0.1)
            goes_on = merged(case, {"scene": {"bodies": "file", "bodies_file": "bodies.h5", "lattice_count": None, "radius_min": None, "radius_max": None,
                                              "period": None}, "time": {"steps": 10}})
            still = merged(goes_on, {"scene": {key: None for key in case["scene"] if key.startswith("cell_")}, "time": {"steps": 1}})
            # velocities in results have single precision
            for title, path, ranks, near in (("goes on", file, 1, 1e-8), ("in parts", file, 2, 1e-8), ("written", written, 1, 1e-4)):
                here = self.here(f"{title} {name}")
                os.makedirs(here)
                shutil.copy(path, os.path.join(here, "bodies.h5"))
                parts = {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4}} if title == "in parts" else {}
                run = run_case(merged(goes_on, parts), ranks, here)
                self.assert_status(run, 0)
                self.assertGreater(len(wanted[f"/steps/{split}/contacts/impulse"]), 20)
                for value in ("cell/edge", "cell/velocity"):
                    np.testing.assert_allclose(run.results()[f"/steps/10/{value}"], wanted[f"/steps/{split + 10}/{value}"], rtol=0, atol=near, err_msg=title + value)
                places = [state[f"/steps/{step}/bodies/position"] + state[f"/steps/{step}/bodies/image"] @ state[f"/steps/{step}/cell/edge"]
                          for state, step in ((run.results(), 10), (wanted, split + 10))]
                # places are images of each other: a new run counts crossings from 0
                off = np.linalg.solve(wanted[f"/steps/{split + 10}/cell/edge"].T, (places[0] - places[1]).T).T
                np.testing.assert_allclose(off, np.round(off), rtol=0, atol=near)
            run = run_case(still, directory=here)
            self.assert_status(run, 0)
            self.assertRegex(run.stdout, r"\ncell        lengths \[m\]: x .*; tilts \[m\]: xy .*; moved by nothing\n")
            found = gravier.BodiesFile(file)
            gradient = np.linalg.solve(cell.edge, cell.velocity).T
            bodies = found.bodies()
            middle = found.origin + 0.5 * found.period
            peculiar = bodies.velocity - (bodies.position - middle) @ gradient.T
            mass = bodies.mass
            self.assertLess(np.abs(run.results()["/steps/1/cell/velocity"]).max(), 1e-14)
            np.testing.assert_array_equal(run.results()["/steps/1/cell/edge"], cell.edge)
            # contacts within the cell and across it change no momentum
            np.testing.assert_allclose(mass @ run.results()["/steps/1/bodies/velocity"][:, :len(middle)], mass @ peculiar, rtol=0, atol=1e-6 * mass.sum())
            # a cell that is sheared is no place for what one that moves has no room for, and has its own lengths
            run = run_case(merged(goes_on, {"scene": {"period": case["scene"]["period"]}}), directory=here)
            self.assert_status(run, 2)
            self.assertIn("&scene period: expected none, since bodies.h5 has the edges of the cell", run.stderr)
            run = run_case(merged(still, {"solver": {"sleeping": True}}), directory=here)
            self.assert_status(run, 2)
            self.assertIn("&solver sleeping = .true.: expected .false. in a periodic cell that is sheared", run.stderr)

    def test_a_cell_that_stops(self):
        """A cell that was stretched, and that nothing moves in the run that goes on, is an ordinary one: its grains keep what they had beside it."""
        speeds = np.array([[0.1, -0.2], [0.0, 0.3]])
        found = self.grains("stretched", [Grain(place, speed, radius=0.01) for place, speed in zip(([0.2, 0.3], [0.7, 0.8]), speeds)],
                            {"period": [1.0, 1.0], "cell_strain_rate": [0.4, -0.3]}, 10, 10, output={"final_bodies": True})
        length, rate = (np.diag(found[f"/steps/10/cell/{name}"]) for name in ("edge", "velocity"))
        place, speed = (found[f"/steps/10/bodies/{name}"] for name in ("position", "velocity"))
        case = {"scene": {"bodies": "file", "bodies_file": "results/final_bodies.h5", "gravity": [0.0, 0.0]}, "time": {"step": STEP, "steps": 1},
                "solver": {"sleeping": True}, "output": {"directory": "still", "every": 1}}
        run = run_case(case, directory=self.here("stretched"))
        self.assert_status(run, 0)
        still = gravier.Run(self.here("stretched", "still"))
        np.testing.assert_array_equal(still.period, length)
        self.assertIsNone(still.cell())
        np.testing.assert_allclose(still.bodies().velocity, speed[:, :2] - (place - [0.5, 0.5]) * rate / length, rtol=0, atol=1e-7)

    def test_edges_of_a_bodies_file(self):
        """Edges that are no cell are refused by one line."""
        case = {"scene": {"bodies": "file", "bodies_file": "bodies.h5", "gravity": [0.0, 0.0]}, "time": {"step": STEP, "steps": 1}}
        good = {"origin": [0.0, 0.0], "period": [1.0, 2.0], "edge": [[1.0, 0.0], [0.3, 2.0]], "velocity": [[0.0, 0.0], [0.1, 0.0]]}
        form = ": expected rows with parts along their own axis and the axes before it alone, as far as these are periodic"
        for change, message in ((None, None), ({"velocity": None}, None), ({"edge": None}, "/box/edge: "),
                                ({"edge": [[1.0, 0.1], [0.3, 2.0]]}, "/box/edge" + form), ({"velocity": [[0.0, 0.1], [0.0, 0.0]]}, "/box/velocity" + form),
                                ({"edge": [[np.nan, 0.0], [0.3, 2.0]]}, "/box/edge: lengths along the axes that are not those of /box/period"),
                                ({"edge": [[1.0, 0.0], [0.3, 2.5]]}, "/box/edge: lengths along the axes that are not those of /box/period"),
                                ({"period": [1.0, 0.0], "edge": [[1.0, 0.0], [0.3, 0.0]]}, "/box/edge" + form),
                                ({"edge": [[1.0, 0.0], [np.nan, 2.0]]}, "/box/edge: a number in it is none or too large"),
                                ({"velocity": [[0.0, 0.0], [1e200, 0.0]]}, "/box/velocity: a number in it is none or too large"),
                                ({"edge": [[1.0, 0.0, 0.0], [0.3, 2.0, 0.0]]}, "/box/edge: "), ({"velocity": [[0.0, 0.0]]}, "/box/velocity: 1 rows")):
            here = self.here("edges")
            os.makedirs(here, exist_ok=True)
            with h5py.File(os.path.join(here, "bodies.h5"), "w") as file:
                file["bodies/id"], file["bodies/position"], file["bodies/radius"] = [1], [[0.5, 0.5]], [0.1]
                for name, values in {**good, **(change or {})}.items():
                    if values is not None:
                        file[f"box/{name}"] = values
            run = run_case(case, directory=here, options=["--check"])
            self.assert_status(run, 2 if message else 0)
            if message:
                self.assertEqual(len(run.stderr.splitlines()), 1, run.stderr)
                self.assertIn("bodies.h5: " + message, run.stderr)


if __name__ == "__main__":
    unittest.main()
