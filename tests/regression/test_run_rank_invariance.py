"""The results do not depend on the number of ranks: not in one bit, for every method, partition and rule. On more ranks than two
`./gravier test long` compares more methods."""
import unittest

from gravier_runs import LONG, RunTestCase, differences, each, merged, run_case, steps_of, write
from packings import settled_disks

FEW = {"solver": {"criterion": "residual", "tolerance": 3e-3}, "time": {"steps": 2}}
# a tolerance at which momentum steers for many iterations; a first solve that does not reach it is compared as it ends
STEERED = {"solver": {"acceleration": "momentum", "criterion": "residual", "tolerance": 1e-5, "max_iterations": 300}}
METHODS = {
    # so many sweeps that the relaxation has to be lowered
    "schwarz": merged(FEW, {"solver": {"method": "schwarz", "sweeps": 10}}),
    "schwarz, momentum": merged(STEERED, {"solver": {"method": "schwarz"}}),
    # a direction of 1 on all contacts does not converge on every packing (user guide, choosing a method)
    "schwarz_ec": merged(FEW, {"solver": {"method": "schwarz_ec"}, "enriched": {"direction": 0.3}}),
    "nscdd": merged(FEW, {"solver": {"method": "nscdd", "sweeps": 2, "acceleration": "none"}}),
    "nscdd, momentum": merged(STEERED, {"solver": {"method": "nscdd", "sweeps": 2}}),
    # a direction on active contacts only: the matrices change from one iteration to the next
    "nscdd_ep, mumps": merged(FEW, {"solver": {"method": "nscdd_ep", "sweeps": 30},
                                    "enriched": {"direction": 30.0, "contacts": "active"}}),
    "nscdd_ep, cg": merged(FEW, {"solver": {"method": "nscdd_ep", "sweeps": 30},
                                 "enriched": {"direction": 30.0, "contacts": "active", "interface": "cg", "cg_tolerance": 1e-8}}),
}


class RankInvariance(RunTestCase):

    def assert_same_runs(self, first, second, what, statuses=(0,)):
        self.assertIn(first.status, statuses, str(first))
        self.assert_status(second, first.status)
        self.assertEqual(differences(first.results(), second.results()), [], what)
        tables = [run.history() for run in (first, second)]
        for table in tables:
            # the only figures that are not of the computation
            for name in ("wall_seconds", "solve_seconds"):
                del table[name]
        self.assertEqual(differences(*tables), [], what)
        self.assertEqual(differences(first.trace(), second.trace()), [], what)

    def compare_ranks(self, cases, ranks):
        """Run each of {title: groups} on each number of ranks; all must give what the first number gives."""
        jobs = [(title, n) for title in cases for n in ranks]
        runs = dict(zip(jobs, each(lambda title, n: run_case(cases[title], n, self.here(f"{title} on {n}")), jobs)))
        for title in cases:
            for n in ranks[1:]:
                with self.subTest(title, ranks=n):
                    # a solve that ends at max_iterations is the same on any number of ranks, too
                    self.assert_same_runs(runs[title, ranks[0]], runs[title, n], f"on {ranks[0]} and {n} ranks",
                                          (0, 3) if "momentum" in title else (0,))
        return runs


