"""What --check says of the scales of a scene, against formulas of its input, and the warnings where the step or the tolerance cannot hold
what the scene is for: they name the key and a number with which they are gone, and they open the log of a run."""
import math
import os
import re
import unittest

from gravier_runs import RunTestCase, gravier, merged, namelist, run_case, write

G = 9.81
DENSITY = 2500.0
RADIUS = 0.01
NUMBER = r"([-+0-9.E]+)"
#: 48 disks in cells of 2.1 radii, over the floor of a box that is 8 cells wide and 6 high
LATTICE = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [8, 6], "radius_min": RADIUS, "radius_max": RADIUS, "density": DENSITY,
              "friction": 0.5},
    "time": {"step": 1e-3, "steps": 2},
    "output": {"directory": "results"},
}
HEIGHT = 6 * 2.1 * RADIUS
#: pressed by a lid that slides
SHEAR = merged(LATTICE, {
    "scene": {"gravity": [0.0, 0.0]},
    "boundary": [{"name": "lid", "shape": "plane", "point": [0.0, HEIGHT], "normal": [0.0, -1.0], "velocity": [2e-3, 0.0],
                  "free": [False, True], "pressure": 1000.0, "mass": 10.0}],
    # grains creep by 0.01 d in that time
    "time": {"steps": 1000000}, "solver": {"criterion": "residual", "tolerance": 1e-4}})


