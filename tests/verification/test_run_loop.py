"""The loop in the user's hands: gravier.Simulation makes the bits of the program where nothing is changed; what a loop sets acts as the same
thing in an input file, or as theory says; what is wrong is refused in one line."""
import os
import unittest

from gravier_runs import differences, gravier, merged, run_case
from loop_runs import BALLS, HEAP, LOOP, LoopTestCase, written

class Loop(LoopTestCase):

    def check_bits(self, title, groups, ranks=(1, 2), status=0):
        for n in ranks:
            program = run_case(groups, ranks=n, directory=self.here(f"{title}_program{n}"))
            self.assert_status(program, status)
            loop = self.play(f"{title}_loop{n}", groups, LOOP, ranks=n, status=status)
            self.same(program, loop)
        return program, loop

    def test_bits_of_disks(self):
        program, loop = self.check_bits("disks", HEAP)
        # the log is the same one, but for seconds
        last = [run.stdout.rstrip().splitlines()[-1] for run in (program, loop)]
        self.assertEqual(last[0], last[1])
        self.assertTrue(os.path.exists(loop.path("results", "run.log")))

    def test_bits_of_spheres(self):
        self.check_bits("balls", BALLS)

    def test_bits_with_inflow_and_outlet(self):
        feed = {"name": "feed", "lower": [0.0, 0.2], "upper": [0.2, 0.26], "rate": 500.0, "count": 20, "radii": "uniform",
                "radius_min": 0.008, "radius_max": 0.012}
        outlet = {"name": "out", "shape": "outlet", "point": [0.0, -0.2], "normal": [0.0, 1.0]}
        self.check_bits("feed", merged(HEAP, {"insertion": [feed], "boundary": HEAP["boundary"][1:] + [outlet], "time": {"steps": 250}}))

    def test_unconverged_solves_have_status_3(self):
        self.check_bits("poor", merged(HEAP, {"solver": {"max_iterations": 2, "tolerance": 1e-9}}), status=3)

    def test_restart(self):
        """The program goes on from a loop that stopped, and a loop from the program."""
        whole = run_case(HEAP, directory=self.here("whole"))
        stopped = """
with gravier.Simulation(case, quiet=True) as s:
    while s.made < 30:
        s.step()
    s.stop("half is enough")
"""
        loop = self.play("half", HEAP, stopped, ranks=2)
        self.assertEqual(loop.stdout, "")
        with open(loop.path("results", "run.log"), encoding="utf-8") as file:
            log = file.read()
        self.assertIn("ended       after step 30 of 60: half is enough\n", log)
        self.assertRegex(log.rstrip().splitlines()[-1], "^finished    all 30 steps reached the accuracy")
        self.assert_status(gravier("--restart", "case.nml", ranks=1, directory=loop.directory), 0)
        self.assertEqual(differences(self.states(whole), self.states(loop)), [])
        half = run_case(merged(HEAP, {"time": {"steps": 30}}), directory=self.here("first"), ranks=2)
        self.assert_status(half, 0)
        again = self.play("first", HEAP, LOOP, "--restart", ranks=2)
        self.assertEqual(differences(self.states(whole), self.states(again)), [])

    def states(self, run):
        """What a run has written; one that was stopped after step 30 has that state too, and the input of its beginning."""
        return {name: value for name, value in written(run.directory).items()
                if not any(part in name for part in ("steps/30", "last_written", "input_text"))}

    def test_energy_at_the_start(self):
        """The kinetic energy is that of the bodies before the first step of a run that goes on, too."""
        script = """
with gravier.Simulation(case, quiet=True) as s:
    assert s.kinetic_energy == 0.0
    for k in range(17):
        s.step()
    s.checkpoint()
    before = 0.5 * float((np.array(s.bodies.mass) * (np.array(s.bodies.velocity)**2).sum(1)).sum())
    assert before > 0.0
with gravier.Simulation(case, quiet=True, restart=True) as s:
    assert s.made == 17 and abs(s.kinetic_energy - before) <= 1e-12 * before, (s.made, s.kinetic_energy, before)
"""
        moving = merged(HEAP, {"output": {"checkpoint_every": 0}, "scene": {"friction": 0.0, "rotation": False}})
        self.play("energy", moving, script)

    def test_what_was_set_is_told(self):
        """The log has a line where a loop sets something for the first time, and a restart warns that the values of the case act again."""
        script = """
with gravier.Simulation(case, quiet=True, forces=True) as s:
    s.step()
    s.boundaries["floor"].friction = 0.5
    s.gravity = (0.0, -1.0)
    s.step()
    s.gravity = (0.0, -2.0)
    s.boundaries["left"].velocity = (0.0, 0.25)
    if s.rank == s.ranks - 1:
        s.bodies.force = np.zeros((len(s.bodies.id), 2))
    s.step()
    s.checkpoint()
"""
        told = ["friction of boundary 'floor' from step 2 on, at first to 5.000E-01", "gravity from step 2 on, at first to 0.000E+00 -1.000E+00",
                "velocity of boundary 'left' from step 3 on, at first to 0.000E+00 2.500E-01", "forces of bodies from step 3 on"]
        names = ", ".join(text.split(" from step")[0] for text in told)
        for ranks in (1, 2):
            case = merged(HEAP, {"output": {"checkpoint_every": 0}, "time": {"steps": 5}})
            loop = self.play(f"told{ranks}", case, script, ranks=ranks)
            with open(loop.path("results", "run.log"), encoding="utf-8") as file:
                lines = [line.rstrip("\n") for line in file if line.startswith("loop ")]
            self.assertEqual(lines, [f"loop        sets {text}; a restart begins without it" for text in told])
            again = gravier("--restart", "case.nml", directory=loop.directory, ranks=ranks)
            self.assert_status(again, 0)
            self.assertIn(f"warning     a loop had set: {names}. What the case has instead acts from here on, until it is set again\n", again.stdout)
            once_more = gravier("--restart", "case.nml", directory=loop.directory)
            self.assert_status(once_more, 0)

    def test_checkpoint_by_hand(self):
        script = """
with gravier.Simulation(case, quiet=True) as s:
    for k in range(17):
        s.step()
    s.checkpoint()
"""
        loop = self.play("by_hand", merged(HEAP, {"output": {"checkpoint_every": 0}}), script, ranks=2)
        with open(loop.path("results", "run.log"), encoding="utf-8") as file:
            log = file.read()
        self.assertIn("checkpoint  of step 17 written in ", log)
        self.assertIn("ended       after step 17 of 60: its loop has ended\n", log)
        again = gravier("--restart", "case.nml", directory=loop.directory)
        self.assert_status(again, 0)
        self.assertEqual(again.history()["step"][-1], 60)


if __name__ == "__main__":
    unittest.main()
