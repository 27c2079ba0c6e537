"""Scenes of blocks for study_masonry.py: convex pieces in the plane or in space, placed by turns, run and read back."""
import itertools
import os
import shutil
import subprocess
import tempfile
from collections import namedtuple
from pathlib import Path

import numpy as np
from study_support import BINARIES, states

from gravier import Run, read_table
from gravier.case import ENVIRONMENT, namelist

#: of Open MPI for a rank without a launcher, in a sixth of the time
ALONE = {"OMPI_MCA_ess_singleton_isolated": "1", "OMPI_MCA_btl": "self", "OMPI_MCA_pml": "ob1",
         "OMPI_MCA_coll": "basic,libnbc,self"}
GRAVITY = 9.81  # m/s^2
STEP = 1.0e-3  # s
#: a solve that is as exact as rounding allows for some hundred contacts
EXACT = {"criterion": "residual", "tolerance": 1.0e-10, "max_iterations": 200000}

Shape = namedtuple("Shape", "name pieces area centre rounding")
Block = namedtuple("Block", "shape angle centre velocity fixed")


def area_and_centre(corners):
    """Area and centre of a polygon whose corners run anticlockwise."""
    x, y = np.asarray(corners, float).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    area = 0.5 * cross.sum()
    return area, np.array([((x + np.roll(x, -1)) * cross).sum(), ((y + np.roll(y, -1)) * cross).sum()]) / (6.0 * area)


def rectangle(width, height):
    """Corners of a rectangle about the origin."""
    return 0.5 * np.array([[-width, -height], [width, -height], [width, height], [-width, height]])


def regular(n, apothem=1.0):
    """Corners of a regular polygon about the origin, one side at the bottom."""
    angle = -0.5 * np.pi + np.pi / n * (2 * np.arange(n) + 1)
    return apothem / np.cos(np.pi / n) * np.column_stack([np.cos(angle), np.sin(angle)])


