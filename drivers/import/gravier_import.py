#!/usr/bin/env python3
"""Make a case of Gravier from a DATBOX of LMGC90.

    gravier_import DATBOX --step H [--steps N] [--out NAME] [--period LX LY [LZ]] [--planes] [--slip V]

--period takes two numbers in 2D and three in 3D, 0 along an axis that is not periodic.
Reads BODIES.DAT, BULK_BEHAV.DAT and TACT_BEHAV.DAT and, where they are there, DRV_DOF.DAT, DOF.INI and Vloc_Rloc.INI; writes NAME.nml,
NAME.h5 (bodies), NAME_drive_K.csv (drives that change in time) and NAME_contacts.csv (the contacts of Vloc_Rloc.INI).
What has no counterpart is named, with file and line, and refused: status 2, nothing is written. So is a case that `gravier --check`
refuses: the program of $GRAVIER_PROGRAM, or the one beside this script or in PATH, reads it before its files get their names."""
import argparse
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import h5py
    import numpy as np
except ImportError as missing:
    sys.exit(f"gravier_import: error: {missing}: expected a python3 with h5py and numpy (apt install python3-h5py)")

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from one_line import OneLineParser, plain  # noqa: E402
from whole_file import Locked, give_names, hdf5_file, output_lock  # noqa: E402

LAWS = ("IQS_CLB", "IQS_DS_CLB", "IQS_MOHR_DS_CLB", "IQS_WET_DS_CLB", "RST_CLB", "RST_DS_CLB")
#: other names of parameters of laws, as LMGC90 itself writes them, in full or in four letters, and those of its pre-processor
OLDER = {"dfric": "dyfr", "dfrc": "dyfr", "sfric": "stfr", "sfrc": "stfr", "cohen": "cohn", "cohet": "coht", "Wethk": "Wthk", "Weth": "Wthk",
         "restn": "rstn", "restt": "rstt"}
GRAINS = {"DISKx": 2, "DISKb": 2, "SPHER": 3, "SPHEb": 3}
WALLS = {"JONCx": 2, "xKSID": 2, "PLANx": 3, "DNLYC": 3}
#: `name= number`; forces and gaps of contacts stand without the sign
VALUE = re.compile(r"(?:([A-Za-z]\w*(?:\(\d\))?)\s*=|\b(rl[nts]/H|gapTT))\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[DdEe][-+]?\d+|[-+]\d{3})?)")
#: relative error of radii of gyration and moments of inertia: files have them to four digits
ROUND = 1e-3
#: rows to a period of a drive that oscillates
ROWS_PER_PERIOD = 200


class Refused(Exception):
    """Input that has no counterpart, or is not a DATBOX."""


def number(text):
    """A real number as Fortran writes it."""
    return float(re.sub(r"(?<=[\d.])([-+]\d{3})$", r"E\1", re.sub("[Dd]", "E", text)))


class Entry:
    """A line that begins a thing, with the values `name= number` of it and of the lines that continue it."""

    def __init__(self, path, line, words):
        self.path, self.line, self.words, self.values = path, line, words, {}

    def add(self, text):
        # ax1 is the older name of axe1
        for name, bare, value in VALUE.findall(text):
            self.values[OLDER.get(name, re.sub(r"^ax(?=\d$)", "axe", name or bare))] = number(value)

    def get(self, name, default=None):
        if name in self.values:
            return self.values[name]
        if default is None:
            names = [name] + [older for older, newer in OLDER.items() if newer == name]
            self.refuse(f"{'=, '.join(names[:-1])}{'= or ' if names[1:] else ''}{names[-1]}= is missing", "a value")
        return default

    def vector(self, name, count, default=None):
        """The values name1, name2, ... or name(1), name(2), ..."""
        names = [f"{name}({k + 1})" if f"{name}({k + 1})" in self.values else f"{name}{k + 1}" for k in range(count)]
        return np.array([self.get(each, default) for each in names])

    def refuse(self, found, expected):
        raise Refused(f"{self.path}: line {self.line}: {found}: expected {expected}")


