"""The last words of a run are true: what was mended, how solves ended, how wrong velocities were, and what is not advised."""
import os
import re

import gravier_runs
import h5py
import numpy as np
from gravier_runs import RunTestCase, merged, run_case, write

import gravier

RADIUS = 0.05  # m
OVERLAP, ALLOWED = 4e-3, 5e-4  # m
#: two grains without loads that overlap: one projection moves each by half of what is too much
PAIR = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "../pair.csv", "gravity": [0.0, 0.0], "overlap_allowed": ALLOWED},
        "time": {"step": 1e-3, "steps": 3}, "output": {"directory": "results", "checkpoint_every": 3}}
#: disks that fall into a box and come to rest
DISKS = {"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [10, 12], "radius_min": 0.008, "radius_max": 0.012,
                   "friction": 0.3},
         "time": {"step": 1e-3, "steps": 300},
         "solver": {"acceleration": "none", "max_iterations": 20000},
         "output": {"directory": "results", "every": 0, "final_bodies": True}}


def line(run, begin):
    """The last line of a log that begins so."""
    found = [text for text in run.stdout.splitlines() if text.startswith(begin)]
    return found[-1] if found else ""


class LastWords(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        write(f"{cls.scratch}/pair.csv", f"id,x,y,radius\n1,0,0,{RADIUS}\n2,{2 * RADIUS - OVERLAP},0,{RADIUS}\n")
        cls.rest = cls.settle("settled", [10, 12])

    @classmethod
    def settle(cls, title, count):
        """A case that starts from so many disks, settled."""
        settled = run_case(merged(DISKS, {"scene": {"lattice_count": count}, "solver": {"criterion": "residual", "tolerance": 1e-3}}),
                           directory=f"{cls.scratch}/{title}")
        if settled.status != 0:
            raise AssertionError(f"the packing was not made: {settled}")
        return merged(DISKS, {"scene": {"bodies": "file", "bodies_file": f"../{title}/results/final_bodies.h5", "lattice_count": None,
                                        "radius_min": None, "radius_max": None},
                              "time": {"steps": 5}, "output": {"final_bodies": False}})

    def test_older_files(self):
        """Files of an older run that this one does not replace are named once, by the run that finds them."""
        case = {**PAIR, "output": {"directory": "results"}}
        said = [line(run_case(merged(case, {"output": more}), 1, self.here("older")), "warning     results holds")
                for more in ({"trace": True, "final_bodies": True}, {}, {"trace": True, "final_bodies": True})]
        self.assertEqual(said, ["", "warning     results holds files of an older run, which stay as they are: trace.csv, final_bodies.h5", ""])
        said = [line(run_case(merged(case, {"output": more}), 1, self.here("older pictures")), "warning     results holds")
                for more in ({"vtk": True}, {"vtk": True, "contacts": False}, {})]
        kept = "warning     results holds files of an older run, which stay as they are: "
        self.assertEqual(said, ["", kept + "contacts.vtkhdf", kept + "bodies.vtkhdf, contacts.vtkhdf"])

    def test_reported_errors(self):
        """What a solve that has converged reports is within the accuracy, also soon after a pass over layers."""
        run = run_case({"scene": {"dimension": 2, "bodies": "column", "column_count": 200}, "time": {"step": 1e-3, "steps": 10},
                        "output": {"directory": "results", "every": 0}}, 1, self.here("column"))
        self.assert_status(run, 0)
        history = run.history()
        self.assertIn("made a pass over layers", run.stdout)
        self.assertLessEqual((history["velocity_error"] / history["velocity_scale"]).max(), 0.1)

    def test_small_shifts(self):
        """Shifts that are small against the paths of grains are named, and said to be no other law, and still smaller ones to be no fault."""
        for speed, words in ((3, r"0\.65 % of the paths of grains; "), (60, r"3\.2E-02 % of the paths of grains, which is too little to matter; ")):
            write(self.here("fast.csv"), f"id,x,y,radius,vx\n1,0,0,{RADIUS},{speed}\n2,{2 * RADIUS - OVERLAP},0,{RADIUS},{speed}\n")
            run = run_case(merged(PAIR, {"scene": {"bodies_file": "../fast.csv"}, "time": {"steps": 9, "step": 1e-2}}), 1, self.here(f"fast {speed}"))
            self.assertRegex(line(run, "finished"), r"overlaps were projected in 11 % of them, by " + words)

    def test_small_roundings(self):
        """Squares on soft springs overlap by more than the default rounding; the log says what holds them, and a larger rounding does."""
        case = {"scene": {"bodies": "file", "bodies_file": "b.csv", "shapes": "a.shapes", "friction": 0.3, "wall_material": "a"},
                "material": {"name": "a"}, "law": {"materials": "a", "kind": "elastic", "normal_stiffness": 1e3},
                "boundary": {"shape": "plane", "normal": [0.0, 1.0]}, "time": {"step": 1e-3, "steps": 50}, "output": {"every": 0}}
        for rounding, told in (("", True), ("rounding 0.003\n", False)):
            directory = self.here(f"squares {len(rounding)}")
            os.makedirs(directory)
            write(os.path.join(directory, "a.shapes"), f"shape square\n{rounding}regular 4 0.01\n")
            write(os.path.join(directory, "b.csv"), "id,shape,mass,x,y\n1,square,0.1,0,0.0072\n2,square,0.1,0,0.0213\n")
            run = run_case(case, 1, directory)
            self.assert_status(run, 0)
            self.assertEqual("; where contacts yield, give the shapes a larger rounding\n" in run.stdout, told, run.stdout)

    def test_mended(self):
        """Lengths of shifts are those of the formula, and the last line says so in more than a tenth of the steps, on any ranks. In the
        later steps the overlap exceeds what is allowed by rounding at most, which does not count."""
        shift = 0.5 * (OVERLAP - ALLOWED)
        said = []
        for subdomains, ranks in ((1, 1), (2, 1), (2, 2)):
            run = run_case(merged(PAIR, {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": subdomains}}), ranks,
                           self.here(f"pair {subdomains} {ranks}"))
            self.assert_status(run, 0)
            found = re.search(r"projected in 1 of 3 steps \(33 %\): shifts of a grain add up to (\S+) m on average\n", run.stdout)
            self.assertTrue(found, run.stdout)
            self.assertAlmostEqual(float(found[1]), shift, delta=5e-6)
            self.assertEqual(line(run, "finished"), "finished    all 3 steps reached the accuracy; overlaps were projected in 33 % of them: "
                             "the results are not those of the contact law; results in results")
            start, later = map(float, re.search(r"overlaps    in the first step at most (\S+) m, later at most (\S+) m", run.stdout).groups())
            self.assertAlmostEqual(start, OVERLAP, delta=5e-6)
            self.assertAlmostEqual(later, ALLOWED, delta=5e-6)
            said.append(re.findall(r"^(?:overlaps|accuracy|finished).*$|^ +(?:U from|projected).*$", run.stdout, re.M))
        self.assertEqual(said[1], said[2])

    def test_overlaps_of_the_start(self):
        """Overlaps in the middle of the first step are no errors of solves: the log says so, and advises nothing. They may come from velocities."""
        kept = merged(PAIR, {"scene": {"overlap_allowed": 1e-4}, "time": {"steps": 1}})
        run = run_case(kept, 1, self.here("overlaps_of_the_start"))
        self.assert_status(run, 0)
        self.assertIn("m: there were as large ones in the middle of the first step, which come from the places and the velocities of the start\n", run.stdout)
        self.assertNotIn("the solves leave errors that add up", run.stdout)

    def test_shared_grains(self):
        """Shifts are those of the places in the results, a grain that two subdomains share counting once."""
        places, x = [], 0.0
        for overlap in (0.0, 4e-3, 3e-3, 1e-3):
            x += 2 * RADIUS - overlap if places else 0.0
            places.append(x)
        write(self.here("chain.csv"), "id,x,y,radius\n" + "".join(f"{k},{place!r},0,{RADIUS}\n" for k, place in enumerate(places, 1)))
        for subdomains in (1, 2):
            run = run_case(merged(PAIR, {"scene": {"bodies_file": "../chain.csv"}, "time": {"steps": 1}, "solver": {"method": "nscdd"},
                                         "decomposition": {"subdomains": subdomains, "grid": [subdomains, 1]}}), 1, self.here(f"chain {subdomains}"))
            self.assert_status(run, 0)
            results = run.results()
            shift = np.abs(results["/steps/1/bodies/position"] - results["/steps/0/bodies/position"])[:, 0].mean()
            said = float(re.search(r"shifts of a grain add up to (\S+) m on average", run.stdout)[1])
            self.assertAlmostEqual(said / shift, 1.0, delta=6e-3)
            self.assertEqual(run.history()["interface_bodies"][0] > 0, subdomains > 1)

    def test_path(self):
        """The path that shifts are compared with is that of the velocities: two grains that fly together overlap at the start."""
        write(self.here("flying.csv"), f"id,x,y,radius,vx,vy\n1,0,0,{RADIUS},3,4\n2,{2 * RADIUS - OVERLAP},0,{RADIUS},3,4\n")
        run = run_case(merged(PAIR, {"scene": {"bodies_file": "../flying.csv"}}), 1, self.here("flying"))
        self.assert_status(run, 0)
        self.assertRegex(run.stdout, r"shifts of a grain add up to 1\.75E-03 m on average, 1\.2E-01 of its path of 1\.50E-02 m\n")

    def test_seldom_mended(self):
        run = run_case(merged(PAIR, {"time": {"steps": 20}}), 1, self.here("seldom"))
        self.assertIn("projected in 1 of 20 steps (5 %)", run.stdout)
        self.assertEqual(line(run, "finished"), "finished    all 20 steps reached the accuracy; results in results")
        for steps, words in ((0, "no step was made"), (1, "its only step reached the accuracy")):
            few = run_case(merged(self.rest, {"time": {"steps": steps}, "output": {"every": 1}}), 1, self.here(f"of {steps}"))
            self.assertEqual(line(few, "finished"), f"finished    {words}; results in results")
        off = run_case(merged(PAIR, {"scene": {"overlap_projection": False, "overlap_allowed": None}}), 1, self.here("off"))
        self.assertIn("            overlaps are not projected\n", off.stdout)

    def test_restart(self):
        """What is known of the steps since the restart alone says so."""
        self.assert_status(run_case(PAIR, 1, self.here("restart")), 0)
        write(self.here("restart", "case.nml"), gravier.namelist(merged(PAIR, {"time": {"steps": 8}})))
        again = gravier_runs.gravier("--restart", "case.nml", directory=self.here("restart"))
        self.assert_status(again, 0)
        self.assertIn("            these lines are of the 5 steps since the restart\n", again.stdout)
        self.assertEqual(line(again, "finished"),
                         "finished    all 8 steps reached the accuracy; errors and overlaps are those since the restart; results in results")

    def test_ways_to_miss(self):
        """Solves that end at max_iterations, that stagnate at rounding, that have no solution: each is counted, the status is 3, and the log
        says what may mend it."""
        write(self.here("grain.csv"), f"id,x,y,radius\n1,0,{RADIUS},{RADIUS}\n")
        crushed = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "../grain.csv", "overlap_projection": False},
                   "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]},
                                {"name": "lid", "shape": "plane", "point": [0.0, 2 * RADIUS], "normal": [0.0, -1.0], "velocity": [0.0, -0.1]}],
                   "time": {"step": 1e-3, "steps": 2}, "solver": {"acceleration": "none", "max_iterations": 20000},
                   "output": {"directory": "results"}}
        cold = {"solver": {"warm_start": False}, "time": {"steps": 2}}
        for title, case, how, mend in (
                ("few", merged(self.rest, cold, {"solver": {"max_iterations": 2}}), "2 ended at max_iterations",
                 "a larger &solver max_iterations, now 2, or a smaller &time step"),
                # of more disks some groups go on creeping by more than rounding
                ("rounding", merged(self.settle("small", [5, 6]), cold,
                                    {"solver": {"accuracy": 1e-12, "max_iterations": 200000, "fallback": "none"}}), "2 stagnated",
                 "&solver fallback = 'newton' takes over solves that stagnate"),
                ("crushed", crushed, "2 found no solution",
                 "a smaller &time step, or more room: bodies that cannot part are pressed together")):
            with self.subTest(title):
                run = run_case(case, 1, self.here(title))
                self.assert_status(run, 3)
                self.assertRegex(line(run, "converged"), rf"^converged   NO: 2 of 2 solves did not reach the accuracy .*; {how}, in steps 1 to 2$")
                self.assertEqual(line(run, "to mend it"), "to mend it  " + mend)
                stagnated, without = run.stdout.count("gain nothing (stagnation)"), run.stdout.count("loads grow without bound")
                self.assertEqual(f" {stagnated} stagnated" in line(run, "converged"), stagnated > 0)
                self.assertEqual(f" {without} found no solution" in line(run, "converged"), without > 0)
                self.assertEqual("\ncreep " in run.stdout, stagnated > 0)
                if stagnated > 0:
                    self.assertRegex(run.stdout, r"\ncreep       in solves that stagnate, the impulses of up to \d+ contacts go on changing; "
                                                 r"(\d+|more than 99) % of these contacts stick\n"
                                                 r"            the largest group of them joins \d+ grains by \d+ contacts?\n"
                                                 r"            velocities in such a group differ by up to \d\.\dE-1\d of U between iterates")
                self.assertIn("*** 2 of the steps did NOT reach the accuracy: the accuracy of the results is not known", line(run, "finished"))
                self.assertRegex(run.stdout, r"at accuracy \S+: not known: 2 solves did not reach the accuracy itself")
                self.assertNotRegex(line(run, "to halve it"), "ten times|longer|looser|larger &time")

    def test_wrong_velocities(self):
        """Solves that reach a loose residual with velocities far from the solution: the verdict names the error; history.csv has it."""
        run = run_case(merged(self.rest, {"solver": {"criterion": "residual", "tolerance": 3e-2, "warm_start": False}}), 1, self.here("wrong"))
        self.assert_status(run, 0)
        history = run.history()
        worst = (history["velocity_error"] / history["velocity_scale"])
        self.assertGreater(worst.max(), 0.5)
        doubt = f"{(worst > 0.1).sum()} of them missed the accuracy 1.0E-01, with velocities wrong by up to {worst.max():.2f} times the velocity scale U"
        self.assertIn(f"finished    every solve reached the residual 3.0E-02, but {doubt}; ", line(run, "finished"))
        self.assertIn(f"converged   only by the residual: every solve reached the tolerance 3.00E-02, but {doubt}; ", line(run, "converged"))
        found = re.search(r"residual at most (\S+) at the end of a solve, tolerance 3\.00E-02; velocity error at most (\S+) of U", run.stdout)
        self.assertAlmostEqual(float(found[1]) / history["residual"].max(), 1.0, delta=6e-3)
        self.assertAlmostEqual(float(found[2]) / worst.max(), 1.0, delta=6e-3)
        self.assertNotRegex(line(run, "to halve it"), "looser|longer")
        # sweeps may wander above this tolerance for thousands of iterations
        newton = {"method": "newton", "criterion": "residual", "tolerance": 1e-6, "acceleration": None}
        right = run_case(merged(self.rest, {"solver": newton}), 1, self.here("right"))
        self.assertEqual(line(right, "finished"), "finished    all 5 steps reached the tolerance and the accuracy; results in results")
        self.assertRegex(line(right, "converged"), r"^converged   yes: every solve reached the tolerance 1\.00E-06 and the accuracy 1\.00E-01; ")

    def test_heavy_on_light(self):
        """A light disk bears a heavy one. The residual of no impulses is their ratio of masses, which ends the solve at once: the
        pair falls freely, by g h more in each step, and the run says so."""
        write(self.here("heavy.csv"), f"id,x,y,radius,mass\n1,0,{RADIUS},{RADIUS},1\n2,0,{3 * RADIUS},{RADIUS},1e6\n")
        run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "../heavy.csv", "overlap_projection": False},
                        "boundary": {"shape": "plane", "normal": [0.0, 1.0]}, "time": {"step": 1e-3, "steps": 3},
                        "solver": {"criterion": "residual"}, "output": {"directory": "results"}}, 1, self.here("heavy"))
        self.assert_status(run, 0)
        history = run.history()
        self.assertEqual(list(history["iterations"]), [0, 0, 0])
        np.testing.assert_allclose(history["velocity_error"] / history["velocity_scale"], [1.0, 2.0, 3.0], rtol=1e-5)
        self.assertEqual(line(run, "finished"), "finished    every solve reached the residual 1.0E-04, but 3 of them missed the accuracy "
                         "1.0E-01, with velocities wrong by up to 3.00 times the velocity scale U; results in results")

    def test_light_bodies(self):
        """A light disk that hangs in the air beside a heavy one at rest is nothing to the mean by mass, and still missed."""
        write(self.here("beside.csv"), f"id,x,y,radius,mass\n1,0,{RADIUS},{RADIUS},1e6\n2,1,{RADIUS},{RADIUS},1\n3,1,{3 * RADIUS},{RADIUS},1\n")
        run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "../beside.csv"},
                        "boundary": {"shape": "plane", "normal": [0.0, 1.0]}, "time": {"step": 1e-3, "steps": 1},
                        "solver": {"criterion": "residual", "tolerance": 1e-2, "acceleration": "none", "check_every": 1},
                        "output": {"directory": "results"}}, 1, self.here("beside"))
        self.assert_status(run, 0)
        self.assertLess(run.history()["velocity_error"][0], 0.1 * run.history()["velocity_scale"][0])
        self.assertIn("but 1 of them missed the accuracy 1.0E-01, because single bodies or contacts are farther off than the mean; ",
                      line(run, "finished"))

    def test_error_not_known(self):
        """Steps of a column that end after fewer than four iterations and do not rest: their velocity error is not known."""
        run = run_case({"scene": {"bodies": "column", "column_count": 100}, "time": {"step": 1e-3, "steps": 40},
                        "solver": {"criterion": "residual", "tolerance": 1e-6}, "output": {"directory": "results"}}, 1, self.here("early"))
        self.assert_status(run, 0)
        history = run.history()
        early = (history["iterations"] < 4) & (history["velocity_error"] > 0.01 * history["velocity_scale"])
        self.assertGreater(early.sum(), 0)
        self.assertEqual(line(run, "finished"), f"finished    every solve reached the residual 1.0E-06, but {early.sum()} of them ended before "
                         "their velocity error was known; results in results")

    def test_advice(self):
        """A loose accuracy is not advised to be looser, a tight one may be."""
        for accuracy, may in ((0.3, False), (0.1, False), (1e-2, True)):
            run = run_case(merged(self.rest, {"time": {"steps": 20}, "solver": {"accuracy": accuracy, "tolerance": 0.1 * accuracy}}), 1,
                           self.here(f"advice {accuracy}"))
            with self.subTest(accuracy):
                self.assert_status(run, 0)
                self.assertEqual(bool(re.search("which is looser|longer &time", line(run, "to halve it"))), may, run.stdout)

    def test_growing_overlaps(self):
        """Grains sink into each other that loose solves do not hold: the advice is a smaller step or accuracy."""
        run = run_case(merged(self.rest, {"time": {"steps": 200}, "scene": {"overlap_projection": False},
                                          "solver": {"criterion": "residual", "tolerance": 0.3, "warm_start": False}}), 1, self.here("sinks"))
        self.assert_status(run, 0)
        self.assertRegex(line(run, "to halve it"), r"^to halve it nothing yet: overlaps grow; first choose a smaller &time step or &solver tolerance$")

    def test_scales(self):
        """The log names the velocity scale after the first step and when another kind comes; the end has the range. In free fall loads
        of a step rule, until the grains are faster than ten times that."""
        run = run_case({"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [2, 2], "radius_min": 0.01, "radius_max": 0.01,
                                  "friction": 0.3},
                        "boundary": {"shape": "plane", "normal": [0.0, 1.0], "velocity": [0.0, 0.0]},
                        "time": {"step": 1e-3, "steps": 400}, "output": {"directory": "results", "every": 0}}, 1, self.here("scales"))
        self.assert_status(run, 0)
        said = re.findall(r"^scale       from step (\d+) on velocity errors are compared with U = (\S+) m/s \((.*?)\)", run.stdout, re.M)
        self.assertEqual((said[0][0], said[0][2]), ("1", "load of a step"))
        self.assertAlmostEqual(float(said[0][1]), 9.81e-3, delta=1e-5)
        self.assertIn("motion of the bodies", [kind for _, _, kind in said])
        self.assertGreater(len(said), 1)
        scale = run.history()["velocity_scale"]
        found = re.search(r"U from (\S+) to (\S+) m/s: load of a step in (\d+) solves, motion of the bodies in (\d+) solves", run.stdout)
        self.assertTrue(found, run.stdout)
        self.assertAlmostEqual(float(found[1]) / scale.min(), 1.0, delta=6e-3)
        self.assertAlmostEqual(float(found[2]) / scale.max(), 1.0, delta=6e-3)
        self.assertEqual(int(found[3]) + int(found[4]), 400)

    def test_results(self):
        """Each state of results.h5 but the start has the error and the scale of its solve, which the Python package reads."""
        run = run_case(merged(self.rest, {"output": {"every": 2}}), 2, self.here("results"))
        self.assert_status(run, 0)
        history, package = run.history(), gravier.Run(run.path("results"))
        self.assertEqual(list(package.steps), [0, 2, 4, 5])
        self.assertTrue(np.isnan(package.velocity_error(0)) and np.isnan(package.velocity_scale(0)))
        with h5py.File(run.path("results", "results.h5")) as file:
            for step in (2, 4, 5):
                for name in ("velocity_error", "velocity_scale"):
                    self.assertAlmostEqual(file[f"steps/{step}"].attrs[name], history[name][step - 1], delta=1e-8 * history[name][step - 1])
                self.assertEqual(package.velocity_error(step), file[f"steps/{step}"].attrs["velocity_error"])
                self.assertEqual(package.velocity_scale(step), file[f"steps/{step}"].attrs["velocity_scale"])
            self.assertGreater(package.velocity_scale(), 0.0)

    def test_layers(self):
        """Deep cold starts go through layers, continue from them where that is better, and the log says so. A column of 60 disks continues
        from each pass, with half of the relaxations that it takes without (measured: 0.48)."""
        tower = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "../tower.csv", "friction": 0.0},
                 "boundary": {"shape": "plane", "normal": [0.0, 1.0]},
                 "time": {"step": 1e-3, "steps": 3}, "solver": {"warm_start": False}, "output": {"directory": "results"}}
        write(self.here("tower.csv"), "id,x,y,radius\n" + "".join(f"{k},0,{0.1 * k - 0.05},0.05\n" for k in range(1, 61)))
        run = run_case(tower, 1, self.here("layers"))
        self.assertRegex(run.stdout, r"\nlayers      3 solves made a pass over layers, 3 of them continued from it; the passes took as much work as \d+ sweeps\n")
        none = run_case(merged(tower, {"solver": {"layered_start": False}}), 1, self.here("no layers"))
        self.assertNotIn("\nlayers  ", none.stdout)
        relaxed = [int(re.search(r"sweeps, (\d+) contact relaxations", each.stdout).group(1)) for each in (run, none)]
        self.assertLess(relaxed[0], 0.7 * relaxed[1])


