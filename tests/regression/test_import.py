"""gravier_import: DATBOX of LMGC90 written here become cases of Gravier that do what formulas say; what has no counterpart is named."""
import fcntl
import math
import os
import signal
import subprocess
import sys
import time

import h5py
import numpy as np

from forked_scripts import script
from gravier_runs import ENVIRONMENT, PROGRAMS, SOURCE, RunTestCase, alone_environment, gravier, namelist, write

IMPORT = os.path.join(PROGRAMS, "gravier_import")
G = 9.81


def real(value):
    """As Fortran writes D14.7."""
    if value == 0.0:
        return " 0.0000000D+00"
    power = math.floor(math.log10(abs(value))) + 1
    return f"{value / 10.0**power:10.7f}D{power:+03d}"


def values(**given):
    return "  ".join(f"{name}={real(value)}" for name, value in given.items())


def vectors(prefix, numbers, form="{}{}"):
    cells = [f"{form.format(prefix, k + 1)}={real(x)}" for k, x in enumerate(numbers)]
    return ("\n" + " " * 29).join("  ".join(cells[k:k + 3]) for k in range(0, len(cells), 3))


def body(dimension, rank, place, contactors, avrd=0.0):
    """A body; contactors as (kind, colour, text of its values)."""
    kind, node, pad = ("RBDY2", "NO3xx", 3) if dimension == 2 else ("RBDY3", "NO6xx", 6)
    place = [*place, *[0.0] * (pad - len(place))]
    lines = ["$bdyty", f" {kind}{rank:7d}", "$blmty", f" PLAIN      1  behav  stone  {values(avrd=avrd, gyrd=0.0)}", "$nodty",
             f" {node}      1                {vectors('coo', place)}", "$tacty"]
    lines += [f" {shape}{k:7d}  color  {colour}  {text}" for k, (shape, colour, text) in enumerate(contactors, 1)]
    return "\n".join(lines) + "\n$$$$$$\n"


def drive(dimension, rank, rows):
    kind, node = ("RBDY2", "NO3xx") if dimension == 2 else ("RBDY3", "NO6xx")
    text = f"$bdyty\n {kind}{rank:7d}\n$nodty\n {node}      1\n"
    text += "$dofty  numbr [CT......+......AMP..*..cos.(..OMEGA.*.time.+.PHI..)]...*...[RAMPI.....+.....RAMP.*.time]\n"
    for what, component, *numbers in rows:
        text += f" {what}{component:7d} " + " ".join(real(x) for x in numbers) + "\n"
    return text + "$$$$$$\n"


def still(dimension, rank):
    return drive(dimension, rank, [("vlocy", k + 1, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0) for k in range(3 * dimension - 3)])


def state(dimension, rank, moved, velocity, frame=None):
    kind, node, pad = ("RBDY2", "NO3xx", 3) if dimension == 2 else ("RBDY3", "NO6xx", 6)
    rows = [vectors("X", [*moved, *[0.0] * (pad - len(moved))], "{}({})"), vectors("V", [*velocity, *[0.0] * (pad - len(velocity))], "{}({})")]
    rows += [vectors(name, axis, "{}({})") for name, axis in zip("abc", frame)] if frame is not None else []
    return f"$bdyty\n {kind}{rank:7d}\n$nodty\n {node}      1                " + ("\n" + " " * 29).join(rows) + "\n$$$$$$\n"


BULK = """! materials
$gravy
                   grv1= 0.0000000D+00  grv2={0}  grv3={1}

$behav  lawty
 stone  RIGID                           Umas= 0.2500000D+04
"""
LAW = "$behav  lawty\n iqsc0  IQS_CLB                         fric= 0.3000000D+00\n"
SEE = "$seety\n cdbdy  cdtac  cdcol  behav  anbdy  antac  ancol\n {0}  {1}  {2}  iqsc0  {0}  {3}  {4}       0.2000000D-02\n"


#: corners of a cube of half a side 0.1, and the triangles of its faces, from 1
CUBE = np.array([[(k & 1) - 0.5, (k >> 1 & 1) - 0.5, (k >> 2) - 0.5] for k in range(8)]) * 0.2
TRIANGLES = [(1, 2, 4), (1, 4, 3), (5, 6, 8), (5, 8, 7), (1, 2, 6), (1, 6, 5), (3, 4, 8), (3, 8, 7), (1, 3, 7), (1, 7, 5), (2, 4, 8), (2, 8, 6)]


def polyg(corners, colour="BLUEx"):
    rows = "".join("\n" + " " * 29 + values(coo1=x, coo2=y) for x, y in corners)
    return "POLYG", colour, f"nb_vertex={len(corners):7d}" + rows


def polyr(corners, colour="BLUEx"):
    rows = "".join("\n" + " " * 29 + values(coo1=x, coo2=y, coo3=z) for x, y, z in corners)
    rows += "".join("\n" + " " * 29 + "  ".join(f"ver{k + 1}={vertex:7d}" for k, vertex in enumerate(face)) for face in TRIANGLES)
    return "POLYR", colour, f"nb_vertex={len(corners):7d}    nb_faces={len(TRIANGLES):7d}" + rows