def entries(path):
    """The file as [(keyword, Entry)]: a line of text after a keyword line `$...` begins an entry, one whose columns 2 to 6 are blank
    continues the last."""
    found, keyword = [], ""
    for count, text in enumerate(path.read_text(encoding="latin-1").expandtabs().splitlines(), 1):
        if not text.strip() or text.lstrip()[0] in "!#":
            continue
        if text.startswith("$"):
            keyword = text.split()[0]
            found.append((keyword, Entry(path, count, text.split()[1:])))
            found[-1][1].add(text)
        elif text[1:6].strip() or not found:
            words = text.split("=")[0].split()
            found.append((keyword, Entry(path, count, words)))
            found[-1][1].add(text)
        else:
            found[-1][1].add(text)
            found[-1][1].words += re.findall(r"^\s+(localframe)", text)
    return found


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

    def velocity(self):
        """Translation, then spin about the axes of space."""
        d = self.dimension
        if self.initial is None:
            return np.zeros(3 * d - 3)
        velocity = self.initial.vector("V", 3 * d - 3)
        if d == 3:
            velocity[3:] = self.frame() @ velocity[3:]
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
            body.bulk = entry
        elif keyword == "$nodty":
            body.node = entry
        elif keyword == "$tacty":
            shape = entry.words[0]
            if GRAINS.get(shape, WALLS.get(shape)) != body.dimension:
                entry.refuse(f"a contactor {shape} of a body {body.kind}", "DISKx, JONCx or xKSID of RBDY2, SPHER, PLANx or DNLYC of RBDY3")
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


def read_bulk(path):
    """Density by nickname, and gravity (3)."""
    density, gravity = {}, None
    for keyword, entry in entries(path):
        if keyword == "$gravy" and "grv1" in entry.values:
            gravity = entry.vector("grv", 3)
        if keyword == "$behav" and len(entry.words) > 1 and entry.words[0] != "lawty":
            density[entry.words[0]] = entry
    if gravity is None:
        raise Refused(f"{path}: no gravity: expected $gravy with grv1=, grv2=, grv3=")
    return density, gravity


def read_laws(path):
    """Laws by nickname, and the table of visibility as [(pair of (contactor, colour), nickname, alert, entry)]."""
    laws, sees = {}, []
    for keyword, entry in entries(path):
        if keyword == "$behav" and len(entry.words) > 1 and entry.words[0] != "lawty":
            laws[entry.words[0]] = entry
        elif keyword == "$seety" and len(entry.words) >= 7 and entry.words[0] != "cdbdy":
            _, candidate, colour, law, _, antagonist, other = entry.words[:7]
            # the distance stands alone, or as alert= on the same line or on the next
            alert = number(entry.words[7]) if len(entry.words) > 7 and entry.words[7] != "alert" else entry.get("alert")
            sees.append(({(candidate, colour), (antagonist, other)}, law, alert, entry))
    if not sees:
        raise Refused(f"{path}: no table of visibility: expected $seety")
    return laws, sees


class Function:
    """A driven value against time: constant, or its table of (time, value)."""

    def __init__(self, constant=0.0, table=None):
        self.constant, self.table = constant, table

    @staticmethod
    def of(entry, start, end):
        """[CT + AMP cos(OMEGA t + PHI)] min(1, RAMPI + RAMP t), or a file of times and values; times from `start` on."""
        if "evolution" in entry.words:
            path = entry.path.parent / entry.words[entry.words.index("evolution") + 1]
            try:
                table = np.loadtxt(path, ndmin=2)
            except (OSError, ValueError) as problem:
                raise Refused(f"{entry.path}: line {entry.line}: {path}: {problem}: expected a file of times and values") from None
            return Function(table=table[:, :2] - [start, 0.0])
        ct, amp, omega, phi, rampi, ramp = (number(word) for word in entry.words[2:8])
        if (amp == 0.0 or omega == 0.0) and ramp == 0.0:
            return Function((ct + amp * math.cos(phi)) * min(1.0, rampi))
        times = [0.0, end - start]
        if ramp != 0.0 and 0.0 < (1.0 - rampi) / ramp - start < end - start:
            times.append((1.0 - rampi) / ramp - start)
        if amp * omega != 0.0:
            times += list(np.arange(0.0, end - start, 2.0 * math.pi / abs(omega) / ROWS_PER_PERIOD))
        times = np.unique(times)
        values = (ct + amp * np.cos(omega * (times + start) + phi)) * np.minimum(1.0, rampi + ramp * (times + start))
        return Function(table=np.stack([times, values], axis=1))

    def at(self, times):
        return np.full(len(times), self.constant) if self.table is None else np.interp(times, *self.table.T)


