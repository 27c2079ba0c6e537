"""Checkpoints and restarts: a run that was stopped, killed or had no more steps to do, and gravier --restart on any number of
ranks, give bit by bit what the run gives that nothing stops: states, history but for wall times, trace, and the checkpoint.

What a kill in the middle of a write leaves is looked for in two ways: kills at random times, and, with a shim between the
program and the system that is compiled here, a kill before one write after the other of results.h5."""
import os
import random
import shutil
import signal
import time
import unittest

import h5py
import numpy as np

from busy_scene import DRUM, write_drum
from gravier_runs import LONG, RunTestCase, contents, differences, each, gravier, merged, namelist, read_csv, run_case, steps_of, write
from killed_runs import Going, compile_shim

from gravier import checksum

BOX = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [10, 8], "radius_min": 0.008, "radius_max": 0.012,
              "friction": 0.3},
    "time": {"step": 1e-3, "steps": 40},
    "solver": {"tolerance": 1e-2, "method": "nscdd"},
    "decomposition": {"subdomains": 2},
    "output": {"every": 1, "checkpoint_every": 1},
}

BOX_3D = merged(BOX, {"scene": {"dimension": 3, "lattice_count": [5, 4, 4], "wall_friction": 0.5},
                      "time": {"steps": 24}, "decomposition": {"subdomains": 4}})


def content(path):
    with open(path, "rb") as file:
        return file.read()


def restart(directory, ranks=1, **changes):
    return gravier("--restart", "case.nml", ranks=ranks, directory=directory, **changes)


