"""Shapes of bodies: what results.h5 keeps of them, and the polygons that a body of a shape shows."""
import numpy as np

#: sides of a circle; meridians of a sphere, and bands of half a sphere
SIDES, MERIDIANS, BANDS = 48, 16, 4


class Piece:
    """A convex piece of a body of radius 1, in its axes from its centre of mass: all points within `rounding` of the hull of `vertex`
    (n, d); `corner` (n, d) are the sharp corners behind the vertices, and `faces`, in 3D, rows of these, anticlockwise from outside."""

    def __init__(self, rounding, vertex, corner, faces):
        self.rounding, self.vertex, self.corner, self.faces = rounding, vertex, corner, faces

    def polygons(self):
        """Outline in 2D, surface in 3D, with sharp corners: a list of arrays (points, d)."""
        if len(self.corner) <= 2:
            ends = self.corner[[0, -1]]
            return [_stadium(*ends, self.rounding)] if ends.shape[1] == 2 else _capsule(*ends, self.rounding)
        if self.corner.shape[1] == 2:
            return [self.corner]
        found = (self._without_repeats(face) for face in self.faces)
        return [points for points in found if len(points) >= 3]

    def holds(self, points):
        """Which points (n, d) are in the piece, with its sharp corners."""
        if len(self.corner) <= 2:
            first, way = self.corner[0], self.corner[-1] - self.corner[0]
            along = np.clip((points - first) @ way / max(way @ way, np.finfo(float).tiny), 0.0, 1.0)
            return np.linalg.norm(points - first - along[:, None] * way, axis=1) <= self.rounding
        if self.corner.shape[1] == 2:
            sides = np.roll(self.corner, -1, axis=0) - self.corner
            across = (points[:, None] - self.corner)[:, :, ::-1] * sides * [-1.0, 1.0]
            turns = across.sum(axis=2)
            return np.all(turns >= 0.0, axis=1) | np.all(turns <= 0.0, axis=1)
        found = np.ones(len(points), dtype=bool)
        for face in self.polygons():
            found &= (points - face[0]) @ np.cross(face, np.roll(face, -1, axis=0)).sum(axis=0) <= 0.0
        return found

    def _without_repeats(self, face):
        points = self.corner[face]
        return points[np.any(points != np.roll(points, 1, axis=0), axis=1)]


class Shape:
    """A shape: name, size (radius in its own file, m), volume and principal moments of inertia of a body of radius and mass 1, pieces."""

    def __init__(self, name, size, volume, inertia, pieces):
        self.name, self.size, self.volume, self.inertia, self.pieces = name, size, volume, inertia, pieces

    def points(self, count):
        """Points that fill the shape evenly (count, d): those of a sequence of low discrepancy that are in one of its pieces."""
        d = self.pieces[0].corner.shape[1]
        # the roots of x^(d + 1) = x + 1, whose powers fill a square or a cube
        steps = (1.324717957244746 if d == 2 else 1.2207440846057596)**-np.arange(1.0, d + 1.0)
        low, high = (np.array([sign * (sign * piece.corner).max(axis=0) + sign * (piece.rounding if len(piece.corner) <= 2 else 0.0) for piece in self.pieces]) for sign in (-1.0, 1.0))
        low, high = low.min(axis=0), high.max(axis=0)
        found, first = np.zeros((0, d)), 0
        while len(found) < count:
            tried = low + (high - low) * np.mod(0.5 + np.arange(first + 1, first + 4 * count + 1)[:, None] * steps, 1.0)
            found = np.concatenate([found, tried[np.any([piece.holds(tried) for piece in self.pieces], axis=0)]])
            first += 4 * count
        return found[:count]

    def polygons(self):
        return [points for piece in self.pieces for points in piece.polygons()]


def ball(dimension):
    """The shape of a disk or a sphere."""
    centre = np.zeros((1, dimension))
    volume = np.pi if dimension == 2 else 4.0 / 3.0 * np.pi
    inertia = np.array([0.5]) if dimension == 2 else np.full(3, 0.4)
    return Shape("disk" if dimension == 2 else "sphere", 1.0, volume, inertia, [Piece(1.0, centre, centre, [])])


def shapes_of(tables):
    """Shapes from the tables of /shapes in results.h5, by their paths there."""
    def rows(name, owner, number):
        return np.flatnonzero(tables[name][owner] == number)

    pieces = {number: [] for number in tables["shapes"].number}
    for number, shape, rounding in zip(tables["pieces"].number, tables["pieces"].shape, tables["pieces"].rounding):
        place = rows("vertices", "piece", number)
        row_of = {vertex: row for row, vertex in enumerate(tables["vertices"].number[place])}
        faces = []
        if "faces" in tables:
            for face in tables["faces"].number[rows("faces", "piece", number)]:
                faces.append(np.array([row_of[vertex] for vertex in tables["face_vertices"].vertex[rows("face_vertices", "face", face)]]))
        pieces[shape].append(Piece(float(rounding), tables["vertices"].vertex[place], tables["vertices"].corner[place], faces))
    shapes = tables["shapes"]
    return [Shape(name, float(size), float(volume), inertia, pieces[number]) for number, name, size, volume, inertia in
            zip(shapes.number, shapes.name, shapes.size, shapes.volume, shapes.inertia)]


def axes_of(orientation):
    """Axes of bodies in global axes, as columns (n, d, d), from angles (n, 1) or unit quaternions (n, 4), the real part first."""
    if orientation.shape[1] == 1:
        c, s = np.cos(orientation[:, 0]), np.sin(orientation[:, 0])
        return np.array([[c, -s], [s, c]]).transpose(2, 0, 1)
    w, x, y, z = orientation.T
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]).transpose(2, 0, 1)


def _stadium(first, second, radius):
    """All points at a distance from a segment, or from a point: a polygon."""
    along = np.arctan2(*(second - first)[::-1])
    # a disk needs no end twice
    half = np.linspace(-0.5 * np.pi, 0.5 * np.pi, SIDES // 2 + 1)[:SIDES // 2 + int(np.any(first != second))] + along
    arc = radius * np.column_stack([np.cos(half), np.sin(half)])
    return np.concatenate([second + arc, first - arc])


def _capsule(first, second, radius):
    """All points at a distance from a segment, or from a point, in space: bands of polygons around its axis."""
    axis = second - first
    axis = axis / np.linalg.norm(axis) if np.any(axis != 0.0) else np.array([0.0, 0.0, 1.0])
    one = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
    one /= np.linalg.norm(one)
    around = np.linspace(0.0, 2.0 * np.pi, MERIDIANS, endpoint=False)
    ring = np.outer(np.cos(around), one) + np.outer(np.sin(around), np.cross(axis, one))
    levels = np.linspace(0.0, 0.5 * np.pi, BANDS + 1)
    rings = [first + radius * (np.cos(level) * ring - np.sin(level) * axis) for level in levels[::-1]]
    rings += [second + radius * (np.cos(level) * ring + np.sin(level) * axis) for level in levels[int(np.all(first == second)):]]
    return [np.array([low[m], low[n], high[n], high[m]]) for low, high in zip(rings, rings[1:])
            for m, n in zip(range(MERIDIANS), np.roll(range(MERIDIANS), -1))]
