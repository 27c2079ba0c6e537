"""&insertion: grains that enter while a run goes on, by number or by mass, in free places of a region, the same on any ranks and through
restarts; what enters, leaves and stays adds up."""
import os
import re
import shutil
import unittest

import numpy as np

from gravier_runs import LONG, RunTestCase, contents, differences, gravier, merged, namelist, read_csv, run_case, write
from shaped_scenes import LIBRARY

from gravier import Run

H = 1e-3
BIN = [{"name": "floor", "shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]},
       {"name": "left", "shape": "plane", "point": [0.0, 0.0], "normal": [1.0, 0.0]},
       {"name": "right", "shape": "plane", "point": [0.24, 0.0], "normal": [-1.0, 0.0]}]
FEED = {"name": "feed", "lower": [0.02, 0.2], "upper": [0.22, 0.26], "rate": 333.0, "radii": "uniform", "radius_min": 0.004, "radius_max": 0.006,
        "velocity": [0.1, -0.8], "velocity_spread": [0.1, 0.2]}
POUR = {
    "scene": {"dimension": 2, "bodies": "none", "friction": 0.3, "density": 2000.0, "overlap_projection": False},
    "boundary": BIN,
    "insertion": [FEED],
    "time": {"step": H, "steps": 240},
    "solver": {"method": "nscdd"},
    "decomposition": {"subdomains": 4},
    "output": {"every": 1, "contacts": False, "energy": True, "checkpoint_every": 240},
}
#: one state, that of the end
LAST = {"output": {"every": 240}}
#: what a run does in steps that nothing is found of afterwards
CLOCKS = ("wall_seconds", "solve_seconds")


def changed(**keys):
    """The scene with other keys of its insertion."""
    return merged(POUR, {"insertion": [{key: value for key, value in {**FEED, **keys}.items() if value is not None}]})


def states(run):
    """Bodies by step: (identifiers, fields)."""
    found = run.results()
    for step in found.steps():
        place = f"/steps/{step}/bodies"
        fields = {name: found[f"{place}/{name}"] for name in found.names(place)}
        yield step, fields["id"], fields


def middles(fields):
    """Places in the middle of a step, where gaps are measured, from those at its end."""
    nd = fields["position"].shape[1]
    return fields["position"] - 0.5 * H * fields["velocity"][:, :nd]


def entries(run):
    """For each step in which grains entered: which of its bodies are new, their places in the middle of the step, all fields."""
    last = 0
    for step, names, fields in states(run):
        new = names > last
        if step > 0 and new.any():
            yield step, new, middles(fields), {"id": names, **fields}
        last = max(last, *names.tolist(), 0)


def least_gap(new, place, radius, period=None):
    """Between grains that enter and all others."""
    least = np.inf
    for k in np.flatnonzero(new):
        way = place - place[k]
        if period is not None:
            way -= period * np.round(way / period)
        gap = np.linalg.norm(way, axis=1) - radius - radius[k]
        gap[k] = np.inf
        least = min(least, gap.min())
    return least


class Insertion(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.directory = os.path.join(cls.scratch, "straight")
        cls.straight = run_case(POUR, directory=cls.directory)
        if cls.straight.status == 0:
            cls.history = cls.straight.history()

    def figures(self, directory):
        """What the last checkpoint and the history hold, but for times on the clock."""
        history = {name: value for name, value in read_csv(os.path.join(directory, "results", "history.csv")).items() if name not in CLOCKS}
        found = contents(os.path.join(directory, "results", "checkpoint.h5"))
        return {**history, **{name: value for name, value in found.items() if "last_written" not in name}}

    def test_number_by_the_rate(self):
        """A grain enters in the step at whose end all of it is owed."""
        self.assert_status(self.straight, 0)
        np.testing.assert_array_equal(np.cumsum(self.history["entered"]), np.floor(333.0 * self.history["time"] + 1e-6))
        np.testing.assert_array_equal(self.history["grains"], np.cumsum(self.history["entered"]))
        self.assertIn("insertion   'feed': 79 grains of", self.straight.stdout)
        self.assertIn("as many as its rate asks for", self.straight.stdout)

    def test_mass_by_the_rate(self):
        run = run_case(changed(rate=None, mass_rate=50.0), directory=self.here("mass"))
        self.assert_status(run, 0)
        history, heaviest = run.history(), 2000.0 * np.pi * 0.006 ** 2
        mass = np.cumsum(history["entered_mass"])
        owed = 50.0 * history["time"]
        self.assertTrue((mass <= owed + 1e-6 * heaviest).all())
        self.assertTrue((mass > owed - heaviest).all())
        *_, (_, _, fields) = states(run)
        self.assertAlmostEqual(fields["mass"].sum(), mass[-1], delta=1e-9)

    def test_what_enters(self):
        """Radii, masses and velocities are those asked for; a grain enters wholly in the region, and touches nothing."""
        velocity = []
        for _, new, place, fields in entries(self.straight):
            radius = fields["radius"]
            self.assertGreaterEqual(least_gap(new, place, radius), 0.0)
            self.assertTrue((place[new] - radius[new, None] >= np.array([0.02, 0.2]) - 1e-12).all())
            self.assertTrue((place[new] + radius[new, None] <= np.array([0.22, 0.26]) + 1e-12).all())
            velocity.append(fields["velocity"][new, :2] - [0.0, -9.81 * H])
            np.testing.assert_allclose(fields["mass"], 2000.0 * np.pi * radius ** 2, rtol=1e-13)
        *_, (_, names, fields) = states(self.straight)
        # the first three identifiers are those of the boundaries
        np.testing.assert_array_equal(names, np.arange(4, 83))
        self.assertTrue(((fields["radius"] >= 0.004) & (fields["radius"] <= 0.006)).all())
        # five deviations of the mean of 79 uniform numbers
        self.assertAlmostEqual(fields["radius"].mean(), 0.005, delta=5 * 0.002 / np.sqrt(12 * 79))
        velocity = np.vstack(velocity)
        # but for those that hit others in the step in which they enter
        inside = (np.abs(velocity - [0.1, -0.8]) <= np.array([0.1, 0.2]) + 1e-9).all(axis=1)
        self.assertGreater(inside.mean(), 0.9)
        self.assertGreater(np.ptp(velocity[inside, 1]), 0.3)

    def test_lists(self):
        """Of grains that do not move, lists are made in steps in which one enters, and in no other."""
        run = run_case(merged(changed(rate=100.0, velocity=[0.0, 0.0], velocity_spread=None), {"scene": {"gravity": [0.0, 0.0]}, "time": {"steps": 100}}),
                       directory=self.here("lists"))
        self.assert_status(run, 0)
        history = run.history()
        self.assertEqual(history["entered"].sum(), 10)
        np.testing.assert_array_equal(history["listed"][1:], history["entered"][1:])

    def test_balances_close(self):
        self.assertIn("grains      0 at the start + 79 entered - 0 left = 79; mass", self.straight.stdout)
        self.assertLess(np.abs(self.history["energy_error"]).max(), 1e-9 * np.abs(self.history["load_work"]).max())
        self.assertLess(self.history["carried_away"][-1], 0.0)

    def test_two_ranks(self):
        for ranks in (2, 3) if LONG else (2,):
            place = self.here(f"ranks{ranks}")
            # the checkpoint has the bodies of the end: no other state is looked at
            self.assert_status(run_case(merged(POUR, LAST), ranks=ranks, directory=place), 0)
            self.assertEqual(differences(self.figures(self.directory), self.figures(place)), [])

    def test_other_subdomains(self):
        """The same grains are owed, and those that touch nothing go the same ways."""
        run = run_case(merged(POUR, {"decomposition": {"subdomains": 1}}), directory=self.here("one"))
        self.assert_status(run, 0)
        first = [state for state in states(run) if state[0] <= 50]
        for (_, names, fields), (_, others, more) in zip(first, states(self.straight)):
            np.testing.assert_array_equal(names, others)
            np.testing.assert_array_equal(fields["radius"], more["radius"])
            np.testing.assert_array_equal(fields["position"], more["position"])
        np.testing.assert_array_equal(run.history()["entered"], self.history["entered"])

    def test_restart(self):
        """Stopped between two grains, with others put off, the run goes on to the same bits on other ranks."""
        crowded = merged(changed(rate=4000.0), LAST)
        whole, part = self.here("whole"), self.here("part")
        run = run_case(crowded, directory=whole)
        self.assert_status(run, 0)
        self.assertRegex(run.stdout, r"\*\*\* \d+ fewer than its rate owes: they found no place; grains were put off in \d+ steps")
        self.assertRegex(run.stdout, r"finished    all \d+ steps reached the accuracy.*; \d+ of the \d+ grains that rates of insertions owe have not entered; ")
        self.assert_status(run_case(merged(crowded, {"time": {"steps": 131}, "output": {"checkpoint_every": 131}}), directory=part), 0)
        write(os.path.join(part, "case.nml"), namelist(crowded))
        self.assert_status(gravier("--restart", "case.nml", ranks=2, directory=part), 0)
        self.assertEqual(differences(self.figures(whole), self.figures(part)), [])

    def test_put_off(self):
        """What finds no place waits: grains enter in the order of their numbers, so that radii are those of a run with room."""
        run = run_case(changed(rate=4000.0), directory=self.here("crowded"))
        self.assert_status(run, 0)
        count = 0
        for _, new, place, fields in entries(run):
            self.assertGreaterEqual(least_gap(new, place, fields["radius"]), 0.0)
            count += new.sum()
        self.assertLess(count, 4000.0 * 0.24 - 100)
        roomy = run_case(merged(changed(upper=[0.22, 1.2], rate=4000.0), {"time": {"steps": 50}}), directory=self.here("roomy"))
        self.assert_status(roomy, 0)
        radius = [list(states(each))[-1][2]["radius"] for each in (run, roomy)]
        n = min(len(radius[0]), len(radius[1]))
        self.assertGreater(n, 150)
        np.testing.assert_array_equal(radius[0][:n], radius[1][:n])
        self.assertIn("a second are more than its region has places for", run.stdout)

    def test_how_many_find_places(self):
        """The rate that the warning gives is the one at which grains enter a full region and leave it, within a quarter."""
        cases = {"disks at rest": (2, [0.0, 0.1], [0.2, 0.3], 0.005, [0.0, 0.0]), "spheres at rest": (3, [0.0, 0.0, 0.1], [0.06, 0.06, 0.2], 0.004, [0.0] * 3),
                 "spheres with a velocity": (3, [0.0, 0.0, 0.1], [0.06, 0.06, 0.2], 0.004, [0.0, 0.0, -1.0])}
        for name, (nd, lower, upper, radius, velocity) in cases.items():
            with self.subTest(name):
                case = {"scene": {"dimension": nd, "bodies": "none"}, "time": {"step": H, "steps": 300}, "output": {"every": 0},
                        "boundary": [{"name": "out", "shape": "outlet", "normal": [0.0] * (nd - 1) + [1.0]}],
                        "insertion": {"lower": lower, "upper": upper, "radius": radius, "velocity": velocity, "rate": 1e5}}
                run = run_case(case, directory=self.here(name))
                self.assert_status(run, 0)
                said = float(re.search(r"before those that entered have left it, about (\S+) a second: a larger region or velocity lets them enter",
                                       run.stdout).group(1))
                rows = run.history()
                entered = rows["entered"][rows["time"] > 0.15 - 1e-9].sum() / 0.15
                self.assertLess(abs(said / entered - 1.0), 0.25, (said, entered))

    def test_as_fast_as_places_are_found(self):
        run = run_case(merged(changed(rate=None, count=100), {"time": {"steps": 120}}), directory=self.here("filled"))
        self.assert_status(run, 0)
        self.assertGreater(run.history()["entered"][0], 30)
        self.assertEqual(run.history()["grains"][-1], 100)
        limited = run_case(merged(changed(mass=3.0), {"time": {"steps": 120}}), directory=self.here("limited"))
        self.assert_status(limited, 0)
        total = limited.history()["entered_mass"].sum()
        self.assertTrue(3.0 - 2000.0 * np.pi * 0.006 ** 2 < total <= 3.0, total)
        # below the mass of one grain
        none = run_case(merged(changed(mass=0.1), {"time": {"steps": 2}}), directory=self.here("none"))
        self.assert_status(none, 0)
        self.assertEqual(none.history()["entered"].sum(), 0)
        self.assertRegex(none.stdout, r"\nwarning     &insertion 'feed': no grain enters, since the first one has a mass of [12]\.\d\dE-01 kg: a mass above "
                                      r"that lets grains in\n")
        checked = run_case(changed(mass=0.1), directory=self.here("none checked"), options=["--check"])
        self.assertIn("insertion 'feed': about 0 grains enter until the end, taking at least", checked.stdout)
        for each, end in ((run, "its count is reached"), (limited, "its mass has room for no other grain")):
            self.assertRegex(each.stdout, rf"kg entered, {end}[\n;]")
            self.assertNotIn("fewer than its rate owes", each.stdout)

    def test_most_in_a_step(self):
        """More than 1000 grains a step do not enter. The log says so, and of the steps in which grains found no place."""
        def still(steps, upper):
            keys = {"lower": [0.0, 0.5], "upper": [10.0, upper], "rate": 1.4e6, "count": 4000, "velocity": [0.0, 0.0], "velocity_spread": None}
            return merged(changed(**keys), {"scene": {"gravity": [0.0, 0.0]}, "boundary": BIN[:1], "time": {"steps": steps},
                                            "output": {"every": 0, "energy": False, "checkpoint_every": 0}})

        for steps, line in ((2, "*** 800 fewer than its rate owes: at most 1000 enter in a step; more than 1000 were to enter in 2 steps"),
                            (4, "its count is reached; more than 1000 were to enter in 3 steps")):
            with self.subTest(steps=steps):
                run = run_case(still(steps, 10.5), directory=self.here(f"most{steps}"))
                self.assert_status(run, 0)
                self.assertIn("&insertion 'feed': 1.40E+06 grains a second are 1.40E+03 in a step, in which at most 1000 of an insertion enter: ",
                              run.stdout)
                left = f"; {4000 - 1000 * steps} of its count of 4000 are still to enter" if steps < 4 else ""
                self.assertIn(f"{line}{left}\n", run.stdout)
        run = run_case(still(8, 0.54), directory=self.here("most_both"))
        self.assert_status(run, 0)
        self.assertRegex(run.stdout, r"\*\*\* \d+ fewer than its rate owes: they found no place, and at most 1000 enter in a step; "
                                     r"grains were put off in \d steps; more than 1000 were to enter in \d steps?; \d+ of its count of 4000 are still to enter\n")

    def test_no_rest_before_grains_enter(self):
        """Neither an empty scene before its start nor one that waits for the next grain is at rest; a scene that is complete is."""
        rules = {"time": {"steps": 4000, "rest_energy": 1e-5}}
        run = run_case(merged(changed(rate=20.0, count=3, start=0.05), rules), directory=self.here("rest"))
        self.assert_status(run, 0)
        self.assertEqual(run.history()["entered"].sum(), 3)
        self.assertIn("at rest     after step", run.stdout)
        self.assertGreater(len(run.history()["step"]), 200 + 10)

    def test_no_rest_while_a_grain_waits_for_a_place(self):
        """A grain that is put off in one step does not end a run whose grains have rested for long; a region that stays full does, and the log says so."""
        feed = {"name": "feed", "lower": [0.0, 0.0], "upper": [0.1, 0.06], "radius": 0.01, "rate": 10.0}
        bin_ = [BIN[0], BIN[1], {**BIN[2], "point": [0.1, 0.0]}]
        case = {"scene": {"dimension": 2, "bodies": "none", "friction": 0.3}, "boundary": bin_, "time": {"step": H, "steps": 2500, "rest_energy": 1e-3},
                "output": {"every": 0, "energy": True}}
        run = run_case(merged(case, {"insertion": [{**feed, "count": 14}]}), directory=self.here("rested"))
        self.assert_status(run, 0)
        self.assertRegex(run.stdout, r"insertion   'feed': 14 grains of \S+ kg entered, its count is reached; grains were put off in \d+ steps\n")
        self.assertRegex(run.stdout, r"at rest     after step \d+ of 2500: the kinetic energy of the grains, without spins of disks and spheres, was at most 1.00E-03 J in 10 steps\n")
        full = run_case(merged(case, {"insertion": [{**feed, "rate": 200.0, "count": 50}]}), directory=self.here("full"))
        self.assert_status(full, 0)
        self.assertRegex(full.stdout, r"at rest     after step \d+ of 2500: .* J in 10 steps, and grains that are still to enter found no place\n")
        self.assertRegex(full.stdout, r"insertion   'feed': \d+ grains of \S+ kg entered, \*\*\* \d+ fewer than its rate owes: they found no place; grains were put off in \d+ steps; \d+ of its count of 50 are still to enter\n")
        # what the last words doubt
        self.assertRegex(Run(full.path("results")).doubts(), r"^\d+ of the 50 grains that rates of insertions owe have not entered$")
        self.assertEqual(Run(full.path("results")).verdict(), "converged with doubts")
        entered, energy = (np.array(full.history()[name]) for name in ("entered", "kinetic_translation"))
        self.assertTrue((energy[-10:] <= 1e-3).all() and not entered[-10:].any())

    def test_steps_to_come_change_nothing(self):
        """A scene that two insertions of different grains fill makes the same steps however many are to follow."""
        feeds = [{"name": "fine", "lower": [0.02, 0.1], "upper": [0.1, 0.16], "rate": 400.0, "count": 40, "radius": 0.004},
                 {"name": "coarse", "lower": [0.02, 0.2], "upper": [0.1, 0.26], "rate": 200.0, "count": 20, "radius": 0.008, "start": 0.03}]
        case = merged(POUR, {"insertion": feeds, "time": {"steps": 150}, "output": {"every": 0}})
        short = run_case(case, directory=self.here("short"))
        longer = run_case(merged(case, {"time": {"steps": 400}}), directory=self.here("longer"))
        for name, column in short.history().items():
            if "seconds" not in name:
                np.testing.assert_array_equal(column, longer.history()[name][:150], name)

    def test_start_and_end(self):
        run = run_case(changed(start=0.05, end=0.1), directory=self.here("times"))
        self.assert_status(run, 0)
        entered, time = run.history()["entered"], run.history()["time"]
        self.assertEqual(entered[time < 0.05].sum(), 0)
        self.assertEqual(entered[time > 0.1 + 1e-9].sum(), 0)
        self.assertEqual(entered.sum(), 16)
        self.assertIn("as many as its rate asks for", run.stdout)

    def test_several_with_grains_at_the_start(self):
        """Identifiers follow on those of the file; two insertions in one region do not overlap; the outlet takes grains out for good."""
        place = self.here("several")
        os.makedirs(place)
        write(os.path.join(place, "start.csv"), "id,shape,x,y,radius,nx,ny\n7,grain,0.06,0.02,0.01,,\n40,grain,0.12,0.03,0.01,,\n")
        outlet = {"name": "out", "shape": "outlet", "point": [0.0, 0.05], "normal": [0.0, 1.0]}
        case = merged(POUR, {
            "scene": {"bodies": "file", "bodies_file": "start.csv"}, "boundary": BIN[1:] + [outlet],
            "insertion": [FEED, {**FEED, "name": "more", "seed": 1, "region": "ball", "lower": None, "upper": None, "centre": [0.12, 0.23],
                                 "region_radius": 0.03, "rate": 100.0}]})
        case["insertion"][1] = {key: value for key, value in case["insertion"][1].items() if value is not None}
        run = run_case(case, directory=place)
        self.assert_status(run, 0)
        seen = set()
        for _, new, middle, fields in entries(run):
            self.assertGreaterEqual(least_gap(new, middle, fields["radius"]), 0.0)
        gone, before = set(), set()
        for _, names, _ in states(run):
            names = set(names.tolist())
            self.assertFalse(names & gone, "no identifier comes back")
            gone |= before - names
            before, seen = names, seen | names
        self.assertGreater(len(gone), 30)
        # those of the boundaries are left out as well
        self.assertEqual(min(seen - {7, 40}), 44)
        found = re.search(r"grains +(\d+) at the start \+ (\d+) entered - (\d+) left = (\d+); mass (\S+) \+ (\S+) - (\S+) = (\S+) kg", run.stdout)
        first, entered, left, now = (int(found[k]) for k in range(1, 5))
        self.assertEqual((first, entered, left, now), (2, len(seen) - 2, len(gone), len(before)))
        self.assertEqual(first + entered - left, now)
        masses = [float(found[k]) for k in range(5, 9)]
        self.assertAlmostEqual(masses[0] + masses[1] - masses[2], masses[3], delta=2e-6 * masses[1])
        *_, (_, _, fields) = states(run)
        self.assertAlmostEqual(fields["mass"].sum(), masses[3], delta=2e-6 * masses[3])
        self.assertLess(np.abs(run.history()["energy_error"]).max(), 1e-9 * np.abs(run.history()["load_work"]).max())
        two = self.here("several2")
        os.makedirs(two)
        shutil.copy(os.path.join(place, "start.csv"), two)
        self.assert_status(run_case(merged(case, LAST), ranks=2, directory=two), 0)
        self.assertEqual(differences(self.figures(place), self.figures(two)), [])

    def test_ball(self):
        for nd, centre in ((2, [0.1, 0.3]), (3, [0.1, 0.1, 0.3])):
            with self.subTest(dimension=nd):
                case = merged(POUR, {
                    "scene": {"dimension": nd}, "time": {"steps": 60}, "boundary": [],
                    "insertion": [{"region": "ball", "centre": centre, "region_radius": 0.04, "rate": 500.0, "radius": 0.004,
                                   "velocity": [0.0] * (nd - 1) + [-2.0]}]})
                del case["boundary"]
                run = run_case(case, directory=self.here(f"ball{nd}"))
                self.assert_status(run, 0)
                ways = []
                for _, new, place, fields in entries(run):
                    ways += np.linalg.norm(place[new] - centre, axis=1).tolist()
                    self.assertGreaterEqual(least_gap(new, place, fields["radius"]), 0.0)
                self.assertEqual(len(ways), 30)
                self.assertLessEqual(max(ways), 0.036 + 1e-12)
                # the mean distance from the centre is nd/(nd + 1) of the radius: five deviations
                self.assertAlmostEqual(np.mean(ways), nd / (nd + 1) * 0.036, delta=5 * 0.3 * 0.036 / np.sqrt(30))

    def test_period(self):
        """The region is a whole period wide: grains overlap no image either, and images are counted."""
        # many are on their way across the side of the period
        case = merged(changed(lower=[0.0, 0.2], upper=[0.24, 0.24], rate=2000.0, velocity=[1.5, -0.4]), {
            "scene": {"period": [0.24, 0.0]}, "boundary": BIN[:1], "decomposition": {"subdomains": 3}})
        run = run_case(case, directory=self.here("period"))
        self.assert_status(run, 0)
        period = np.array([0.24, 1e9])
        for _, new, place, fields in entries(run):
            self.assertGreaterEqual(least_gap(new, place, fields["radius"], period), -1e-15)
        two = self.here("period2")
        self.assert_status(run_case(merged(case, LAST), ranks=2, directory=two), 0)
        self.assertEqual(differences(self.figures(self.here("period")), self.figures(two)), [])
        out = run_case(merged(case, {"insertion": [{**FEED, "lower": [-0.02, 0.2]}]}), directory=self.here("out"))
        self.assert_status(out, 2)
        self.assertIn("case.nml: &insertion 'feed': expected a region in the period along axis 1, from 0", out.stderr)

    def test_units(self):
        """Lengths of four times, times of twice the size: the same motion to the bit, since all factors are powers of two."""
        other = merged(POUR, {
            "scene": {"density": 500.0},
            "boundary": [{**wall, "point": [4.0 * x for x in wall["point"]]} for wall in BIN],
            "insertion": [{**FEED, "lower": [0.08, 0.8], "upper": [0.88, 1.04], "rate": 166.5, "radius_min": 0.016, "radius_max": 0.024,
                           "velocity": [0.2, -1.6], "velocity_spread": [0.2, 0.4]}], "time": {"step": 2 * H}})
        run = run_case(other, directory=self.here("units"))
        self.assert_status(run, 0)
        for (_, names, fields), (_, others, more) in zip(states(run), states(self.straight)):
            np.testing.assert_array_equal(names, others)
            np.testing.assert_allclose(fields["position"], 4.0 * more["position"], rtol=1e-12, atol=0.0)
            np.testing.assert_allclose(fields["velocity"][:, :2], 2.0 * more["velocity"][:, :2], rtol=1e-9, atol=1e-12)

    def test_shapes(self):
        for nd in (2, 3):
            with self.subTest(dimension=nd):
                place = self.here(f"shapes{nd}")
                os.makedirs(place)
                write(os.path.join(place, "a.shapes"), LIBRARY[nd])
                names = ("pill, disk, square", "cube, sphere, pill")[nd - 2]
                middle = [0.0] * (nd - 2)
                case = merged(POUR, {
                    "scene": {"dimension": nd, "shapes": "a.shapes"},
                    "boundary": [{"name": "floor", "shape": "plane", "point": [0.0] + middle + [0.0], "normal": [0.0] + middle + [1.0]}],
                    "insertion": [{"lower": [0.0] * (nd - 1) + [0.2], "upper": [0.3] * (nd - 1) + [0.5], "rate": 300.0, "radius": 0.02,
                                   "grain_shapes": names, "grain_shares": [2.0, 1.0, 1.0], "velocity": [0.0] + middle + [-1.0]}],
                    "time": {"steps": 100}})
                run = run_case(case, directory=place)
                self.assert_status(run, 0)
                for _, new, places, fields in entries(run):
                    self.assertGreaterEqual(least_gap(new, places, fields["radius"]), 0.0)
                *_, (_, _, fields) = states(run)
                self.assertEqual(len(fields["shape"]), 30)
                self.assertEqual(len(set(fields["shape"].tolist())), 3)
                self.assertGreater(len(np.unique(fields["orientation"].round(9), axis=0)), 20)
                first = fields["mass"][fields["shape"] == 0] / (2000.0 * (np.pi * 0.02 ** 2, 4 / 3 * np.pi * 0.02 ** 3)[nd - 2])
                np.testing.assert_allclose(first, 1.0, rtol=1e-13)
                two = self.here(f"shapes{nd}_2")
                os.makedirs(two)
                write(os.path.join(two, "a.shapes"), LIBRARY[nd])
                self.assert_status(run_case(merged(case, LAST), ranks=2, directory=two), 0)
                self.assertEqual(differences(self.figures(place), self.figures(two)), [])

    def test_sleeping(self):
        """Grains that enter above others at rest wake them where they land; the run ends like any other."""
        run = run_case(merged(POUR, {"solver": {"sleeping": True, "sleep_after": 5}, "time": {"steps": 400},
                                     "insertion": [{**FEED, "rate": 100.0}]}), directory=self.here("sleep"))
        self.assert_status(run, 0)
        self.assertEqual(run.history()["grains"][-1], 40)

    def test_material(self):
        case = merged(changed(material="light"), {"time": {"steps": 30}})
        case["material"] = [{"name": "heavy", "density": 7000.0}, {"name": "light", "density": 100.0}]
        run = run_case(case, directory=self.here("light"))
        self.assert_status(run, 0)
        *_, (_, _, fields) = states(run)
        np.testing.assert_allclose(fields["mass"], 100.0 * np.pi * fields["radius"] ** 2, rtol=1e-13)
        self.assertTrue((fields["material"] == 2).all())

    def test_table_of_radii(self):
        place = self.here("table")
        os.makedirs(place)
        write(os.path.join(place, "radii.csv"), "radius,share\n0.004,1\n0.006,3\n")
        case = merged(changed(radii="table", radius_min=None, radius_max=None, radius_table="radii.csv"),
                      {"time": {"steps": 100}, "output": {"checkpoint_every": 100}})
        run = run_case(case, directory=place)
        self.assert_status(run, 0)
        *_, (_, _, fields) = states(run)
        self.assertEqual(set(fields["radius"].tolist()), {0.004, 0.006})
        write(os.path.join(place, "radii.csv"), "radius,share\n0.004,2\n0.006,3\n")
        write(os.path.join(place, "case.nml"), namelist(merged(case, {"time": {"steps": 120}})))
        again = gravier("--restart", "case.nml", directory=place)
        self.assert_status(again, 2)
        self.assertIn("contents of radii.csv", again.stderr)

    def test_refused(self):
        lines = {
            "&insertion 'feed': expected a region in which boundaries and outlets leave room for grains: in 1000 places of it the smallest "
            "grain overlaps one": {"lower": [0.02, -0.2], "upper": [0.22, -0.1]},
            "&insertion 'feed': expected a region with room for the largest grain, of diameter 1.200E-02 m": {"upper": [0.22, 0.21]},
            "&insertion (the 1st, 'feed') upper = 0.02, 0.26: expected components above those of lower": {"upper": [0.02, 0.26]},
            "&insertion (the 1st, 'feed') rate = 0.0: expected a finite real number > 0 (1/s)": {"rate": 0.0},
            "&insertion (the 1st, 'feed') mass_rate = -1.0: expected a finite real number > 0 (kg/s)": {"rate": None, "mass_rate": -1.0},
            "&insertion (the 1st, 'feed') mass_rate = 2.0: expected it in the place of rate": {"mass_rate": 2.0},
            "&insertion (the 1st, 'feed') count = 0: expected an integer >= 1": {"count": 0},
            "&insertion (the 1st, 'feed') mass = 0.0: expected a finite real number > 0 (kg)": {"mass": 0.0},
            "&insertion (the 1st, 'feed') start = -1.0: expected a finite real number >= 0 (s)": {"start": -1.0},
            "&insertion (the 1st, 'feed') end = 0.1: expected a time later than start, here start = 0.1": {"start": 0.1, "end": 0.1},
            "&insertion (the 1st, 'feed') velocity_spread = 0.1, -0.1: expected": {"velocity_spread": [0.1, -0.1]},
            "&insertion (the 1st, 'feed') velocity = 0.1, 0.0, 1.0: expected a third component of 0": {"velocity": [0.1, 0.0, 1.0]},
            "&insertion (the 1st, 'feed') material = 'glass': expected the name of a &material, and there is none": {"material": "glass"},
            "&insertion (the 1st, 'feed') grain_shapes = 'square': expected shapes of &scene": {"grain_shapes": "square"},
            "&insertion (the 1st, 'feed') radius_min = 0.008: expected at most radius_max, here radius_max = 0.006": {"radius_min": 0.008},
            "&insertion (the 1st, 'feed') centre = 0.0, 0.0: centre belongs to region = 'ball'": {"centre": [0.0, 0.0]},
            "&insertion (the 1st, 'feed') region_radius is missing": {"region": "ball", "lower": None, "upper": None, "centre": [0.1, 0.2]},
            "&insertion (the 1st, 'feed') region_radius = 0.0: expected": {"region": "ball", "lower": None, "upper": None, "centre": [0.1, 0.2],
                                                                          "region_radius": 0.0},
            "&insertion (the 1st, 'feed') region = 'cone': expected 'box' or 'ball'": {"region": "cone"},
            "unknown key 'rat' in &insertion; did you mean 'rate'?": {"rat": 1.0},
        }
        for line, keys in lines.items():
            with self.subTest(line):
                run = run_case(changed(**keys), directory=self.here("bad"), options=("--check",))
                self.assert_status(run, 2)
                self.assertEqual(len(run.stderr.splitlines()), 1, run.stderr)
                self.assertIn(line, run.stderr)
        twice = run_case(merged(POUR, {"insertion": [FEED, FEED]}), directory=self.here("bad"))
        self.assert_status(twice, 2)
        self.assertIn("&insertion (the 2nd, 'feed') name = 'feed': expected a name of its own, but the 1st has it too", twice.stderr)
        run = run_case(merged(POUR, {"decomposition": {"partition": "metis"}}), directory=self.here("bad"))
        self.assert_status(run, 2)
        self.assertIn("&decomposition partition = 'metis': expected 'grid' where bodies = 'none'", run.stderr)
        column = merged(POUR, {"scene": {"bodies": "column", "density": None, "friction": None}, "solver": {"method": "nlgs", "criterion": "error"},
                               "decomposition": {"subdomains": 1}})
        run = run_case(column, directory=self.here("bad"))
        self.assert_status(run, 2)
        self.assertIn("&solver criterion = 'error': expected another where grains enter", run.stderr)
        far = merged(POUR, {"boundary": BIN[:2] + [{**BIN[2], "point": [1e12, 0.0]}]})
        run = run_case(far, directory=self.here("bad"))
        self.assert_status(run, 2)
        self.assertIn("boundary 'right': a coordinate or length of 1.000E+12 m: expected at most", run.stderr)
        none = merged(POUR)
        del none["insertion"]
        run = run_case(none, directory=self.here("bad"))
        self.assert_status(run, 2)
        self.assertIn("group &insertion is missing: expected &insertion ... /, required by bodies = 'none'", run.stderr)

    def test_restart_of_another_insertion(self):
        write(os.path.join(self.directory, "case.nml"), namelist(merged(changed(rate=300.0), {"time": {"steps": 250}})))
        run = gravier("--restart", "case.nml", directory=self.directory)
        write(os.path.join(self.directory, "case.nml"), namelist(POUR))
        self.assert_status(run, 2)
        self.assertIn("rate = 300.0: expected rate = 333.0", run.stderr)


if __name__ == "__main__":
    unittest.main()
