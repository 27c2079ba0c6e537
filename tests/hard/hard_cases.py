"""Small scenes that are hard for a solver, each for a reason of its own, and the methods that they are given to.

A case says what is hard about it, its grains, boundaries and input groups, and what must hold of a run beside scene_laws: `holds`
takes a Played and returns complaints. A method may end a run with exit status 3 and a loud line where `may_fail` says so; a wrong
result, a crash, a NaN or energy from nowhere is a failure everywhere. To try a method, add it to METHODS."""
import copy
import dataclasses
import functools
import os
from typing import Callable

import numpy as np

from gravier_runs import merged, run_case, write
from scene_laws import Figures, Scene, check_numbers, check_states
from small_scenes import G, Grain, Record, bodies_csv, floats, plane

STEP = 1.0 / 512
#: residual that is asked for beside the default accuracy of velocities: a solve ends where both are met
TOLERANCE = 1e-8
#: of a solve; a tenth of it, and 100 steps at most, for the enriched methods, whose iterations cost a hundred times as much
#: here, a fifth of it and 100 steps for `newton`. That is not enough everywhere: the enriched ones may always end with exit
#: status 3, and so may Schwarz, which oscillates on some scenes
ITERATIONS = 1000
DEAR = {"nscdd_ep": ITERATIONS // 10, "schwarz_ec": ITERATIONS // 10, "newton": ITERATIONS // 5}

#: title: input groups; a method that is 'nlgs' has one domain
METHODS = {
    "nlgs": {"solver": {"method": "nlgs", "acceleration": "none"}},
    "nlgs, accelerated": {"solver": {"method": "nlgs", "acceleration": "momentum"}},
    "nscdd": {"solver": {"method": "nscdd", "acceleration": "none"}},
    "nscdd, accelerated": {"solver": {"method": "nscdd", "acceleration": "momentum"}},
    "nscdd_ep": {"solver": {"method": "nscdd_ep"}},
    "nscdd_ep, all": {"solver": {"method": "nscdd_ep"}, "enriched": {"direction": 0.3}},
    "nscdd_ep, active": {"solver": {"method": "nscdd_ep", "acceleration": "none"},
                         "enriched": {"direction": 10.0, "contacts": "active"}},
    "schwarz": {"solver": {"method": "schwarz"}},
    "schwarz, accelerated": {"solver": {"method": "schwarz", "acceleration": "momentum"}},
    "schwarz_ec": {"solver": {"method": "schwarz_ec"}},
    "newton": {"solver": {"method": "newton"}},
}


#: methods that serve moments, and words of the others' refusals
SERVE_MOMENTS = ("nlgs", "nscdd", "schwarz", "newton")
MOMENTS = "with rolling or pivoting friction"


def is_enriched(method):
    """Whether a method, by its word or its title, is one of the enriched ones."""
    return method.startswith(("nscdd_ep", "schwarz_ec"))


@dataclasses.dataclass
class Change:
    """Of units, and an orthogonal matrix."""
    length: float
    mass: float
    time: float
    turn: np.ndarray


@dataclasses.dataclass
class Case:
    """A scene and what is expected of it."""
    name: str
    #: what is hard about it, for the page of the suite
    hard: str
    grains: list
    boundaries: list = dataclasses.field(default_factory=list)
    #: changes of the input groups
    groups: dict = dataclasses.field(default_factory=dict)
    steps: int = 20
    #: the same in a study, where that is longer
    long: int = 0
    #: states are written at half of the steps and at the end, not in each step
    halves: bool = False
    #: solves take many hundred exchanges
    slow: bool = False
    #: what must hold comes in its last steps, which dear methods make too
    late: bool = False
    subdomains: int = 4
    dimension: int = 2
    #: what must hold of a run that ended with 0 or 3
    holds: Callable = lambda played: []
    #: methods of METHODS that may end with exit status 3 here; "all" for every one
    may_fail: tuple = ()
    #: exit statuses and words of a run that is refused or stopped
    ends: tuple = ()
    #: words by which methods other than those that serve moments refuse the case
    refuses: str = ""
    #: velocities are unique, and those of two methods agree to this part of the largest speed (falls of a step included)
    agree: float = 0.0
    #: the last state for which this holds; None for all
    agree_until: int | None = None
    #: methods other than those of METHODS
    methods: dict = dataclasses.field(default_factory=dict)
    files: dict = dataclasses.field(default_factory=dict)
    #: from BASE to this scene
    change: Change | None = None

    def input_groups(self, method, long=False, dear_steps=100):
        """Input groups for a method: `long` for a study, at most `dear_steps` steps for one of DEAR."""
        several = method["solver"]["method"] != "nlgs"
        word = method["solver"]["method"]
        steps = self.long if long and self.long else self.steps
        steps = min(steps, 100 if self.late else dear_steps) if word in DEAR else steps
        return merged({
            "scene": {"dimension": self.dimension, "bodies": "file", "bodies_file": "bodies.csv",
                      "gravity": [0.0, -G, 0.0] if self.dimension == 2 else [0.0, 0.0, -G]},
            "boundary": [dict(keys) for keys in self.boundaries],
            "time": {"step": STEP, "steps": steps},
            "solver": {"tolerance": TOLERANCE, "max_iterations": DEAR.get(word, ITERATIONS)},
            "decomposition": {"subdomains": self.subdomains if several else 1},
            "output": {"directory": "results", "energy": True, "every": steps // 2 if self.halves else 1},
        }, method, self.groups, {} if several else {"decomposition": {"subdomains": 1, "grid": None}})

    def may_miss(self, method):
        return "all" in self.may_fail or method in self.may_fail or is_enriched(method) or method.startswith("schwarz")


class Played:
    """A run of a case by a method, and what it wrote."""

    def __init__(self, case, method, groups, run):
        self.case, self.method, self.groups, self.run = case, method, groups, run
        self.scene = Scene(case.grains, groups, case.boundaries)
        self.wrote = os.path.exists(run.path("results", "history.csv"))
        self.figures = Figures(run, self.scene) if self.wrote else None

    @functools.cached_property
    def record(self):
        return Record(self.run, self.case.grains, self.case.dimension)

    def complaints(self):
        """All that is wrong with the run; empty if nothing is."""
        case, run = self.case, self.run
        said = run.stdout + run.stderr
        ends = case.ends
        if case.refuses and self.groups["solver"]["method"] not in SERVE_MOMENTS:
            ends = (2,), case.refuses
        if ends:
            status, words = ends
            wrong = [] if run.status in status and words in said else [f"ended with status {run.status}, without '{words}'"]
            return wrong + (check_numbers(run) if self.wrote else [])
        if run.status not in (0, 3) or not self.wrote:
            return [f"ended with status {run.status}: {said[-300:]}"]
        wrong = check_numbers(run)
        if run.status == 3:
            if "***" not in run.stdout:
                wrong.append("a solve failed without a loud line")
            if not case.may_miss(self.method):
                wrong.append(self.figures.words)
        wrong += check_states(run, self.scene, self.figures.history)
        if "DIVERGED" not in run.stdout:
            wrong += case.holds(self)
        return wrong


def play(case, title, method, ranks, directory, long=False, dear_steps=100):
    """Run a case by a method in a directory; `long` and `dear_steps` as in its input groups."""
    os.makedirs(directory, exist_ok=True)
    files = {"bodies.csv": bodies_csv(case.grains) if case.grains else NO_GRAINS[case.dimension], **case.files}
    for name, text in files.items():
        write(os.path.join(directory, name), text)
    groups = case.input_groups(method, long, dear_steps)
    return Played(case, title, groups, run_case(groups, ranks, directory))


def methods_of(case, titles=None):
    """{title: groups} of a case: its own, or those of METHODS, all or the ones named."""
    if case.methods:
        return case.methods
    return {title: groups for title, groups in METHODS.items() if titles is None or title in titles}


def disagreement(one, two):
    """Complaint where two runs of a scene whose velocities are unique differ, in the states up to `agree_until` that both have."""
    if not one.case.agree or one.run.status != 0 or two.run.status != 0:
        return []
    first, second = one.record, two.record
    last = min(len(first.velocity), len(second.velocity))
    if one.case.agree_until is not None:
        last = min(last, one.case.agree_until + 1)
    fall = one.scene.step * np.linalg.norm(one.scene.gravity)
    radii = np.array([grain.radius for grain in one.case.grains])[:, None]
    scale = max(np.abs(first.velocity).max(), fall)
    apart = max(np.abs(first.velocity[:last] - second.velocity[:last]).max(), np.abs((first.spin[:last] - second.spin[:last]) * radii).max())
    if apart <= one.case.agree * scale:
        return []
    return [f"velocities of {one.method} and {two.method} differ by {apart:.1e} m/s of {scale:.1e} m/s"]


NO_GRAINS = {2: "id,radius,mass,x,y\n", 3: "id,radius,mass,x,y,z\n"}


# ---- scenes that several cases share

def floor(dimension=2, **more):
    return plane([0.0] * dimension, [0.0] * (dimension - 1) + [1.0], **more)


def box(width, **more):
    return [floor(**more), plane([0.0, 0.0], [1.0, 0.0], **more), plane([width, 0.0], [-1.0, 0.0], **more)]


def tower(masses, radius=0.05):
    return [Grain([0.0, radius * (2 * k + 1)], radius=radius, mass=mass) for k, mass in enumerate(masses)]


def heap(speed=1.0, seed=1, dimension=2, count=12, radius=0.05):
    """Grains thrown down into a box, some radii apart; they meet within the first steps."""
    rng = np.random.default_rng(seed)
    across = 4 if dimension == 2 else 2
    grains = []
    for k in range(count):
        column, layer = k % across ** (dimension - 1), k // across ** (dimension - 1)
        cell = [column % across, column // across, layer] if dimension == 3 else [column, layer]
        place = radius * 2.1 * (np.array(cell) + 0.55) + rng.uniform(-0.04, 0.04, dimension) * radius
        velocity = rng.normal(0.0, 0.2 * speed, dimension)
        velocity[-1] -= speed
        grains.append(Grain(place, velocity, spin=rng.normal(0.0, speed / radius, 2 * dimension - 3),
                            radius=radius * rng.uniform(0.8, 1.0), mass=rng.uniform(0.5, 1.0)))
    return grains


def heap_box(dimension=2, radius=0.05):
    if dimension == 2:
        return box(4 * 2.1 * radius + 0.1 * radius)
    width = 2 * 2.1 * radius + 0.1 * radius
    return [floor(3)] + [plane([place if d == k else 0.0 for k in range(3)], [sign if d == k else 0.0 for k in range(3)])
                         for d in range(2) for place, sign in ((0.0, 1.0), (width, -1.0))]


def square(n, radius=0.05):
    return [Grain([radius * (2 * i + 1), radius * (2 * j + 1)], radius=radius) for j in range(n) for i in range(n)]


def hexagons(n, radius=0.05):
    """Rows of n and n - 1 disks in turn, between sides 2 n radii apart."""
    return [Grain([radius * (2 * i + 1 + j % 2), radius * (1 + np.sqrt(3.0) * j)], radius=radius)
            for j in range(n) for i in range(n - j % 2)]


def arch(n, radius=0.05, slope=0.4):
    """Links of a hanging chain upside down: each joint bears one disk's weight more. The first and the last are glued."""
    angle = np.arctan(slope * (np.arange(n + 1) - 0.5 * n))
    steps = 2 * radius * np.stack([np.cos(angle), -np.sin(angle)], -1)
    centres = np.vstack([np.zeros(2), np.cumsum(steps, 0)]) + [radius, 2 * radius]
    return [Grain(place, radius=radius, group=int(k in (0, n + 1))) for k, place in enumerate(centres)]


def flower(petals=12, radius=0.2, gap=0.0):
    """A large disk with small ones around it, which fall on it."""
    small = 0.05
    around = 2 * np.pi * (np.arange(petals) + 0.5) / petals
    out = np.stack([np.cos(around), np.sin(around)], -1)
    return [Grain([0.0, 0.0], radius=radius, mass=8.0)] + [
        Grain(n * (radius + small + gap), -n * 0.3, radius=small, mass=0.5) for n in out]


def transformed(case, name, hard, length=1.0, mass=1.0, time=1.0, turn=None):
    """The case in other units, or turned by an orthogonal matrix."""
    matrix = np.eye(case.dimension) if turn is None else np.array(turn, float)
    sign = np.linalg.det(matrix)
    new = copy.deepcopy(case)
    new.name, new.hard, new.change = name, hard, Change(length, mass, time, matrix)
    for grain in new.grains:
        grain.place = [float(x) for x in length * (matrix @ grain.place)]
        grain.velocity = [float(v) for v in length / time * (matrix @ grain.velocity)]
        grain.spin = [float(sign * w / time) for w in grain.spin]
        grain.radius, grain.mass = grain.radius * length, grain.mass * mass
    for keys in new.boundaries:
        keys["point"] = [float(x) for x in length * (matrix @ keys["point"])]
        keys["normal"] = [float(x) for x in matrix @ keys["normal"]]
    gravity = length / time ** 2 * (matrix @ np.array([0.0, -G]))
    new.groups = merged(new.groups, {"scene": {"gravity": [float(g) for g in gravity] + [0.0]}, "time": {"step": STEP * time}})
    return new


# ---- what must hold

def at_rest(part):
    """No speed above `part` of what a body falls at within a step."""
    def holds(played):
        record = played.record
        allowed = part * played.scene.step * np.linalg.norm(played.scene.gravity)
        fastest = np.abs(record.velocity).max()
        if played.run.status == 0 and not fastest <= allowed:
            return [f"not at rest: {fastest:.1e} m/s, allowed {allowed:.1e}"]
        return []
    return holds


def keeps_energy(part):
    """Kinetic energy and the energy of the start differ by no more than a part."""
    def holds(played):
        figures = played.figures
        off = abs(figures.final_kinetic / figures.start_kinetic - 1.0)
        return [] if played.run.status == 3 or off <= part else [f"kinetic energy is off by {off:.1e}, allowed {part:.1e}"]
    return holds


def gains_nothing(part):
    """Kinetic energy never exceeds that of the start by more than a part of it."""
    def holds(played):
        most = played.figures.history["kinetic_energy"].max() / played.figures.start_kinetic - 1.0
        return [] if most <= part else [f"kinetic energy grew by {most:.1e}, allowed are {part:.1e}"]
    return holds


def bounded_energy(most):
    """Kinetic energy never exceeds `most` [J]."""
    def holds(played):
        found = played.figures.history["kinetic_energy"].max()
        return [] if found <= most else [f"kinetic energy of {found:.3e} J, stated are {most:.1e} J"]
    return holds


def converged_at_most(most):
    """Kinetic energy never exceeds `most` [J] in a run whose solves all converged."""
    return lambda played: [] if played.run.status == 3 else bounded_energy(most)(played)


def overlaps_below(part, late=0.0):
    """No overlap above `part` of the mean radius, once a share `late` of the steps is over."""
    def holds(played):
        overlaps = played.figures.history["max_overlap"]
        found = overlaps[int(late * len(overlaps)):].max() / np.mean([grain.radius for grain in played.case.grains])
        return [] if played.run.status == 3 or found <= part else [f"an overlap of {found:.1e} mean radii, allowed are {part:.1e}"]
    return holds


def creeps_below(part):
    """In the second half of a run of 1000 steps and more no grain moves by more than `part` of its radius."""
    def holds(played):
        record = played.record
        if record.step[-1] < 1000:
            return []
        moved = np.abs(record.position[-1] - record.position[1]).max() / min(grain.radius for grain in played.case.grains)
        return [] if moved <= part else [f"a grain crept by {moved:.1e} radii, allowed are {part:.1e}"]
    return holds


def together(*several):
    return lambda played: [words for one in several for words in one(played)]


def no_contact(played):
    found = played.figures.history["contacts"].sum()
    return [] if found == 0 else [f"{found:.0f} contacts in a scene that has none"]


def shared_by(n):
    """Some body is held by n subdomains or more (the log lists multiplicities up to 7 one by one, then 8 or more)."""
    def holds(played):
        if "subdomains" not in played.groups["decomposition"] or played.groups["solver"]["method"] == "nlgs":
            return []
        return [] if f" in {n} or more subdomains" in played.run.stdout else [f"no body is shared by {n} subdomains"]
    return holds


ALL = ("all",)
#: radii that a grain at rest may move by in 5 10^4 steps
CREEP = 1e-4
BASE = Case("heap", "twelve disks are thrown into a box without friction", heap(), heap_box(),
            {"solver": {"tolerance": 1e-11}}, agree=1e-6)


def towers():
    return [
        Case("tower, light on heavy", "ten disks, each 10^(2/3) lighter than the one below: mass ratio 10^6",
             tower(np.logspace(6, 0, 10)), [floor()], {"scene": {"friction": 0.3}}, steps=10, holds=at_rest(1e-4)),
        Case("tower, heavy on light", "the same upside down: an iteration moves the top by 10^-6 of its error",
             tower(np.logspace(0, 6, 10)), [floor()], {"scene": {"friction": 0.3}}, steps=10, may_fail=ALL, holds=at_rest(1e-4)),
        Case("tower, heavy on light, tolerance 1e-4", "impulses that bear little of the top would meet it: each disk lacks little",
             tower(np.logspace(0, 6, 10)), [floor()], {"scene": {"friction": 0.3}, "solver": {"tolerance": 1e-4}}, steps=10,
             may_fail=ALL, holds=converged_at_most(0.5 * 1e6 * (0.1 * STEP * G) ** 2)),
        Case("heavy on one light disk", "a body bears 10^6 times its own weight",
             tower([1.0, 1e6]), [floor()], steps=10, subdomains=2, may_fail=ALL, holds=at_rest(1e-4)),
        Case("heavy on one light disk, tolerance 1e-4", "the residual compares what a local solve changes, which the light disk keeps "
             "small, with the impulses: it alone would meet the tolerance while the heavy one falls", tower([1.0, 1e6]), [floor()],
             {"solver": {"tolerance": 1e-4}}, steps=10, subdomains=2, may_fail=ALL,
             holds=converged_at_most(0.5 * 1e6 * (0.1 * STEP * G) ** 2)),
        Case("column of 1000", "impulses travel from end to end, one contact a sweep",
             tower([1.0] * 1000, 0.01), [floor()], {"solver": {"max_iterations": 100}}, steps=2, subdomains=8, may_fail=ALL,
             holds=at_rest(1e-2)),
    ]


def packings():
    radius = 0.05
    wide = 10 * radius
    wedge = [plane([0.0, 0.0], [np.cos(0.25), np.sin(0.25)]), plane([0.0, 0.0], [-np.cos(0.25), np.sin(0.25)])]
    still = together(at_rest(1e-5), overlaps_below(1e-6))
    rest = {"solver": {"tolerance": 1e-4, "max_iterations": 500}}
    return [
        Case("10^5 steps at rest", "15 disks in a box, tolerance 1e-4: errors of each step add up",
             heap(count=15), heap_box(), merged(rest, {"scene": {"friction": 0.3}}), steps=1000, long=100000,
             halves=True, may_fail=ALL,
             holds=together(overlaps_below(0.02, 0.2), bounded_energy(12.0), calms_down, creeps_below(CREEP))),
        Case("square lattice", "more contacts than it takes: impulses are not unique", square(5), box(wide),
             {"scene": {"friction": 0.3}}, holds=still, agree=1e-5),
        Case("hexagonal lattice", "the same, six neighbours each", hexagons(5), box(wide), {"scene": {"friction": 0.5}},
             holds=still, agree=1e-5),
        Case("square lattice, no friction", "a column of it stands on nothing but its foot", square(5), box(wide), holds=still,
             agree=1e-5),
        Case("jammed wedge", "a heavy disk between two planes that lean towards each other; friction bears it with no unique force",
             [Grain([0.0, radius / np.sin(0.25)], radius=radius, mass=100.0)], wedge,
             {"scene": {"friction": 1.0}}, subdomains=1, holds=still),
        Case("arch", "disks on the inverse of a hanging chain: in balance, and unstable", arch(7),
             [{"shape": "grains", "group": 1}], {"scene": {"friction": 0.5}}, steps=5, holds=at_rest(1e-4)),
        Case("arch, no friction", "the same without friction: normal forces alone balance it", arch(7),
             [{"shape": "grains", "group": 1}], steps=5, holds=at_rest(1e-4)),
    ]


def laws():
    row = [Grain([0.1 * k, 0.0], [1.0 if k == 0 else 0.0, 0.0]) for k in range(6)]
    free = {"scene": {"gravity": [0.0, 0.0, 0.0]}}
    cluster = [Grain([0.12 * k, 0.05], [0.0, -1.0 - 0.1 * k]) for k in range(3)] + [
        Grain([0.12 * k, 0.15 + 0.01 * k], [0.0, -2.0]) for k in range(3)]
    found = [Case(f"friction {mu:g}", "twelve disks are thrown into a box", heap(), heap_box(), {"scene": {"friction": mu}},
                  holds=overlaps_below(0.02, 0.5), agree=1e-4 if mu == 0.0 else 0.0) for mu in (0.0, 10.0, 1e6)]
    found += [Case(f"friction {mu:g}, spheres", "eight spheres are thrown into a box", heap(dimension=3, count=8), heap_box(3),
                   {"scene": {"friction": mu}}, dimension=3, holds=overlaps_below(0.02, 0.5),
                   agree=1e-4 if mu == 0.0 else 0.0) for mu in (0.0, 10.0, 1e6)]
    return found + [
        Case("cradle", "a row that touches, e = 1: nothing may be lost", row, [], merged(free, {"scene": {"restitution": 1.0}}),
             # a gap that rounding opens or closes decides what follows
             holds=keeps_energy(1e-7), agree=1e-6, agree_until=1),
        Case("cradle in a box", "e = 1, walls too, shocks for 0.4 s", row, [plane([-0.06, 0.0], [1.0, 0.0]),
             plane([0.58, 0.0], [-1.0, 0.0])], merged(free, {"scene": {"restitution": 1.0}}), steps=200, holds=keeps_energy(1e-6)),
        Case("struck from behind", "e = 1: a shock loads a pair that opens; held instead of sent back, it would gain 6 % of energy",
             [Grain([x, 0.0], [v, 0.0]) for x, v in ((0.0, 1.0), (0.1, 0.0), (0.199, 0.1))], [],
             merged(free, {"scene": {"restitution": 1.0}}), steps=5, subdomains=2, holds=keeps_energy(1e-7), agree=1e-6,
             agree_until=1),
        Case("inelastic collapse", "ever more and ever smaller shocks in finite time, e = 0.3", cluster, [floor()],
             {"scene": {"restitution": 0.3}, "time": {"step": 1.0 / 128}}, steps=150, holds=comes_to_rest),
        Case("bouncing heap", "e = 1 without friction: shocks of many contacts at once", heap(), heap_box(),
             {"scene": {"restitution": 1.0}}, steps=100),
    ]


def resistances():
    """Rolling and pivoting resistance, tangential restitution, attractions, sleep."""
    free = {"scene": {"gravity": [0.0, 0.0, 0.0]}}
    tan = 0.2 * (1.0 - 1e-6)
    slope = G * np.array([tan, -1.0]) / np.hypot(tan, 1.0)
    incline = {"scene": {"gravity": floats([*slope, 0.0]), "friction": 0.5, "rolling_friction": 0.2}}
    spinning = [Grain([0.1 * k, 0.0], [1.0 if k == 0 else 0.0, 0.0], spin=20.0 * (-1) ** k) for k in range(6)]
    chain = [Grain([0.0, -0.1 * k], group=int(k == 0)) for k in range(11)]
    held = [{"shape": "grains", "group": 1}]
    weight = 10 * 0.7 * G

    def bonds(strength):
        return {"material": [{"name": "rock"}],
                "law": [{"materials": "rock", "kind": "bonded", "friction": 0.3, "bond_strength": float(strength),
                         "bond_friction": 1.0, "bond_distance": 1e-3}]}

    def sticky(force, **more):
        return {"scene": {"wall_material": "wet"}, "material": [{"name": "wet"}],
                "law": [{"materials": "wet", "kind": "adhesive", "friction": 0.3, "adhesion": float(force), "adhesion_range": 2e-3,
                         **more}]}

    asleep = {"scene": {"friction": 0.3}, "solver": {"tolerance": 1e-4, "max_iterations": 500, "sleeping": True, "sleep_after": 10}}
    struck = square(4) + [Grain([0.21, 0.62], [0.3, -3.0])]
    return [
        Case("on the edge of rolling", "disks on an incline a millionth less steep than their rolling friction",
             [Grain([0.15 * k, 0.05], radius=0.05, mass=10.0 ** (k - 2)) for k in range(5)], [floor()], incline,
             holds=at_rest(1e-5), refuses=MOMENTS),
        Case("rolling friction 10", "twelve disks that cannot roll are thrown into a box", heap(), heap_box(),
             {"scene": {"friction": 0.5, "rolling_friction": 10.0}}, may_fail=("nscdd", "newton"), holds=overlaps_below(0.02, 0.5),
             refuses=MOMENTS),
        Case("rolling friction without friction", "moments alone turn the disks", heap(), heap_box(),
             {"scene": {"rolling_friction": 0.3}}, holds=overlaps_below(0.02, 0.5), refuses=MOMENTS),
        Case("rolling and pivoting friction 1e6, spheres", "eight spheres that only slide are thrown into a box",
             heap(dimension=3, count=8), heap_box(3), {"scene": {"friction": 0.3, "rolling_friction": 1e6, "pivoting_friction": 1e6}},
             dimension=3, holds=overlaps_below(0.02, 0.5), refuses=MOMENTS),
        Case("superballs", "e = e_t = 1 in a row of disks that spin: no shock may give energy", spinning, [],
             merged(free, {"scene": {"friction": 1e6, "restitution": 1.0, "tangential_restitution": 1.0}}), steps=50,
             holds=gains_nothing(1e-7)),
        Case("heap of superballs", "e = e_t = 1 between walls, shocks of many contacts at once", heap(), heap_box(),
             merged(free, {"scene": {"friction": 10.0, "restitution": 1.0, "tangential_restitution": 1.0}}), steps=50,
             holds=gains_nothing(1e-5)),
        Case("hanging chain", "ten disks hang in bonds a tenth stronger than their weight", chain, held,
             bonds(1.1 * weight), may_fail=("nscdd",), holds=at_rest(1e-4)),
        Case("hanging chain, strong bonds", "the same in bonds 10^3 times as strong: tensions are what is left of large numbers",
             chain, held, bonds(1e3 * weight), may_fail=ALL, holds=at_rest(1e-2)),
        Case("hanging chain, bonds beyond the tolerance", "the same in bonds 10^9 times as strong: a residual of 1e-8 is ten times the "
             "weight", chain, held, merged(bonds(1e9 * weight), {"solver": {"accuracy": 1e-2}}), steps=1, may_fail=ALL,
             holds=at_rest(1e-2)),
        Case("sticky heap", "twelve disks that attract each other with 100 times their weight are thrown into a box", heap(),
             heap_box(), sticky(100 * 0.7 * G), holds=overlaps_below(0.02, 0.5)),
        Case("sticky heap that rolls badly", "the same with rolling friction 0.3 of the law", heap(), heap_box(),
             sticky(100 * 0.7 * G, rolling_friction=0.3), may_fail=("nscdd", "newton"), holds=overlaps_below(0.02, 0.5),
             refuses=MOMENTS),
        Case("sleeping lattice", "disks fall asleep under a tolerance of 1e-4", square(4), box(8 * 0.05), asleep, steps=60,
             holds=together(at_rest(1e-2), overlaps_below(1e-3))),
        Case("sleepers that are struck", "a disk falls among disks at rest", struck, box(8 * 0.05), asleep, steps=100, may_fail=ALL,
             holds=overlaps_below(0.02)),
    ]


def places():
    weight = 12 * 0.75 * G
    overlapping = [Grain([0.05 * 1.9 * (i + 0.5), 0.05 * 1.8 * (j + 0.5)]) for j in range(3) for i in range(4)]
    still = {"scene": {"gravity": [0.0, 0.0, 0.0]}}
    large = [Grain([0.0, 0.5], radius=0.5, mass=1e4)] + [
        Grain([0.25 + 0.01 * k, 1.1 + 0.011 * (k % 3)], radius=0.005, mass=0.01) for k in range(8)] + [
        Grain([-1.2 + 0.012 * k, 0.005], radius=0.005, mass=0.01) for k in range(10)]
    fast = [Grain([0.0, 0.5], [0.0, -100.0]), Grain([0.4, 0.05]), Grain([0.9, 0.3], [-200.0, 0.0]), Grain([0.8, 0.05])]
    return [
        Case("overlaps of a fifth, weightless", "twelve disks overlap by a fifth of their radius: they are moved apart, not thrown",
             overlapping, [], still, holds=together(bounded_energy(0.0), overlaps_below(0.02, 0.5))),
        Case("overlaps of a fifth, in a box", "the same under gravity, between walls: they gain what lifts them",
             overlapping, box(0.45), {}, steps=100, holds=bounded_energy(12 * 0.7 * G * 0.3)),
        Case("coincident centres", "no direction from one to the other", [Grain([0.0, 0.3]), Grain([0.0, 0.3]), Grain([0.2, 0.1])],
             [floor()], {"scene": {"friction": 0.3, "start_overlap": 2.0}}, steps=40, late=True, subdomains=2,
             holds=together(bounded_energy(1.5 * weight), overlaps_below(0.02, 0.9))),
        Case("radius ratio 1:100", "a disk of 10^4 kg on disks of 10 g", large, [floor()], {"scene": {"friction": 0.3}}, steps=100),
        Case("steps of 1e-6 s", "changes of velocity that are small beside the velocities", flower(), [],
             {"time": {"step": 1e-6}, "scene": {"friction": 0.3}}, may_fail=ALL),
        Case("steps of 1 s", "grains fall by many radii in a step", heap(), heap_box(),
             {"time": {"step": 1.0}, "scene": {"friction": 0.3}}, holds=bounded_energy(1e4), may_fail=ALL),
        Case("faster than a radius per step", "an impact that may be missed", fast, [floor()], {"scene": {"friction": 0.3}},
             holds=bounded_energy(0.35 * (100.0 ** 2 + 200.0 ** 2) + 10.0)),
    ]


def units():
    huge, tiny = 2.0 ** 40, 2.0 ** -40
    return [
        transformed(BASE, "lengths 10^12 times larger", "units of 2^40: the same numbers, to rounding", length=huge),
        transformed(BASE, "lengths 10^12 times smaller", "units of 2^-40: the same digits", length=tiny),
        transformed(BASE, "masses 10^12 times larger", "units of 2^40: the same digits", mass=huge),
        transformed(BASE, "masses 10^12 times smaller", "units of 2^-40: the same digits", mass=tiny),
        transformed(BASE, "times 10^12 times longer", "units of 2^40: the same digits", time=huge),
        transformed(BASE, "times 10^12 times shorter", "units of 2^-40: the same digits", time=tiny),
        transformed(BASE, "mirrored", "left and right change places, and the order of contacts with them", turn=[[-1, 0], [0, 1]]),
        transformed(BASE, "turned upside down", "the axes change places", turn=[[0, -1], [1, 0]]),
    ]


def next_to_nothing():
    free = {"scene": {"gravity": [0.0, 0.0, 0.0]}}
    spread = [Grain([0.3 * k, 0.3 * (k % 3) + 0.5]) for k in range(6)]
    near = [Grain([0.104 * i, 0.104 * j + 0.2], [0.1 * i, 0.1 * j]) for j in range(3) for i in range(3)]
    around = [n for n in np.array(np.meshgrid([-1, 0, 1], [-1, 0, 1], [-1, 0, 1])).reshape(3, -1).T if np.any(n)]
    pairs = [Grain([0.1 * i + x, 0.05], [0.5 * i - 0.25, 0.0]) for x in (0.0, 2.0) for i in range(2)]
    return [
        Case("flight out of sight", "speeds of 10^29 m/s: places beyond what cells can count", [
            Grain([0.0, 0.0], [1e29, 0.0]), Grain([0.1, 0.0]), Grain([0.2, 0.0], [-1e29, 1e29]), Grain([0.5, 0.3])], [],
             {"scene": {"friction": 0.3}}, subdomains=2),
        Case("gravity 0", "nothing moves", square(4), box(8 * 0.05), free, holds=bounded_energy(0.0)),
        Case("empty scene", "no grain at all", [], [floor()], subdomains=1),
        Case("one body", "in flight", [Grain([0.0, 0.5])], [], subdomains=1, holds=no_contact),
        Case("glued bodies only", "nothing is free", [Grain([0.1 * k, 0.0], group=1) for k in range(4)], [
            {"shape": "grains", "group": 1}], subdomains=2),
        Case("no contact", "six bodies in flight, in subdomains of their own", spread, [floor()], steps=10, holds=no_contact),
        Case("every contact open", "pairs within the alert distance that part: no impulse", near, [], free, steps=5,
             holds=keeps_energy(1e-12)),
        Case("subdomains that empty", "two pairs far apart in eight boxes; one touches, and then no more", pairs, [floor()],
             merged(free, {"decomposition": {"grid": [8, 1], "subdomains": 8}}), steps=40, subdomains=8),
        # subdomains are no more than the cells of a diameter in the box of the grains: far ones make it large enough
        Case("large disk in many subdomains", "a body that 8 subdomains and more share", flower(16) + [Grain([0.0, 16.0])], [],
             merged(free, {"decomposition": {"grid": [30, 1], "subdomains": 30}, "solver": {"max_iterations": 3000}}), subdomains=30,
             holds=shared_by(8), agree=1e-4),
        Case("large sphere in many subdomains", "the same in space",
             [Grain([0.0] * 3, radius=0.3, mass=10.0), Grain([0.0, 0.0, 30.0])] + [
                 Grain(np.array(n) * 0.35 / np.linalg.norm(n), -0.3 * np.array(n), radius=0.05) for n in around], [],
             merged(free, {"scene": {"friction": 0.4}, "decomposition": {"grid": [5, 5, 1], "subdomains": 25}}), dimension=3,
             subdomains=25, holds=shared_by(8), may_fail=ALL),
        Case("lid in many subdomains", "a plane that forces move on 16 disks, in eight subdomains",
             [Grain([0.05 + 0.1 * k, 0.05]) for k in range(16)],
             [floor(), {**plane([0.0, 0.1], [0.0, -1.0]), "free": [False, True], "force": [0.0, -50.0], "mass": 3.0}],
             {"decomposition": {"grid": [8, 1], "subdomains": 8}}, subdomains=8, holds=together(shared_by(8), at_rest(1e-5))),
    ]


def extremes():
    free = {"scene": {"gravity": [0.0, 0.0, 0.0]}}
    spin = [Grain([0.0, 0.0, 0.05], spin=[0.0, 0.0, 30.0]), Grain([1.0, 0.0, 2.0], spin=[3.0, 20.0, -5.0])]
    return [
        Case("spinning spheres", "one on the ground, one in flight: no step may change their spin", spin, [floor(3)],
             {"scene": {"gravity": [0.0, 0.0, 0.0], "friction": 0.5}, "output": {"energy": False}}, halves=True,
             dimension=3, steps=5000, long=1000000,
             subdomains=1, holds=keeps_energy(1e-12)),
        Case("denormal impulses", "momenta of 10^-309 kg m/s",
             [Grain([0.1 * k, 0.0], [1e-280 * (1 - k), 0.0], mass=1e-29) for k in range(3)], [],
             merged(free, {"time": {"step": 1e-5}}), subdomains=2),
        Case("tiny impulses", "momenta of 10^-125 kg m/s",
             [Grain([0.1 * k, 0.0], [1e-100 * (1 - k), 0.0], mass=1e-25) for k in range(3)], [], free, subdomains=2,
             may_fail=ALL),
        Case("huge impulses", "momenta of 10^50 kg m/s",
             [Grain([2.0e20 * k, 0.0], [1e20 * (1 - k), 0.0], radius=1e20, mass=1e30) for k in range(3)], [], free, subdomains=2,
             may_fail=ALL),
        Case("NaN in the input", "a place that is no number", [Grain([0.0, float("nan")])], [floor()], subdomains=1,
             ends=((2,), "y")),
    ]


def enrichments():
    found = []
    for contacts in ("all", "active"):
        for direction in (0.0, 1e-6, 1.0, 1e3, 1e12):
            for method in ("nscdd_ep", "schwarz_ec"):
                found.append((f"{method}, {contacts}, l = {direction:g}",
                              {"solver": {"method": method, "acceleration": "none"},
                               "enriched": {"direction": direction, "contacts": contacts}}))
    inner = {
        "nscdd_ep, cg": {"enriched": {"interface": "cg"}},
        "nscdd_ep, cg to 0.1": {"enriched": {"interface": "cg", "cg_tolerance": 0.1}},
        "nscdd_ep, cg, l = 1e12": {"enriched": {"interface": "cg", "direction": 1e12}},
    }
    stopped = {"nscdd_ep, 2 iterations of cg": {"solver": {"method": "nscdd_ep"},
                                               "enriched": {"interface": "cg", "cg_max_iterations": 2}}}
    floats = [Grain([0.104 * i, 0.104 * j + 0.05], [0.2 * (i - j), -0.2]) for j in range(3) for i in range(4)]
    return [
        Case("search directions from 0 to 10^12", "the enriched operator from nothing to near singular", heap(), heap_box(),
             {"scene": {"friction": 0.3}}, may_fail=ALL, methods=dict(found)),
        Case("no direction", "l = 0 is NSCDD, bit for bit", heap(), heap_box(),
             {"scene": {"friction": 0.3}, "solver": {"max_iterations": ITERATIONS}}, steps=8,
             methods={"nscdd": METHODS["nscdd"], "nscdd_ep, all, l = 0": dict(found)["nscdd_ep, all, l = 0"],
                      "nscdd_ep, active, l = 0": dict(found)["nscdd_ep, active, l = 0"]}),
        Case("bodies that float", "grains that no active contact holds in a subdomain; large l", floats, [floor()], {},
             may_fail=ALL, methods={title: groups for title, groups in found if "active" in title}),
        Case("inner iterations that end early", "a loose interface solve", heap(), heap_box(), {"scene": {"friction": 0.3}},
             may_fail=ALL, methods={title: merged({"solver": {"method": "nscdd_ep"}}, groups) for title, groups in inner.items()}),
        Case("inner iterations that fail", "an interface solve that may not reach its tolerance", heap(), heap_box(),
             {"scene": {"friction": 0.3}}, late=True, ends=((3, 4), "did not reach cg_tolerance"), methods=stopped),
        Case("many sweeps", "50 sweeps between two exchanges", heap(), heap_box(), {"scene": {"friction": 0.3}}, may_fail=(
            "schwarz, 50 sweeps", "schwarz_ec, 50 sweeps"),
            methods={f"{title}, 50 sweeps": merged(METHODS[title], {"solver": {"sweeps": 50}})
                     for title in ("nscdd", "nscdd, accelerated", "nscdd_ep", "schwarz", "schwarz_ec")}),
    ]


def calms_down(played):
    """At the end: no energy to speak of."""
    figures = played.figures
    kinetic = played.figures.history["kinetic_energy"]
    if played.run.status == 3 or len(kinetic) < 1000 or kinetic[len(kinetic) // 2:].max() <= 1e-4 * figures.most_kinetic:
        return []
    return [f"kinetic energy of {kinetic[len(kinetic) // 2:].max():.1e} J in the second half"]


def comes_to_rest(played):
    found = played.figures.final_kinetic
    return [] if played.run.status == 3 or found <= 1e-4 else [f"kinetic energy of {found:.1e} J at the end"]


def cases():
    """All cases, by name."""
    slow = [dataclasses.replace(case, slow=True) for case in towers() + packings()]
    found = slow + laws() + resistances() + places() + units() + next_to_nothing() + extremes() + enrichments()
    return {case.name: case for case in found}
