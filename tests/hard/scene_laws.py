"""What every run must obey, whatever its method: checked from what it wrote, with formulas of its own.

From two states that follow each other: finite numbers, Coulomb's cone, action and reaction (the velocities written are those of the
impulses written), the laws of contact to the residual that the run reports, and no energy from nowhere."""
import array

import numpy as np

from gravier_runs import contents, steps_of
from small_scenes import EPS, INERTIA

#: sums of a dozen terms, each rounded, and the reckoning here
ROUNDING = 1e3 * EPS
#: momenta whose squares are below the smallest numbers: residuals are 0 then, and contacts as they come [kg m/s]
SMALLEST = 1e-140


class Scene:
    """Masses and loads of a scene of small_scenes.Grain, as the checks need them."""

    def __init__(self, grains, groups, boundaries):
        self.grains = grains
        self.dimension = len(grains[0].place) if grains else groups["scene"]["dimension"]
        scene = groups["scene"]
        self.friction, self.restitution = scene.get("friction", 0.0), scene.get("restitution", 0.0)
        self.wall_friction = scene.get("wall_friction", self.friction)
        self.wall_restitution = scene.get("wall_restitution", self.restitution)
        self.gravity = np.array(scene["gravity"][:self.dimension], float)
        self.step = groups["time"]["step"]
        self.tolerance = groups["solver"]["tolerance"]
        self.turns = self.with_friction(boundaries) and scene.get("rotation", True)
        #: no boundary does work; some boundary is moved by forces, and takes part in its contacts with a mass
        self.still = not any(np.any(b.get(key, False)) for b in boundaries for key in ("velocity", "rotation"))
        self.pressed = any(np.any(b.get("free", False)) for b in boundaries)

    def with_friction(self, boundaries):
        return max([self.friction, self.wall_friction] + [b.get("friction", 0.0) for b in boundaries]) > 0.0


def tangents(normal):
    """Tangents of contacts (c, d - 1, d): theory.md, section 3."""
    if normal.shape[1] == 2:
        return np.stack([np.stack([-normal[:, 1], normal[:, 0]], -1)], 1)
    x, y, z = normal.T
    sign = np.where(np.signbit(z), -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.stack([np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], -1), np.stack([b, sign + y * y * a, -y], -1)], 1)


