"""What every run must obey, whatever its method: checked from what it wrote, with formulas of its own.

From two states that follow each other: finite numbers, the cones of friction and of moments, action and reaction (the velocities
written are those of the impulses written), the laws of contact to the residual that the run reports, and no energy from nowhere. Laws
are those of &scene and, of pairs of materials, one adhesive law, or a bonded one whose bonds hold."""
import array

import numpy as np

from gravier_runs import steps_of
from small_scenes import EPS, INERTIA

#: sums of a dozen terms, each rounded, and the reckoning here
ROUNDING = 1e3 * EPS
#: momenta whose squares are below the smallest numbers: residuals are 0 then, and contacts as they come [kg m/s]
SMALLEST = 1e-140
COEFFICIENTS = ["friction", "restitution", "tangential_restitution", "rolling_friction", "pivoting_friction"]


class Scene:
    """Masses and loads of a scene of small_scenes.Grain, as the checks need them. All grains are of one material."""

    def __init__(self, grains, groups, boundaries):
        self.grains = grains
        self.dimension = len(grains[0].place) if grains else groups["scene"]["dimension"]
        scene = groups["scene"]
        #: coefficients of each kind between grains, at walls and glued grains, and of the law of the material
        self.law = groups["law"][0] if "law" in groups else None
        law = self.law or {}
        self.coefficients = {name: (scene.get(name, 0.0), scene.get(f"wall_{name}", scene.get(name, 0.0)), law.get(name, 0.0))
                             for name in COEFFICIENTS}
        if "bond_friction" in law:
            self.coefficients["friction"] = (*self.coefficients["friction"][:2], law["bond_friction"])
        #: it counts at boundaries where these have the material too, at glued grains in any case
        self.law_at_walls = "wall_material" in scene
        self.gravity = np.array(scene["gravity"][:self.dimension], float)
        self.step = groups["time"]["step"]
        self.tolerance = groups["solver"]["tolerance"]
        #: momentum over the root mean square of impulses below which a grain may be made to stand still
        self.sleep_speed = groups["solver"].get("sleep_speed", 100.0 * self.tolerance) if groups["solver"].get("sleeping") else 0.0
        self.sleep_after = groups["solver"].get("sleep_after", 20)
        rotation = scene.get("rotation", True)
        self.rolls = rotation and any(max(self.coefficients[name]) > 0.0 for name in ("rolling_friction", "pivoting_friction"))
        self.turns = (self.with_friction(boundaries) or self.rolls) and rotation
        #: no boundary does work; some boundary is moved by forces, and takes part in its contacts with a mass
        self.still = not any(np.any(b.get(key, False)) for b in boundaries for key in ("velocity", "rotation"))
        self.pressed = any(np.any(b.get("free", False)) for b in boundaries)

    def with_friction(self, boundaries):
        return max([*self.coefficients["friction"]] + [b.get("friction", 0.0) for b in boundaries]) > 0.0

    def attraction(self, by_law, gap):
        """Of contacts, under the law or not, with these gaps [N]."""
        if self.law is None:
            return np.zeros(len(gap))
        force, reach = ((self.law["bond_strength"], np.inf) if self.law["kind"] == "bonded" else
                        (self.law["adhesion"], self.law["adhesion_range"]))
        return np.where((gap <= reach) & by_law, force, 0.0)


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
        by_law = np.full(self.n, scene.law is not None)
        if not scene.law_at_walls:
            by_law &= np.maximum(*self.side) < len(grains)
        self.mu, self.e, self.e_t, self.rolling, self.pivoting = (
            np.choose(np.where(by_law, 2, wall.astype(int)), scene.coefficients[name]).astype(float) for name in COEFFICIENTS)
        self.e_t[self.mu == 0.0] = 0.0
        #: impulse of the attraction, and the normal impulse without it, which is what laws are about
        self.pull = scene.step * scene.attraction(by_law, self.gap)
        self.pressing = self.impulse[:, 0] + self.pull
        self.bonded = by_law & (scene.law is not None and scene.law["kind"] == "bonded")
        one, two = self.side
        self.w_n = self.inverse[one] + self.inverse[two]
        self.w_t = self.w_n + self.radius[one] ** 2 * self.inverse_inertia[one] + self.radius[two] ** 2 * self.inverse_inertia[two]
        lever = np.where(free, self.radius, 0.0)
        #: radius R* of moments, and moments over it about the normal and the tangents (of disks about z), (c, 2 d - 3)
        self.reach = np.where(np.minimum(lever[one], lever[two]) > 0.0, lever[one] * lever[two] / np.maximum(
            lever[one] + lever[two], 1e-300), np.maximum(lever[one], lever[two]))
        self.moment = np.zeros((self.n, (2 * d - 3) * scene.rolls))
        if scene.rolls and self.n > 0:
            self.moment = table("moment").reshape(self.n, 2 * d - 3) / np.maximum(self.reach, 1e-300)[:, None]
        self.w_r = self.reach ** 2 * (self.inverse_inertia[one] + self.inverse_inertia[two])
        self.d = d

    def velocities(self, results, step):
        """Of all bodies (grains, walls): (n, nv)."""
        rows = results[f"/steps/{step}/bodies/velocity"]
        if len(self.walls) == 0:
            return rows
        walls = results.get(f"/steps/{step}/boundaries/velocity", np.zeros((len(self.walls), rows.shape[1])))
        return np.vstack([rows, walls])

    def axes(self):
        """Axes of the moments (c, 2 d - 3, 2 d - 3): normal, then tangents; of disks z."""
        if self.d == 2:
            return np.ones((self.n, 1, 1))
        return np.concatenate([self.normal[:, None], self.tangent], 1)

    def beside(self, bodies):
        """Which contacts have one of these bodies, by a mask, at a side."""
        return bodies[self.side[0]] | bodies[self.side[1]]

    def relative(self, velocity):
        """(c, d), with moments (c, 3 d - 3): normal, tangential, then of the spins times R*, of the candidate against the
        antagonist."""
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
        if self.moment.shape[1] > 0:
            spin = (velocity[one, d:] - velocity[two, d:]) * self.reach[:, None]
            found += list(np.einsum("cmk,ck->mc", self.axes(), spin))
        return np.stack(found, -1)

    def all_impulses(self):
        """(c, d), with moments over R* (c, 3 d - 3), the normal ones without attraction: what laws are about."""
        return np.hstack([self.pressing[:, None], self.impulse[:, 1:], self.moment])

    def pushed(self):
        """What the impulses add to the velocities of the bodies, and the sizes that were added up, both (n, nv)."""
        d = self.normal.shape[1]
        nv = 3 * d - 3
        force = self.impulse[:, :1] * self.normal + np.einsum("ck,ckd->cd", self.impulse[:, 1:], self.tangent)
        moment = -self.impulse[:, 1:]
        if d == 3:
            moment = -(self.impulse[:, 1:2] * self.tangent[:, 1] - self.impulse[:, 2:3] * self.tangent[:, 0])
        roll = np.zeros_like(moment)
        if self.moment.shape[1] > 0:
            roll = np.einsum("cm,cmk->ck", self.moment, self.axes()) * self.reach[:, None]
        change, size = np.zeros((len(self.mass), nv)), np.zeros((len(self.mass), nv))
        for sign, side in ((1.0, self.side[0]), (-1.0, self.side[1])):
            turn = moment * self.radius[side, None]
            parts = np.hstack([sign * force * self.inverse[side, None], (turn + sign * roll) * self.inverse_inertia[side, None]])
            np.add.at(change, side, parts)
            # the force without its attraction and the attraction are two terms
            terms = np.abs(force) + np.abs(self.pull[:, None] * self.normal)
            np.add.at(size, side, np.hstack([terms * self.inverse[side, None],
                                             (np.abs(turn) + np.abs(roll)) * self.inverse_inertia[side, None]]))
        return change, size

    def pulled(self, velocity):
        """Velocities with the attractions as loads (n, nv)."""
        found, d = velocity.copy(), self.normal.shape[1]
        for sign, side in ((-1.0, self.side[0]), (1.0, self.side[1])):
            np.add.at(found[:, :d], side, sign * self.pull[:, None] * self.normal * self.inverse[side, None])
        return found

    def defect(self, relative, before, loaded, step):
        """How far each impulse is from its own local solve under all others, and the shifted velocities, (c, d) or, with moments,
        (c, 3 d - 3)."""
        shift = np.where(self.bonded, 0.0, np.maximum(self.gap, 0.0) / step)
        bounces = self.e > 0.0
        held = (before[:, 0] > 0.0) & (loaded[:, 0] < 0.0)
        # rounding decides where the loads of the step are all that was needed to close a contact
        tie = np.abs(loaded[:, 0]) <= ROUNDING * before[:, 0]
        held = np.where(tie, np.abs(relative[:, 0]) < np.abs(relative[:, 0] + self.e * before[:, 0]), held)
        shift[bounces] = (self.e * np.where(held, 0.0, before[:, 0]))[bounces]
        shifted = relative.copy()
        shifted[:, 0] += shift
        d = self.d
        shifted[:, 1:d] += self.e_t[:, None] * before[:, 1:d]
        impulse = self.all_impulses()
        wanted = np.zeros_like(impulse)
        wanted[:, 0] = np.maximum(0.0, impulse[:, 0] - shifted[:, 0] / self.w_n)
        limits = [(slice(1, d), self.mu, self.w_t)]
        if self.moment.shape[1] > 0:
            limits += [(slice(d, None), self.rolling, self.w_r)] if d == 2 else [
                (slice(d, d + 1), self.pivoting, self.w_r), (slice(d + 1, None), self.rolling, self.w_r)]
        for part, coefficient, w in limits:
            trial = impulse[:, part] - shifted[:, part] / np.maximum(w, 1e-300)[:, None]
            size = np.linalg.norm(trial, axis=1)
            limit = coefficient * wanted[:, 0]
            wanted[:, part] = trial * np.where(size > limit, limit / np.maximum(size, 1e-300), 1.0)[:, None]
            wanted[coefficient == 0.0, part] = 0.0
        return impulse - wanted, shifted

    def outside_cones(self):
        """Whether some impulse is outside the cone of its law, beyond rounding."""
        slack = ROUNDING * (np.abs(self.impulse[:, 0]) + self.pull)
        discs = [(self.mu, self.impulse[:, 1:])]
        if self.moment.shape[1] > 0:
            discs += [(self.rolling, self.moment)] if self.d == 2 else [
                (self.pivoting, self.moment[:, :1]), (self.rolling, self.moment[:, 1:])]
        return np.any(self.pressing < np.where(self.pull > 0.0, -slack, 0.0)) or any(np.any(
            np.linalg.norm(part, axis=1) > coefficient * (self.pressing + slack)) for coefficient, part in discs)