def read_drives(path, bodies, start, end):
    body = None
    for keyword, entry in entries(path):
        if keyword == "$bdyty" and entry.words:
            rank = int(entry.words[1])
            if entry.words[0] != bodies[0].kind or not 1 <= rank <= len(bodies):
                entry.refuse(f"body {' '.join(entry.words[:2])}", f"a body of BODIES.DAT, {bodies[0].kind} 1 to {len(bodies)}")
            body = bodies[rank - 1]
        elif keyword == "$dofty" and entry.words and body and entry.words[0] in ("vlocy", "force"):
            body.drives[int(entry.words[1])] = (entry.words[0], Function.of(entry, start, end), entry)
        elif keyword == "$dofty" and entry.words and entry.words[0] not in ("numbr",) and not entry.words[0].startswith("["):
            entry.refuse(f"a driven degree of freedom {entry.words[0]}", "vlocy or force")


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
            body.initial = entry
    return time


def read_contacts(path, bodies, laws):
    """Rows of the contacts: body, contactor, body, contactor, status, gap, forces n, t, s, normal, force on the candidate along the axes
    of space. The normal is from the antagonist to the candidate; t is (n2, -n1) in 2D and stands in the file in 3D, as s does."""
    rows, head = [], False
    for keyword, entry in entries(path):
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
            status = next((word for word in words[kinds[1] + 4:] if not word.isdigit()), "")
            gap = next((entry.values[name] for name in ("gapTT", "gTT", "gap") if name in entry.values), math.nan)
            law = laws.get(words[kinds[1] - 1])
            if law and law.words[1] == "IQS_MOHR_DS_CLB" and not status.startswith("M"):
                entry.refuse(f"bodies {pair[0]} and {pair[1]} with status {status}, whose bond is broken", "Mstck: near pairs begin bonded here")
            force = [entry.values.get(f"{name}/H", 0.0) for name in ("rln", "rlt", "rls")]
            normal = entry.vector("n", 3, 0.0)
            if bodies[0].dimension == 2:
                tangents = np.array([[normal[1], -normal[0], 0.0], [0.0] * 3])
            else:
                tangents = np.stack([entry.vector(name, 3, math.nan) for name in "ts"])
            rows.append([pair[0], words[kinds[0] + 2], pair[1], words[kinds[1] + 2], status, gap, *force, *normal,
                         *(force[0] * normal + force[1:] @ tangents)])
    return rows


# ---- what it becomes