if __name__ == "__main__":
    import unittest
    unittest.main()


class FallenGrains(RunTestCase):
    """Grains below all boundaries are told of once, and in the last words; those that something may stop are not."""

    #: three disks above a ledge of 1 m, two beside it
    DISKS = ((3, -0.2, 0.05), (4, 0.0, 0.05), (7, 0.2, 0.05), (9, 0.8, 0.0), (12, -0.9, 0.05))
    LEDGE = {"name": "ledge", "shape": "segment", "point": [-0.5, 0.0], "end": [0.5, 0.0]}
    FAR = {"name": "far", "shape": "plane", "point": [0.0, -1000.0], "normal": [0.0, 1.0]}
    SIDE = {"name": "side", "shape": "plane", "point": [5.0, 0.0], "normal": [-1.0, 0.0]}

    def run_with(self, boundaries, ranks=1, disks=DISKS, steps=250, **scene):
        turned = scene.pop("turned", False)
        rows = "".join(f"{number},{y if turned else x},{x if turned else y},0.05\n" for number, x, y in disks)
        write(self.here("disks.csv"), "id,x,y,radius\n" + rows)
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "disks.csv", "gravity": [0.0, -9.81], **scene},
                "time": {"step": 1e-3, "steps": steps}, "decomposition": {"subdomains": 2}, "solver": {"method": "nscdd"},
                "output": {"directory": "results", "every": 0}}
        run = run_case({**case, "boundary": boundaries}, ranks, self.here(""))
        self.assert_status(run, 0)
        return [text for text in run.stdout.splitlines() if "below all boundaries" in text]

    def test_told_once(self):
        told = ["warning     2 grains have fallen below all boundaries by step 200, grain 9 among them: no boundary there stops a grain, "
                "and one of shape 'outlet' would remove it",
                "warnings    grains fallen below all boundaries 2",
                "finished    all 350 steps reached the accuracy; 2 grains had fallen below all boundaries; results in results"]
        for ranks in (1, 2):
            self.assertEqual(self.run_with([self.LEDGE, self.SIDE], ranks, steps=350), told)
        one = self.run_with([self.LEDGE], disks=self.DISKS[:4])
        self.assertRegex(one[0], "1 grain has fallen .* by step 200, grain 9:")
        self.assertRegex(one[-1], "; 1 grain had fallen")

    def test_along_gravity(self):
        """Down is where gravity points."""
        upright = {"name": "ledge", "shape": "segment", "point": [0.0, -0.5], "end": [0.0, 0.5]}
        self.assertRegex(self.run_with([upright], gravity=[-9.81, 0.0], turned=True)[0], "2 grains have .* by step 200")
        # the two come down by 0.31 m, and begin at a height of 0 and of 0.05 m
        wall = {"name": "wall", "shape": "segment", "point": [3.0, 0.0], "end": [3.0, -0.2]}
        self.assertEqual([len(self.run_with([self.LEDGE, {**wall, "end": [3.0, -deep]}])) for deep in (0.1, 0.3)], [3, 0])

    def test_glued_grains(self):
        """Glued grains are boundaries, and do not fall themselves."""
        boundaries = [{"name": "glued", "shape": "grains", "group": 1}]
        rows = "".join(f"{k},{0.1 * k},-0.05,0.05,1\n" for k in range(1, 4)) + "8,0.2,0.06,0.05,0\n9,2,0,0.05,0\n"
        for deep, fallen in (("", 3), ("7,5,-3,0.05,1\n", 0)):
            write(self.here("glued.csv"), "id,x,y,radius,group\n" + rows + deep)
            told = self.run_with(boundaries, bodies_file="glued.csv")
            self.assertEqual(len(told), fallen, told)

    def test_beside_a_cylinder(self):
        """An upright cylinder stops nothing that falls in it, and one that leans may."""
        write(self.here("balls.csv"), "id,x,y,z,radius\n1,0,0,0.05,0.05\n5,0.9,0,0,0.05\n")
        floor = {"name": "floor", "shape": "rectangle", "point": [-0.5, -0.5, 0.0], "edge_a": [1.0, 0.0, 0.0], "edge_b": [0.0, 1.0, 0.0]}
        for axis, lines in (([0.0, 0.0, 1.0], 3), ([0.3, 0.0, 1.0], 0)):
            silo = {"name": "silo", "shape": "cylinder", "point": [0.0, 0.0, 0.0], "axis": axis, "radius": 3.0}
            told = self.run_with([floor, silo], dimension=3, bodies_file="balls.csv", gravity=[0.0, 0.0, -9.81])
            self.assertEqual(len(told), lines, told)

    def test_what_may_stop(self):
        """A plane below, an outlet, a period along gravity; no gravity."""
        below = {"name": "out", "shape": "outlet", "point": [0.0, -1000.0], "normal": [0.0, 1.0]}
        for boundaries, scene in (([self.LEDGE, self.FAR], {}), ([self.LEDGE, below], {}), ([self.LEDGE], {"period": [0.0, 9.0]}),
                                  ([self.LEDGE], {"gravity": [0.0, 0.0]}), ([self.SIDE], {}), ([self.LEDGE], {"body_force": [1.0, 0.0]})):
            self.assertEqual(self.run_with(boundaries, **scene), [])
