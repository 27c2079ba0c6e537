"""What a solve leaves out and what the log tells of its time: checks that can tell nothing new, and the balance of sweeps."""
import re

from gravier_runs import RunTestCase, merged, run_case, settled_disks


class Progress(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        packing = settled_disks(cls.scratch, count=(14, 12))
        cls.case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": packing, "friction": 0.3},
                    "time": {"step": 1e-3, "steps": 1},
                    "solver": {"tolerance": 1e-4, "max_iterations": 20000, "check_every": 10, "warm_start": False},
                    "output": {"directory": "results"}}

    def test_checks_left_out(self):
        """With trace no check is left out. Without, a solve ends with the same residual asked for, at most two checks later."""
        for method, subdomains in (("nlgs", 1), ("nscdd", 4), ("schwarz", 2)):
            for tolerance in (1e-2, 1e-4):
                runs = [run_case(merged(self.case, {"solver": {"method": method, "tolerance": tolerance},
                                                    "decomposition": {"subdomains": subdomains}, "output": {"trace": trace}}),
                                 1, self.here(f"{method} {tolerance} {trace}")) for trace in (False, True)]
                with self.subTest(method=method, tolerance=tolerance):
                    for run in runs:
                        self.assert_status(run, 0)
                        self.assertLessEqual(run.history()["residual"][0], tolerance)
                    few, all_checks = (run.history()["iterations"][0] for run in runs)
                    self.assertGreaterEqual(few, all_checks)
                    self.assertLessEqual(few, all_checks + 20)

    def test_balance(self):
        """A line after each new partition but the first, and one at the end; none with one subdomain."""
        case = merged(self.case, {"time": {"steps": 12}, "solver": {"method": "nscdd", "tolerance": 1e-2},
                                  "decomposition": {"subdomains": 4, "repartition_every": 5}})
        for ranks in (1, 2):
            run = run_case(case, ranks, self.here(f"balance {ranks}"))
            self.assert_status(run, 0)
            found = re.findall(r"^balance     seconds in sweeps: slowest rank ([\d.]+), slowest subdomain ([\d.]+) of the mean (\w+)",
                               run.stdout, re.M)
            self.assertEqual([line[2] for line in found], ["until", "until", "since"], run.stdout)
            for rank, subdomain, _ in found:
                self.assertTrue(1.0 <= float(rank) <= ranks, rank)
                self.assertTrue(1.0 <= float(subdomain) <= 4.0, subdomain)
        alone = run_case(self.case, 1, self.here("alone"))
        self.assert_status(alone, 0)
        self.assertNotIn("balance  ", alone.stdout)
