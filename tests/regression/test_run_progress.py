"""What a solve leaves out and what the log tells of its time: checks that can tell nothing new, the balance of sweeps, lines of
steps, warnings and the closing summary."""
import fcntl
import os
import re
import struct
import subprocess
import termios
import threading

from gravier_runs import ENVIRONMENT, GRAVIER, MPIEXEC, PATIENCE, RunTestCase, each, merged, namelist, run_case, write
from packings import settled_disks

#: begin of the line of a step: number, time, contacts
STEP = re.compile(r"^ +(\d+) +\d\.\d{6}E[+-]\d+ +\d+ ", re.M)


class Progress(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        packing = settled_disks(cls.scratch, count=(14, 12))
        cls.case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": packing, "friction": 0.3},
                    "time": {"step": 1e-3, "steps": 1},
                    "solver": {"criterion": "residual", "tolerance": 1e-4, "max_iterations": 20000, "check_every": 10, "warm_start": False},
                    "output": {"directory": "results"}}

    def test_checks_left_out(self):
        """With trace no check is left out. Without, a solve ends with the same residual asked for, at most two checks later; earlier
        only with momentum, whose sums may speak for a check before its turn."""
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
                    if method == "schwarz":
                        self.assertGreaterEqual(few, all_checks)
                    self.assertLessEqual(few, all_checks + 20)

    def test_balance(self):
        """A line after each new partition but the first, and one at the end; none with one subdomain."""
        case = merged(self.case, {"time": {"steps": 12}, "solver": {"method": "nscdd", "tolerance": 1e-2},
                                  "decomposition": {"subdomains": 4, "repartition_every": 5}})
        for ranks in (1, 2):
            run = run_case(case, ranks, self.here(f"balance {ranks}"))
            self.assert_status(run, 0)
            found = re.findall(r"^balance     time of sweeps over its mean: ([\d.]+) on the slowest rank, ([\d.]+) in the slowest subdomain, (\w+)",
                               run.stdout, re.M)
            self.assertEqual([line[2] for line in found], ["until", "until", "since"], run.stdout)
            for rank, subdomain, _ in found:
                self.assertTrue(1.0 <= float(rank) <= ranks, rank)
                self.assertTrue(1.0 <= float(subdomain) <= 4.0, subdomain)
        alone = run_case(self.case, 1, self.here("alone"))
        self.assert_status(alone, 0)
        self.assertNotIn("balance  ", alone.stdout)

    def test_lines_of_steps(self):
        """In a log the first ten steps and the last one have a line, the others now and then; nothing but text is written."""
        run = run_case(merged(self.case, {"time": {"steps": 200}, "solver": {"tolerance": 1e-1, "warm_start": True},
                                          "output": {"every": 0}}), 1, self.here("lines"))
        self.assert_status(run, 0)
        with open(run.path("results", "run.log"), encoding="ascii") as file:
            self.assertEqual(file.read(), run.stdout)
        said = [int(number) for number in STEP.findall(run.stdout)]
        self.assertEqual(said[:10], list(range(1, 11)))
        self.assertEqual(said[-1], 200)
        # one a second at most
        self.assertLessEqual(len(said), 12 + run.history()["wall_seconds"].sum())
        self.assertNotIn("\033", run.stdout)
        self.assertNotIn("\r", run.stdout)

    def on_terminal(self, command, directory, columns=80, enough=None):
        """Status of a command, and what it writes to a terminal of so many columns; it is stopped once it has said `enough`."""
        master, slave = os.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        said = []

        def listen():
            try:
                while text := os.read(master, 65536):
                    said.append(text)
                    if enough and re.search(enough, b"".join(said).decode()):
                        process.kill()
            except OSError:
                pass  # the other end is closed

        listener = threading.Thread(target=listen)
        with subprocess.Popen(command, cwd=directory, env={**ENVIRONMENT, **os.environ}, stdin=subprocess.DEVNULL, stdout=slave,
                              stderr=subprocess.STDOUT) as process:
            os.close(slave)
            listener.start()
            status = process.wait(timeout=PATIENCE)
        listener.join()
        os.close(master)
        return status, b"".join(said).decode()

    def test_long_solve(self):
        """A solve that takes long gives a sign of life: a line in run.log, on a terminal in the place of the live line, as long as the
        terminal is wide."""
        case = namelist({"scene": {"bodies": "column", "column_count": 3000, "radius": 0.5, "mass": 1.0},
                         "time": {"step": 1e-3, "steps": 2}, "output": {"directory": "results"},
                         "solver": {"criterion": "residual", "tolerance": 1e-14, "acceleration": "none", "max_iterations": 1000000000}})
        sign = r"step 1 is being solved: \d+ iterations in \d[\d.minh ]* s, residual \d\.\dE-\d+ at the last check, tolerance 1.0E-14"
        ways = (("wide", [], 150, sign), ("launched, narrow", [MPIEXEC, "-n", "2"], 40, r"step 1 is being solved: \d+ iterat"))

        def play(title, command, columns, shown):
            os.makedirs(self.here("long " + title))
            write(self.here("long " + title, "case.nml"), case)
            return self.on_terminal([*command, GRAVIER, "case.nml"], self.here("long " + title), columns, shown)[1]

        # the sign comes after seconds, whatever else the machine does
        for (title, _, columns, shown), said in zip(ways, each(play, ways)):
            with self.subTest(title):
                self.assertRegex(said, r"\r\033\[K" + shown)
                self.assertTrue(max(len(line) for line in re.findall(r"\033\[K(step [^\r]*)", said)) < columns)
                with open(self.here("long " + title, "results", "run.log"), encoding="ascii") as file:
                    self.assertRegex(file.read(), r"(?m)^ +" + sign + "$")

    def test_live_line(self):
        """On a terminal, with and without the launcher, steps are one line that is wiped out at the end; run.log has their lines."""
        case = namelist(merged(self.case, {"time": {"steps": 30}, "solver": {"tolerance": 1e-1}, "output": {"every": 0}}))
        for title, command in (("by itself", []), ("launched", [MPIEXEC, "-n", "2"])):
            with self.subTest(title):
                os.makedirs(self.here(title))
                write(self.here(title, "case.nml"), case)
                status, said = self.on_terminal([*command, GRAVIER, "case.nml"], self.here(title))
                self.assertEqual(status, 0, said)
                self.assertRegex(said, r"\r\033\[Kstep 1/30  1.000E-03 s  \d+ contacts  \d+ iterations  \S+E-\d+  .* remaining")
                self.assertEqual(STEP.findall(said), [])
                self.assertTrue(max(len(line) for line in re.findall(r"\033\[K(step [^\r]*)", said)) < 80)
                with open(self.here(title, "results", "run.log"), encoding="ascii") as file:
                    log = file.read()
                self.assertEqual(STEP.findall(log)[-1], "30")
                self.assertNotIn("\033", log)
                # what stays on the terminal is the text of the log without its steps
                kept = [line for line in re.sub(r"\r\033\[K[^\r]*(?=\r\033)", "", said).replace("\r\033[K", "").splitlines() if line]
                self.assertEqual(kept, [line for line in log.splitlines() if not STEP.match(line)])

    def test_warnings(self):
        """Of 30 warnings of a kind the first five, the 10th and the 20th are said; the end counts all of them."""
        run = run_case(merged(self.case, {"time": {"steps": 30}, "solver": {"tolerance": 1e-9, "max_iterations": 2},
                                          "output": {"every": 0}}), 1, self.here("warnings"))
        self.assert_status(run, 3)
        said = [int(number) for number in re.findall(r"NOT CONVERGED: .* in step (\d+)", run.stdout)]
        self.assertEqual(said, [1, 2, 3, 4, 5, 10, 20])
        self.assertIn("\nwarnings    solves above the tolerance 30\n", run.stdout)
        limited = {"solver": {"tolerance": 1e-9, "max_iterations": 2}, "output": {"every": 0, "checkpoint_every": 10}}
        for steps, options in ((10, []), (12, ["--restart"])):
            run = run_case(merged(self.case, limited, {"time": {"steps": steps}}), 1, self.here("restarted"), options=options)
        self.assertIn("\nwarnings    solves above the tolerance 2; those since the restart\n", run.stdout)

    def test_summary(self):
        """Whether it converged, where the time went, what would halve it: as the history has it."""
        residual = merged(self.case, {"solver": {"criterion": "residual"}})
        idle = run_case(residual, 2, self.here("idle"))
        self.assertRegex(idle.stdout, r"\nconverged   yes: every solve reached the tolerance 1.00E-04 and the accuracy 1.00E-01; [\d.]+ iterations a solve\n")
        self.assertRegex(idle.stdout, r"\ntime        [\d.]+ s, [\d.]+ m?s a step: [a-z]+.* \d+ %")
        self.assertIn("\nto halve it 1 of 2 ranks own no subdomain and wait: choose as many &decomposition subdomains as ranks, now 1, or fewer ranks", idle.stdout)
        lost = run_case(merged(residual, {"time": {"steps": 5}, "solver": {"tolerance": 1e-16, "max_iterations": 3000},
                                          "output": {"every": 0}}), 1, self.here("lost"))
        said = re.search(r"\nconverged   NO: 5 of 5 solves did not reach the tolerance 1.00E-16; at worst (\S+); ", lost.stdout)
        self.assertTrue(said, lost.stdout)
        self.assertAlmostEqual(float(said[1]) / lost.history()["residual"].max(), 1.0, delta=0.01)
        accurate = (lost.history()["velocity_error"] / lost.history()["velocity_scale"]).max() <= 0.1
        self.assertIn("\nto mend it  velocities are within the accuracy 1.00E-01: a larger &solver tolerance, now 1.00E-16, if that is enough\n"
                      if accurate else "\nto mend it  a larger &solver max_iterations, now 3000, or a smaller &time step\n", lost.stdout)
        self.assertIn("\nto halve it solves that do not converge take most of the iterations: see `to mend it`\n", lost.stdout)
        self.assertNotIn("\nto mend it ", idle.stdout)
        self.assertRegex(lost.stdout, r"(?m)^case        case\.nml$")
