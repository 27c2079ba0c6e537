"""What the files of a DATBOX of LMGC90 say: bodies, materials, laws, the table of visibility, states and contacts."""
import math
from dataclasses import dataclass

import numpy as np
from datbox_text import ABOVE_0, Refused, entries


GRAINS = {"DISKx": 2, "DISKb": 2, "SPHER": 3, "SPHEb": 3}
WALLS = {"JONCx": 2, "xKSID": 2, "PLANx": 3, "DNLYC": 3}
HULLS = {"POLYG": 2, "POLYR": 3}
#: sizes of contactors, in their order; the others have a radius
HALF_AXES = {"JONCx": ("axe1", "axe2"), "PLANx": ("axe1", "axe2", "axe3")}
#: relative error of radii of gyration and moments of inertia: files have them to four digits
ROUND = 1e-3


class Body:
    """A rigid body: its bulk, node and contactors, and what drives it."""

    def __init__(self, rank, kind, start):
        self.rank, self.kind, self.start = rank, kind, start
        self.dimension = {"RBDY2": 2, "RBDY3": 3}[kind]
        self.bulk = self.node = self.initial = None
        self.contactors = []
        #: component (1, 2, ...): (kind vlocy or force, function of the time or constant)
        self.drives = {}

    def frame(self):
        """Axes of the body as columns."""
        if self.dimension == 2:
            turned = self.node.get("coo3", 0.0) + (self.initial.get("X(3)", 0.0) if self.initial else 0.0)
            return np.array([[math.cos(turned), -math.sin(turned)], [math.sin(turned), math.cos(turned)]])
        if self.initial is None or "a(1)" not in self.initial.values:
            return np.eye(3)
        third = "c" if "c(1)" in self.initial.values else "g"
        return np.stack([self.initial.vector(name, 3) for name in ("a", "b", third)], axis=1)

    def place(self):
        place = self.node.vector("coo", self.dimension)
        return place + self.initial.vector("X", self.dimension) if self.initial else place

    def centre(self, beside):
        """Where the centre of mass is, `beside` the node in the axes of BODIES.DAT. LMGC90 shifts the node of a body with one contactor by it,
        without a turn, so that DOF.INI turns and moves the body about it. The node of a body with several contactors stays where it is."""
        return self.place() + (beside if len(self.contactors) == 1 else self.frame() @ beside)

    def velocity(self, beside=None):
        """Translation of the centre of mass `beside` the node, or of the node, then spin about the axes of space."""
        d = self.dimension
        if self.initial is None:
            return np.zeros(3 * d - 3)
        velocity = self.initial.vector("V", 3 * d - 3)
        if d == 3:
            velocity[3:] = self.frame() @ velocity[3:]
        if beside is not None and len(self.contactors) > 1:
            arm = self.frame() @ beside
            velocity[:d] += np.cross(velocity[3:], arm) if d == 3 else velocity[2] * np.array([-arm[1], arm[0]])
        return velocity


def read_bodies(path):
    bodies, body = [], None
    for keyword, entry in entries(path):
        head = not entry.words or keyword == "$$$$$$"
        if keyword == "$bdyty" and entry.words:
            kind = entry.words[0]
            if kind not in ("RBDY2", "RBDY3"):
                entry.refuse(f"a body {kind}", "RBDY2 or RBDY3: rigid bodies")
            body = Body(sum(other.kind == kind for other in bodies) + 1, kind, entry)
            bodies.append(body)
        elif head or body is None:
            continue
        elif keyword == "$blmty":
            if entry.words[0] != "PLAIN":
                entry.refuse(f"a bulk {entry.words[0]}", "PLAIN")
            entry.check("avrd", entry.get("avrd", 0.0))
            body.bulk = entry
        elif keyword == "$nodty":
            body.node = entry
        elif keyword == "$tacty":
            shape = entry.words[0]
            if {**GRAINS, **WALLS, **HULLS}.get(shape) != body.dimension:
                entry.refuse(f"a contactor {shape} of a body {body.kind}",
                             "DISKx, POLYG, JONCx or xKSID of RBDY2, SPHER, POLYR, PLANx or DNLYC of RBDY3")
            if shape not in HULLS:
                for place, name in enumerate(HALF_AXES.get(shape, ["byrd"]), 1):
                    entry.check(name, entry.size(place, name), ABOVE_0)
            body.contactors.append(entry)
    for body in bodies:
        for what, there in (("$blmty", body.bulk), ("$nodty", body.node), ("$tacty", body.contactors)):
            if not there:
                body.start.refuse(f"body {body.rank} has no {what}", "one")
    if not bodies:
        raise Refused(f"{path}: no body: expected $bdyty and RBDY2 or RBDY3")
    if len({body.kind for body in bodies}) > 1:
        next(body for body in bodies if body.kind != bodies[0].kind).start.refuse("bodies of 2D and 3D in one file", "one kind")
    return bodies


def put_once(found, entry):
    """Put a material or a law under its nickname. One that is there already has to be the same."""
    older = found.setdefault(entry.words[0], entry)
    if (older.words, older.values) != (entry.words, entry.values):
        entry.refuse(f"{entry.words[0]} differs from line {older.line}, where it is too", "each name once")


