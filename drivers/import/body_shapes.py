"""Shapes of the bodies of a DATBOX: pieces, their volume and inertia, and their lines in a file of shapes."""
import math

import numpy as np
from datbox import HULLS


#: rounding of corners of polygons and polyhedra: over the size of the shape, and over the shortest side of a polygon at most
ROUNDING, OF_SIDE = 1e-3, 0.1
#: distance from a plane, over the extent of a polyhedron, within which files of single digits put a vertex
FLAT = 1e-5


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