class Scales(RunTestCase):

    def check_case(self, *parts, ranks=1, files=()):
        """Text of --check of a case, made of parts."""
        directory = self.here("check")
        os.makedirs(directory, exist_ok=True)
        for name, text in dict(files).items():
            write(os.path.join(directory, name), text)
        write(os.path.join(directory, "case.nml"), namelist(merged(*parts)))
        run = gravier("--check", "case.nml", ranks=ranks, directory=directory)
        self.assert_status(run, 0)
        return run.stdout

    def figures(self, text, pattern, *expected):
        """The numbers of a line are those expected, to the three digits that are written."""
        found = re.search(pattern, text)
        self.assertTrue(found, f"{pattern} in {text}")
        for said, value in zip(found.groups(), expected):
            self.assertLess(abs(float(said) - value), 6e-3 * abs(value), f"{said}, expected {value:.4g} in {found[0]}")

    def warnings(self, text):
        found = [line for line in text.splitlines() if line.startswith("warning     ")]
        count = {0: "no error found;", 1: "no error found, 1 warning;"}.get(len(found), f"no error found, {len(found)} warnings;")
        self.assertIn(f"checked     {count} nothing was run", text)
        return found

    def assert_heeded(self, case, words, *parts):
        """There is one warning that has the words, and the number that would do, in the place of that of its key, does."""
        found = [line for line in self.warnings(self.check_case(case, *parts)) if words in line]
        self.assertEqual(len(found), 1, found)
        group, key, most = re.match(r"warning     &(\w+) (\w+) = .* at most ([-+0-9.E]+)(?: s)? would do", found[0]).groups()
        # three digits are written
        for factor, remain in ((0.99, 0), (1.02, 1)):
            again = self.warnings(self.check_case(case, *parts, {group: {key: factor * float(most)}}))
            self.assertEqual(len([line for line in again if words in line]), remain, again)
        return found[0]

    def test_gravity(self):
        text = self.check_case(LATTICE)
        self.figures(text, rf"scales      mean diameter d = {NUMBER} m; g h = {NUMBER} m/s, {NUMBER} mean diameters a step; sqrt\(g d\) = {NUMBER} m/s",
                     2 * RADIUS, G * 1e-3, G * 1e-6 / (2 * RADIUS), math.sqrt(2 * G * RADIUS))
        self.figures(text, rf"velocity errors are compared with U = {NUMBER} m/s \(load of a step\)", G * 1e-3)
        lists = rf"distances   contacts have gaps of at most {NUMBER} m \(alert_distance\), lists reach {NUMBER} m further \(skin\)"
        self.figures(text, lists + rf", overlaps above {NUMBER} m are projected \(overlap_allowed\)\n", 0.1 * RADIUS, 0.2 * RADIUS, 0.01 * RADIUS)
        given = self.check_case(LATTICE, {"scene": {"alert_distance": 3e-4, "skin": 7e-4, "overlap_projection": False}})
        self.figures(given, lists + "\n", 3e-4, 7e-4)
        self.assertEqual(self.warnings(text), [])
        # what the libraries of a process take differs from time to time
        memory = r"about \d+ MiB at most on a rank"
        self.assertEqual(re.sub(memory, "", text), re.sub(memory, "", self.check_case(LATTICE)))

    def test_density_without_effect(self):
        """A density that the case gives, while the bodies file gives other masses, is warned of: of a material, and of the scene, also with shapes. One
        that is that of the masses, one that the case leaves out and one of a file without masses are not."""
        disks = "id,x,y,radius,material,mass\n" + "".join(f"{k + 1},{k},0.5,0.01,{1 + k % 2},{m}\n" for k, m in enumerate([0.7854] * 4))
        squares = "id,x,y,shape,radius,material,mass\n1,0,1,square,,1,100\n2,3,1,,0.01,1,0.31416\n"
        shapes = "shape square\npolygon -0.1581139 -0.1581139 0.1581139 -0.1581139 0.1581139 0.1581139 -0.1581139 0.1581139\n"
        light = {"name": "light", "density": 2500.0}
        heavy = {"name": "heavy", "density": 7500.0}
        words = "has no effect: the bodies file gives masses, which are those of a density of "
        for title, bodies, scene, materials, wanted in (
                ("material", disks, {"density": None}, [light, heavy], [f"&material 'heavy' density = 7.50E+03 {words}2.50E+03"]),
                ("right", disks, {"density": 2500.0}, [light, {"name": "heavy"}], []),
                ("scene", disks.replace("0.01,2,", "0.01,1,"), {"density": 7800.0}, [], [f"&scene density = 7.80E+03 {words}2.50E+03"]),
                ("left out", disks.replace("0.01,2,", "0.01,1,").replace("0.7854", "9.0"), {"density": None}, [], []),
                ("no masses", disks.replace(",mass", "").replace(",0.7854", ""), {"density": None}, [light, heavy], []),
                ("shapes", squares, {"density": 1000.0, "shapes": "s.shapes"}, [], []),
                ("other shapes", squares, {"density": 500.0, "shapes": "s.shapes"}, [], [f"&scene density = 5.00E+02 {words}1.00E+03"])):
            with self.subTest(title):
                scene = {**LATTICE["scene"], **scene, "bodies": "file", "bodies_file": "b.csv", "lattice_count": None, "radius_min": None, "radius_max": None,
                         "gravity": [0.0, 0.0]}
                case = {**LATTICE, "scene": {key: value for key, value in scene.items() if value is not None}, "material": materials,
                        "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 2}}
                for ranks in (1, 2):
                    text = self.check_case(case, ranks=ranks, files={"b.csv": bodies, "s.shapes": shapes})
                    self.assertEqual([line[12:] for line in self.warnings(text)], wanted)

    def test_grains_that_nothing_holds(self):
        """Gravity along a period without any boundary is warned of. A boundary, gravity along another axis, a table and gravity that is off are not."""
        sample = {"scene": {"bodies": "sample", "dimension": 2, "period": [0.0, 0.2]},
                  "sample": {"count": 20, "radius": 0.005, "box": [0.2, 0.2], "container": "box", "arrangement": "lattice"}, "time": {"step": 1e-4, "steps": 1}}
        files = {"b.csv": "id,x,y,radius\n1,0.1,0.1,0.01\n", "space.csv": "id,x,y,z,radius\n1,0.1,0.1,0.1,0.01\n", "g.csv": "time,gx,gy\n0,0,-1\n1,0,-1\n"}
        free = {"scene": {"bodies": "file", "bodies_file": "b.csv", "dimension": 2, "period": [0.2, 0.2]}, "time": {"step": 1e-4, "steps": 1}}
        space = merged(free, {"scene": {"dimension": 3, "period": [0.0, 0.0, 0.2], "bodies_file": "space.csv"}})
        words = "nothing holds the grains against gravity along"
        for title, case, wanted in (
                ("both axes", free, f"{words} y, where the scene is periodic and has no boundary: all of them fall together. "
                                    "&scene gravity = 0, 0 switches gravity off"),
                ("space", space, f"{words} z, where the scene is periodic and has no boundary: all of them fall together. "
                                 "&scene gravity = 0, 0, 0 switches gravity off"),
                ("across", merged(free, {"scene": {"period": [0.2, 0.0]}}), None),
                ("planes of a sample", sample, None),
                ("boundary", merged(free, {"boundary": [{"shape": "segment", "point": [0.0, 0.05], "end": [0.2, 0.05]}]}), None),
                ("table", merged(free, {"scene": {"gravity_table": "g.csv"}}), None),
                ("off", merged(free, {"scene": {"gravity": [0.0, 0.0]}}), None)):
            with self.subTest(title):
                found = [line[12:] for line in self.warnings(self.check_case(case, files=files)) if words in line]
                self.assertEqual(found, [wanted] if wanted else [])

    def test_unit_of_lengths(self):
        """Grains of metres are large: millimetres that are meant as such are seen."""
        large = self.check_case(LATTICE, {"scene": {"radius_min": 4.0, "radius_max": 6.0}, "time": {"step": 0.01}})
        self.assertRegex(large, r"scales      mean diameter d = \S+ m \(lengths are in metres\); g h")
        self.assertNotIn("lengths are in metres", self.check_case(LATTICE))

    def test_shear(self):
        text = self.check_case(SHEAR)
        speed, rate = math.sqrt(1000.0 / DENSITY), 2e-3 / HEIGHT
        self.figures(text, rf"pressure P = {NUMBER} N/m on 'lid'; sqrt\(P/rho\) = {NUMBER} m/s, h sqrt\(P/rho\)/d = {NUMBER}",
                     1000.0, speed, 1e-3 * speed / (2 * RADIUS))
        self.figures(text, rf"rate {NUMBER} 1/s by 'lid', rate d = {NUMBER} m/s; inertial number I = {NUMBER}",
                     rate, rate * 2 * RADIUS, rate * 2 * RADIUS / speed)
        self.figures(text, rf"fastest boundary 'lid': {NUMBER} m/s, {NUMBER} mean radii a step", 2e-3, 2e-3 * 1e-3 / RADIUS)
        self.figures(text, rf"velocity errors are compared with U = {NUMBER} m/s \(drive\)", 2e-3)
        self.assertNotIn("g h", text)

    def test_heavy_lid(self):
        """A lid whose load gives it less than what solves may be wrong by: the warning ends at the mass that it names."""
        lid = {"name": "lid", "shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0], "free": [False, True], "force": [0.0, -10.0]}

        def said(mass):
            text = self.check_case(LATTICE, {"boundary": [*LATTICE.get("boundary", []), {**lid, "mass": mass}]})
            return [each for each in self.warnings(text) if "its load gives it" in each]
        # F h/m = 0.1 g h
        most = 10.0 / (0.1 * G)
        self.assertEqual(said(0.99 * most), [])
        self.assertEqual(len(said(1.01 * most)), 1)
        found = re.search(rf"'lid': its load gives it {NUMBER} m/s in a step, less than the error of {NUMBER} m/s .* at most {NUMBER} kg would do",
                          said(1e6)[0])
        for text, value in zip(found.groups(), (10.0 * 1e-3 / 1e6, 0.1 * G * 1e-3, most)):
            self.assertAlmostEqual(float(text) / value, 1.0, delta=6e-3)
        # what it advises is enough
        self.assertEqual(said(float(found[3])), [])

    def test_mean_of_what_enters(self):
        """Of a scene that is filled, the mean grain is that of all that are to enter; of insertions without a number each counts alike."""
        case = {"scene": {"dimension": 2, "bodies": "none"}, "time": {"step": 1e-3, "steps": 100},
                "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]}],
                "insertion": [{"name": name, "lower": [0.0, 0.5], "upper": [0.4, 0.6], "radius": radius, "count": count}
                              for name, radius, count in (("big", 0.007, 120), ("small", 0.0035, 480))]}
        for title, more, diameter in (("counts", {}, "8.40E-03"), ("rates", {"count": None, "rate": 1e3}, "1.05E-02"), ("free", {"count": None}, "1.05E-02")):
            insertions = [{key: value for key, value in {**one, **more}.items() if value is not None} for one in case["insertion"]]
            run = run_case({**case, "insertion": insertions}, directory=self.here(f"enters {title}"), options=("--check",))
            self.assert_status(run, 0)
            self.assertIn(f"mean diameter d = {diameter} m", run.stdout)

    def test_table_that_turns_within_steps(self):
        """A table of a drive or of gravity whose ups and downs fall between steps is warned of; with steps that follow it it is not. Loads have means over steps, and
        what moves has those about their ends."""
        wave = "".join(f"{0.005 * k},{(k % 2) * 9.81}\n" for k in range(41))
        for key, column, name, parts in (("boundary", "vx", "boundary 'plate': its table", ("5", "5[23]")),
                                         ("scene", "gx", "&scene gravity_table = 'wave.csv'", ("5", "5"))):
            for step, kept in ((0.01, parts[0]), (0.005, parts[1]), (0.0002, None)):
                case = {"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [2, 1], "radius_min": 0.05, "radius_max": 0.05},
                        "boundary": [{"name": "plate", "shape": "plane", "normal": [0.0, 1.0], "point": [0.0, -0.05]}],
                        "time": {"step": step, "steps": round(0.1 / step)}}
                (case["boundary"][0] if key == "boundary" else case["scene"])["table" if key == "boundary" else "gravity_table"] = "wave.csv"
                place = self.here(f"{key}{step}")
                os.makedirs(place)
                write(os.path.join(place, "wave.csv"), f"time,{column}\n{wave}")
                run = run_case(case, directory=place, options=("--check",))
                self.assert_status(run, 0)
                if kept is None:
                    self.assertNotIn("turns within steps", run.stdout)
                else:
                    self.assertRegex(run.stdout, f"warning     {re.escape(name)} turns within steps: they keep {kept} % of its ups and downs; a smaller &time step keeps more")

    def test_ranks(self):
        said = [[line for line in self.check_case(SHEAR, {"solver": {"method": "nscdd", "tolerance": 0.1}, "decomposition": {"subdomains": 3}},
                                                  ranks=ranks).splitlines() if re.match("scales|warning|            ", line)]
                for ranks in (1, 2)]
        self.assertEqual(*said)
        self.assertGreater(len(said[0]), 5)

    def test_glued_walls(self):
        """Rows of glued disks, one of which a force presses on the other, in a periodic cell: the rate is that of their distance."""
        rows = "".join(f"{k + 1},{0.02 * (k % 10)!r},{0.2 * (k // 10)!r},0.01,{k // 10 + 1}\n" for k in range(20))
        grains = "".join(f"{k + 21},{0.02 * (k % 10)!r},{0.03 + 0.02 * (k // 10)!r},0.01,0\n" for k in range(70))
        case = {"scene": {"dimension": 2, "gravity": [0.0, 0.0], "bodies": "file", "bodies_file": "rows.csv", "density": DENSITY,
                          "period": [0.2, 0.0]},
                "boundary": [{"name": "bottom", "shape": "grains", "group": 1},
                             {"name": "top", "shape": "grains", "group": 2, "velocity": [0.01, 0.0], "free": [False, True],
                              "force": [0.0, -100.0], "mass": 10.0}], "time": SHEAR["time"]}
        text = self.check_case(case, files={"rows.csv": "id,x,y,radius,group\n" + rows + grains})
        self.figures(text, rf"pressure P = {NUMBER} N/m on 'top'", 100.0 / 0.2)
        self.figures(text, rf"rate {NUMBER} 1/s by 'top', rate d = {NUMBER} m/s; inertial number I = {NUMBER}", 0.05, 0.05 * 0.02,
                     0.05 * 0.02 * math.sqrt(DENSITY / 500.0))
        self.figures(text, rf"compared with U = {NUMBER} m/s \(drive\)", 0.01)

    def test_tables(self):
        """Loads and speeds are the largest of their tables; U is that of the first step, which counts the speed of a lid that begins from rest 30 steps later."""
        files = {"lid.csv": "time,vx,pressure\n0,0,1000\n0.5,0.4,4000\n1.0,0,1000\n", "g.csv": "time,gy\n0,-1\n0.4,-4\n1,0\n"}
        lid = {**SHEAR["boundary"][0], "table": "lid.csv", "velocity": None, "pressure": None}
        text = self.check_case(SHEAR, {"scene": {"gravity": None, "gravity_table": "g.csv"}, "time": {"step": 1e-3},
                                       "boundary": [{k: v for k, v in lid.items() if v is not None}]}, files=files)
        self.figures(text, rf"g h = {NUMBER} m/s", 4e-3)
        self.figures(text, rf"pressure P = {NUMBER} N/m", 4000.0)
        self.figures(text, rf"fastest boundary 'lid': {NUMBER} m/s", 0.4)
        self.figures(text, rf"compared with U = {NUMBER} m/s \(drive\)", 0.8 * 31e-3)
        # a flat of ten steps between jumps within steps
        files["lid.csv"] = "time,vx,pressure\n0.3,0,1000\n0.3001,0.4,9000\n0.31,0.4,9000\n0.3101,0,1000\n"
        text = self.check_case(SHEAR, {"scene": {"gravity": None, "gravity_table": "g.csv"}, "time": {"step": 1e-3},
                                       "boundary": [{k: v for k, v in lid.items() if v is not None}]}, files=files)
        self.figures(text, rf"pressure P = {NUMBER} N/m", 9000.0)
        self.figures(text, rf"fastest boundary 'lid': {NUMBER} m/s", 0.4)

    def test_given_scale(self):
        self.figures(self.check_case(LATTICE, {"solver": {"velocity_scale": 0.125}}), rf"compared with U = {NUMBER} m/s \(given\)", 0.125)

    def test_long_steps(self):
        """Steps through which grains fall into the floor."""
        lifted = merged(LATTICE, {"scene": {"period_origin": None}, "time": {"step": 0.1}})
        line = self.assert_heeded(lifted, "loads move a free grain")
        self.figures(line, rf"&time step = {NUMBER} s: loads move a free grain by {NUMBER} mean diameters in it", 0.1, G * 0.01 / (2 * RADIUS))
        bodies = "id,x,y,radius\n" + "".join(f"{k + 1},{0.05 * k!r},2.0,0.01\n" for k in range(4))
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "high.csv"}, "time": LATTICE["time"],
                "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]}]}
        write(os.path.join(self.here("check"), "high.csv"), bodies)
        words = "to the lowest support moves by"
        self.assertEqual(self.warnings(self.check_case(case)), [])
        line = self.assert_heeded(case, words, {"time": {"step": 2e-3}})
        # 1.99 m and what the gaps leave: less than 2.01 m, more than 1.95 m
        self.figures(line, rf"a grain that falls {NUMBER} m to the lowest support moves by {NUMBER} mean radii", 1.99, 0.2 * math.sqrt(2 * G * 1.99))
        # one that enters at 1 m/s has the same way to fall
        enters = {"scene": {"dimension": 2, "bodies": "none"}, "time": {"step": 2e-3, "steps": 10}, "boundary": case["boundary"],
                  "insertion": {"lower": [0.0, 1.9], "upper": [1.0, 2.0], "radius": 0.01, "rate": 100.0, "velocity": [0.0, -1.0]}}
        line = self.assert_heeded(enters, "grains that enter are at up to")
        speed = math.sqrt(1.0 + 2 * G * 1.98)
        self.figures(line, rf"grains that enter are at up to {NUMBER} m/s where they have fallen to the lowest support, move by {NUMBER} mean radii",
                     speed, 0.2 * speed)
        # upside down there is no support
        up = self.warnings(self.check_case(case, {"scene": {"gravity": [0.0, G]}, "time": {"step": 2e-3}}))
        self.assertEqual(up, [])
        column = {"scene": {"bodies": "column", "column_count": 100, "radius": 0.01, "mass": 1.0}, "time": {"step": 4e-3, "steps": 1}}
        self.assertEqual(self.warnings(self.check_case(column)), [], "a column has nowhere to fall")

    def test_events_after_the_end(self):
        """What a run ends before: insertions that begin and boundaries that are removed at its end or later; not what comes in its last step."""
        case = {"scene": {"dimension": 2, "bodies": "none"}, "time": {"step": 1e-3, "steps": 400},
                "boundary": [{"name": "gate", "shape": "plane", "normal": [0.0, 1.0], "remove_at": 0.4}],
                "insertion": {"name": "late", "lower": [0.0, 0.1], "upper": [0.1, 0.2], "radius": 0.01, "rate": 10.0, "start": 0.5}}
        lines = self.warnings(self.check_case(case))
        for start, step in ((0.0, 1), (1e-3, 2), (1.5e-3, 3)):
            run = run_case(merged(case, {"boundary": [{**case["boundary"][0], "remove_at": start}], "time": {"steps": 4}}), 1, self.here(f"removed {step}"))
            self.assert_status(run, 0)
            self.assertEqual(re.findall("\nremoved .*", run.stdout), [f"\nremoved     boundary 'gate' at the start of step {step}"])
        self.assertEqual(lines, ["warning     &insertion 'late': start = 5.00000E-01 s, and the run ends at 4.00000E-01 s, before grains enter",
                                 "warning     &boundary 'gate': remove_at = 4.00000E-01 s, and the run ends at 4.00000E-01 s, before it is removed"])
        self.assertEqual(self.warnings(self.check_case(case, {"time": {"steps": 501}})), [])
        # boundaries go with a step that begins at their time or later: 0.3995 lies in the last step, and 0.399 is its beginning
        for time, number in ((0.3995, 2), (0.399, 1)):
            gate = {"boundary": [{**case["boundary"][0], "remove_at": time}]}
            self.assertEqual(len(self.warnings(self.check_case(case, gate))), number)

    def test_sample_that_is_not_prepared(self):
        """A run starts from a sample as it is placed, and says so where its input asks for more; not so after a restart."""
        case = {"scene": {"dimension": 2, "bodies": "sample", "density": DENSITY}, "sample": {"count": 30, "radius": RADIUS, "box": [0.3, 0.3], "file": "s.h5"},
                "time": {"step": 1e-3, "steps": 2}, "output": {"directory": "results", "checkpoint_every": 2}}
        self.assertEqual(self.warnings(self.check_case(case)), [])
        for preparation, keys in (("settled", {}), ("compacted", {"pressure": 10.0})):
            line = (f"warning     &sample preparation = '{preparation}': gravier_sample prepares grains, and a run of gravier starts from them as they are "
                    "placed; make their file by gravier_sample, and start from it with &scene bodies = 'file'")
            prepared = merged(case, {"sample": {"preparation": preparation, **keys}})
            self.assertEqual(self.warnings(self.check_case(prepared)), [line])
            run = run_case(prepared, 1, self.here(preparation))
            self.assert_status(run, 0)
            self.assertEqual(run.stdout.count(line + "\n"), 1)
            run = run_case(merged(prepared, {"time": {"steps": 4}}), 1, self.here(preparation), ("--restart",))
            self.assert_status(run, 0)
            self.assertNotIn("gravier_sample prepares", run.stdout)

    def test_far_from_the_origin(self):
        """Places of maps, of which the last digits are coarser than a step at the speed of the scene: a floor that rises came 7 % too short."""
        bodies = "id,x,y,radius\n1,5e5,5000000.02,0.01\n"
        os.makedirs(self.here("check"), exist_ok=True)
        write(os.path.join(self.here("check"), "far.csv"), bodies)
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "far.csv", "gravity": [0.0, 0.0]}, "time": {"step": 1e-4, "steps": 10},
                "boundary": [{"name": "floor", "shape": "plane", "point": [5e5, 5e6], "normal": [0.0, 1.0], "velocity": [0.0, 1e-4]}]}
        lines = self.warnings(self.check_case(case))
        self.assertEqual(lines, ["warning     &boundary 'floor' at 5.00E+06 m: numbers there are 9.3E-10 m apart, and a step at 1.00E-04 m/s is 1.00E-08 m: "
                                 "rounding changes such motion by up to 9.31 %; put the origin nearer to the scene"])
        # far along itself, and at a turning point of an oscillation, which is at rest but for rounding
        along = {"name": "floor", "shape": "plane", "point": [1e7, 0.0], "normal": [0.0, 1.0], "velocity": [0.0, 1e-4]}
        turning = {"name": "shaker", "shape": "plane", "point": [0.01, -0.01], "normal": [0.0, 1.0], "oscillation": [0.0, 1e-5], "frequency": 5.0,
                   "phase": math.pi / 2}
        write(os.path.join(self.here("check"), "near.csv"), "id,x,y,radius\n1,0,0.02,0.01\n")
        near = {"scene": {"bodies_file": "near.csv"}, "boundary": [along, turning]}
        self.assertNotIn("rounding changes", self.check_case(case, near))
        still = {"boundary": [{**case["boundary"][0], "velocity": [0.0, 0.0]}], "scene": {"gravity": [0.0, -10.0]}, "time": {"step": 1e-5}}
        lines = self.warnings(self.check_case(case, still))
        self.assertEqual(lines, ["warning     bodies at 5.00E+06 m: numbers there are 9.3E-10 m apart, and a step at 1.00E-04 m/s is 1.00E-09 m: "
                                 "rounding changes such motion by up to 93.13 %; put the origin nearer to the scene"])
        self.assertEqual(self.warnings(self.check_case(case, {"time": {"step": 1e-2}})), [])

    def test_no_grains(self):
        """A file without a row is a scene in which nothing can happen; with an insertion it is one that is filled."""
        os.makedirs(self.here("check"), exist_ok=True)
        write(os.path.join(self.here("check"), "none.csv"), "id,x,y,radius\n")
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "none.csv"}, "time": {"step": 1e-3, "steps": 10}}
        self.assertEqual(self.warnings(self.check_case(case)), ["warning     the scene has no grain, and no &insertion lets grains in"])
        feed = {"insertion": {"lower": [0.0, 0.1], "upper": [0.1, 0.2], "radius": 0.01, "rate": 10.0}}
        self.assertEqual(self.warnings(self.check_case(case, feed)), [])

    def test_slip_scale(self):
        """Errors of a tenth of g h are as large as the slip at which static friction is lost: ten layers that are shaken below their limit slide."""
        law = {"material": {"name": "a"}, "scene": {"wall_material": "a"}}
        slip = {"law": {"materials": "a", "kind": "velocity", "static_friction": 0.5, "dynamic_friction": 0.3, "slip_scale": 1e-3}}
        error = 0.1 * G * 1e-3
        lines = self.warnings(self.check_case(merged(LATTICE, law, slip, {"time": {"step": 1e-3}})))
        self.assertEqual(len(lines), 1, lines)
        self.figures(lines[0], rf"&law slip_scale = {NUMBER} m/s: solves may leave errors of {NUMBER} m/s, which take contacts out of their static friction; "
                           rf"an accuracy of at most {NUMBER} would do", 1e-3, error, 0.05 / error * 1e-3)
        self.assertEqual(self.warnings(self.check_case(merged(LATTICE, law, slip, {"time": {"step": 1e-3}, "solver": {"accuracy": 0.05}}))), [])

    def test_fast_boundaries(self):
        line = self.assert_heeded(SHEAR, "radii of the smallest grain", {"boundary": [{**SHEAR["boundary"][0], "velocity": [2.0, 0.0]}]})
        self.figures(line, rf"boundary 'lid' moves by {NUMBER} radii of the smallest grain", 2.0 * 1e-3 / RADIUS)
        drum = {"boundary": [{"name": "drum", "shape": "circle", "point": [0.08, 0.06], "radius": 0.2, "rotation": [10.0]}]}
        line = self.assert_heeded(LATTICE, "radii of the smallest grain", drum)
        self.figures(line, rf"boundary 'drum' moves by {NUMBER} radii", 0.2 * 10.0 * 1e-3 / RADIUS)

    def test_boundaries_that_may_pass_through_grains(self):
        """Whatever moves it, a boundary that goes towards grains by more than their radius in a step is counted where it reaches them,
        and the log says so; one that goes along its surface, or by less, is not. Those with a velocity of 30 m/s are 15 mm before the
        grains and then 15 mm behind them: there is no contact."""
        row = "".join(f"{k + 1},{0.03 * k!r},%s0,{RADIUS}\n" for k in range(5))
        flat = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "../row.csv", "density": DENSITY, "gravity": [0.0, 0.0]},
                "time": {"step": 1e-3, "steps": 30}, "output": {"directory": "results", "every": 0}}
        space = merged(flat, {"scene": {"dimension": 3, "bodies_file": "../space.csv", "gravity": [0.0, 0.0, 0.0]}})
        ram = {"name": "ram", "shape": "segment", "point": [-0.1, -0.39], "end": [0.3, -0.39]}
        plate = {"name": "ram", "shape": "rectangle", "point": [-0.1, -0.1, -0.39], "edge_a": [0.4, 0.0, 0.0],
                 "edge_b": [0.0, 0.2, 0.0]}
        mesh = {"name": "ram", "shape": "mesh", "file": "../ram.csv"}
        write(self.here("row.csv"), "id,x,y,radius\n" + row.replace("%s", ""))
        write(self.here("space.csv"), "id,x,y,z,radius\n" + row.replace("%s", "0,"))
        write(self.here("ram.csv"), "x,y\n-0.1,-0.39\n0.06,-0.39\n0.3,-0.39\n")
        push = {"free": [False, True], "mass": 1.0, "force": [0.0, 4e4], "velocity": [0.0, 0.0]}
        cases = {
            "segment": (flat, {**ram, "velocity": [0.0, 30.0]}, True),
            "segment by a force": (flat, {**ram, **push}, True),
            "mesh": (flat, {**mesh, "velocity": [0.0, 30.0]}, True),
            "rectangle": (space, {**plate, "velocity": [0.0, 0.0, 30.0]}, True),
            "segment that turns": (flat, {**ram, "point": [-0.2, -0.1], "end": [-0.2, -0.5], "pivot": [-0.2, 0.0], "rotation": [100.0]}, True),
            "segment in small steps": (merged(flat, {"time": {"step": 1e-4, "steps": 300}}), {**ram, "velocity": [0.0, 30.0]}, False),
            "segment along itself": (flat, {**ram, "point": [-0.9, -0.011], "end": [0.3, -0.011], "velocity": [30.0, 0.0]}, False),
            "segment far away": (flat, {**ram, "point": [1.1, -0.39], "end": [1.5, -0.39], "velocity": [0.0, 30.0]}, False),
            "drum": (flat, {"name": "drum", "shape": "circle", "point": [0.06, 0.0], "radius": 0.08, "rotation": [400.0]}, False),
        }
        for title, (case, boundary, counts) in cases.items():
            with self.subTest(title):
                found = []
                for ranks in (1, 2):
                    run = run_case(merged(case, {"boundary": boundary, "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 2}}),
                                   ranks, self.here(f"{title} {ranks}".replace(" ", "_")))
                    self.assert_status(run, 0)
                    found.append(run.history()["fast"].sum())
                self.assertEqual(found[0], found[1])
                if counts:
                    self.assertGreaterEqual(found[0], 5)
                    if 30.0 in boundary.get("velocity", []):
                        self.assertEqual(run.history()["kinetic_energy"].max(), 0.0)
                    self.assertRegex(run.stdout, r"warning     in step \d+ the way of \d grains, or of a boundary towards it, is longer than the radius")
                    self.assertRegex(run.stdout, rf"finished    .*; {found[0]:.0f} times something moved too far for the step; results in")
                else:
                    self.assertEqual(found[0], 0)

    def test_held_by_grains(self):
        """A light lid that a large force presses on disks at rest does not move, though it would go far without them."""
        write(self.here("held.csv"), "id,x,y,radius,mass\n1,0,0.005,0.005,0.1\n2,0.02,0.005,0.005,0.1\n")
        lid = {"name": "lid", "shape": "plane", "point": [0.0, 0.01], "normal": [0.0, -1.0], "free": [False, True], "force": [0.0, -100.0], "mass": 0.1}
        run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "../held.csv"}, "time": {"step": 3e-3, "steps": 20},
                        "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]}, lid], "output": {"directory": "results"}}, 1, self.here("held"))
        self.assert_status(run, 0)
        self.assertEqual(run.history()["fast"].sum(), 0)
        self.assertNotIn("too far", run.stdout)

    def test_pressure(self):
        line = self.assert_heeded(SHEAR, "under the pressure on", {"boundary": [{**SHEAR["boundary"][0], "velocity": [0.0, 0.0], "pressure": 1e5}]})
        self.figures(line, rf"h sqrt\(P/rho\)/d = {NUMBER} under the pressure on 'lid'", 1e-3 * math.sqrt(1e5 / DENSITY) / (2 * RADIUS))

    def test_tolerance_in_slow_shear(self):
        """An error of 2 tolerance h p d/(m rate d) of the speed of the wall, in 2D; above 0.05 is a warning."""
        self.assertEqual(self.warnings(self.check_case(SHEAR, {"solver": {"tolerance": 1e-4}})), [])
        line = self.assert_heeded(SHEAR, "of the speed of", {"solver": {"tolerance": 1e-3}})
        load = 1e-3 * 1000.0 * 2 * RADIUS / (DENSITY * math.pi * RADIUS**2)
        motion = 2e-3 / HEIGHT * 2 * RADIUS
        self.figures(line, rf"&solver tolerance = {NUMBER}: solves leave errors of about {NUMBER} of the speed of 'lid' in shear at I = {NUMBER}; "
                     rf"at most {NUMBER} would do, or a smaller &time step", 1e-3, 2 * 1e-3 * load / motion,
                     motion * math.sqrt(DENSITY / 1000.0), 0.05 * motion / (2 * load))

    def test_log_of_a_run(self):
        """A run says what --check warns of, and the log keeps it; it runs nevertheless."""
        case = merged(SHEAR, {"solver": {"tolerance": 1e-3}, "time": {"step": 5e-3, "steps": 2}})
        expected = self.warnings(self.check_case(case))
        self.assertGreater(len(expected), 0)
        for ranks in (1, 2):
            run = run_case(case, ranks, self.here(f"run {ranks}"))
            self.assert_status(run, 0)
            with open(run.path("results", "run.log"), encoding="utf-8") as file:
                before = file.read().split("    step       time")[0]
            self.assertEqual([line for line in before.splitlines() if line.startswith("warning     &")], expected)


if __name__ == "__main__":
    unittest.main()