def read_bulk(path):
    """Density by nickname, and gravity (3)."""
    density, gravity = {}, None
    for keyword, entry in entries(path):
        if keyword == "$gravy" and "grv1" in entry.values:
            gravity = entry.vector("grv", 3)
        if keyword == "$behav" and len(entry.words) > 1 and entry.words[0] != "lawty":
            put_once(density, entry)
    if gravity is None:
        raise Refused(f"{path}: no gravity: expected $gravy with grv1=, grv2=, grv3=")
    return density, gravity


def read_laws(path):
    """Laws by nickname, and the table of visibility as [(pair of (contactor, colour), nickname, alert, entry)]."""
    laws, sees = {}, []
    for keyword, entry in entries(path):
        if keyword == "$behav" and len(entry.words) > 1 and entry.words[0] != "lawty":
            put_once(laws, entry)
        elif keyword == "$seety" and len(entry.words) >= 7 and entry.words[0] != "cdbdy":
            _, candidate, colour, law, _, antagonist, other = entry.words[:7]
            # the distance stands alone, or as alert= on the same line or on the next
            alert = entry.number(entry.words[7]) if len(entry.words) > 7 and entry.words[7] != "alert" else entry.get("alert")
            entry.check("alert", alert)
            sees.append(({(candidate, colour), (antagonist, other)}, law, alert, entry))
    if not sees:
        raise Refused(f"{path}: no table of visibility: expected $seety")
    return laws, sees


def read_initial(path, bodies):
    """States by number of the body; the time."""
    time, body = 0.0, None
    for keyword, entry in entries(path):
        if keyword == "$steps":
            time = entry.get("time", 0.0)
        elif keyword == "$bdyty" and entry.words:
            rank = int(entry.words[1])
            if entry.words[0] != bodies[0].kind or not 1 <= rank <= len(bodies):
                entry.refuse(f"body {' '.join(entry.words[:2])}", f"a body of BODIES.DAT, {bodies[0].kind} 1 to {len(bodies)}")
            body = bodies[rank - 1]
        elif keyword == "$nodty" and entry.words and body:
            if body.initial:
                entry.refuse(f"a second state of body {body.rank}, after that of line {body.initial.line}", "one state of a body")
            body.initial = entry
    return time


@dataclass
class Contact:
    """A contact of Vloc_Rloc: numbers of the candidate and the antagonist, their contactors, forces along n, t and s [N]."""
    candidate: int
    contactor: str
    antagonist: int
    other: str
    status: str
    gap: float
    along: list
    #: from the antagonist to the candidate (3)
    normal: np.ndarray
    #: on the candidate along the axes of space (3) [N]
    force: np.ndarray
    #: (3); NaN where the file has none
    point: np.ndarray

    def row(self):
        """Its row in the table of contacts."""
        return [self.candidate, self.contactor, self.antagonist, self.other, self.status, self.gap, *self.along, *self.normal, *self.force]


def read_contacts(path, bodies, laws):
    """The contacts, and the time at which they are [s]. In 2D t is (n2, -n1); in 3D t and s stand in the file."""
    contacts, head, time = [], False, 0.0
    for keyword, entry in entries(path):
        if keyword == "$steps":
            time = entry.get("time", 0.0)
        if keyword != "$icdan" or not entry.words:
            continue
        if entry.words[0] == "cdbdy":
            head = True
        elif head and entry.words[0] == bodies[0].kind:
            words = entry.words
            kinds = [k for k, word in enumerate(words) if word == bodies[0].kind]
            if len(kinds) != 2:
                entry.refuse("a contact of other bodies", f"two bodies {bodies[0].kind}")
            pair = [int(words[k + 1]) for k in kinds]
            if not all(1 <= rank <= len(bodies) for rank in pair):
                entry.refuse(f"bodies {pair[0]} and {pair[1]}", f"bodies of BODIES.DAT, 1 to {len(bodies)}")
            # polygons name the vertex of the one and the segment of the other, too
            status = next((word for word in words[kinds[1] + 4:] if not word.isdigit() and word not in ("CDVER", "ANSEG")), "")
            gap = next((entry.values[name] for name in ("gapTT", "gTT", "gap") if name in entry.values), math.nan)
            law = laws.get(words[kinds[1] - 1])
            if law and law.words[1] == "IQS_MOHR_DS_CLB" and not status.startswith("M"):
                entry.refuse(f"bodies {pair[0]} and {pair[1]} with status {status}, whose bond is broken", "Mstck: near pairs begin bonded here")
            along = [entry.get(f"{name}/H", 0.0 if name == "rls" and bodies[0].dimension == 2 else None) for name in ("rln", "rlt", "rls")]
            normal = np.append(entry.vector("n", bodies[0].dimension), [0.0] * (3 - bodies[0].dimension))
            if bodies[0].dimension == 2:
                tangents = np.array([[normal[1], -normal[0], 0.0], [0.0] * 3])
            else:
                tangents = np.stack([entry.vector(name, 3, math.nan) for name in "ts"])
            contacts.append(Contact(pair[0], words[kinds[0] + 2], pair[1], words[kinds[1] + 2], status, gap, along, normal,
                                    along[0] * normal + along[1:] @ tangents, entry.vector("coo", 3, math.nan)))
    return contacts, time