class Disks(RankInvariance):
    """600 settled disks with friction in 6 subdomains."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.packing = settled_disks(cls.scratch)
        cls.case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": cls.packing, "friction": 0.3},
            "time": {"step": 1e-3, "steps": 3},
            "solver": {"tolerance": 1e-3, "max_iterations": 5000, "check_every": 2},
            "decomposition": {"subdomains": 6},
            "output": {"directory": "results", "trace": True},
        }

    def check_variants(self, partition, kind, methods=tuple(METHODS), on_four=()):
        """Methods on one and two ranks, and some on four, which are more than the cores of many machines."""
        cases = {f"{name}, {partition}, {kind}": merged(self.case, METHODS[name],
                                                        {"decomposition": {"partition": partition, "kind": kind}})
                 for name in methods}
        four = [title for title in cases if title.startswith(tuple(f"{name}, {partition}" for name in on_four))]
        runs = self.compare_ranks({title: cases[title] for title in four}, (1, 2, 4))
        runs.update(self.compare_ranks({title: case for title, case in cases.items() if title not in four}, (1, 2)))
        self.assertEqual(len(runs), 2 * len(methods) + len(on_four))
        for (title, _), run in runs.items():
            # a comparison of runs that do nothing would prove nothing
            self.assertEqual(steps_of(run.results()), list(range(cases[title]["time"]["steps"] + 1)))
            history = run.history()
            self.assertGreater(history["contacts"].min(), 1100, title)
            # later steps may start converged
            self.assertGreater(history["iterations"][0], 0, title)
            self.assertGreater(history["iterations"].max() * cases[title]["solver"].get("sweeps", 1), 100, title)
            self.assertGreater(history["interface_bodies"].min(), 30, title)

    def test_grid_dual(self):
        self.check_variants("grid", "dual", on_four=("schwarz", "nscdd, momentum", "nscdd_ep, mumps") if LONG else ("nscdd, momentum",))

    def test_grid_primal(self):
        self.check_variants("grid", "primal", ("schwarz, momentum", "nscdd", "nscdd_ep, mumps") if LONG else ("schwarz, momentum", "nscdd_ep, mumps"))

    def test_metis_dual(self):
        self.check_variants("metis", "dual", ("schwarz", "schwarz_ec", "nscdd", "nscdd_ep, mumps") if LONG else ("schwarz", "nscdd"))

    def test_metis_primal(self):
        if LONG:
            self.check_variants("metis", "primal", on_four=("schwarz, momentum", "schwarz_ec", "nscdd", "nscdd_ep, cg"))
        else:
            self.check_variants("metis", "primal", ("schwarz_ec", "nscdd, momentum"), on_four=("schwarz_ec",))

    def test_the_same_run_twice(self):
        case = merged(self.case, METHODS["nscdd_ep, mumps"])
        first, second = (run_case(case, 2, self.here(f"take {k}")) for k in (1, 2))
        self.assert_same_runs(first, second, "twice on 2 ranks")

    def test_more_ranks_than_subdomains(self):
        """By sweeps, and with the interface solved on all ranks."""
        cases = {name: merged(self.case, METHODS[name], {"solver": {"tolerance": 1e-2}, "decomposition": {"subdomains": 2}})
                 for name in ("nscdd", "nscdd_ep, mumps")}
        runs = self.compare_ranks(cases, (1, 4))
        for name in cases:
            self.assertIn("2 ranks own no subdomain", runs[name, 4].stdout)

    def test_repartition(self):
        case = merged(self.case, METHODS["nscdd"], {"time": {"steps": 3}, "decomposition": {"partition": "metis", "repartition_every": 2}})
        self.compare_ranks({"nscdd, new partition": case}, (1, 3))


class Spheres(RankInvariance):
    """288 spheres fall into a box, touch the ground, and start to settle: bodies change their subdomain, impulses of the
    step before are carried over."""

    def test_spheres(self):
        case = {
            "scene": {"dimension": 3, "bodies": "lattice", "lattice_count": [6, 6, 8], "radius_min": 0.008, "radius_max": 0.012,
                      "friction": 0.3},
            "time": {"step": 2e-3, "steps": 80},
            "solver": {"method": "nscdd", "tolerance": 1e-3, "max_iterations": 5000, "warm_start": True},
            "decomposition": {"subdomains": 4, "grid": [2, 1, 2], "repartition_every": 30},
            "output": {"directory": "results", "every": 10, "trace": True},
        }
        runs = self.compare_ranks({"spheres": case}, (1, 4))
        history = runs["spheres", 1].history()
        self.assertGreater(history["contacts"].max(), 500)
        # falling, then stopped by the ground and by each other
        self.assertLess(history["kinetic_energy"][-1], 0.5 * history["kinetic_energy"].max())


class Glued(RankInvariance):
    """Disks on a row of glued disks that moves as prescribed, in every method: the glued are candidates of their contacts."""

    def test_moving_floor(self):
        rows = [f"{14 * j + i + 1},{0.1 * i + 0.05 * (j % 2) + 0.05},{0.05 + 0.087 * j},0.05,{1 if j == 0 else 0}"
                for j in range(6) for i in range(14)]
        path = self.here("glued.csv")
        write(path, "id,x,y,radius,group\n" + "\n".join(rows) + "\n")
        case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": path, "friction": 0.3, "period": [1.4, 0.0]},
            "boundary": [{"shape": "grains", "group": 1, "velocity": [0.2, 0.0]}],
            "time": {"step": 1e-3, "steps": 8 if LONG else 3},
            "solver": {"tolerance": 1e-2, "max_iterations": 300},
            "decomposition": {"subdomains": 6},
            "output": {"directory": "results", "trace": True},
        }
        self.compare_ranks({name: merged(case, {"solver": METHODS[name]["solver"], "enriched": METHODS[name].get("enriched", {})},
                                         {"solver": {"tolerance": 1e-2}}) for name in METHODS}, (1, 3) if LONG else (1, 2))


if __name__ == "__main__":
    unittest.main()