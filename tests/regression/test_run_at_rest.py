"""rest_energy of &time: a run ends when its grains have come to rest, at the same step on any ranks and through restarts, with its
last state and checkpoint written."""
import os
import re
import unittest

import h5py
import numpy as np

from gravier_runs import RunTestCase, contents, differences, gravier, merged, namelist, run_case, steps_of, write

STEPS, QUIET = 3000, 10
#: J; 80 disks of some 0.8 kg that move by a tenth of g h have a third of it
LOW = 1.0e-4

BOX = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [10, 8], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
    "time": {"step": 1e-3, "steps": STEPS, "rest_energy": LOW},
    "solver": {"method": "nscdd"},
    "decomposition": {"subdomains": 2},
    "output": {"every": 0, "checkpoint_every": 100},
}


def again(directory, ranks=1, **changes):
    """Change the case and go on from the checkpoint."""
    write(os.path.join(directory, "case.nml"), namelist(merged(BOX, changes)))
    return gravier("--restart", "case.nml", ranks=ranks, directory=directory)


class AtRest(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.directory = os.path.join(cls.scratch, "straight")
        cls.straight = run_case(BOX, directory=cls.directory)
        cls.energy = cls.straight.history()["kinetic_energy"]

    def state(self, directory):
        found = contents(os.path.join(directory, "results", "checkpoint.h5"))
        return {name: value for name, value in found.items() if "last_written" not in name}

    def test_ends_after_ten_quiet_steps(self):
        self.assert_status(self.straight, 0)
        count = len(self.energy)
        # the energy without spins, of the states of each step; that of the history is with them
        every = run_case(merged(BOX, {"output": {"every": 1}}), directory=self.here("every step"))
        with h5py.File(self.here("every step", "results", "results.h5")) as results:
            mass = results["/steps/0/bodies/mass"][:]
            energy = np.array([0.5 * (mass[:, None] * results[f"/steps/{step}/bodies/velocity"][:, :2]**2).sum() for step in range(1, count + 1)])
        self.assertTrue((energy <= every.history()["kinetic_energy"] * (1 + 1e-12)).all())
        self.assertLess(count, STEPS)
        self.assertGreater(count, 100)
        quiet = energy <= LOW
        self.assertTrue(quiet[-QUIET:].all())
        self.assertFalse(quiet[-QUIET - 1])
        runs = "".join("q" if value else "-" for value in quiet)
        self.assertEqual(runs.find("q" * QUIET), count - QUIET, "it ends the first time")
        self.assertIn(f"at rest     after step {count} of {STEPS}", self.straight.stdout)
        self.assertRegex(self.straight.stdout.rstrip().splitlines()[-1], f"^finished    all {count} steps reached the accuracy")

    def test_spins(self):
        """A ball that spins about the normal of its only contact spins for ever, and is at rest; one whose spin makes it roll away is not."""
        for spin, steps in (([0.0, 0.0, 20.0], 10), ([0.0, 20.0, 0.0], 50)):
            here = self.here(f"spin {steps}")
            os.makedirs(here)
            write(os.path.join(here, "ball.csv"), f"id,x,y,z,radius,wx,wy,wz\n1,0,0,0.01,0.01,{spin[0]},{spin[1]},{spin[2]}\n")
            run = run_case({"scene": {"dimension": 3, "bodies": "file", "bodies_file": "ball.csv", "wall_friction": 0.5},
                            "boundary": [{"shape": "plane", "point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]}],
                            "time": {"step": 1e-3, "steps": 50, "rest_energy": 1e-9}, "output": {"directory": "results"}}, directory=here)
            self.assert_status(run, 0)
            self.assertEqual(run.history()["step"][-1], steps)

    def test_what_is_to_come(self):
        """Grains that rest do not end a run before a gate opens, gravity turns, or a belt or a cell starts, nor in the ten steps behind that."""
        files = {"gravity.csv": "time,gx,gy\n0,0,-9.81\n0.1,0,-9.81\n0.2,5,-9.81\n", "belt.csv": "time,vx\n0,0\n0.1,0\n0.2,0.5\n",
                 "cell.csv": "time,strain_rate_x\n0,0\n0.1,0\n0.2,-0.2\n"}
        floor = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
        ground = {"shape": "plane", "point": [0.0, -0.2], "normal": [0.0, 1.0]}
        for name, boundaries, scene, moved in (("gate", [{**floor, "remove_at": 0.1}, ground], {}, lambda place: place[1] < -0.15),
                                               ("gravity", [floor], {"gravity_table": "gravity.csv"}, lambda place: place[0] > 0.01),
                                               ("belt", [{**floor, "table": "belt.csv"}], {}, lambda place: place[0] > 0.01),
                                               ("cell", [], {"period": [1.0, 1.0], "cell_table": "cell.csv", "gravity": [0.0, 0.0]},
                                                lambda place: place[0] > 0.01),
                                               ("nothing", [floor], {}, lambda place: abs(place[0]) < 1e-6)):
            with self.subTest(name):
                place = self.here(name)
                os.makedirs(place)
                for path, text in {**files, "ball.csv": "id,x,y,radius\n1,0,0.01,0.01\n"}.items():
                    write(os.path.join(place, path), text)
                run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "ball.csv", "friction": 0.4, "rotation": False, **scene},
                                "boundary": boundaries, "time": {"step": 1e-3, "steps": 600, "rest_energy": LOW}, "output": {"every": 0}}, directory=place)
                self.assert_status(run, 0)
                steps = len(run.history()["step"])
                self.assertEqual(steps, 10) if name == "nothing" else self.assertGreater(steps, 200)
                results = run.results()
                last = max(int(key.split("/")[2]) for key in results if key.endswith("/bodies/position"))
                self.assertTrue(moved(results[f"/steps/{last}/bodies/position"][0]), results[f"/steps/{last}/bodies/position"])

    def test_a_wall_on_its_way(self):
        """It does not keep a run going, and the last words name it, whether a velocity or a force moves it; one that rests on the grain they do not."""
        lid = {"name": "lid", "shape": "plane", "point": [0.0, 0.05], "normal": [0.0, -1.0]}
        force = {"free": [False, True], "mass": 1.0, "force": [0.0, -1.0]}
        for name, wall, told in (("velocity", {**lid, "velocity": [0.0, -0.1]}, True), ("force", {**lid, **force}, True),
                                 ("still", lid, False), ("pressed", {**lid, **force, "point": [0.0, 0.02]}, False)):
            place = self.here(f"wall_{name}")
            os.makedirs(place)
            write(os.path.join(place, "ball.csv"), "id,x,y,radius\n1,0,0.01,0.01\n")
            run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "ball.csv"},
                            "boundary": [{"shape": "plane", "normal": [0.0, 1.0]}, wall],
                            "time": {"step": 1e-3, "steps": 100, "rest_energy": LOW}, "output": {"every": 0}}, directory=place)
            self.assert_status(run, 0)
            self.assertIn("at rest     after step 10 of 100: the kinetic energy of the grains, without spins of disks and spheres, was at most", run.stdout)
            self.assertEqual("; boundary 'lid' still moves" in run.stdout, told, run.stdout[-600:])

    def test_no_grain_is_left(self):
        """A scene that is empty ends with these words, and not with the energy of no grain."""
        place = self.here("empties")
        os.makedirs(place)
        write(os.path.join(place, "balls.csv"), "id,x,y,radius\n1,0,0.01,0.01\n2,0.1,0.02,0.01\n")
        run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "balls.csv"},
                        "boundary": [{"shape": "outlet", "point": [0.0, -0.1], "normal": [0.0, 1.0]}],
                        "time": {"step": 1e-3, "steps": 1000, "rest_energy": LOW}, "output": {"every": 0}}, directory=place)
        self.assert_status(run, 0)
        self.assertRegex(run.stdout, r"\nat rest     after step \d+ of 1000: no grain is left")
        self.assertEqual(run.history()["grains"][-1], 0)

    def test_a_ball_at_its_apex_is_not_at_rest(self):
        """It is slow for some steps of each bounce, which do not add up."""
        place = self.here("ball")
        os.makedirs(place)
        write(os.path.join(place, "ball.csv"), "id,shape,x,y,radius,nx,ny\n1,grain,0,0.03,0.01,,\n2,plane,0,0,,0,1\n")
        run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "ball.csv", "density": 2500.0, "wall_restitution": 0.95},
                        "time": {"step": 1e-3, "steps": 600, "rest_energy": LOW}, "output": {"every": 0}}, directory=place)
        self.assert_status(run, 0)
        energy = run.history()["kinetic_energy"]
        self.assertEqual(len(energy), 600)
        self.assertGreater((energy <= LOW).sum(), QUIET)

    def test_what_begins_to_move(self):
        """Light disks whose energy is low enough when they begin to fall, or when a cell begins to press them together, are not at rest: nothing
        bears them. They are when they lie on the floor."""
        pair = "id,x,y,radius\n1,0.02,0.02,0.01\n2,0.06,0.02,0.01\n"
        for name, scene, boundaries, ends in (("fall", {}, [{"shape": "plane", "normal": [0.0, 1.0]}], True),
                                              ("cell", {"gravity": [0.0, 0.0], "period": [0.08, 0.08], "cell_pressure": [1.0, 1.0]}, [], False)):
            place = self.here(f"begins {name}")
            os.makedirs(place)
            write(os.path.join(place, "pair.csv"), pair)
            run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "pair.csv", "density": 1000.0, **scene},
                            "boundary": boundaries, "time": {"step": 1e-4, "steps": 600, "rest_energy": 1.0 if ends else 1e-2},
                            "output": {"directory": "results", "every": 0}}, directory=place)
            self.assert_status(run, 0)
            energy = run.history()["kinetic_energy"]
            self.assertLess(energy[:20].max(), 1e-2)
            # they fall by 10 mm in 45 ms
            self.assertEqual("at rest     after step" in run.stdout, ends)
            self.assertGreater(len(energy), 440)

    def test_writes_the_last_state_and_a_checkpoint(self):
        self.assertEqual(steps_of(self.straight.results()), [len(self.energy)])
        self.assertRegex(self.straight.stdout, f"checkpoint  of step {len(self.energy)} written")

    def test_two_ranks_end_at_the_same_step(self):
        place = self.here("two")
        self.assert_status(run_case(BOX, ranks=2, directory=place), 0)
        self.assertEqual(differences(self.state(self.directory), self.state(place)), [])

    def test_restarts_count_on(self):
        """Stopped within the quiet steps, the run goes on to the same end; there it has nothing more to do."""
        place = self.here("restart")
        self.assert_status(run_case(merged(BOX, {"time": {"steps": len(self.energy) - QUIET // 2}}), directory=place), 0)
        for _ in range(2):
            self.assert_status(again(place, ranks=2), 0)
            self.assertEqual(differences(self.state(self.directory), self.state(place)), [])

    def test_a_lower_energy_goes_on(self):
        place = self.here("lower")
        self.assert_status(run_case(BOX, directory=place), 0)
        run = again(place, time={"rest_energy": 0.01 * LOW, "steps": len(self.energy) + 2 * QUIET})
        self.assert_status(run, 0)
        self.assertGreaterEqual(len(run.history()["step"]), len(self.energy) + QUIET)

    def test_without_the_key_all_steps_are_made(self):
        run = run_case(merged(BOX, {"time": {"rest_energy": 0.0, "steps": len(self.energy) + QUIET}}), directory=self.here("all"))
        self.assert_status(run, 0)
        energy = run.history()["kinetic_energy"]
        self.assertEqual(len(energy), len(self.energy) + QUIET)
        np.testing.assert_array_equal(energy[:len(self.energy)], self.energy)
        self.assertNotIn("at rest ", run.stdout)

    def test_refused(self):
        run = run_case(merged(BOX, {"time": {"rest_energy": -1.0}}), directory=self.here("bad"))
        self.assert_status(run, 2)
        self.assertRegex(run.stderr, re.escape("case.nml: &time rest_energy = -1.0: expected a finite real number >= 0 (J)"))


if __name__ == "__main__":
    unittest.main()
