#!/usr/bin/env python3
"""Make a case of Gravier from a DATBOX of LMGC90.

    gravier_import DATBOX --step H [--steps N] [--out NAME] [--period LX LY [LZ]] [--planes] [--slip V] [--homogeneous] [--drop-g0]

--period takes two numbers in 2D and three in 3D, 0 along an axis that is not periodic.
Reads BODIES.DAT, BULK_BEHAV.DAT and TACT_BEHAV.DAT and, where they are there, DRV_DOF.DAT, DOF.INI and Vloc_Rloc.INI; writes NAME.nml,
NAME.h5 (bodies), NAME.shapes (where bodies have shapes), NAME_drive_K.csv (drives that change in time) and NAME_contacts.csv (the contacts of
Vloc_Rloc.INI).
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

LAWS = ("IQS_CLB", "IQS_CLB_g0", "IQS_DS_CLB", "IQS_MOHR_DS_CLB", "IQS_WET_DS_CLB", "RST_CLB", "RST_DS_CLB")
#: other names of parameters of laws, as LMGC90 itself writes them, in full or in four letters, and those of its pre-processor
OLDER = {"dfric": "dyfr", "dfrc": "dyfr", "sfric": "stfr", "sfrc": "stfr", "cohen": "cohn", "cohet": "coht", "Wethk": "Wthk", "Weth": "Wthk",
         "restn": "rstn", "restt": "rstt"}
GRAINS = {"DISKx": 2, "DISKb": 2, "SPHER": 3, "SPHEb": 3}
WALLS = {"JONCx": 2, "xKSID": 2, "PLANx": 3, "DNLYC": 3}
HULLS = {"POLYG": 2, "POLYR": 3}
#: bulks that are rigid; what a conducting one conducts is left out
BULKS = ("RIGID", "THERMO_RIGID", "ELECTRO_RIGID")
#: what a body that moves freely may be made of
PIECES = ("DISKx", "DISKb", "SPHER", "SPHEb", "POLYG", "POLYR", "JONCx")
#: `name= number`; forces and gaps of contacts stand without the sign
VALUE = re.compile(r"(?:([A-Za-z]\w*(?:\(\d\))?)\s*=|\b(rl[nts]/H|gapTT))\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[DdEe][-+]?\d+|[-+]\d{3})?)")
#: relative error of radii of gyration and moments of inertia: files have them to four digits
ROUND = 1e-3
#: rows to a period of a drive that oscillates
ROWS_PER_PERIOD = 200
#: rounding of corners of polygons and polyhedra: over the size of the shape, and over the shortest side of a polygon at most
ROUNDING, OF_SIDE = 1e-3, 0.1
#: distance from a plane, over the extent of a polyhedron, within which files of single digits put a vertex
FLAT = 1e-5


class Refused(Exception):
    """Input that has no counterpart, or is not a DATBOX."""


def number(text):
    """A real number as Fortran writes it."""
    return float(re.sub(r"(?<=[\d.])([-+]\d{3})$", r"E\1", re.sub("[Dd]", "E", text)))


class Entry:
    """A line that begins a thing, with the values `name= number` of it and of the lines that continue it."""

    def __init__(self, path, line, words):
        self.path, self.line, self.words, self.values = path, line, words, {}
        #: the values of each line by itself
        self.rows = []

    def add(self, text):
        # ax1 is the older name of axe1
        self.rows.append({OLDER.get(name, re.sub(r"^ax(?=\d$)", "axe", name or bare)): number(value)
                          for name, bare, value in VALUE.findall(text)})
        self.values.update(self.rows[-1])

    def size(self, place, name):
        """A size of a contactor: LMGC90 reads it by its place on the first line, whatever its name."""
        row = list(self.rows[0].values())
        return self.get(name) if name in self.values or len(row) < place else row[place - 1]

    def shift(self, count):
        """Place of a contactor in its body: coo1, coo2, ... after its sizes, which may have these names too. The node where there is none."""
        for k, row in enumerate(self.rows):
            start = list(row).index("coo1") if "coo1" in row else len(row)
            if len(row) - start >= count and k + start > 0:
                return np.array(list(row.values())[start:start + count])
        return np.zeros(count)

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

    def table(self, prefix, counted, count):
        """The values of as many lines that begin with prefix1= as the value `counted`, or its singular, says. LMGC90 reads them by their
        places: the third may have another name."""
        rows = [list(row.values())[:count] for row in self.rows if next(iter(row), "") == f"{prefix}1" and len(row) >= count]
        wanted = self.get(counted, self.values.get(counted.removesuffix("s")))
        if len(rows) != wanted:
            self.refuse(f"{self.words[0]} with {counted}= {wanted:g} and {len(rows)} lines of {prefix}1= to {prefix}{count}=", "a line for each")
        return np.array(rows)

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
            if {**GRAINS, **WALLS, **HULLS}.get(shape) != body.dimension:
                entry.refuse(f"a contactor {shape} of a body {body.kind}",
                             "DISKx, POLYG, JONCx or xKSID of RBDY2, SPHER, POLYR, PLANx or DNLYC of RBDY3")
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


# ---- shapes


def moments_of_polygon(corner):
    """Area, centroid and integral of (x - centroid)(x - centroid)^T of a polygon in anticlockwise order."""
    a, b = corner[1:-1] - corner[0], corner[2:] - corner[0]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    centre = (area[:, None] * (a + b)).sum(axis=0) / 3.0 / area.sum()
    # of a triangle from the origin: A/12 (a a + b b + (a + b)(a + b))
    second = sum(np.einsum("k,ki,kj->ij", area, x, x) for x in (a, b, a + b)) / 12.0
    return area.sum(), corner[0] + centre, second - area.sum() * np.outer(centre, centre)


def moments_of_polyhedron(corner, faces):
    """Volume, centroid and integral of (x - centroid)(x - centroid)^T of a polyhedron with triangular faces."""
    point = corner[faces] - corner[0]
    volume = np.linalg.det(point) / 6.0
    total = point.sum(axis=1)
    centre = (volume[:, None] * total).sum(axis=0) / 4.0 / volume.sum()
    # of a tetrahedron from the origin: V/20 (sum of x x + total total)
    second = (np.einsum("k,kvi,kvj->ij", volume, point, point) + np.einsum("k,ki,kj->ij", volume, total, total)) / 20.0
    return volume.sum(), corner[0] + centre, second - volume.sum() * np.outer(centre, centre)


def moments_of_round(ends, radius):
    """The same of a disk, of a capsule in the plane, or of a sphere."""
    d, way = len(ends[0]), ends[1] - ends[0]
    length = np.linalg.norm(way)
    if d == 3:
        return 4.0 / 3.0 * math.pi * radius**3, ends[0], 4.0 / 15.0 * math.pi * radius**5 * np.eye(3)
    along = np.outer(way, way) / length**2 if length > 0.0 else np.zeros((2, 2))
    # a rectangle, and two half disks whose centres of mass are 4 r/(3 pi) beyond its ends
    lengthwise = 2.0 * radius * length**3 / 12.0 + math.pi * radius**2 * length**2 / 4.0 + 4.0 * radius**3 * length / 3.0
    second = math.pi * radius**4 / 4.0 * np.eye(2) + lengthwise * along + length * (2.0 * radius)**3 / 12.0 * (np.eye(2) - along)
    return math.pi * radius**2 + 2.0 * radius * length, (ends[0] + ends[1]) / 2.0, second


class Piece:
    """A contactor as a piece of a shape, in the axes of its body: `kind`, corners or ends, radius of what is round, its moments."""

    def __init__(self, contactor, dimension):
        self.contactor, self.kind, self.radius = contactor, contactor.words[0], 0.0
        if self.kind == "POLYG":
            self.point = self.polygon()
            self.moments = moments_of_polygon(self.point)
        elif self.kind == "POLYR":
            self.point = contactor.table("coo", "nb_vertex", 3)
            self.moments = moments_of_polyhedron(self.point, self.faces())
        else:
            shift = contactor.shift(dimension)
            half = np.array([contactor.size(1, "axe1"), 0.0]) if self.kind == "JONCx" else np.zeros(dimension)
            self.radius = contactor.size(2, "axe2") if self.kind == "JONCx" else contactor.get("byrd")
            self.point = np.array([shift - half, shift + half])
            self.moments = moments_of_round(self.point, self.radius)

    def polygon(self):
        corner = self.contactor.table("coo", "nb_vertex", 2)
        if len(corner) < 3:
            self.contactor.refuse(f"POLYG with {len(corner)} vertices", "three or more")
        side = np.roll(corner, -1, axis=0) - corner
        turn = side[:, 0] * np.roll(side, -1, axis=0)[:, 1] - side[:, 1] * np.roll(side, -1, axis=0)[:, 0]
        if not (np.all(turn > 0.0) or np.all(turn < 0.0)):
            self.contactor.refuse("POLYG that is not convex, or has three vertices in a line", "a convex polygon")
        return corner if turn[0] > 0.0 else corner[::-1]

    def faces(self):
        """Triangles by rows of vertices, seen anticlockwise from outside."""
        faces = self.contactor.table("ver", "nb_faces", 3).astype(int) - 1
        if faces.size == 0 or faces.min() < 0 or faces.max() >= len(self.point):
            self.contactor.refuse("POLYR with a face whose vertices there are not", f"vertices 1 to {len(self.point)}")
        corner, inside = self.point[faces], self.point.mean(axis=0)
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        inwards = ((corner[:, 0] - inside) * normal).sum(axis=1) < 0.0
        faces[inwards] = faces[inwards][:, ::-1]
        normal[inwards] *= -1.0
        height = np.einsum("fi,fvi->fv", normal, self.point[None] - corner[:, :1]) / np.linalg.norm(normal, axis=1)[:, None]
        if not np.all(height <= FLAT * np.ptp(self.point, axis=0).max()):
            self.contactor.refuse("POLYR that is not convex", "a convex polyhedron")
        sides = [tuple(pair) for face in faces for pair in zip(face, np.roll(face, -1))]
        if {pair[::-1] for pair in sides} != set(sides) or len(set(sides)) != len(sides):
            self.contactor.refuse("POLYR whose faces leave a hole, or cover each other", "a closed surface")
        return faces

    def line(self, centre):
        """Its line in a file of shapes, from the centre of mass on."""
        word = {"POLYG": "polygon", "POLYR": "hull", "JONCx": "capsule"}.get(self.kind, "disk" if len(centre) == 2 else "sphere")
        point = self.point[:1] if word in ("disk", "sphere") else self.point
        numbers = [*(point - centre).ravel(), *([self.radius] if self.radius > 0.0 else [])]
        return f"{word} {' '.join(repr(float(x) + 0.0) for x in numbers)}"

    def size(self, centre):
        return np.linalg.norm(self.point - centre, axis=1).max() + self.radius

    def shortest(self):
        return np.linalg.norm(self.point - np.roll(self.point, 1, axis=0), axis=1).min() if self.kind == "POLYG" else math.inf


class ShapeOfBody:
    """The shape that a body has: one piece or a cluster. What pieces have in common counts with each of them, as in the program."""

    def __init__(self, body):
        self.pieces = [Piece(contactor, body.dimension) for contactor in body.contactors]
        moments = [piece.moments for piece in self.pieces]
        self.volume = sum(volume for volume, _, _ in moments)
        self.centre = sum(volume * centre for volume, centre, _ in moments) / self.volume
        self.second = sum(second + volume * np.outer(centre - self.centre, centre - self.centre) for volume, centre, second in moments)
        self.size = max(piece.size(self.centre) for piece in self.pieces)

    def text(self):
        rounding = min(ROUNDING * self.size, OF_SIDE * min(piece.shortest() for piece in self.pieces))
        head = [f"rounding {float(rounding)!r}"] if any(piece.kind in HULLS for piece in self.pieces) else []
        return "\n".join([*head, *(piece.line(self.centre) for piece in self.pieces)]) + "\n"

    def gyration(self):
        """Radius of gyration in the plane."""
        return math.sqrt(np.trace(self.second) / self.volume)

    def principal(self):
        """Principal moments of inertia over the largest, in space, ascending."""
        moments = np.linalg.eigvalsh(np.trace(self.second) * np.eye(3) - self.second)
        return moments / moments[-1]


def turn_of(frame):
    """Angle, or unit quaternion with the real part first, of axes as columns."""
    if len(frame) == 2:
        return [math.atan2(frame[1, 0], frame[0, 0])]
    # the eigenvector of the largest eigenvalue (Bar-Itzhack)
    a = frame
    form = np.array([[a[0, 0] + a[1, 1] + a[2, 2], a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1]],
                     [0.0, a[0, 0] - a[1, 1] - a[2, 2], a[1, 0] + a[0, 1], a[0, 2] + a[2, 0]],
                     [0.0, 0.0, a[1, 1] - a[0, 0] - a[2, 2], a[2, 1] + a[1, 2]], [0.0, 0.0, 0.0, a[2, 2] - a[0, 0] - a[1, 1]]])
    turn = np.linalg.eigh(form, UPLO="U")[1][:, -1]
    return list(turn if turn[0] >= 0.0 else -turn)


# ---- what it becomes


class Case:
    """The case that is made: grains, boundaries, materials (one for each contactor and colour), laws (one for each line of the table of
    visibility that grains have part in), remarks for the user. `slip` is the scale [m/s] of laws with static and dynamic friction, `period`
    has a length for each axis or is empty."""

    def __init__(self, bodies, density, gravity, laws, sees, options):
        self.bodies, self.density, self.gravity, self.laws, self.sees = bodies, density, gravity, laws, sees
        self.planes, self.slip, self.homogeneous, self.period = options.planes, options.slip, options.homogeneous, options.period or []
        self.drop_g0, self.dimension = options.drop_g0, bodies[0].dimension
        #: contactor and colour: that which stands for it, since bodies have contactors of both
        self.stands_for = {}
        self.grains, self.boundaries, self.remarks, self.used, self.materials, self.met = [], [], [], [], [], {}
        #: bodies whose inertia or centre of mass their shape decides, by --homogeneous
        self.replaced = set()
        #: lines of the file of shapes with their names, which bodies share
        self.shapes = {}
        self.free = [body for body in bodies if not body.drives and all(contactor.words[0] in PIECES for contactor in body.contactors)]
        if not self.free:
            bodies[0].start.refuse("no grain moves freely", "a body of DISKx, POLYG, JONCx, SPHER or POLYR that DRV_DOF.DAT does not drive")
        self.merge_kinds()
        self.colours = {self.thing(body.contactors[0]) for body in self.free}
        #: radii by contactor and colour: none of flat walls
        self.radii = {}
        for contactor in (contactor for body in bodies for contactor in body.contactors):
            self.radii.setdefault(self.thing(contactor), set()).update([contactor.get("byrd")] if contactor.words[0] in GRAINS else [])
        self.centres = np.array([body.place() for body in self.free])

    @staticmethod
    def named(kind, colour):
        """Contactor and colour, by which the table of visibility names it."""
        return {"DISKb": "DISKx", "SPHEb": "SPHER"}.get(kind, kind), colour

    def thing(self, contactor):
        """Contactor and colour, or those that stand for them."""
        thing = self.named(contactor.words[0], contactor.words[3])
        return self.stands_for.get(thing, thing)

    def merge_kinds(self):
        """A body has one material: contactors of several kinds or colours that make up bodies become one thing, where what they see and
        under which laws is the same for all of them."""
        for body in self.free:
            things = list(dict.fromkeys(self.thing(contactor) for contactor in body.contactors))
            for other in things[1:]:
                self.stands_for = {thing: things[0] if stands == other else stands for thing, stands in self.stands_for.items()}
                self.stands_for[other] = things[0]
        if not self.stands_for:
            return
        members = {}
        for thing, stands in self.stands_for.items():
            members.setdefault(stands, [stands]).append(thing)
        lines = {}
        for pair, law, alert, see in self.sees:
            merged = frozenset(self.stands_for.get(thing, thing) for thing in pair)
            lines.setdefault(merged, []).append((pair, law, alert, see))
        self.sees = []
        for merged, found in lines.items():
            groups = [members.get(thing, [thing]) for thing in (min(merged), max(merged))]
            wanted = {frozenset((one, other)) for one in groups[0] for other in groups[1]}
            # pairs of which no body has both sides, and walls by themselves, need no line
            if len(wanted) > 1 and ({frozenset(pair) for pair, *_ in found} != wanted or len({law for _, law, _, _ in found}) > 1):
                found[0][3].refuse(f"contactors {' and '.join(' '.join(thing) for thing in max(groups, key=len))} of one body that do not see the same under "
                                   "one law", "the same lines $seety for each of them: a body has one material here")
            self.sees.append((set(merged), found[0][1], max(alert for _, _, alert, _ in found), found[0][3]))

    def material(self, thing):
        """Name of its material: the colour, where no other contactor has it."""
        name = thing[1] if sum(other[1] == thing[1] for other in self.radii) == 1 else " ".join(thing)
        if name not in self.materials:
            self.materials.append(name)
        return name

    def meet(self, thing):
        """Take over the laws between the free grains and a contactor of a colour; False where no grain sees it. Things that do not see each
        other pass through each other."""
        lines = {grain: see for grain in sorted(self.colours) for see in self.sees if see[0] == {grain, thing}}
        if not lines and thing not in self.colours:
            return False
        for grain in sorted(self.colours - lines.keys()):
            self.met[tuple(sorted((self.material(grain), self.material(thing))))] = {"kind": "none"}
            one, other = sorted((grain, thing))
            self.remarks.append(f"{' '.join(one)} does not see {' '.join(other)}: they pass through each other")
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
        if name == "IQS_CLB_g0" and not self.drop_g0:
            entry.refuse("law IQS_CLB_g0, whose gaps count from those of the start", "--drop-g0, with which they count from contact")
        if name == "IQS_CLB_g0":
            self.remarks.append(f"law {entry.words[0]} IQS_CLB_g0: gaps count from contact here, not from those of the start")
        if name in ("IQS_CLB", "IQS_CLB_g0", "RST_CLB"):
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
            entry.refuse(f"law IQS_MOHR_DS_CLB of {' and '.join(sorted({thing[0] for thing in pair}))}", "disks or spheres, JONCx and PLANx")
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
        kind = self.density[name].words[1]
        if kind not in BULKS:
            self.density[name].refuse(f"material {kind}", f"one of {', '.join(BULKS)}")
        if kind != "RIGID":
            self.remarks.append(f"material {name} {kind}: what it conducts is left out")
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
                            self.material(self.thing(contactor)), "", None])

    def is_ball(self, body):
        """Is it one disk or sphere about its centre?"""
        contactor = body.contactors[0]
        return len(body.contactors) == 1 and contactor.words[0] in GRAINS and not np.any(contactor.shift(self.dimension) != 0.0)

    def add_shaped(self, body, group):
        """A body with a shape; its place is that of its centre of mass."""
        things = sorted({self.thing(contactor) for contactor in body.contactors})
        if len(things) > 1:
            body.contactors[-1].refuse(f"driven body {body.rank} has contactors {' and '.join(' '.join(thing) for thing in things)}",
                                       "contactors of one kind and one colour: a body with a shape has one material here")
        shape = ShapeOfBody(body)
        self.check_mass(body, shape)
        frame = body.frame()
        name = self.shapes.setdefault(shape.text(), f"{things[0][0]}_{len(self.shapes) + 1}")
        velocity = body.velocity() if group == 0 else None
        if things[0][0] == "JONCx":
            self.remarks.append(f"body {body.rank} JONCx: nothing drives it, it moves freely")
        if any(piece.kind in HULLS for piece in shape.pieces):
            self.remarks.append(f"corners and edges of polygons and polyhedra are round here, with at most {ROUNDING:g} of their size")
        self.grains.append([body.rank, body.place() + frame @ shape.centre, 0.0, self.mass(body, shape.volume), velocity, group,
                            self.material(things[0]), name, turn_of(frame)])

    def check_mass(self, body, shape):
        """Refuse a centre of mass or an inertia that are given and are not those of the shape. The mass is as it is given."""
        given = body.bulk.get("avrd", 0.0) > 0.0
        beside = np.linalg.norm(shape.centre)
        if beside > ROUND * shape.size:
            if given and not body.drives:
                self.differs(body, f"body {body.rank} with avrd= {body.bulk.get('avrd'):g} and its centre of mass {beside:g} beside its node",
                             "contactors about their centre of mass, or avrd= 0")
            else:
                self.remarks.append(f"body {body.rank}: its place is the centre of mass of its contactors, {beside:g} beside its node")
        if body.drives:
            return
        gyration = body.bulk.get("gyrd", 0.0)
        if self.dimension == 2 and gyration > 0.0 and abs(gyration - shape.gyration()) > ROUND * gyration:
            self.differs(body, f"gyrd= {gyration:g}", f"0 or {shape.gyration():g}, that of its contactors, homogeneous")
        inertia = np.sort([body.bulk.get(name, 0.0) for name in ("I1", "I2", "I3")])
        if self.dimension == 3 and inertia[-1] > 0.0 and np.abs(inertia / inertia[-1] - shape.principal()).max() > ROUND:
            self.differs(body, f"moments of inertia as {', '.join(f'{x:g}' for x in inertia / inertia[-1])}",
                         f"as {', '.join(f'{x:g}' for x in shape.principal())}, those of its contactors, homogeneous")

    def differs(self, body, found, expected):
        """Inertia or centre of mass that are not those of the shape: refused, or replaced where --homogeneous says so."""
        if not self.homogeneous:
            body.bulk.refuse(found, f"{expected}; or --homogeneous, with which the shape decides and the mass stays")
        self.replaced.add(body.rank)

    def check_free(self, body):
        contactor = body.contactors[0]
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
            return 4.0 * contactor.size(1, "axe1") * contactor.size(2, "axe2") + math.pi * contactor.size(2, "axe2")**2
        if shape in HULLS:
            return Piece(contactor, self.dimension).moments[0]
        if shape == "PLANx":
            return 8.0 * math.prod(contactor.size(k, f"axe{k}") for k in (1, 2, 3))
        return self.ball(contactor.get("byrd"))

    def axes_of(self, body, contactor):
        """Centre of a contactor and its axes as columns."""
        frame, d = body.frame(), self.dimension
        place = body.place() + frame @ contactor.shift(d)
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
        half, thick = contactor.size(1, "axe1"), contactor.size(d, f"axe{d}")
        normal, along = frame[:, -1], frame[:, 0] * half
        height = (self.centres - centre) @ normal
        sides = [side for side in (1.0, -1.0) if np.any(side * height > 0.0)]
        across = frame[:, 1] * contactor.size(2, "axe2") if d == 3 else 0.0 * along
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
            if not self.meet(self.thing(contactor)):
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
                    self.grains.append([None, place, radius, self.ball(radius), None, group, material, "", None])
                self.boundaries.append(({"name": name + " ends", "shape": "grains", "group": group, **keys}, columns))

    def new_group(self):
        return 1 + max([grain[5] for grain in self.grains], default=0)

    def add_glued(self, body):
        """A driven body of disks or spheres, or of polygons or polyhedra: grains glued to each other, each of its own material, or one grain
        with a shape."""
        seen = [self.meet(self.thing(contactor)) for contactor in body.contactors]
        if not any(seen):
            self.remarks.append(f"body {body.rank} {body.contactors[0].words[0]}: no grain sees it, left out")
            return
        group = self.new_group()
        if any(contactor.words[0] in HULLS for contactor in body.contactors):
            self.add_shaped(body, group)
        else:
            for contactor, there in zip(body.contactors, seen):
                if there:
                    self.add_grain(body, contactor, self.axes_of(body, contactor)[0], group)
        keys, columns = self.motion(body, True)
        self.boundaries.append(({"name": f"body {body.rank}", "shape": "grains", "group": group, **keys}, columns))

    def build(self):
        for thing in sorted(self.colours):
            self.meet(thing)
        for body in self.bodies:
            kinds = {contactor.words[0] not in WALLS for contactor in body.contactors}
            if len(kinds) > 1 and body not in self.free:
                body.start.refuse(f"body {body.rank} has contactors of grains and of walls", "one kind")
            if body in self.free and self.is_ball(body):
                self.check_free(body)
                self.add_grain(body, body.contactors[0], body.place(), 0)
            elif body in self.free:
                self.add_shaped(body, 0)
            elif kinds == {True}:
                self.add_glued(body)
            else:
                self.add_wall(body)
        if not self.used:
            self.free[0].start.refuse("the bodies that move freely see nothing", "a contact law: $seety of TACT_BEHAV.DAT")
        if self.replaced:
            self.remarks.append(f"{len(self.replaced)} bodies have the inertia and the centre of mass of their shapes here, not those of BODIES.DAT")


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
    spins, names = 3 * d - 3, list(case.shapes.values())
    with hdf5_file(path) as file:
        file["bodies/id"] = np.array([grain[0] for grain in case.grains], dtype=np.int64)
        file["bodies/position"] = np.array([grain[1] for grain in case.grains])
        file["bodies/radius"] = np.array([grain[2] for grain in case.grains])
        file["bodies/mass"] = np.array([grain[3] for grain in case.grains])
        file["bodies/velocity"] = np.array([np.zeros(spins) if grain[4] is None else grain[4] for grain in case.grains])
        file["bodies/material"] = np.array([1 + case.materials.index(grain[6]) for grain in case.grains], dtype=np.int64)
        if case.shapes:
            file["bodies/shape"] = np.array([1 + names.index(grain[7]) if grain[7] else 0 for grain in case.grains], dtype=np.int64)
            file["bodies/shape"].attrs["names"] = np.bytes_(",".join(names))
            plain_turn = [0.0] if d == 2 else [1.0, 0.0, 0.0, 0.0]
            file["bodies/orientation"] = np.array([plain_turn if grain[8] is None else grain[8] for grain in case.grains])
        if any(grain[5] for grain in case.grains):
            file["bodies/group"] = np.array([grain[5] for grain in case.grains], dtype=np.int64)


def texts_of(case, stem, options, contacts):
    """The text files as {ending of the name: text}, with names that begin with `stem` in the case."""
    d, made = case.dimension, {}
    scene = {"title": f"imported from {options.datbox}", "dimension": d, "gravity": list(case.gravity[:d]), "bodies": "file",
             "bodies_file": stem + ".h5", "alert_distance": max(case.used)}
    if case.shapes:
        scene["shapes"] = stem + ".shapes"
        made[".shapes"] = "".join(f"shape {name}\n{text}" for text, name in case.shapes.items())
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
    parser.add_argument("--homogeneous", action="store_true",
                        help="bodies with shapes have the inertia and the centre of mass of these, where BODIES.DAT says otherwise")
    parser.add_argument("--drop-g0", action="store_true", help="take IQS_CLB_g0 for IQS_CLB: gaps that are open at the start may close")
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
        case = Case(bodies, density, gravity, laws, sees, options)
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
