"""Batch jobs through a stand-in for the scheduler: `sbatch`, `srun` and `qsub` of its own put jobs into a queue, which the test works off
with the variables that the scheduler sets. A run in slices is the run in one piece, bit by bit."""
import os
import shutil
import subprocess
import time

import numpy as np

from gravier_runs import ENVIRONMENT, MPIEXEC, PATIENCE, PROGRAMS, SOURCE, RunTestCase, gravier, namelist, read_csv, write

JOBS = os.path.join(SOURCE, "drivers", "jobs")
CASE = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [24, 20], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
    "time": {"step": 1e-3, "steps": 60},
    "solver": {"method": "nscdd", "tolerance": 1e-4},
    "decomposition": {"subdomains": 2},
    "output": {"directory": "part", "every": 100, "checkpoint_every": 1000},
}
#: writes its variables and arguments into the queue
SUBMIT = """#!/bin/sh
echo "row=${GRAVIER_ROW:-} $*" >> "$QUEUE"
"""


class Jobs(RunTestCase):

    def setUp(self):
        self.work = os.path.join(self.scratch, self.id().split(".")[-1])
        self.bin = os.path.join(self.work, "bin")
        os.makedirs(self.bin)
        for name in ("sbatch", "qsub"):
            self.program(name, SUBMIT)
        self.program("srun", f'#!/bin/sh\nexec "{MPIEXEC}" "$@"\n')
        self.program("mpirun", f'#!/bin/sh\nexec "{MPIEXEC}" "$@"\n')
        for name in ("slurm.sh", "pbs.sh", "mpirun.sh"):
            shutil.copy(os.path.join(JOBS, name), self.work)
        self.program("gravier_job", f'#!/bin/sh\nexec sh "{os.path.join(JOBS, "gravier_job")}" "$@"\n')

    def program(self, name, text):
        path = os.path.join(self.bin, name)
        write(path, text)
        os.chmod(path, 0o755)

    def sh(self, *command, **variables):
        environment = {**ENVIRONMENT, **os.environ, "PATH": f"{self.bin}:{PROGRAMS}:{os.environ['PATH']}",
                       "QUEUE": os.path.join(self.work, "queue"), "GRAVIER_MARGIN": "0", **{k: str(v) for k, v in variables.items()}}
        return subprocess.run(command, cwd=self.work, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False)

    def queue(self):
        path = os.path.join(self.work, "queue")
        if not os.path.exists(path):
            return []
        with open(path, encoding="utf-8") as file:
            jobs = file.read().splitlines()
        os.remove(path)
        return jobs

    def history(self, directory):
        with open(os.path.join(self.work, directory, "history.csv"), encoding="ascii") as file:
            return [row.split(",")[:9] for row in file]

    def work_off(self, script, variables, *seconds):
        """Run a job of so many seconds, and those that are submitted once more; how many ran. The program keeps back one second, so that
        a job of one second makes one step."""
        waiting, count = [""], 0
        while waiting:
            self.assertLess(count, len(seconds), "the run does not get on")
            row, time_given, count = waiting.pop(0), seconds[count], count + 1
            given = {**variables, "GRAVIER_ROW": row} if row else dict(variables)
            end = {"SLURM_JOB_END_TIME": int(time.time()) + time_given} if script == "slurm.sh" else {"PBS_WALLTIME": time_given}
            done = self.sh("sh", script, **given, **end)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            for job in self.queue():
                self.assertIn(script, job)
                self.assertIn("afterany:77", job)
                waiting.append(job.split()[0].removeprefix("row="))
        return count

    def test_slices_under_slurm_and_pbs_are_the_whole_run(self):
        write(os.path.join(self.work, "whole.nml"), namelist({**CASE, "output": {**CASE["output"], "directory": "whole"}}))
        self.assertEqual(gravier("whole.nml", ranks=2, directory=self.work).status, 0)
        nodes = os.path.join(self.work, "nodes")
        write(nodes, "here\nhere\n")
        for script, variables in (("slurm.sh", {"SLURM_JOB_ID": 77, "SLURM_NTASKS": 2}),
                                  ("pbs.sh", {"PBS_JOBID": 77, "PBS_NODEFILE": nodes, "PBS_O_WORKDIR": self.work})):
            with self.subTest(script=script):
                name = script.split(".", maxsplit=1)[0]
                # a walltime of the case gives way
                given = {"walltime": 1e5} if name == "pbs" else {}
                write(os.path.join(self.work, f"{name}.nml"), namelist({**CASE, "output": {**CASE["output"], "directory": name, **given}}))
                self.assertEqual(self.work_off(script, {**variables, "CASE": f"{name}.nml"}, 1, 1, 60), 3, "jobs of a second do not end")
                self.assertEqual(self.history(name), self.history("whole"))

    def test_an_array_of_jobs_over_a_list(self):
        case = namelist({**CASE, "time": {"step": 1e-3, "steps": 3}, "scene": {**CASE["scene"], "friction": "@mu@", "lattice_count": [4, 4]},
                         "output": {"directory": "@run@", "every": 0}}).replace("'@mu@'", "@mu@")
        write(os.path.join(self.work, "sweep.nml"), case)
        write(os.path.join(self.work, "list.csv"), "# friction of each run\nmu\n0.1\n0.3\n0.5\n")
        self.work_off("slurm.sh", {"SLURM_JOB_ID": 77, "SLURM_NTASKS": 1, "SLURM_ARRAY_TASK_ID": 2, "CASE": "sweep.nml", "LIST": "list.csv"}, 60)
        self.assertEqual(sorted(d for d in os.listdir(self.work) if os.path.isdir(os.path.join(self.work, d))), ["bin", "sweep_2"])
        done = self.sh("sh", "mpirun.sh", CASE="sweep.nml", LIST="list.csv")
        self.assertEqual(done.returncode, 0, done.stderr)
        for k, mu in enumerate(("0.1", "0.3", "0.5"), 1):
            with open(os.path.join(self.work, f"sweep_{k}.job.nml"), encoding="utf-8") as file:
                self.assertIn(f"friction = {mu}", file.read())
            self.assertEqual(len(read_csv(os.path.join(self.work, f"sweep_{k}", "history.csv"))["step"]), 3)
        # the case of a row is written anew, a file of the user's own is not: no row runs
        self.assertEqual(self.sh("gravier_job", "--list", "list.csv", "--row", "1", "sweep.nml").returncode, 0)
        own = write(os.path.join(self.work, "sweep_3.nml"), "! mine\n")
        done = self.sh("gravier_job", "--list", "list.csv", "--fresh", "sweep.nml")
        self.assertEqual((done.returncode, done.stderr), (2, "gravier_job: error: sweep_3.nml: there is a file that gravier_job has not made, which is not "
                                                             "replaced; expected a template of another name\n"))
        with open(own, encoding="utf-8") as file:
            self.assertEqual(file.read(), "! mine\n")
        # a list from Windows with blank lines and a column of notes; a row that is wrong is found before the first one runs
        write(os.path.join(self.work, "odd.nml"), case)
        write(os.path.join(self.work, "odd.csv"), "label,mu\r\nfirst of all,0.1\r\n \r\n\r\n")
        done = self.sh("gravier_job", "--list", "odd.csv", "odd.nml")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        write(os.path.join(self.work, "late.nml"), case)
        write(os.path.join(self.work, "late.csv"), "mu\n0.1\n0.2,0.3\n")
        done = self.sh("gravier_job", "--list", "late.csv", "late.nml")
        self.assertEqual((done.returncode, done.stderr), (2, "gravier_job: error: late.csv: line 3: 2 columns; expected 1\n"))
        self.assertFalse(os.path.exists(os.path.join(self.work, "late_1")))
        done = self.sh("gravier_job", "odd_1.nml", GRAVIER_MARGIN="abc")
        self.assertEqual((done.returncode, done.stderr), (2, "gravier_job: error: GRAVIER_MARGIN=abc: expected seconds, 0 or more\n"))

    def test_runs_that_have_ended_stay(self):
        """A run that has ended is kept when its job is run again: its log stays, with its status. It is made anew where its case, a file of its case or
        its results have changed, and with --fresh."""
        case = namelist({**CASE, "time": {"step": 1e-3, "steps": 60}, "solver": {"max_iterations": 3, "fallback": "none"}, "decomposition": {},
                         "scene": {"dimension": 2, "bodies": "file", "bodies_file": "disks.csv", "friction": "@mu@"},
                         "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]}],
                         "output": {"directory": "@run@", "every": 0, "checkpoint_every": 60}}).replace("'@mu@'", "@mu@")
        write(os.path.join(self.work, "kept.nml"), case)
        write(os.path.join(self.work, "kept.csv"), "mu\n0.3\n0.4\n")
        disks = "id,x,y,radius\n" + "".join(f"{k + 1},{0.021 * (k % 6)},{0.012 + 0.021 * (k // 6)},0.01\n" for k in range(36))
        write(os.path.join(self.work, "disks.csv"), disks)
        log = [os.path.join(self.work, f"kept_{k}", "run.log") for k in (1, 2)]

        def logs():
            found = []
            for path in log:
                with open(path, encoding="utf-8") as file:
                    found.append(file.read())
            return found
        job = ("gravier_job", "--list", "kept.csv", "kept.nml")
        done = self.sh(*job)
        self.assertEqual(done.returncode, 3, done.stderr)
        first = logs()
        done = self.sh(*job)
        self.assertEqual(done.returncode, 3)
        self.assertRegex(done.stderr, r"^gravier_job: kept_1: stays as it is: it has ended with this case: \*\*\* \d+ of the steps .*; results in kept_1; "
                                      r"--fresh runs it again\ngravier_job: kept_2: stays .*\n$")
        self.assertEqual(logs(), first)
        # another friction; a run whose results are gone, which has no checkpoint either
        write(os.path.join(self.work, "kept.csv"), "mu\n0.3\n0.5\n")
        shutil.rmtree(os.path.join(self.work, "kept_2"))
        done = self.sh(*job)
        self.assertIn("kept_1: stays", done.stderr)
        self.assertNotIn("kept_2: stays", done.stderr)
        second = logs()
        self.assertEqual(second[0], first[0])
        self.assertIn("friction = 0.5", second[1])
        shutil.rmtree(os.path.join(self.work, "kept_1"))
        self.assertNotIn("kept_1: stays", self.sh(*job).stderr)
        # a file of the case
        later = time.time() + 5
        os.utime(os.path.join(self.work, "disks.csv"), (later, later))
        self.assertNotIn("stays", self.sh(*job).stderr)
        os.utime(os.path.join(self.work, "disks.csv"), (1e9, 1e9))
        self.assertEqual(self.sh(*job).stderr.count("stays"), 2)
        done = self.sh("gravier_job", "--fresh", *job[1:])
        self.assertNotIn("stays", done.stderr)
        for text in logs():
            self.assertEqual(text.count("\nfinished "), 1, "a fresh run goes on from no checkpoint, in no row")

    def test_a_table_of_results(self):
        """The last values, or means, of columns of history.csv, a row a run: ended, under way with a row that is cut off, not begun, and of another case."""
        keys = {"scene": {**CASE["scene"], "lattice_count": [6, 4], "friction": "@mu@"}, "time": {**CASE["time"], "steps": 12},
                "output": {"directory": "results of/@run@", "every": 0}}
        template = "! @name@\n! directory = 'elsewhere'\n" + namelist(keys).replace("'@mu@'", "@mu@")
        write(os.path.join(self.work, "t.csv"), "mu, name\n0.1,a\n\n# none\n0.3, b\n0.5,c\n")
        write(os.path.join(self.work, "t.nml"), template)
        job = ("gravier_job", "--list", "t.csv")
        table = (*job, "--table", "contacts,kinetic_energy")
        done = self.sh(*table, "t.nml")
        self.assertEqual((done.returncode, done.stdout), (0, "run,status,mu,name,step,contacts,kinetic_energy\n" + "".join(
            f"t_{k},none,{mu},{name},,,\n" for k, mu, name in ((1, 0.1, "a"), (2, 0.3, "b"), (3, 0.5, "c")))), done.stderr)
        self.assertFalse(os.path.exists(os.path.join(self.work, "t_1.nml")))
        self.assertEqual(self.sh(*job, "t.nml").returncode, 0)
        histories = [read_csv(os.path.join(self.work, "results of", f"t_{k}", "history.csv")) for k in (1, 2, 3)]
        done = self.sh(*table, "t.nml")
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = done.stdout.splitlines()
        self.assertEqual(len(lines), 4)
        for k, history in enumerate(histories):
            cells = lines[k + 1].split(",")
            self.assertEqual(cells[:5], [f"t_{k + 1}", "0", ["0.1", "0.3", "0.5"][k], "abc"[k], "12"])
            self.assertEqual([float(cell) for cell in cells[5:]], [history["contacts"][-1], history["kinetic_energy"][-1]])
        mean = self.sh(*table, "--mean", "5", "--row", "2", "t.nml").stdout.splitlines()
        self.assertEqual(len(mean), 2)
        for cell, name in zip(mean[1].split(",")[5:], ("contacts", "kinetic_energy")):
            self.assertAlmostEqual(float(cell) / histories[1][name][-5:].mean(), 1.0, places=8)
        # the second run goes on and is in the middle of a row; the third one is of another friction
        os.remove(os.path.join(self.work, "t_2.done"))
        path = os.path.join(self.work, "results of", "t_2", "history.csv")
        with open(path, encoding="ascii") as file:
            text = file.read()
        write(path, text[:-2])
        write(os.path.join(self.work, "t.csv"), "mu,name\n0.1,a\n0.3,b\n0.7,c\n")
        lines = self.sh(*table, "t.nml").stdout.splitlines()
        self.assertTrue(lines[2].startswith("t_2,unfinished,0.3,b,11,"), lines)
        self.assertEqual(float(lines[2].split(",")[-1]), histories[1]["kinetic_energy"][-2])
        self.assertEqual(lines[3], "t_3,changed,0.7,c,,,")
        self.assertEqual(self.sh(*table, "--mean", "12", "t.nml").stdout.splitlines()[2], "t_2,unfinished,0.3,b,,,")
        for arguments, words in (((*job, "--table", "contacts,weight", "t.nml"), "history.csv: no column weight; expected one of step,time,contacts"),
                                 ((*table, "--mean", "13", "t.nml"), "t_1/history.csv: 12 steps; expected 13 at least"), ((*table, "--mean", "0", "t.nml"), "--mean 0: expected a number of steps"),
                                 ((*job, "--mean", "3", "t.nml"), "--mean 3: expected --table COLUMNS too"), (("gravier_job", "--table", "a", "t.nml"), "--table a: expected --list LIST.csv too"),
                                 ((*table, "--row", "9", "t.nml"), "no row 9")):
            done = self.sh(*arguments)
            self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (2, "", 1), done.stderr)
            self.assertIn(words, done.stderr)
        done = self.sh(*table, "t.nml", GRAVIER_PROGRAM="gravier_sample")
        self.assertIn("samples have no history.csv", done.stderr)

    def test_a_table_of_thinned_histories(self):
        """Sums, means, largest and least values over steps, of all rows or of thinned ones: a row stands for the steps since the row before it, and counts are those of all steps."""
        write(os.path.join(self.work, "h.csv"), "every\n1\n9\n")
        write(os.path.join(self.work, "h.nml"), namelist({**CASE, "output": {"directory": "@run@", "every": 0, "history_every": "@every@"}}).replace("'@every@'", "@every@"))
        job = ("gravier_job", "--list", "h.csv")
        self.assertEqual(self.sh(*job, "h.nml").returncode, 0)
        step = np.arange(1, 51)
        full = {"step": step, "time": 1e-3 * step, "left": (step % 17 == 0) * 2, "converged": 1 - (step == 20), "force_x:max": np.round(100.0 * np.sin(step)), "stress": step**2}
        place = np.arange(50)
        for k, every in ((1, 1), (2, 9)):
            rows = (step % every == 0) | np.isin(step, (1, 50)) | (full["left"] > 0) | (full["converged"] == 0)
            write(os.path.join(self.work, f"h_{k}", "history.csv"), "\n".join(",".join(map(str, row)) for row in [full, *zip(*(values[rows] for values in full.values()))]) + "\n")
            # the row that stands for each step
            row = place[rows][np.searchsorted(step[rows], step)]
            known = {name: values if name in ("left", "converged") else values[row] for name, values in full.items()}
            force = known["force_x:max"]
            blocks, late = force.reshape(5, 10).mean(axis=1), force[23:43].reshape(2, 10).mean(axis=1)
            for options, asked in (
                    ((), {"sum:left": 4, "max:force_x:max": force.max(), "min:force_x:max": force.min(), "stress": 2500, "sum:converged": 49, "mean:force_x:max": force.mean(), "sum:stress": known["stress"].sum()}),
                    (("--since", "0.0235"), {"sum:left": 2, "sum:converged": 27, "max:stress": 2500, "min:force_x:max": force[23:].min(), "mean:force_x:max": force[23:].mean(), "left": 0}),
                    (("--since", "0.023"), {"sum:stress": known["stress"][23:].sum()}),
                    (("--mean", "10"), {"max:force_x:max": blocks.max(), "min:force_x:max": blocks.min(), "stress": known["stress"][-10:].mean(), "left": 0, "sum:left": 4, "max:left": 0.2}),
                    (("--mean", "33"), {"left": 2.0 / 33.0, "converged": 32.0 / 33.0, "stress": known["stress"][-33:].mean()}),
                    (("--mean", "10", "--since", "0.0235"), {"max:force_x:max": late.max(), "min:force_x:max": late.min(), "min:converged": 1.0}),
                    (("--mean", "50"), {"converged": 0.98, "force_x:max": force.mean()})):
                done = self.sh(*job, "--table", ",".join(asked), *options, "--row", str(k), "h.nml")
                self.assertEqual(done.stderr, "")
                header, cells = (line.split(",") for line in done.stdout.splitlines())
                self.assertEqual((header[3:], cells[:4]), (["step", *asked], [f"h_{k}", "0", str(every), "50"]))
                for name, cell in zip(asked, cells[4:]):
                    self.assertAlmostEqual(float(cell), asked[name], delta=1e-8 * (1.0 + abs(asked[name])), msg=f"{name} {options} {every}")
            for arguments, words in ((("max:a",), "no column a; expected one of step,time"), (("max:stress", "--since", "0.05"), "history.csv: 0 steps after 0.05 s; expected 1 at least"),
                                     (("max:stress", "--since", "0.0235", "--mean", "30"), "27 steps after 0.0235 s; expected 30 at least"), (("stress", "--since", "x"), "--since x: expected a time [s]")):
                done = self.sh(*job, "--table", *arguments, "--row", str(k), "h.nml")
                self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (2, "", 1), done.stderr)
                self.assertIn(words, done.stderr)
        self.assertIn("--since 1: expected --table COLUMNS too", self.sh(*job, "--since", "1", "h.nml").stderr)

    def test_a_signal_to_the_job(self):
        """SIGTERM to the job stops the ranks, which write a checkpoint; the job ends after them, and no further row runs."""
        write(os.path.join(self.work, "long.nml"), namelist({**CASE, "time": {"step": 1e-3, "steps": 1000000}, "output": {"directory": "@run@", "every": 0}})
              .replace("friction = 0.3", "friction = @mu@"))
        write(os.path.join(self.work, "long.csv"), "mu\n0.3\n0.4\n")
        for ranks in (1, 2):
            shutil.rmtree(os.path.join(self.work, "long_1"), ignore_errors=True)
            job = subprocess.Popen(["gravier_job", "--ranks", str(ranks), "--list", "long.csv", "long.nml"], cwd=self.work, stderr=subprocess.PIPE, text=True,
                                   env={**ENVIRONMENT, **os.environ, "PATH": f"{self.bin}:{PROGRAMS}:{os.environ['PATH']}"})
            history, began = os.path.join(self.work, "long_1", "history.csv"), time.time()
            while not (os.path.exists(history) and os.path.getsize(history) > 2000) and time.time() - began < PATIENCE:
                time.sleep(0.05)
            job.terminate()
            _, said = job.communicate(timeout=PATIENCE)
            self.assertEqual(job.returncode, 143, said)
            self.assertRegex(said, r"^gravier_job: long_1: ended by SIGTERM: interrupted \*\*\* by SIGTERM after step \d+ of 1000000")
            self.assertTrue(os.path.exists(os.path.join(self.work, "long_1", "checkpoint.h5")))
            self.assertFalse(os.path.exists(os.path.join(self.work, "long_2")))
            with open(os.path.join(self.work, "long_1", "run.log"), encoding="utf-8") as file:
                self.assertIn("interrupted ***", file.read().splitlines()[-1])

    def test_samples_of_a_list(self):
        """The samples of a list, one after the other; of one that is refused the error is said."""
        write(os.path.join(self.work, "grades.csv"), "count,fraction\n20,0.3\n30,0.3\n20,5.0\n")
        write(os.path.join(self.work, "grade.nml"), "&scene bodies = 'sample' /\n&sample count = @count@, solid_fraction = @fraction@, box = 0.2, radius = 0.01, file = '@run@.h5' /\n"
              "&time step = 1.0e-3, steps = 0 /\n")
        done = self.sh("gravier_job", "--list", "grades.csv", "grade.nml", GRAVIER_PROGRAM="gravier_sample")
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        for name, made in (("grade_1.h5", True), ("grade_2.h5", True), ("grade_3.h5", False)):
            self.assertEqual(os.path.exists(os.path.join(self.work, name)), made, name)
        self.assertIn("grade_3: the run ended with status 2, see grade_3.out: gravier_sample: error: ", done.stderr)
        # a sample has no directory of results; a run has one
        write(os.path.join(self.work, "same.csv"), "count\n20\n30\n")
        write(os.path.join(self.work, "same.nml"), "&scene bodies = 'sample' /\n&sample count = @count@, box = 0.2, radius = 0.01, file = 'same.h5' /\n"
              "&time step = 1.0e-3, steps = 0 /\n")
        for program, place in (("gravier_sample", 'file = "@run@.h5" in &sample, a bodies file for each row'),
                               ("gravier", '&output directory = "@run@", a directory for each row')):
            done = self.sh("gravier_job", "--list", "same.csv", "same.nml", GRAVIER_PROGRAM=program)
            self.assertEqual((done.returncode, done.stderr), (2, f"gravier_job: error: same.nml: no @run@; expected {place}\n"))

    def test_without_a_scheduler_it_goes_on_by_itself(self):
        write(os.path.join(self.work, "case.nml"), namelist({**CASE, "time": {"step": 1e-3, "steps": 80}}))
        done = self.sh("sh", "mpirun.sh", RANKS=1, SECONDS_EACH=1.02)
        self.assertEqual(done.returncode, 0, done.stderr)
        with open(os.path.join(self.work, "case.out"), encoding="utf-8") as file:
            self.assertGreater(file.read().count("interrupted ***"), 0)
        self.assertEqual(len(self.history("part")), 81)

    def test_bad_use_and_failures(self):
        write(os.path.join(self.work, "case.nml"), namelist({**CASE, "output": {"directory": "part"}}))
        write(os.path.join(self.work, "bad.nml"), "&scene bodies = 'cubes' /\n&time step = 1, steps = 1 /\n")
        write(os.path.join(self.work, "plain.nml"), "&scene\n/\n")
        write(os.path.join(self.work, "template.nml"), "&scene friction = @mu@ /\n&output directory = '@run@' /\n")
        write(os.path.join(self.work, "mu.csv"), "mu\n0.1\n")
        write(os.path.join(self.work, "nu.csv"), "nu\n0.1\n")
        write(os.path.join(self.work, "both.csv"), "mu,nu\n0.1,2\n")
        write(os.path.join(self.work, "short.csv"), "mu,nu\n0.1\n")
        write(os.path.join(self.work, "none.csv"), "mu\n")
        for arguments, words in (
                ((), "no case"), (("a.nml",), "a.nml: cannot read"), (("list",), "cannot read"), (("--frob", "case.nml"), "unknown option --frob"),
                (("case.nml", "bad.nml"), "more than one case"), (("mu.csv",), "ends in .nml"), (("--ranks", "0", "case.nml"), "--ranks 0"),
                (("--seconds", "soon", "case.nml"), "--seconds soon"), (("--seconds",), "expected a value"),
                (("--list", "x.csv", "template.nml"), "x.csv: cannot read"), (("--list", "mu.csv", "--row", "2", "template.nml"), "no row 2"),
                (("--list", "mu.csv", "--row", "a", "template.nml"), "--row a"), (("--list", "none.csv", "template.nml"), "no row"),
                (("--list", "nu.csv", "template.nml"), "@mu@: no such column"), (("--list", "both.csv", "template.nml"), "no @nu@"),
                (("--list", "short.csv", "template.nml"), "1 columns; expected 2"), (("--list", "mu.csv", "plain.nml"), "no @run@"),
                (("--row", "1", "case.nml"), "--row 1: expected --list LIST.csv too"),
                (("bad.nml",), "status 2, see bad.out: gravier: error: bad.job.nml: &scene bodies = 'cubes'")):
            with self.subTest(arguments):
                done = self.sh("gravier_job", *arguments)
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertIn(words, done.stderr)
        # what did not converge is said in the words of the run, and what says nothing, too
        write(os.path.join(self.work, "rough.nml"), namelist({**CASE, "solver": {"tolerance": 1e-12, "max_iterations": 1},
                                                              "decomposition": {}, "output": {"directory": "rough"}}))
        done = self.sh("gravier_job", "--fresh", "rough.nml")
        self.assertEqual(done.returncode, 3)
        self.assertRegex(done.stderr, r"gravier_job: rough: the run ended with status 3, see rough.out: finished    \*\*\* \d+ of the steps "
                                      r"did NOT reach the accuracy: .*results in rough\n")
        self.program("silent", "#!/bin/sh\nexit 7\n")
        done = self.sh("gravier_job", "--fresh", "rough.nml", GRAVIER_PROGRAM="silent", GRAVIER_LAUNCH="env")
        self.assertEqual((done.returncode, done.stderr), (7, "gravier_job: rough: the run ended with status 7, see rough.out: it said nothing\n"))
        # a job that is too short for one step is not submitted for ever; one that is not submitted says so
        write(os.path.join(self.work, "case.reached"), "1\n")
        done = self.sh("gravier_job", "--fresh", "--seconds", "0.01", "case.nml")
        self.assertEqual(done.returncode, 4)
        self.assertIn("no step since the last job", done.stderr)
        done = self.sh("gravier_job", "--fresh", "case.nml", SLURM_JOB_ID=1, SLURM_JOB_END_TIME=int(time.time()))
        self.assertEqual(done.returncode, 4)
        self.assertIn("GRAVIER_RESUBMIT is not set", done.stderr)
        # the limit finds its place in a case without &output, too
        group = {name: keys for name, keys in CASE.items() if name != "output"}
        write(os.path.join(self.work, "silent.nml"), namelist({**group, "time": {"step": 1e-3, "steps": 100000}}))
        done = self.sh("gravier_job", "--fresh", "--seconds", "0.01", "silent.nml", GRAVIER_RESUBMIT="true")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("silent: interrupted after step", done.stderr)
        done = self.sh("gravier_job", "--seconds", "0.01", "case.nml", GRAVIER_RESUBMIT="false")
        self.assertEqual(done.returncode, 4)
        self.assertIn("could not be submitted", done.stderr)


if __name__ == "__main__":
    import unittest
    unittest.main()
