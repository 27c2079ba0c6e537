"""Elongations of tangential springs in results and in bodies files: a run on springs that is cut in two goes on as a whole one does."""
import os
import shutil
import unittest

import h5py
import numpy as np

from gravier_runs import RunTestCase, merged, run_case, write

import gravier

RADIUS, STEP, STEPS, MORE = 0.01, 2e-4, 400, 15
#: a heap that is still in motion after the cut
HEAP = {"scene": {"bodies": "lattice", "radius_min": 0.8 * RADIUS, "radius_max": RADIUS, "density": 2000.0, "overlap_projection": False,
                  "wall_material": "m"},
        "material": {"name": "m"}, "time": {"step": STEP, "steps": STEPS},
        "solver": {"criterion": "residual", "tolerance": 1e-13, "max_iterations": 20000, "fallback": "none"},
        "output": {"directory": "results", "every": STEPS, "final_bodies": True, "final_forces": True, "energy": True}}
SPRINGS = {"materials": "m", "kind": "elastic", "friction": 0.4, "normal_stiffness": 2e4}


class CutSprings(RunTestCase):

    def heap(self, dimension, **law):
        count = [4, 5] if dimension == 2 else [3, 3, 3]
        return merged(HEAP, {"scene": {"dimension": dimension, "lattice_count": count}, "law": {**SPRINGS, **law}})

    def play(self, title, case, ranks=1, bodies=None):
        directory = self.here(title)
        os.makedirs(directory)
        if bodies:
            shutil.copy(bodies, os.path.join(directory, "bodies.h5"))
        run = run_case(case, ranks, directory)
        self.assert_status(run, 0)
        return run

    def goes_on(self, case):
        scene = {"bodies": "file", "bodies_file": "bodies.h5", "lattice_count": None, "radius_min": None, "radius_max": None}
        return merged(case, {"scene": scene, "time": {"steps": MORE}})

    def turn_pairs(self, path):
        """Give every other contact between two bodies by its other body."""
        with h5py.File(path, "r+") as file:
            contacts = file["contacts"]
            candidate, antagonist = contacts["candidate"][:], contacts["antagonist"][:]
            pairs = antagonist > 0
            chosen = pairs & (np.cumsum(pairs) % 2 == 1)
            contacts["candidate"][:], contacts["antagonist"][:] = np.where(chosen, antagonist, candidate), np.where(chosen, candidate, antagonist)
            for name in ("normal", "force", "elongation"):
                contacts[name][:] = np.where(chosen[:, None], -contacts[name][:], contacts[name][:])
            for name in ("candidate", "antagonist", "normal", "force", "elongation"):
                del contacts[name].attrs["checksum"]
            return chosen.sum()

    def test_cut_runs(self):
        """Places, spins and elongations are those of a run that is not cut, with springs alone and with dashpots, in both orders of the step, with
        the springs of Hertz; on two ranks, too. Files of states have single precision in velocities."""
        laws = {"springs": {}, "second order": {"spring_theta": 0.5}, "dashpots": {"spring_restitution": 0.4, "tangential_damping": 0.5},
                "hertz": {"kind": "hertz", "young_modulus": 5e7, "poisson_ratio": 0.3, "normal_stiffness": None}}
        for dimension in (2, 3):
            for name, law in laws.items():
                if dimension == 2 and name == "hertz":
                    continue
                with self.subTest(dimension=dimension, law=name):
                    title, case = f"{name} {dimension}", self.heap(dimension, **law)
                    whole = gravier.Run(self.play(title + " whole", merged(case, {"time": {"steps": STEPS + MORE}})).path("results"))
                    first = self.play(title + " first", case).path("results")
                    state = self.here(title + ".h5")
                    gravier.write_bodies(gravier.Run(first), state)
                    held = whole.contacts(STEPS).elongation
                    self.assertGreater(np.linalg.norm(held, axis=1).max(), 1e-7)
                    turned = shutil.copy(os.path.join(first, "final_bodies.h5"), self.here(title + " turned.h5"))
                    self.assertGreaterEqual(self.turn_pairs(turned), 2 if name == "springs" else 0)
                    parts = {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4}}
                    for kind, file, more, ranks, near in (("final", os.path.join(first, "final_bodies.h5"), {}, 1, 1e-10),
                                                          ("turned", turned, {}, 1, 1e-10), ("parts", os.path.join(first, "final_bodies.h5"), parts, 2, 1e-10), ("state", state, {}, 1, 1e-5)):
                        run = gravier.Run(self.play(f"{title} {kind}", merged(self.goes_on(case), more), ranks, file).path("results"))
                        found, wanted = run.bodies(MORE), whole.bodies(STEPS + MORE)
                        np.testing.assert_allclose(found.position, wanted.position, rtol=0, atol=near * RADIUS, err_msg=kind)
                        np.testing.assert_allclose(found.spin, wanted.spin, rtol=0, atol=max(near, 1e-6) * 100.0, err_msg=kind)
                        tables = [dict(zip(zip(contacts.candidate, contacts.antagonist), contacts.elongation)) for contacts in (run.contacts(MORE), whole.contacts(STEPS + MORE))]
                        self.assertEqual(tables[0].keys(), tables[1].keys())
                        for pair, row in tables[0].items():
                            np.testing.assert_allclose(row, tables[1][pair], rtol=0, atol=max(near, 1e-7) * RADIUS, err_msg=f"{kind} {pair}")

    def test_elongations(self):
        """Elongations lie in the tangent plane and are those of the forces: force on the candidate = - k_t elongation. Those of a
        bodies file are those of the last state."""
        for dimension in (2, 3):
            with self.subTest(dimension=dimension):
                run = self.play(f"forces {dimension}", self.heap(dimension, stiffness_ratio=0.4))
                read = gravier.Run(run.path("results"))
                contacts, forces = read.contacts(), read.forces()
                normal_force = (forces.force * contacts.normal).sum(axis=1)
                tangential = forces.force - normal_force[:, None] * contacts.normal
                self.assertGreater(np.linalg.norm(tangential, axis=1).max(), 1e-3)
                np.testing.assert_allclose((contacts.elongation * contacts.normal).sum(axis=1), 0.0, atol=1e-16)
                np.testing.assert_allclose(0.4 * SPRINGS["normal_stiffness"] * contacts.elongation, -tangential,
                                           atol=(1e-9 if dimension == 2 else 1e-2) * np.abs(tangential).max())
                with h5py.File(run.path("results", "final_bodies.h5")) as file:
                    kept = file["contacts"]
                    table = dict(zip(zip(kept["candidate"][:], kept["normal"][:, 0]), kept["elongation"][:]))
                    self.assertIn(kept["elongation"].attrs["unit"], (b"m", "m"))
                bears = normal_force > 0.0
                self.assertEqual(len(table), bears.sum())
                for candidate, normal, row in zip(contacts.candidate[bears], contacts.normal[bears], contacts.elongation[bears]):
                    np.testing.assert_array_equal(table[candidate, normal[0]], row)
        bare = {group: keys for group, keys in self.heap(2).items() if group not in ("law", "material")}
        rigid = gravier.Run(self.play("rigid", merged(bare, {"scene": {"wall_material": None, "friction": 0.3}, "solver": {"tolerance": 1e-8},
                                                             "time": {"steps": 250}})).path("results"))
        self.assertNotIn("elongation", rigid.contacts())

    def test_refused(self):
        path = write(self.here("bodies.csv"), "id,x,y,radius\n1,0,0.01,0.01\n")
        case = {"scene": {"bodies": "file", "bodies_file": "bodies.h5", "wall_material": "m"}, "material": {"name": "m"}, "law": SPRINGS,
                "boundary": {"name": "floor", "shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0], "material": "m"},
                "time": {"step": STEP, "steps": 1}, "output": {"directory": "results"}}
        os.remove(path)
        for value, line in (([[np.nan, 0.0]], "/contacts/elongation: row 0 (counted from 0): NaN or infinity, but finite numbers were expected"),
                            ([[1.0, 0.0]] * 2, "/contacts/elongation: 2 rows, but /contacts/candidate has 1")):
            directory = self.here("refused")
            os.makedirs(directory, exist_ok=True)
            with h5py.File(os.path.join(directory, "bodies.h5"), "w") as file:
                file["bodies/id"], file["bodies/position"], file["bodies/radius"] = [1], [[0.0, 0.01]], [0.01]
                for name, values in (("candidate", [1]), ("antagonist", [-1]), ("normal", [[0.0, 1.0]]), ("force", [[0.0, 1.0]]), ("elongation", value)):
                    file[f"contacts/{name}"] = values
                file["contacts/boundaries"] = np.array([b"floor"])
            run = run_case(case, directory=directory, options=["--check"])
            self.assert_status(run, 2)
            self.assertIn(line, run.stderr)


if __name__ == "__main__":
    unittest.main()