def kinetic(contacts, scene, velocity):
    """Kinetic energy of the free bodies."""
    d = scene.dimension
    mass = np.where(contacts.free, contacts.mass, 0.0)
    inertia = INERTIA[d] * mass * contacts.radius ** 2
    return 0.5 * (mass * (velocity[:, :d] ** 2).sum(1) + inertia * (velocity[:, d:] ** 2).sum(1)).sum()


def check_numbers(run):
    """Complaints about what is not a finite number in any file."""
    wrong = []
    for name, value in run.results().arrays().items():
        if np.asarray(value).dtype.kind == "f" and not np.all(np.isfinite(value)):
            wrong.append(f"{name} is not finite")
    for name in ("history.csv", "run.log"):
        with open(run.path("results", name), encoding="utf-8") as file:
            words = file.read().lower().replace(",", " ").split()
        if set(words) & {"nan", "inf", "infinity", "-inf", "-nan", "-infinity"}:
            wrong.append(f"{name} has a NaN or an infinity")
    return wrong


class Sleepers:
    """The momenta that grains which stand still may have by their impulses, l of theory.md, section 12: a grain that sleeps that of
    the step in which it fell asleep, beside what this step left to it, any other half of that of now."""
    #: of the normal impulses on a grain
    SHARE = 0.1

    def __init__(self, scene):
        self.speed, self.after = scene.sleep_speed, scene.sleep_after
        #: by the identifiers of those that sleep; of those that slept before the first state nothing is known
        self.known = {}
        #: velocities that the step left to those that sleep, by their identifiers
        self.left = {}

    def beside_left(self, contacts, rest, velocity):
        """The velocities that grains would have by their impulses, those of sleepers less what was left to them."""
        sleeps, slept = rest[1] >= self.after, rest[0] >= self.after
        self.left = {i: self.left.get(i, np.zeros(velocity.shape[1])) if slept[k] else velocity[k].copy()
                     for k, i in enumerate(contacts.identifiers) if sleeps[k]}
        less = np.zeros_like(velocity)
        for k in np.flatnonzero(sleeps & slept):
            less[k] = self.left[contacts.identifiers[k]]
        return velocity - less

    def limits(self, contacts, rest):
        """Of all bodies (grains, walls), infinite where it is not known, by the steps at rest in the last state and in this one."""
        grains = len(contacts.identifiers)
        now = np.zeros(len(contacts.mass), bool)
        now[:grains] = rest[1] >= self.after
        slept = now.copy()
        slept[:grains] &= rest[0] >= self.after
        solved = contacts.all_impulses()[contacts.beside(~slept & contacts.free)]
        usual = np.sqrt((solved ** 2).sum() / max(len(solved), 1))
        pressing = sum(np.bincount(side, contacts.pressing, len(contacts.mass)) for side in contacts.side)
        found = np.minimum(self.speed * usual, self.SHARE * pressing)
        self.known = {i: self.known.get(i, np.inf) if slept[k] else found[k] for k, i in enumerate(contacts.identifiers) if now[k]}
        return np.array([self.known.get(i, np.inf) if slept[k] else 0.5 * found[k] for k, i in enumerate(contacts.identifiers)] +
                        [0.0] * len(contacts.walls))


