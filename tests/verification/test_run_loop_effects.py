"""What a loop of the user's own sets acts as the same thing in an input file does, or as theory says (test_run_loop has the bits of a loop that
sets nothing): drives, loads, coefficients, forces, velocities, bodies that come and go."""
import os
import re
import unittest

import numpy as np

from gravier_runs import LONG, differences, gravier, merged, namelist, run_case, steps_of, write
from loop_runs import HEAP, LoopTestCase, written

SET = """
with gravier.Simulation(case, quiet=True) as s:
    {}
    while s.goes_on:
        s.step()
"""
#: a lid that forces move, on disks between walls without friction
PRESS = merged(HEAP, {
    "scene": {"bodies": "file", "bodies_file": "../press.csv", "lattice_count": None, "radius_min": None, "radius_max": None, "friction": 0.0},
    "boundary": [{"name": "floor", "shape": "plane", "point": [0.0, -0.012], "normal": [0.0, 1.0]},
                 {"name": "left", "shape": "plane", "point": [-0.012, 0.0], "normal": [1.0, 0.0]},
                 {"name": "right", "shape": "plane", "point": [0.215, 0.0], "normal": [-1.0, 0.0]},
                 {"name": "lid", "shape": "plane", "point": [0.0, 0.2], "normal": [0.0, -1.0], "free": [False, True], "mass": 20.0,
                  "force": [0.0, -300.0]}],
    "time": {"steps": 600}, "output": {"every": 0, "contacts": False, "trace": False}})
#: one sphere that meets nothing
SPHERE = {"scene": {"dimension": 3, "bodies": "file", "bodies_file": "../sphere.csv"},
          "time": {"step": 1e-3, "steps": 800}, "output": {"directory": "results", "every": 0}}


