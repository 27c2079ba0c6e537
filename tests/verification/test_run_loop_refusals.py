"""What is wrong in a loop of the user's own is refused in one line, and the run is as it was; a program in C that makes a run by gravier.h;
communicators of mpi4py; exceptions of a loop on several ranks."""
import os
import shutil
import subprocess
import sys
import unittest

from gravier_runs import PROGRAMS, SOURCE, differences, gravier, merged, run_case
from loop_runs import HEAP, LOOP, LoopTestCase, written

LIBRARY = os.path.join(os.path.dirname(PROGRAMS), "lib")
#: statements, and what they are refused with; `s` is a simulation
REFUSED = [
    ("s.boundaries['roof']", "boundary 'roof': no boundary has this name; expected one of "),
    ("s.bodies.force = np.zeros((len(s.bodies), 2))",
     "force: this run has no applied forces; expected a simulation that was opened with them"),
    ("s.bodies.velocity = np.zeros((3, 2))", "velocity: an array of shape (3, 2); expected (48, 2), a row for each body of this rank"),
    ("s.bodies.velocity = np.zeros((48, 3))", "velocity: an array of shape (48, 3); expected (48, 2), a row for each body of this rank"),
    ("s.bodies.spin = np.zeros(48)", "spin: an array of shape (48,); expected (48, 1), a row for each body of this rank"),
    ("s.bodies.velocity = np.ma.masked_all((48, 2))", "velocity: a masked array; expected numbers for all entries"),
    ("s.bodies.velocity = np.zeros((48, 2), 'datetime64[s]')", "velocity: expected numbers"),
    ("s.bodies.velocity = np.full((48, 2), '1')", "velocity: expected numbers"),
    ("s.bodies.velocity = np.full((48, 2), '1', object)", "velocity: expected numbers"),
    ("s.gravity = (0.0, np.timedelta64(1, 's'))", "gravity: expected numbers"),
    ("gravier.Simulation(None)", "None: expected the path of an input file"),
    ("s.subdomains[0].velocity = np.zeros((len(s.subdomains[0]), 3))", "velocity: an array of shape ("),
    ("s.bodies.velocity = np.full((len(s.bodies), 2), np.nan)",
     "velocity of body 1: not a number to reckon with; expected a number of at most 1e30 in size"),
    ("s.bodies.velocity = 'fast'", "velocity: expected numbers"),
    ("s.bodies.velocity = s.bodies.velocity + 1j", "velocity: an array of complex numbers; expected real ones"),
    ("s.gravity = (0.0, 1j)", "gravity: an array of complex numbers; expected real ones"),
    ("call('array', s.handle, b'weight', 0, *[(ctypes.c_int64 * 2)()] * 3)", "array 'weight': unknown; gravier.h has the names"),
    ("call('array', s.handle, b'mass', 7, *[(ctypes.c_int64 * 2)()] * 3)", "subdomain 7: this rank has 2; expected a number from 0 on"),
    ("call('set_array', s.handle, b'mass', 0, (ctypes.c_double * 3)(), (ctypes.c_int64 * 2)())", "mass: cannot be set; expected one of velocity, force"),
    ("call('set_array', s.handle, b'velocity', 0, (ctypes.c_double * 3)(), (ctypes.c_int64 * 2)(0, 3))",
     "velocity: an array of 0 bodies with 3 numbers each; expected "),
    ("call('get_boundary', s.handle, 99, b'force', (ctypes.c_double * 3)(), ctypes.byref(ctypes.c_int()))", "boundary 99: the scene has "),
    ("call('get_boundary', s.handle, 0, b'weight', (ctypes.c_double * 3)(), ctypes.byref(ctypes.c_int()))", ": weight: unknown; expected one of "
     "position, normal, velocity, spin, force, applied_force, pressure, friction"),
    ("call('set_boundary', s.handle, 0, b'force', (ctypes.c_double * 3)(), 2)",
     ": force cannot be set; expected one of velocity, spin, applied_force, pressure, friction"),
    ("s.whole('weight')", "whole number 'weight': unknown; gravier.h has the names"),
    ("s.real('weight')", "real number 'weight': unknown; gravier.h has the names"),
    ("s.gravity = (1.0, 2.0, 3.0)", "gravity: 3 numbers; expected 2"),
    ("s.gravity = (0.0, np.inf)", "gravity: not a number to reckon with; expected a number of at most 1e30 in size"),
    ("s.friction = -0.1", "friction: expected a number from 0 to 1e30"),
    ("s.boundaries['floor'].friction = -0.1", "boundary 'floor': friction: expected a number from 0 to 1e30"),
    ("s.boundaries['floor'].velocity = (1.0, 2.0, 3.0)", "boundary 'floor': velocity has 3 numbers; expected 2"),
    ("s.boundaries['floor'].velocity = (1.0, np.nan)", "boundary 'floor': velocity is not a number to reckon with; expected a number of at most"),
    ("s.boundaries['floor'].spin = 1.0", "boundary 'floor': spin about z: the boundary does not turn about it in the case; expected 0, or a "
     "rotation in the case"),
    ("s.boundaries['floor'].applied_force = (0.0, 1.0)", "boundary 'floor': applied_force along y: not a free component; expected 0 there"),
    ("s.boundaries['floor'].pressure = 1.0", "boundary 'floor': pressure is for a plane of which a component along its normal is free"),
    ("s.boundaries['lid'].velocity = (0.0, 1.0)", "boundary 'lid': velocity along y: forces move it; expected 0 there"),
    ("s.boundaries['belt'].velocity = (1.0, 0.0)", "boundary 'belt': velocity along x: its table gives it; expected a boundary without this column"),
    ("s.boundaries['swing'].velocity = (1.0, 0.0)", "boundary 'swing': velocity along y: it oscillates; expected a boundary without an oscillation along "
     "this axis"),
    ("s.boundaries['swing'].spin = 1.0", "boundary 'swing': spin about z: it oscillates; expected a boundary without an oscillation about this axis"),
    ("s.boundaries['belt'].spin = 1.0", "boundary 'belt': spin about z: its table gives it; expected a boundary without this column"),
    ("s.boundaries['press'].applied_force = (0.0, 1.0)",
     "boundary 'press': applied_force along y: its table gives it; expected a boundary without this column"),
    ("s.boundaries['press'].pressure = 1.0", "boundary 'press': pressure is given by its table; expected a boundary without this column"),
    ("s.add_bodies([[0.05, 0.5, 0.0]], 0.01)", "position: an array of shape (1, 3); expected (bodies, 2)"),
    ("s.add_bodies([[0.05, 0.5]], [0.01, 0.01])", "radius, mass, material: expected one number, or one for each of 1 bodies"),
    ("s.add_bodies([[0.05, 0.5]], 0.0)", "add_bodies: body 1: radius: expected a number from 1e-30 to 1e30"),
    ("s.add_bodies([[0.05, 0.5]], 1.0)", "add_bodies: body 1: radius 1.000000E+00 m: expected at most "),
    ("s.add_bodies([[0.05, 0.5]], 1.0)", ", the largest radius of the scene at its start"),
    ("s.add_bodies([[0.05, 0.5]], 0.01, mass=-1.0)", "add_bodies: body 1: mass: expected a number from 1e-30 to 1e30"),
    ("s.add_bodies([[0.05, 0.5]], 0.01, mass=0.0)", "add_bodies: body 1: mass: expected a number from 1e-30 to 1e30"),
    ("s.add_bodies([[0.05, 0.5]], 0.01, mass=np.nan)", "add_bodies: body 1: mass: expected a number from 1e-30 to 1e30"),
    ("s.add_bodies([[0.05, 0.5], [0.09, 0.5]], 0.01, mass=[1.0, -0.0])", "add_bodies: body 2: mass: expected a number from 1e-30 to 1e30"),
    ("s.add_bodies([[0.05, 2e8]], 0.01)", "add_bodies: body 1: position: expected at most 1.000E+08 m, 1e10 radii of the smallest grain: rounding would hide gaps"),
    ("s.add_bodies([[0.05, np.nan]], 0.01)", "add_bodies: body 1: position: expected a number of at most 1e30 in size"),
    ("s.add_bodies([[0.05, 0.5]], 0.01, velocity=[[0.0, np.nan]])", "add_bodies: body 1: velocity: expected a number of at most 1e30 in size"),
    ("s.add_bodies([[0.05, 0.5]], 0.01, material=2)", "add_bodies: body 1: material 2: expected a number from 1 to 1"),
    ("s.add_bodies([[0.05, 0.5]], 0.01, material=1.5)", "material: expected whole numbers"),
    ("s.add_bodies([[0.05, 0.5], [0.06, 0.5]], 0.01)",
     "add_bodies: body 2: it overlaps body 1 of those to add; expected a free place"),
    ("s.add_bodies(np.array(s.bodies.position[:1]) + 0.001, 0.001)", "add_bodies: body 1: it overlaps body 1 of the scene; expected a free place"),
    ("s.add_bodies([[0.05, -0.012]], 0.01)", "add_bodies: body 1: it overlaps a boundary of the scene; expected a free place"),
    ("s.add_bodies([[0.05, 0.4]], 0.01); s.add_bodies([[0.05, 0.401]], 0.01)",
     "add_bodies: body 1: it overlaps a body that was added before; expected a free place"),
    ("s.remove([1, 9999])", "remove: body 9999: no free body of the scene; expected an identifier of one"),
    ("s.remove([1, 1])", "remove: body 1: removed twice; expected each identifier once"),
    ("s.remove(np.array([2**63], dtype=np.uint64))", "remove: body 9223372036854775808: no free body of the scene; expected an identifier of one"),
    ("s.remove([1.5])", "remove: expected identifiers, which are whole numbers"),
    ("gravier.Simulation('case.nml')", "open: a simulation is open in this process; expected that it is closed before, by "
     "gravier.Simulation.opened().close() if it is lost"),
]
#: the same of a run that is over
OVER = [("s.step()", "step: the run is over after step 60; expected a run that goes on"),
        ("s.checkpoint()", "checkpoint: the run is over after step 60; expected a run that goes on"),
        ("s.add_bodies([[0.05, 0.5]], 0.01)", "add_bodies: the run is over; expected a run that goes on"),
        ("s.bodies.velocity = np.array(s.bodies.velocity)", "velocity: the run is over after step 60; expected a run that goes on"),
        ("s.remove([1])", "remove: the run is over; expected a run that goes on")]