class Contacts:
    """The contacts of one state with the bodies on both sides; a boundary is a body without lever that nothing moves."""

    def __init__(self, scene, results, step):
        def table(name):
            return results.get(f"/steps/{step}/contacts/{name}", np.zeros(0))

        self.identifiers = results[f"/steps/{step}/bodies/id"]
        grains = [scene.grains[i - 1] for i in self.identifiers]
        walls = results.get(f"/steps/{step}/boundaries/id", np.zeros(0, int))
        self.n, d = len(table("gap")), scene.dimension
        row = {identifier: k for k, identifier in enumerate([*self.identifiers, *walls])}
        self.side = [np.array([row[i] for i in table(name)], int) for name in ("candidate", "antagonist")]
        free = np.array([grain.group == 0 for grain in grains] + [False] * len(walls), bool)
        self.mass = np.array([grain.mass for grain in grains] + [np.inf] * len(walls))
        self.radius = np.array([grain.radius for grain in grains] + [0.0] * len(walls))
        self.inverse = np.where(free, 1.0 / self.mass, 0.0)
        inertia = INERTIA[d] * np.where(free, self.mass, 1.0) * np.where(free, self.radius, 1.0) ** 2
        self.inverse_inertia = np.where(free & scene.turns, 1.0 / inertia, 0.0)
        self.free, self.walls = free, walls
        self.normal = table("normal").reshape(self.n, d)
        self.tangent = tangents(self.normal)
        self.gap = table("gap")
        self.impulse = np.zeros((self.n, d))
        if self.n > 0:
            impulse = table("impulse")
            self.impulse[:, :impulse.shape[1]] = impulse
        wall = ~(free[self.side[0]] & free[self.side[1]])
        self.mu = np.where(wall, scene.wall_friction, scene.friction)
        self.e = np.where(wall, scene.wall_restitution, scene.restitution)
        one, two = self.side
        self.w_n = self.inverse[one] + self.inverse[two]
        self.w_t = self.w_n + self.radius[one] ** 2 * self.inverse_inertia[one] + self.radius[two] ** 2 * self.inverse_inertia[two]

    def velocities(self, results, step):
        """Of all bodies (grains, walls): (n, nv)."""
        rows = results[f"/steps/{step}/bodies/velocity"]
        if len(self.walls) == 0:
            return rows
        walls = results.get(f"/steps/{step}/boundaries/velocity", np.zeros((len(self.walls), rows.shape[1])))
        return np.vstack([rows, walls])

    def relative(self, velocity):
        """(c, d): normal, then tangential, of the candidate against the antagonist."""
        one, two = self.side
        d = self.normal.shape[1]
        apart = velocity[one, :d] - velocity[two, :d]
        turn = self.radius[one, None] * velocity[one, d:] + self.radius[two, None] * velocity[two, d:]
        found = [(self.normal * apart).sum(1)]
        if d == 2:
            found.append((self.tangent[:, 0] * apart).sum(1) - turn[:, 0])
        else:
            found.append((self.tangent[:, 0] * apart).sum(1) - (self.tangent[:, 1] * turn).sum(1))
            found.append((self.tangent[:, 1] * apart).sum(1) + (self.tangent[:, 0] * turn).sum(1))
        return np.stack(found, -1)

    def pushed(self):
        """What the impulses add to the velocities of the bodies, and the sizes that were added up, both (n, nv)."""
        d = self.normal.shape[1]
        nv = 3 * d - 3
        force = self.impulse[:, :1] * self.normal + np.einsum("ck,ckd->cd", self.impulse[:, 1:], self.tangent)
        moment = -self.impulse[:, 1:]
        if d == 3:
            moment = -(self.impulse[:, 1:2] * self.tangent[:, 1] - self.impulse[:, 2:3] * self.tangent[:, 0])
        change, size = np.zeros((len(self.mass), nv)), np.zeros((len(self.mass), nv))
        for sign, side in ((1.0, self.side[0]), (-1.0, self.side[1])):
            parts = np.hstack([sign * force * self.inverse[side, None],
                               moment * (self.radius[side] * self.inverse_inertia[side])[:, None]])
            np.add.at(change, side, parts)
            np.add.at(size, side, np.abs(parts))
        return change, size

    def defect(self, relative, before, loaded, step):
        """How far each impulse is from its own local solve under all others (c, d), and the shifted velocities."""
        shift = np.maximum(self.gap, 0.0) / step
        bounces = self.e > 0.0
        held = (before[:, 0] > 0.0) & (loaded[:, 0] < 0.0)
        shift[bounces] = (self.e * np.where(held, 0.0, before[:, 0]))[bounces]
        shifted = relative.copy()
        shifted[:, 0] += shift
        wanted = np.zeros_like(self.impulse)
        wanted[:, 0] = np.maximum(0.0, self.impulse[:, 0] - shifted[:, 0] / self.w_n)
        trial = self.impulse[:, 1:] - relative[:, 1:] / self.w_t[:, None]
        size = np.linalg.norm(trial, axis=1)
        limit = self.mu * wanted[:, 0]
        wanted[:, 1:] = trial * np.where(size > limit, limit / np.maximum(size, 1e-300), 1.0)[:, None]
        wanted[self.mu == 0.0, 1:] = 0.0
        return self.impulse - wanted, shifted


def kinetic(contacts, scene, velocity):
    """Kinetic energy of the free bodies."""
    d = scene.dimension
    mass = np.where(contacts.free, contacts.mass, 0.0)
    inertia = INERTIA[d] * mass * contacts.radius ** 2
    return 0.5 * (mass * (velocity[:, :d] ** 2).sum(1) + inertia * (velocity[:, d:] ** 2).sum(1)).sum()


