"""gravier_import and the forces of LMGC90: two pyramids that LMGC90 has settled (tests/support/pyramids: the input by test_import.py's
writers, 200 steps of 1 ms by LMGC90 with its tolerance 1e-10) are in equilibrium under the forces that are imported, and keep them."""
import os
import shutil
import unittest

import h5py
import numpy as np

from forked_scripts import script
from gravier_runs import PROGRAMS, SOURCE, RunTestCase, alone_environment, gravier

IMPORT = os.path.join(PROGRAMS, "gravier_import")
#: dimension, bodies that move freely, contacts that press
PYRAMIDS = {"disks": (2, 3, 4), "spheres": (3, 4, 9)}
G = 9.81


class ImportForces(RunTestCase):
    def convert(self, box, *options, status=0):
        folder = os.path.join(self.scratch, f"run{len(os.listdir(self.scratch))}")
        os.mkdir(folder)
        with alone_environment() as environment:
            done = script(IMPORT, box, "--step", "1e-3", "--steps", "1", "--out", "case", *options, directory=folder,
                          environment=environment)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return folder, done.stderr

    def box(self, name):
        """A copy of a pyramid, for changes."""
        folder = os.path.join(self.scratch, f"box{len(os.listdir(self.scratch))}")
        shutil.copytree(os.path.join(SOURCE, "tests/support/pyramids", name), folder)
        return os.path.join(folder, "DATBOX")

    def contacts(self, folder):
        with h5py.File(os.path.join(folder, "case.h5")) as file:
            bodies = {name: file[f"bodies/{name}"][:] for name in ("id", "position", "mass", "radius")}
            if "contacts" not in file:
                return bodies, None, []
            names = file["contacts/boundaries"][0].decode().split("\n") if "boundaries" in file["contacts"] else []
            return bodies, {name: file[f"contacts/{name}"][:] for name in ("candidate", "antagonist", "normal", "force", "point")}, names

    def test_equilibrium(self):
        """Forces have seven digits in the file, and there are four on a body at most: sums are off by 4 times 5e-7 of the largest, twice that
        with their normals, whose digits are as many; levers are the radius."""
        for name, (dimension, free, count) in PYRAMIDS.items():
            with self.subTest(name):
                folder, _ = self.convert(self.box(name))
                bodies, contacts, names = self.contacts(folder)
                self.assertEqual(len(contacts["force"]), count)
                self.assertEqual(names, [f"body {free + 1}"])
                self.assertGreater(np.abs(contacts["force"][:, 0]).max(), 1.0)
                for k in range(free):
                    total = np.zeros(dimension)
                    total[-1] = -bodies["mass"][k] * G
                    torque = np.zeros(3)
                    for candidate, antagonist, force, point in zip(*(contacts[key] for key in ("candidate", "antagonist", "force", "point"))):
                        sense = {candidate: 1.0, antagonist: -1.0}.get(bodies["id"][k], 0.0)
                        total += sense * force
                        arm = np.resize([*(point - bodies["position"][k]), 0.0], 3)
                        torque += sense * np.cross(arm, np.resize([*force, 0.0], 3))
                    allowed = 4e-6 * np.abs(contacts["force"]).max()
                    self.assertLess(np.abs(total).max(), allowed)
                    self.assertLess(np.abs(torque).max(), allowed * bodies["radius"][k])

    def test_forces_stay(self):
        """The first step keeps them to the digits of the file, and without them it finds others where they are not unique."""
        for name, (dimension, _, _) in PYRAMIDS.items():
            with self.subTest(name):
                folder, _ = self.convert(self.box(name))
                _, contacts, _ = self.contacts(folder)
                run = gravier("case.nml", directory=folder)
                self.assert_status(run, 0)
                number = len(contacts["force"])
                self.assertIn(f"{number} of its {number} contacts touch in the first step, with 100.0 % of its normal forces", run.stdout)
                given = (contacts["force"] * contacts["normal"]).sum(axis=1)
                order = np.lexsort((contacts["antagonist"], contacts["candidate"]))
                kept = self.normal_forces(folder)
                np.testing.assert_allclose(kept, given[order], atol=1e-5 * given.max())
                with h5py.File(os.path.join(folder, "case.h5"), "a") as file:
                    del file["contacts"]
                self.assert_status(gravier("case.nml", directory=folder), 0)
                cold = self.normal_forces(folder)
                if dimension == 3:
                    self.assertGreater(np.abs(cold - given[order]).max(), 1e-3 * given.max())

    def normal_forces(self, folder):
        """Of the contacts that press, in the order of candidates and antagonists, boundaries before bodies."""
        with h5py.File(os.path.join(folder, "case_results", "results.h5")) as file:
            rows = file["steps/1/contacts"]
            candidate, antagonist, impulse = (rows[key][:] for key in ("candidate", "antagonist", "impulse"))
            bodies = set(file["steps/1/bodies/id"][:])
        antagonist = np.array([other if other in bodies else -1 for other in antagonist])
        order = np.lexsort((antagonist, candidate))
        found = impulse[order, 0] / 1e-3
        return found[found > 0.0]

    def test_ends_of_walls(self):
        """What a wall of LMGC90 is here has several parts: the contact is that of the nearest, at a round end the disk there."""
        box = self.box("disks")
        path = os.path.join(box, "BODIES.DAT")
        with open(path, encoding="utf-8") as file:
            text = file.read()
        # the ground ends under the centres of the two lower disks, whose contacts are where the flat part meets the round ones
        moved = text.replace("axe1= 0.5000000D+00", "axe1= 0.4995000D-01")
        self.assertNotEqual(moved, text)
        with open(path, "w", encoding="utf-8") as file:
            file.write(moved)
        folder, _ = self.convert(box)
        bodies, contacts, names = self.contacts(folder)
        self.assertEqual(names, [])
        ends = bodies["id"][3:]
        places = dict(zip(ends, bodies["position"][3:]))
        others = [(place, other) for other, place in zip(contacts["antagonist"], contacts["point"]) if other in ends]
        self.assertEqual(len(others), 2)
        for place, other in others:
            self.assertLess(abs(places[other][0] - place[0]), 1e-3)

    def test_times_that_differ(self):
        box = self.box("disks")
        path = os.path.join(box, "Vloc_Rloc.INI")
        with open(path, encoding="utf-8") as file:
            text = file.read()
        with open(path, "w", encoding="utf-8") as file:
            file.write(text.replace("time= 0.2000000D+00", "time= 0.1000000D+00"))
        folder, said = self.convert(box)
        self.assertIn("note: Vloc_Rloc.INI is of 0.1 s and DOF.INI of 0.2 s: the first solve does not start from its forces", said)
        self.assertIsNone(self.contacts(folder)[1])

    def test_the_last_state(self):
        """--last takes the state of OUTBOX: LAST before OUT, of these the last."""
        box = self.box("disks")
        out = os.path.join(os.path.dirname(box), "OUTBOX")
        _, said = self.convert(box, "--last", status=2)
        self.assertIn("OUTBOX: no DOF.LAST and no DOF.OUT.n: expected the last state", said)
        os.mkdir(out)
        for name in ("DOF", "Vloc_Rloc"):
            os.rename(os.path.join(box, f"{name}.INI"), os.path.join(out, f"{name}.OUT.10"))
            shutil.copy(os.path.join(out, f"{name}.OUT.10"), os.path.join(out, f"{name}.OUT.9"))
        self.change(out, "OUT.9", "0.2889284D+03", "0.1500000D+03")
        self.assertIsNone(self.contacts(self.convert(box)[0])[1])
        self.assertGreater(np.abs(self.contacts(self.convert(box, "--last")[0])[1]["force"]).max(), 200.0)
        shutil.copy(os.path.join(out, "DOF.OUT.10"), os.path.join(out, "DOF.LAST"))
        shutil.copy(os.path.join(out, "Vloc_Rloc.OUT.10"), os.path.join(out, "Vloc_Rloc.LAST"))
        self.change(out, "LAST", "0.2889284D+03", "0.2000000D+03")
        self.assertLess(np.abs(self.contacts(self.convert(box, "--last")[0])[1]["force"]).max(), 201.0)

    def change(self, folder, ending, old, new):
        path = os.path.join(folder, f"Vloc_Rloc.{ending}")
        with open(path, encoding="utf-8") as file:
            text = file.read()
        self.assertIn(old, text)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text.replace(old, new))


if __name__ == "__main__":
    unittest.main()