def check_states(run, scene, history):
    """Complaints about each pair of states that follow each other in the results of `run`; `history` has a row for each step that
    it kept."""
    results = run.results()
    rows = {int(step): k for k, step in enumerate(history["step"])}
    wrong = []
    steps = steps_of(results)
    sleepers = Sleepers(scene)
    for last, step in zip(steps, steps[1:]):
        contacts = Contacts(scene, results, step)
        if contacts.outside_cones():
            wrong.append(f"step {step}: an impulse is outside the cone of its law")
        if step != last + 1 or not np.array_equal(contacts.identifiers, results[f"/steps/{last}/bodies/id"]):
            continue
        limits = np.zeros(len(contacts.mass))
        if scene.sleep_speed > 0.0:
            limits = sleepers.limits(contacts, [results[f"/steps/{s}/bodies/rest"] for s in (last, step)])
        found = check_step(contacts, scene, results, (last, step), (history["residual"][rows[step]], limits, sleepers))
        wrong += [f"step {step}: {words}" for words in found]
    return wrong


def check_step(contacts, scene, results, steps, bounds):
    """Complaints about a step; `bounds`: the residual that was reported, the momenta that grains which stand still may have, and what is known of
    those that sleep."""
    residual, limits, sleepers = bounds
    old, new = (contacts.velocities(results, step) for step in steps)
    d = scene.dimension
    wrong = []
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        # action and reaction
        standing = np.zeros(len(old), dtype=bool)
        loaded = old.copy()
        loaded[contacts.free, :d] += scene.step * scene.gravity
        change, size = contacts.pushed()
        if scene.sleep_speed > 0.0:
            # grains that stand still: the laws are those of the velocities that they would have
            standing = contacts.free & np.all(new == 0.0, axis=1)
            new = np.where(standing[:, None], loaded + change, new)
            given = sleepers.beside_left(contacts, [results[f"/steps/{s}/bodies/rest"] for s in steps], new)
            momenta = np.where(contacts.free, contacts.mass, 0.0) * (
                np.linalg.norm(given[:, :d], axis=1) + contacts.radius * np.linalg.norm(given[:, d:], axis=1))
            usual = np.sqrt((contacts.all_impulses() ** 2).sum() / max(contacts.n, 1))
            if np.any((momenta > limits + ROUNDING * usual)[standing]):
                wrong.append("a grain stands still that moves by its impulses")
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
        loaded = contacts.pulled(loaded)
        relative, before = contacts.relative(new), contacts.relative(old)
        under_loads = contacts.relative(loaded)
        defect, shifted = contacts.defect(relative, before, under_loads, scene.step)
        speed = np.abs(loaded[:, :d]).max()
        if contacts.mass[contacts.free].min(initial=1.0) * speed < SMALLEST:
            return wrong
        mass = contacts.mass[contacts.free].max() if contacts.free.any() else 0.0
        missed, size = np.linalg.norm(defect), np.linalg.norm(contacts.all_impulses())
        rounding = ROUNDING * (mass * speed + size) * np.sqrt(contacts.n)
        # beside grains that stand still, by what these may move with
        still = np.linalg.norm(sum(np.where(standing, limits, 0.0)[side] for side in contacts.side))
        if missed > 1.001 * residual * (size if size > 0.0 else mass * speed) + still + rounding:
            wrong.append(f"contacts miss their laws by {missed / size if size > 0.0 else missed:.1e}, reported was {residual:.1e}")
        slack = 2.0 * (missed + rounding) * (max(contacts.w_t.max(), contacts.w_r.max()) * size + np.linalg.norm(shifted) +
                                             np.linalg.norm(relative))
        first, free, last = (kinetic(contacts, scene, velocity) for velocity in (old, loaded, new))
        slack += ROUNDING * max(first, free, last)
        if not scene.still:
            return wrong
        if np.all(contacts.e == 0.0) and np.all(contacts.e_t == 0.0):
            # inelastic contacts take energy from what moves freely, under attractions too
            if last > free + slack:
                wrong.append(f"energy from nowhere: {last:.6e} J after {free:.6e} J without contacts, allowed {slack:.1e} J")
        elif np.all((contacts.mu == 0.0) | (contacts.e_t == contacts.e)) and len(set(contacts.e)) == 1 and not scene.rolls:
            # with one restitution for both directions, or without friction, contacts do no work in the mean of the velocities
            # before and after, but against the loads of the step: of 0 <= r W r = r (v - v_loaded) and r (v + e v_before) <= 0,
            # or e r_n v_n,before where a contact is held
            pushed = work_of(contacts, before - under_loads)
            held = np.zeros_like(before)
            held[:, 0] = np.where((before[:, 0] > 0.0) & (under_loads[:, 0] <= ROUNDING * before[:, 0]), before[:, 0], 0.0)
            slack += 0.5 * max(pushed, 0.0) + work_of(contacts, held)
            work = 0.5 * work_of(contacts, relative + before)
            if work > slack:
                wrong.append(f"energy from nowhere: contacts do a work of {work:.1e} J on {first:.6e} J, allowed {slack:.1e} J")
    return wrong


def work_of(contacts, relative):
    """Work of the impulses at a relative velocity, as `relative` gives it [J]."""
    return (contacts.all_impulses() * relative).sum()


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