def check_numbers(run):
    """Complaints about what is not a finite number in any file."""
    wrong = []
    for name, value in contents(run.path("results", "results.h5")).items():
        if np.asarray(value).dtype.kind == "f" and not np.all(np.isfinite(value)):
            wrong.append(f"{name} is not finite")
    for name in ("history.csv", "run.log"):
        with open(run.path("results", name), encoding="utf-8") as file:
            words = file.read().lower().replace(",", " ").split()
        if set(words) & {"nan", "inf", "infinity", "-inf", "-nan", "-infinity"}:
            wrong.append(f"{name} has a NaN or an infinity")
    return wrong


def check_states(run, scene, history):
    """Complaints about each pair of states that follow each other in the results of `run`; `history` has a row for each step that
    it kept."""
    results = run.results()
    rows = {int(step): k for k, step in enumerate(history["step"])}
    wrong = []
    steps = steps_of(results)
    for last, step in zip(steps, steps[1:]):
        contacts = Contacts(scene, results, step)
        if np.any(contacts.impulse[:, 0] < 0.0) or np.any(
                np.linalg.norm(contacts.impulse[:, 1:], axis=1) > contacts.mu * contacts.impulse[:, 0] * (1.0 + ROUNDING)):
            wrong.append(f"step {step}: an impulse is outside Coulomb's cone")
        if step != last + 1 or not np.array_equal(contacts.identifiers, results[f"/steps/{last}/bodies/id"]):
            continue
        found = check_step(contacts, scene, results, (last, step), history["residual"][rows[step]])
        wrong += [f"step {step}: {words}" for words in found]
    return wrong


def check_step(contacts, scene, results, steps, residual):
    old, new = (contacts.velocities(results, step) for step in steps)
    d = scene.dimension
    wrong = []
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        # action and reaction
        loaded = old.copy()
        loaded[contacts.free, :d] += scene.step * scene.gravity
        change, size = contacts.pushed()
        off = np.abs(new - loaded - change)[contacts.free]
        size = (size + np.abs(loaded) + np.abs(old))[contacts.free]
        # each component to the size of the terms of the whole vector: normals and tangents are rounded
        levers = np.where(contacts.radius > 0.0, contacts.radius, 1.0)[contacts.free, None]
        for part, lever in ((slice(0, d), 1.0), (slice(d, None), levers)):
            scale = (size[:, :d].sum(1) + (size[:, d:] * levers).sum(1))[:, None]
            if np.any(off[:, part] * lever > ROUNDING * scale + 1e-300):
                wrong.append("velocities are not those of the impulses")
        if contacts.n == 0 or scene.pressed:
            return wrong
        # the laws, to the residual that was reported
        relative, before = contacts.relative(new), contacts.relative(old)
        under_loads = contacts.relative(loaded)
        defect, shifted = contacts.defect(relative, before, under_loads, scene.step)
        speed = np.abs(loaded[:, :d]).max()
        if contacts.mass[contacts.free].min(initial=1.0) * speed < SMALLEST:
            return wrong
        mass = contacts.mass[contacts.free].max() if contacts.free.any() else 0.0
        missed, size = np.linalg.norm(defect), np.linalg.norm(contacts.impulse)
        rounding = ROUNDING * (mass * speed + size) * np.sqrt(contacts.n)
        if missed > 1.001 * residual * (size if size > 0.0 else mass * speed) + rounding:
            wrong.append(f"contacts miss their laws by {missed / size if size > 0.0 else missed:.1e}, reported was {residual:.1e}")
        slack = 2.0 * (missed + rounding) * (contacts.w_t.max() * size + np.linalg.norm(shifted) + np.linalg.norm(relative))
        first, free, last = (kinetic(contacts, scene, velocity) for velocity in (old, loaded, new))
        slack += ROUNDING * max(first, free, last)
        if not scene.still:
            return wrong
        if np.all(contacts.e == 0.0):
            # inelastic contacts take energy from what moves freely
            if last > free + slack:
                wrong.append(f"energy from nowhere: {last:.6e} J after {free:.6e} J without contacts, allowed {slack:.1e} J")
        elif np.all(contacts.mu == 0.0) and len(set(contacts.e)) == 1:
            # without friction, and with one restitution, contacts do no work in the mean of the velocities before and after, but
            # against the loads of the step: of 0 <= r W r = r (v - v_loaded) and v = -e v_before, or 0 where a contact is held
            pushed = work_of(contacts, before - under_loads)
            held = work_of(contacts, np.where((before > 0.0) & (under_loads < 0.0), before, 0.0))
            slack += 0.5 * max(pushed, 0.0) + held
            work = 0.5 * work_of(contacts, relative + before)
            if work > slack:
                wrong.append(f"energy from nowhere: contacts do a work of {work:.1e} J on {first:.6e} J, allowed {slack:.1e} J")
    return wrong


