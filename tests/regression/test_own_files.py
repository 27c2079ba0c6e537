"""Tools in Python write files of their own and no other: a name has the ending of what is written, and results, cases, tables and foreign files of
the same ending stay as they are."""
import os
import shutil
import subprocess
import unittest

import h5py
import matplotlib.pyplot  # noqa: F401
from forked_scripts import script
from gravier_runs import ENVIRONMENT, SOURCE, RunTestCase, merged, run_case, write

import gravier
from gravier import blocks

CASE = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [6, 4], "radius_min": 0.008, "radius_max": 0.012},
    "time": {"step": 1e-3, "steps": 20},
    "output": {"directory": "results", "every": 10, "contacts": True, "trace": True},
}
#: tools and what they take before the name of what they write, as an option or the last word
TOOLS = {
    "report": ["report/gravier_report.py", "results", "-o"],
    "packing": ["plot/gravier_plot.py", "packing", "results", "--dpi", "50", "--out"],
    "history": ["plot/gravier_plot.py", "history", "results", "--out"],
    "movie": ["plot/gravier_plot.py", "movie", "results", "--size", "2", "--out"],
    "profile": ["fclib/plot_fclib.py", "profile.csv", "--out"],
    "tiles": ["studies/tile_bodies.py", "bodies.h5"],
    "join": ["join/gravier_join.py", "bodies.h5", "bodies.h5", "--above", "0.1", "--out"],
    "walls": ["rough_walls/gravier_rough_walls.py", "bodies.h5", "--depth", "0.2", "--sides", "-y", "--out"],
    "measure": ["measure/gravier_measure.py", "heap", "results", "--out"],
    "blocks": ["blocks/gravier_blocks.py", "wall", "--bricks", "2", "--courses", "2", "--size", "0.2", "0.1", "--out"],
}
#: the tool, the name of the file, and the rest of the refusal where it is not that of a foreign file
WRONG_ENDINGS = [("report", name, ": expected a name that ends in .html") for name in ("results/results.h5", "results/history.csv", "case.nml")] + [
    (tool, "results/results.h5", ": expected a name that ends in .png or .svg") for tool in ("packing", "history", "profile")] + [
    ("tiles", "results/history.csv", ": expected a name that ends in .h5"), ("measure", "results/results.h5", ": expected a name that ends in .csv"),
    ("join", "results/history.csv", ": expected a name that ends in .h5"), ("walls", "results/history.csv", ": expected a name that ends in .h5")]
FOREIGN = [("tiles", "results/results.h5"), ("join", "results/results.h5"), ("walls", "results/results.h5"), ("report", "own.html"), ("packing", "own.png"), ("history", "own.svg"), ("movie", "own.gif"), ("profile", "own.png"),
           ("measure", "results/history.csv"), ("measure", "profile.csv"),
           ("blocks", "results/history"), ("blocks", "results/trace"), ("blocks", "case")]
STAYS = ": there is a file of another kind or origin, which is not replaced; expected the name of no file, or of one that was made in the same way"


