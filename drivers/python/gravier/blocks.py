"""Block structures: walls in running bond, towers, arches, and Voronoi blocks that fill a rectangle or a box.

    from gravier import blocks
    blocks.wall(8, 5, (0.2, 0.08)).write("wall")        # wall.shapes, wall.csv and wall.nml, which runs

Heights are along the last axis, and the ground is at height 0. Blocks touch exactly where they should. Voronoi blocks of a box need scipy."""
import math
import os
import tempfile
from pathlib import Path

import numpy as np

from .case import namelist
from whole_file import Misplaced, check_place, give_names

#: first words of its files, after the mark of a comment
MADE = "made by gravier_blocks"
#: rounding of a shape by the program's own rule, over its size
USUAL_ROUNDING = 1e-3


class BlocksError(Exception):
    """Figures that no structure has: one line."""


class Blocks:
    """Blocks of a structure: `shapes` {name: lines of the file of shapes}, rows of bodies (shape, place, angle or quaternion or None), planes
    (point, normal), and `volume`, that of all blocks."""

    def __init__(self, dimension):
        self.dimension, self.shapes, self.bodies, self.planes, self.volume = dimension, {}, [], [], 0.0

    def add(self, shape, place, volume, turn=None):
        self.bodies.append((shape, np.array(place, float), turn))
        self.volume += volume

    def add_ground(self):
        d = self.dimension
        self.planes.append((np.zeros(d), np.eye(d)[-1]))

    def shapes_text(self):
        return "".join(f"shape {name}\n{lines}\n" for name, lines in self.shapes.items())

    def bodies_text(self):
        d = self.dimension
        places, turns, normals = "xyz"[:d], ["angle"] if d == 2 else ["qw", "qx", "qy", "qz"], [f"n{axis}" for axis in "xyz"[:d]]
        rows = [",".join(["id", *places, "shape", *turns, *normals])]
        for number, (shape, place, turn) in enumerate(self.bodies, 1):
            turned = [""] * len(turns) if turn is None else [repr(float(x)) for x in np.atleast_1d(turn)]
            rows.append(",".join([str(number), *(repr(float(x)) for x in place), shape, *turned, *[""] * d]))
        for number, (point, normal) in enumerate(self.planes, len(self.bodies) + 1):
            rows.append(",".join([str(number), *(repr(float(x)) for x in point), "plane", *[""] * len(turns),
                                  *(repr(float(x)) for x in normal)]))
        return "\n".join(rows) + "\n"

    def groups(self, name, friction=0.7, density=2000.0, step=1e-3, steps=200):
        """Groups of the case, for `gravier.run` or `gravier.namelist`."""
        return {"scene": {"dimension": self.dimension, "bodies": "file", "bodies_file": f"{name}.csv", "shapes": f"{name}.shapes",
                          "friction": friction, "density": density},
                "time": {"step": step, "steps": steps},
                "output": {"directory": f"{name}_results", "every": max(1, steps // 10)}}

    def write(self, stem, **figures):
        """Write STEM.shapes, STEM.csv and STEM.nml; `figures` are those of `groups`. Files that are there are replaced where this function has
        made them. Returns the names."""
        folder, name = os.path.split(str(stem))
        texts = {".shapes": f"# {MADE}\n{self.shapes_text()}", ".csv": f"# {MADE}\n{self.bodies_text()}",
                 ".nml": f"! {MADE}\n{namelist(self.groups(name, **figures))}"}
        try:
            for ending in texts:
                check_place(f"{stem}{ending}", {ending: f"[!#] {MADE}\n".encode()})
        except Misplaced as refused:
            raise BlocksError(str(refused)) from None
        if folder:
            os.makedirs(folder, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".gravier_blocks-", dir=folder or ".") as draft:
            for ending, text in texts.items():
                Path(draft, name + ending).write_text(text, encoding="utf-8")
            # the case comes last: where it is there, so is what it names
            give_names({f"{stem}{ending}": os.path.join(draft, name + ending) for ending in texts})
        return [f"{stem}{ending}" for ending in texts]


def _sizes(what, values, count):
    """Lengths above 0, as many as there should be."""
    values = [float(value) for value in np.atleast_1d(values)]
    if len(values) not in np.atleast_1d(count) or not all(math.isfinite(value) and value > 0.0 for value in values):
        raise BlocksError(f"{what} {' '.join(f'{value:g}' for value in values)}: expected {' or '.join(map(str, np.atleast_1d(count)))} "
                          "finite numbers > 0")
    return np.array(values)


def _count(what, value, least):
    if value != int(value) or value < least:
        raise BlocksError(f"{what} {value:g}: expected a whole number of at least {least}")
    return int(value)


def _numbers(values):
    return " ".join(repr(float(value)) for value in np.ravel(values))


def _block(size):
    """A rectangle or a box about its centre, as a line of a file of shapes."""
    if len(size) == 3:
        return f"box {_numbers(size)}"
    return f"polygon {_numbers(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size / 2.0)}"


def wall(bricks, courses, size):
    """A wall of bricks in running bond: each course is shifted by half a brick, and every second one ends with half bricks. `size` is that of
    a brick, (length, height) or (length, thickness, height)."""
    bricks, courses = _count("bricks", bricks, 1), _count("courses", courses, 1)
    size = _sizes("size", size, (2, 3))
    made = Blocks(len(size))
    half = size * [0.5] + size * 0.0
    half[1:] = size[1:]
    made.shapes["brick"] = _block(size)
    if courses > 1:
        made.shapes["half"] = _block(half)
    middle = np.zeros(made.dimension)
    for course in range(courses):
        middle[-1] = (course + 0.5) * size[-1]
        # places in lengths of a brick
        row = [("brick", k + 0.5) for k in range(bricks)]
        if course % 2:
            row = [("half", 0.25), *(("brick", k + 1.0) for k in range(bricks - 1)), ("half", bricks - 0.25)]
        for shape, along in row:
            middle[0] = along * size[0]
            made.add(shape, middle, np.prod(size if shape == "brick" else half))
    made.add_ground()
    return made


def tower(levels, size, a_level=1):
    """A tower: blocks one upon the other, or, in space, levels of `a_level` planks side by side, each level across the one below. `size` is
    that of a block, (length, height) or (length, width, height)."""
    levels, a_level = _count("levels", levels, 1), _count("blocks of a level", a_level, 1)
    size = _sizes("size", size, (2, 3))
    made = Blocks(len(size))
    if a_level > 1 and made.dimension == 2:
        raise BlocksError(f"{a_level} blocks of a level: expected 1 where the size of a block has two lengths")
    if a_level > 1 and a_level * size[1] > size[0] * (1.0 + 1e-12):
        raise BlocksError(f"{a_level} planks of width {size[1]:g} side by side: expected at most their length, {size[0]:g}")
    made.shapes["block"] = _block(size)
    across = np.array([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
    for level in range(levels):
        for k in range(a_level):
            place = np.zeros(made.dimension)
            place[-1] = (level + 0.5) * size[-1]
            if a_level == 1:
                made.add("block", place, np.prod(size))
                continue
            # spread over the length of the planks below
            side = ((k / (a_level - 1)) - 0.5) * (size[0] - size[1])
            place[1 - level % 2] = side
            made.add("block", place, np.prod(size), across if level % 2 else None)
    made.add_ground()
    return made


def arch(voussoirs, radius, thickness, depth=None):
    """A semicircular arch of equal voussoirs on the ground, in the plane or, with a depth, in space. `radius` is that of the middle line. The
    sides of voussoirs along the arch are straight, with their ends on the circles."""
    voussoirs = _count("voussoirs", voussoirs, 2)
    radius, thickness = _sizes("radius and thickness", (radius, thickness), 2)
    if thickness >= 2.0 * radius:
        raise BlocksError(f"thickness {thickness:g}: expected less than twice the radius, {2.0 * radius:g}")
    made = Blocks(2 if depth is None else 3)
    share = math.pi / voussoirs / 2.0
    inner, outer = radius - thickness / 2.0, radius + thickness / 2.0
    # a voussoir at the crown, seen from the centre of the circles
    corner = np.array([[-math.sin(share) * inner, math.cos(share) * inner], [math.sin(share) * inner, math.cos(share) * inner],
                       [math.sin(share) * outer, math.cos(share) * outer], [-math.sin(share) * outer, math.cos(share) * outer]])
    area = 0.5 * (outer**2 - inner**2) * math.sin(2.0 * share)
    # of a trapezium
    height, low, high = (outer - inner) * math.cos(share), 2.0 * inner * math.sin(share), 2.0 * outer * math.sin(share)
    middle = inner * math.cos(share) + height / 3.0 * (low + 2.0 * high) / (low + high)
    if depth is None:
        made.shapes["voussoir"] = f"polygon {_numbers(corner)}"
    else:
        depth = _sizes("depth", depth, 1)[0]
        made.shapes["voussoir"] = "hull " + _numbers([[x, side * depth / 2.0, z] for side in (-1.0, 1.0) for x, z in corner])
        area *= depth
    for k in range(voussoirs):
        # from left to right, clockwise from the crown
        angle = (k + 0.5) * 2.0 * share - math.pi / 2.0
        place = middle * np.array([math.sin(angle), math.cos(angle)])
        if depth is None:
            made.add("voussoir", place, area, -angle)
        else:
            made.add("voussoir", [place[0], 0.0, place[1]], area, [math.cos(angle / 2.0), 0.0, math.sin(angle / 2.0), 0.0])
    made.add_ground()
    return made


def voronoi(count, size, seed=1, relax=3):
    """Voronoi blocks that fill a rectangle or a box of this size, from the origin on, between planes on its sides. Their seeds are random and
    are moved `relax` times to the centres of their blocks, which makes blocks rounder. Blocks of a box need scipy."""
    count = _count("blocks", count, 1)
    size = _sizes("size", size, (2, 3))
    made = Blocks(len(size))
    place = np.random.default_rng(seed).random((count, made.dimension)) * size
    cells = _cells_2d if made.dimension == 2 else _cells_3d
    for _ in range(_count("relax", relax, 0)):
        place = np.array([_centre(corner)[0] for corner in cells(place, size)])
    for number, corner in enumerate(cells(place, size), 1):
        name = f"block_{number}"
        centre, volume = _centre(corner)
        corner = corner - centre
        if made.dimension == 2:
            # something has to be left of each side
            shortest = np.linalg.norm(corner - np.roll(corner, 1, axis=0), axis=1).min()
            rounding = min(USUAL_ROUNDING * np.linalg.norm(corner, axis=1).max(), 0.1 * shortest)
            made.shapes[name] = f"rounding {float(rounding)!r}\npolygon {_numbers(corner)}"
        else:
            made.shapes[name] = f"hull {_numbers(corner)}"
        made.add(name, centre, volume)
    for axis in range(made.dimension):
        normal = np.eye(made.dimension)[axis]
        made.planes.append((np.zeros(made.dimension), normal))
        if axis < made.dimension - 1:
            made.planes.append((size * normal, -normal))
    return made


def _centre(corner):
    """Centroid and area or volume of the hull of points; in the plane corners in anticlockwise order."""
    if corner.shape[1] == 2:
        a, b = corner[1:-1] - corner[0], corner[2:] - corner[0]
        twice = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        return corner[0] + (twice[:, None] * (a + b)).sum(axis=0) / 3.0 / twice.sum(), twice.sum() / 2.0
    hull = _scipy().ConvexHull(corner)
    inside = corner.mean(axis=0)
    edges = corner[hull.simplices] - inside
    volume = np.abs(np.linalg.det(edges)) / 6.0
    return inside + (volume[:, None] * edges.sum(axis=1) / 4.0).sum(axis=0) / volume.sum(), volume.sum()


def _cells_2d(place, size):
    """Corners of each cell of a rectangle: what lies nearer to its place than to any other."""
    cells = []
    for own in place:
        corner = np.array([[0.0, 0.0], [size[0], 0.0], [size[0], size[1]], [0.0, size[1]]])
        way = place - own
        for k in np.argsort((way**2).sum(axis=1), kind="stable")[1:]:
            # no farther place cuts the cell
            if (way[k]**2).sum() > 4.0 * ((corner - own)**2).sum(axis=1).max():
                break
            corner = _cut(corner, way[k], way[k] @ (own + place[k]) / 2.0)
        cells.append(_without_repeats(corner, 1e-9 * size.max()))
    return cells


def _cut(corner, normal, offset):
    """The part of a convex polygon where normal . x <= offset."""
    height = corner @ normal - offset
    kept = []
    for k, after in enumerate(np.roll(height, -1)):
        if height[k] <= 0.0:
            kept.append(corner[k])
        if height[k] * after < 0.0:
            kept.append(corner[k] + height[k] / (height[k] - after) * (corner[(k + 1) % len(corner)] - corner[k]))
    return np.array(kept)


def _without_repeats(corner, same):
    return corner[np.linalg.norm(corner - np.roll(corner, 1, axis=0), axis=1) > same]


def _cells_3d(place, size):
    """Corners of each cell of a box: places mirrored at its sides bound them."""
    mirrored = [place]
    for axis in range(3):
        for side in (0.0, size[axis]):
            other = place.copy()
            other[:, axis] = 2.0 * side - other[:, axis]
            mirrored.append(other)
    found = _scipy().Voronoi(np.concatenate(mirrored))
    # what lies on a side by rounding lies on it
    return [np.clip(found.vertices[found.regions[found.point_region[k]]], 0.0, size) for k in range(len(place))]


def _scipy():
    try:
        import scipy.spatial
    except ImportError as missing:
        raise BlocksError(f"{missing}: Voronoi blocks of a box need scipy; expected a python3 with it (apt install python3-scipy)") from None
    return scipy.spatial