class Case:
    """The case that is made: grains, boundaries, materials (one for each contactor and colour), laws (one for each line of the table of
    visibility that grains have part in), remarks for the user. `slip` is the scale [m/s] of laws with static and dynamic friction, `period`
    has a length for each axis or is empty."""

    def __init__(self, bodies, density, gravity, laws, sees, planes, slip, period):
        self.bodies, self.density, self.gravity, self.laws, self.sees, self.planes = bodies, density, gravity, laws, sees, planes
        self.period = period
        self.dimension, self.slip = bodies[0].dimension, slip
        self.grains, self.boundaries, self.remarks, self.used, self.materials, self.met = [], [], [], [], [], {}
        self.free = [body for body in bodies if not body.drives and body.contactors[0].words[0] in GRAINS]
        if not self.free:
            bodies[0].start.refuse("no grain moves freely", "a body with one contactor DISKx or SPHER that DRV_DOF.DAT does not drive")
        self.colours = {self.thing(body.contactors[0]) for body in self.free}
        #: radii by contactor and colour: none of flat walls
        self.radii = {}
        for contactor in (contactor for body in bodies for contactor in body.contactors):
            self.radii.setdefault(self.thing(contactor), set()).update([contactor.get("byrd")] if contactor.words[0] in GRAINS else [])
        self.centres = np.array([body.place() for body in self.free])

    @staticmethod
    def thing(contactor):
        """Contactor and colour, by which the table of visibility names it."""
        return {"DISKb": "DISKx", "SPHEb": "SPHER"}.get(contactor.words[0], contactor.words[0]), contactor.words[3]

    def material(self, thing):
        """Name of its material: the colour, where no other contactor has it."""
        name = thing[1] if sum(other[1] == thing[1] for other in self.radii) == 1 else " ".join(thing)
        if name not in self.materials:
            self.materials.append(name)
        return name

    def meet(self, thing, entry):
        """Take over the laws between the free grains and a contactor of a colour; False where no grain sees it."""
        lines = {grain: see for grain in sorted(self.colours) for see in self.sees if see[0] == {grain, thing}}
        for grain in sorted(self.colours - lines.keys() if lines else ()):
            entry.refuse(f"{grain[0]} of colour {grain[1]} does not see {thing[0]} of colour {thing[1]}, others do",
                         "a contact law for all grains: $seety of TACT_BEHAV.DAT")
        for pair, law, alert, see in lines.values():
            names = sorted(self.material(each) for each in pair)
            self.met[tuple(names)] = self.keys_of(law, alert, see, pair)
            self.used.append(alert)
        return bool(lines)

    def keys_of(self, nickname, alert, see, pair):
        """Keys of the &law that a line of the table of visibility becomes."""
        if nickname not in self.laws:
            see.refuse(f"law {nickname}", "a law of this file")
        entry = self.laws[nickname]
        name = entry.words[1]
        if name not in LAWS:
            entry.refuse(f"law {name}", f"one of {', '.join(LAWS)}")
        keys = self.friction_of(entry, name)
        if name.startswith("RST"):
            keys.update(restitution=entry.get("rstn"), tangential_restitution=entry.get("rstt"))
        if name == "IQS_WET_DS_CLB":
            return {"kind": "adhesive", **keys, "adhesion": entry.get("cohn"), "adhesion_range": min(entry.get("Wthk"), alert)}
        if name == "IQS_MOHR_DS_CLB":
            return {"kind": "bonded", **keys, **self.bond_of(entry, alert, pair)}
        return {"kind": "velocity" if "slip_scale" in keys else "coulomb", **keys}

    def friction_of(self, entry, name):
        """Keys of friction: one coefficient, or a static and a dynamic one where the law here has both."""
        if name in ("IQS_CLB", "RST_CLB"):
            return {"friction": entry.get("fric")}
        static, dynamic = entry.get("stfr"), entry.get("dyfr")
        if static == dynamic:
            return {"friction": static}
        if name in ("IQS_WET_DS_CLB", "IQS_MOHR_DS_CLB"):
            entry.refuse(f"law {name} with stfr= {static:g} and dyfr= {dynamic:g}", "equal ones: this law has one coefficient here")
        if self.slip is None:
            entry.refuse(f"law {name} with stfr= {static:g} and dyfr= {dynamic:g}",
                         "--slip V, the slip [m/s] over which friction falls from the one to the other")
        return {"static_friction": static, "dynamic_friction": dynamic, "slip_scale": self.slip}

    def bond_of(self, entry, alert, pair):
        """Keys of a bond. Cohesion is a stress in LMGC90, of a contact as large as R* = R_i R_j/(R_i + R_j) in 2D, pi R*^2 in 3D, with the
        radius of the grain against a flat wall."""
        if not {thing[0] for thing in pair} <= {"DISKx", "SPHER", "JONCx", "PLANx"}:
            entry.refuse("law IQS_MOHR_DS_CLB of grains in a drum", "grains, JONCx and PLANx")
        cohesion, shear = entry.get("cohn"), entry.get("coht")
        if not (cohesion > 0.0 and shear > 0.0):
            entry.refuse(f"law IQS_MOHR_DS_CLB with cohn= {cohesion:g} and coht= {shear:g}", "both > 0")
        first, last = min(pair), max(pair)
        sizes = []
        for choose in (min, max):
            one, other = (choose(self.radii[thing], default=math.inf) for thing in (first, last))
            reduced = 1.0 / (1.0 / one + 1.0 / other)
            sizes.append(reduced if self.dimension == 2 else math.pi * reduced**2)
        if sizes[1] - sizes[0] > ROUND * sizes[1]:
            entry.refuse(f"law IQS_MOHR_DS_CLB between several radii, with bonds of {cohesion * sizes[0]:g} to {cohesion * sizes[1]:g} N",
                         "one radius: the bonds of a law are of one strength here")
        self.remarks.append(f"law {entry.words[0]} IQS_MOHR_DS_CLB: bodies bonded across a gap keep it, LMGC90 draws them together")
        return {"bond_strength": cohesion * sizes[1], "bond_friction": shear / cohesion, "bond_distance": alert}

    def mass(self, body, volume):
        name = body.bulk.words[3] if len(body.bulk.words) > 3 else ""
        if name not in self.density:
            body.bulk.refuse(f"material {name}", "one of BULK_BEHAV.DAT")
        if self.density[name].words[1] != "RIGID":
            self.density[name].refuse(f"material {self.density[name].words[1]}", "RIGID")
        average = body.bulk.get("avrd", 0.0)
        if average > 0.0:
            volume = self.ball(average)
        return self.density[name].get("Umas") * volume

    def ball(self, radius):
        return math.pi * radius**2 if self.dimension == 2 else 4.0 / 3.0 * math.pi * radius**3

    def add_grain(self, body, contactor, place, group):
        radius = contactor.get("byrd")
        identifier = body.rank if contactor is body.contactors[0] else None
        velocity = body.velocity() if group == 0 else None
        self.grains.append([identifier, place, radius, self.mass(body, self.ball(radius)), velocity, group,
                            self.material(self.thing(contactor))])

    def check_free(self, body):
        contactor = body.contactors[0]
        shift = contactor.vector("coo", self.dimension, 0.0)
        if len(body.contactors) > 1 or np.any(shift != 0.0):
            body.contactors[-1].refuse(f"body {body.rank} has several contactors or one beside its centre and is not driven",
                                       "one disk or sphere: clusters have no counterpart")
        radius, gyration = contactor.get("byrd"), body.bulk.get("gyrd", 0.0)
        if self.dimension == 2 and gyration > 0.0 and abs(gyration - radius / math.sqrt(2.0)) > ROUND * radius:
            body.bulk.refuse(f"gyrd= {gyration:g}", f"0 or byrd/sqrt(2) = {radius / math.sqrt(2.0):g}, a homogeneous disk")
        inertia = [body.bulk.get(name, 0.0) for name in ("I1", "I2", "I3")]
        if max(inertia) - min(inertia) > ROUND * max(inertia):
            body.bulk.refuse(f"moments of inertia {inertia}", "three equal ones")

    def motion(self, body, whole):
        """Keys of the boundary of a body, from its drives. `whole`: it is one boundary, so that forces may move it."""
        d = self.dimension
        keys, columns = {}, {}
        names = ("vx vy omega" if d == 2 else "vx vy vz wx wy wz").split()
        velocity, free, force = [0.0] * len(names), [False] * d, self.gravity[:d] * 0.0
        mass = self.mass(body, sum(self.volume(contactor) for contactor in body.contactors))
        for k, name in enumerate(names):
            kind, function, entry = body.drives.get(k + 1, ("force", Function(), body.start))
            if kind == "vlocy":
                if function.table is None:
                    velocity[k] = function.constant
                else:
                    columns[name] = function
                continue
            if k >= d:
                entry.refuse(f"body {body.rank} ({body.contactors[0].words[0]}) turns freely", f"vlocy {k + 1} in DRV_DOF.DAT")
            if not whole:
                entry.refuse(f"body {body.rank} ({body.contactors[0].words[0]}) is moved by forces and has grains on both sides, or ends",
                             "grains on one side, and --planes for rectangles with round ends")
            # what moves freely bears its weight, which a boundary here does not
            weight = mass * self.gravity[k]
            free[k] = True
            if function.table is None:
                force[k] = function.constant + weight
            else:
                columns["f" + name[1]] = Function(table=function.table + [0.0, weight])
        spin = np.array(velocity[d:])
        if d == 3:
            turned = not np.allclose(body.frame(), np.eye(3))
            if turned and any(name in columns for name in names[3:]):
                body.start.refuse(f"body {body.rank} turns at a changing rate about axes that are not those of space", "a constant rate")
            spin = body.frame() @ spin
        if any(velocity[:d]):
            keys["velocity"] = velocity[:d]
        if np.any(spin != 0.0):
            keys["rotation"] = list(spin)
        if np.any(spin != 0.0) or any(name in columns for name in names[d:]):
            keys["pivot"] = list(body.place())
        if any(free):
            keys.update(free=free, mass=mass)
            if np.any(force != 0.0):
                keys["force"] = list(force)
        return keys, columns

    def volume(self, contactor):
        shape = contactor.words[0]
        if shape == "JONCx":
            return 4.0 * contactor.get("axe1") * contactor.get("axe2") + math.pi * contactor.get("axe2")**2
        if shape == "PLANx":
            return 8.0 * contactor.get("axe1") * contactor.get("axe2") * contactor.get("axe3")
        return self.ball(contactor.get("byrd"))

    def axes_of(self, body, contactor):
        """Centre of a contactor and its axes as columns."""
        frame, d = body.frame(), self.dimension
        place = body.place() + frame @ contactor.vector("coo", d, 0.0)
        if d == 3 and "localframe" in contactor.words:
            frame = frame @ np.stack([contactor.vector(name, 3) for name in ("alp", "bet", "gam")], axis=1)
        return place, frame

    def pieces(self, body, contactor):
        """Boundaries that a contactor of a wall becomes, as [(name, keys)], and the disks at its ends."""
        shape, d = contactor.words[0], self.dimension
        centre, frame = self.axes_of(body, contactor)
        if shape in ("xKSID", "DNLYC"):
            keys = {"shape": "circle", "point": list(centre), "radius": contactor.get("byrd")}
            if shape == "DNLYC":
                keys.update(shape="cylinder", axis=list(frame[:, 2]))
                self.remarks.append(f"body {body.rank} DNLYC: the cylinder is endless here, its height "
                                    f"2 x {contactor.get('High'):g} m is not kept")
            return [("", keys)], []
        half, thick = contactor.get("axe1"), contactor.get("axe2" if d == 2 else "axe3")
        normal, along = frame[:, -1], frame[:, 0] * half
        height = (self.centres - centre) @ normal
        sides = [side for side in (1.0, -1.0) if np.any(side * height > 0.0)]
        across = frame[:, 1] * contactor.get("axe2") if d == 3 else 0.0 * along
        spans = self.spans_period(normal, np.abs(along) + np.abs(across))
        if spans and not self.planes and len(sides) == 1:
            self.remarks.append(f"body {body.rank} {shape}: it is as wide as the period, and becomes an endless plane")
        endless = (self.planes or spans) and len(sides) == 1
        found = []
        for side in sides:
            face = centre + side * thick * normal
            label = "" if len(sides) == 1 else " above" if side > 0.0 else " below"
            if endless:
                keys = {"shape": "plane", "point": list(face), "normal": list(side * normal)}
            elif d == 2:
                keys = {"shape": "segment", "point": list(face - along), "end": list(face + along)}
            else:
                keys = {"shape": "rectangle", "point": list(face - along - across), "edge_a": list(2.0 * along),
                        "edge_b": list(2.0 * across)}
            found.append((label, keys))
        if d == 3 and not self.planes and not endless:
            self.remarks.append(f"body {body.rank} PLANx: its edges are sharp here, round with {thick:g} m in LMGC90")
        forced = any(kind == "force" for kind, _, _ in body.drives.values()) or len(body.drives) < 3 * d - 3
        ends = [] if d == 3 or self.planes or endless or forced else [(centre - along, thick), (centre + along, thick)]
        if forced and d == 2 and not self.planes and not endless:
            self.remarks.append(f"body {body.rank} JONCx: moved by forces, its ends are sharp here")
        return found, ends

    def spans_period(self, normal, half):
        """Does a flat wall of these half widths reach round a periodic axis along which it lies?"""
        return any(length > 0.0 and abs(across) < ROUND and 2.0 * width >= length * (1.0 - ROUND)
                   for length, across, width in zip(self.period, normal, half))

    def add_wall(self, body):
        for number_of, contactor in enumerate(body.contactors, 1):
            if not self.meet(self.thing(contactor), contactor):
                self.remarks.append(f"body {body.rank} {contactor.words[0]}: no grain sees it, left out")
                continue
            material = self.material(self.thing(contactor))
            found, ends = self.pieces(body, contactor)
            keys, columns = self.motion(body, len(found) == 1 and not ends and len(body.contactors) == 1)
            name = f"body {body.rank}" + (f" contactor {number_of}" if len(body.contactors) > 1 else "")
            for label, shape in found:
                self.boundaries.append(({"name": name + label, **shape, **keys, "material": material}, columns))
            if ends:
                group = self.new_group()
                for place, radius in ends:
                    self.grains.append([None, place, radius, self.ball(radius), None, group, material])
                self.boundaries.append(({"name": name + " ends", "shape": "grains", "group": group, **keys}, columns))

    def new_group(self):
        return 1 + max([grain[5] for grain in self.grains], default=0)

    def add_glued(self, body):
        """A driven body of disks or spheres: grains glued to each other, each of its own material."""
        for contactor in body.contactors:
            if not self.meet(self.thing(contactor), contactor):
                contactor.refuse(f"no grain sees a contactor of body {body.rank}", "a contact law: $seety of TACT_BEHAV.DAT")
        group = self.new_group()
        for contactor in body.contactors:
            self.add_grain(body, contactor, self.axes_of(body, contactor)[0], group)
        keys, columns = self.motion(body, True)
        self.boundaries.append(({"name": f"body {body.rank}", "shape": "grains", "group": group, **keys}, columns))

    def build(self):
        first = self.free[0].contactors[0]
        for thing in sorted(self.colours):
            if not self.meet(thing, first):
                first.refuse(f"grains of colour {thing[1]} do not see each other", "a contact law: $seety of TACT_BEHAV.DAT")
        for body in self.bodies:
            kinds = {contactor.words[0] in GRAINS for contactor in body.contactors}
            if len(kinds) > 1:
                body.start.refuse(f"body {body.rank} has contactors of grains and of walls", "one kind")
            if body in self.free:
                self.check_free(body)
                self.add_grain(body, body.contactors[0], body.place(), 0)
            elif kinds == {True}:
                self.add_glued(body)
            else:
                self.add_wall(body)


