"""Scenes of bodies with shapes: a library of each dimension, and places and turns of bodies drawn from it."""
import os

import numpy as np

from gravier_runs import merged, write

#: polygons with and without equal sides, a capsule, and clusters of polygons and of disks
FLAT = """shape square
polygon -0.05 -0.05  0.05 -0.05  0.05 0.05  -0.05 0.05
shape wedge
rounding 0.002
polygon 0 0  0.12 0  0.03 0.09
shape pill
capsule -0.04 0  0.04 0  0.03
shape ell
polygon 0 0  0.12 0  0.12 0.05  0 0.05
polygon 0 0.05  0.05 0.05  0.05 0.12  0 0.12
shape twin
disk -0.03 0  0.04
disk 0.03 0.01  0.04
"""
#: hulls, a capsule, and clusters of boxes and of spheres
SOLID = """shape cube
box 0.1 0.1 0.1
shape askew
hull 0 0 0  0.12 0.02 0  0.03 0.11 0.03  0.04 0.04 0.12  0.1 0.09 0.08
shape pill
capsule 0 0 -0.04  0 0 0.04  0.03
shape cross
box 0.15 0.05 0.05
box 0.05 0.05 0.05  0 0.05 0
box 0.05 0.05 0.05  0 -0.05 0.02
shape twin
sphere -0.03 0 0  0.04
sphere 0.03 0.01 0  0.04
"""
LIBRARY = {2: FLAT, 3: SOLID}
#: every other name is a disk or a sphere
NAMES = {2: ["square", "wedge", "grain", "pill", "ell", "twin"], 3: ["cube", "askew", "grain", "pill", "cross", "twin"]}
SPINS = {2: ["omega"], 3: ["wx", "wy", "wz"]}
TURN = {2: ["angle"], 3: ["qw", "qx", "qy", "qz"]}


def body(shape, place, turn=None, velocity=None, spin=None, **more):
    """A row of a bodies file: a shape of the library or a grain, whose size `more` has as its scale or radius."""
    dimension = len(place)
    row = dict(zip("xyz", place))
    row["shape"] = shape
    if turn is not None:
        row.update(zip(TURN[dimension], np.atleast_1d(turn)))
    if velocity is not None:
        row.update(zip(("vx", "vy", "vz"), velocity))
    if spin is not None:
        row.update(zip(SPINS[dimension], np.atleast_1d(spin)))
    row.update(more)
    return row


def bodies_csv(rows):
    """Text of a bodies file; bodies are numbered from 1 on."""
    names = sorted({name for row in rows for name in row})
    lines = [",".join(["id", *names])]
    for number, row in enumerate(rows, 1):
        lines.append(",".join([str(number), *(cell(row[name]) if name in row else "" for name in names)]))
    return "\n".join(lines) + "\n"


def cell(value):
    return value if isinstance(value, str) else repr(value.item() if isinstance(value, np.generic) else value)


def lattice(counts, seed=1, spacing=0.17, names=None, height=0.1, speed=0.3):
    """Bodies of the library on a lattice above the origin, turned and moving at random; disks and spheres among them."""
    random = np.random.default_rng(seed)
    dimension = len(counts)
    names = names or NAMES[dimension]
    rows = []
    for number, index in enumerate(np.ndindex(*counts[::-1])):
        place = spacing * (np.array(index[::-1], float) + 0.5)
        place[-1] += height - 0.5 * spacing
        turn = random.normal(size=4) if dimension == 3 else random.uniform(-3.0, 3.0)
        velocity, spin = speed * random.normal(size=dimension), 10.0 * speed * random.normal(size=2 * dimension - 3)
        name = names[number % len(names)]
        more = {"radius": 0.05} if name == "grain" else {"scale": random.uniform(0.8, 1.1)}
        rows.append(body(name, place, turn, velocity, spin, **more))
    return rows


def box(counts, spacing=0.17):
    """Planes of the box that a lattice stands in: the floor and the sides."""
    dimension = len(counts)
    planes = []
    for axis in range(dimension):
        normal = np.eye(dimension)[axis]
        planes.append({"shape": "plane", "point": [0.0] * dimension, "normal": normal.tolist()})
        if axis < dimension - 1:
            planes.append({"shape": "plane", "point": (counts[axis] * spacing * normal).tolist(), "normal": (-normal).tolist()})
    return planes


def shaped_case(dimension, boundaries=(), *parts):
    """A case of bodies with shapes in the files that `prepare` writes."""
    case = {
        "scene": {"dimension": dimension, "bodies": "file", "bodies_file": "bodies.csv", "shapes": "bodies.shapes"},
        "time": {"step": 1e-3, "steps": 100},
        "output": {"directory": "results", "every": 0},
    }
    if boundaries:
        case["boundary"] = [dict(keys) for keys in boundaries]
    return merged(case, *parts)


def prepare(directory, dimension, rows, library=None):
    """Write the files of a scene into a directory, which is made."""
    os.makedirs(directory, exist_ok=True)
    write(os.path.join(directory, "bodies.csv"), bodies_csv(rows))
    write(os.path.join(directory, "bodies.shapes"), library or LIBRARY[dimension])
    return directory
