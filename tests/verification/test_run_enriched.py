"""The enriched methods on packings: the search direction they choose takes at most half the iterations of NSCDD, no search direction
diverges where NSCDD converges, the safeguard says what it does, and l = 0 is NSCDD, all on any number of ranks.

With -v (ctest -V) the iterations of all runs are printed."""
import re
import unittest

import numpy as np

from gravier_runs import LONG, RunTestCase, differences, each, merged, run_case
from packings import settled_disks, settled_spheres

MOMENTUM = {"solver": {"acceleration": "momentum"}}
PARTS = {"decomposition": {"subdomains": 4, "partition": "metis"}}


def ep(direction=None, contacts=None, **more):
    return merged({"solver": {"method": "nscdd_ep"}, "enriched": {"direction": direction, "contacts": contacts, **more}})


class Enriched(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.disks = merged({
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": settled_disks(cls.scratch, count=(16, 16)), "friction": 0.3},
            "time": {"step": 1e-3, "steps": 1},
            "solver": {"method": "nscdd", "acceleration": "none", "sweeps": 3, "criterion": "residual", "tolerance": 1e-3, "max_iterations": 2000,
                       "check_every": 1, "warm_start": False},
            "output": {"directory": "results", "trace": True},
        }, PARTS)
        spheres = settled_spheres(cls.scratch + "/spheres", 7, 350)
        cls.spheres = merged(cls.disks, {"scene": {"dimension": 3, "bodies_file": spheres}})

    def play(self, jobs, ranks=1):
        """{title: run} of {title: case}."""
        return dict(zip(jobs, each(lambda title: run_case(jobs[title], ranks, self.here(f"{title} {ranks}".replace(" ", "_"))), [(title,) for title in jobs])))

    def lowered(self, run):
        """How often the safeguard lowered l, as the closing table has it."""
        return int(re.search(r"^direction .*; (\d+) reductions? of l$", run.stdout, re.MULTILINE).group(1))

    def test_automatic_direction(self):
        """At most half the iterations of NSCDD, over 1, 3 and 10 sweeps together, and at most 0.65 at any of them; with momentum too where
        there is no friction. With both, momentum has done most of what there is to gain: not more iterations."""
        jobs, pairs = {}, []
        for packing, friction in (("disks", 0.0), ("disks", 0.3), ("spheres", 0.0), ("spheres", 0.3)):
            for sweeps in (1, 3, 10):
                for extra in ({}, MOMENTUM):
                    title = f"{packing} {friction} {sweeps} {'momentum' if extra else 'plain'}"
                    case = merged(getattr(self, packing), extra, {"scene": {"friction": friction}, "solver": {"sweeps": sweeps}})
                    jobs[title + " nscdd"], jobs[title + " ep"] = case, merged(case, ep())
                    pairs.append(title)
        runs = self.play(jobs)
        print()
        sums = {}
        for title in pairs:
            with self.subTest(title):
                for name in (" nscdd", " ep"):
                    self.assert_status(runs[title + name], 0)
                plain, enriched = (int(runs[title + name].history()["iterations"][0]) for name in (" nscdd", " ep"))
                print(f"  {title:28s} NSCDD {plain:5d}  NSCDD-EP {enriched:4d}, l lowered {self.lowered(runs[title + ' ep'])} times")
                packing, friction, _, extra = title.split()
                both_accelerated = friction == "0.3" and extra == "momentum"
                self.assertLessEqual(enriched, plain if both_accelerated else 0.65 * plain)
                if not both_accelerated:
                    sums.setdefault((packing, friction, extra), []).append((enriched, plain))
                self.assertRegex(runs[title + " ep"].stdout, r"direction +l = \S+/W_aa \(automatic\), active contacts")
        for title, iterations in sums.items():
            with self.subTest(" ".join(title)):
                enriched, plain = (sum(column) for column in zip(*iterations))
                self.assertLessEqual(2 * enriched, plain)

    def test_any_direction(self):
        """From 0.1 to 1e12, on all contacts and on active ones, by both interface solvers: none diverges, all reach the tolerance. On
        active contacts none takes more iterations than NSCDD (and a tenth); on all, an l somewhat too large may take several times
        as many, in which the changes neither grow nor go round."""
        nscdd = self.play({"nscdd": self.disks})["nscdd"]
        self.assert_status(nscdd, 0)
        plain = int(nscdd.history()["iterations"][0])
        jobs = {}
        for contacts in ("all", "active"):
            for direction in (0.1, 3.0, 100.0, 1e4, 1e12):
                jobs[f"{contacts} {direction:g}"] = merged(self.disks, ep(direction, contacts))
        jobs["all 100 momentum"] = merged(self.disks, ep(100.0, "all"), MOMENTUM)
        jobs["all 3 cg"] = merged(self.disks, ep(3.0, "all", interface="cg"))
        print(f"\n  NSCDD {plain}")
        for title, run in self.play(jobs).items():
            with self.subTest(title):
                self.assert_status(run, 0)
                iterations, lowered = int(run.history()["iterations"][0]), self.lowered(run)
                print(f"  {title:20s} {iterations:5d}, l lowered {lowered} times")
                if title.startswith("active"):
                    self.assertLessEqual(iterations, 1.1 * plain)
                self.assertEqual("search direction l lowered" in run.stdout, lowered > 0)
                if title.startswith("all") and float(title.split()[1]) >= 3.0:
                    # NSCDD-EP diverges with it on all contacts (user guide, section on methods)
                    self.assertGreater(lowered, 0)
                self.assertTrue(np.all(np.isfinite(run.trace()["residual"])))

    def test_zero(self):
        """l = 0 is NSCDD bit by bit, whichever contacts take part."""
        jobs = {"nscdd": self.disks, "all": merged(self.disks, ep(0.0, "all")), "active": merged(self.disks, ep(0.0, "active"))}
        runs = self.play(jobs)
        wanted = {name: value for name, value in runs["nscdd"].results().items() if not name.startswith("/run")}
        for title in ("all", "active"):
            found = {name: value for name, value in runs[title].results().items() if not name.startswith("/run")}
            self.assertEqual(differences(wanted, found), [])
            self.assertEqual(differences(runs["nscdd"].trace(), runs[title].trace()), [])

    def test_ranks(self):
        """The same bits on 1 and 2 ranks, with the safeguard at work too, and with conjugate gradients on 4; all on 4 in `./gravier test
        long`."""
        jobs = {"automatic": merged(self.disks, ep()), "momentum": merged(self.disks, ep(), MOMENTUM),
                "spheres": merged(self.spheres, ep(), MOMENTUM), "cg": merged(self.disks, ep(interface="cg")),
                "guarded": merged(self.disks, ep(100.0, "all")),
                "schwarz_ec": merged(self.disks, ep(), {"solver": {"method": "schwarz_ec", "relaxation": 0.7}})}
        # each iteration with conjugate gradients takes as long as ten others
        jobs = {title: merged(case, {"solver": {"max_iterations": 8 if title == "cg" else 24}}) for title, case in jobs.items()}
        one = self.play(jobs)
        self.assertGreater(self.lowered(one["guarded"]), 0)
        for ranks in (2, 4):
            for title, run in self.play(jobs if LONG or ranks == 2 else {"cg": jobs["cg"]}, ranks).items():
                with self.subTest(title, ranks=ranks):
                    self.assertEqual(differences(one[title].trace(), run.trace()), [])
                    self.assertEqual([name for name in differences(one[title].results(), run.results())
                                      if not name.startswith("/run")], [])


if __name__ == "__main__":
    unittest.main()
