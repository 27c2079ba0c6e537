"""The Python package and gravier_plot on one small run: what they read is what the files hold, pictures are drawn, bad input is refused."""
import contextlib
import io
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import types
import unittest.mock

import gravier_runs  # noqa: F401  puts the package on the path
import h5py
import matplotlib.image
import numpy as np
from gravier_runs import SOURCE, RunTestCase, write

import gravier

sys.path.insert(0, os.path.join(SOURCE, "drivers/plot"))
import curve_pictures  # noqa: E402
import gravier_plot  # noqa: E402
import packing_picture  # noqa: E402
import picture_style  # noqa: E402

GROUND = {"name": "it's the ground", "shape": "plane", "normal": [0.0, 1.0]}


class Package(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.base = {"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [6, 6], "radius_min": 0.008, "radius_max": 0.012,
                              "friction": 0.3},
                    "time": {"step": 1e-3, "steps": 300},
                    "solver": {"method": "nscdd", "tolerance": 1e-4},
                    "decomposition": {"subdomains": 2},
                    "output": {"directory": "results", "every": 100, "trace": True}}
        cls.status = gravier.run(cls.base, cls.here(cls, "heap"), ranks=2)
        cls.run_ = gravier.Run(cls.here(cls, "heap/results"))

    def plot(self, *arguments):
        """Status and text of gravier_plot, in this process: most of its time would go into the start of another."""
        said, place = io.StringIO(), os.getcwd()
        os.chdir(self.scratch)
        try:
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                gravier_plot.main(arguments)
            status = 0
        except SystemExit as end:
            status = end.code
        finally:
            os.chdir(place)
        return status, said.getvalue()

    def test_namelists(self):
        """Entries that nothing is said of keep their place, and only an end of a line ends a comment."""
        read = gravier.parse_namelist("&boundary velocity = 0.0, , -0.02,\n force = ,1 ! a\u2028b c\n mass = 2*, 3.0 /\n")
        self.assertEqual(read, {"boundary": [{"velocity": [0.0, None, -0.02], "force": [None, 1], "mass": [None, None, 3.0]}]})
        self.assertEqual(gravier.value_text([0.0, None, -0.02]), "0.0, , -0.02")
        # entries by their index, a group that ends with &end, and a key apart from its value
        read = gravier.parse_namelist("&region name = 'x' lower(2) = 0.1, upper( 2:3 ) = 1,\n 2 &END\n&a x(3)=1 x(1)=2 b\n =\n .true. /")
        self.assertEqual(read, {"region": [{"name": "x", "lower": [None, 0.1], "upper": [None, 1, 2]}], "a": [{"x": [2, None, 1], "b": True}]})
        for text, words in (("&scene a = 1, a = 2 /", "&scene a is given twice"), ("&a x(1) = 1, x = 2 /", "&a x is given twice"),
                            ("&a x(2) = 1, x(1:2) = 2, 3 /", "&a x(2) is given twice"), ("&a x = 1", "&a is not closed: expected /"),
                            ("&a x = 1 /\n y = 2", "'y =' outside a group"), ("&a 3 /", "'3' in &a: expected `key = value` or /"),
                            ("&a x = (1,2) /", "'(' in &a: expected `key = value` or /"),
                            ("&a x = 1 &b y = 2 /", "'&b' in &a: expected `key = value` or /"), ("&a x(q) = 1 /", "&a x(q): expected an index as (2) or (2:3)")):
            with self.assertRaises(gravier.CaseError) as refused:
                gravier.parse_namelist(text)
            self.assertEqual(str(refused.exception), words)
        # texts that are repeated, and what Python alone takes for numbers
        read = gravier.parse_namelist("&law materials = 2*'it''s', x = 2*\"\", y = 1_8, z = 1_0.5 /")
        self.assertEqual(read, {"law": [{"materials": ["it's", "it's"], "x": ["", ""], "y": "1_8", "z": "1_0.5"}]})
        with self.assertRaisesRegex(gravier.CaseError, r"^'a\\nb': expected a text on one line$"):
            gravier.namelist({"scene": {"title": "a\nb"}})

    def test_command(self):
        done = subprocess.run([sys.executable, os.path.join(SOURCE, "drivers/plot/gravier_plot.py"), "--help"], capture_output=True,
                              text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("convergence", done.stdout)

    def test_tables_are_what_the_file_holds(self):
        run = self.run_
        self.assertEqual((self.status, run.dimension, list(run.steps)), (0, 2, [0, 100, 200, 300]))
        self.assertAlmostEqual(run.times[-1], 0.3, places=12)
        with h5py.File(run.path) as file:
            for step in run.steps:
                self.assertTrue(np.array_equal(run.bodies(step).position, file[f"steps/{step}/bodies/position"]))
            bodies = run.bodies()
            self.assertTrue(np.array_equal(bodies.mass, file["steps/300/bodies/mass"]))
            self.assertLess(np.abs(bodies.mass / (2500.0 * math.pi * bodies.radius**2) - 1.0).max(), 1e-14)
            self.assertTrue(np.array_equal(bodies.material, np.ones(36)), "without a &material all are of the first")
            velocity = file["steps/300/bodies/velocity"][:]
            self.assertTrue(np.array_equal(np.hstack([run.bodies().velocity, run.bodies().spin]), velocity))
            self.assertTrue(np.array_equal(run.contacts().impulse, file["steps/300/contacts/impulse"]))
            self.assertEqual(list(run.boundaries().shape), [value.decode() for value in file["boundaries/shape"]])
        self.assertEqual(len(run.history()), 300)
        means, every = run.history().means(70), run.history().kinetic_energy
        self.assertEqual(len(means), 4)
        np.testing.assert_allclose(means.kinetic_energy, [every[70 * k:70 * (k + 1)].mean() for k in range(4)], rtol=1e-15)
        with self.assertRaisesRegex(gravier.ResultsError, "means of 301 steps; expected 1 to 300, the steps that there are"):
            run.history().means(301)
        self.assertEqual(run.verdict(), "converged")
        self.assertEqual(set(run.trace().step), set(range(1, 301)))
        self.assertEqual(run.case["solver"], [self.base["solver"]])
        with self.assertRaisesRegex(gravier.ResultsError, "no step 7; expected one of 0, 100, 200, 300"):
            run.bodies(7)
        with self.assertRaisesRegex(gravier.ResultsError, "expected the results of a run"):
            gravier.Run(self.here("nowhere"))

    def test_a_body_over_all_states(self):
        """A body by its id, a row a written state; a grain that flies through a cell which is sheared has no jump in its places."""
        body = self.run_.body(7)
        np.testing.assert_array_equal(body.step, [0, 100, 200, 300])
        np.testing.assert_array_equal(body.time, self.run_.times)
        for k, step in enumerate(body.step):
            bodies = self.run_.bodies(step)
            for key in ("position", "velocity", "spin", "radius", "mass"):
                np.testing.assert_array_equal(body[key][k], bodies[key][bodies.id == 7][0], f"{step} {key}")
        self.assertEqual(len(body), 4)
        with self.assertRaisesRegex(gravier.ResultsError, "no body 99 in the written states; expected an id of bodies()"):
            self.run_.body(99)
        write(self.here("flying.csv"), "id,x,y,radius,vx,vy\n3,0.5,0.5,0.01,2.0,3.0\n")
        scene = {"bodies": "file", "bodies_file": self.here("flying.csv"), "gravity": [0.0, 0.0], "period": [1.0, 1.0]}
        for name, moving in (("still", {}), ("sheared", {"cell_shear_rate": 0.5})):
            gravier.run({"scene": {**scene, **moving}, "time": {"step": 0.01, "steps": 150}, "output": {"directory": ".", "every": 10}}, self.here(name))
            flying = gravier.Run(self.here(name)).body(3)
            self.assertEqual(len(flying), 16)
            self.assertGreater(np.abs(flying.image).max(), 2)
            ways = np.diff(flying.position, axis=0)
            # a sheared cell carries it along in its first step
            np.testing.assert_allclose(ways[1:], np.broadcast_to(ways[1], ways[1:].shape), atol=1e-7)
            np.testing.assert_allclose(ways[1, 1], 0.3, atol=1e-7)
            np.testing.assert_allclose(10 * 0.01 * flying.velocity[2:], ways[1:], atol=1e-6)

    def test_frames(self):
        """Components have the names of what they are along: axes, the normal and the tangents of a contact, the real part of a quaternion. A
        dictionary stands in for a table of pandas."""
        run, table = self.run_, gravier.Table
        with unittest.mock.patch.dict(sys.modules, {"pandas": types.SimpleNamespace(DataFrame=dict)}):
            bodies, contacts = run.bodies().frame(), run.contacts().frame()
            space = table(impulse=np.ones((1, 3)), moment=np.ones((1, 3)), orientation=np.ones((1, 4)), spin=np.ones((1, 3)), edge=np.ones((1, 3)))
            plane = table(moment=np.ones((0, 1)), orientation=np.ones((0, 1)), origin=np.ones((0, 1)), corners=np.ones((0, 2, 2)), stress=np.ones((0, 2, 2)))
            space, plane, forces = space.frame(), plane.frame(), table(moment=np.ones((1, 3))).frame()
        self.assertEqual([name for name in bodies if "_" in name], ["position_x", "position_y", "velocity_x", "velocity_y", "spin_z"])
        self.assertEqual([name for name in contacts if "_" in name], ["impulse_n", "impulse_t", "normal_x", "normal_y"])
        np.testing.assert_array_equal(contacts["impulse_t"], run.contacts().impulse[:, 1])
        np.testing.assert_array_equal(bodies["spin_z"], run.bodies().spin[:, 0])
        self.assertEqual(" ".join(space), "impulse_n impulse_t impulse_s moment_n moment_t moment_s orientation_w orientation_x orientation_y orientation_z "
                                          "spin_x spin_y spin_z edge_x edge_y edge_z")
        self.assertEqual(" ".join(plane), "moment_z orientation origin corners_1x corners_1y corners_2x corners_2y stress_xx stress_xy stress_yx stress_yy")
        self.assertEqual(list(forces), ["moment_x", "moment_y", "moment_z"])

    def test_frames_need_pandas(self):
        with unittest.mock.patch.dict(sys.modules, {"pandas": None}):
            with self.assertRaisesRegex(gravier.ResultsError, "^frame: there is no pandas; expected a python3 that has it, or the arrays of the table$"):
                self.run_.bodies().frame()

    def test_tables_that_are_cut_off(self):
        """A last row without its end is left out, also where it has as many values; a row within that is short is an error."""
        for text, expected in (("a,b\n1,2\n3,4", [2.0]), ("a,b\n1,2\n3", [2.0]), ("a,b\n1,2\n3,4\n", [2.0, 4.0]), ("a,b\n", [])):
            self.assertEqual(list(gravier.read_table(write(self.here("cut.csv"), text)).b), expected)
        with self.assertRaisesRegex(gravier.ResultsError, "cut.csv: line 3: 1 values; expected 2, as many as names$"):
            gravier.read_table(write(self.here("cut.csv"), "a,b\n1,2\n3\n5,6\n"))

    def test_forces_of_the_chains_carry_the_weight(self):
        """At rest the normal forces on the ground are the weight of the disks, which touch nothing else that could carry: walls
        of the box may do so by friction, which is added. Each chain begins at a centre and ends at one, or on a boundary."""
        run = self.run_
        bodies, contacts, boundaries = run.bodies(), run.contacts(), run.boundaries()
        segments, force = run.chains()
        self.assertTrue(np.array_equal(force, contacts.impulse[:, 0] / 1e-3))
        between = np.isin(contacts.antagonist, bodies.id)
        ends = bodies.position[contacts.antagonist[between] - 1]
        # gap and normal are those of the middle of the step
        self.assertLess(np.abs(segments[between, 1] - ends).max(), 1e-3 * np.abs(bodies.velocity).max() + 1e-12)
        ground = contacts.antagonist == boundaries.id[np.flatnonzero(boundaries.normal[:, 1] == 1.0)[0]]
        self.assertTrue(ground.any() and np.abs(segments[ground, 1, 1]).max() < 1e-5)
        # sum of f_n R over all ends is that of p d V over all bodies
        ends = bodies.radius[contacts.candidate - 1] + np.where(between, bodies.radius[np.minimum(contacts.antagonist, 36) - 1], 0.0)
        self.assertAlmostEqual((run.pressure() * 2.0 * math.pi * bodies.radius**2).sum() / (force * ends).sum(), 1.0, places=12)
        # the same in global axes: at rest the candidate of a contact has the half of its gap behind its surface
        forces = run.forces()
        self.assertTrue(np.array_equal(forces.antagonist, contacts.antagonist))
        np.testing.assert_allclose((forces.force * contacts.normal).sum(axis=1), force, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(forces.force[ground].sum(axis=0), -boundaries.force[boundaries.id == contacts.antagonist[ground][0]][0], atol=1e-9)
        arm = forces.point - (bodies.position - 0.5e-3 * bodies.velocity)[contacts.candidate - 1]
        np.testing.assert_allclose(arm, -(bodies.radius[contacts.candidate - 1] + 0.5 * contacts.gap)[:, None] * contacts.normal, atol=1e-12)
        weight = (2500.0 if "density" not in run.case["scene"][0] else 0.0) * math.pi * (bodies.radius**2).sum() * 9.81
        self.assertAlmostEqual(-boundaries.force[:, 1].sum() / weight, 1.0, delta=0.05)

    def test_namelists_are_read_as_they_are_written(self):
        groups = {"scene": [{"title": "it's & a 'title' / ! no comment", "gravity": [0.0, -9.81], "friction": 0.3}],
                  "boundary": [GROUND, {"name": "gate", "shape": "plane", "free": [True, False], "mass": 1e-3}],
                  "time": [{"step": 1e-3, "steps": 5}]}
        self.assertEqual(gravier.parse_namelist(gravier.namelist(groups)), groups)
        text = "! a & b = 3 /\n&Scene Title='x', gravity = 2*0.0, -1.0d1 ! more\n bodies='file' /\n &output vtk = T /"
        self.assertEqual(gravier.parse_namelist(text), {"scene": [{"title": "x", "gravity": [0.0, 0.0, -10.0], "bodies": "file"}],
                                                        "output": [{"vtk": True}]})

    def test_a_run_beside_another(self):
        """A directory where a run is under way is refused, and what the first one has written stays."""
        base = {**self.base, "time": {"step": 1e-3, "steps": 2}}
        place = pathlib.Path(self.here("beside"))
        gravier.run(base, place)
        before = {file.name: file.read_bytes() for file in place.iterdir() if file.is_file()}
        holding = (f"import sys\nsys.path[:0] = {sys.path!r}\nfrom whole_file import output_lock\n"
                   f"with output_lock({str(place / 'terminal.log')!r}, 'gravier.run'):\n    print(flush=True)\n    input()\n")
        with subprocess.Popen([sys.executable, "-c", holding], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
            other.stdout.readline()
            with self.assertRaisesRegex(gravier.CaseError, "terminal.log: another program writes here: gravier.run, process"):
                gravier.run({**base, "time": {"step": 1e-3, "steps": 3}}, place)
            other.communicate("\n")
        self.assertEqual({file.name: file.read_bytes() for file in place.iterdir() if file.is_file()}, before)
        with self.assertRaisesRegex(gravier.CaseError, "case.nml: File exists; expected a place for a directory"):
            gravier.run(base, place / "case.nml")

    def test_another_program(self):
        """A program of Gravier by its name, from where `gravier` comes, and any program by its path, from where Python is."""
        grains = {"scene": {"bodies": "sample", "gravity": [0.0, -9.81]}, "sample": {"count": 5, "radius": 0.01, "box": [0.1, 0.1], "file": "grains.h5"},
                  "time": {"step": 1e-3, "steps": 0}}
        for k, program in enumerate(("gravier_sample", pathlib.Path(os.path.relpath(gravier.case.find_program("gravier_sample"))))):
            place = pathlib.Path(self.here(f"sample_{k}"))
            self.assertEqual(gravier.run(grains, place, program=program), 0)
            self.assertEqual(len(gravier.BodiesFile(place / "grains.h5").bodies()), 5)
        with self.assertRaisesRegex(gravier.CaseError, "sample_0: gravier ended with status 2: gravier_sample: error: case.nml: &sample file = '': expected"):
            gravier.run({**grains, "sample": {**grains["sample"], "file": ""}}, self.here("sample_0"), program="gravier_sample")

    def test_logs_of_others(self):
        """A terminal.log of another origin is refused before anything is written; one of gravier.run is replaced, also of an earlier version."""
        base, place = {**self.base, "time": {"step": 1e-3, "steps": 1}}, pathlib.Path(self.here("logs"))
        place.mkdir()
        for own in ("made by gravier.run\nx\n", "Gravier 0.1.0 (a)\n", "gravier: error: x\n", ""):
            (place / "terminal.log").write_text(own)
            self.assertEqual(gravier.run(base, place, ranks=1.0), 0)
            self.assertRegex((place / "terminal.log").read_text(), r"^made by gravier\.run\nGravier \d")
        (place / "case.nml").unlink()
        (place / "terminal.log").write_text("my notes\n")
        with self.assertRaisesRegex(gravier.CaseError, "logs/terminal.log: there is a file of another kind or origin, which is not replaced"):
            gravier.run(base, place)
        self.assertEqual(((place / "terminal.log").read_text(), (place / "case.nml").exists()), ("my notes\n", False))
        # the first line is none of what a program has said
        with unittest.mock.patch.dict(os.environ, {"MPIEXEC": shutil.which("false")}):
            with self.assertRaisesRegex(gravier.CaseError, "gravier ended with status 1: $"):
                gravier.run(base, self.here("silent"))

    def test_pictures(self):
        drawn = [("packing", "a.png", ("--dpi", "100")), ("packing", "b.svg", ("--colour", "pressure", "--step", "100")),
                 ("packing", "c.png", ("--colour", "rotation", "--no-chains", "--dpi", "100")), ("history", "d.png", ()), ("convergence", "e.png", ())]
        for kind, name, options in drawn:
            status, said = self.plot(kind, "heap/results", "--out", name, *options)
            self.assertEqual((status, said), (0, name + "\n"))
        for name in ("a.png", "c.png", "d.png", "e.png"):
            picture = matplotlib.image.imread(self.here(name))
            self.assertGreater(min(picture.shape[:2]), 300)
            self.assertGreater(picture[:, :, :3].std(), 0.05, f"{name} is blank")
        # force chains are red, and only there where they are asked for
        red = [np.all(np.abs(matplotlib.image.imread(self.here(name))[:, :, :3] - np.array([0xb2, 0x18, 0x2b]) / 255) < 0.02, axis=2).sum()
               for name in ("a.png", "c.png")]
        self.assertGreater(red[0], 200)
        self.assertEqual(red[1], 0)
        with open(self.here("b.svg"), encoding="utf-8") as file:
            self.assertIn("<svg", file.read())

    def test_names_of_runs(self):
        """What tells directories apart is kept of them."""
        for paths, names in ((["/a/run_1/results", "/a/run_2/results"], ["run_1", "run_2"]), (["/a/b", "/a/b/c"], ["b", "b/c"]),
                             (["/a/x/y/r", "/a/z/r"], ["x/y", "z"]), (["/a/b"], ["b"])):
            self.assertEqual(curve_pictures.names_of([types.SimpleNamespace(directory=pathlib.Path(path)) for path in paths]), names)

    def test_runs_compared_and_movie(self):
        status, said = self.plot("history", "heap/results", "heap/results", "--out", "two.png", "--columns", "contacts")
        self.assertEqual((status, said), (0, "two.png\n"))
        status, said = self.plot("movie", "heap/results", "--out", "film.gif", "--every", "2")
        self.assertEqual((status, said), (0, "film.gif\n"))
        with open(self.here("film.gif"), "rb") as file:
            self.assertEqual(file.read(3), b"GIF")
        status, said = self.plot("movie", "heap/results", "--out", "frames", "--every", "3")
        self.assertEqual((status, sorted(os.listdir(self.here("frames")))), (0, ["frame_00000.png", "frame_00001.png"]))
        shapes = {matplotlib.image.imread(self.here("frames", name)).shape for name in os.listdir(self.here("frames"))}
        self.assertEqual(len(shapes), 1)

    def test_directories_of_frames(self):
        """Frames of a shorter movie are replaced. Those of a longer one, and a file that is no picture, are refused before anything is drawn."""
        def held():
            return {path.name: path.read_bytes() for path in pathlib.Path(self.here("film")).iterdir()}
        for every, count in ((3, 2), (1, 4)):
            self.assertEqual(self.plot("movie", "heap/results", "--out", "film", "--every", str(every)), (0, "film\n"))
            self.assertEqual(sorted(held()), [f"frame_0000{k}.png" for k in range(count)])
        before = held()
        self.assertEqual(self.plot("movie", "heap/results", "--out", "film", "--every", "3"),
                         (2, "gravier_plot: film: frame_00002.png to frame_00003.png of another movie, which this one of 2 frames would leave there; "
                             "expected a directory without them\n"))
        self.assertEqual(held(), before)
        write(self.here("film/frame_00001.png"), "mine")
        status, said = self.plot("movie", "heap/results", "--out", "film")
        self.assertEqual((status, len(said.splitlines())), (2, 1), said)
        self.assertIn("film/frame_00001.png: there is a file of another kind or origin", said)
        self.assertEqual(held(), {**before, "frame_00001.png": b"mine"})

    def test_colours_of_a_movie(self):
        """One value has one colour in all frames, also where a frame alone would have another unit."""
        run, options = self.run_, types.SimpleNamespace(view=(-60.0, 20.0), colour="speed", chains=True, regions=False, box=None)
        frame = packing_picture.shared_frame(run, list(run.steps), options)
        speeds = [np.linalg.norm(run.bodies(step).velocity, axis=1) for step in run.steps]
        tops = [np.quantile(values, 0.98) for values in speeds]
        self.assertLess(min(tops), 1e-3 * max(tops))
        # of the bodies of all states together but those in which nothing moves
        top = np.quantile(np.concatenate([values for values in speeds if values.any()]), 0.98)
        self.assertEqual(frame.limits, (0.0, top))
        self.assertLess(top, max(tops))
        how = [packing_picture.colours(run, step, run.bodies(step), "speed", frame.limits) for step in run.steps]
        self.assertEqual({label for _, label, _ in how}, {"speed [$10^{-3}$ m/s]"})
        for values, (shown, _, keys) in zip(speeds, how):
            np.testing.assert_allclose(shown, 1e3 * values, rtol=1e-12)
            np.testing.assert_allclose([keys["norm"].vmin, keys["norm"].vmax], [0.0, 1e3 * top], rtol=1e-12)
        # about 0 where some state has negative values, and none where nothing moves
        falls = packing_picture.shared_frame(run, list(run.steps), types.SimpleNamespace(**{**vars(options), "colour": "velocity_y"})).limits
        self.assertEqual(falls[0], -falls[1])
        self.assertIsNone(packing_picture.shared_frame(run, [0], options).limits)

    def test_movies_by_ffmpeg(self):
        """Frames go to the program ffmpeg one after the other, of even size, which its coding of .mp4 wants. A program that keeps what it is
        given stands in for it, one that fails, and none; where the real one is installed it makes a movie too."""
        real = shutil.which("ffmpeg")
        programs = self.here("programs")
        os.mkdir(programs)
        with unittest.mock.patch.dict(os.environ, {"PATH": programs}):
            status, said = self.plot("movie", "heap/results", "--out", "film.mp4")
            self.assertEqual((status, said), (2, "gravier_plot: film.mp4: no program ffmpeg; expected a movie .gif, or a directory for frames\n"))
            stub = os.path.join(programs, "ffmpeg")
            for end, text in ((0, ""), (1, "1")):
                with open(stub, "w", encoding="ascii") as file:
                    file.write(f'#!/bin/sh\nfor last; do :; done\necho "$@" >"$last.said"\n/bin/cat >"$last"\nexit {text}\n')
                os.chmod(stub, 0o755)
                status, said = self.plot("movie", "heap/results", "--out", "film.mp4", "--every", "3", "--fps", "5", "--size", "4.37")
                if end == 0:
                    self.assertEqual((status, said), (0, "film.mp4\n"))
                    with open(self.here("film.part.mp4.said"), encoding="ascii") as file:
                        width, height = map(int, re.search(r"-s (\d+)x(\d+) -pix_fmt rgba -.* 5.0 ", file.read()).groups())
                    self.assertEqual((width % 2, height % 2), (0, 0))
                    pictures = np.fromfile(self.here("film.mp4"), dtype=np.uint8).reshape(2, height, width, 4)
                    self.assertGreater(min(picture[:, :, :3].std() for picture in pictures), 10.0)
                    self.assertTrue((pictures[0] != pictures[1]).any())
                    # what the stand-in writes is no movie, and would not be replaced
                    os.remove(self.here("film.mp4"))
                else:
                    self.assertEqual((status, len(said.splitlines())), (2, 1), said)
                    self.assertIn("film.mp4: ffmpeg ended with status 1; expected a movie .gif", said)
        if real:
            status, said = self.plot("movie", "heap/results", "--out", "real.mp4")
            self.assertEqual((status, said), (0, "real.mp4\n"))
            with open(self.here("real.mp4"), "rb") as file:
                self.assertIn(b"ftyp", file.read(16))

    def test_pictures_of_bodies_files(self):
        with h5py.File(self.here("two.h5"), "w") as file:
            file["bodies/id"], file["bodies/radius"] = [4, 7], [0.1, 0.2]
            file["bodies/position"] = [[0.1, 0.1], [0.5, 0.2]]
            file["walls/id"], file["walls/point"], file["walls/normal"] = [8], [[0.0, 0.0]], [[0.0, 1.0]]
        sample = gravier.BodiesFile(self.here("two.h5"))
        self.assertEqual((sample.dimension, list(sample.bodies().id), list(sample.boundaries().name)), (2, [4, 7], ["wall 8"]))
        status, said = self.plot("packing", "two.h5", "--dpi", "100")
        self.assertEqual((status, said), (0, "two.png\n"))
        self.assertGreater(matplotlib.image.imread(self.here("two.png"))[:, :, :3].std(), 0.05)
        with h5py.File(self.here("bare.h5"), "w") as file:
            file["bodies/id"], file["bodies/position"], file["bodies/radius"] = [1], [[0.0, 0.0, 0.0]], [0.1]
        status, said = self.plot("packing", "bare.h5", "--out", "bare.png")
        self.assertEqual((status, said), (0, "bare.png\n"))
        for arguments, message in ((("two.h5", "--colour", "speed"), "two.h5: no velocities; expected another --colour"),
                                   (("two.h5", "--colour", "pressure"), "two.h5: a bodies file has no contacts"),
                                   (("two.h5", "--regions"), "two.h5: a bodies file has no regions and no chains"),
                                   (("two.h5", "--chains"), "two.h5: a bodies file has no regions and no chains"),
                                   (("two.h5", "--colour", "subdomain"), "two.h5: a bodies file has no subdomains"),
                                   (("heap/results/results.h5",), "no /bodies with id, position and radius; expected a bodies file"),
                                   (("none.h5",), "none.h5: no such file; expected a bodies file")):
            status, said = self.plot("packing", *arguments)
            self.assertEqual((status, len(said.splitlines())), (2, 1), said)
            self.assertIn(message, said)

    def test_what_bodies_files_do_not_have(self):
        """A bodies file goes into a directory that is made; what only a run has is NaN, or refused in one line."""
        gravier.write_bodies(self.run_, self.here("deeper/below/state.h5"), 300)
        state = gravier.BodiesFile(self.here("deeper/below/state.h5"))
        self.assertEqual(list(state.bodies().id), list(self.run_.bodies().id))
        self.assertTrue(np.isnan([state.velocity_error(), state.velocity_scale()]).all())
        for use, words in ((state.history, "a bodies file has no history; expected the results of a run"), (state.trace, "has no trace; expected the"),
                           (state.time_step, "a bodies file has no time step; expected the results of a run"),
                           (lambda: gravier.write_bodies(self.run_, self.here("heap/case.nml/state.h5")), "state.h5: .*; expected"),
                           (lambda: gravier.Run(None), "None: expected the path of a directory"), (lambda: gravier.BodiesFile(3), "3: expected the path of a")):
            with self.assertRaisesRegex(gravier.ResultsError, words):
                use()

    def test_files_changed_by_hand(self):
        """What is not as a run writes it is one line."""
        last = "steps/300/"
        for name, values, words in (("bodies/velocity", np.full((36, 3), np.nan), "bodies/velocity: a value that is not a finite number"),
                                    ("bodies/radius", -np.ones(36), "bodies/radius: -1; expected radii above 0"),
                                    ("bodies/id", np.ones(36, int), "results.h5: bodies whose ids do not ascend, or a contact whose candidate"),
                                    ("bodies/id", np.arange(100, 136), "results.h5: bodies whose ids do not ascend, or a contact whose candidate"),
                                    ("/boundaries/name", np.arange(3), "/boundaries/name: numbers; expected texts"),
                                    (None, "&scene friction = 0.3 /", "results.h5: its case has no time step; expected the results of a run")):
            shutil.copytree(self.here("heap/results"), self.here("changed"), dirs_exist_ok=True)
            with h5py.File(self.here("changed/results.h5"), "r+") as file:
                if name:
                    place = name if name.startswith("/") else last + name
                    del file[place]
                    file[place] = values
                else:
                    file["run"].attrs["input_text"] = values
            status, said = self.plot("packing", "changed", "--dpi", "50")
            self.assertEqual((status, len(said.splitlines())), (2, 1), said)
            self.assertIn(words, said)

    def test_refusals(self):
        for arguments, message in ((("packing", "nowhere"), "results.h5: no such file; expected the results of a run"),
                                   (("packing", "heap/results", "--step", "5"), "no step 5; expected one of 0, 100"),
                                   (("packing", "heap/results", "--out", "x.txt"), "ends in .png or .svg"),
                                   (("packing", "heap/results", "--colour", "subdomain"), "vtk = .true."),
                                   (("history", "heap/results", "--columns", "nothing"), "no column nothing"),
                                   (("convergence", "heap/results", "--step", "999"), "no step 999"),
                                   (("movie", "heap/results", "--out", "x.avi"), "x.avi: expected a movie .gif or .mp4"),
                                   (("packing", "heap/results", "--size", "900"), "--size 900: 180000 dots at 200 an inch; expected 20000 at most"),
                                   (("movie", "heap/results", "--size", "900"), "--size 900: 90000 dots at 100 an inch; expected 20000 at most"),
                                   (("movie", "heap/results", "--every", "0"), "--every 0 --fps 10: expected 1 or more"),
                                   (("packing", "heap/results", "--size", "0"), "--size 0: expected a size above 0, 1000 at most"),
                                   (("packing", "heap/results", "--view", "nan", "0"), "--view nan 0: expected two numbers"),
                                   (("packing", "heap/results", "--view", "0", "0"), "heap/results: a scene in the plane; expected no --view"),
                                   (("movie", "heap/results", "--out", "heap/case.nml/film.gif", "--every", "3"),
                                    "heap/case.nml/film.gif: File exists; expected a place for files")):
            status, said = self.plot(*arguments)
            self.assertEqual((status, len(said.splitlines())), (2, 1), said)
            self.assertIn(message, said)
        with unittest.mock.patch.object(gravier_plot, "draw_packing", side_effect=MemoryError("std::bad_alloc")):
            self.assertEqual(self.plot("packing", "heap/results", "--out", "x.png"),
                             (2, "gravier_plot: there is not enough memory for this picture; expected a smaller one, or fewer bodies\n"))


if __name__ == "__main__":
    gravier_runs.unittest.main()
