"""Meshes for walls, and the files that hold them."""
import numpy as np

from gravier_runs import write


def floor(count, half, seed=None, turn=None, shift=(0.0, 0.0, 0.0)):
    """Triangles (n, 3, 3) of a square of half width `half` about the origin, 2 count^2 of them, whose inner corners are moved at random
    where a seed is given; turned by a matrix and shifted."""
    line = np.linspace(-half, half, count + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    if seed is not None:
        random = np.random.default_rng(seed)
        for places in (x, y):
            places[1:-1, 1:-1] += random.uniform(-0.6, 0.6, (count - 1, count - 1)) * half / count
    corner = np.stack([x, y, np.zeros_like(x)], axis=-1)
    if turn is not None:
        corner = corner @ np.transpose(turn)
    return quadrangles(corner + np.array(shift))


def quadrangles(corner):
    """Triangles of a grid of corners (m, n, 3), cut along either diagonal in turn."""
    triangles = []
    for i in range(corner.shape[0] - 1):
        for j in range(corner.shape[1] - 1):
            a, b, c, d = corner[i, j], corner[i + 1, j], corner[i + 1, j + 1], corner[i, j + 1]
            triangles += [(a, b, c), (a, c, d)] if (i + j) % 2 else [(a, b, d), (b, c, d)]
    return np.array(triangles)


def box(low, high):
    """Twelve triangles of a box."""
    corner = np.array([[[[x, y, z] for z in (low[2], high[2])] for y in (low[1], high[1])] for x in (low[0], high[0])], dtype=float)
    sides = [side.reshape(2, 2, 3) for axis in range(3) for side in np.moveaxis(corner, axis, 0)]
    return np.concatenate([quadrangles(side) for side in sides])


def stl_text(triangles):
    """An ASCII STL file, whose numbers are exact."""
    lines = ["solid mesh"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex " + " ".join(repr(float(x)) for x in corner) for corner in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join(lines + ["endsolid mesh"]) + "\n"


def stl_bytes(triangles):
    """A binary STL file, of single precision."""
    record = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["corners"] = triangles
    return b"mesh".ljust(80) + np.uint32(len(record)).tobytes() + record.tobytes()


def write_line(path, points):
    """A CSV file of one line."""
    write(path, "x,y\n" + "".join(f"{float(x)!r},{float(y)!r}\n" for x, y in points))
