"""Runs that start from the forces of contacts that their bodies file gives: forces that are not unique stay as they are given, a packing
that has settled stays settled, bits do not depend on ranks, and files that say what cannot be are refused."""
import os
import shutil
import unittest

import h5py
import numpy as np

from gravier_runs import SOME_RANKS, RunTestCase, contents, differences, gravier, merged, namelist, run_case, write

import gravier as package

G = 9.81
STEP = 1e-3
SAMPLE = {
    "scene": {"dimension": 2, "bodies": "sample", "density": 2500.0, "friction": 0.3, "alert_distance": 0.003},
    "sample": {"preparation": "settled", "count": 150, "radii": "uniform", "radius_min": 0.008, "radius_max": 0.012, "box": 0.25,
               "solid_fraction": 0.5, "file": "sample.h5", "max_steps": 5000},
    "time": {"step": STEP, "steps": 0},
    "solver": {"accuracy": 1e-3, "max_iterations": 5000},
}


def write_bodies(path, bodies, walls, contacts, names=()):
    """A bodies file from dictionaries of datasets."""
    with h5py.File(path, "w") as file:
        for group, rows in (("bodies", bodies), ("walls", walls), ("contacts", contacts)):
            for name, values in (rows or {}).items():
                file[f"{group}/{name}"] = values
        if names:
            file["contacts/boundaries"] = np.array(["\n".join(names)], dtype="S")


def contact_rows(contacts):
    """{(candidate, antagonist or name of a boundary): (normal, force, moment), place}."""
    names = contacts["boundaries"][0].decode().split("\n")
    return {(i, j if j > 0 else names[-1 - j]): (np.concatenate([contacts[name][k] for name in ("normal", "force", "moment")]), contacts["point"][k])
            for k, (i, j) in enumerate(zip(contacts["candidate"][:], contacts["antagonist"][:]))}


def wedge(dimension, part, count=1):
    """A disk or sphere of 2 kg in a right-angled wedge: bodies, boundaries, contacts. The forces along the flanks are this part of the
    weight; a part below 0 points downwards."""
    radius, mass = 0.1, 2.0
    up, side = np.eye(dimension)[-1], np.eye(dimension)[0]
    normals = [(up + side) / np.sqrt(2.0), (up - side) / np.sqrt(2.0)]
    along = [(up - side) / np.sqrt(2.0), (up + side) / np.sqrt(2.0)]
    # of the vertical balance 2 (n + t)/sqrt(2) = m g
    tangential = part * mass * G
    normal = mass * G / np.sqrt(2.0) - tangential
    bodies = {"id": [7], "position": [np.sqrt(2.0) * radius * up], "radius": [radius], "mass": [mass]}
    boundaries = [{"name": name, "shape": "plane", "point": [0.0] * dimension, "normal": list(n)} for name, n in zip(("left", "right"), normals)]
    force = [normal * n + tangential * t for n, t in zip(normals, along)]
    return bodies, boundaries, {"candidate": [7, 7], "antagonist": [-1, -2], "normal": normals, "force": force}


