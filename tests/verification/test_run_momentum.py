"""Momentum: the solutions are those of plain iterations, it takes far fewer of them, it takes not many more to any velocity error on
any problem here, and a run goes on from a checkpoint bit by bit.

With -v (ctest -V) the iterations to each velocity error are printed, plain and with momentum."""
import unittest

import numpy as np

from gravier_runs import LONG, RunTestCase, differences, each, merged, run_case
from packings import settled_disks, settled_spheres

#: velocity errors [g h]; the runs go on to a residual that is small beside them
GOALS = [0.5, 0.3, 0.2, 0.1]
TIGHT, CHECK_EVERY, STEP = 2e-5, 5, 1e-3

PLAIN = {"solver": {"acceleration": "none"}}
MOMENTUM = {"solver": {"acceleration": "momentum"}}
NLGS = {"solver": {"method": "nlgs"}}
METHODS = {
    "nlgs": NLGS,
    "nlgs, 3 sweeps": {"solver": {"method": "nlgs", "sweeps": 3}},
    "nscdd": {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": 8}},
    "nscdd, 3 sweeps": {"solver": {"method": "nscdd", "sweeps": 3}, "decomposition": {"subdomains": 8, "partition": "metis"}},
    "nscdd_ep": {"solver": {"method": "nscdd_ep", "sweeps": 3}, "decomposition": {"subdomains": 4},
                 "enriched": {"direction": 1.0, "contacts": "active"}},
    "schwarz": {"solver": {"method": "schwarz"}, "decomposition": {"subdomains": 8}},
    "schwarz, 3 sweeps": {"solver": {"method": "schwarz", "sweeps": 3}, "decomposition": {"subdomains": 8, "partition": "metis"}},
    "schwarz_ec": {"solver": {"method": "schwarz_ec", "sweeps": 3}, "decomposition": {"subdomains": 4},
                   "enriched": {"direction": 1.0, "contacts": "active"}},
}


#: from this coefficient of friction on the iterates of packings wander, plain and with momentum: their error goes on crossing 0.1 g h
#: for thousands of iterations, so that the last time it is above says nothing
WANDERING = 0.8


def below_for_good(trace):
    """Iterations from which on the estimated velocity error was at most each of GOALS, None where it was above at the end."""
    found = []
    for goal in GOALS:
        above = np.nonzero(trace["velocity_error"] > goal * 9.81 * STEP)[0]
        after = above[-1] + 1 if len(above) else 0
        found.append(int(trace["iteration"][after]) if after < len(trace["iteration"]) else None)
    return found


def below_first(trace):
    """Iterations at which the estimated velocity error was at most each of GOALS for the first time, where a run to this accuracy ends."""
    below = [np.nonzero(trace["velocity_error"] <= goal * 9.81 * STEP)[0] for goal in GOALS]
    return [int(trace["iteration"][found[0]]) if len(found) else None for found in below]


class Momentum(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.packing = settled_disks(cls.scratch)
        cls.disks = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": cls.packing, "friction": 0.3},
            "time": {"step": STEP, "steps": 1},
            "solver": {"criterion": "residual", "tolerance": TIGHT, "max_iterations": 6000, "check_every": CHECK_EVERY},
            "output": {"directory": "results", "trace": True},
        }
        cls.column = merged(cls.disks, {"scene": {"bodies": "column", "bodies_file": None, "column_count": 40, "radius": 0.05,
                                                  "friction": 0.0}})
        cls.spheres = cls.step_of_spheres(7, 350)

    @classmethod
    def step_of_spheres(cls, edge, steps):
        """A step of edge^3 spheres that have settled in so many steps."""
        spheres = settled_spheres(f"{cls.scratch}/spheres_{edge}", edge, steps)
        return merged(cls.disks, {"scene": {"dimension": 3, "bodies_file": spheres}})

    def pairs(self, cases):
        """{title: (iterations to each goal, plain and with momentum)}."""
        jobs = [(title, plain) for title in cases for plain in (True, False)]
        runs = dict(zip(jobs, each(lambda title, plain: run_case(
            merged(cases[title], PLAIN if plain else MOMENTUM), 1, self.here(f"{title}, {plain}".replace(" ", "_"))), jobs)))
        found = {}
        print()
        for title in cases:
            for plain in (True, False):
                # 3: the tolerance was not met, which is no failure of a comparison
                self.assertIn(runs[title, plain].status, (0, 3), runs[title, plain])
            wanders = cases[title]["scene"]["friction"] >= WANDERING
            found[title] = tuple((below_first if wanders else below_for_good)(runs[title, plain].trace()) for plain in (True, False))
            print(f"  {title:30s} {found[title][0]}\n  {'':21s} momentum {found[title][1]}")
        return found

    def test_never_much_slower(self):
        """To every velocity error that plain iterations reach, momentum takes at most a tenth more and one check. Where the iterates settle,
        it stays below this error from then on. At a friction of 0.8 and more spheres take thousands of plain iterations, in
        `./gravier test long`."""
        cases = {f"column, {name}": merged(self.column, method) for name, method in METHODS.items() if name != "nscdd_ep"}
        for name, method in METHODS.items():
            cases[f"disks 0.3, {name}"] = merged(self.disks, method)
        for friction in (0.0, 0.1, 0.5, 0.8, 1.2):
            cases[f"disks {friction}, nlgs"] = merged(self.disks, NLGS, {"scene": {"friction": friction}})
        for friction in (0.0, 0.3, 0.5, 0.8, 1.2) if LONG else (0.0, 0.3, 0.5):
            cases[f"spheres {friction}, nlgs"] = merged(self.spheres, NLGS, {"scene": {"friction": friction}})
        for name in ("nscdd", "schwarz"):
            cases[f"spheres 0.3, {name}"] = merged(self.spheres, METHODS[name])
        for title, (plain, momentum) in self.pairs(cases).items():
            for goal, most, taken in zip(GOALS, plain, momentum):
                if most is not None:
                    with self.subTest(title, goal=goal):
                        self.assertIsNotNone(taken)
                        self.assertLessEqual(taken, 1.1 * most + CHECK_EVERY)

    def test_gains(self):
        """What it is for: a fifth of the iterations, or fewer, to a velocity error of 0.1 on settled packings."""
        spheres = self.step_of_spheres(10, 450)
        cases = {"disks 0.0": merged(self.disks, NLGS, {"scene": {"friction": 0.0}}), "disks 0.3": merged(self.disks, NLGS),
                 "spheres 0.3": merged(spheres, NLGS), "spheres 0.3 in 8": merged(spheres, METHODS["nscdd"])}
        for title, (plain, momentum) in self.pairs(cases).items():
            with self.subTest(title):
                # what plain iterations did not reach took them more than max_iterations
                self.assertIsNotNone(momentum[-1])
                self.assertLessEqual(5 * momentum[-1], plain[-1] or 6000)

    def test_restart(self):
        """Four steps at once, and two steps, then two more from the checkpoint on another number of ranks."""
        case = merged(self.disks, METHODS["nscdd"], MOMENTUM,
                      {"time": {"steps": 4}, "solver": {"tolerance": 1e-3}, "output": {"checkpoint_every": 1}})
        straight = run_case(case, 1, self.here("straight"))
        self.assert_status(straight, 0)
        self.assert_status(run_case(merged(case, {"time": {"steps": 2}}), 2, self.here("stopped")), 0)
        again = run_case(case, 1, self.here("stopped"), options=["--restart"])
        self.assert_status(again, 0)
        # the text of the input tells how many steps were asked for first
        self.assertEqual([name for name in differences(straight.results(), again.results()) if name != "/run@input_text"], [])
        self.assertEqual(differences(straight.trace(), again.trace()), [])


if __name__ == "__main__":
    unittest.main()
