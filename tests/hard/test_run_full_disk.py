"""A disk that fills up during a run: exit status 4, one line, and what was written before stays whole and right.

Needs the right to mount a small file system (root); without it the tests are skipped, loudly."""
import os
import subprocess
import sys
import unittest

from gravier_runs import RunTestCase, differences, merged, run_case, steps_of

CASE = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [20, 10], "radius_min": 0.008, "radius_max": 0.012,
              "friction": 0.3},
    "time": {"step": 1e-3, "steps": 30},
    "solver": {"method": "nscdd", "tolerance": 1e-2},
    "decomposition": {"subdomains": 2},
    "output": {"directory": "disk/results", "trace": True},
}


class FullDisk(RunTestCase):

    def small_disk(self, name, kilobytes):
        """A directory whose `disk` holds no more than so many kilobytes."""
        directory = self.here(name)
        disk = os.path.join(directory, "disk")
        os.makedirs(disk)
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "gravier-test", disk], capture_output=True,
                              text=True, check=False)
        if done.returncode != 0:
            reason = f"NOT TESTED: full disks, for want of the right to mount one: {done.stderr.strip()}"
            print(reason, file=sys.stderr)
            self.skipTest(reason)
        self.addCleanup(subprocess.run, ["umount", "-l", disk], check=True)
        return directory

    def unhindered(self):
        if not hasattr(type(self), "free"):
            type(self).free = run_case(CASE, 1, self.here("free"))
            self.assert_status(self.free, 0)
        return self.free

    def assert_stopped(self, run):
        self.assert_status(run, 4)
        self.assertEqual(run.stderr.count("\n"), 1, f"one line expected: {run.stderr!r}")
        self.assertRegex(run.stderr, r"^gravier: error: disk/results/\S+: .*no space left on device")
        self.assertNotRegex(run.stdout, "reached the (accuracy|tolerance)", "a run that stopped must not look like one that finished")

    def compare_with_free(self, run):
        """Steps and rows that were written are those of the run that had room."""
        wanted = self.unhindered().results("disk/results")
        found = run.results("disk/results")
        steps = steps_of(found)
        self.assertEqual(steps, list(range(len(steps))))
        self.assertLess(len(steps), len(steps_of(wanted)))
        kept = {f"/steps/{step}" for step in steps}
        there = {name: value for name, value in wanted.items()
                 if not name.startswith("/steps/") or any(name.startswith((k + "/", k + "@")) or name == k for k in kept)}
        self.assertEqual(differences(there, found), [])
        for name in ("history", "trace"):
            rows = getattr(run, name)("disk/results")
            all_rows = getattr(self.unhindered(), name)("disk/results")
            n = len(rows["step"])
            self.assertEqual(differences({key: value[:n] for key, value in all_rows.items() if not key.endswith("_seconds")},
                                         {key: value for key, value in rows.items() if not key.endswith("_seconds")}), [], name)
        return steps

    def fills_up(self, ranks):
        # a step takes 20 KiB of bodies and contacts, and as room for headers 64 KiB more
        directory = self.small_disk(f"small on {ranks}", 600)
        run = run_case(CASE, ranks, directory)
        self.assert_stopped(run)
        steps = self.compare_with_free(run)
        # there was room for more than the start
        self.assertGreater(len(steps), 5)
        self.assertGreaterEqual(run.history("disk/results")["step"][-1], steps[-1])

    def test_one_rank(self):
        self.fills_up(1)

    def test_two_ranks(self):
        self.fills_up(2)

    def test_history_does_not_fit(self):
        """With one state at the end, it is a table that meets the full disk."""
        directory = self.small_disk("tables", 130)
        run = run_case(merged(CASE, {"output": {"every": 0}, "time": {"steps": 2000}, "solver": {"tolerance": 1e-3}}), 2,
                       directory)
        self.assert_stopped(run)
        self.assertEqual(steps_of(run.results("disk/results")), [])
        for table in (run.history("disk/results"), run.trace("disk/results")):
            self.assertGreater(len(table["step"]), 20)

    def test_final_bodies_do_not_fit(self):
        """An incomplete bodies file would be taken for a whole one."""
        case = merged(CASE, {"output": {"every": 0, "contacts": False, "trace": False, "final_bodies": True},
                             "scene": {"lattice_count": [50, 40]}, "time": {"steps": 1}})
        free = run_case(case, 1, self.here("free final bodies"))
        sizes = [os.path.getsize(free.path("disk/results", name)) // 1024 for name in ("results.h5", "final_bodies.h5")]
        # some disk is large enough for the state, which comes first, and not for the bodies file
        for kilobytes in range(sizes[0], sizes[0] + sizes[1] + 200, sizes[1] // 3):
            run = run_case(case, 2, self.small_disk(f"disk of {kilobytes}", kilobytes))
            self.assert_stopped(run)
            if "final_bodies.h5" in run.stderr:
                break
        self.assertIn("final_bodies.h5", run.stderr)
        self.assertEqual(differences(run.results("disk/results"), free.results("disk/results")), [])
        self.assertEqual(sorted(os.listdir(run.path("disk/results"))), ["history.csv", "results.h5", "run.log"])

    def test_full_from_the_start(self):
        """Nothing fits: refused as a directory that cannot be written to, before any file is made."""
        directory = self.small_disk("full", 64)
        with open(os.path.join(directory, "disk", "filling"), "wb", buffering=0) as file:
            try:
                while True:
                    file.write(bytes(4096))
            except OSError:
                pass
        for ranks in (1, 2):
            run = run_case(merged(CASE, {"output": {"directory": "disk"}}), ranks, directory)
            self.assertIn(run.status, (2, 4), str(run))
            self.assertEqual(run.stderr.count("\n"), 1, run.stderr)
            self.assertIn("no space left on device", run.stderr)
            self.assertEqual(os.listdir(os.path.join(directory, "disk")), ["filling"])

    def test_dev_full(self):
        """No right to mount is needed for a device that is always full."""
        directory = self.here("dev full")
        os.makedirs(os.path.join(directory, "disk", "results"))
        os.symlink("/dev/full", os.path.join(directory, "disk", "results", "history.csv"))
        for ranks in (1, 2):
            run = run_case(CASE, ranks, directory)
            self.assert_stopped(run)
            self.assertIn("history.csv", run.stderr)


if __name__ == "__main__":
    unittest.main()