class Import(RunTestCase):

    def box(self, dimension, bodies, laws, drives="", states=None, bulk=None, contacts=None):
        folder = self.fresh("DATBOX")
        gravity = (real(-G), real(0.0)) if dimension == 2 else (real(0.0), real(-G))
        files = {"BODIES.DAT": "! File BODIES\n" + bodies, "BULK_BEHAV.DAT": bulk or BULK.format(*gravity), "TACT_BEHAV.DAT": laws,
                 "DRV_DOF.DAT": "! DOF\n" + drives, "DOF.INI": states and "! DOF\n\n$steps      0                time= 0.0000000D+00\n" + states,
                 "Vloc_Rloc.INI": contacts}
        for name, text in files.items():
            if text is not None:
                write(os.path.join(folder, name), text)
        return folder

    def fresh(self, name):
        folder = os.path.join(self.scratch, f"{name}{len(os.listdir(self.scratch))}")
        os.mkdir(folder)
        return folder

    def convert(self, box, *options, step=1e-3, steps=50, status=0, **variables):
        folder = self.fresh("run")
        with alone_environment() as environment:
            done = script(IMPORT, box, "--step", step, "--steps", steps, "--out", "case", *options, directory=folder,
                          environment={**environment, **variables})
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        self.assertNotRegex(done.stdout, r"\b1 (grains|boundaries|contacts)\b")
        self.assertEqual("is not checked" in done.stderr, "GRAVIER_PROGRAM" in variables)
        return folder, done.stderr

    def run_case(self, folder):
        run = gravier("case.nml", directory=folder)
        self.assertEqual(run.status, 0, run)
        with h5py.File(os.path.join(folder, "case_results", "results.h5")) as file:
            steps = [file[f"steps/{k}"] for k in sorted(map(int, file["steps"]))]
            return [{name: data[:] for name, data in each["bodies"].items()} for each in steps], \
                   [each["boundaries/force"][:] for each in steps]

    def test_two_at_once(self):
        """Where another program writes the case, one line says which, and nothing is written; a lock that nobody holds is none."""
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx")
        box = self.box(2, body(2, 1, [0.0, 0.0], [("DISKx", "BLUEx", values(byrd=0.1))]), laws)
        folder = self.fresh("both")
        lock = os.path.join(folder, ".case.nml.lock")
        command = [sys.executable, IMPORT, box, "--step", "1e-3", "--out", "case"]

        def convert():
            return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env={**ENVIRONMENT, **os.environ})

        write(lock, "elsewhere\ngravier_import, process 77\n")
        with open(lock, "rb+") as file:
            fcntl.lockf(file, fcntl.LOCK_EX, 2, 0)
            done = convert()
            self.assertEqual(done.returncode, 2, done)
            self.assertEqual(done.stderr, "gravier_import: error: case.nml: another program writes here: gravier_import, process 77; "
                             "expected a place that no other program writes to\n")
            self.assertEqual(os.listdir(folder), [".case.nml.lock"])
        done = convert()
        self.assertEqual(done.returncode, 0, done)
        self.assertEqual(sorted(os.listdir(folder)), ["case.h5", "case.nml"])

    def test_ended_in_the_middle(self):
        """SIGTERM and ^C while the program reads the case leave no draft and no traceback."""
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx")
        box = self.box(2, body(2, 1, [0.0, 0.0], [("DISKx", "BLUEx", values(byrd=0.1))]), laws)
        for number, status in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
            folder = self.fresh("ended")
            program = write(os.path.join(folder, "slow.sh"), "#!/bin/sh\n: > started\nexec sleep 100\n")
            os.chmod(program, 0o755)
            command = [sys.executable, IMPORT, box, "--step", "1e-3", "--out", "case"]
            with subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True,
                                  env={**ENVIRONMENT, **os.environ, "GRAVIER_PROGRAM": program}) as tool:
                while tool.poll() is None and not any("started" in names for _, _, names in os.walk(folder)):
                    time.sleep(0.02)
                tool.send_signal(number)
                said = tool.communicate()[1]
            self.assertEqual((tool.returncode, said), (status, ""))
            self.assertEqual(sorted(name for name in os.listdir(folder) if "started" not in name), ["slow.sh"])

    def test_reader_that_ends(self):
        """A tool whose output nobody reads to its end says nothing of it, whether it notes so while it writes or at its end."""
        tool = "import sys; sys.path.insert(0, {!r})\nfrom one_line import run_tool\ndef main():\n    print('x' * {})\n    return 0\nrun_tool(main)\n"
        for size in (10, 10**6):
            code = tool.format(os.path.join(SOURCE, "drivers/python"), size)
            with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as writer:
                writer.stdout.close()
                said = writer.stderr.read()
                writer.stderr.close()
                self.assertEqual((writer.wait(), said), (141, ""), size)

    def test_a_settled_packing_stays_settled(self):
        """300 disks at rest, as LMGC90 would have written them (reference places and displacements, walls that are rectangles with
        round ends): they stay, and the walls bear the weight."""
        self.make_packing()
        with h5py.File(self.here("packing.h5")) as file:
            place, radius, identifier = (file[f"bodies/{name}"][:] for name in ("position", "radius", "id"))
        order = np.argsort(identifier)
        place, radius = place[order], radius[order]
        n, moved = len(radius), np.array([1e-3, -2e-3])
        bodies = "".join(body(2, k + 1, x - moved, [("DISKx", "BLUEx", values(byrd=r))]) for k, (x, r) in enumerate(zip(place, radius)))
        thick, width, height = 0.01, 0.3, 0.4
        walls = [((0.5 * width, -thick), 0.0, width), ((-thick, 0.5 * height), 0.5 * math.pi, height),
                 ((width + thick, 0.5 * height), 0.5 * math.pi, height)]
        for k, (centre, turned, half) in enumerate(walls, n + 1):
            bodies += body(2, k, [*centre, turned], [("JONCx", "WALLx", values(axe1=half, axe2=thick))])
        states = "".join(state(2, k + 1, moved, [0.0, 0.0]) for k in range(n))
        contacts = ("$steps      7                time= 0.0000000D+00\n\n$icdan  DKDKx        1\n"
                    " cdbdy  numbr  cdtac  numbr  behav  anbdy  numbr  antac  numbr  sttus   iadj\n"
                    " RBDY2      1  DISKx      1  iqsc0  RBDY2      2  DISKx      1  stick      1\n"
                    f"{' ' * 29}rlt/H 0.1000000D+00  rln/H 0.2000000D+01  rls/H 0.0000000D+00\n{' ' * 29}gapTT-0.1000000D-05\n"
                    f"{' ' * 29}n(1)= 0.0000000D+00  n(2)= 0.1000000D+01  n(3)= 0.0000000D+00\n")
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx") + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx")
        box = self.box(2, bodies, laws, "".join(still(2, n + 1 + k) for k in range(3)), states, contacts=contacts)
        folder, _ = self.convert(box)
        with open(os.path.join(folder, "case_contacts.csv"), encoding="utf-8") as file:
            self.assertEqual(file.read().splitlines()[1], "1,DISKx,2,DISKx,stick,-1e-06,2.0,0.1,0.0,0.0,1.0,0.0,0.1,2.0,0.0")
        with h5py.File(os.path.join(folder, "case.h5")) as file:
            self.assertEqual(len(file["bodies/id"]), n + 6)
            np.testing.assert_allclose(file["bodies/mass"][:n], 2500.0 * math.pi * radius**2, rtol=1e-6)
        steps, forces = self.run_case(folder)
        # 50 steps of fall would be 12 mm; 1e-3 of a radius is what the rest criterion of the sample leaves
        self.assertLess(np.abs(steps[-1]["position"] - steps[0]["position"])[:n].max(), 0.02 * radius.mean())
        weight = 2500.0 * math.pi * (radius**2).sum() * G
        self.assertLess(abs(forces[-1][:, 1].sum() + weight), 0.02 * weight)

    def make_packing(self):
        write(self.here("sample.nml"), namelist({
            "scene": {"bodies": "sample", "dimension": 2, "density": 2500.0, "friction": 0.3, "alert_distance": 2e-3},
            "sample": {"preparation": "settled", "count": 120, "radii": "uniform", "radius_min": 0.008, "radius_max": 0.012, "box": [0.3],
                       "solid_fraction": 0.5, "file": "packing.h5"},
            "time": {"step": 1e-3, "steps": 0}, "solver": {"tolerance": 1e-3, "max_iterations": 5000}}))
        done = gravier("sample.nml", directory=self.scratch, program="gravier_sample")
        self.assertEqual(done.status, 0, done)

    def test_waves(self):
        """Waves of one frequency and phase are an oscillation, for ever; what has another frequency, or a ramp, is a table."""
        bodies = body(2, 1, [0.0, 0.06], [("DISKx", "BLUEx", values(byrd=0.05))]) + body(2, 2, [0.0, 0.0], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))])
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx") + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx")
        still_along = ("vlocy", 1, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
        for spin, is_table in ((("vlocy", 3, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0), False), (("vlocy", 3, 0.0, 1e-6, 31.0, 0.7, 1.0, 0.0), True)):
            # down and up by 4 mm with 40 rad/s, which is below g, beside a rise of 0.05 m/s
            drives = drive(2, 2, [still_along, ("vlocy", 2, 0.05, 0.16, -40.0, -0.7, 1.0, 0.0), spin])
            folder, said = self.convert(self.box(2, bodies, laws, drives), steps=200)
            self.assertEqual("formulas of drives are written up to the last step" in said, is_table)
            with open(os.path.join(folder, "case.nml"), encoding="utf-8") as file:
                self.assertRegex(file.read(), r"oscillation = 0\.0, 0\.004")
            steps, _ = self.run_case(folder)
            time = 0.2
            way = 0.05 * time + 0.004 * (math.sin(40.0 * time + 0.7) - math.sin(0.7))
            np.testing.assert_allclose(steps[-1]["position"][0], [0.0, 0.06 + way], atol=1e-4)

    def test_a_drum_and_a_moving_wall(self):
        """A disk falls onto the lowest point of a drum, another rides on a plate that rises by the ramp of its drive."""
        disk = [("DISKx", "BLUEx", values(byrd=0.05))]
        bodies = body(2, 1, [0.0, -0.94], disk) + body(2, 2, [0.5, 0.06], disk) + \
            body(2, 3, [0.0, 0.0], [("xKSID", "DRUMx", values(byrd=1.0))]) + \
            body(2, 4, [0.5, 0.0], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))])
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx") + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx") \
            + SEE.format("RBDY2", "DISKx", "BLUEx", "xKSID", "DRUMx")
        rise = drive(2, 4, [("vlocy", 1, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0), ("vlocy", 2, 0.2, 0.0, 0.0, 0.0, 0.0, 10.0),
                            ("vlocy", 3, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)])
        folder, _ = self.convert(self.box(2, bodies, laws, still(2, 3) + rise), steps=200)
        steps, _ = self.run_case(folder)
        last = steps[-1]["position"]
        np.testing.assert_allclose(last[0], [0.0, -0.95], atol=1e-3)
        # velocity 0.2 min(1, 10 t): 0.01 m in the first 0.1 s and 0.02 m in the other
        np.testing.assert_allclose(last[1], [0.5, 0.06 + 0.03], atol=1e-3)

    def test_spheres_on_a_plate_in_a_cylinder(self):
        """A sphere on an inclined plate (localframe) at rest by friction; one that spins in a frame of its own; a hollow cylinder."""
        slope = 0.2
        alp, bet, gam = [math.cos(slope), 0.0, math.sin(slope)], [0.0, 1.0, 0.0], [-math.sin(slope), 0.0, math.cos(slope)]
        frame = "".join("\n" + " " * 29 + vectors(name, axis) for name, axis in (("alp", alp), ("bet", bet), ("gam", gam)))
        ball = [("SPHER", "BLUEx", values(byrd=0.05))]
        bodies = body(3, 1, list(0.06 * np.array(gam)), ball) + body(3, 2, [0.0, 0.0, 0.5], ball) + \
            body(3, 3, [0.0] * 3, [("PLANx", "WALLx", values(axe1=1.0, axe2=1.0, axe3=0.01) + "\n" + " " * 29 + "localframe" + frame)]) + \
            body(3, 4, [0.0] * 3, [("DNLYC", "DRUMx", values(High=1.0, byrd=2.0))])
        laws = LAW + "".join(SEE.format("RBDY3", "SPHER", "BLUEx", other, colour)
                             for other, colour in (("SPHER", "BLUEx"), ("PLANx", "WALLx"), ("DNLYC", "DRUMx")))
        turned = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
        states = state(3, 2, [0.1, 0.0, 0.0], [0.0, 0.0, 0.0, 3.0, 0.0, 0.0], turned)
        folder, notes = self.convert(self.box(3, bodies, laws, still(3, 3) + still(3, 4), states), steps=20)
        self.assertIn("DNLYC: the cylinder is endless", notes)
        with h5py.File(os.path.join(folder, "case.h5")) as file:
            # V(4) is about the first axis of the body, which is y of space
            np.testing.assert_allclose(file["bodies/velocity"][1], [0.0, 0.0, 0.0, 0.0, 3.0, 0.0], atol=1e-12)
            np.testing.assert_allclose(file["bodies/position"][1], [0.1, 0.0, 0.5], atol=1e-12)
        steps, _ = self.run_case(folder)
        # it rolls, with 5/7 g sin(slope) along the plate
        moved = steps[-1]["position"][0] - steps[0]["position"][0]
        self.assertLess(abs(moved @ np.array(gam)), 1e-6)
        self.assertLess(abs(moved @ np.array(alp) + 0.5 * 5.0 / 7.0 * G * math.sin(slope) * 0.02**2), 0.06 * 1.4e-3 * 0.2)
        self.assertLess(abs(steps[-1]["position"][1][2] - (0.5 - 0.5 * G * 0.02**2)), 1e-4)

    def test_a_lid_moved_by_a_force(self):
        """A lid that weighs 2 kg and is pressed down by 30 N on a disk: the ground bears all."""
        bodies = body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))]) + \
            body(2, 2, [0.0, -0.01], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))]) + \
            body(2, 3, [0.0, 0.11], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))], avrd=math.sqrt(2.0 / 2500.0 / math.pi))
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx") + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx")
        lid = drive(2, 3, [("vlocy", 1, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0), ("force", 2, -30.0, 0.0, 0.0, 0.0, 1.0, 0.0),
                           ("vlocy", 3, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)])
        for option in ([], ["--planes"]):
            folder, _ = self.convert(self.box(2, bodies, laws, still(2, 2) + lid), *option)
            _, forces = self.run_case(folder)
            weight = 2500.0 * math.pi * 0.05**2 * G
            self.assertLess(abs(forces[-1][0, 1] + 30.0 + 2.0 * G + weight), 0.01 * weight)

    def test_a_lid_that_falls(self):
        """A lid that forces move starts with its velocity of DOF.INI: it falls freely."""
        bodies = body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))]) + \
            body(2, 2, [0.0, 1.0], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))], avrd=0.1)
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx")
        lid = drive(2, 2, [("vlocy", 1, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0), ("vlocy", 3, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)])
        folder, _ = self.convert(self.box(2, bodies, laws, lid, state(2, 1, [0.0, 0.0], [0.0, 0.0]) + state(2, 2, [0.0, 0.0], [0.0, 0.3])))
        self.run_case(folder)
        with h5py.File(os.path.join(folder, "case_results", "results.h5")) as file:
            first, last = (file[f"steps/{k}/boundaries/velocity"][0, 1] for k in (0, max(map(int, file["steps"]))))
        self.assertEqual(first, 0.3)
        self.assertAlmostEqual(last, 0.3 - 50e-3 * G, places=12)

    def test_drives_of_a_file(self):
        """A file of a drive has times that rise."""
        bodies = body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))]) + \
            body(2, 2, [0.0, -0.01], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))])
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx")
        drives = still(2, 2).replace(" vlocy      1 " + " ".join(map(real, (0.0, 0.0, 0.0, 0.0, 1.0, 0.0))), " vlocy      1 evolution way.txt")
        for rows, status in (("0 2\n0.05 7\n0.1 1\n", 0), ("0.D0 2.d+0\n5.D-2 0.7D1\n1D-1 1\n", 0), ("", 2), ("0 2\n0.1 1\n0.05 7\n", 2), ("0\n1\n", 2), ("0 2\n0.1 nan\n", 2)):
            with self.subTest(rows=rows):
                box = self.box(2, bodies, laws, drives)
                write(os.path.join(box, "way.txt"), rows)
                folder, message = self.convert(box, status=status)
                if status == 0:
                    table = np.loadtxt(os.path.join(folder, "case_drive_1.csv"), delimiter=",", skiprows=2)
                    np.testing.assert_array_equal(table[:, :2], [[0.0, 2.0], [0.05, 7.0], [0.1, 1.0]])
                else:
                    self.assertIn("way.txt: expected two columns of finite numbers, times that rise and values", message)

    def test_laws_by_wall(self):
        """A wall has its own law: RST_CLB on the ground, IQS_CLB between disks."""
        disk = body(2, 1, [0.0, 0.06], [("DISKx", "BLUEx", values(byrd=0.05))])
        # as public files have it
        disk = disk.replace(values(gyrd=0.0), values(gyrd=0.05 * 0.70706))
        bodies = disk + body(2, 2, [0.0, -0.01], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))])
        bounce = LAW.replace("IQS_CLB", "RST_CLB").replace("iqsc0", "rstc0") + " " * 40 + values(rstn=0.5, rstt=0.25) + "\n"
        laws = LAW + bounce + SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx") + \
            SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx").replace("iqsc0", "rstc0")
        folder, _ = self.convert(self.box(2, bodies, laws, still(2, 2)), "--planes", steps=100)
        self.assertIn("&law\n  materials = 'BLUEx', 'WALLx'\n  kind = 'coulomb'\n  friction = 0.3\n  restitution = 0.5\n"
                      "  tangential_restitution = 0.25\n/\n", self.case_of(folder))
        self.assertIn("&law\n  materials = 'BLUEx'\n  kind = 'coulomb'\n  friction = 0.3\n/\n", self.case_of(folder))
        steps, _ = self.run_case(folder)
        # it falls by 1 cm, with 0.443 m/s after 45 ms, and comes up by a quarter of that
        self.assertLess(abs(max(state["position"][0, 1] for state in steps[6:]) - 0.0525), 4e-4)

    def case_of(self, folder):
        with open(os.path.join(folder, "case.nml"), encoding="utf-8") as file:
            return file.read()

    def on_ground(self, laws, disks):
        """Disks of radius 5 cm, each (place, colour), above a ground that each colour meets by the law `iqsc0`, as planes."""
        shapes = [body(2, k, place, [("DISKx", colour, values(byrd=0.05))]) for k, (place, colour) in enumerate(disks, 1)]
        shapes.append(body(2, len(disks) + 1, [0.0, -0.01], [("JONCx", "WALLx", values(axe1=2.0, axe2=0.01))]))
        walls = "".join(SEE.format("RBDY2", "DISKx", colour, "JONCx", "WALLx") for colour in sorted({colour for _, colour in disks}))
        box = self.box(2, "".join(shapes), LAW + laws + walls, still(2, len(disks) + 1))
        return self.convert(box, "--planes")

    def see(self, name, one="BLUEx", other="BLUEx"):
        return SEE.format("RBDY2", "DISKx", one, "DISKx", other).replace("iqsc0", name)

    def law(self, name, kind, *lines):
        return f"$behav  lawty\n {name}  {kind:30s}  " + ("\n" + " " * 40).join(values(**line) for line in lines) + "\n"

    def test_a_wall_of_polygons_stays(self):
        """Bricks in running bond on a driven base that is a polygon too, all as POLYG with displacements: the wall stays, masses are those of
        the bricks or of avrd, and equal bricks share a shape."""
        brick, half = ([(x, y) for x, y in ((-a, -0.04), (a, -0.04), (a, 0.04), (-a, 0.04))] for a in (0.1, 0.05))
        moved, rows = np.array([2e-3, -1e-3]), []
        for course in range(4):
            line = [(brick, 0.1 + 0.2 * k) for k in range(4)]
            if course % 2:
                line = [(half, 0.05), *((brick, 0.2 + 0.2 * k) for k in range(3)), (half, 0.75)]
            rows += [(corner, np.array([x, 0.04 + 0.08 * course])) for corner, x in line]
        bodies = "".join(body(2, k, place - moved, [polyg(corner)], avrd=0.1 if k == 1 else 0.0) for k, (corner, place) in enumerate(rows, 1))
        n = len(rows)
        bodies += body(2, n + 1, [0.4, -0.05], [polyg([(-0.6, -0.05), (0.6, -0.05), (0.6, 0.05), (-0.6, 0.05)])])
        laws = LAW + SEE.format("RBDY2", "POLYG", "BLUEx", "POLYG", "BLUEx")
        box = self.box(2, bodies, laws, still(2, n + 1), "".join(state(2, k + 1, moved, [0.0, 0.0]) for k in range(n)))
        folder, notes = self.convert(box)
        self.assertIn("corners and edges of polygons and polyhedra are round here", notes)
        with open(os.path.join(folder, "case.shapes"), encoding="utf-8") as file:
            self.assertEqual(file.read().count("shape POLYG_"), 3)
        with h5py.File(os.path.join(folder, "case.h5")) as file:
            areas = [0.2 * 0.08 if corner is brick else 0.1 * 0.08 for corner, _ in rows]
            areas[0] = math.pi * 0.1**2
            np.testing.assert_allclose(file["bodies/mass"][:n], 2500.0 * np.array(areas), rtol=1e-6)
            np.testing.assert_allclose(file["bodies/position"][:n], [place for _, place in rows], atol=1e-8)
        steps, _ = self.run_case(folder)
        self.assertLess(np.abs(steps[-1]["position"] - steps[0]["position"]).max(), 2e-5)
        self.assertLess(np.abs(steps[-1]["orientation"] - steps[0]["orientation"]).max(), 1e-4)

    def test_polygons_and_clusters_fall_free(self):
        """Places, turns and spins of bodies in the air; the place is that of the centre of mass. Shapes have the area of their contactors."""
        wedge = [(0.0, 0.0), (0.0, 0.3), (0.6, 0.0)]
        ell = [polyg([(0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.0, 0.1)]), polyg([(0.0, 0.1), (0.1, 0.1), (0.1, 0.2), (0.0, 0.2)])]
        bodies = body(2, 1, [0.0, 1.0, 0.5], [polyg(wedge)]) + body(2, 2, [2.0, 1.0], ell) + \
            body(2, 3, [4.0, 1.0, 0.2], [("POLYG", "BLUEx", polyg([(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)])[2])]) + \
            body(2, 4, [0.0, -1.0], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))])
        laws = LAW + SEE.format("RBDY2", "POLYG", "BLUEx", "POLYG", "BLUEx") + SEE.format("RBDY2", "POLYG", "BLUEx", "JONCx", "WALLx")
        folder, notes = self.convert(self.box(2, bodies, laws, still(2, 4), state(2, 3, [0.0, 0.0, 0.1], [1.0, 2.0, 3.0])), steps=20)
        self.assertIn("body 1: its place is the centre of mass of its contactors", notes)
        steps, _ = self.run_case(folder)
        first, last = steps[0], steps[-1]
        # the node of a body with one contactor is shifted before it is turned
        centre = np.array([[0.2, 1.1], [2.0 + (0.03 * 0.15 + 0.01 * 0.05) / 0.04, 1.0 + (0.03 * 0.05 + 0.01 * 0.15) / 0.04],
                           [4.0, 1.0]])
        np.testing.assert_allclose(first["position"][:3], centre, atol=1e-9)
        np.testing.assert_allclose(first["orientation"][:3, 0], [0.5, 0.0, 0.3], atol=1e-9)
        np.testing.assert_allclose(first["mass"][:3], 2500.0 * np.array([0.09, 0.04, 0.04]), rtol=1e-9)
        np.testing.assert_allclose(last["orientation"][2, 0], 0.3 + 3.0 * 0.02, atol=1e-9)
        np.testing.assert_allclose(last["position"][2], [4.0 + 0.02, 1.0 + 2.0 * 0.02 - 0.5 * G * 0.02**2], atol=1e-6)

    def test_state_of_bodies_whose_node_is_not_their_centre(self):
        """DOF.INI moves and turns a body with one contactor about its centre of mass, to which LMGC90 shifts the node, and one with several about
        its node, whose velocity is not that of the centre. They fly on as they are: the corner that stands where DOF.INI says has the velocity of a rigid body."""
        wedge = [(0.0, 0.0), (0.6, 0.0), (0.0, 0.3)]
        ell = [polyg([(0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.0, 0.1)]), polyg([(0.0, 0.1), (0.1, 0.1), (0.1, 0.2), (0.0, 0.2)])]
        bodies = body(2, 1, [0.0, 1.0, 0.2], [polyg(wedge)]) + body(2, 2, [2.0, 1.0], ell) + \
            body(2, 3, [0.0, -1.0], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))])
        laws = LAW + SEE.format("RBDY2", "POLYG", "BLUEx", "POLYG", "BLUEx") + SEE.format("RBDY2", "POLYG", "BLUEx", "JONCx", "WALLx")
        states = state(2, 1, [0.01, 0.02, 0.3], [1.0, 0.0, 2.0]) + state(2, 2, [0.01, 0.02, 0.3], [1.0, 0.0, 2.0])
        folder, _ = self.convert(self.box(2, bodies, laws, still(2, 3), states), steps=1)
        steps, _ = self.run_case(folder)
        arm = np.array([(0.03 * 0.15 + 0.01 * 0.05) / 0.04, (0.03 * 0.05 + 0.01 * 0.15) / 0.04])
        c, s = math.cos(0.3), math.sin(0.3)
        arm = np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])
        np.testing.assert_allclose(steps[0]["position"][:2], [[0.2 + 0.01, 1.1 + 0.02], [2.01 + arm[0], 1.02 + arm[1]]], atol=1e-9)
        np.testing.assert_allclose(steps[0]["orientation"][:2, 0], [0.5, 0.3], atol=1e-9)
        np.testing.assert_allclose(steps[0]["velocity"][:2], [[1.0, 0.0, 2.0], [1.0 - 2.0 * arm[1], 2.0 * arm[0], 2.0]], atol=1e-9)

    def test_disks_in_one_body(self):
        """Two disks and a free JONCx on a ground: a dumb-bell keeps its length and comes to rest on both disks, a stadium on its side."""
        pair = [("DISKx", "BLUEx", values(byrd=0.05) + "  " + values(coo1=x, coo2=0.0)) for x in (-0.06, 0.06)]
        bodies = body(2, 1, [0.0, 0.06], pair) + body(2, 2, [0.0, -0.01], [("JONCx", "WALLx", values(axe1=1.0, axe2=0.01))]) + \
            body(2, 3, [0.5, 0.03], [("JONCx", "BLUEx", values(axe1=0.1, axe2=0.02))])
        things = ("DISKx", "JONCx")
        laws = LAW + "".join(SEE.format("RBDY2", one, "BLUEx", other, "BLUEx") for one, other in (("DISKx", "DISKx"), ("DISKx", "JONCx"),
                                                                                                    ("JONCx", "JONCx")))
        laws += "".join(SEE.format("RBDY2", one, "BLUEx", "JONCx", "WALLx") for one in things)
        folder, notes = self.convert(self.box(2, bodies, laws, still(2, 2)), steps=200)
        self.assertIn("body 3 JONCx: nothing drives it, it moves freely", notes)
        steps, forces = self.run_case(folder)
        np.testing.assert_allclose(steps[-1]["position"][:2, 1], [0.05, 0.02], atol=1e-4)
        np.testing.assert_allclose(steps[-1]["orientation"][:2], 0.0, atol=1e-3)
        masses = 2500.0 * np.array([2.0 * math.pi * 0.05**2, math.pi * 0.02**2 + 0.2 * 0.04])
        np.testing.assert_allclose(steps[0]["mass"][:2], masses, rtol=1e-6)
        self.assertLess(abs(forces[-1][:, 1].sum() + masses.sum() * G), 0.01 * masses.sum() * G)

    def test_polyhedra(self):
        """Two cubes of POLYR, one turned by its frame, on a driven one, and a cluster of spheres: they stay; a hull with a dent is refused."""
        bodies = body(3, 1, [0.0, 0.0, 0.1], [polyr(CUBE)]) + body(3, 2, [0.0, 0.0, 0.3], [polyr(CUBE)]) + \
            body(3, 3, [0.0, 0.0, -0.1], [polyr(CUBE * [5.0, 5.0, 1.0])])
        laws = LAW + SEE.format("RBDY3", "POLYR", "BLUEx", "POLYR", "BLUEx")
        turned = [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]
        states = state(3, 2, [0.0, 0.0, 0.0], [0.0] * 6, turned)
        folder, _ = self.convert(self.box(3, bodies, laws, still(3, 3), states), steps=100)
        steps, _ = self.run_case(folder)
        np.testing.assert_allclose(steps[0]["mass"][:2], 2500.0 * 0.008, rtol=1e-9)
        np.testing.assert_allclose(steps[0]["orientation"][1], [math.sqrt(0.8), 0.0, 0.0, math.sqrt(0.2)], atol=1e-9)
        self.assertLess(np.abs(steps[-1]["position"] - steps[0]["position"]).max(), 2e-5)
        self.assertLess(np.abs(steps[-1]["orientation"] - steps[0]["orientation"]).max(), 1e-4)
        balls = body(3, 1, [0.0, 0.0, 0.5], [("SPHER", "BLUEx", values(byrd=0.05) + "  " + values(coo1=x, coo2=0.0, coo3=0.0))
                                             for x in (-0.05, 0.05)])
        see = LAW + SEE.format("RBDY3", "SPHER", "BLUEx", "SPHER", "BLUEx")
        folder, _ = self.convert(self.box(3, balls, see), steps=20)
        steps, _ = self.run_case(folder)
        self.assertLess(abs(steps[-1]["position"][0, 2] - (0.5 - 0.5 * G * 0.02**2)), 1e-6)
        dented = CUBE.copy()
        dented[7] *= 0.5
        inertia = bodies.replace("gyrd= 0.0000000D+00", "gyrd= 0.0000000D+00\n" + " " * 29 + values(I1=1.0, I2=1.0, I3=2.0), 1)
        hole = bodies.replace("nb_faces=     12", "nb_faces=     11", 1).replace("ver1=      1  ver2=      2  ver3=      4\n", "", 1)
        for text, words in ((body(3, 1, [0.0] * 3, [polyr(dented)]), ("POLYR that is not convex",)),
                            (inertia, ("moments of inertia as 0.5, 0.5, 1: expected as 1, 1, 1",)),
                            (hole, ("leave a hole",)),
                            (bodies.replace("ver3=      4", "ver3=      9", 1), ("a face whose vertices there are not",))):
            folder, message = self.convert(self.box(3, text, laws, states=states if text is inertia else None), status=2)
            self.assertEqual(message.count("\n"), 1)
            for word in words:
                self.assertIn(word, message)
            self.assertEqual(os.listdir(folder), [])

    def test_lines_as_older_files_have_them(self):
        """A PLANx whose half axes are called coo1, coo2 and coor, POLYR with nb_face= and coor=, places of DISKb and SPHEb on a line of their own,
        comments between the lines: LMGC90 reads values by their places."""
        plan = body(3, 1, [0.0, 0.0, -0.05], [("PLANx", "BLUEx", values(coo1=1.0, coo2=2.0, coor=0.05))])
        cube = body(3, 2, [0.0, 0.0, 0.1], [polyr(CUBE)]).replace("nb_faces=", "nb_face=").replace("coo3=", "coor=")
        cube = cube.replace("coor=", "coo3=", 1)  # the node
        pair = body(3, 3, [0.6, 0.0, 0.05], [("SPHEb", "BLUEx", values(byrd=0.05) + "\n" + " " * 29 + values(coo1=x, coo2=0.0, coo3=0.0))
                                             for x in (-0.05, 0.05)]).replace("$tacty", "! a comment\n$tacty")
        laws = LAW + "".join(SEE.format("RBDY3", one, "BLUEx", other, "BLUEx") for one, other in (("POLYR", "POLYR"), ("POLYR", "PLANx"),
                                                                                                    ("SPHER", "PLANx")))
        folder, notes = self.convert(self.box(3, plan + cube + pair, laws, still(3, 1)), steps=50)
        self.assertIn("POLYR BLUEx does not see SPHER BLUEx: they pass through each other", notes)
        with open(os.path.join(folder, "case.nml"), encoding="utf-8") as file:
            text = file.read()
        self.assertIn("edge_a = 2.0, 0.0, 0.0\n  edge_b = 0.0, 4.0, 0.0", text)
        self.assertEqual(text.count("kind = 'none'"), 2)
        steps, _ = self.run_case(folder)
        np.testing.assert_allclose(steps[-1]["position"][:2, 2], [0.1, 0.05], atol=1e-4)
        np.testing.assert_allclose(steps[0]["mass"][:2], 2500.0 * np.array([0.008, 8.0 / 3.0 * math.pi * 0.05**3]), rtol=1e-6)

    def test_a_polygon_and_disks_in_one_body(self):
        """A POLYG with two DISKb, which see the same, is one body of one material; lines that differ are refused; --homogeneous takes the inertia
        and the centre of mass of the shape at the given mass."""
        square = polyg([(-0.1, -0.04), (0.1, -0.04), (0.1, 0.04), (-0.1, 0.04)])
        disks = [("DISKb", "BLUEx", values(byrd=0.04) + "\n" + " " * 29 + values(coo1=x, coo2=0.0)) for x in (-0.1, 0.1)]
        bodies = body(2, 1, [0.0, 0.04], [square, *disks]) + body(2, 2, [0.0, -0.01], [("JONCx", "WALLx", values(ax1=1.0, ax2=0.01))])
        pairs = [("POLYG", "POLYG", "BLUEx"), ("DISKx", "DISKx", "BLUEx"), ("DISKx", "POLYG", "BLUEx"), ("POLYG", "JONCx", "WALLx"),
                 ("DISKx", "JONCx", "WALLx")]
        lines = [SEE.format("RBDY2", one, "BLUEx", other, colour) for one, other, colour in pairs]
        folder, _ = self.convert(self.box(2, bodies, LAW + "".join(lines), still(2, 2)), steps=100)
        path = os.path.join(folder, "case.nml")
        # forces of 50 steps add up to the weight but for the change of the momentum, by accuracy/50 of the weight
        with open(path, "a", encoding="utf-8") as file:
            file.write("&solver accuracy = 0.01 /\n")
        steps, forces = self.run_case(folder)
        weight = 2500.0 * (0.2 * 0.08 + 2.0 * math.pi * 0.04**2) * G
        np.testing.assert_allclose(steps[-1]["position"][0], [0.0, 0.04], atol=1e-4)
        mean = np.mean([force[:, 1].sum() for force in forces[len(forces) // 2:]])
        self.assertLess(abs(mean + weight), 1e-3 * weight)
        _, message = self.convert(self.box(2, bodies, LAW + "".join(lines[:-1]), still(2, 2)), status=2)
        self.assertIn("contactors POLYG BLUEx and DISKx BLUEx of one body that do not see the same under one law", message)
        odd = body(2, 1, [0.0, 0.3], [polyg([(0.0, 0.0), (0.3, 0.0), (0.0, 0.3)])], avrd=0.1).replace("gyrd= 0.0000000D+00", "gyrd= 0.5000000D+00")
        box = self.box(2, odd + bodies[bodies.index("$bdyty", 1):], LAW + lines[0] + lines[3], still(2, 2))
        self.assertIn("or --homogeneous", self.convert(box, status=2)[1])
        folder, notes = self.convert(box, "--homogeneous", steps=10)
        self.assertIn("1 bodies have the inertia and the centre of mass of their shapes here", notes)
        steps, _ = self.run_case(folder)
        np.testing.assert_allclose(steps[0]["position"][0], [0.1, 0.4], atol=1e-9)
        self.assertAlmostEqual(steps[0]["mass"][0], 2500.0 * math.pi * 0.1**2, delta=1e-6)

    def test_what_does_not_see_each_other(self):
        """Disks of a colour that no line pairs with itself fall through each other and lie on the ground that they see."""
        bodies = body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))]) + body(2, 2, [0.0, 0.16], [("DISKx", "BLUEx", values(byrd=0.05))]) + \
            body(2, 3, [0.0, -0.01], [("JONCx", "WALLx", values(axe1=1.0, axe2=0.01))])
        box = self.box(2, bodies, LAW.replace("IQS_CLB   ", "IQS_CLB_g0") + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx"), still(2, 3))
        self.assertIn("law IQS_CLB_g0, whose gaps count from those of the start: expected --drop-g0", self.convert(box, status=2)[1])
        folder, notes = self.convert(box, "--drop-g0", steps=200)
        self.assertIn("DISKx BLUEx does not see DISKx BLUEx: they pass through each other", notes)
        self.assertIn("law iqsc0 IQS_CLB_g0: gaps count from contact here", notes)
        steps, _ = self.run_case(folder)
        np.testing.assert_allclose(steps[-1]["position"][:2, 1], 0.05, atol=1e-4)

    def test_materials_of_colours(self):
        """Two colours, laws by pairs: each slides by the friction of its pair on a driven body of both colours."""
        laws = self.law("iqsc1", "IQS_CLB", {"fric": 0.1}) + self.see("iqsc0") + self.see("iqsc1", "REDxx", "REDxx") + \
            self.see("iqsc1", "REDxx", "BLUEx")
        folder, _ = self.on_ground(laws, [([0.0, 0.05], "BLUEx"), ([0.5, 0.05], "REDxx")])
        case = self.case_of(folder)
        self.assertEqual([case.count(f"&{group}\n") for group in ("material", "law", "boundary")], [3, 5, 1])
        self.assertIn("  materials = 'BLUEx', 'REDxx'\n  kind = 'coulomb'\n  friction = 0.1\n", case)
        with h5py.File(os.path.join(folder, "case.h5")) as file:
            self.assertEqual(list(file["bodies/material"]), [1, 2])
        # each on its like, which goes faster than friction, 0.3 and 0.1 of a weight in a step, can carry along; in half a step the normal
        # turns by 0.02 m/s 0.5 ms/0.1 m = 1e-4, as much of the weight, 1e-3 of the friction
        slab = [("DISKx", "BLUEx", values(byrd=0.05) + "  " + values(coo1=-0.5, coo2=0.0)),
                ("DISKx", "REDxx", values(byrd=0.05) + "  " + values(coo1=0.5, coo2=0.0))]
        bodies = body(2, 1, [-0.5, 0.1], [("DISKx", "BLUEx", values(byrd=0.05))]) + \
            body(2, 2, [0.5, 0.1], [("DISKx", "REDxx", values(byrd=0.05))]) + body(2, 3, [0.0, 0.0], slab)
        moving = drive(2, 3, [("vlocy", 1, 0.02, 0.0, 0.0, 0.0, 1.0, 0.0)] + [("vlocy", k, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0) for k in (2, 3)])
        folder, _ = self.convert(self.box(2, bodies, LAW + laws, moving), steps=1)
        steps, _ = self.run_case(folder)
        np.testing.assert_allclose(steps[-1]["velocity"][:2, 0], [0.3 * G * 1e-3, 0.1 * G * 1e-3], rtol=3e-3)

    def test_static_and_dynamic_friction(self):
        """IQS_DS_CLB: one coefficient is Coulomb's; two want the slip over which friction falls, and a fast disk is under the dynamic one."""
        ground = LAW.replace("IQS_CLB ", "IQS_DS_CLB").replace("fric= 0.3000000D+00", values(dyfr=0.2, stfr=0.5)) + self.see("iqsc0")
        slides = state(2, 1, [0.0, 0.0], [1.0, 0.0])
        box = self.box(2, body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))])
                       + body(2, 2, [0.0, -0.01], [("JONCx", "WALLx", values(axe1=2.0, axe2=0.01))]),
                       ground + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx"), still(2, 2), slides)
        _, message = self.convert(box, status=2)
        self.assertIn("TACT_BEHAV.DAT: line 2: law IQS_DS_CLB with stfr= 0.5 and dyfr= 0.2: expected --slip V", message)
        folder, _ = self.convert(box, "--planes", "--slip", "1e-3", steps=20)
        self.assertIn("  kind = 'velocity'\n  static_friction = 0.5\n  dynamic_friction = 0.2\n  slip_scale = 0.001\n", self.case_of(folder))
        steps, _ = self.run_case(folder)
        self.assertLess(abs(steps[-1]["velocity"][0, 0] - (1.0 - 0.2 * G * 0.02)), 1e-4)
        # names as LMGC90 itself writes them, in full and in four letters
        four = self.law("dsclb", "IQS_WET_DS_CLB", {"cohen": 1.0, "cohet": 0.0}, {"Weth": 1e-3}, {"dfrc": 0.2, "sfrc": 0.2})
        folder, _ = self.on_ground(four + self.see("dsclb"), [([0.0, 0.05], "BLUEx")])
        self.assertIn("  kind = 'adhesive'\n  friction = 0.2\n  adhesion = 1.0\n  adhesion_range = 0.001\n", self.case_of(folder))
        equal = self.law("dsclb", "RST_DS_CLB", {"restn": 0.4, "restt": 0.0}, {"dfric": 0.2, "sfric": 0.2})
        folder, _ = self.on_ground(equal + self.see("dsclb"), [([0.0, 0.05], "BLUEx")])
        self.assertIn("  kind = 'coulomb'\n  friction = 0.2\n  restitution = 0.4\n", self.case_of(folder))

    def hanging(self, law, weights):
        """A disk under a driven one, with a force of so many weights between them at most; how far it falls in 50 steps of 1 ms."""
        weight = 2500.0 * math.pi * 0.05**2 * G
        top, low = (body(2, k, [0.0, y], [("DISKx", "BLUEx", values(byrd=0.05))]) for k, y in ((2, 0.0), (1, -0.1)))
        folder, notes = self.convert(self.box(2, low + top, law(weights * weight) + self.see("cohes"), still(2, 2)))
        steps, _ = self.run_case(folder)
        return steps[0]["position"][0, 1] - steps[-1]["position"][0, 1], self.case_of(folder), notes

    def test_adhesion(self):
        """IQS_WET_DS_CLB holds what is lighter than cohn, within Wthk."""
        def law(force):
            return self.law("cohes", "IQS_WET_DS_CLB", {"cohn": force, "coht": 0.0}, {"Wthk": 1e-3}, {"dyfr": 0.3, "stfr": 0.3})
        held, case, _ = self.hanging(law, 1.1)
        self.assertIn("  kind = 'adhesive'\n  friction = 0.3\n", case)
        self.assertIn("  adhesion_range = 0.001\n", case)
        self.assertLess(abs(held), 1e-6)
        self.assertGreater(self.hanging(law, 0.9)[0], 1e-4)

    def test_bonds(self):
        """IQS_MOHR_DS_CLB: cohn times R* = 25 mm is the strength, coht/cohn the friction of the bond."""
        def law(force):
            stress = force / 0.025
            return self.law("cohes", "IQS_MOHR_DS_CLB", {"cohn": stress, "coht": 0.5 * stress}, {"dyfr": 0.3, "stfr": 0.3})
        held, case, notes = self.hanging(law, 1.1)
        self.assertIn("  kind = 'bonded'\n  friction = 0.3\n", case)
        self.assertIn("  bond_friction = 0.5\n  bond_distance = 0.002\n", case)
        self.assertIn("note: law cohes IQS_MOHR_DS_CLB: bodies bonded across a gap keep it", notes)
        self.assertLess(abs(held), 1e-6)
        self.assertGreater(self.hanging(law, 0.9)[0], 5e-3)

    def contact(self, kind, law, status, lines):
        """A Vloc_Rloc.INI with one contact of bodies 1 and 2, as LMGC90 writes it: a number has its sign next to its name."""
        shape, between = ("DISKx", "") if kind == "DKDKx" else ("SPHER", " " * 7)
        text = "\n".join(" " * 29 + "  ".join(f"{name}{real(x)}" for name, x in line.items()) for line in lines)
        rigid = "RBDY2" if kind == "DKDKx" else "RBDY3"
        return (f"$steps      7                time= 0.0000000D+00\n\n$icdan  {kind}        1\n cdbdy  numbr  cdtac  numbr  behav  anbdy\n"
                f" {rigid}      1  {shape}      1{between}  {law}  {rigid}      2  {shape}      1  {status}      2\n{text}\n")

    def test_forces_of_contacts_along_the_axes_of_space(self):
        """In 3D the frame (s, t, n) of a contact stands in the file, after the gap `gTT =`; in 2D t = (n2, -n1)."""
        laws = LAW + SEE.format("RBDY3", "SPHER", "BLUEx", "SPHER", "BLUEx")
        bodies = "".join(body(3, k, place, [("SPHER", "BLUEx", values(byrd=0.05))]) for k, place in ((1, [0.06, 0.0, 0.08]), (2, [0.0] * 3)))
        axes = {"s": [0.0, 1.0, 0.0], "t": [0.8, 0.0, -0.6], "n": [0.6, 0.0, 0.8]}
        lines = [{"rls/H": 3.0, "rlt/H": -0.5, "rln/H": 10.0}, {"vls =": 0.0, "vlt =": 0.1, "vln =": 0.0}, {"gTT =": -1e-6}]
        lines += [{f"{name}({k})=": x for k, x in enumerate(axis, 1)} for name, axis in axes.items()]
        folder, _ = self.convert(self.box(3, bodies, laws, contacts=self.contact("SPSPx", "iqsc0", "slide", lines)))
        with open(os.path.join(folder, "case_contacts.csv"), encoding="utf-8") as file:
            head, row = file.read().splitlines()
        self.assertEqual(head.split(",")[-7:], ["force_s", "nx", "ny", "nz", "fx", "fy", "fz"])
        self.assertTrue(row.startswith("1,SPHER,2,SPHER,slide,-1e-06,10.0,-0.5,3.0,0.6,0.0,0.8,"), row)
        np.testing.assert_allclose([float(cell) for cell in row.split(",")[-3:]], [6.0 - 0.4, 3.0, 8.0 + 0.3], rtol=1e-12)

    def test_forces_that_cannot_be_read(self):
        """A contact without a normal force or a normal, or with one that is no number, is refused: it is no contact without force."""
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx")
        bodies = "".join(body(2, k, [0.1 * k, 0.0], [("DISKx", "BLUEx", values(byrd=0.05))]) for k in (1, 2))
        lines = [{"rlt/H": 0.0, "rln/H": 1.0, "rls/H": 0.0}, {"n(1)=": -1.0, "n(2)=": 0.0, "n(3)=": 0.0}]
        good = self.contact("DKDKx", "iqsc0", "stick", lines)
        self.convert(self.box(2, bodies, laws, contacts=good))
        for change, name in (((f"rln/H{real(1.0)}", "rln/H NaN"), "rln/H"), ((f"rln/H{real(1.0)}", ""), "rln/H"), (("n(2)=", "m(2)="), "n2")):
            with self.subTest(change=change):
                self.assertIn(change[0], good)
                folder, message = self.convert(self.box(2, bodies, laws, contacts=good.replace(*change)), status=2)
                self.assertIn(f"Vloc_Rloc.INI: line 5: {name}= is missing: expected a value", message)
                self.assertEqual(os.listdir(folder), [])

    def test_a_broken_bond_is_refused(self):
        """LMGC90 bonds at its first step what it does not know; a contact that Vloc_Rloc.INI has, it takes as it is."""
        laws = self.law("cohes", "IQS_MOHR_DS_CLB", {"cohn": 10.0, "coht": 5.0}, {"dyfr": 0.3, "stfr": 0.3}) + self.see("cohes")
        bodies = "".join(body(2, k, [0.1 * k, 0.0], [("DISKx", "BLUEx", values(byrd=0.05))]) for k in (1, 2))
        lines = [{"rlt/H": 0.0, "rln/H": 1.0, "rls/H": 0.0}, {"n(1)=": -1.0, "n(2)=": 0.0, "n(3)=": 0.0}]
        self.convert(self.box(2, bodies, laws, contacts=self.contact("DKDKx", "cohes", "Mstck", lines)))
        _, message = self.convert(self.box(2, bodies, laws, contacts=self.contact("DKDKx", "cohes", "slifw", lines)), status=2)
        self.assertIn("Vloc_Rloc.INI: line 5: bodies 1 and 2 with status slifw, whose bond is broken: expected Mstck", message)

    def test_laws_that_mean_another_thing_are_refused(self):
        two, one = {"dyfr": 0.2, "stfr": 0.5}, {"dyfr": 0.3, "stfr": 0.3}
        cohesion = {"cohn": 10.0, "coht": 5.0}
        cases = [
            (self.law("cohes", "IQS_WET_DS_CLB", cohesion, {"Wthk": 1e-3}, two), 0.05, "law IQS_WET_DS_CLB with stfr= 0.5 and dyfr= 0.2"),
            (self.law("cohes", "IQS_MOHR_DS_CLB", cohesion, two), 0.05, "law IQS_MOHR_DS_CLB with stfr= 0.5 and dyfr= 0.2"),
            (self.law("cohes", "IQS_MOHR_DS_CLB", {"cohn": 0.0, "coht": 5.0}, one), 0.05, "law IQS_MOHR_DS_CLB with cohn= 0 and coht= 5"),
            (self.law("cohes", "IQS_MOHR_DS_CLB", cohesion, one), 0.06, "law IQS_MOHR_DS_CLB between several radii"),
            (self.law("cohes", "xQS_WET_DS_CLB", cohesion, {"Wthk": 1e-3}, one), 0.05, "law xQS_WET_DS_CLB: expected one of IQS_CLB"),
        ]
        for law, radius, words in cases:
            with self.subTest(words=words):
                bodies = body(2, 1, [0.0, 0.0], [("DISKx", "BLUEx", values(byrd=0.05))]) + \
                    body(2, 2, [1.0, 0.0], [("DISKx", "BLUEx", values(byrd=radius))])
                folder, message = self.convert(self.box(2, bodies, law + self.see("cohes")), status=2)
                self.assertIn("TACT_BEHAV.DAT: line 2: " + words, message)
                self.assertEqual(os.listdir(folder), [])
        drum = SEE.format("RBDY2", "DISKx", "BLUEx", "xKSID", "DRUMx").replace("iqsc0", "cohes")
        bodies = body(2, 1, [0.0, 0.0], [("DISKx", "BLUEx", values(byrd=0.05))]) + body(2, 2, [0.0, 0.0], [("xKSID", "DRUMx", values(byrd=1.0))])
        laws = self.law("cohes", "IQS_MOHR_DS_CLB", cohesion, one) + LAW + self.see("iqsc0") + drum
        _, message = self.convert(self.box(2, bodies, laws, still(2, 2)), status=2)
        self.assertIn("law IQS_MOHR_DS_CLB of DISKx and xKSID: expected disks or spheres, JONCx and PLANx", message)
        glued = body(2, 1, [0.0, 0.0], [("DISKx", "BLUEx", values(byrd=0.05))]) + body(2, 2, [1.0, 0.0], [("DISKx", "REDxx", values(byrd=0.05))])
        _, message = self.convert(self.box(2, glued, LAW + self.see("iqsc0"), still(2, 2)))
        self.assertIn("body 2 DISKx: no grain sees it, left out", message)

    def test_what_would_fall_through_is_refused(self):
        """Bodies that forces move become boundaries, which pass through each other: refused where LMGC90 has them meet another driven body, and
        where no body without drives sees them."""
        ball = [("DISKx", "BLUEx", values(byrd=0.05))]
        ground = [("JONCx", "WALLx", values(axe1=1.0, axe2=0.01))]
        bodies = body(2, 1, [0.0, 0.05], ball) + body(2, 2, [0.5, 0.05], ball) + body(2, 3, [0.0, -0.01], ground)
        on_ground = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx")
        each_other = SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx")
        pulled = drive(2, 1, [("force", 1, 20.0, 0.0, 0.0, 0.0, 1.0, 0.0), ("vlocy", 3, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)])
        turns = drive(2, 1, [("force", 1, 20.0, 0.0, 0.0, 0.0, 1.0, 0.0)])
        for drives, laws, words in (
                (pulled, on_ground, "TACT_BEHAV.DAT: line 5: body 1 (DISKx), which forces move, sees body 3 (JONCx), which has drives too: expected vlocy 1 to 2 of body 1"),
                (turns, LAW + each_other, "body 1 (DISKx) turns freely: expected vlocy 3"),
                (pulled, LAW + SEE.format("RBDY2", "DISKx", "REDxx", "JONCx", "WALLx"), "body 1 (DISKx) is moved by forces and no body without drives sees it: expected vlocy 1 to 2")):
            with self.subTest(words=words):
                folder, message = self.convert(self.box(2, bodies, laws, still(2, 3) + drives), status=2)
                self.assertIn(words, message)
                self.assertEqual(os.listdir(folder), [])
        # a lid that meets grains alone is one as ever
        self.convert(self.box(2, bodies, LAW + each_other, still(2, 3) + pulled))

    def test_states_that_are_not_those_of_the_bodies(self):
        """A file of states that lacks bodies is told of, and one that has a body twice is refused."""
        bodies = body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))]) + body(2, 2, [0.5, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))])
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx")
        one = state(2, 1, [0.1, 0.0], [0.0, 0.0])
        _, notes = self.convert(self.box(2, bodies, laws, "", one))
        self.assertIn("note: DOF.INI has 1 of the 2 bodies: the others are at rest where BODIES.DAT has them\n", notes)
        _, notes = self.convert(self.box(2, bodies, laws, "", one + state(2, 2, [0.0, 0.0], [0.0, 0.0])))
        self.assertNotIn("of the 2 bodies", notes)
        _, message = self.convert(self.box(2, bodies, laws, "", one + state(2, 1, [0.2, 0.0], [0.0, 0.0])), status=2)
        self.assertRegex(message, r"DOF\.INI: line \d+: a second state of body 1, after that of line \d+: expected one state of a body")

    def test_a_plate_that_turns_in_its_frame(self):
        """A plate whose frame stands in BODIES.DAT turns about its own axes, as LMGC90 has it without DOF.INI."""
        frame = "".join("\n" + " " * 29 + vectors(name, axis) for name, axis in (("alp", [1.0, 0.0, 0.0]), ("bet", [0.0, 0.0, -1.0]), ("gam", [0.0, 1.0, 0.0])))
        bodies = body(3, 1, [0.0, 0.06, 0.0], [("SPHER", "BLUEx", values(byrd=0.05))]) + \
            body(3, 2, [0.0] * 3, [("PLANx", "WALLx", values(axe1=1.0, axe2=1.0, axe3=0.01) + "\n" + " " * 29 + "localframe" + frame)])
        laws = LAW + SEE.format("RBDY3", "SPHER", "BLUEx", "SPHER", "BLUEx") + SEE.format("RBDY3", "SPHER", "BLUEx", "PLANx", "WALLx")
        turning = drive(3, 2, [("vlocy", k, 1.0 if k == 6 else 0.0, 0.0, 0.0, 0.0, 1.0, 0.0) for k in range(1, 7)])
        folder, _ = self.convert(self.box(3, bodies, laws, turning))
        with open(os.path.join(folder, "case.nml"), encoding="utf-8") as file:
            self.assertRegex(file.read(), r"rotation = -?0\.0, 1\.0, -?0\.0")

    def test_a_wall_through_the_middle_of_a_grain(self):
        """A wall on whose middle all grains lie has both of its sides."""
        for dimension, shape, wall, half in ((2, "DISKx", "JONCx", {"axe1": 0.5, "axe2": 0.01}),
                                             (3, "SPHER", "PLANx", {"axe1": 0.6, "axe2": 0.3, "axe3": 0.01})):
            rigid = f"RBDY{dimension}"
            side = [2.0] + [0.0] * (dimension - 1)
            ground = body(dimension, 2, [0.0] * dimension, [(wall, "WALLx", values(**half))])
            laws = LAW + SEE.format(rigid, shape, "BLUEx", shape, "BLUEx") + SEE.format(rigid, shape, "BLUEx", wall, "WALLx")
            grain = body(dimension, 1, side, [(shape, "BLUEx", values(byrd=0.05))])
            folder, _ = self.convert(self.box(dimension, grain + ground, laws, still(dimension, 2)))
            self.assertEqual(self.case_of(folder).count("shape = 'segment'" if dimension == 2 else "shape = 'rectangle'"), 2)

    def test_a_ground_as_wide_as_the_period(self):
        """A ground that reaches round the cell is a plane. One between grains above and below has two sides: they have no ends where the ground
        is as long as the period, and carry the grain above; a longer one is refused."""
        for dimension, shape, wall, half in ((2, "DISKx", "JONCx", {"axe1": 0.5, "axe2": 0.01}),
                                             (3, "SPHER", "PLANx", {"axe1": 0.6, "axe2": 0.3, "axe3": 0.01})):
            rigid = f"RBDY{dimension}"
            up = [0.0] * (dimension - 1)
            ground = body(dimension, 2, [*up, -0.01], [(wall, "WALLx", values(**half))])
            grain = body(dimension, 1, [*up, 0.05], [(shape, "BLUEx", values(byrd=0.05))])
            laws = LAW + SEE.format(rigid, shape, "BLUEx", shape, "BLUEx") + SEE.format(rigid, shape, "BLUEx", wall, "WALLx")
            period = ("--period", "1.0", *["0.0"] * (dimension - 1))
            folder, notes = self.convert(self.box(dimension, grain + ground, laws, still(dimension, 2)), *period)
            self.assertIn(f"note: body 2 {wall}: it is as wide as the period along x, and becomes an endless plane"
                          f"{', along y too, where it has edges' if dimension == 3 else ''}\n", notes)
            self.assertEqual(self.case_of(folder).count("shape = 'plane'"), 1)
            _, forces = self.run_case(folder)
            weight = 2500.0 * G * (math.pi * 0.05**2 if dimension == 2 else 4.0 / 3.0 * math.pi * 0.05**3)
            self.assertLess(abs(forces[-1][0, dimension - 1] + weight), 0.01 * weight)
            below = body(dimension, 3, [*up, -0.07], [(shape, "BLUEx", values(byrd=0.05))])
            box = self.box(dimension, grain + ground + below, laws, still(dimension, 2))
            if half["axe1"] > 0.5:
                folder, message = self.convert(box, *period, status=2)
                self.assertRegex(message, r"^gravier_import: error: case.nml: gravier --check refuses the case that was made: case.nml: boundary "
                                          r"'body 2 above': expected a width, .* at most the period of 1.000E\+00 m, .*\n$")
                self.assertEqual(os.listdir(folder), [])
            else:
                folder, notes = self.convert(box, *period)
                self.assertNotIn("becomes an endless plane", notes)
                self.assertIn("name = 'body 2 above'", self.case_of(folder))
                _, forces = self.run_case(folder)
                self.assertLess(abs(forces[-1][:, dimension - 1].sum() + weight), 0.01 * weight)
            # a wall narrower than the period stays what it is
            half["axe1"] = 0.3
            small = body(dimension, 2, [*up, -0.01], [(wall, "WALLx", values(**half))])
            folder, notes = self.convert(self.box(dimension, grain + small, laws, still(dimension, 2)), *period)
            self.assertNotIn("plane", notes + self.case_of(folder))

    def test_the_case_is_checked(self):
        """What gravier refuses is not written, and older files of the name stay; without the program that is said."""
        deep = body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))]) + body(2, 2, [0.0, 0.06], [("DISKx", "BLUEx", values(byrd=0.05))])
        box = self.box(2, deep, LAW + self.see("iqsc0"))
        folder, message = self.convert(box, status=2)
        self.assertRegex(message, r"^gravier_import: error: case.nml: gravier --check refuses the case that was made: .*overlap.*\n$")
        self.assertEqual(os.listdir(folder), [])
        # a program that cannot run says why, and has refused nothing
        broken = write(self.here("broken.sh"), "#!/bin/sh\necho 'orted: no free slots' >&2\necho 'MPI_Init failed' >&2\nexit 77\n")
        os.chmod(broken, 0o755)
        folder, message = self.convert(box, status=2, GRAVIER_PROGRAM=broken)
        self.assertEqual(message, f"orted: no free slots\nMPI_Init failed\ngravier_import: error: case.nml: {broken} --check ended with status 77, without a word on the case "
                                  "that was made; expected a program gravier that runs, or none in the place of this one, with which the case is not checked\n")
        self.assertEqual(os.listdir(folder), [])
        folder, notes = self.convert(box, GRAVIER_PROGRAM="no_such_program")
        self.assertIn("case.nml is not checked; see gravier --check case.nml", notes)
        self.assertEqual(sorted(os.listdir(folder)), ["case.h5", "case.nml"])

    def test_periods(self):
        disk = body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))])
        ball = body(3, 1, [0.0, 0.0, 0.05], [("SPHER", "BLUEx", values(byrd=0.05))])
        flat = self.box(2, disk, LAW + self.see("iqsc0"))
        space = self.box(3, ball, LAW + SEE.format("RBDY3", "SPHER", "BLUEx", "SPHER", "BLUEx"))
        zero = "0 along an axis that is not periodic"
        for box, period, words in (
                (flat, ["1.0"], f"--period: 1 number: expected 2, for bodies RBDY2 in 2D, {zero}"),
                (space, ["1.0", "1.0"], f"--period: 2 numbers: expected 3, for bodies RBDY3 in 3D, {zero}"),
                (flat, ["1.0", "nan"], "--period 1 nan: expected finite numbers >= 0"),
                (space, ["1.0", "-1.0", "0"], "--period 1 -1 0: expected finite numbers >= 0")):
            folder, message = self.convert(box, "--period", *period, status=2)
            self.assertEqual(message, f"gravier_import: error: {words}\n")
            self.assertEqual(os.listdir(folder), [])
        folder, _ = self.convert(space, "--period", "1.0", "2.0", "0")
        self.assertIn("  period = 1.0, 2.0, 0.0\n", self.case_of(folder))

    def test_what_has_no_counterpart_is_refused(self):
        disk = body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))])
        wall = body(2, 2, [0.0, -0.01], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))])
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "DISKx", "BLUEx") + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx")
        polygon = body(2, 1, [0.0, 0.0], [("POLYG", "BLUEx", "nb_vertex=      4    byrd= 0.1000000D+00")])
        arrow = body(2, 1, [0.0, 0.0], [polyg([(0.0, 0.0), (1.0, 1.0), (0.0, 0.2), (-1.0, 1.0)])])
        beside = body(2, 1, [0.0, 0.5], [polyg([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])], avrd=0.4)
        square = body(2, 1, [0.0, 0.5], [polyg([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])])
        cluster = body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05)), ("DISKx", "REDxx", values(byrd=0.05))])
        flat = LAW + SEE.format("RBDY2", "POLYG", "BLUEx", "POLYG", "BLUEx") + SEE.format("RBDY2", "POLYG", "BLUEx", "JONCx", "WALLx")
        good = {"bodies": disk + wall, "laws": laws, "drives": still(2, 2)}
        bulk, slippery = BULK.format(real(-G), real(0.0)), LAW.replace("iqsc0", "slips").replace("0.3", "0.1")
        cases = [
            ({"bodies": disk.replace("RBDY2", "MAILx")}, ("BODIES.DAT: line 3", "MAILx", "rigid bodies")),
            ({"bodies": polygon + wall, "laws": flat}, ("BODIES.DAT: line 9", "POLYG with nb_vertex= 4 and 0 lines of coo1= to coo2=")),
            ({"bodies": arrow + wall, "laws": flat}, ("BODIES.DAT: line 9", "POLYG that is not convex")),
            ({"bodies": beside + wall, "laws": flat}, ("BODIES.DAT: line 5", "its centre of mass", "expected contactors about their centre of mass")),
            ({"bodies": square.replace("gyrd= 0.0000000D+00", "gyrd= 0.5000000D+00") + wall, "laws": flat}, ("line 5", "gyrd= 0.5: expected 0 or 0.408248")),
            ({"bodies": cluster + wall}, ("TACT_BEHAV.DAT: line 5", "contactors DISKx BLUEx and DISKx REDxx of one body", "one law: expected the same lines $seety")),
            ({"bodies": disk.replace("DISKx", "PT2Dx") + wall}, ("BODIES.DAT: line 9", "a contactor PT2Dx of a body RBDY2")),
            ({"bodies": disk.replace("gyrd= 0.0000000D+00", "gyrd= 0.1000000D-01") + wall}, ("gyrd= 0.01", "homogeneous disk")),
            ({"bodies": disk.replace("stone", "brick") + wall}, ("material brick",)),
            ({"bodies": wall, "drives": still(2, 1)}, ("no grain moves freely",)),
            ({"laws": laws.replace("IQS_CLB ", "IQS_MAC_CZM")}, ("TACT_BEHAV.DAT: line 2", "IQS_MAC_CZM", "IQS_WET_DS_CLB, RST_CLB")),
            ({"laws": laws.replace("IQS_CLB", "RST_CLB")}, ("TACT_BEHAV.DAT: line 2", "rstn= or restn= is missing")),
            ({"laws": LAW + SEE.format("RBDY2", "DISKx", "REDxx", "JONCx", "WALLx")}, ("the bodies that move freely see nothing",)),
            ({"laws": laws.replace("0.2000000D-02", "")}, ("alert= is missing",)),
            ({"laws": LAW}, ("no table of visibility", "$seety")),
            ({"drives": still(2, 2)[:still(2, 2).index(" vlocy      3")]}, ("body 2 (JONCx) turns freely", "vlocy 3")),
            ({"drives": still(2, 7)}, ("DRV_DOF.DAT: line 3", "body RBDY2 7")),
            ({"drives": still(2, 2).replace("vlocy      1", "gravy      1")}, ("gravy", "vlocy or force")),
            # no word of a file steers the terminal
            ({"drives": still(2, 2).replace("vlocy      1", "vl\x1bcy      1")}, ("vl?cy", "vlocy or force")),
            ({"bulk": "$behav  lawty\n stone  RIGID      Umas= 1.\n"}, ("no gravity", "$gravy")),
            # numbers are checked where they stand
            ({"bodies": disk.replace(values(byrd=0.05), values(byrd=-0.05)) + wall}, ("BODIES.DAT: line 9: byrd= -0.05: expected a finite number > 0",)),
            ({"bodies": disk + wall.replace(values(axe1=0.2, axe2=0.01), values(axe1=0.2, axe2=0.0))}, ("BODIES.DAT: line 18: axe2= 0: expected a finite",)),
            ({"bodies": disk.replace("avrd= 0.0", "avrd=-0.1") + wall}, ("BODIES.DAT: line 5: avrd= -0.1: expected a finite number >= 0",)),
            ({"bulk": bulk.replace("0.25", "-.25")}, ("BULK_BEHAV.DAT: line 6: Umas= -2500: expected a finite number > 0",)),
            ({"bulk": bulk.replace("0.25", "0.00")}, ("BULK_BEHAV.DAT: line 6: Umas= 0: expected a finite number > 0",)),
            ({"laws": laws.replace("fric= 0.3", "fric=-0.3")}, ("TACT_BEHAV.DAT: line 2: fric= -0.3: expected a finite number >= 0",)),
            ({"laws": laws.replace("IQS_CLB", "RST_CLB").replace(LAW[-5:], LAW[-5:-1] + "  " + values(rstn=1.5, rstt=0.0) + "\n", 1)},
             ("TACT_BEHAV.DAT: line 2: rstn= 1.5: expected a finite number >= 0 and <= 1",)),
            ({"laws": laws.replace("0.2000000D-02", "-.2000000D-02", 1)}, ("TACT_BEHAV.DAT: line 5: alert= -0.002: expected a finite number >= 0",)),
            # what is said twice is the same
            ({"laws": laws + slippery + SEE.format("RBDY2", "JONCx", "WALLx", "DISKx", "BLUEx").replace("iqsc0", "slips")},
             ("TACT_BEHAV.DAT: line 13: DISKx BLUEx and JONCx WALLx with law slips", "with law iqsc0 and alert= 0.002 on line 8: expected one $seety")),
            ({"laws": laws + LAW.replace("0.3", "0.4")}, ("TACT_BEHAV.DAT: line 10: iqsc0 differs from line 2, where it is too: expected each name once",)),
            ({"bulk": bulk + "$behav  lawty\n stone  RIGID      Umas= 1.\n"}, ("BULK_BEHAV.DAT: line 8: stone differs from line 6",)),
            ({"drives": still(2, 2) + drive(2, 2, [("vlocy", 1, 0.7, 0.0, 0.0, 0.0, 1.0, 0.0)])},
             ("DRV_DOF.DAT: line 16: vlocy 1 of body 2 differs from line 7, which drives the same component: expected one drive",)),
            ({"drives": still(2, 2) + drive(2, 2, [("force", 1, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)])}, ("DRV_DOF.DAT: line 16: force 1 of body 2 differs",)),
            ({"drives": still(2, 2) + drive(2, 2, [("vlocy", 4, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)])},
             ("DRV_DOF.DAT: line 16: vlocy 4 of body 2: expected a component from 1 to 3",)),
            ({"contacts": "$icdan  DKDKx        1\n cdbdy  numbr\n RBDY2      1  DISKx      1  iqsc0  RBDY2      9  DISKx      1\n"},
             ("Vloc_Rloc.INI: line 3", "bodies 1 and 9")),
            ({"bodies": "nothing\n"}, ("no body", "$bdyty")),
            # what begins as a number is one
            ({"laws": laws.replace("0.3000000D+00", "0.3000O00D-01")}, ("TACT_BEHAV.DAT: line 2: fric= 0.3000O00D-01: expected a number",)),
            ({"bulk": bulk.replace("grv2=", "grv2=-9,81 grv3=")}, ("BULK_BEHAV.DAT: line 2: grv2= -9,81: expected a number",)),
            ({"bulk": bulk.replace("0.2500000D+04", "0.25O0000D+04")}, ("BULK_BEHAV.DAT: line 6: Umas= 0.25O0000D+04: expected a number",)),
            ({"laws": laws.replace("0.2000000D-02", "0.20O0000D-02", 1)}, ("TACT_BEHAV.DAT: line 5: 0.20O0000D-02: expected a number",)),
            ({"drives": still(2, 2).replace("0.1000000D+01", "0.1O00000D+01", 1)}, ("DRV_DOF.DAT: line 7: 0.1O00000D+01: expected a number",)),
            ({"drives": still(2, 2).replace(" 0.1000000D+01  0.0000000D+00", "", 1)}, ("DRV_DOF.DAT: line 7: vlocy 1", "expected six numbers")),
        ]
        for change, words in cases:
            with self.subTest(words=words):
                folder, message = self.convert(self.box(2, **{**good, **change}), status=2)
                self.assertEqual(message.count("\n"), 1, message)
                for word in words:
                    self.assertIn(word, message)
                self.assertEqual(os.listdir(folder), [])
        folder, message = self.convert(self.fresh("empty"), status=2)
        self.assertIn("BODIES.DAT: no such file", message)
        # equal repeats say nothing new, nor do lines between walls
        twice = {"bodies": disk + wall, "laws": 2 * laws + slippery + "".join(
            SEE.format("RBDY2", "JONCx", "WALLx", "JONCx", "WALLx").replace("iqsc0", law) for law in ("iqsc0", "slips")),
            "drives": 2 * still(2, 2), "bulk": bulk + bulk[bulk.index("$behav"):]}
        made = [self.case_of(self.convert(self.box(2, **files))[0]) for files in (good, twice)]
        self.assertEqual(*(text[text.index("  dimension"):] for text in made))

    def test_files_of_others_stay(self):
        """An import replaces the files of an import, and no other: not results, nor a case or a table of the user's own."""
        disk = body(2, 1, [0.0, 0.05], [("DISKx", "BLUEx", values(byrd=0.05))])
        wall = body(2, 2, [0.0, -0.01], [("JONCx", "WALLx", values(axe1=0.2, axe2=0.01))])
        laws = LAW + SEE.format("RBDY2", "DISKx", "BLUEx", "JONCx", "WALLx")
        moved = drive(2, 2, [("vlocy", k, 0.0, 0.1 * (k == 1), 9.0, 0.0, 0.5, 1.0) for k in (1, 2, 3)])
        contacts = "$icdan  DKJCx        1\n cdbdy  numbr\n RBDY2      1  DISKx      1  iqsc0  RBDY2      2  JONCx      1  noctc\n" + " " * 29 + \
            values(n1=0.0, n2=1.0) + "\n" + " " * 29 + f"gapTT {real(0.0)}  rln/H {real(0.0)}  rlt/H {real(0.0)}\n"
        box = self.box(2, disk + wall, laws, moved, contacts=contacts)
        folder, _ = self.convert(box)
        made = sorted(os.listdir(folder))
        self.assertEqual(made, ["case.h5", "case.nml", "case_contacts.csv", "case_drive_1.csv"])
        command = [IMPORT, box, "--step", "1e-3", "--steps", "50", "--out", "case"]
        again = script(*command, directory=folder)
        self.assertEqual((again.returncode, sorted(os.listdir(folder))), (0, made), again.stderr)
        with h5py.File(os.path.join(self.scratch, "own.h5"), "w") as file:
            file["bodies/id"] = [1]
        with open(os.path.join(self.scratch, "own.h5"), "rb") as file:
            image = file.read()
        for name in made:
            with self.subTest(name), open(os.path.join(folder, name), "rb") as file:
                before = file.read()
                own = write(os.path.join(folder, name), image if name == "case.h5" else b"own\n")
                done = script(*command, directory=folder)
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertRegex(done.stderr, rf"\Agravier_import: error: --out case: {name}: there is a file of another kind or origin, which is not .*\n\Z")
                with open(own, "rb") as kept:
                    self.assertEqual(kept.read(), image if name == "case.h5" else b"own\n")
                self.assertEqual(sorted(os.listdir(folder)), made)
                write(own, before)


if __name__ == "__main__":
    import unittest
    unittest.main()
