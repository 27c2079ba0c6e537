"""gravier --restart --changed: a run that goes on with other loads, drives and coefficients of contact. What has changed acts from the next step on,
as a loop of one's own or theory says; the log and results.h5 tell it; what a checkpoint depends on is refused as without the option."""
import os
import unittest

import numpy as np
from gravier_runs import differences, gravier, merged, namelist, read_csv, run_case, write
from loop_runs import BALLS, HEAP, LoopTestCase, written
from small_scenes import Grain, bodies_csv

from gravier import Run

#: a lid that a force presses on disks, and a body of its own
PRESSED = merged(HEAP, {"boundary": HEAP["boundary"] + [
    {"name": "lid", "shape": "plane", "point": [0.0, 0.16], "normal": [0.0, -1.0], "free": [False, True, False], "mass": 2.0, "force": [0.0, -20.0, 0.0]}],
    "time": {"steps": 30}})
#: a body on a floor without friction, at 0.3 m/s
SLIDING = {
    "scene": {"bodies": "file", "bodies_file": "bodies.csv", "friction": 0.0},
    "boundary": [{"name": "floor", "shape": "plane"}],
    "time": {"step": 1e-3, "steps": 20},
    "solver": {"accuracy": 1e-6},
    "output": {"every": 0, "checkpoint_every": 10, "energy": True},
}
#: one on a spring
SPRING = {"materials": "grain", "kind": "elastic", "friction": 0.5, "normal_stiffness": 1e4, "spring_restitution": 0.1}
RESTING = {
    "scene": {"bodies": "column", "column_count": 1, "radius": 0.01, "mass": 0.1, "wall_material": "grain"},
    "material": {"name": "grain"},
    "law": [SPRING],
    "time": {"step": 2e-4, "steps": 500},
    "solver": {"accuracy": 1e-8},
    "output": {"every": 0, "checkpoint_every": 500},
}


def with_boundary(groups, number, **keys):
    """A case in which a boundary has other keys."""
    boundaries = [dict(boundary) for boundary in groups["boundary"]]
    boundaries[number].update(keys)
    return merged(groups, {"boundary": boundaries})