def work_of(contacts, relative):
    """Work of the normal impulses at a relative velocity (c, d) [J]."""
    return (contacts.impulse[:, 0] * relative[:, 0]).sum()


def read_history(run):
    """The columns of history.csv that are looked at, zero where they were not asked for; of millions of rows too."""
    names = ["step", "iterations", "residual", "max_overlap", "kinetic_energy", "converged", "contacts", "potential_energy",
             "load_work"]
    values = {name: array.array("d") for name in names}
    with open(run.path("results", "history.csv"), encoding="ascii") as file:
        header = file.readline().strip().split(",")
        for line in file:
            cells = dict(zip(header, line.split(",")))
            for name, column in values.items():
                column.append(float(cells.get(name, 0.0)))
    return {name: np.array(column) for name, column in values.items()}


class Figures:
    """The figures of a run that a table shows."""

    def __init__(self, run, scene):
        self.history = history = read_history(run)
        self.status = run.status
        self.steps = len(history["step"])
        self.iterations = int(history["iterations"].sum())
        self.residual = history["residual"].max() if self.steps else float("nan")
        radii = [grain.radius for grain in scene.grains] or [1.0]
        self.overlap = history["max_overlap"].max() / np.mean(radii) if self.steps else float("nan")
        free = [grain for grain in scene.grains if grain.group == 0]
        spin = [INERTIA[scene.dimension] * g.mass * g.radius ** 2 * np.dot(g.spin, g.spin) for g in free]
        with np.errstate(over="ignore", under="ignore"):
            start = 0.5 * (sum(g.mass * np.dot(g.velocity, g.velocity) for g in free) + sum(spin))
            height = -sum(g.mass * np.dot(scene.gravity, g.place) for g in free)
            energies = history["kinetic_energy"] + history["potential_energy"] - height - start if self.steps else np.zeros(1)
            most = max(start, np.abs(history["kinetic_energy"]).max()) if self.steps else start
            fallen = np.abs(history["load_work"]).max() if self.steps else 0.0
            weight = np.linalg.norm(scene.gravity) * sum(g.mass * g.radius for g in free)
            scale = max(most, fallen, weight)
            #: kinetic and potential energy gained (lost: below 0), over the largest of those exchanged and the weights times radii
            self.energy = energies[-1] / scale if scale > 0.0 else 0.0
            self.most_kinetic, self.start_kinetic, self.final_kinetic = most, start, (
                history["kinetic_energy"][-1] if self.steps else start)
        missed = int((history["converged"] == 0).sum()) if self.steps else 0
        self.missed = missed
        if run.status == 0:
            self.words = "converged"
        elif run.status == 2:
            self.words = "refused"
        elif "DIVERGED" in run.stdout:
            self.words = f"diverged in step {self.steps + 1}"
        elif run.status == 3:
            self.words = f"not converged in {missed} of {self.steps} steps"
        else:
            self.words = f"stopped in step {self.steps + 1}"