class Restart(RunTestCase):

    def state(self, directory, results="results"):
        """All that a run leaves and that is not a time on the clock, or the history of its file."""
        path = os.path.join(directory, results)
        found = {f"results{name}": value for name, value in contents(os.path.join(path, "results.h5")).items()
                 if not name.startswith("/run@")}
        for table in ("history", "trace"):
            if os.path.exists(os.path.join(path, f"{table}.csv")):
                rows = read_csv(os.path.join(path, f"{table}.csv"))
                found.update({f"{table} {name}": value for name, value in rows.items() if not name.endswith("_seconds")})
        found.update({f"checkpoint{name}": value for name, value in
                      contents(os.path.join(path, "checkpoint.h5")).items()})
        return found

    def assert_same(self, straight, other, what=""):
        self.assertEqual(differences(self.state(straight), self.state(other)), [], what)

    def assert_refused(self, run, pattern):
        self.assert_status(run, 2)
        self.assertEqual(run.stderr.count("\n"), 1, run.stderr)
        self.assertRegex(run.stderr, pattern)

    def one_restart(self, case, stop, before, after, straight, prepare=None):
        """Run to step `stop` on `before` ranks and then to the end on `after`: the bits of `straight`."""
        directory = self.here(f"{os.path.basename(straight)} {stop} {before} {after}")
        if prepare:
            prepare(directory)
        steps = case["time"]["steps"]
        self.assert_status(run_case(merged(case, {"time": {"steps": stop}}), before, directory), 0)
        # the run that nothing stops writes no state at `stop`, unless it is due
        every = case["output"]["every"]
        write(os.path.join(directory, "case.nml"), namelist(case))
        run = restart(directory, after)
        self.assert_status(run, 0)
        self.assertIn(f"from the checkpoint of step {stop}\n", run.stdout)
        found = self.state(directory)
        if stop % every != 0:
            prefix = f"results/steps/{stop}"
            found = {name: value for name, value in found.items() if name.split("@")[0] != prefix
                     and not name.startswith(prefix + "/")}
        different = differences(self.state(straight), found)
        self.assertEqual(different, [], f"{straight}: stopped at {stop} of {steps}, {before} ranks, then {after}")
        shutil.rmtree(directory)

    def straight(self, name, case, prepare=None):
        directory = self.here(name)
        if prepare:
            prepare(directory)
        self.assert_status(run_case(case, 2, directory), 0)
        return directory

    def test_drum(self):
        """Stops right after a list was made, long after, just before a partition, and before and after a boundary goes."""
        straight = self.straight("drum", DRUM, write_drum)
        history = read_csv(os.path.join(straight, "results", "history.csv"))
        # it is as busy as it is meant to be
        listed, divided = np.flatnonzero(history["listed"]) + 1, np.flatnonzero(history["divided"]) + 1
        self.assertTrue({14, 27, 40, 53} < set(divided), "by schedule and by imbalance")
        ages = [step - listed[listed <= step].max() for step in range(1, 60)]
        self.assertGreater(max(ages), 2)
        self.assertGreater(history["left"].sum(), 0)
        images = self.state(straight)["results/steps/60/bodies/image"]
        self.assertTrue(np.any(images != 0))
        oldest = 1 + int(np.argmax(ages))
        stops = sorted({int(listed[len(listed) // 2]), oldest, int(divided[1]) - 1, 32, 33, 34})
        ranks = [(1, 2), (2, 4), (4, 1), (2, 1), (1, 4), (4, 2)] if LONG else [(1, 2), (2, 1), (2, 2), (2, 1), (1, 4), (1, 2)]
        each(lambda stop, number: self.one_restart(DRUM, stop, *number, straight, write_drum), list(zip(stops, ranks)))

    def test_piston(self):
        """Overlaps under a lid that a force moves, taken back step by step: grains and lid go on from where they were put."""
        case = merged(BOX, {"scene": {"overlap_allowed": 1e-6},
                            "boundary": [{"shape": "plane", "name": "lid", "point": [0.0, 0.21], "normal": [0.0, -1.0],
                                          "free": [False, True], "mass": 5.0, "force": [0.0, -2000.0]}],
                            "time": {"step": 2e-3, "steps": 80}, "decomposition": {"subdomains": 4},
                            "output": {"every": 7, "boundary_forces": True}})
        straight = self.straight("piston", case)
        history = read_csv(os.path.join(straight, "results", "history.csv"))
        self.assertGreater(history["projected"][30:].sum(), 40)
        for stop, before, after in ((45, 1, 2), (61, 2, 1), (62, 2, 4)) if LONG else ((45, 1, 2), (61, 2, 1)):
            self.one_restart(case, stop, before, after, straight)

    def test_defaults(self):
        """A fall by the default solver, which learns from its solves when the next ones are worth a check. Runs with a trace, and runs that
        end by the residual, make checks at fixed iterations instead, so that the other tests here do not see what it has learned."""
        case = {"scene": {"bodies": "lattice", "lattice_count": [12, 12], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3,
                          "alert_distance": 0.003},
                "time": {"step": 1e-3, "steps": 130}, "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 2},
                "output": {"every": 10, "checkpoint_every": 5}}
        straight = self.straight("defaults", case)
        iterations = read_csv(os.path.join(straight, "results", "history.csv"))["iterations"]
        # checks come at other iterations than every tenth
        self.assertGreater(np.count_nonzero(iterations[95:] % 10), 10)
        for stop, before, after in ((95, 1, 2), (110, 2, 1)):
            self.one_restart(case, stop, before, after, straight)

    def test_refined(self):
        """A load that grows on grains that do not give way: solves aim at less error, by how far the scene has come in all steps."""
        case = {"scene": {"bodies": "column", "column_count": 12, "radius": 0.05, "mass": 0.7, "gravity": [0.0, 0.0]},
                "boundary": [{"shape": "plane", "name": "lid", "point": [0.0, 1.2], "normal": [0.0, -1.0], "free": [False, True], "mass": 0.7,
                              "table": "../force.csv"}],
                "time": {"step": 1 / 512, "steps": 90}, "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 3},
                "output": {"every": 10, "checkpoint_every": 5}}
        write(self.here("force.csv"), "time,fy\n0,0\n1,-2000\n")
        straight = self.straight("refined", case)
        words = contents(os.path.join(straight, "results", "checkpoint.h5"))["/arrays/drift"]
        self.assertGreater(words[0], 80)
        for stop, before, after in ((45, 1, 2), (70, 2, 1)):
            self.one_restart(case, stop, before, after, straight)

    def test_methods(self):
        """Every method, and without a warm start; in 3D with walls of another friction."""
        cases = {
            "nlgs": merged(BOX, {"solver": {"method": "nlgs"}, "decomposition": {"subdomains": 1}}),
            "schwarz": merged(BOX_3D, {"solver": {"method": "schwarz", "relaxation": 0.7}}),
            "nscdd_ep": merged(BOX, {"solver": {"method": "nscdd_ep", "max_iterations": 100}}),
            "cold": merged(BOX_3D, {"solver": {"warm_start": False}}),
        }
        for number, (name, case) in enumerate(cases.items()):
            case = merged(case, {"output": {"every": 4, "trace": True}})
            self.one_restart(case, 10 + number, 1 + number % 2, 2 - number % 2, self.straight(name, case))

    def test_another_layout_of_memory(self):
        """What pairs keep is laid out by warm starts, laws with a memory and sleeping; a run that goes on with another layout finds
        bonds and impulses in it. Nothing sleeps within so few steps, so that sleeping changes no bit of the motion; without warm
        starts solves end elsewhere within their tolerance."""
        rows = [f"{5 * j + i + 1},{0.1 * i:.3f},{0.1 * j + 0.1:.3f},0.05,{0.3 * (-1) ** i * j:.2f},{-0.1 * i:.2f},{i - 2}"
                for j in range(4) for i in range(5)]
        base = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": "grains.csv", "wall_material": "rock"},
            "material": [{"name": "rock"}],
            "law": [{"materials": "rock", "kind": "bonded", "friction": 0.3, "bond_strength": 3000.0, "bond_friction": 0.8,
                     "bond_distance": 1e-3}],
            "boundary": [{"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}],
            "time": {"step": 1e-3, "steps": 60},
            "solver": {"method": "nscdd", "criterion": "residual", "tolerance": 1e-9, "max_iterations": 20000},
            "decomposition": {"subdomains": 2},
            "output": {"every": 20, "checkpoint_every": 60},
        }
        layouts = {"plain": {}, "sleeping": {"solver": {"sleeping": True, "sleep_after": 1000}},
                   "cold": {"solver": {"warm_start": False}}}

        def prepare(directory):
            os.makedirs(directory, exist_ok=True)
            write(os.path.join(directory, "grains.csv"), "id,x,y,radius,vx,vy,omega\n" + "\n".join(rows) + "\n")

        def motion(directory):
            found = contents(os.path.join(directory, "results", "results.h5"))
            return {name: found[f"/steps/60/bodies/{name}"] for name in ("id", "position", "velocity")}

        straight = self.straight("bonds", base, prepare)
        last = motion(straight)
        # bonds hold some of the grains together, and others have broken
        self.assertGreater(np.ptp(last["velocity"][:, 0]), 0.01)
        for before, after in (("plain", "sleeping"), ("sleeping", "plain"), ("cold", "plain"), ("plain", "cold"), ("cold", "sleeping")):
            with self.subTest(before=before, after=after):
                directory = self.here(f"bonds {before} {after}")
                prepare(directory)
                stopped = merged(base, layouts[before], {"time": {"steps": 25}, "output": {"checkpoint_every": 25}})
                self.assert_status(run_case(stopped, 2, directory), 0)
                write(os.path.join(directory, "case.nml"), namelist(merged(base, layouts[after])))
                run = restart(directory, 1)
                self.assert_status(run, 0)
                self.assertIn("from the checkpoint of step 25\n", run.stdout)
                found = motion(directory)
                if "cold" in (before, after):
                    self.assertLess(np.abs(found["position"] - last["position"]).max(), 1e-6)
                else:
                    self.assertEqual(differences(last, found), [])

    def test_signals(self):
        """SIGTERM, to one rank or to all, stops with status 4; SIGUSR1, to the launcher, writes a checkpoint and goes on."""
        straight = self.straight("signals", merged(BOX, {"time": {"steps": 400}, "output": {"every": 50, "checkpoint_every": 0,
                                                                                          "walltime": 1000.0}}))
        case = merged(BOX, {"time": {"steps": 400}, "output": {"every": 50, "checkpoint_every": 0, "walltime": 1000.0}})
        draw = random.Random(2)
        for number, (ranks, send) in enumerate([(1, lambda run: run.send(signal.SIGTERM)),
                                                (2, lambda run: run.send(signal.SIGTERM, 1)),
                                                (2, lambda run: run.send(signal.SIGTERM))]):
            directory = self.here(f"term {number}")
            run = Going(case, ranks, directory)
            run.wait_for_rows(draw.randrange(1, 100))
            send(run)
            status, said = run.end()
            self.assertEqual(status, 4, said)
            self.assertIn("interrupted *** by SIGTERM after step", said)
            self.assertNotIn("finished ", said)
            again = restart(directory, 3 - ranks)
            self.assert_status(again, 0)
            self.assertNotIn("from the checkpoint of step 400\n", again.stdout)
            self.assert_same(straight, directory)

        def ask(name, *signals):
            """A run that is asked once makes one checkpoint, and one at its end."""
            directory = self.here(name)
            run = Going(case, 2, directory)
            run.wait_for_rows(draw.randrange(1, 50))
            for send in signals:
                send(run)
                run.wait_for(lambda: os.path.exists(os.path.join(directory, "results", "checkpoint.h5")), "the checkpoint")
                run.wait_for_rows(run.rows() + 2)
            status, said = run.end()
            self.assertEqual(status, 0, said)
            self.assertEqual(said.count("checkpoint  of step"), 2, said)
            self.assert_same(straight, directory)

        ask("usr1", lambda run: run.process.send_signal(signal.SIGUSR1))
        # a launcher that passes it on to one rank some steps after the other
        ask("usr1 late", lambda run: os.kill(sorted(run.pids())[0], signal.SIGUSR1),
            lambda run: os.kill(sorted(run.pids())[1], signal.SIGUSR1))

    def test_imbalance_that_no_division_cures(self):
        """Space is divided anew once, and again when contacts lie more unevenly than the last division left them, or after 16 steps, 20, 24 and so on;
        a restart in between does as the run that nothing stops."""
        def chains(directory):
            os.makedirs(directory, exist_ok=True)
            # 11 grains that stay together, and 8 that part in the 7th step: 10 and 7 contacts, then 10 and none
            rows = [f"{k + 1},{0.02 * k!r},0.0,0.01,0.0" for k in range(11)]
            rows += [f"{k + 12},{1 + 0.02 * k!r},0.0,0.01,{0.02 * k!r}" for k in range(8)]
            write(os.path.join(directory, "grains.csv"), "id,x,y,radius,vx\n" + "\n".join(rows) + "\n")
        case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": "grains.csv", "gravity": [0.0, 0.0]},
            "time": {"step": 8e-3, "steps": 20}, "solver": {"method": "nscdd"},
            "decomposition": {"grid": [2, 1], "repartition_imbalance": 1.1},
            "output": {"every": 5, "checkpoint_every": 1}}
        straight = self.straight("chains", case, chains)
        history = read_csv(os.path.join(straight, "results", "history.csv"))
        self.assertEqual(list(history["contacts"][[0, 5, 6, 19]]), [17, 17, 10, 10])
        self.assertEqual(list(history["step"][history["divided"] == 1]), [2, 8, 17])
        for stop in (4, 7, 16):
            self.one_restart(case, stop, 1, 2, straight, chains)

    def test_another_partition(self):
        """A restart with other boxes, or with METIS, divides space in its first step and no more; one with the same boxes does not."""
        case = merged(BOX, {"decomposition": {"subdomains": 4, "grid": [4, 1]}, "output": {"every": 0}})
        directory = self.here("partition")
        self.assert_status(run_case(merged(case, {"time": {"steps": 8}}), 2, directory), 0)
        for steps, change in ((16, {"grid": [2, 2]}), (24, {"grid": [2, 2]}), (32, {"grid": None, "partition": "metis"})):
            run = run_case(merged(case, {"time": {"steps": steps}, "decomposition": change}), 2, directory, options=["--restart"])
            self.assert_status(run, 0)
        history = run.history()
        self.assertEqual(list(history["step"][history["divided"] == 1]), [9, 25])

    def test_walltime(self):
        """The run stops before its time is over, and goes on."""
        case = merged(BOX, {"time": {"steps": 100000}, "output": {"every": 0, "checkpoint_every": 0, "walltime": 2.5}})
        directory = self.here("walltime")
        run = run_case(case, 2, directory)
        self.assert_status(run, 4)
        self.assertRegex(run.stdout, r"interrupted \*\*\* at the walltime of \S+ s after step \d+ of 100000")
        self.assertLess(run.history()["wall_seconds"].sum(), 2.5)
        n = len(run.history()["step"])
        # a machine with much else to do makes few steps in that time
        self.assertGreater(n, 0)
        again = run_case(merged(case, {"time": {"steps": n + 5}, "output": {"walltime": 0.0}}), 1, directory,
                         options=["--restart"])
        self.assert_status(again, 0)
        self.assertIn(f"from the checkpoint of step {n}\n", again.stdout)

    def test_checkpoint_seconds(self):
        case = merged(BOX, {"time": {"steps": 400}, "output": {"every": 0, "checkpoint_every": 0, "checkpoint_seconds": 0.01}})
        run = run_case(case, 1, self.here("seconds"))
        self.assert_status(run, 0)
        self.assertGreater(run.stdout.count("checkpoint  of step"), 1)

    def check_readable(self, directory):
        """results.h5 is not there yet, or holds whole steps one after the other."""
        path = os.path.join(directory, "results", "results.h5")
        if not os.path.exists(path):
            return
        found = contents(path)
        steps = steps_of(found)
        self.assertEqual(steps, list(range(len(steps))))
        for step in steps:
            wanted = ["bodies/id", "bodies/position", "bodies/velocity", "bodies/radius", "boundaries/force"]
            for name in wanted + (["contacts/impulse"] if step > 0 else []):
                self.assertIn(f"/steps/{step}/{name}", found)

    def test_kills_at_random(self):
        """Killed again and again while it writes a state and a checkpoint each step, on 1 and 2 ranks in turn; nine times in `./gravier test
        long`, and five in a shorter run."""
        steps, times, most = (300, 9, 45) if LONG else (120, 5, 30)
        case = merged(BOX, {"time": {"steps": steps}, "output": {"trace": True}})
        straight = self.straight("not killed", case)
        directory = self.here("killed")
        draw = random.Random(3)
        reached = kills = 0
        for kills in range(times):
            run = Going(case, 1 + kills % 2, directory, ["--restart"])
            run.wait_for_rows(reached)
            reached += draw.randrange(5, most)
            run.wait_for_rows(min(reached, steps - 10))
            time.sleep(draw.random() * 0.01)
            run.send(signal.SIGKILL)
            status, said = run.end()
            self.assertNotEqual(status, 0, said)
            self.check_readable(directory)
        # a row that the system had half on the disk
        history = os.path.join(directory, "results", "history.csv")
        with open(history, "rb+") as file:
            file.truncate(os.path.getsize(history) - 1)
            file.seek(0, os.SEEK_END)
            file.write(b"\n%d,0.2" % (steps - 1))
        run = restart(directory, 2)
        self.assert_status(run, 0)
        self.assertIn("from the checkpoint of step", run.stdout)
        self.assert_same(straight, directory, f"after {kills + 1} kills")

    def test_kill_before_each_write(self):
        """Killed just before one write to results.h5 or another, of rank 0, which writes all headers: the file is whole."""
        library = compile_shim(self.scratch)
        case = merged(BOX, {"time": {"steps": 6}, "solver": {"max_iterations": 10, "tolerance": 0.1},
                            "output": {"checkpoint_every": 2}})
        straight = self.straight("all written", case)

        def killed(ranks, count):
            directory = self.here(f"write {count} of {ranks}")
            run = Going(case, ranks, directory, shim=(library, 0, count))
            status, said = run.end()
            self.assertNotIn(status, (0, 1, 2, 3), f"not killed at write {count}: {said}")
            self.check_readable(directory)
            # and killed again while the restart takes states out of the file
            Going(case, ranks, directory, ["--restart"], shim=(library, 0, 1 + count % 4)).end()
            self.check_readable(directory)
            again = restart(directory, 3 - ranks)
            self.assert_status(again, 0)
            self.assert_same(straight, directory, f"killed on {ranks} ranks before write {count}")
            shutil.rmtree(directory)

        # a state takes 45 writes, of which the last three show it
        counts = [*range(10, 60, 16), *range(100, 150, 8), 230] if LONG else [10, 42, 116, 132, 230]
        each(killed, [(1 + k % 2, count) for k, count in enumerate(counts)])

    def test_refusals(self):
        """Another scene, a damaged checkpoint, results that are gone: one line, status 2, and all files as they were."""
        directory = self.here("refused")
        os.makedirs(directory)
        write(os.path.join(directory, "grains.csv"), "id,x,y,radius\n1,0.0,0.02,0.01\n2,0.03,0.02,0.012\n")
        case = merged(BOX, {"scene": {"bodies": "file", "bodies_file": "grains.csv", "lattice_count": None, "radius_min": None,
                                      "radius_max": None},
                            "boundary": [{"shape": "plane", "normal": [0.0, 1.0]},
                                         {"shape": "plane", "normal": [1.0, 0.0], "point": [-0.1, 0.0], "table": "drive.csv"}],
                            "time": {"steps": 4}, "decomposition": {"subdomains": 1}, "output": {"every": 1}})
        case["scene"]["gravity_table"] = "gravity.csv"
        tables = {"drive.csv": "time,vx\n0,0\n1,0.1\n", "gravity.csv": "time,gx,gy\n0,0,-9\n1,0,-9.81\n"}
        for name, text in tables.items():
            write(os.path.join(directory, name), text)
        results = os.path.join(directory, "results")
        self.assert_status(run_case(merged(case, {"time": {"steps": 2}}), 1, directory), 0)
        older = content(os.path.join(results, "checkpoint.h5"))
        self.assert_status(run_case(case, 1, directory), 0)

        def files():
            return {name: content(os.path.join(results, name)) for name in sorted(os.listdir(results))}

        before = files()
        longer = merged(case, {"time": {"steps": 8}})

        def refused(groups, pattern, ranks=1):
            run = run_case(groups, ranks, directory, options=["--restart"])
            self.assert_refused(run, pattern)
            self.assertEqual(files(), now)

        now = before
        refused(merged(longer, {"scene": {"friction": 0.4}}), r"case\.nml: .*friction = 0\.4.*: expected friction = 0\.3")
        refused(merged(longer, {"boundary": [{"shape": "plane", "normal": [0.0, 1.0], "velocity": [0.1, 0.0]}, case["boundary"][1]]}),
                r"case\.nml: .*velocity")
        refused(merged(longer, {"decomposition": {"subdomains": 2}}), r"case\.nml: &decomposition subdomains: expected 1", 2)
        refused(merged(longer, {"time": {"step": 2e-3}}), r"case\.nml: &time step: expected 0?\.?0?1?.*E?-?")
        refused(merged(longer, {"time": {"theta": 0.6}}), r"case\.nml: &time theta: expected")
        refused(merged(case, {"time": {"steps": 3}}), r"case\.nml: &time steps = 3: expected 4 at least")
        for option in ("energy", "stress", "structure", "boundary_forces"):
            other = not longer["output"].get(option, False)
            run = run_case(merged(longer, {"output": {option: other}}), 1, directory, options=["--restart"])
            self.assert_refused(run, rf"results/history\.csv: line 1: (no|a) column [\w: ]+: &output {option} = \.{str(other).lower()}\., "
                                     rf"but \.{str(not other).lower()}\. was expected, with which this table was begun$")
            self.assertEqual(files(), now)
            self.assertEqual(run.stdout, "")
        # beyond an older checkpoint all states stay where columns are refused
        write(os.path.join(results, "checkpoint.h5"), older)
        now = files()
        refused(merged(longer, {"output": {"energy": True}}), r"results/history\.csv: line 1: no column")
        write(os.path.join(results, "checkpoint.h5"), before["checkpoint.h5"])
        now = before
        history = before["history.csv"].split(b"\n")
        for rows, words in ((history[:2] + history[3:], "line 3: step 3, but rows of step 2 were expected"),
                            (history[:3] + [b""], "its last row is of step 2, but rows up to step 4 were expected")):
            write(os.path.join(results, "history.csv"), b"\n".join(rows))
            now = files()
            for ranks in (1, 2):
                refused(longer, r"results/history\.csv: " + words, ranks)
        write(os.path.join(results, "history.csv"), before["history.csv"])
        now = before
        write(os.path.join(directory, "grains.csv"), "id,x,y,radius\n1,0.0,0.02,0.01\n2,0.03,0.02,0.011\n")
        refused(longer, r"checkpoint\.h5: the run began with 2 grains")
        write(os.path.join(directory, "grains.csv"), "id,x,y,radius\n1,0.0,0.02,0.01\n2,0.03,0.02,0.012\n")
        for name, text in (("drive.csv", "time,vx\n0,0\n1,0.2\n"), ("drive.csv", "time,vy\n0,0\n1,0.1\n"),
                           ("drive.csv", tables["drive.csv"] + "2,0\n"), ("gravity.csv", "time,gx,gy\n0,0,-9\n2,0,-9.81\n")):
            write(os.path.join(directory, name), text)
            for ranks in (1, 2):
                refused(longer, rf"case\.nml: contents of {name} are not those with which \S+ was written: expected the file as it was then, or gravier --restart --changed$", ranks)
            write(os.path.join(directory, name), tables[name])
        checkpoint = os.path.join(results, "checkpoint.h5")
        whole = before["checkpoint.h5"]
        for text in (b"", whole[:len(whole) // 2], b"no HDF5 file", before["results.h5"], whole[:-100]):
            write(checkpoint, text)
            now = files()
            for ranks in (1, 2):
                refused(longer, r"results/checkpoint\.h5", ranks)
        write(checkpoint, whole)
        os.remove(os.path.join(results, "results.h5"))
        run = run_case(longer, 2, directory, options=["--restart"])
        self.assert_refused(run, r"results/results\.h5: .*[Nn]o such file")
        self.assertEqual(content(checkpoint), whole)
        write(os.path.join(results, "results.h5"), before["results.h5"])
        self.assert_status(run_case(longer, 1, directory, options=["--restart"]), 0)

    def test_beginning_and_end(self):
        """Without a checkpoint it begins; with nothing left to do it changes nothing; a new run forgets an old checkpoint."""
        case = merged(BOX, {"time": {"steps": 7}, "output": {"every": 3, "checkpoint_every": 2, "final_bodies": True, "final_forces": True}})
        straight = self.straight("end", case)
        directory = self.here("beginning")
        run = run_case(case, 1, directory, options=["--restart"])
        self.assert_status(run, 0)
        self.assertIn("restart     no checkpoint in results: from the beginning\n", run.stdout)
        self.assert_same(straight, directory)
        final = content(run.path("results", "final_bodies.h5"))
        with h5py.File(run.path("results", "final_bodies.h5")) as file:
            self.assertGreater(len(file["contacts/force"]), 0)
        for ranks in (1, 2, 3):
            again = restart(directory, ranks)
            self.assert_status(again, 0)
            self.assertIn("warning     no step is left to make: ", again.stdout)
            self.assertIn("finished    no step was left to make after step 7; results in results\n", again.stdout)
            self.assert_same(straight, directory, "nothing to do")
            self.assertEqual(content(run.path("results", "final_bodies.h5")), final)
        # a state of other bodies than those of the checkpoint does not stay
        with h5py.File(run.path("results", "final_bodies.h5"), "r+") as file:
            values = file["bodies/velocity"][:]
            values[3, 1] += 1e-9
            file["bodies/velocity"][:] = values
            file["bodies/velocity"].attrs["checksum"] = np.int64(checksum.checksum(values))
        self.assert_status(restart(directory), 0)
        with h5py.File(run.path("results", "final_bodies.h5")) as file:
            self.assertNotIn("contacts", file)
        # a checkpoint in the middle becomes the end: bodies and boundaries of the last state are there
        shorter = self.here("shorter")
        self.assert_status(run_case(merged(case, {"time": {"steps": 5}}), 1, shorter), 0)
        self.assert_status(run_case(merged(case, {"time": {"steps": 5}}), 1, shorter, options=["--restart"]), 0)
        self.assertEqual(steps_of(contents(os.path.join(shorter, "results", "results.h5"))), [0, 3, 5])
        self.assert_status(run_case(merged(case, {"output": {"checkpoint_every": 0}}), 1, directory), 0)
        self.assertFalse(os.path.exists(run.path("results", "checkpoint.h5")))


if __name__ == "__main__":
    unittest.main()