# ---- files


def text_of(value):
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    if isinstance(value, (list, tuple)):
        return ", ".join(text_of(entry) for entry in value)
    return repr(int(value)) if isinstance(value, int) else repr(float(value))


def group_text(name, keys):
    return f"&{name}\n" + "".join(f"  {key} = {text_of(value)}\n" for key, value in keys.items()) + "/\n"


def write_bodies(case, path):
    """The bodies file; grains without a number get one."""
    d = case.dimension
    taken = {grain[0] for grain in case.grains}
    later = max(len(case.bodies), *(i for i in taken if i)) + 1
    for grain in case.grains:
        if grain[0] is None:
            grain[0], later = later, later + 1
    spins = 3 * d - 3
    with hdf5_file(path) as file:
        file["bodies/id"] = np.array([grain[0] for grain in case.grains], dtype=np.int64)
        file["bodies/position"] = np.array([grain[1] for grain in case.grains])
        file["bodies/radius"] = np.array([grain[2] for grain in case.grains])
        file["bodies/mass"] = np.array([grain[3] for grain in case.grains])
        file["bodies/velocity"] = np.array([np.zeros(spins) if grain[4] is None else grain[4] for grain in case.grains])
        file["bodies/material"] = np.array([1 + case.materials.index(grain[6]) for grain in case.grains], dtype=np.int64)
        if any(grain[5] for grain in case.grains):
            file["bodies/group"] = np.array([grain[5] for grain in case.grains], dtype=np.int64)