class GivenForces(RunTestCase):
    def start(self, name, groups, file, ranks=1, options=()):
        """Run a case in a directory of its own with a bodies file."""
        directory = self.here(name)
        os.makedirs(directory, exist_ok=True)
        shutil.copy(file, os.path.join(directory, "bodies.h5"))
        return run_case(merged({"scene": {"bodies": "file", "bodies_file": "bodies.h5"}, "time": {"step": STEP, "steps": 1},
                                "output": {"directory": "results", "contacts": True, "every": 1}}, groups), ranks, directory, options)

    def test_forces_that_are_not_unique(self):
        """Each of the forces that hold a disk in a wedge is an equilibrium, and stays; rounding of the place of 1e-17 m is 1e-14 m/s in a
        step of 1e-3 s, of g h = 1e-2 m/s."""
        for dimension in (2, 3):
            kept = []
            for part in (-0.2, 0.0, 0.2):
                bodies, boundaries, contacts = wedge(dimension, part)
                for given in (True, False):
                    name = f"wedge_{dimension}_{part}_{given}"
                    write_bodies(self.here(name + ".h5"), bodies, None, contacts if given else None, ("left", "right") if given else ())
                    run = self.start(name, {"scene": {"dimension": dimension, "friction": 0.6}, "boundary": boundaries}, self.here(name + ".h5"))
                    self.assert_status(run, 0)
                    results = run.results()
                    normal, impulse = results["/steps/1/contacts/normal"], results["/steps/1/contacts/impulse"]
                    size = np.linalg.norm(impulse[:, 1:], axis=1)
                    if not given:
                        kept.append(size[0])
                        continue
                    self.assertIn("2 of its 2 contacts touch in the first step, with 100.0 % of its normal forces", run.stdout)
                    expected = [(f @ n * STEP, np.linalg.norm(f - (f @ n) * n) * STEP) for f, n in zip(np.array(contacts["force"]), normal)]
                    np.testing.assert_allclose(np.stack([impulse[:, 0], size], axis=1), expected, rtol=1e-9, atol=1e-12)
                    self.assertLess(np.abs(results["/steps/1/bodies/velocity"]).max(), 1e-9 * G * STEP)
            # without them every run starts from the same
            np.testing.assert_allclose(kept, kept[0], rtol=1e-12)

    def test_springs_that_are_stretched(self):
        """The same disk on springs that it presses by N/k: each share of its weight that given forces carry along the flanks stays
        with the tangential springs, for twenty steps and over a restart, and nothing is dissipated. Without forces the springs begin
        unstretched, and the disk sinks."""
        stiffness, ratio, steps = 1e5, 0.5, 20
        for dimension, kind in ((2, "elastic"), (3, "elastic"), (3, "hertz")):
            law = {"materials": ["m"], "kind": kind, "friction": 0.6}
            if kind == "elastic":
                law.update(normal_stiffness=stiffness, stiffness_ratio=ratio)
            else:
                law.update(young_modulus=1e7, poisson_ratio=0.3)
            for part in (-0.1, 0.1):
                bodies, boundaries, contacts = wedge(dimension, part)
                normal = contacts["force"][0] @ contacts["normal"][0]
                depth = normal / stiffness
                if kind == "hertz":
                    # E* of two bodies of the same kind, and the radius of the sphere on a plane
                    depth = (0.75 * normal / (1e7 / (2 * (1 - 0.09)) * np.sqrt(0.1))) ** (2 / 3)
                bodies["position"] = [np.array(bodies["position"][0]) * (1 - depth / 0.1)]
                groups = {"scene": {"dimension": dimension, "wall_material": "m"}, "material": {"name": "m"}, "law": law,
                          "boundary": boundaries, "time": {"steps": steps}, "solver": {"accuracy": 1e-9},
                          "output": {"energy": True, "checkpoint_every": steps}}
                moved = {}
                for given in (True, False):
                    name = f"springs_{dimension}_{kind}_{part}_{given}"
                    write_bodies(self.here(name + ".h5"), bodies, None, contacts if given else None, ("left", "right") if given else ())
                    run = self.start(name, groups, self.here(name + ".h5"))
                    self.assert_status(run, 0)
                    moved[given] = np.linalg.norm(run.results()[f"/steps/{steps}/bodies/position"][0] - bodies["position"][0])
                    if given:
                        rested = run
                with self.subTest(dimension=dimension, kind=kind, part=part):
                    self.assertLess(moved[True], 1e-6 * depth)
                    self.assertGreater(moved[False], 1e-2 * depth)
                    found = rested.results()
                    size = np.linalg.norm(found[f"/steps/{steps}/contacts/impulse"][:, 1:], axis=1)
                    np.testing.assert_allclose(size, abs(part) * bodies["mass"][0] * G * STEP, rtol=1e-5)
                    history = rested.history()
                    self.assertIn("% of its normal forces; springs press by their overlaps", rested.stdout)
                    stored = history["elastic_energy"][-1]
                    self.assertGreater(stored, 0.0)
                    for column in ("dissipated_normal", "dissipated_friction", "energy_error"):
                        self.assertLess(np.abs(history[column]).max(), 1e-5 * stored, column)
                    # an account that begins at a restart begins with what the springs hold
                    again = merged(groups, {"time": {"steps": 2 * steps}})
                    os.remove(rested.path("results", "history.csv"))
                    run = self.start(os.path.basename(rested.directory), again, self.here(os.path.basename(rested.directory) + ".h5"), options=["--restart"])
                    self.assert_status(run, 0)
                    self.assertLess(np.abs(run.history()["dissipated_friction"]).max(), 1e-5 * stored)

    def settle(self):
        path = self.here("sample.h5")
        if not os.path.exists(path):
            write(self.here("sample.nml"), namelist(SAMPLE))
            self.assert_status(gravier("sample.nml", directory=self.scratch, program="gravier_sample"), 0)
            with h5py.File(path) as file, h5py.File(self.here("bare.h5"), "w") as bare:
                for group in ("bodies", "walls"):
                    file.copy(group, bare)
        return path, self.here("bare.h5")

    def test_settled_stays_settled(self):
        """With the forces of the packing the normal forces stay theirs, to ten times the `accuracy` of the solves in the mean; a start
        without them finds others, which differ by a tenth and more, since with friction forces are not unique."""
        path, bare = self.settle()
        accuracy, steps = 1e-3, 20
        with h5py.File(path) as file:
            walls = {-1 - k: int(name.split()[-1]) for k, name in enumerate(file["contacts/boundaries"][0].decode().split("\n"))}
            rows = zip(*(file[f"contacts/{key}"][:] for key in ("candidate", "antagonist", "force", "normal")))
            given = {(i, walls.get(j, j)): force @ normal for i, j, force, normal in rows}
        off = {}
        for name, file in (("with", path), ("without", bare)):
            run = self.start(name, {"scene": {"friction": 0.3}, "solver": {"accuracy": accuracy}, "time": {"steps": steps}}, file)
            # the first solve without forces may stagnate at a hundredth of U, in groups of grains that stick
            self.assertIn(run.status, (0,) if name == "with" else (0, 3), str(run))
            self.assertEqual("start       from forces" in run.stdout, name == "with")
            results = run.results()
            rows = zip(*(results[f"/steps/{steps}/contacts/{key}"] for key in ("candidate", "antagonist", "impulse")))
            found = {(i, j): impulse[0] / STEP for i, j, impulse in rows}
            difference = [found.get(pair, 0.0) - force for pair, force in given.items()]
            off[name] = np.linalg.norm(difference) / np.linalg.norm(list(given.values()))
        self.assertLess(off["with"], 10.0 * accuracy)
        self.assertGreater(off["without"], 0.1)

    def test_bits(self):
        """The same on any number of ranks, and after a restart, which does not start from the forces again."""
        path, _ = self.settle()
        groups = {"scene": {"friction": 0.3}, "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 5}, "time": {"steps": 4},
                  "output": {"checkpoint_every": 2, "final_bodies": True, "final_forces": True}}
        runs = [self.start(f"ranks_{ranks}", groups, path, ranks) for ranks in SOME_RANKS]
        for run in runs:
            self.assert_status(run, 0)
            self.assertEqual(differences(contents(run.path("results", "final_bodies.h5")), contents(runs[0].path("results", "final_bodies.h5"))), [])
            self.assertEqual([name for name in differences(run.results(), runs[0].results()) if "@command" not in name], [])
        self.assert_status(self.start("again", merged(groups, {"time": {"steps": 2}}), path), 0)
        again = self.start("again", groups, path, 2, ("--restart",))
        self.assert_status(again, 0)
        self.assertNotIn("start       from forces", again.stdout)
        self.assertEqual(differences(contents(again.path("results", "final_bodies.h5")), contents(runs[0].path("results", "final_bodies.h5"))), [])

    def test_layers_do_not_replace_them(self):
        """A column whose forces are half of what they have to be goes on from these; without forces layers carry the loads."""
        count, radius = 150, 0.05
        height = (2 * np.arange(count) + 1) * radius
        bodies = {"id": np.arange(1, count + 1), "position": np.stack([0.0 * height, height], axis=1), "radius": np.full(count, radius),
                  "mass": np.ones(count)}
        walls = {"id": [count + 1], "point": [[0.0, 0.0]], "normal": [[0.0, 1.0]]}
        # body k carries those above it; the ground carries all
        force = 0.5 * G * np.arange(count, 0, -1)
        # of two bodies that of the higher identifier may come first, too
        contacts = {"candidate": np.arange(1, count + 1), "antagonist": [-1, *range(1, count)], "normal": np.tile([0.0, 1.0], (count, 1)),
                    "force": np.stack([0.0 * force, force], axis=1)}
        said = []
        for given in (True, False):
            write_bodies(self.here("column.h5"), bodies, walls, contacts if given else None, [f"wall {count + 1}"] if given else ())
            run = self.start(f"column_{given}", {"scene": {"friction": 0.3}, "solver": {"max_iterations": 20000}}, self.here("column.h5"))
            self.assert_status(run, 0)
            said.append("made a pass over layers" in run.stdout)
        self.assertEqual(said, [False, True])

    def test_not_found(self):
        """Boundaries that the scene does not have, and pairs that do not touch, are counted."""
        bodies, boundaries, contacts = wedge(2, 0.0)
        bodies = {name: [*values, *values] for name, values in bodies.items()}
        bodies["id"], bodies["position"][1] = [7, 9], [0.0, 5.0]
        contacts = {name: [*values, values[0]] for name, values in contacts.items()}
        contacts["antagonist"] = [-1, -2, 9]
        write_bodies(self.here("found.h5"), bodies, None, contacts, ("left", "elsewhere"))
        run = self.start("found", {"scene": {"friction": 0.6}, "boundary": boundaries}, self.here("found.h5"))
        self.assert_status(run, 0)
        self.assertIn("1 of its 3 contacts touch in the first step, with 33.3 % of its normal forces", run.stdout)
        run = self.start("found", {"scene": {"friction": 0.6}, "boundary": boundaries, "solver": {"warm_start": False}}, self.here("found.h5"))
        self.assert_status(run, 0)
        self.assertNotIn("start       from forces", run.stdout)

    def test_other_steps_and_effects(self):
        """What final_bodies.h5 leaves of packings with other effects is found again, with another step too."""
        few = {"count": 60, "box": 0.15}
        cases = {
            "rolling": {"scene": {"rolling_friction": 0.05}, "sample": few},
            "spheres": {"scene": {"dimension": 3, "rolling_friction": 0.05, "pivoting_friction": 0.05},
                        "sample": {"count": 30, "box": [0.045, 0.045], "solid_fraction": 0.25}},
            "periodic": {"scene": {"period": [0.15, 0.0]}, "sample": {**few, "box": None}},
            "adhesive": {"material": [{"name": "wet"}], "law": [{"materials": ["wet", "wet"], "kind": "adhesive", "adhesion": 0.5, "adhesion_range": 1e-4, "friction": 0.3}],
                         "scene": {"friction": None}, "sample": few},
        }
        for name, change in cases.items():
            with self.subTest(name):
                os.makedirs(self.here(name), exist_ok=True)
                case = merged(SAMPLE, change)
                write(self.here(name, "sample.nml"), namelist(case))
                self.assert_status(gravier("sample.nml", directory=self.here(name), program="gravier_sample"), 0)
                scene = {key: value for key, value in case["scene"].items() if key not in ("bodies", "density")}
                run = self.start(name, {"scene": scene, **{key: case[key] for key in ("material", "law") if key in case},
                                        "time": {"step": 0.5 * STEP, "steps": 1}}, self.here(name, "sample.h5"))
                self.assert_status(run, 0)
                with h5py.File(self.here(name, "sample.h5")) as file:
                    rows = len(file["contacts/candidate"])
                    self.assertEqual("moment" in file["contacts"], "rolling_friction" in scene)
                    given = file["contacts/force"][:] @ np.eye(len(file["contacts/force"][0]))
                    normal = (given * file["contacts/normal"][:]).sum(axis=1)
                self.assertGreater(rows, 50)
                self.assertRegex(run.stdout, rf"{rows} of its {rows} contacts touch in the first step, with 100\.0 %")
                # solves to an accuracy of a tenth leave what they find nearly as it is
                found = run.results()["/steps/1/contacts/impulse"][:, 0] / (0.5 * STEP)
                self.assertLess(abs(found.sum() - normal.sum()), 0.02 * np.abs(normal).sum())
                self.assertLess(run.history()["iterations"][0], 20)

    def test_period_of_a_bodies_file(self):
        """A period that came with the bodies goes on with them: in results.h5, in gravier.Run, and in the files that gravier.write_bodies makes."""
        case = {"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [6, 3], "radius_min": 0.01, "radius_max": 0.01, "friction": 0.3,
                          "period": [0.13, 0.0], "period_origin": [-0.02, 0.0]},
                "time": {"step": STEP, "steps": 20}, "output": {"directory": "results", "every": 20, "contacts": True, "final_bodies": True}}
        first = run_case(case, 1, self.here("period"))
        self.assert_status(first, 0)
        follow = merged(case, {"scene": {"bodies": "file", "bodies_file": "bodies.h5", "lattice_count": None, "radius_min": None, "radius_max": None,
                                         "period": None, "period_origin": None}})
        given = first.path("results", "final_bodies.h5")
        for title in ("period goes on", "period goes on again"):
            directory = self.here(title)
            os.makedirs(directory)
            shutil.copy(given, os.path.join(directory, "bodies.h5"))
            run = run_case(follow, 1, directory)
            self.assert_status(run, 0)
            read = package.Run(run.path("results"))
            np.testing.assert_array_equal(read.period, [0.13, 0.0])
            np.testing.assert_array_equal(read.origin, [-0.02, 0.0])
            given = self.here(title + ".h5")
            package.write_bodies(read, given)
            np.testing.assert_array_equal(package.BodiesFile(given).period, [0.13, 0.0])
        # results of an earlier version have that of the input
        with h5py.File(first.path("results", "results.h5"), "r+") as file:
            for name in ("period_x", "origin_x"):
                del file["run"].attrs[name]
        read = package.Run(first.path("results"))
        np.testing.assert_array_equal([read.period, read.origin], [[0.13, 0.0], [-0.02, 0.0]])

    def test_states_of_results(self):
        """gravier.write_bodies makes of the last state in results.h5, whose numbers have single precision or more, what final_bodies.h5
        has; a run starts from it."""
        for dimension, counts in ((2, [6, 5]), (3, [3, 3, 3])):
            with self.subTest(dimension=dimension):
                case = {"scene": {"dimension": dimension, "bodies": "lattice", "lattice_count": counts, "radius_min": 0.008, "radius_max": 0.012,
                                  "friction": 0.3, "rolling_friction": 0.1},
                        "boundary": [{"name": "a lid, far away", "shape": "plane", "point": [0.0, 9.0, 9.0][3 - dimension:],
                                      "normal": [0.0, 0.0, -1.0][3 - dimension:]}],
                        "time": {"step": STEP, "steps": 200}, "output": {"directory": "results", "every": 200, "final_bodies": True, "final_forces": True}}
                run = run_case(case, 1, self.here(f"state_{dimension}"))
                self.assert_status(run, 0)
                state = self.here(f"state_{dimension}.h5")
                package.write_bodies(package.Run(run.path("results")), state)
                with h5py.File(state) as made, h5py.File(run.path("results", "final_bodies.h5")) as wanted:
                    for group in ("bodies", "walls", "contacts"):
                        self.assertGreaterEqual(set(made[group]), set(wanted[group]) - {"material"})
                    for name in ("id", "position", "velocity", "radius", "mass"):
                        np.testing.assert_allclose(made[f"bodies/{name}"][:], wanted[f"bodies/{name}"][:], rtol=1e-6, atol=1e-9)
                    np.testing.assert_allclose(made["walls/point"][:], wanted["walls/point"][:], atol=1e-9)
                    tables = [contact_rows(file["contacts"]) for file in (made, wanted)]
                    self.assertEqual(tables[0].keys(), tables[1].keys())
                    self.assertGreater(len(tables[0]), 20)
                    # results have the places of the end of the step, at which contacts were half a step before
                    way = STEP * np.abs(wanted["bodies/velocity"][:, :dimension]).max()
                    for pair, (row, place) in tables[0].items():
                        np.testing.assert_allclose(row, tables[1][pair][0], rtol=2e-6, atol=2e-6 * np.abs(row).max(), err_msg=str(pair))
                        np.testing.assert_allclose(place, tables[1][pair][1], atol=way)
                again = self.start(f"again_{dimension}", {"scene": {"dimension": dimension, "friction": 0.3, "rolling_friction": 0.1},
                                                          "boundary": case["boundary"]}, state)
                self.assert_status(again, 0)
                self.assertIn(f"{len(tables[0])} of its {len(tables[0])} contacts touch", again.stdout)

    def test_walls_that_a_case_takes(self):
        """Walls of a sample that a case takes by their sides or their identifiers, as they are: the same bits as without, with their
        identifiers, their forces and the names of the case; a wall may be driven, and one removed at the start is gone."""
        path, _ = self.settle()
        with h5py.File(path) as file:
            walls = {tuple(normal): int(number) for number, normal in zip(file["walls/id"][:], file["walls/normal"][:])}
        left, right, floor = walls[1.0, 0.0], walls[-1.0, 0.0], walls[0.0, 1.0]
        scene = {"scene": {"dimension": 2, "friction": 0.3, "alert_distance": 0.003}, "time": {"steps": 20}, "output": {"checkpoint_every": 10}}
        plain = self.start("plain", scene, path)
        self.assert_status(plain, 0)
        taken = {"boundary": [{"name": "ground", "shape": "wall", "wall": "-y"}, {"name": "right", "shape": "wall", "wall": str(right)}]}
        run = self.start("taken", merged(scene, taken), path)
        self.assert_status(run, 0)
        self.assertRegex(run.stdout, r"start       from forces of the bodies file: (\d+) of its \1 contacts touch in the first step, with 100.0 %")
        for step in (1, 20):
            for name in ("bodies/position", "bodies/velocity", "contacts/impulse", "contacts/antagonist"):
                np.testing.assert_array_equal(run.results()[f"/steps/{step}/{name}"], plain.results()[f"/steps/{step}/{name}"], f"{step} {name}")
        rows = package.Run(run.path("results")).boundaries()
        self.assertEqual(dict(zip(rows.name, rows.id)), {f"wall {left}": left, "ground": floor, "right": right})
        self.assertEqual(list(rows.shape), ["plane"] * 3)
        np.testing.assert_array_equal(rows.normal[list(rows.name).index("right")], [-1.0, 0.0])
        # driven, on another number of ranks and after a restart
        driven = {"boundary": [{"name": "ground", "shape": "wall", "wall": "-y"},
                               {"name": "gate", "shape": "wall", "wall": "+x", "velocity": [0.05, 0.0], "friction": 0.1},
                               {"name": "gone", "shape": "wall", "wall": "-x", "remove_at": 0.0}]}
        runs = [self.start(f"driven_{ranks}", merged(scene, driven, {"time": {"steps": steps}}), path, ranks) for ranks, steps in ((1, 20), (2, 10))]
        runs[1] = self.start("driven_2", merged(scene, driven), path, 1, ["--restart"])
        for one in runs:
            self.assert_status(one, 0)
        for name in ("bodies/position", "bodies/velocity", "contacts/impulse", "boundaries/force"):
            np.testing.assert_array_equal(*(one.results()[f"/steps/20/{name}"] for one in runs))
        results, rows = runs[0].results(), package.Run(runs[0].path("results")).boundaries()
        place = {name: rows.position[k] for k, name in enumerate(rows.name)}
        self.assertAlmostEqual(place["gate"][0], 0.25 + 0.05 * 20 * STEP, places=12)
        self.assertNotIn(left, results["/steps/20/contacts/antagonist"])
        self.assertIn(floor, results["/steps/20/contacts/antagonist"])

    def test_walls_stay_with_the_bodies(self):
        """Walls that a case has taken are in the bodies file that its run leaves, and in one that Python makes: where the run has left them, under
        their identifiers, with the forces on them, and without the one that it has removed. The next run may take them again or not."""
        path, _ = self.settle()
        with h5py.File(path) as file:
            walls = {tuple(normal): int(number) for number, normal in zip(file["walls/id"][:], file["walls/normal"][:])}
        left, right, floor = walls[1.0, 0.0], walls[-1.0, 0.0], walls[0.0, 1.0]
        scene = {"scene": {"dimension": 2, "friction": 0.3, "alert_distance": 0.003}, "time": {"steps": 21},
                 "output": {"every": 7, "final_bodies": True, "final_forces": True}}
        taken = {"boundary": [{"name": "gate", "shape": "wall", "wall": "+x", "velocity": [-1e-4, 0.0]},
                              {"name": "ramp", "shape": "wall", "wall": str(floor), "rotation": [-0.01]},
                              {"name": "gone", "shape": "wall", "wall": "-x", "remove_at": 10 * STEP}]}
        run = self.start("taken_walls", merged(scene, taken), path)
        self.assert_status(run, 0)
        made = package.Run(run.path("results"))
        package.write_bodies(made, self.here("made.h5"))
        package.write_bodies(made, self.here("before.h5"), 7)
        turn, far = -0.01 * 21 * STEP, 0.25 - 1e-4 * 21 * STEP
        for file in (run.path("results", "final_bodies.h5"), self.here("made.h5")):
            with h5py.File(file) as found:
                self.assertEqual(sorted(found["walls/id"][:]), sorted([right, floor]))
                rows = {number: row for row, number in enumerate(found["walls/id"][:])}
                np.testing.assert_allclose(found["walls/point"][rows[right]], [far, 0.0], rtol=1e-12)
                np.testing.assert_allclose(found["walls/normal"][rows[floor]], [-np.sin(turn), np.cos(turn)], rtol=1e-12)
                self.assertLessEqual({f"wall {right}", f"wall {floor}"}, set(found["contacts/boundaries"][0].decode().split("\n")))
            for title, groups in (("left", {}), ("again", {"boundary": [{"name": "lid", "shape": "wall", "wall": "+x"}]})):
                again = self.start(f"{title} {os.path.basename(file)}", merged(scene, {"time": {"steps": 1}}, groups), file)
                self.assert_status(again, 0)
                self.assertRegex(again.stdout, r"start       from forces of the bodies file: (\d+) of its \1 contacts touch in the first step")
                rows = package.Run(again.path("results")).boundaries()
                self.assertEqual(dict(zip(rows.id, rows.name)), {right: "lid" if groups else f"wall {right}", floor: f"wall {floor}"})
        with h5py.File(self.here("before.h5")) as found:
            self.assertEqual(sorted(found["walls/id"][:]), sorted([left, right, floor]))

    def test_shapes(self):
        """Places tell the points of a pair from each other: two blocks on a table of which one stands on one edge more than on the other."""
        write(self.here("blocks.shapes"), "shape block\nrounding 0.001\npolygon -0.1 -0.05 0.1 -0.05 0.1 0.05 -0.1 0.05\n")
        os.makedirs(self.here("blocks"), exist_ok=True)
        shutil.copy(self.here("blocks.shapes"), self.here("blocks", "blocks.shapes"))
        mass, part = 2.0, 0.5
        bodies = {"id": [1], "position": [[0.0, 0.05]], "radius": [0.0], "mass": [mass], "shape": [1], "orientation": [0.0]}
        contacts = {"candidate": [1, 1], "antagonist": [-1, -1], "normal": [[0.0, 1.0]] * 2, "point": [[-0.1, 0.0], [0.1, 0.0]],
                    "force": [[0.3, part * mass * G], [-0.3, part * mass * G]]}
        write_bodies(self.here("blocks.h5"), bodies, {"id": [2], "point": [[0.0, 0.0]], "normal": [[0.0, 1.0]]}, contacts, ["wall 2"])
        with h5py.File(self.here("blocks.h5"), "a") as file:
            file["bodies/shape"].attrs["names"] = np.bytes_("block")
        groups = {"scene": {"friction": 0.5, "shapes": "blocks.shapes"}}
        run = self.start("blocks", groups, self.here("blocks.h5"))
        self.assert_status(run, 0)
        results = run.results()
        order = np.argsort(results["/steps/1/contacts/point"][:, 0])
        # t = (-n_y, n_x) = (-1, 0): the friction of the two edges is a state of stress of the block, which stays
        np.testing.assert_allclose(results["/steps/1/contacts/impulse"][order] / STEP, [[part * mass * G, -0.3], [part * mass * G, 0.3]],
                                   rtol=1e-6)
        with h5py.File(self.here("blocks.h5"), "a") as file:
            del file["contacts/point"]
        run = self.start("blocks", groups, self.here("blocks.h5"))
        self.assert_refused(run, "/contacts/point: missing", "where bodies have shapes")

    def assert_refused(self, run, *words):
        self.assert_status(run, 2)
        said = [line for line in run.stderr.splitlines() if "gravier: error: " in line]
        self.assertEqual(len(said), 1, run.stderr)
        for word in ("bodies.h5", *words):
            self.assertIn(word, said[0])

    def test_refused(self):
        bodies, boundaries, good = wedge(2, 0.1)
        nan, names = float("nan"), ("left", "right")
        cases = [
            ("unknown body", {"antagonist": [-1, 8]}, names, ("/contacts: row 1", "body 8", "/bodies/id")),
            ("unknown candidate", {"candidate": [3, 7]}, names, ("/contacts: row 0", "body 3")),
            ("itself", {"antagonist": [7, -1]}, names, ("/contacts/antagonist: row 0", "7", "another body")),
            ("no name", {"antagonist": [-1, -3]}, names, ("/contacts/antagonist: row 1", "-3", "-1 to -2")),
            ("no names", {}, (), ("/contacts/antagonist: row 0", "/contacts/boundaries")),
            ("zero", {"antagonist": [0, -1]}, names, ("/contacts/antagonist: row 0",)),
            ("no body", {"candidate": [0, 7]}, names, ("/contacts/candidate: row 0", ", but the identifier of a body was expected")),
            ("NaN", {"force": [[1.0, 1.0], [nan, 1.0]]}, names, ("/contacts/force: row 1", "NaN or infinity")),
            ("huge", {"force": [[1.0, 1e300], [1.0, 1.0]]}, names, ("/contacts/force: row 0", "1.000")),
            ("no normal", {"normal": [[0.0, 0.0], [0.0, 1.0]]}, names, ("/contacts/normal: row 0", "zero")),
            ("pulls", {"force": [[1.0, 1.0], [1.0, -5.0]]}, names, ("/contacts/force: row 1", "pulls", "no law attracts")),
            ("columns", {"force": np.ones((2, 3))}, names, ("/contacts/force", "(N, 3)", "(N, 2)")),
            ("rows", {"force": np.ones((1, 2))}, names, ("/contacts/force", "1 rows", "2")),
            ("texts", {"candidate": [7.0, 7.5]}, names, ("/contacts/candidate", "integers")),
            ("no force", {"force": None}, names, ("/contacts/force", "missing")),
            ("unknown set", {"colour": [1, 2]}, names, ("/contacts/colour: unknown",)),
            ("moment", {"moment": np.ones((2, 2))}, names, ("/contacts/moment", "(N, 2)", "(N, 1)")),
            ("point", {"point": [[nan, 0.0], [0.0, 0.0]]}, names, ("/contacts/point: row 0", "NaN")),
            ("long name", {}, ("left", "r" * 65), ("/contacts/boundaries: name 2", "65 letters")),
        ]
        for number, (title, change, given, words) in enumerate(cases):
            # on one rank or on two, by turns
            with self.subTest(title):
                write_bodies(self.here("bad.h5"), bodies, None, {key: value for key, value in {**good, **change}.items() if value is not None}, given)
                run = self.start("bad", {"scene": {"friction": 0.6}, "boundary": boundaries}, self.here("bad.h5"), 1 + number % 2)
                self.assert_refused(run, *words)
        write_bodies(self.here("bad.h5"), bodies, None, {**good, "antagonist": [-1, -1]})
        with h5py.File(self.here("bad.h5"), "a") as file:
            file["contacts/boundaries"] = "left\nright"
        run = self.start("bad", {"scene": {"friction": 0.6}, "boundary": boundaries}, self.here("bad.h5"))
        self.assert_refused(run, "/contacts/boundaries", "fixed length")
        self.assertFalse(os.path.exists(self.here("bad", "results")))


if __name__ == "__main__":
    unittest.main()
