"""What scripts and users rely on: options of the command, exit statuses, names, shapes and types in the results."""
import os
import re
import unittest

import h5py
import numpy as np

from gravier_runs import RunTestCase, differences, gravier, merged, namelist, run_case, steps_of, write

DISKS = {
    "scene": {"title": "a few disks", "dimension": 2, "bodies": "lattice", "lattice_count": [6, 5], "radius_min": 0.008,
              "radius_max": 0.012, "friction": 0.3},
    "time": {"step": 2e-3, "steps": 40},
    "solver": {"method": "nscdd", "tolerance": 1e-3},
    "decomposition": {"subdomains": 3},
    "output": {"directory": "results", "every": 15, "trace": True, "final_bodies": True},
}
SPHERES = merged(DISKS, {"scene": {"dimension": 3, "lattice_count": [3, 3, 4]}, "time": {"steps": 40}})


class Commands(RunTestCase):

    def test_version(self):
        for ranks in (1, 2):
            run = gravier("--version", ranks=ranks, directory=self.scratch)
            self.assert_status(run, 0)
            self.assertEqual(run.stderr, "")
            self.assertRegex(run.stdout, r"\AGravier \d+\.\d+\.\d+ ")
            self.assertEqual(run.stdout.count("Gravier"), 1, "one rank speaks")
            for library in ("HDF5", "MUMPS", "METIS", "MPI"):
                self.assertIn(library, run.stdout)

    def test_help(self):
        for word in ("--help", "-h"):
            run = gravier(word, ranks=2, directory=self.scratch)
            self.assert_status(run, 0)
            self.assertEqual(run.stdout.count("usage: gravier CASE.nml"), 1)
            for expected in ("--check", "--version", "--keys", "exit status: 0", "2 bad input", "3 a solve", "4 anything else"):
                self.assertIn(expected, run.stdout)

    def test_keys(self):
        run = gravier("--keys", directory=self.scratch)
        self.assert_status(run, 0)
        for expected in ("&scene", "&time", "&solver", "&decomposition", "&enriched", "&output", "gravity", "steps", "tolerance",
                         "max_iterations", "sweeps", "check_every", "warm_start", "partition", "grid", "subdomains",
                         "repartition_every", "direction_unit", "cg_tolerance", "directory", "every", "trace"):
            self.assertIn(expected, run.stdout)

    def test_a_partition_that_cannot_be(self):
        """A scene that shrinks until it fills fewer cells than there are subdomains keeps its partition, and says why."""
        rows = [f"{k + 1},0.01,1.0,{k % 2},{0.05 * (k // 2)},{10 - 20 * (k % 2)},0" for k in range(4)]
        bodies = write(self.here("shrinks.csv"), "id,radius,mass,x,y,vx,vy\n" + "\n".join(rows) + "\n")
        case = {"scene": {"bodies": "file", "bodies_file": bodies, "gravity": [0.0, 0.0]}, "time": {"step": 1e-3, "steps": 52},
                "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 64, "repartition_every": 10}}
        for ranks in (1, 2):
            run = run_case(case, ranks, self.here(f"shrinks {ranks}"))
            self.assert_status(run, 0)
            self.assertIn("warning     space cannot be divided anew, and the old partition is kept: &decomposition subdomains = 64: the "
                          "scene is too small for so many subdomains; expected at most 8 for this scene\n", run.stdout)
            self.assertIn("warnings    partitions refused 2\n", run.stdout)

    def test_check(self):
        directory = self.here("check")
        os.makedirs(directory)
        write(os.path.join(directory, "case.nml"), namelist(DISKS))
        before = os.listdir(directory)
        outputs = []
        for ranks in (1, 2):
            run = gravier("--check", "case.nml", ranks=ranks, directory=directory)
            self.assert_status(run, 0)
            self.assertEqual(run.stderr, "")
            for expected in ("a few disks", "30 grains, 3 boundaries", "subdomains 3", "2D: friction, rotation, gravity", "off         restitution",
                             "contacts", "interface: 0 bodies, 1 interactions", "bytes of each item", "MiB at most on a rank while it runs", " a contact, ",
                             "nothing was run", "tolerance = 0.001"):
                self.assertIn(expected, run.stdout)
            outputs.append([line for line in run.stdout.splitlines()
                            if not line.startswith("ranks") and "on the rank with most" not in line and "at most on a rank while" not in line])
        self.assertEqual(*outputs)
        self.assertEqual(os.listdir(directory), before)
        # bodies of the interface by the number of subdomains that share them
        run = run_case(merged(DISKS, {"decomposition": {"subdomains": 6}}), 1, self.here("shared"))
        self.assertRegex(run.stdout, r"interface: \d+ bodies \(\d+ in 2 subdomains(, \d+ in \d subdomains)*\), \d+ interactions\n")
        for total, parts in re.findall(r"interface: (\d+) bodies \((.*?)\)", run.stdout):
            self.assertEqual(int(total), sum(int(part.split()[0]) for part in parts.split(", ")))

    def test_check_says_what_is_off(self):
        directory = self.here("off")
        os.makedirs(directory)
        write(os.path.join(directory, "case.nml"),
              namelist(merged(SPHERES, {"scene": {"friction": 0.0, "gravity": [0.0, 0.0, 0.0]}})))
        run = gravier("--check", "case.nml", directory=directory)
        for expected in ("3D: nothing", "off         friction, rotation, restitution, ", ", gravity, body force, removal, insertion, moving cell, bonds\n", "3 degrees of freedom a grain",
                         "1 unknowns a contact"):
            self.assertIn(expected, run.stdout)

    def test_options_in_force_are_an_input_file(self):
        """What the log prints as the options in force, defaults included, runs as the case did."""
        first = run_case(DISKS, 1, self.here("first"))
        block = first.stdout.split("options in force\n")[1]
        lines = block.splitlines()
        text = "\n".join(lines[:max(k for k, line in enumerate(lines) if line.strip() == "/") + 1])
        os.makedirs(self.here("second"))
        write(self.here("second", "case.nml"), text + "\n")
        second = gravier("case.nml", directory=self.here("second"))
        self.assert_status(second, 0)
        found = [{name: value for name, value in run.results().items() if not name.startswith("/run")} for run in (first, second)]
        self.assertEqual(differences(*found), [])

    def test_check_refuses(self):
        """What a run refuses, the check refuses."""
        directory = self.here("refuse")
        os.makedirs(directory)
        for bad, word in (({"time": {"step": -1.0}}, "step"), ({"decomposition": {"subdomains": 1000}}, "subdomains"),
                          ({"scene": {"bodies_file": "x.csv"}}, "bodies_file")):
            write(os.path.join(directory, "case.nml"), namelist(merged(DISKS, bad)))
            run = gravier("--check", "case.nml", ranks=2, directory=directory)
            self.assert_status(run, 2)
            self.assertEqual(run.stderr.count("\n"), 1)
            self.assertIn(word, run.stderr)


class Results(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.runs = {dimension: run_case(case, 2, os.path.join(cls.scratch, f"{dimension}D"))
                    for dimension, case in ((2, DISKS), (3, SPHERES))}

    def test_status_and_files(self):
        for run in self.runs.values():
            self.assert_status(run, 0)
            self.assertEqual(run.stderr, "")
            self.assertEqual(sorted(os.listdir(run.path("results"))),
                             ["final_bodies.h5", "history.csv", "results.h5", "run.log", "trace.csv"])
            with open(run.path("results", "run.log"), encoding="utf-8") as file:
                self.assertEqual(file.read(), run.stdout)
            self.assertRegex(run.stdout, "all 40 steps reached the (accuracy|tolerance); results in results")

    def test_tables(self):
        for run in self.runs.values():
            with open(run.path("results", "history.csv"), encoding="ascii") as file:
                self.assertTrue(file.readline().startswith(
                    "step,time,contacts,iterations,sweeps,residual,velocity_error,velocity_scale,jump,max_overlap,kinetic_energy,wall_seconds"))
            with open(run.path("results", "trace.csv"), encoding="ascii") as file:
                self.assertEqual(file.readline(), "step,iteration,residual,velocity_error,jump\n")
            history, trace = run.history(), run.trace()
            self.assertEqual(list(history["step"]), list(range(1, 41)))
            np.testing.assert_allclose(history["time"], 2e-3 * history["step"], rtol=1e-15)
            self.assertTrue(np.array_equal(history["sweeps"], history["iterations"]))
            self.assertTrue(np.all(history["residual"] <= 1e-3))
            self.assertGreater(history["contacts"][-1], 30)
            # the last check of a step is what the history has
            for step in range(1, 41):
                of_step = trace["step"] == step
                self.assertEqual(trace["iteration"][of_step][0], 0)
                self.assertEqual(trace["iteration"][of_step][-1], history["iterations"][step - 1])
                self.assertEqual(trace["residual"][of_step][-1], history["residual"][step - 1])

    def test_error_column(self):
        run = run_case({"scene": {"bodies": "column", "gravity": [0.0, -1.0, 0.0]}, "time": {"step": 1.0, "steps": 1},
                        "solver": {"criterion": "error", "tolerance": 1e-6}, "output": {"directory": "results", "trace": True}},
                       directory=self.here("column"))
        self.assert_status(run, 0)
        with open(run.path("results", "trace.csv"), encoding="ascii") as file:
            self.assertEqual(file.readline(), "step,iteration,residual,velocity_error,jump,error\n")
        self.assertLessEqual(run.trace()["error"][-1], 1e-6)
        # before the first sweep no impulse is right
        self.assertEqual(run.trace()["error"][0], 1.0)

    def test_error_that_is_not_known(self):
        """The criterion 'error' is refused where something else than gravity acts on the column."""
        column = {"scene": {"bodies": "column", "column_count": 4, "friction": 0.0}, "time": {"step": 1e-3, "steps": 40},
                  "solver": {"criterion": "error", "tolerance": 1e-6}}
        ground = "where there is a boundary beside the ground, or the ground moves or goes away"
        for name, case, what in (
                ("goes", {"boundary": [{"name": "w", "shape": "wall", "wall": "-y", "remove_at": 0.005}]}, ground),
                ("moves", {"boundary": [{"name": "w", "shape": "wall", "wall": "-y", "velocity": [0.0, 1.0]}]}, ground),
                ("lid", {"boundary": [{"name": "w", "shape": "plane", "point": [0.0, 9.0], "normal": [0.0, -1.0]}]}, ground),
                ("pulled", {"scene": {"body_force": [0.0, -1.0]}}, "where a gravity_table or a body_force acts"),
                ("table", {"scene": {"gravity_table": "g.csv"}}, "where a gravity_table or a body_force acts")):
            directory = self.here(f"not known {name}")
            os.makedirs(directory)
            write(os.path.join(directory, "g.csv"), "time,gy\n0,-9.81\n")
            run = run_case(merged(column, case), directory=directory)
            self.assert_status(run, 2)
            self.assertIn(f"case.nml: &solver criterion = 'error': expected another {what}: the impulses of the column alone are known", str(run))
        named = run_case(merged(column, {"time": {"steps": 1}, "boundary": [{"name": "w", "shape": "wall", "wall": "-y", "friction": 0.2}]}),
                         directory=self.here("not known named"))
        self.assert_status(named, 0)

    def test_layout(self):
        for dimension, n, walls in ((2, 30, 3), (3, 36, 5)):
            run = self.runs[dimension]
            results = run.results()
            steps = [0, 15, 30, 40]
            self.assertEqual(steps_of(results), steps)
            with h5py.File(run.path("results", "results.h5")) as file:
                self.assertEqual(sorted(file), ["boundaries", "run", "steps"])
                self.assertEqual(sorted(file["run"].attrs), ["command", "dimension", "input_text", "version"])
                text = file["run"].attrs["input_text"]
                with open(run.path("case.nml"), encoding="utf-8") as case:
                    self.assertEqual(text.decode() if isinstance(text, bytes) else text, case.read())
                self.assertEqual(file["run"].attrs["dimension"], dimension)
                self.assertEqual(sorted(file["boundaries"]), ["id", "name", "normal", "shape"])
                self.assertEqual(list(file["boundaries/shape"].asstr()), ["plane"] * walls)
                self.assertEqual(list(file["boundaries/name"].asstr()), [f"wall {k}" for k in file["boundaries/id"]])
                self.assertEqual(file["boundaries/normal"].shape, (walls, dimension))
                for step in steps:
                    group = file[f"steps/{step}"]
                    self.assertEqual(group.attrs["step"], step)
                    self.assertAlmostEqual(group.attrs["time"], 2e-3 * step, delta=1e-15)
                    self.assertEqual(sorted(group), ["bodies", "boundaries"] + (["contacts"] if step > 0 else []))
                    self.assert_datasets(group["boundaries"], {
                        "id": ("<i8", (walls,)), "position": ("<f8", (walls, dimension)),
                        "normal": ("<f8", (walls, dimension)), "velocity": ("<f8", (walls, 3 * dimension - 3)),
                        "force": ("<f8", (walls, dimension))})
                    self.assert_datasets(group["bodies"], {
                        "id": ("<i8", (n,)), "position": ("<f8", (n, dimension)), "velocity": ("<f8", (n, 3 * dimension - 3)),
                        "radius": ("<f8", (n,)), "mass": ("<f8", (n,)), "material": ("<i8", (n,))})
                    self.assertEqual(list(group["bodies/id"]), list(range(1, n + 1)))
                    if step > 0:
                        self.check_contacts(group, dimension, run.history()["contacts"][step - 1])
            self.assert_finite(results)

    def check_contacts(self, group, dimension, count):
        c = int(count)
        self.assert_datasets(group["contacts"], {
            "candidate": ("<i8", (c,)), "antagonist": ("<i8", (c,)), "normal": ("<f8", (c, dimension)), "gap": ("<f8", (c,)),
            "impulse": ("<f8", (c, dimension))})
        pairs = list(zip(group["contacts/candidate"][:], group["contacts/antagonist"][:]))
        self.assertEqual(pairs, sorted(set(pairs)), "by candidate, then antagonist, each once")
        np.testing.assert_allclose(np.linalg.norm(group["contacts/normal"][:], axis=1), 1.0, atol=1e-15 * 4)
        impulse = group["contacts/impulse"][:]
        self.assertGreaterEqual(impulse[:, 0].min(initial=0.0), 0.0)
        # Coulomb's cone, but for the rounding of a projection
        self.assertLessEqual((np.linalg.norm(impulse[:, 1:], axis=1) - 0.3 * impulse[:, 0]).max(initial=0.0),
                             1e-15 * impulse[:, 0].max(initial=1.0))

    def assert_datasets(self, group, wanted):
        self.assertEqual({name: (data.dtype.str, data.shape) for name, data in group.items()}, wanted, group.name)

    def test_final_bodies(self):
        """The bodies file is the last state, and a run that reads it starts from there."""
        for dimension, run in self.runs.items():
            last = {name: value for name, value in run.results().items() if name.startswith("/steps/40/bodies/")}
            with h5py.File(run.path("results", "final_bodies.h5")) as file:
                for name in ("id", "position", "velocity", "radius"):
                    self.assertTrue(np.array_equal(file[f"bodies/{name}"], last[f"/steps/40/bodies/{name}"]), name)
                self.assertEqual(sorted(file["bodies"]), ["id", "mass", "position", "radius", "velocity"])
                self.assertEqual(len(file["walls/id"]), 2 * dimension - 1)
            again = run_case({"scene": {"dimension": dimension, "bodies": "file", "friction": 0.3,
                                        "bodies_file": run.path("results", "final_bodies.h5")},
                              "time": {"step": 2e-3, "steps": 0}, "output": {"directory": "results"}},
                             2, self.here(f"again {dimension}"))
            self.assert_status(again, 0)
            for name in ("id", "position", "velocity", "radius"):
                self.assertTrue(np.array_equal(again.results()[f"/steps/0/bodies/{name}"], last[f"/steps/40/bodies/{name}"]), name)

    def test_an_older_run_is_replaced(self):
        directory = self.here("twice")
        run_case(merged(DISKS, {"output": {"every": 1}}), 1, directory)
        run = run_case(merged(DISKS, {"time": {"steps": 2}}), 1, directory)
        self.assert_status(run, 0)
        self.assertEqual(steps_of(run.results()), [0, 2])
        self.assertEqual(len(run.history()["step"]), 2)

    def test_no_steps_and_no_contacts(self):
        run = run_case(merged(DISKS, {"time": {"steps": 0}}), 2, self.here("no steps"))
        self.assert_status(run, 0)
        self.assertEqual(steps_of(run.results()), [0])
        run = run_case(merged(DISKS, {"output": {"contacts": False, "every": 0}}), 2, self.here("no contacts"))
        self.assert_status(run, 0)
        self.assertEqual(steps_of(run.results()), [40])
        self.assertFalse(any("/contacts" in name for name in run.results()))


if __name__ == "__main__":
    unittest.main()