ENDED = "MPI has been ended in this process; expected one in which it runs or can be started"
BOUNDARIES = [{"name": "lid", "shape": "plane", "point": [0.0, 2.0], "normal": [0.0, -1.0], "free": [False, True], "mass": 1.0},
              {"name": "press", "shape": "plane", "point": [0.0, 3.0], "normal": [0.0, -1.0], "free": [False, True], "mass": 1.0,
               "table": "press.csv"},
              {"name": "belt", "shape": "segment", "point": [4.0, 0.0], "end": [5.0, 0.0], "table": "belt.csv"},
              {"name": "swing", "shape": "segment", "point": [6.0, 0.0], "end": [7.0, 0.0], "oscillation": [0.0, 0.1], "rotation_oscillation": [0.1],
               "frequency": 5.0}]


class Refusals(LoopTestCase):

    def test_wrong_uses(self):
        """Each raises its line, and the run goes on."""
        script = f"""
import ctypes
from gravier.library import call
REFUSED = {REFUSED!r}
open("press.csv", "w").write("time,fy,pressure\\n0,-1,0\\n")
open("belt.csv", "w").write("time,vx,omega\\n0,1,0\\n")
with gravier.Simulation(case, quiet=True) as s:
    s.step()
    for statement, line in REFUSED:
        try:
            exec(statement)
        except gravier.SimulationError as error:
            assert line in str(error) and "\\n" not in str(error) and error.status == 2, (statement, str(error))
        else:
            raise AssertionError("not refused: " + statement)
    for name in ("weight", "position"):
        for statement in (f"s.boundaries['floor'].{{name}} = 1.0", f"s.bodies.{{name}} = 1.0", f"s.{{name}} = 1.0"):
            try:
                exec(statement)
            except AttributeError:
                pass
            else:
                raise AssertionError("not refused: " + statement)
    before = np.array(s.bodies.velocity)
    wrong = before + 1.0
    wrong[-1] = np.nan
    try:
        s.bodies.velocity = wrong
    except gravier.SimulationError:
        assert np.array_equal(before, np.array(s.bodies.velocity)), "a subdomain has taken its part of what was refused"
    else:
        raise AssertionError("not refused: NaN in the last row")
    s.remove([48])
    s.remove(np.array([47]))
    s.step()
    for change in (lambda: s.remove([46]), lambda: s.add_bodies([[0.05, 0.6]], 0.01)):
        change()
        try:
            s.checkpoint()
        except gravier.SimulationError as error:
            assert str(error) == ("checkpoint: bodies that were added or removed enter or leave at the start of the next step; expected a "
                                  "checkpoint before these calls, or after that step"), str(error)
        else:
            raise AssertionError("a checkpoint that loses what was added or removed")
        s.step()
    s.bodies.velocity = np.array(s.bodies.velocity)
    try:
        s.checkpoint()
    except gravier.SimulationError as error:
        assert str(error) == ("checkpoint: velocities were set, which take effect with the next step; expected a checkpoint before that, "
                              "or after that step"), str(error)
    else:
        raise AssertionError("a checkpoint whose balance does not know the velocities")
    s.step()
    s.checkpoint()
    while s.goes_on:
        s.step()
    for statement, line in {OVER!r}:
        try:
            exec(statement)
        except gravier.SimulationError as error:
            assert str(error) == line, str(error)
        else:
            raise AssertionError("not refused: " + statement)
    s.stop("too late")
try:
    s.step()
except gravier.SimulationError as error:
    assert str(error) == "this simulation is closed; expected one that is open"
assert (s.made, s.rank, s.ranks) == (60, 0, 1), (s.made, s.rank, s.ranks)
"""
        groups = merged(HEAP, {"boundary": HEAP["boundary"] + BOUNDARIES, "scene": {"gravity_table": None}})
        self.play("wrong", groups, script)

    def test_arrays_of_a_step_that_is_over(self):
        """What numpy asks the array for raises; what it takes without asking has the values of the step of the array, also where the library
        has given its memory back. So it is with one subdomain and with several."""
        script = """
import copy
import pickle
s = gravier.Simulation(case, quiet=True)
s.step()
kept = []
for own in (s.bodies, s.subdomains[0]):
    for name in ("position", "velocity", "spin", "mass", "id"):
        old = getattr(own, name)
        assert not old.flags.writeable and len(old) == len(own)
        assert type(old.copy()) is type(copy.copy(old)) is type(pickle.loads(pickle.dumps(old))) is type(old + 1.0) is np.ndarray
        assert old.tolist() == list(map(list, old) if old.ndim == 2 else old) and np.array_equal(old, np.array(old)) and str(old) == str(np.array(old))
        kept += [(view, np.array(view), np.asarray(view)) for view in (old, old[1:], old.T, old.ravel())]
uses = [lambda old: old[0], lambda old: old + 1.0, lambda old: old == 1.0, lambda old: old != old, lambda old: old.sum(), lambda old: old.dot(1.0),
        lambda old: np.concatenate([old, old]), lambda old: old.copy(), lambda old: copy.copy(old), lambda old: copy.deepcopy(old), list,
        lambda old: old.tolist(), lambda old: old.tobytes(), lambda old: old.flat, lambda old: old.T, lambda old: pickle.dumps(old), bytes, repr, str,
        lambda old: f"{old}", float, bool, lambda old: 1.0 in old, lambda old: np.zeros(old.shape).__iadd__(old)]

def check():
    for old, values, plain in kept:
        for number, use in enumerate(uses):
            try:
                use(old)
            except gravier.StaleArray as error:
                assert str(error) == ("this array of bodies is of a step that is over; expected one that is taken anew, or a copy: numpy.array(...)")
            else:
                raise AssertionError(f"a stale array was read: {number}")
        assert np.array_equal(np.array(old), values) and np.array_equal(plain, values) and np.array_equal(np.array([old])[0], values)

s.step()
check()
s.add_bodies([[0.05, 0.4]], 0.01)
s.remove([1])
s.step()
check()
s.close()
check()
"""
        for subdomains in (1, 2):
            self.play(f"stale{subdomains}", merged(HEAP, {"decomposition": {"subdomains": subdomains}}), script)

    def refused(self, title, groups, statement, line, options="", ranks=1):
        script = f"""
with gravier.Simulation(case, quiet=True{options}) as s:
    try:
        {statement}
    except (gravier.SimulationError, AttributeError) as error:
        assert {line!r} in str(error), str(error)
    else:
        raise AssertionError("not refused")
"""
        self.play(title, groups, script, ranks=ranks)

    def test_cases_that_do_not_allow_it(self):
        with open(self.here("g.csv"), "w", encoding="ascii") as file:
            file.write("time,gx\n0,1\n")
        self.refused("table", merged(HEAP, {"scene": {"gravity_table": "../g.csv"}}), "s.gravity = (0.0, -1.0)",
                     "gravity: gravity_table gives it; expected a case without this table")
        glass = {"material": {"name": "glass"}, "law": {"materials": "glass", "kind": "coulomb", "friction": 0.2}}
        self.refused("law", merged(HEAP, glass), "s.friction = 0.2", "friction: laws of materials have their own; expected a case without &law")
        self.refused("smooth", merged(HEAP, {"scene": {"friction": 0.0}}), "s.friction = 0.2",
                     "friction: no contact of the scene has friction; expected a case in which some coefficient is above 0")
        free = {group: keys for group, keys in HEAP.items() if group != "boundary"}
        self.refused("moving", merged(free, {"scene": {"period": [1.0, 1.0], "gravity": [0.0, 0.0], "cell_shear_rate": [0.1]}}),
                     "s.add_bodies([[0.5, 0.9]], 0.01)",
                     "add_bodies: the periodic cell of the scene moves; expected one that stays as it is")
        cell = {"scene": {"period": [1.0, 1.0], "gravity": [0.0, 0.0], "cell_shear_rate": [0.1], "cell_pressure": [0.0, 5.0],
                          "cell_table": "../cell.csv"}}
        with open(self.here("cell.csv"), "w", encoding="ascii") as file:
            file.write("time,strain_rate_x\n0,0.1\n")
        names = "strain_rate_x, pressure_x, strain_rate_y, pressure_y, shear_rate_xy, shear_stress_xy"
        for title, statement, line in (
                ("of a table", "s.cell.strain_rate_x = 0.2", "cell: strain_rate_x: cell_table moves this component; expected a table without it"),
                ("driven", "s.cell.strain_rate_y = 0.2", "cell: strain_rate_y: a stress drives this component; expected pressure_y"),
                ("with a rate", "s.cell.shear_stress_xy = 0.2",
                 "cell: shear_stress_xy: no stress drives this component in the case; expected shear_rate_xy"),
                ("pulled", "s.cell.pressure_y = -1.0", "cell: pressure_y: expected a pressure >= 0"),
                ("far", "s.cell.pressure_y = 1e31", "cell: pressure_y is not a number to reckon with; expected a number of at most 1e30 in size"),
                ("no number", "s.cell.pressure_y = 'much'", "cell: pressure_y: expected numbers"),
                ("edge", "s.cell.length_x = 1.0", f"cell: length_x cannot be set; expected one of {names}"),
                ("unknown", "s.cell.pressure_z", f"cell: pressure_z: unknown; expected one of {names}, length_x, strain_x, length_y, "
                 "strain_y, tilt_xy, shear_xy"),
                ("column", "s.real('stress_xx')", "real number 'stress_xx': unknown; gravier.h has the names, and options of &output add those of "
                                                  "their columns in history.csv")):
            self.refused("cell " + title, merged(free, cell), statement, line)
        with open(self.here("grain.csv"), "w", encoding="ascii") as file:
            file.write("id,x,y,radius\n1,0.5,0.5,0.1\n")
        grain = {"bodies": "file", "bodies_file": "../grain.csv", "period": [1.0, 0.0], "gravity": [0.0, 0.0], "cell_strain_rate": [0.1, 0.0]}
        self.refused("no period", {"scene": grain, "time": {"step": 1e-3, "steps": 2}, "output": {"directory": "results"}},
                     "s.cell.shear_rate_xy = 1.0", "cell: shear_rate_xy: expected a component along axes that are periodic")
        for statement in ("s.cell.shear_rate_xy", "s.cell.shear_rate_xy = 1.0"):
            self.refused("no cell", HEAP, statement, "cell: that of the scene does not move; expected a periodic cell that moves in the case")
        walls = [{**wall, "friction": 0.2} for wall in HEAP["boundary"]]
        self.refused("bouncing", merged(HEAP, {"scene": {"friction": 0.0, "tangential_restitution": 0.5}, "boundary": [
            {**wall, "tangential_restitution": 0.0} for wall in walls]}), "s.friction = 0.2",
            "friction: tangential_restitution acts where a case has friction; expected a coefficient above 0 there")
        self.refused("forced", HEAP, "s.bodies.force = np.full((48, 2), 1e31)",
                     "force of body 1: not a number to reckon with; expected a number of at most 1e30 in size", options=", forces=True")
        self.refused("apart", HEAP, "s.gravity = (0.0, -float(s.rank)); s.step()", "step: ranks have set different drives, loads, coefficients or "
                     "bodies; expected the same calls with the same values on all ranks", ranks=2)

    def test_a_case_that_is_refused(self):
        """The line and the status of the program; another run may follow in the same process, and nothing after MPI has been ended."""
        script = f"""
for case, line in (("absent.nml", "absent.nml"), ("bad.nml", "bad.nml: &time step = -1.0: expected")):
    try:
        gravier.Simulation(case)
    except gravier.SimulationError as error:
        assert line in str(error) and error.status == 2, str(error)
for k in range(2):
    with gravier.Simulation("case.nml", quiet=True) as s:
        s.step()
    assert s.close() == s.status == 0
from gravier.library import load
load().gravier_finalize()
try:
    gravier.Simulation("case.nml")
except gravier.SimulationError as error:
    assert str(error) == {ENDED!r}
"""
        os.makedirs(self.here("again"), exist_ok=True)
        with open(self.here("again", "bad.nml"), "w", encoding="ascii") as file:
            file.write("&scene bodies = 'lattice', lattice_count = 2, 2, radius_min = 1.0, radius_max = 1.0 /\n&time step = -1.0, steps = 1 /\n")
        self.play("again", HEAP, script)

    def test_a_simulation_that_is_lost(self):
        """One that no name holds any more can be reached, and closed."""
        self.play("lost", HEAP, """
assert gravier.Simulation.opened() is None
s = gravier.Simulation(case, quiet=True)
s.step()
del s
try:
    gravier.Simulation(case)
except gravier.SimulationError as error:
    assert error.status == 2
else:
    raise AssertionError("not refused")
assert gravier.Simulation.opened().made == 1
gravier.Simulation.opened().close()
with gravier.Simulation(case, quiet=True) as s:
    assert gravier.Simulation.opened() is s
    s.step()
assert gravier.Simulation.opened() is None
try:
    gravier.Simulation("absent.nml")
except gravier.SimulationError:
    assert gravier.Simulation.opened() is None
""")

    def test_exceptions_of_the_loop(self):
        """On one rank the run is ended as by stop; on several all ranks end, for the others would wait for ever."""
        script = """
with gravier.Simulation(case) as s:
    for k in range(5):
        s.step()
    if s.rank == 0:
        raise ValueError("enough")
    s.step()
"""
        loop = self.play("raised", HEAP, script, status=1)
        self.assertIn("ended       after step 5 of 60: an exception in its loop, ValueError\n", loop.stdout)
        self.assertEqual(len(loop.history()["step"]), 5)
        two = self.play("raised2", HEAP, script, ranks=2, status=4)
        self.assertIn("ValueError: enough", two.stderr)
        stale = script.replace('raise ValueError("enough")', "place + 1.0").replace("    for k", "    place = s.bodies.position\n    for k")
        two = self.play("raised3", HEAP, stale, ranks=2, status=4)
        self.assertIn("StaleArray: this array of bodies is of a step that is over", two.stderr)
        # what one rank gets wrong is an error of that rank alone
        wrong = script.replace('raise ValueError("enough")', "s.bodies.velocity = np.zeros((1, 7))")
        two = self.play("raised4", HEAP, wrong, ranks=2, status=4)
        self.assertIn("an array of shape (1, 7)", two.stderr)
        # the same of a script without a block
        bare = "s = gravier.Simulation(case)\n" + script.replace("    ", "", 1).split("s:\n")[1].replace("\n    ", "\n")
        two = self.play("raised5", HEAP, bare, ranks=2, status=4)
        self.assertIn("ValueError: enough", two.stderr)

    def test_the_library_is_missed_in_one_line(self):
        script = "import gravier\ntry:\n    gravier.Simulation('case.nml')\nexcept gravier.SimulationError as error:\n    print(error)\n"
        done = subprocess.run([sys.executable, "-c", script], env={**os.environ, "GRAVIER_LIBRARY": "/absent/libgravier.so"}, capture_output=True,
                              text=True, check=True)
        self.assertRegex(done.stdout, r"^/absent/libgravier\.so: cannot load the library of Gravier: .*; expected libgravier\.so beside the program, "
                                      r"or its path in GRAVIER_LIBRARY\n$")

    def test_a_library_of_another_version_is_told(self):
        """One that lacks a function of the package, as where a new package finds an old build."""
        compiler = os.environ.get("CC") or shutil.which("cc")
        if not compiler:
            self.skipTest("no compiler of C")
        source, library = self.here("old.c"), self.here("libold.so")
        with open(source, "w", encoding="ascii") as file:
            file.write("int gravier_open(void) { return 0; }\n")
        subprocess.run([compiler, "-shared", "-fPIC", source, "-o", library], check=True)
        script = "import gravier\ntry:\n    gravier.Simulation('case.nml')\nexcept gravier.SimulationError as error:\n    print(error)\n"
        done = subprocess.run([sys.executable, "-c", script], env={**os.environ, "GRAVIER_LIBRARY": library}, capture_output=True, text=True, check=True)
        self.assertEqual(done.stdout, f"{library}: no function gravier_step: a library of another version; expected that of this package, built anew or "
                                      "named by GRAVIER_LIBRARY\n")

    # ---- C and mpi4py

    def test_a_program_in_c(self):
        compiler = os.environ.get("CC") or shutil.which("cc")
        if not compiler:
            self.skipTest("there is no C compiler")
        directory = self.here("c")
        program = run_case(merged(HEAP, {"time": {"steps": 60}}), ranks=2, directory=self.here("c_program"))
        os.makedirs(directory)
        shutil.copy(program.path("case.nml"), directory)
        subprocess.run([compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-I", os.path.join(SOURCE, "src/interface"),
                        os.path.join(SOURCE, "doc/loop_example.c"), "-o", "loop", "-L", LIBRARY, "-lgravier", "-lm", "-Wl,-rpath," + LIBRARY],
                       cwd=directory, check=True)
        run = gravier("case.nml", "wall 49", ranks=2, directory=directory, program=os.path.join(directory, "loop"))
        self.assert_status(run, 0)
        self.assertRegex(run.stdout, r"\n60 steps, the grains press wall 49 with [1-9][0-9]*\.[0-9]{3} N\n$")
        wrong = gravier("absent.nml", "bottom", directory=directory, program=os.path.join(directory, "loop"))
        self.assert_status(wrong, 2)
        self.assertIn("absent.nml", wrong.stderr)
        first, other = written(program.directory), written(run.directory)
        self.assertEqual(differences(first, other), [])
        # the error of a call is said and ends the program, whatever calls follow it
        unknown = gravier("case.nml", "roof", directory=directory, program=os.path.join(directory, "loop"))
        self.assert_status(unknown, 2)
        self.assertRegex(unknown.stderr, r"\Aloop: error: boundary 'roof': no boundary has this name; expected one of .*\n\Z")

    def test_wrong_calls_in_c(self):
        """A handle that is null or closed, a count below 0 and a number that no boundary has are errors with a line, and end no process."""
        compiler = os.environ.get("CC") or shutil.which("cc")
        if not compiler:
            self.skipTest("there is no C compiler")
        program = run_case(HEAP, directory=self.here("wrong_c"), options=("--check",))
        with open(program.path("wrong.c"), "w", encoding="ascii") as file:
            file.write("""
#include <stdio.h>
#include "gravier.h"
#define TELL(call) do { int status = (call); printf("%d %s\\n", status, gravier_error()); } while (0)
int main(void) {
  gravier_simulation *none = NULL, *closed;
  int64_t whole, shape[2];
  double real, sum = 1.0;
  const void *address;
  int kind, number;
  TELL(gravier_step(none));
  TELL(gravier_close(none));
  if (gravier_open("absent.nml", "wrong", GRAVIER_QUIET, NULL, &none) != 2 || none) return 1;
  TELL(gravier_whole(none, "step", &whole));
  TELL(gravier_real(none, "time", &real));
  gravier_sum(none, 1, &sum);
  if (gravier_open("case.nml", "wrong", GRAVIER_QUIET, NULL, &none)) return 1;
  closed = none;
  TELL(gravier_add_bodies(none, -1, NULL, NULL, NULL, NULL, NULL));
  TELL(gravier_remove_bodies(none, -1, NULL));
  TELL(gravier_boundary_name(none, 99) == NULL);
  TELL(gravier_boundary_name(none, 0) == NULL);
  TELL(gravier_close(none));
  TELL(gravier_close(closed));
  TELL(gravier_stop(closed, "late"));
  TELL(gravier_array(closed, "position", 0, &address, shape, &kind));
  TELL(gravier_boundary(closed, "floor", &number));
  gravier_finalize();
  return 0;
}
""")
        subprocess.run([compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-I", os.path.join(SOURCE, "src/interface"), "wrong.c", "-o", "wrong",
                        "-L", LIBRARY, "-lgravier", "-lm", "-Wl,-rpath," + LIBRARY], cwd=program.directory, check=True)
        run = gravier("case.nml", directory=program.directory, program=program.path("wrong"))
        self.assert_status(run, 0)
        shut = "2 simulation: not open; expected one that gravier_open has opened, and that is not closed yet"
        count = "2 n = -1 bodies: expected 0 or more"
        lines = [line for line in run.stdout.splitlines() if line]
        self.assertRegex(lines.pop(6), r"^1 boundary 99: the scene has \d+; expected a number from 0 on$")
        self.assertEqual(lines, [shut] * 4 + [count] * 2 + ["0 "] * 2 + [shut] * 4)

    def test_communicators_of_mpi4py(self):
        try:
            import mpi4py  # noqa: F401
        except ImportError:
            self.skipTest("there is no mpi4py")
        program = run_case(HEAP, ranks=2, directory=self.here("mpi4py_program"))
        loop = self.play("mpi4py", HEAP, "from mpi4py import MPI\n" + LOOP.replace("case,", "case, communicator=MPI.COMM_WORLD,"), ranks=2)
        self.same(program, loop)
        # each rank a run of its own
        script = """
import os
from mpi4py import MPI
rank = MPI.COMM_WORLD.rank
os.makedirs(f"own{rank}", exist_ok=True)
os.chdir(f"own{rank}")
with gravier.Simulation("../case.nml", quiet=True, communicator=MPI.COMM_SELF) as s:
    assert (s.rank, s.ranks) == (0, 1)
    while s.goes_on:
        s.step()
assert MPI.COMM_WORLD.allreduce(s.status) == 0
"""
        own = self.play("own", HEAP, script, ranks=2)
        first = written(program.directory)
        for rank in range(2):
            other = written(own.path(f"own{rank}"))
            self.assertEqual(differences(first, other), [])


if __name__ == "__main__":
    unittest.main()