def turned(points, angle):
    """Points of the plane turned about the origin."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points) @ np.array([[c, s], [-s, c]])


class Scene:
    """Blocks and planes. Lengths are in metres; bodies have the density 1000."""

    def __init__(self, dimension=2, friction=0.5, gravity=None, **keys):
        self.dimension = dimension
        self.gravity = [0.0] * (dimension - 1) + [-GRAVITY] if gravity is None else list(map(float, gravity))
        self.keys = {"dimension": dimension, "bodies": "file", "bodies_file": "blocks.csv", "shapes": "blocks.shapes",
                     "density": 1000.0, "friction": friction, "gravity": self.gravity, **keys}
        self.shapes, self.blocks, self.walls = {}, [], []

    # ---- what is in it

    def shape(self, pieces, rounding=1.0e-3):
        """A shape in the plane of convex polygons, whose corners run anticlockwise."""
        pieces = [np.asarray(piece, float) for piece in pieces]
        # equal bodies share a shape
        key = (rounding, *[piece.tobytes() for piece in pieces])
        if key not in self.shapes:
            areas, centres = zip(*map(area_and_centre, pieces))
            centre = np.average(centres, axis=0, weights=areas)
            self.shapes[key] = Shape(f"s{len(self.shapes)}", pieces, sum(areas), centre, rounding)
        return self.shapes[key]

    def prism(self, base, height, rounding=1.0e-3):
        """A right prism about the origin whose base has its centre there."""
        return self.solid(np.array([[x, y, z] for z in (-0.5 * height, 0.5 * height) for x, y in base]), rounding)

    def solid(self, corners, rounding=1.0e-3):
        """A convex solid by its corners; its centre is the origin."""
        key = (rounding, np.asarray(corners).tobytes())
        if key not in self.shapes:
            self.shapes[key] = Shape(f"s{len(self.shapes)}", [np.asarray(corners)], 0.0, np.zeros(3), rounding)
        return self.shapes[key]

    def put(self, shape, at, angle=0.0, velocity=None, fixed=False):
        """Place the origin of the shape, turned by an angle or in space by a unit quaternion. Returns the number of the block."""
        centre = turned(shape.centre, angle) + at if self.dimension == 2 else np.asarray(at, float)
        if velocity is None:
            velocity = [0.0] * (3 if self.dimension == 2 else 6)
        self.blocks.append(Block(shape, angle, np.asarray(centre, float), velocity, fixed))
        return len(self.blocks) - 1

    def brick(self, width, height, at, angle=0.0, rounding=1.0e-3, **more):
        """A rectangle by its centre."""
        return self.put(self.shape([rectangle(width, height)], rounding), at, angle, **more)

    def plane(self, normal, point=None, **keys):
        self.walls.append({"shape": "plane", "normal": list(map(float, normal)),
                           "point": list(map(float, point if point is not None else [0.0] * self.dimension)), **keys})

    def corners(self, k):
        """Corners of each piece of a block where it is."""
        block = self.blocks[k]
        return [turned(piece - block.shape.centre, block.angle) + block.centre for piece in block.shape.pieces]

    # ---- files and runs

    def write(self, directory, steps, step, solver, output, **groups):
        word = "polygon" if self.dimension == 2 else "hull"
        text = ""
        for shape in self.shapes.values():
            text += f"shape {shape.name}\nrounding {float(shape.rounding)!r}\n"
            for piece in shape.pieces:
                text += word + "".join(f" {x!r}" for x in piece.ravel().tolist()) + "\n"
        (directory / "blocks.shapes").write_text(text, encoding="ascii")
        names = ["id", *"xyz"[:self.dimension], *(["vx", "vy", "omega", "angle"] if self.dimension == 2 else
                                                ["vx", "vy", "vz", "wx", "wy", "wz", "qw", "qx", "qy", "qz"]), "shape", "group"]
        rows = [",".join(names)]
        for k, block in enumerate(self.blocks):
            turn = [block.angle] if self.dimension == 2 else block.angle
            numbers = [*block.centre, *block.velocity, *turn]
            rows.append(",".join([str(k + 1), *[repr(float(x)) for x in numbers], block.shape.name, str(int(block.fixed))]))
        (directory / "blocks.csv").write_text("\n".join(rows) + "\n", encoding="ascii")
        walls = list(self.walls)
        if any(block.fixed for block in self.blocks):
            walls.append({"shape": "grains", "group": 1})
        case = {"scene": self.keys, "boundary": walls, "time": {"step": step, "steps": steps}, "solver": solver,
                "output": {"directory": ".", "every": 0, **output}, **groups}
        (directory / "case.nml").write_text(namelist(case), encoding="utf-8")

    def run(self, steps=1, step=STEP, solver=EXACT, ranks=1, keep=None, **more):
        """Run the scene; what it left."""
        output = more.pop("output", {})
        directory = Path(keep or tempfile.mkdtemp(prefix="gravier-masonry-"))
        directory.mkdir(parents=True, exist_ok=True)
        try:
            self.write(directory, steps, step, solver, output, **more)
            program = str((BINARIES / "gravier").resolve())
            command = [os.environ.get("MPIEXEC", "mpiexec"), "-n", str(ranks), program] if ranks > 1 else [program]
            own = {} if ranks > 1 else {**ALONE, "OMPI_MCA_orte_tmpdir_base": str(directory)}
            done = subprocess.run([*command, "case.nml"], cwd=directory, env={**ENVIRONMENT, **own, **os.environ},
                                  stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
            if done.returncode not in (0, 3):
                said = done.stdout.decode(errors="replace")
                raise RuntimeError(f"{directory}: gravier ended with status {done.returncode}: {said}")
            return Outcome(self, directory, done.returncode, step)
        finally:
            if keep is None:
                shutil.rmtree(directory, ignore_errors=True)


class Outcome:
    """The last state of a run and its history."""

    def __init__(self, scene, directory, status, step):
        self.converged, self.step = status == 0, step
        self.gravity = np.linalg.norm(scene.gravity)
        self.history = read_table(directory / "history.csv")
        run = Run(directory)
        # (time, orientations) of the states that are written besides the first and the last
        self.turns = []
        if len(run.steps) > 2:
            for _, t, group in states(directory / "results.h5"):
                self.turns.append((t, group["bodies/orientation"][:][np.argsort(group["bodies/id"][:])]))
        bodies = run.bodies()
        order = np.argsort(bodies.id)
        self.position, self.velocity = bodies.position[order], np.hstack([bodies.velocity, bodies.spin])[order]
        self.turn, self.mass = bodies.orientation[order], bodies.mass[order]
        self.contacts, self.boundaries = run.contacts(), run.boundaries()
        self.iterations = self.history.iterations

    def speed(self, blocks=slice(None)):
        """The largest speed of some blocks after one step from rest over that of a free fall; spins count with a length of 1 m."""
        return np.abs(self.velocity[blocks]).max() / (self.gravity * self.step)

    def impulses_on(self, candidate, antagonist=None):
        """Sum over the contacts of a pair, in global axes, on the candidate [N s]."""
        c = self.contacts
        rows = c.candidate == candidate + 1
        if antagonist is not None:
            rows &= c.antagonist == antagonist + 1
        normal, impulse = c.normal[rows], c.impulse[rows]
        return (impulse[:, :1] * normal + impulse[:, 1:2] * np.column_stack([-normal[:, 1], normal[:, 0]])).sum(0)


def bisect(stands, low, high, width):
    """The place between `low`, where it stands, and `high`, where it falls, to a width; nan where an end is not so."""
    if not stands(low) or stands(high):
        return np.nan
    while abs(high - low) > width:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stands(middle) else (low, middle)
    return 0.5 * (low + high)


def bisect_all(stand, low, high, width):
    """The same for many that one run tries side by side: `stand` takes one number for each and says for each whether it stands."""
    low, high = np.array(low, float), np.array(high, float)
    good = np.asarray(stand(low)) & ~np.asarray(stand(high))
    while np.abs(high - low).max() > width:
        middle = 0.5 * (low + high)
        up = np.asarray(stand(middle))
        low, high = np.where(up, middle, low), np.where(up, high, middle)
    return np.where(good, 0.5 * (low + high), np.nan)


def spread(n, apart):
    """Places (n, 2) of things that must not meet, about the origin."""
    side = int(np.ceil(np.sqrt(n)))
    return [np.array([apart * i, apart * j]) for i, j in itertools.islice(itertools.product(range(side), range(side)), n)]