class OwnFiles(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.run_directory = cls.here(cls, "run")
        gravier.run(CASE, cls.run_directory)
        with h5py.File(os.path.join(cls.run_directory, "bodies.h5"), "w") as file:
            file["bodies/id"], file["bodies/position"], file["bodies/radius"] = [1], [[0.1, 0.1]], [0.1]
            file["walls/id"], file["walls/point"], file["walls/normal"] = [2], [[0.0, 0.0]], [[0.0, 1.0]]
        write(os.path.join(cls.run_directory, "profile.csv"), "ratio,nlgs\n1,0.5\n2,1\n")
        for name in ("own.html", "own.png", "own.svg", "own.gif"):
            write(os.path.join(cls.run_directory, name), "mine\n")

    def setUp(self):
        self.work = self.here(self.id().split(".")[-1])
        shutil.copytree(self.run_directory, self.work)

    def tool(self, name, out):
        path, *arguments = TOOLS[name]
        return script(os.path.join(SOURCE, "drivers", path), *arguments, out, directory=self.work,
                      environment={**ENVIRONMENT, **os.environ})

    def files(self):
        """What is in each file below the directory."""
        found = {}
        for folder, _, names in os.walk(self.work):
            for name in names:
                with open(os.path.join(folder, name), "rb") as file:
                    found[os.path.relpath(os.path.join(folder, name), self.work)] = file.read()
        return found

    def test_files_of_others_stay(self):
        before = self.files()
        self.assertLess({"results/results.h5", "results/history.csv", "results/trace.csv", "results/run.log", "case.nml"}, set(before))
        os.mkdir(os.path.join(self.work, "folder.html"))
        places = [("tiles", "bodies.h5", ": this file is read; expected another name"), ("join", "bodies.h5", ": this file is read; expected another name"), ("walls", "bodies.h5", ": this file is read; expected another name"), ("report", "folder.html", ": there is a directory or a device"),
                  ("report", "a" * 300 + ".html", ": File name too long; expected a file that can be written")]
        for tool, name, text in WRONG_ENDINGS + [(*one, STAYS) for one in FOREIGN] + places:
            with self.subTest(tool=tool, name=name):
                done = self.tool(tool, name)
                self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
                ending = {"results/history": ".csv", "results/trace": ".csv", "case": ".nml"}.get(name, "") if tool == "blocks" else ""
                self.assertIn(f": error: {name}{ending}{text}", done.stderr)
                self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
                self.assertEqual(self.files(), before)

    def test_own_files_are_replaced(self):
        """What a tool has made it makes anew, and an empty file is nobody's."""
        for tool, name in (("report", "a.html"), ("packing", "a.png"), ("packing", "a.svg"), ("movie", "a.gif"), ("profile", "b.png"), ("tiles", "a.h5"),
                           ("blocks", "wall"), ("measure", "a.csv"), ("join", "b.h5"), ("walls", "c.h5")):
            write(os.path.join(self.work, name if tool != "blocks" else "wall.nml"), "")
            for time in range(2):
                with self.subTest(tool=tool, name=name, time=time):
                    done = self.tool(tool, name)
                    self.assertEqual((done.returncode, done.stderr), (0, ""))
                    self.assertGreater(os.path.getsize(os.path.join(self.work, name if tool != "blocks" else "wall.nml")), 0)

    def test_files_of_a_run(self):
        """A run replaces files of an older one and empty ones, and refuses a directory with a file of another origin under one of its names."""
        case = merged(CASE, {"output": {"final_bodies": True, "vtk": True}})
        run_case(case, directory=self.work)
        names = ["run.log", "history.csv", "trace.csv", "results.h5", "final_bodies.h5", "bodies.vtkhdf"]
        for name in names:
            path = os.path.join(self.work, "results", name)
            with open(path, "rb") as file:
                own = file.read()
            write(path, "")
            self.assert_status(run_case(case, directory=self.work), 0)
            write(path, "time,mine\n1,2\n")
            before = self.files()
            for options in ((), ("--restart",)):  # there is no checkpoint: a restart begins anew
                run = run_case(case, directory=self.work, options=options)
                self.assert_status(run, 2)
                self.assertIn(f"case.nml: &output directory = 'results': the file {name} in it is none of this program, and is not replaced; expected "
                              "another directory, or another name for that file", str(run))
                self.assertEqual(self.files(), before)
            with open(path, "wb") as file:
                file.write(own)
        self.assert_status(run_case(case, directory=self.work), 0)

    def test_input_in_place_of_an_output(self):
        """A table of radii that has the name of an output is read, and not replaced."""
        table = write(os.path.join(self.work, "results", "history.csv"), "radius,share\n0.008,0\n0.012,1\n")
        case = merged(CASE, {"sample": {"count": 20, "box": [0.3, 0.0], "radii": "table", "radius_table": "results/history.csv"}})
        case["scene"] = {"dimension": 2, "bodies": "sample"}
        for options in ((), ("--restart",)):
            run = run_case(case, directory=self.work, options=options)
            self.assert_status(run, 2)
            self.assertIn("case.nml: &sample radius_table = 'results/history.csv': this run would replace the file by its own history.csv", str(run))
            with open(table, encoding="utf-8") as file:
                self.assertEqual(file.read(), "radius,share\n0.008,0\n0.012,1\n")

    def test_files_of_another_run(self):
        """A restart goes on with the files that its run has written. Those of an older run, in the place of outputs that it had not asked for
        until then, begin anew."""
        output = {"directory": "results", "every": 5, "vtk": True, "trace": True}
        case = merged(CASE, {"output": output})
        shutil.rmtree(os.path.join(self.work, "results"))
        self.assert_status(run_case(case, directory=self.work), 0)
        other = merged(CASE, {"scene": {"lattice_count": [5, 3]}, "output": {"vtk": False, "trace": False, "every": 5, "checkpoint_every": 10}})
        self.assert_status(run_case(other, directory=self.work), 0)
        for steps, first in ((30, 20), (40, 20)):
            longer = merged(other, {"time": {"steps": steps}, "output": output})
            self.assert_status(run_case(longer, directory=self.work, options=("--restart",)), 0)
            with h5py.File(os.path.join(self.work, "results", "bodies.vtkhdf"), "r") as file:
                self.assertEqual(set(file["VTKHDF/NumberOfPoints"][:]), {15})
                self.assertEqual([round(1000*time) for time in file["VTKHDF/Steps/Values"]], list(range(first + 5, steps + 1, 5)))
            with open(os.path.join(self.work, "results", "trace.csv"), encoding="utf-8") as file:
                found = {int(line.split(",")[0]) for line in file.readlines()[1:]}
            self.assertEqual(found, set(range(first + 1, steps + 1)))

    def test_functions_of_the_package(self):
        """The same by exceptions: bodies files, cases, seals of tables and blocks."""
        run, before = gravier.Run(os.path.join(self.work, "results")), self.files()
        path = {name: os.path.join(self.work, name) for name in ("results/results.h5", "results/history.csv", "case.nml", "bodies.h5", "mine/case.nml")}
        for call, error, text in (
                (lambda: gravier.write_bodies(run, path["results/results.h5"]), gravier.ResultsError, "this file is read"),
                (lambda: gravier.write_bodies(run, path["results/history.csv"]), gravier.ResultsError, "expected a name that ends in .h5 or .hdf5"),
                (lambda: gravier.write_bodies(run, path["bodies.h5"]), gravier.ResultsError, "not replaced"),
                (lambda: gravier.seal(path["results/results.h5"]), gravier.CaseError, "not a text; expected a table in CSV"),
                (lambda: gravier.seal(path["results/history.csv"]), gravier.CaseError, "a table that a run writes"),
                (lambda: blocks.tower(2, (0.1, 0.1)).write(os.path.join(self.work, "results/history")), blocks.BlocksError, "not replaced")):
            with self.assertRaisesRegex(error, text) as caught:
                call()
            self.assertNotIn("\n", str(caught.exception))
            self.assertEqual(self.files(), before)
        os.mkdir(self.here("own_case"))
        own = write(self.here("own_case", "case.nml"), "! mine\n" + gravier.namelist(CASE))
        with self.assertRaisesRegex(gravier.CaseError, "case.nml: there is a file of another kind or origin"):
            gravier.run(CASE, self.here("own_case"))
        self.assertEqual(os.listdir(self.here("own_case")), ["case.nml"])
        with open(own, encoding="utf-8") as file:
            self.assertTrue(file.read().startswith("! mine\n"))
        # what would be written is there already, and what was written is replaced
        write(own, gravier.namelist(CASE))
        self.assertEqual(gravier.run(CASE, self.here("own_case")), 0)
        self.assertEqual(gravier.run({**CASE, "time": {"step": 1e-3, "steps": 2}}, self.here("own_case")), 0)
        for step in (10, 20):
            gravier.write_bodies(run, os.path.join(self.work, "state.h5"), step)
            self.assertEqual(len(gravier.BodiesFile(os.path.join(self.work, "state.h5")).bodies().id), 24)
        table = write(os.path.join(self.work, "pair.csv"), "time,gx,gy\n0,0,-9.81\n")
        gravier.seal(table)
        with open(table, encoding="ascii") as file:
            self.assertRegex(file.read(), r"\A# checksum [0-9a-f]{16}\ntime,gx,gy\n0,0,-9\.81\n\Z")

    def test_the_launcher_leaves_what_is_no_build(self):
        """Files in the place of a build stay, and a link to the launcher builds where the launcher is, and not where the link is."""
        tree, elsewhere = (os.path.join(os.path.realpath(self.work), name) for name in ("tree", "elsewhere"))
        for place in (tree, elsewhere):
            os.makedirs(os.path.join(place, "build/release"))
            write(os.path.join(place, "build/release/mine.txt"), "mine")
        shutil.copy(os.path.join(SOURCE, "gravier"), tree)
        os.symlink("../tree/gravier", os.path.join(elsewhere, "gravier"))
        os.symlink("gravier", os.path.join(elsewhere, "again"))
        for launcher in (os.path.join(tree, "gravier"), os.path.join(elsewhere, "gravier"), os.path.join(elsewhere, "again")):
            done = subprocess.run([launcher, "build"], cwd=elsewhere, capture_output=True, text=True, check=False, env={**ENVIRONMENT, **os.environ})
            self.assertEqual(done.returncode, 2, done)
            self.assertIn(f"{tree}/build/release has files that are no build of Gravier: expected nothing there, or a build\n", done.stdout + done.stderr)
            self.assertEqual(os.listdir(os.path.join(tree, "build/release")), ["mine.txt"])
        self.assertEqual(sorted(os.listdir(elsewhere)), ["again", "build", "gravier"])
        self.assertEqual(os.listdir(os.path.join(elsewhere, "build")), ["release"])
        self.assertEqual(os.listdir(os.path.join(elsewhere, "build/release")), ["mine.txt"])

    def test_the_launcher_refuses_before_it_builds(self):
        tree = os.path.join(os.path.realpath(self.work), "refusing")
        os.makedirs(tree)
        launcher = shutil.copy(os.path.join(SOURCE, "gravier"), tree)
        for arguments, more, line in (
                (["run", "none.nml"], {}, "none.nml: no such file; expected a case"),
                (["run", "-n", "0", "none.nml"], {}, "-n expects a number of ranks, 1 or more; found '0'"),
                (["test", "all"], {}, "test takes no argument but quick or long; found 'all'"),
                (["demo"], {"GRAVIER_PYTHON": "/bin/false"}, "GRAVIER_PYTHON=/bin/false: expected a python3 with h5py, numpy and matplotlib")):
            done = subprocess.run([launcher, *arguments], cwd=tree, capture_output=True, text=True, check=False, env={**ENVIRONMENT, **os.environ, **more})
            self.assertEqual((done.returncode, done.stderr), (2, f"gravier: {line}\n"), arguments)
        shutil.rmtree(os.path.join(tree, "build"), ignore_errors=True)
        write(os.path.join(tree, "build"), "a file")
        done = subprocess.run([launcher, "build"], cwd=tree, capture_output=True, text=True, check=False, env={**ENVIRONMENT, **os.environ})
        self.assertEqual((done.returncode, done.stderr), (2, f"gravier: {tree}/build: expected a directory that can be written to\n"))


if __name__ == "__main__":
    unittest.main()
