"""Sleeping: bodies at rest stand still and leave the contact problem until something disturbs them. Two heaps of disks stand side by side,
a wall between them; a disk falls on the left one. Spheres roll down a bed of many others, and wake those near them alone."""
import re
import unittest

import numpy as np

from gravier_runs import RunTestCase, contents, differences, each, merged, run_case, write
from small_scenes import Grain, Record, bodies_csv, plane

TOLERANCE = 1e-4
COUNT, SPACING, RADIUS = 7, 0.021, 0.01
HALF = COUNT * SPACING
#: grains of a heap, one after the other; the disk that falls is the last grain
HEAP = COUNT**2
#: it falls for 0.25 s; both heaps are at rest long before
STEPS, IMPACT, REST = 420, 250, 100
SLEEPING = {"solver": {"sleeping": True}}


def heaps():
    """The grains of both heaps on lattices, then the disk."""
    rng = np.random.default_rng(3)
    grains = []
    for heap in range(2):
        for k in range(HEAP):
            radius = rng.uniform(0.8, 1.0) * RADIUS
            place = [heap * HALF + (k % COUNT + 0.5) * SPACING, (k // COUNT + 0.6) * SPACING]
            grains.append(Grain(place, radius=radius, mass=2800.0 * np.pi * radius**2))
    grains.append(Grain([0.5 * HALF, COUNT * SPACING + 0.5 * 9.81 * (1e-3 * IMPACT)**2], radius=RADIUS,
                        mass=2800.0 * np.pi * RADIUS**2))
    return grains


class Sleeping(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.grains = heaps()
        bodies = write(f"{cls.scratch}/heaps.csv", bodies_csv(cls.grains))
        wall = {"shape": "segment", "point": [HALF, 0.0], "end": [HALF, 3.0]}
        cls.case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": bodies, "friction": 0.3},
            "boundary": [plane([0, 0], [0, 1]), plane([0, 0], [1, 0]), plane([2 * HALF, 0], [-1, 0]), wall],
            "time": {"step": 1e-3, "steps": STEPS},
            "solver": {"method": "nscdd", "criterion": "residual", "tolerance": TOLERANCE, "max_iterations": 5000},
            "decomposition": {"subdomains": 4, "repartition_every": 150},
            "output": {"directory": "results", "every": 10, "checkpoint_every": 100},
        }
        cls.plain, cls.sleeping = each(lambda name, more: run_case(merged(cls.case, more), 1, f"{cls.scratch}/{name}"),
                                       [("plain", {}), ("sleeping", SLEEPING)])

    def test_slow_plate(self):
        """A plate begins to rise slowly under a column that sleeps: all disks rise with it, and none stands still."""
        speed, begin, end = 1e-4, 0.3, 1.5
        table = write(f"{self.scratch}/plate.csv", f"time,vy\n0,0\n{begin - 1e-3},0\n{begin},{speed}\n100,{speed}\n")
        column = [Grain([0.0, (2 * k + 1) * RADIUS], radius=RADIUS, mass=1.0) for k in range(20)]
        case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": write(f"{self.scratch}/column.csv", bodies_csv(column)), "friction": 0.3},
            "boundary": [{**plane([0, 0], [0, 1]), "table": table}],
            "time": {"step": 1e-3, "steps": round(end / 1e-3)},
            "solver": {"sleeping": True},
            "output": {"directory": "results", "every": round(end / 1e-3)},
        }
        run = run_case(case, 1, f"{self.scratch}/plate")
        self.assert_status(run, 0)
        asleep = run.history()["sleeping"]
        self.assertGreater(asleep[:round(begin / 1e-3) - 1].max(), 0)
        self.assertEqual(asleep[round(begin / 1e-3) + 1:].max(), 0)
        results = run.results()
        rise = results[f"/steps/{round(end / 1e-3)}/bodies/position"][:, 1] - results["/steps/0/bodies/position"][:, 1]
        self.assertLess(np.abs(rise / (speed * (end - begin)) - 1.0).max(), 0.05)

    def moving(self, name, boundaries, rows, speed, steps, gravity):
        """A run of disks that sleep where they may, which move along x with a speed at the start; its ways along x over those of the speed."""
        disks = write(f"{self.scratch}/{name}.csv", "id,x,y,radius,mass,vx\n" + "".join(
            f"{k},{x},{y},{RADIUS},1.0,{speed}\n" for k, (x, y) in enumerate(rows, 1)))
        run = run_case({
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": disks, "friction": 0.3, "wall_friction": 0.0, "gravity": [0.0, -gravity]},
            "boundary": boundaries, "time": {"step": 1e-3, "steps": steps}, "solver": {"sleeping": True},
            "output": {"directory": "results", "every": steps, "boundary_forces": True}}, 1, f"{self.scratch}/{name}")
        self.assert_status(run, 0)
        state = run.results()
        first, last = (state[f"/steps/{step}/bodies/position"][:, 0] for step in (0, steps))
        return (last - first) / (speed * 1e-3 * steps), run.history()

    def test_motion_as_a_whole(self):
        """What moves slowly and evenly is not at rest. Disks between two pistons that press them with the same force go on in a frictionless pipe, whose
        momentum nothing changes, and a box with a lid takes its disks along. Errors of solves go to and fro, and do not keep disks awake."""
        rows = [(RADIUS * (1.0 + i * 3**0.5), RADIUS * (1 + 2 * j + i % 2)) for i in range(8) for j in range(4)]
        width, force, speed = RADIUS * (2.0 + 7.0 * 3**0.5), 2000.0, 1e-2
        piston = {"free": [True, False], "mass": 10.0, "velocity": [speed, 0.0]}
        pipe = [
            plane([0, 0], [0, 1]), plane([0, 9 * RADIUS], [0, -1]), {**plane([0, 0], [1, 0]), **piston, "force": [force, 0.0]},
            {**plane([width, 0], [-1, 0]), **piston, "force": [-force, 0.0]}]
        ways, _ = self.moving("pipe", pipe, rows, speed, 1000, 0.0)
        self.assertLess(np.abs(ways - 1.0).max(), 0.01)
        square = [(RADIUS * (2 * i + 1), RADIUS * (2 * j + 1)) for i in range(6) for j in range(6)]
        along, speed = {"velocity": [1e-4, 0.0]}, 1e-4
        ways, history = self.moving("box", [
            {**plane([0, 0], [0, 1]), **along, "name": "floor"}, {**plane([0, 0], [1, 0]), **along}, {**plane([12 * RADIUS, 0], [-1, 0]), **along},
            {**plane([0, 12 * RADIUS], [0, -1]), **along, "free": [False, True], "mass": 10.0, "force": [0.0, -1000.0]}], square, speed, 1000, 0.0)
        self.assertLess(np.abs(ways - 1.0).max(), 0.01)
        self.assertLess(abs(history["force_y:floor"][-100:].mean() / -1000.0 - 1.0), 1e-3)

    def test_beside_what_is_faster(self):
        """A floor rises slowly under a heap, and far away a paddle turns fast that touches nothing: the heap rises with the floor."""
        rows = [(RADIUS * (2 * i + 1), RADIUS * (2 * j + 1)) for i in range(8) for j in range(8)]
        disks = write(f"{self.scratch}/beside.csv", bodies_csv([Grain(list(place), radius=RADIUS, mass=1.0) for place in rows]))
        speed, begin, steps = 1e-4, 0.5, 1500
        table = write(f"{self.scratch}/rise.csv", f"time,vy\n0,0\n{begin - 1e-3},0\n{begin},{speed}\n100,{speed}\n")
        case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": disks, "friction": 0.3},
            "boundary": [{**plane([0, 0], [0, 1]), "table": table}, {**plane([0, 0], [1, 0]), "friction": 0.0}, {**plane([16 * RADIUS, 0], [-1, 0]), "friction": 0.0},
                         {"shape": "segment", "point": [2.0, 1.0], "end": [2.2, 1.0], "rotation": [2.5]}],
            "time": {"step": 1e-3, "steps": steps}, "solver": {"sleeping": True}, "output": {"directory": "results", "every": steps}}
        run = run_case(case, 1, f"{self.scratch}/beside")
        self.assert_status(run, 0)
        self.assertGreater(run.history()["sleeping"][round(begin / 1e-3) - 5], 60)
        state = run.results()
        rise = state[f"/steps/{steps}/bodies/position"][:, 1] - state["/steps/0/bodies/position"][:, 1]
        self.assertLess(np.abs(rise / (speed * (1e-3 * steps - begin)) - 1.0).max(), 0.1)

    def test_loads_that_change_slowly(self):
        """Changes that wake no body reach the ground in the end: columns that grow disk by disk, and a lid whose load rises. The floor then bears all
        of it to 4 %, which is within an accuracy of a tenth of the load of a step. Earlier it bore a third of 24 disks."""
        count, every, gap = 24, 60, 1e-9
        first = write(f"{self.scratch}/first.csv", bodies_csv([Grain([0.0, RADIUS], radius=RADIUS, mass=2500.0 * np.pi * RADIUS**2)]))
        entries = [{"name": f"disk {k}", "region": "ball", "centre": [0.0, RADIUS * (2 * k + 1) + gap * (k + 1)],
                    "region_radius": RADIUS + 0.5 * gap, "radius": RADIUS, "count": 1, "start": 1e-3 * every * k} for k in range(1, count)]
        column = write(f"{self.scratch}/twenty.csv", bodies_csv([Grain([0.0, (2 * k + 1) * RADIUS], radius=RADIUS, mass=1.0) for k in range(20)]))
        load = write(f"{self.scratch}/load.csv", f"time,fy\n0,0\n0.3,0\n1.3,{-20 * 9.81}\n")
        output = {"directory": "results", "every": 0, "boundary_forces": True}
        floor = {**plane([0, 0], [0, 1]), "name": "floor"}
        grown = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": first, "density": 2500.0, "alert_distance": 0.1 * RADIUS},
            "boundary": [floor, plane([-1.0005 * RADIUS, 0], [1, 0]), plane([1.0005 * RADIUS, 0], [-1, 0])], "insertion": entries,
            "time": {"step": 1e-3, "steps": every * (count + 4)}, "solver": {"sleeping": True}, "output": output}
        loaded = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": column, "friction": 0.3},
            "boundary": [floor, {**plane([0, 40 * RADIUS], [0, -1]), "name": "lid", "free": [False, True], "mass": 1.0, "table": load}],
            "time": {"step": 1e-3, "steps": 2000}, "solver": {"sleeping": True}, "output": output}
        weight = 2500.0 * np.pi * RADIUS**2 * 9.81
        for name, case, right in (("grown", grown, count * weight), ("loaded", loaded, 41 * 9.81)):
            with self.subTest(name):
                run = run_case(case, 1, f"{self.scratch}/{name}")
                self.assert_status(run, 0)
                history = run.history()
                self.assertGreater(history["sleeping"].max(), 15)
                self.assertLess(abs(history["force_y:floor"][-100:].mean() / -right - 1.0), 0.04)

    def test_load_that_jumps(self):
        """The force on a piston rises by a twentieth in one step, below disks that sleep: piston and disks go the way of that force at once. They were
        held for up to 200 steps."""
        rng = np.random.default_rng(1)
        grains = [Grain([RADIUS * 2.1 * (i + 0.5), RADIUS * (2.1 * j + 1.15)], radius=radius, mass=2500.0 * np.pi * radius**2)
                  for j in range(12) for i in range(6) for radius in [rng.uniform(0.85, 1.0) * RADIUS]]
        mass, jump, steps, extra = 20.0, 0.711, 1010, 0.05
        weight = 9.81 * sum(grain.mass for grain in grains)
        load = write(f"{self.scratch}/jump.csv", f"time,fy\n0,{weight}\n{jump - 1e-3},{weight}\n{jump},{(1 + extra) * weight}\n")
        case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": write(f"{self.scratch}/jump_bodies.csv", bodies_csv(grains)), "friction": 0.4,
                      "wall_friction": 0.0},
            "boundary": [plane([0, 0], [0, 1]), plane([0, 0], [1, 0]), plane([12.6 * RADIUS, 0], [-1, 0]),
                         {**plane([0, 0], [0, 1]), "name": "piston", "free": [False, True], "mass": mass, "table": load}],
            "time": {"step": 1e-3, "steps": steps}, "solver": {"sleeping": True},
            "output": {"directory": "results", "every": 0, "boundary_forces": True}}
        run = run_case(case, 1, f"{self.scratch}/jump")
        self.assert_status(run, 0)
        history = run.history()
        before, after = (history["position_y:piston"][step - 1] for step in (round(jump / 1e-3) - 1, steps))
        self.assertGreater(history["sleeping"][round(jump / 1e-3) - 10], 50)
        exact = 0.5 * extra * weight / (weight / 9.81 + mass) * (1e-3 * steps - jump)**2
        self.assertLess(abs((after - before) / exact - 1.0), 0.01)

    def test_contacts_at_an_early_end(self):
        """A plate pushes a disk along until the run ends by it, beside a column that sleeps: all contacts are written as in the middle of
        the last step, as they are where nothing sleeps."""
        disks = [Grain([3.0, (2 * k + 1) * RADIUS], radius=RADIUS, mass=1.0) for k in range(3)]
        disks.append(Grain([0.5 + RADIUS, RADIUS], radius=RADIUS, mass=1.0))
        case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": write(f"{self.scratch}/pushed.csv", bodies_csv(disks))},
            "boundary": [plane([0, 0], [0, 1]), {**plane([0.5, 0], [1, 0]), "name": "plate", "velocity": [0.1, 0.0]}],
            "time": {"step": 1e-3, "steps": 1000, "stop_boundary": "plate", "stop_displacement": 0.02},
            "solver": {"accuracy": 1e-6},
            "output": {"directory": "results", "every": 1000, "contacts": True},
        }
        gaps = []
        for name, more in (("awake", {}), ("asleep", SLEEPING)):
            run = run_case(merged(case, more), 1, f"{self.scratch}/pushed {name}")
            self.assert_status(run, 0)
            self.assertEqual(run.history()["sleeping"][-1], 3 * len(more))
            gaps.append(run.results()[f"/steps/{int(run.history()['step'][-1])}/contacts/gap"])
        self.assertEqual(len(gaps[0]), 5)
        self.assertLess(np.abs(gaps[1] - gaps[0]).max(), 1e-9)

    def test_the_problem_of_all_contacts_on_ranks(self):
        """What is left out comes back into the file of FCLIB, with bodies that ranks share."""
        files = []
        for ranks in (1, 2):
            case = merged(self.case, SLEEPING, {"time": {"steps": 202}, "output": {"fclib_step": 201, "checkpoint_every": 0}})
            run = run_case(case, ranks, f"{self.scratch}/problem {ranks}")
            self.assert_status(run, 0)
            self.assertGreater(run.history()["sleeping"][200], 100)
            files.append(contents(run.path("results", "step_201.hdf5")))
        self.assertEqual(differences(*files), [])

    def test_falling_disk(self):
        """The heap that is hit wakes, the other one sleeps on, and both come to the places that they have without sleep."""
        self.assert_status(self.sleeping, 0)
        history, record = self.sleeping.history(), Record(self.sleeping, self.grains, 2)
        self.assertLessEqual(history["residual"].max(), TOLERANCE)
        asleep = history["sleeping"] / history["contacts"]
        left, right, disk = slice(0, HEAP), slice(HEAP, 2 * HEAP), 2 * HEAP
        speed = np.abs(record.all_velocities).max(axis=2)
        before = record.step.tolist().index(IMPACT - 20)
        # whole heaps sleep before the disk arrives, and all grains stand still; it wakes the left one, and all sleep again
        self.assertGreater(asleep[IMPACT - 20], 0.95)
        self.assertEqual(speed[before, :disk].max(), 0.0)
        hit = slice(before, before + 12)
        self.assertGreater(speed[hit, left].max(), 0.0)
        self.assertLess(asleep[IMPACT:IMPACT + 100].min(), 0.9)
        self.assertGreater(asleep[-1], 0.95)
        self.assertEqual(speed[-1].max(), 0.0)
        # the right heap knows nothing of it
        self.assertEqual(speed[before:, right].max(), 0.0)
        self.assertEqual(np.ptp(record.position[before:, right], axis=0).max(), 0.0)
        # measured: 7e-4 of a radius, between friction and walls that leave more than one place to rest
        plain = Record(self.plain, self.grains, 2)
        self.assertLess(np.abs(record.position[-1] - plain.position[-1]).max(), 2e-3 * RADIUS)

    def test_work(self):
        """Sleep saves relaxations of contacts: from the step on in which both heaps rest all but an eighth (measured: 3584 of 33 087), in all,
        the fall of the heaps included, what the log tells; and the log says how many contacts were left out."""
        relaxed = [int(re.search(r"sweeps, (\d+) contact relaxations", run.stdout).group(1)) for run in (self.plain, self.sleeping)]
        self.assertLess(relaxed[1], relaxed[0])
        plain, sleeping = self.plain.history(), self.sleeping.history()
        self.assertLess(8 * (sleeping["iterations"] * (sleeping["contacts"] - sleeping["sleeping"]))[REST:].sum(),
                        (plain["iterations"] * plain["contacts"])[REST:].sum())
        slept = int(re.search(r"sleeping +(\d+) contacts of bodies asleep were left out", self.sleeping.stdout).group(1))
        self.assertEqual(slept, self.sleeping.history()["sleeping"].sum())
        self.assertEqual(sum(self.plain.history()["sleeping"]) + sum(self.plain.history()["woken"]), 0, "nobody sleeps unless asked to")

    def test_ranks_and_restart(self):
        """Bit by bit the same on other numbers of ranks, and from a checkpoint between impact and rest."""
        case, where = merged(self.case, SLEEPING), f"{self.scratch}/on 2 and 4"
        self.assert_status(run_case(merged(case, {"time": {"steps": IMPACT + 20}}), 2, where), 0)
        run = run_case(case, 4, where, options=["--restart"])
        self.assert_status(run, 0)
        # the text of the input tells how many steps were asked for first
        differing = differences(self.sleeping.results(), run.results())
        # the state written when the first run ended
        self.assertEqual([name for name in differing if name != "/run@input_text"], [])
        for column in ("sleeping", "woken", "iterations", "residual"):
            self.assertEqual(self.sleeping.history()[column].tolist(), run.history()[column].tolist(), column)

    def test_velocity_error(self):
        """Solves that end by the velocity error let bodies sleep as well. Of the 170 steps after the impact a few are solved anew because
        bodies wake, until the heap rests again (measured: 3). Of the relaxations after the first fall sleep saves all but a fifth (measured:
        2528 of 45 527)."""
        case = merged(self.case, {"solver": {"criterion": "velocity_error", "tolerance": None}, "output": {"checkpoint_every": 0}})
        plain, sleeping = each(lambda name, more: run_case(merged(case, more), 1, f"{self.scratch}/error {name}"),
                               [("plain", {}), ("sleeping", SLEEPING)])
        self.assert_status(sleeping, 0)
        history = sleeping.history()
        asleep = history["sleeping"] / history["contacts"]
        self.assertGreater(asleep[IMPACT - 20], 0.95)
        self.assertLess(asleep[IMPACT:IMPACT + 100].min(), 0.9)
        # in step 400 all wake
        self.assertGreater(asleep[398], 0.95)
        self.assertGreater(history["woken"].sum(), 0)
        self.assertLessEqual(history["woken"].sum(), 12)
        relaxed = [(each["iterations"] * (each["contacts"] - each["sleeping"]))[REST:].sum() for each in (plain.history(), history)]
        self.assertLess(5 * relaxed[1], relaxed[0])

    def test_schwarz_and_nlgs(self):
        """The same sleep under the other methods; a boundary that begins to move, and gravity that changes, wake it."""
        gravity = write(f"{self.scratch}/gravity.csv", "time,gx,gy\n0,0,-9.81\n0.20,0,-9.81\n0.201,0.5,-9.81\n")
        drive = write(f"{self.scratch}/drive.csv", "time,vx\n0,0\n0.20,0\n0.201,-0.05\n")
        short = merged(self.case, SLEEPING, {"time": {"steps": 210}, "output": {"checkpoint_every": 0}})
        walls = list(self.case["boundary"])
        walls[1] = {**walls[1], "table": drive}
        cases = [("schwarz", {"solver": {"method": "schwarz"}, "boundary": walls}),
                 ("nlgs", {"solver": {"method": "nlgs"}, "decomposition": {"subdomains": None, "repartition_every": 0},
                           "scene": {"gravity_table": gravity}})]
        runs = each(lambda name, more: run_case(merged(short, more), 1, f"{self.scratch}/{name}"), cases)
        for run in runs:
            self.assert_status(run, 0)
            history = run.history()
            self.assertLessEqual(history["residual"].max(), TOLERANCE)
            self.assertGreater(history["sleeping"][195] / history["contacts"][195], 0.9)
        # of the contacts with the wall and their neighbours
        asleep = runs[0].history()["sleeping"]
        self.assertGreater(asleep[198], asleep[201])
        self.assertGreater(asleep[-1], 0)
        self.assertEqual(runs[1].history()["sleeping"][202:].tolist(), [0] * 8)

    def test_all_methods(self):
        """The enriched methods and Newton's have sleepers as well."""
        short = merged(self.case, SLEEPING, {"time": {"steps": IMPACT + 30}, "output": {"checkpoint_every": 0, "every": 0}})
        runs = each(lambda name, more: run_case(merged(short, more), 1, f"{self.scratch}/{name}"),
                    [(method, {"solver": {"method": method}}) for method in ("nscdd_ep", "schwarz_ec", "newton")])
        for run in runs:
            self.assert_status(run, 0)
            history = run.history()
            asleep = history["sleeping"] / history["contacts"]
            self.assertGreater(asleep[IMPACT - 20], 0.95)
            self.assertLess(asleep[IMPACT:].min(), 0.9)
            self.assertLessEqual(history["residual"].max(), TOLERANCE)

    def test_what_is_shown(self):
        """Diagnostics and files have all contacts, those that are left out too: the floor bears the weight of what sleeps, and a state has as
        many contacts as without sleep. What is shown changes no bit of the motion."""
        weight = 9.81 * sum(grain.mass for grain in self.grains[:2 * HEAP])
        steps = {"time": {"steps": IMPACT + 10}}
        shown = merged(self.case, SLEEPING, steps, {"output": {"every": 3, "boundary_forces": True, "stress": True, "energy": True,
                                                                    "checkpoint_every": 0}})
        hidden = merged(self.case, SLEEPING, steps, {"output": {"every": 0, "checkpoint_every": 0}})
        runs = each(lambda name, case: run_case(case, 2, f"{self.scratch}/{name}"), [("shown", shown), ("hidden", hidden)])
        for run in runs:
            self.assert_status(run, 0)
        history, results = runs[0].history(), runs[0].results()
        last = IMPACT - 10
        self.assertGreater(history["sleeping"][last - 1], 0.95 * history["contacts"][last - 1])
        self.assertLess(abs(history["force_y:boundary 1"][last - 1] + weight), 0.01 * weight)
        # nothing is turned over while all sleep but the disk that falls
        for name in ("dissipated_normal", "dissipated_friction", "energy_error"):
            self.assertLess(np.ptp(history[name][last - 40:last]), 1e-12, name)
        forces = results[f"/steps/{last}/boundaries/force"]
        self.assertLess(abs(forces[0, 1] + weight), 0.01 * weight)
        self.assertEqual(len(results[f"/steps/{last}/contacts/gap"]), history["contacts"][last - 1])
        final = f"/steps/{IMPACT + 10}/bodies/"
        for name in ("position", "velocity", "rest"):
            self.assertEqual(results[final + name].tolist(), runs[1].results()[final + name].tolist(), name)
        self.assertEqual(history["iterations"].tolist(), runs[1].history()["iterations"].tolist())

    def test_held_by_sleepers(self):
        """A sphere that sleepers hold and that rebounds from one of them has no velocity that their contacts allow. All wake then; the second
        method does not look for it in vain, and the log names the key that leads there."""
        edge = 4 * 0.021
        sides = [plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])]
        for axis in range(2):
            normal = [float(axis == 0), float(axis == 1), 0.0]
            sides += [plane([0.0, 0.0, 0.0], normal), plane([edge * x for x in normal], [-x for x in normal])]
        cases = [{"scene": {"dimension": 3, "bodies": "lattice", "lattice_count": [4, 4, 5], "radius_min": 0.007, "radius_max": 0.0104,
                            "seed": seed, "friction": 0.3, "restitution": 0.9, "wall_restitution": 0.2},
                  "boundary": sides, "time": {"step": 1e-3, "steps": 1000}, "solver": {"sleeping": True, "sleep_after": 1},
                  "output": {"directory": "results", "every": 0}} for seed in range(3)]
        runs = each(lambda seed, case: run_case(case, 1, f"{self.scratch}/held {seed}"), list(enumerate(cases)))
        shares = []
        for run in runs:
            self.assert_status(run, 0)
            history = run.history()
            self.assertEqual(history["converged"].min(), 1)
            # where nothing sleeps the second method is tried as ever
            taken = re.search(r"took over (\d+) solve", run.stdout)
            iterations = history["iterations"]
            held = iterations * ((history["woken"] > 0) & (iterations > 900))
            self.assertLess(int(taken[1]) if taken else 0, 0.2 * np.count_nonzero(held))
            shares.append([held[k:k + 50].sum() / (1 + iterations[k:k + 50].sum()) for k in range(0, 950, 10)])
        seed, begin = np.unravel_index(np.argmax(shares), np.shape(shares))
        part = [merged(cases[seed], {"time": {"steps": 10 * int(begin) + more}, "output": {"checkpoint_every": 10}}) for more in (0, 50)]
        self.assert_status(run_case(part[0], 1, self.here("part")), 0)
        run = run_case(part[1], 1, self.here("part"), options=["--restart"])
        self.assert_status(run, 0)
        self.assertIn("\nto halve it solves beside bodies that sleep, which fail and are solved anew with all awake, take most of the iterations: "
                      "a larger &solver sleep_after, now 1\n", run.stdout)

    def test_refusals(self):
        """One line, status 2."""
        for more, expected in [({"warm_start": False}, "bodies that sleep keep their impulses"),
                               ({"sleep_after": 0}, "sleep_after = 0: expected an integer >= 1"),
                               ({"sleep_speed": 0.0}, "sleep_speed = 0.0: expected a finite real number > 0")]:
            with self.subTest(more):
                run = run_case(merged(self.case, SLEEPING, {"solver": more}), 1, self.here("refused"), options=["--check"])
                self.assert_status(run, 2)
                self.assertEqual(len(run.stderr.splitlines()), 1, run)
                self.assertIn(expected, run.stderr)
        checked = run_case(merged(self.case, SLEEPING), 1, self.here("checked"), options=["--check"])
        self.assertIn("bodies at rest for 20 steps stand still and leave the contact problem", checked.stdout)


if __name__ == "__main__":
    unittest.main()