class Changed(LoopTestCase):

    def go_on(self, directory, groups, *options, ranks=1):
        write(os.path.join(directory, "case.nml"), namelist(groups))
        return gravier("--restart", *options, "case.nml", ranks=ranks, directory=directory)

    def changed_run(self, title, first, then, ranks=(1, 1), prepare=None):
        """A run of one case that goes on with another one, on so many ranks each."""
        directory = self.here(title)
        os.makedirs(directory)
        if prepare:
            prepare(directory)
        self.assert_status(run_case(first, ranks=ranks[0], directory=directory), 0)
        run = self.go_on(directory, then, "--changed", ranks=ranks[1])
        self.assert_status(run, 0)
        return run

    def test_as_a_loop_that_sets_it(self):
        """A loop that sets the same values after the same step has the same history, on any ranks."""
        then = merged(with_boundary(PRESSED, 2, force=[0.0, -60.0, 0.0], friction=0.1), {"scene": {"friction": 0.6, "gravity": [2.0, -9.0, 0.0]}, "time": {"steps": 60}})
        loop = self.play("loop", merged(PRESSED, {"time": {"steps": 60}}), """
with gravier.Simulation(case, quiet=True) as s:
    while s.goes_on:
        s.step()
        if s.made == 30:
            s.friction, s.gravity = 0.6, (2.0, -9.0)
            lid = s.boundaries["lid"]
            lid.friction, lid.applied_force = 0.1, (0.0, -60.0)
""")
        # walls have the friction of the scene in the case, and not in the loop
        first = merged(PRESSED, {"scene": {"wall_friction": 0.3}})
        then = merged(then, {"scene": {"wall_friction": 0.3}})
        one = self.changed_run("one", first, then)
        two = self.changed_run("two", first, then, ranks=(1, 2))
        self.assertEqual(differences(written(one.directory), written(two.directory)), [])
        for name, column in loop.history().items():
            if "seconds" not in name:
                np.testing.assert_array_equal(one.history()[name], column, name)
        self.assertEqual([line for line in one.stdout.splitlines() if line.startswith("changed ")], [
            "changed     &scene gravity = 2.0, -9.0, 0.0, in the place of 0.0, -9.81, 0.0",
            "changed     &scene friction = 0.6, in the place of 0.3",
            "changed     &boundary 'lid' force = 0.0, -60.0, 0.0, in the place of 0.0, -20.0, 0.0",
            "changed     &boundary 'lid' friction = 0.1, in the place of not given"])
        run = Run(one.path("results"))
        self.assertEqual([run.case_at(step)["scene"][0]["friction"] for step in (1, 30, 31, 60)], [0.3, 0.3, 0.6, 0.6])

    def test_goes_on_from_there(self):
        """A restart after it takes the new case without the option, and has the bits of a run that went on without a stop."""
        then = merged(with_boundary(PRESSED, 2, velocity=[0.1, 0.0, 0.0]), {"scene": {"friction": 0.5}, "time": {"steps": 90}})
        whole = self.changed_run("whole", PRESSED, then)
        stopped = self.changed_run("stopped", PRESSED, merged(then, {"time": {"steps": 60}}))
        run = self.go_on(stopped.directory, then, ranks=2)
        self.assert_status(run, 0)
        self.assertNotIn("changed ", run.stdout)
        for name, column in whole.history().items():
            if "seconds" not in name:
                np.testing.assert_array_equal(read_csv(stopped.path("results", "history.csv"))[name], column, name)

    def test_bodies_begin_to_turn(self):
        """Bodies that slid without friction get their moments of inertia: they end rolling at 2/3 of their speed, spheres at 5/7."""
        for dimension, share, rolling in ((2, 2 / 3, 3 / 2), (3, 5 / 7, 7 / 5)):
            up = [0.0] * (dimension - 1) + [1.0]
            first = with_boundary(merged(SLIDING, {"scene": {"dimension": dimension}}), 0, point=[0.0] * dimension, normal=up)

            def prepare(directory, dimension=dimension):
                write(os.path.join(directory, "bodies.csv"), bodies_csv([Grain([0.0] * (dimension - 1) + [0.01], [0.3, 0.0, 0.0][:dimension], radius=0.01)]))
            run = self.changed_run(f"slide{dimension}", first, merged(first, {"scene": {"friction": 0.2}, "time": {"steps": 200}}), prepare=prepare)
            energy = run.history()["kinetic_energy"]
            self.assertAlmostEqual(energy[-1] / energy[0], share**2 * rolling, delta=1e-6)
            self.assertLess(abs(run.history()["energy_error"][-1]), 1e-12)

    def test_impulses_of_spheres(self):
        """Friction and rolling resistance in the place of none: solves start from the normal impulses that there were, on any ranks and however
        the run began."""
        bare = merged(BALLS, {"scene": {"friction": 0.0}, "time": {"steps": 200}, "solver": {"accuracy": 1e-3}, "output": {"energy": None}})
        then = merged(bare, {"scene": {"friction": 0.5, "rolling_friction": 0.1, "wall_pivoting_friction": 0.1}, "time": {"steps": 220}})
        one = self.changed_run("balls1", bare, then)
        two = self.changed_run("balls2", bare, then, ranks=(2, 2))
        self.assertEqual(differences(written(one.directory), written(two.directory)), [])
        cold = self.changed_run("cold", merged(bare, {"solver": {"warm_start": False}}), then)
        self.assertLess(one.history()["iterations"][200], cold.history()["iterations"][200])

    def test_springs(self):
        """A spring of another stiffness is pressed by m g/k."""
        for k in (2e4, 5e3):
            run = self.changed_run(f"spring{k}", RESTING, merged(RESTING, {"law": [{**SPRING, "normal_stiffness": k}], "time": {"steps": 1500}}))
            heights = [Run(run.path("results")).bodies(step).position[0, 1] for step in (500, 1500)]
            np.testing.assert_allclose(0.01 - np.array(heights), [0.1 * 9.81 / 1e4, 0.1 * 9.81 / k], rtol=1e-6)

    def test_drives_and_tables(self):
        """A floor that stood moves on from where it is, and a table counts the time of the run."""
        case = merged(RESTING, {"scene": {"wall_material": None, "friction": 0.5}, "material": [], "law": [], "output": {"every": 500},
                                "boundary": [{"name": "lid", "shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0], "velocity": [0.0, 0.1, 0.0]}]})
        moved = self.changed_run("moved", case, merged(with_boundary(case, 0, velocity=[0.0, -0.2, 0.0]), {"time": {"steps": 1000}}))
        place = [Run(moved.path("results")).boundaries(step).position[-1, 1] for step in (0, 500, 1000)]
        # half of the first step of another speed is made with the old one
        np.testing.assert_allclose(place, [1.0, 1.01, 1.01 - 0.02 + 0.5 * 2e-4 * 0.3], atol=1e-14)

        def prepare(directory):
            write(os.path.join(directory, "lid.csv"), "time,vy\n0.1,0.0\n0.2,1.0\n")
        by_table = merged(with_boundary(case, 0, velocity=[0.0, 0.0, 0.0], table="lid.csv"), {"time": {"steps": 1000}})
        tabled = self.changed_run("tabled", case, by_table, prepare=prepare)
        place = Run(tabled.path("results")).boundaries(1000).position[-1, 1]
        # at its end the table turns from 10 m/s^2 to a constant velocity, within the mean about the last step
        self.assertAlmostEqual(place, 1.01 + 0.05 + 0.5 * 2e-4 * 0.1 - 10.0 * 2e-4 ** 2 / 16, delta=1e-12)
        # another table: its contents have changed
        write(tabled.path("lid.csv"), "time,vy\n0.2,1.0\n0.3,0.0\n")
        longer = merged(by_table, {"time": {"steps": 1500}})
        self.assert_refused(self.go_on(tabled.directory, longer), "contents of lid.csv are not those with which results/checkpoint.h5 was written: "
                            "expected the file as it was then, or gravier --restart --changed")
        run = self.go_on(tabled.directory, longer, "--changed")
        self.assert_status(run, 0)
        self.assertIn("changed     contents of lid.csv\n", run.stdout)
        self.assertAlmostEqual(Run(tabled.path("results")).boundaries(1500).position[-1, 1], place + 0.05, delta=1e-12)

    def test_cells(self):
        """A periodic cell that stood is sheared from where it is, and its strain counts from the start of the run."""
        case = {"scene": {"bodies": "lattice", "lattice_count": [6, 6], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3, "gravity": [0.0, 0.0],
                          "period": [0.16, 0.16], "cell_strain_rate": [-0.1, 0.0]},
                "time": {"step": 1e-3, "steps": 100}, "output": {"every": 100, "checkpoint_every": 100, "stress": True}}
        run = self.changed_run("cell", case, merged(case, {"scene": {"cell_strain_rate": None, "cell_shear_rate": [0.5]}, "time": {"steps": 300}}))
        history = run.history()
        self.assertAlmostEqual(history["cell_strain_x"][99], np.log(0.99), delta=1e-4)
        self.assertAlmostEqual(history["cell_strain_x"][-1], history["cell_strain_x"][99], delta=1e-4)
        self.assertAlmostEqual(history["cell_shear_xy"][-1], 0.1, delta=1e-3)

    def test_sleepers_wake(self):
        """Bodies that sleep feel a gravity that has turned."""
        case = merged(HEAP, {"solver": {"sleeping": True}, "time": {"steps": 590}, "output": {"every": 0, "checkpoint_every": 590, "trace": None},
                             "boundary": [*HEAP["boundary"], {"name": "right", "shape": "plane", "point": [0.21, 0.0], "normal": [-1.0, 0.0]}]})
        run = self.changed_run("asleep", case, merged(case, {"scene": {"gravity": [5.0, -5.0, 0.0]}, "time": {"steps": 630}}))
        history = run.history()
        self.assertGreater(history["sleeping"][589], 60)
        self.assertEqual(history["sleeping"][590], 0)
        self.assertGreater(history["kinetic_translation"][-1], 100 * history["kinetic_translation"][589])

    def test_sleepers_slide(self):
        """A body that sleeps on a slope slides as soon as friction no longer holds it."""
        case = merged(RESTING, {"scene": {"wall_material": None, "friction": 0.8, "gravity": [2.0, -9.81], "rotation": False}, "material": [], "law": [],
                                "time": {"step": 1e-3, "steps": 100}, "solver": {"sleeping": True}, "output": {"checkpoint_every": 100}})
        run = self.changed_run("slope", case, merged(case, {"scene": {"friction": 0.05}, "time": {"steps": 200}}))
        self.assertEqual(run.history()["sleeping"][99], 1)
        speed = (2.0 - 0.05 * 9.81) * 0.1
        self.assertAlmostEqual(run.history()["kinetic_energy"][-1], 0.5 * 0.1 * speed**2, delta=1e-6)

    def assert_refused(self, run, words):
        self.assert_status(run, 2)
        self.assertEqual(run.stderr.count("\n"), 1, run.stderr)
        self.assertIn(words, run.stderr)

    def test_refused(self):
        """What a checkpoint depends on, also beside the option; and a change without it, which the line names. Nothing is touched."""
        case = PRESSED
        directory = self.here("refused")
        self.assert_status(run_case(case, directory=directory), 0)
        before = written(directory)
        longer = merged(case, {"time": {"steps": 40}})
        self.assert_refused(self.go_on(directory, merged(longer, {"scene": {"friction": 0.5}})), "case.nml: the scene is not that of results/checkpoint.h5: "
                            "friction = 0.5: expected friction = 0.3, or gravier --restart --changed, which goes on with the new value\n")
        other = "or a new run that begins with a state of this one: its final_bodies.h5, or a file of gravier.write_bodies\n"
        for groups, words in (({"scene": {"radius_max": 0.013}}, f"radius_max = 0.013: expected radius_max = 0.012, {other}"),
                              ({"scene": {"gravity": [0.0, -1.0], "rotation": False}}, f"rotation = .false.: expected rotation = .true., {other}"),
                              ({"boundary": longer["boundary"][:2]}, f"no further group: expected &boundary, {other}"),
                              ({"boundary": [{**longer["boundary"][0], "point": [0.0, -0.02]}, *longer["boundary"][1:]]}, "point = 0.0, -0.02, 0.0: expected point = "),
                              ({"boundary": with_boundary(longer, 2, velocity=[0.0, 1.0, 0.0])["boundary"]}, "case.nml: &boundary 'lid' velocity: expected 0 along what forces "
                               "move: there the boundary goes on with the velocity that it has\n"),
                              ({"scene": {"friction": 0.0}}, "case.nml: no grain turns without friction, and those of results/checkpoint.h5 turn: expected a friction "
                               "above 0 of some contacts, however small\n")):
            self.assert_refused(self.go_on(directory, merged(longer, groups), "--changed"), words)
        self.assert_refused(gravier("--changed", "case.nml", directory=directory), "--changed without --restart: expected both, since a run that begins has nothing "
                            "to differ from; see gravier --help\n")
        self.assertEqual(differences(before, written(directory)), [])

    def test_removed_boundaries(self):
        """A boundary that is gone does not come back."""
        case = with_boundary(PRESSED, 1, remove_at=0.01)
        directory = self.here("removed")
        self.assert_status(run_case(case, directory=directory), 0)
        kept = merged(with_boundary(case, 1, remove_at=1.0), {"time": {"steps": 40}})
        self.assert_refused(self.go_on(directory, kept, "--changed"), "case.nml: &boundary 'left' remove_at: expected the time at which it was removed, since it is "
                            "no longer there in results/checkpoint.h5\n")
        # one that is still there goes later
        later = merged(with_boundary(case, 0, remove_at=0.035), {"time": {"steps": 40}})
        run = self.go_on(directory, later, "--changed")
        self.assert_status(run, 0)
        self.assertRegex(run.stdout, r"\nremoved +.*'floor'")

    def test_nothing_changed(self):
        """The option beside an unchanged case, and where there is no checkpoint."""
        directory = self.here("same")
        whole = run_case(merged(PRESSED, {"time": {"steps": 60}}), directory=self.here("whole_same"))
        self.assert_status(run_case(PRESSED, directory=directory), 0)
        run = self.go_on(directory, merged(PRESSED, {"time": {"steps": 60}}), "--changed")
        self.assert_status(run, 0)
        self.assertNotIn("changed ", run.stdout)
        for name, column in whole.history().items():
            if "seconds" not in name:
                np.testing.assert_array_equal(run.history()[name], column, name)


if __name__ == "__main__":
    unittest.main()