class Effects(LoopTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        rows = [f"{8 * j + i + 1},{0.0251 * i},{0.0248 * j},{0.009 + 0.003 * np.sin(7.0 * i + 3.0 * j) ** 2}" for j in range(8) for i in range(8)]
        write(os.path.join(cls.scratch, "press.csv"), "id,x,y,radius\n" + "\n".join(rows) + "\n")
        write(os.path.join(cls.scratch, "cell.csv"), "id,x,y,radius,vx,vy\n1,0.2,0.2,0.05,1,2\n2,0.5,0.5,0.05,0,1\n3,0.8,0.3,0.05,1,0\n")
        write(os.path.join(cls.scratch, "sphere.csv"), "id,x,y,z,radius\n1,0,0,0,0.01\n")

    def bodies(self, run):
        """Positions and velocities of all written steps but the first."""
        found = run.results()
        return {f"{step}/{name}": found[f"/steps/{step}/bodies/{name}"] for step in steps_of(found)[1:] for name in ("position", "velocity")}

    def check_as_in_case(self, title, groups, lines, changed):
        """Set before the first step, it moves bodies as if the case had it."""
        case = run_case(changed, directory=self.here(title + "_case"))
        self.assert_status(case, 0)
        loop = self.play(title, groups, SET.format(lines))
        self.assertEqual(differences(self.bodies(case), self.bodies(loop)), [])
        plain = run_case(groups, directory=self.here(title + "_plain"))
        self.assertNotEqual(differences(self.bodies(plain), self.bodies(loop)), [], "it acts")

    def test_gravity(self):
        self.check_as_in_case("gravity", HEAP, "s.gravity = (3.0, -7.0)", merged(HEAP, {"scene": {"gravity": [3.0, -7.0]}}))

    def test_friction(self):
        """Between grains and at boundaries, along which the grains slide."""
        slope = merged(PRESS, {"boundary": PRESS["boundary"][:3], "scene": {"friction": 0.3, "gravity": [5.0, -8.0]}, "time": {"steps": 120},
                               "output": {"every": 20}})
        lines = "s.friction = 0.7; s.boundaries['floor'].friction = 0.1; s.boundaries['right'].friction = 0.1"
        walls = [{**wall, "friction": 0.3 if wall["name"] == "left" else 0.1} for wall in slope["boundary"]]
        self.check_as_in_case("friction", slope, lines, merged(slope, {"scene": {"friction": 0.7}, "boundary": walls}))
        # grains alone
        walls = [{**wall, "friction": 0.3} for wall in slope["boundary"]]
        self.check_as_in_case("grains", slope, "s.friction = 0.7", merged(slope, {"scene": {"friction": 0.7}, "boundary": walls}))

    def test_force_on_a_lid(self):
        heavy = PRESS["boundary"][:3] + [{**PRESS["boundary"][3], "force": [0.0, -500.0]}]
        light = {"time": {"steps": 200}, "output": {"every": 50}}
        self.check_as_in_case("lid", merged(PRESS, light), "s.boundaries['lid'].applied_force = (0.0, -500.0)",
                              merged(PRESS, light, {"boundary": heavy}))

    def test_pressure_on_a_lid(self):
        pressed = [PRESS["boundary"][:3] + [{**PRESS["boundary"][3], "pressure": p}] for p in (0.0, 2000.0)]
        light = {"time": {"steps": 200}, "output": {"every": 50}}
        self.check_as_in_case("pressure", merged(PRESS, light), "s.boundaries['lid'].pressure = 2000.0",
                              merged(PRESS, light, {"boundary": pressed[1]}))

    def test_drives(self):
        """A place is the sum of h ((1 - theta) v_i + theta v_{i+1}), an angle that of the spins."""
        script = """
speeds, spins = np.linspace(0.3, -0.1, 40), np.linspace(2.0, 5.0, 40)
with gravier.Simulation(case, quiet=True) as s:
    paddle = s.boundaries["paddle"]
    h, way, angle, last, turning = s.time_step, 0.0, 0.0, 0.0, 1.0
    for v, w in zip(speeds, spins):
        paddle.velocity = (v, 2.0 * v)
        paddle.spin = w
        s.step()
        way += h * (0.5 * last + 0.5 * v)
        angle += h * (0.5 * turning + 0.5 * w)
        last, turning = v, w
        assert np.array_equal(paddle.velocity, (v, 2.0 * v)) and paddle.spin == w
    place = np.array([3.0 + way, 2.0 * way]) + 0.5 * np.array([np.cos(angle), np.sin(angle)])
    assert np.abs(paddle.position - place).max() < 1e-13, (paddle.position, place)
"""
        paddle = {"name": "paddle", "shape": "segment", "point": [3.5, 0.0], "end": [3.6, 0.0], "pivot": [3.0, 0.0], "rotation": 1.0}
        for ranks in (1, 2):
            self.play(f"drives{ranks}", merged(HEAP, {"boundary": HEAP["boundary"] + [paddle]}), script, ranks=ranks)

    def test_servo_against_a_lid(self):
        """A loop presses the lid until the floor carries a given force: what the lid must then bear is that force less the weight of the disks,
        and the disks stand as under a lid that is given this load."""
        script = """
target = 1500.0
with gravier.Simulation(case, quiet=True) as s:
    lid, floor = s.boundaries["lid"], s.boundaries["floor"]
    weight = 9.81 * s.sum(s.bodies.mass.sum())
    load = 300.0
    while s.goes_on:
        s.step()
        # impacts are not to be followed
        load += np.clip(0.05 * (target + floor.force[1]), -5.0, 5.0)
        lid.applied_force = (0.0, -load)
    if s.rank == 0:
        print(weight, load, floor.force[1], lid.force[1], lid.position[1])
"""
        loop = self.play("servo", PRESS, script, ranks=2)
        weight, load, carried, borne, height = (float(word) for word in loop.stdout.split())
        self.assertGreater(weight, 50.0)
        self.assertLess(abs(load - (1500.0 - weight)), 1e-2 * 1500.0)
        self.assertLess(abs(carried + 1500.0), 1e-2 * 1500.0)
        self.assertLess(abs(borne - (1500.0 - weight)), 1e-2 * 1500.0)
        given = run_case(merged(PRESS, {"boundary": PRESS["boundary"][:3] + [{**PRESS["boundary"][3], "force": [0.0, weight - 1500.0]}]}),
                         directory=self.here("given"))
        self.assert_status(given, 0)
        found = given.results()
        self.assertLess(abs(found["/steps/600/boundaries/position"][3, 1] - height), 0.005)

    def test_drag(self):
        """A sphere under gravity and an explicit drag: v' = v + h (g - c v/m), to the limit m g/c."""
        script = """
with gravier.Simulation(case, quiet=True, forces=True) as s:
    m, h = s.bodies.mass[0], s.time_step
    c = 0.05 * m / h
    v = 0.0
    while s.goes_on:
        s.bodies.force = -c * s.bodies.velocity
        s.step()
        v += h * (-9.81 - c / m * v)
        assert abs(s.bodies.velocity[0, 2] - v) <= 1e-13 * abs(v), (s.made, v)
    assert abs(v + 9.81 * m / c) < 1e-12 and np.all(s.bodies.velocity[0, :2] == 0.0)
"""
        loop = self.play("drag", SPHERE, script)
        with open(loop.path("results", "run.log"), encoding="utf-8") as file:
            off, turnover = re.search(r"balance off by (\S+) J; the sizes of its terms sum up to (\S+) J", file.read()).groups()
        self.assertLess(float(off), 1e-12 * float(turnover))

    def test_forces_on_any_ranks(self):
        """Forces of each body's own travel with it and to its copies: the same bits on any ranks, and energies that balance."""
        script = """
with gravier.Simulation(case, quiet=True, forces=True) as s:
    while s.goes_on:
        push = 3.0 * np.sin(s.bodies.id + 0.3 * s.made)
        s.bodies.force = s.bodies.mass[:, None] * np.stack([push, -0.5 * push], axis=1)
        s.step()
"""
        groups = merged(HEAP, {"decomposition": {"subdomains": 4}, "time": {"steps": 100}, "solver": {"tolerance": 1e-8}})
        runs = [self.play(f"forces{ranks}", groups, script, ranks=ranks) for ranks in ((1, 2, 4) if LONG else (1, 2))]
        for other in runs[1:]:
            self.same(runs[0], other)
        history = runs[0].history()
        scale = np.abs(history["load_work"]).max()
        self.assertLess(np.abs(history["energy_error"]).max(), 1e-11 * scale)
        plain = run_case(groups, directory=self.here("unforced"))
        self.assertGreater(np.abs(plain.results()["/steps/100/bodies/position"] - runs[0].results()["/steps/100/bodies/position"]).max(), 1e-3)

    def test_forces_hold_what_weight_would(self):
        """m g as an applied force acts as gravity does."""
        script = """
with gravier.Simulation(case, quiet=True, forces=True) as s:
    while s.goes_on:
        s.bodies.force = s.bodies.mass[:, None] * np.array([0.0, -9.81])
        s.step()
"""
        groups = merged(HEAP, {"solver": {"tolerance": 1e-10, "max_iterations": 20000, "velocity_scale": 0.01}, "output": {"every": 10}})
        weight = run_case(groups, directory=self.here("weight"))
        loop = self.play("weightless", merged(groups, {"scene": {"gravity": [0.0, 0.0]}}), script)
        for name, values in self.bodies(weight).items():
            self.assertLess(np.abs(values - self.bodies(loop)[name]).max(), 1e-6, name)

    def test_sleeping_contacts_wake(self):
        """What is set disturbs a heap that sleeps."""
        script = """
with gravier.Simulation(case, quiet=True) as s:
    while s.goes_on:
        s.step()
        if s.made == 900:
            s.gravity = (4.0, -9.81)
"""
        groups = merged(HEAP, {"solver": {"sleeping": True, "tolerance": 1e-3}, "time": {"steps": 905}, "output": {"every": 0, "checkpoint_every": 0}})
        asleep = self.play("asleep", groups, script).history()["sleeping"]
        self.assertGreater(asleep[899], 20)
        self.assertEqual(asleep[900], 0)

    def test_velocities(self):
        """Momentum that the loop gives is there after the step, and no body loses energy to the account."""
        script = """
with gravier.Simulation(case, quiet=True) as s:
    s.step()
    velocity = np.array(s.bodies.velocity)
    velocity[:, 0] += 0.25
    s.bodies.velocity = velocity
    s.bodies.spin = np.full_like(s.bodies.spin, 4.0)
    s.step()
    assert np.abs(s.bodies.velocity[:, 0] - velocity[:, 0]).max() < 1e-15
    assert np.all(s.bodies.spin == 4.0)
    assert np.abs(s.bodies.velocity[:, 1] - velocity[:, 1] + 9.81 * s.time_step).max() < 1e-15
"""
        loop = self.play("kick", merged(PRESS, {"boundary": [], "scene": {"friction": 0.3}}), script)
        history = loop.history()
        self.assertLess(np.abs(history["energy_error"]).max(), 1e-14)
        # what the bodies were given has not been taken away from them
        self.assertLess(history["carried_away"][-1], -1.0)

    def test_bodies_set_on_some_ranks(self):
        """A rank without a subdomain sets nothing, and one may set what it wants to: the same bits as on one rank. Grains that sleep wake on
        all ranks, in a checkpoint too, and without one."""
        groups = merged(HEAP, {"solver": {"sleeping": True, "tolerance": 1e-3}, "time": {"steps": 710},
                               "output": {"every": 300, "checkpoint_every": 0}})
        script = """
with gravier.Simulation(case, quiet=True, forces=True) as s:
    while s.goes_on:
        s.step()
        for part in s.subdomains:
            if s.made == 10 and 1 in part.id:
                part.velocity = np.where((part.id == 1)[:, None], [0.1, 1.0], part.velocity)
                part.spin = np.where((part.id == 1)[:, None], 3.0, part.spin)
            if s.made == 690 and 48 in part.id:
                part.force = np.where((part.id == 48)[:, None], [0.0, 1.0], 0.0)
        if s.made == 690 and written:
            s.checkpoint()
"""
        for subdomains in (1, 2):
            case = merged(groups, {"decomposition": {"subdomains": subdomains}})
            runs = [self.play(f"some{subdomains}_{ranks}", case, f"written = {subdomains == 1}\n" + script, ranks=ranks) for ranks in (1, 2)]
            self.same(*runs)
            asleep = runs[0].history()["sleeping"]
            # where nothing wakes them they sleep from step 641 or earlier to step 699 or later
            self.assertGreater(asleep[689], 20)
            self.assertEqual(asleep[690], 0)

    def test_cell(self):
        """What a loop sets of a cell acts as in the case; it reads edges, rates, stresses that are held, and columns of history.csv."""
        case = {"scene": {"bodies": "lattice", "lattice_count": [6, 6], "radius_min": 0.4, "radius_max": 0.6, "friction": 0.3, "density": 1.0,
                          "gravity": [0.0, 0.0], "period": [7.6, 7.6], "cell_shear_stress": [0.05], "cell_strain_rate": [0.1, 0.0],
                          "cell_pressure": [0.0, 1.0]},
                "time": {"step": 0.05, "steps": 100}, "output": {"directory": "results", "every": 100, "stress": True}}
        script = """
with gravier.Simulation(case, quiet=True) as s:
    s.cell.pressure_y, s.cell.shear_stress_xy, s.cell.strain_rate_x = 2.0, -0.2, -0.05
    while s.goes_on:
        s.step()
    assert (s.cell.pressure_y, s.cell.shear_stress_xy, s.cell.pressure_x) == (2.0, -0.2, 0.0)
    print(s.cell.strain_rate_x, s.cell.length_x, s.cell.length_y, s.cell.tilt_xy, s.cell.shear_rate_xy, s.real("stress_yy"),
          s.cell.strain_x, s.cell.strain_y, s.cell.shear_xy)
    names = [name for name in dir(s.cell) if not name.startswith("_")]
    assert len(names) == 12 and all(isinstance(getattr(s.cell, name), float) for name in names), names
    assert not hasattr(s.cell, "length_z") and not hasattr(s.cell, "length_x ")
"""
        wanted = merged(case, {"scene": {"cell_pressure": [0.0, 2.0], "cell_shear_stress": [-0.2], "cell_strain_rate": [-0.05, 0.0]}})
        loop, program = self.play("cell", case, script), run_case(wanted, directory=self.here("cell as in the case"))
        state, history = program.results(), program.history()
        for name in ("bodies/position", "bodies/velocity", "cell/edge", "cell/velocity", "contacts/impulse"):
            np.testing.assert_array_equal(loop.results()["/steps/100/" + name], state["/steps/100/" + name], name)
        self.assertIn(", shear_stress_xy = -2.000E-01 N/m", program.stdout)
        strain_rate, length_x, length_y, tilt, rate, stress, *strains = map(float, loop.stdout.split()[-9:])
        edge, velocity = (state[f"/steps/100/cell/{name}"] for name in ("edge", "velocity"))
        self.assertEqual([length_x, length_y, tilt], [edge[0, 0], edge[1, 1], edge[1, 0]])
        gradient = np.linalg.solve(edge, velocity).T
        np.testing.assert_allclose([strain_rate, rate], gradient[0], rtol=0, atol=1e-14)
        self.assertEqual([stress, *strains], [history[name][-1] for name in ("stress_yy", "cell_strain_x", "cell_strain_y", "cell_shear_xy")])

    def test_bodies_of_a_cell_that_moves(self):
        """What is taken out of a cell, and velocities that are set, are counted once; the last body of a cell that stresses drive stays."""
        case = {"scene": {"bodies": "file", "bodies_file": "../cell.csv", "period": [1.0, 1.0], "gravity": [0.0, 0.0], "cell_shear_rate": 0.5},
                "time": {"step": 1e-3, "steps": 12}, "output": {"directory": "results", "every": 0, "energy": True}}
        script = """
with gravier.Simulation(case, quiet=True) as s:
    while s.goes_on:
        s.step()
        if s.made == 3:
            s.remove([1])
        if s.made == 6:
            s.bodies.velocity = np.zeros_like(s.bodies.velocity)
"""
        history = self.play("moving cell", case, script).history()
        self.assertGreater(history["carried_away"][-1], 1e-3)
        self.assertLess(np.abs(history["energy_error"]).max(), 1e-12 * history["carried_away"][-1])
        line = "remove: no free body would be left in a cell that stresses drive; expected one that stays"
        last = f"""
with gravier.Simulation(case, quiet=True) as s:
    s.step()
    try:
        s.remove([1, 2, 3])
    except gravier.SimulationError as error:
        assert str(error) == {line!r}, str(error)
    else:
        raise AssertionError("not refused")
    s.remove([1, 2])
    while s.goes_on:
        s.step()
"""
        self.play("driven cell", merged(case, {"scene": {"cell_shear_rate": None, "cell_pressure": [100.0, 100.0]}}), last)

    def test_bodies_come_and_go(self):
        script = """
with gravier.Simulation(case, quiet=True) as s:
    mass, n = s.sum(s.bodies.mass.sum()), s.sum(len(s.bodies))
    for k in range(10):
        s.step()
    gone = np.isin(s.bodies.id, [1, 17])
    out = s.sum(s.bodies.mass[gone].sum())
    s.remove([17, 1])
    s.add_bodies([[0.03, 0.3], [0.08, 0.3]], 0.01, velocity=[[0.0, -1.0], [0.5, -1.0]], mass=[0.7, 0.9])
    s.add_bodies([[0.13, 0.3]], 0.011)
    assert s.sum(len(s.bodies)) == n, "they come with the next step"
    s.step()
    assert (s.whole("left"), s.whole("entered"), s.whole("bodies")) == (2, 3, n + 1)
    assert s.sum(np.isin(s.bodies.id, [1, 17]).sum()) == 0
    new = s.bodies.id > n
    next_id = -s.highest(-s.bodies.id[new].min(initial=10**6))
    # boundaries have identifiers, too
    assert s.sum(new.sum()) == 3 and s.sum(s.bodies.id[new].sum()) == 3 * next_id + 3
    expected = mass - out + 0.7 + 0.9 + 2500.0 * np.pi * 0.011**2
    assert abs(s.sum(s.bodies.mass.sum()) - expected) < 1e-12 * expected
    # 0.7 kg at -1 m/s, and a step of gravity
    first = s.bodies.id == next_id
    assert abs(s.sum((s.bodies.mass[first] * s.bodies.velocity[first, 1]).sum()) + 0.7 * (1.0 + 9.81 * s.time_step)) < 1e-14
    while s.goes_on:
        s.step()
"""
        groups = merged(HEAP, {"decomposition": {"subdomains": 3}, "time": {"steps": 120}})
        runs = [self.play(f"guests{ranks}", groups, script, ranks=ranks) for ranks in (1, 2)]
        self.same(*runs)
        history = runs[0].history()
        self.assertEqual((history["grains"][9], history["grains"][10]), (48, 49))
        self.assertLess(np.abs(history["energy_error"]).max(), 1e-11 * np.abs(history["load_work"]).max())

    def test_newcomers_in_a_checkpoint(self):
        """A restart knows the grains that a loop has added, and their mass to the bit, with an insertion and without one."""
        script = """
with gravier.Simulation(case, restart="--restart" in sys.argv) as s:
    while s.goes_on:
        if s.made == 10:
            s.add_bodies([[0.03, 0.3], [0.08, 0.3]], 0.01, mass=[0.1, 0.7])
        if s.made == 20:
            s.remove([17])
        s.step()
"""
        outlet = {"name": "out", "shape": "outlet", "point": [0.0, 0.004], "normal": [0.0, 1.0]}
        closed = merged(HEAP, {"boundary": [outlet]})
        opened = merged(closed, {"insertion": [{"name": "rain", "lower": [0.0, 0.4], "upper": [0.2, 0.5], "rate": 300.0, "radius": 0.009}]})
        for title, groups in (("closed", closed), ("opened", opened)):
            whole = self.play(title, groups, script)
            half = merged(groups, {"time": {"steps": 30}})
            parts = [self.play(f"{title}{k}", half, script) for k in range(2)]
            by_loop = self.play(f"{title}0", groups, script, "--restart", ranks=2)
            write(parts[1].path("case.nml"), namelist(groups))
            by_program = gravier("--restart", "case.nml", directory=parts[1].directory)
            self.assert_status(by_program, 0)
            for again in (by_loop, by_program):
                self.assertEqual(differences(self.states(whole), self.states(again)), [])
                lines = [[line for line in run.stdout.splitlines() if line.startswith("grains      ")] for run in (whole, again)]
                self.assertRegex(lines[0][-1], r" 48 at the start \+ (2|2\d) entered - ")
                self.assertEqual(lines[0], lines[1])

    def states(self, run):
        """What a run has written, but for the state in which it was interrupted and the input of its beginning."""
        return {name: value for name, value in written(run.directory).items()
                if not any(part in name for part in ("steps/30", "last_written", "input_text"))}

    def test_stop_criterion(self):
        script = """
with gravier.Simulation(case) as s:
    while s.goes_on:
        s.step()
        if s.highest(np.abs(s.bodies.velocity).max()) > 0.3:
            s.stop("a disk is faster than 0.3 m/s")
    assert not s.goes_on
assert s.status == 0
"""
        for ranks in (1, 2):
            loop = self.play(f"stop{ranks}", HEAP, script, ranks=ranks)
            # 0.3 m/s after 30.6 steps of gravity
            self.assertIn("ended       after step 31 of 60: a disk is faster than 0.3 m/s\n", loop.stdout)
            self.assertEqual(steps_of(loop.results()), [0, 20, 31])
            self.assertIn("checkpoint  of step 31 written", loop.stdout)


if __name__ == "__main__":
    unittest.main()