def texts_of(case, stem, options, contacts):
    """The text files as {ending of the name: text}, with names that begin with `stem` in the case."""
    d, made = case.dimension, {}
    scene = {"title": f"imported from {options.datbox}", "dimension": d, "gravity": list(case.gravity[:d]), "bodies": "file",
             "bodies_file": stem + ".h5", "alert_distance": max(case.used)}
    if options.period:
        scene["period"] = options.period
    parts = [group_text("scene", scene), *(group_text("material", {"name": name}) for name in case.materials),
             *(group_text("law", {"materials": names, **keys}) for names, keys in case.met.items())]
    tables = {}
    for keys, columns in case.boundaries:
        if columns:
            times = np.unique(np.concatenate([function.table[:, 0] for function in columns.values()]))
            text = "time," + ",".join(columns) + "\n" + "".join(
                ",".join(repr(float(x)) for x in row) + "\n"
                for row in np.stack([times, *(function.at(times) for function in columns.values())], axis=1))
            ending = tables.setdefault(text, f"_drive_{len(tables) + 1}.csv")
            made[ending] = text
            keys = {**keys, "table": stem + ending}
        parts.append(group_text("boundary", keys))
    parts += [group_text("time", {"step": options.step, "steps": options.steps}),
              group_text("output", {"directory": stem + "_results", "every": max(1, options.steps // 10)})]
    made[".nml"] = "! " + f"made by gravier_import from {options.datbox}\n" + "\n".join(parts)
    if contacts is not None:
        made["_contacts.csv"] = "candidate,contactor,antagonist,other,status,gap,force_n,force_t,force_s,nx,ny,nz,fx,fy,fz\n" + "".join(
            ",".join(str(cell) for cell in row) + "\n" for row in contacts)
    return made


def write_files(case, stem, options, contacts):
    """Write everything into a directory beside the final names, let `gravier --check` read it there, and then give the files their names:
    what is there is whole, and is a case. Returns the names."""
    folder, name = os.path.split(stem)
    with tempfile.TemporaryDirectory(prefix=".gravier_import-", dir=folder or ".") as draft:
        write_bodies(case, os.path.join(draft, name + ".h5"))
        for ending, text in texts_of(case, name, options, contacts).items():
            Path(draft, name + ending).write_text(text, encoding="utf-8")
        check(case, draft, name + ".nml", stem + ".nml")
        made = texts_of(case, stem, options, contacts)
        Path(draft, name + ".nml").write_text(made[".nml"], encoding="utf-8")
        made = [".h5", *made]
        # the case comes last: where it is there, so is what it names
        give_names({stem + ending: os.path.join(draft, name + ending) for ending in sorted(made, key=".nml".__eq__)})
    return [stem + ending for ending in made]


def find_program():
    """The program that reads cases: that of the environment, or the one beside this script or in PATH; None where there is none."""
    beside = [os.path.dirname(path) for path in (os.path.abspath(__file__), os.path.realpath(__file__), os.path.abspath(sys.argv[0]))]
    wanted = os.environ.get("GRAVIER_PROGRAM")
    return shutil.which(wanted) if wanted else next(filter(None, (shutil.which("gravier", path=folder) for folder in [*beside, None])), None)


def check(case, folder, name, final):
    """Refuse a case that the program refuses; without a program say so."""
    program = find_program()
    if program is None:
        case.remarks.append(f"there is no program gravier beside this script or in PATH: {final} is not checked; see gravier --check {final}")
        return
    # the program runs by itself, whatever launcher has started this script
    done = subprocess.run([program, "--check", name], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = next((line for line in done.stderr.splitlines() if "gravier: error: " in line), f"status {done.returncode}")
        raise Refused(f"{final}: gravier --check refuses the case that was made: {said.removeprefix('gravier: error: ')}")


def parse():
    parser = OneLineParser(prog="gravier_import", description="Make a case of Gravier from a DATBOX of LMGC90.")
    parser.add_argument("datbox", type=Path, metavar="DATBOX", help="the directory, with BODIES.DAT and the other files")
    parser.add_argument("--step", type=float, required=True, metavar="H", help="time step [s]: the command script of LMGC90 has it")
    parser.add_argument("--steps", type=int, default=100, metavar="N", help="number of steps (100)")
    parser.add_argument("--out", default="imported", metavar="NAME", help="the files are NAME.nml, NAME.h5 and so on (imported)")
    parser.add_argument("--period", type=float, nargs="+", metavar="L",
                        help="lengths of the periodic cell, which the command script has: LX LY in 2D, LX LY LZ in 3D, 0 along an axis that is "
                        "not periodic")
    parser.add_argument("--planes", action="store_true", help="walls with all grains on one side become endless planes")
    parser.add_argument("--slip", type=float, metavar="V",
                        help="slip [m/s] over which friction falls from static to dynamic, for IQS_DS_CLB and RST_DS_CLB")
    options = parser.parse_args()
    if not (math.isfinite(options.step) and options.step > 0.0) or options.steps < 0:
        parser.error("--step: expected a finite number > 0, and --steps at least 0")
    if options.slip is not None and not (math.isfinite(options.slip) and options.slip > 0.0):
        parser.error("--slip: expected a finite number > 0")
    return options


def main():
    options = parse()
    box = options.datbox
    try:
        for name in ("BODIES.DAT", "BULK_BEHAV.DAT", "TACT_BEHAV.DAT"):
            if not (box / name).is_file():
                raise Refused(f"{box / name}: no such file: expected the files of a DATBOX")
        bodies = read_bodies(box / "BODIES.DAT")
        density, gravity = read_bulk(box / "BULK_BEHAV.DAT")
        laws, sees = read_laws(box / "TACT_BEHAV.DAT")
        start = read_initial(box / "DOF.INI", bodies) if (box / "DOF.INI").is_file() else 0.0
        if (box / "DRV_DOF.DAT").is_file():
            read_drives(box / "DRV_DOF.DAT", bodies, start, start + options.step * options.steps)
        contacts = read_contacts(box / "Vloc_Rloc.INI", bodies, laws) if (box / "Vloc_Rloc.INI").is_file() else None
        if options.period and len(options.period) != bodies[0].dimension:
            raise Refused(f"--period: {len(options.period)} {'numbers' if options.period[1:] else 'number'}: expected {bodies[0].dimension}, for "
                          f"bodies {bodies[0].kind} in {bodies[0].dimension}D, 0 along an axis that is not periodic")
        if options.period and not all(math.isfinite(length) and length >= 0.0 for length in options.period):
            raise Refused(f"--period {' '.join(f'{length:g}' for length in options.period)}: expected finite numbers >= 0")
        case = Case(bodies, density, gravity, laws, sees, options.planes, options.slip, options.period or [])
        case.build()
        with output_lock(options.out + ".nml", "gravier_import"):
            made = write_files(case, options.out, options, contacts)
    except (Refused, Locked) as refused:
        print(f"gravier_import: error: {plain(refused)}", file=sys.stderr)
        return 2
    except (ValueError, IndexError) as problem:
        print(f"gravier_import: error: {box}: {plain(problem)}: expected the files of a DATBOX as LMGC90 writes them", file=sys.stderr)
        return 2
    except OSError as problem:
        print(f"gravier_import: error: {problem.filename or options.out}: {' '.join(str(problem.strerror or problem).split())}", file=sys.stderr)
        return 4
    for remark in dict.fromkeys(case.remarks):
        print(f"gravier_import: note: {plain(remark)}", file=sys.stderr)
    print(f"{len(case.free)} grains, {len(case.boundaries)} boundaries" + (f", {len(contacts)} contacts" if contacts is not None else "")
          + f": {', '.join(made)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
