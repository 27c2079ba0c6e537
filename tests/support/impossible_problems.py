#!/usr/bin/env python3
"""Contact problems without a solution, and near neighbours that have one: grains and boxes between walls of prescribed velocity.

    impossible_problems.py DIRECTORY    writes each as DIRECTORY/impossible/NAME.h5 or DIRECTORY/solvable/NAME.h5

v = W r + q with W = H^T M^-1 H and q = H^T M^-1 f - (velocities of the walls).

Why there is no solution. Let z have impulses along the normals alone, z_n >= 0, that leave all bodies in balance: H z = 0, so W z = 0.
A solution has v_n >= 0, so 0 <= z.v = z.W r + z.q = z.q. Each squeezed line of contacts has such a z, and walls that approach each
other along it make z.q < 0: that is a contradiction. `squeeze` checks both for every problem that it makes.

A wedge of half angle alpha that closes on a grain that does not turn, with speed c of each wall along its normal, has no such z, for the
grain could slide out. It does not where mu >= tan(alpha) and no load pulls it out. Both v_n >= 0 ask for u_y >= c/sin(alpha) > 0. At a
contact that carries an impulse, v_n = 0, so the grain slides out along its wall, and friction is mu r_n into the wedge. The impulses
along y sum to at most r_n (sin(alpha) - mu cos(alpha)) <= 0 for each contact, but m u_y > 0. In 3D, friction along the third axis
is against the velocity along it, which is 0 thus.
"""
import os
import sys

import numpy as np

from fclib_problems import write_local


class Scene:
    """Bodies and contacts, in 2D or 3D. A contact has a point, a normal towards its candidate, and a body or a wall behind it."""

    def __init__(self, dimension, friction):
        self.dimension, self.friction = dimension, friction
        self.bodies, self.contacts = [], []

    def add_body(self, place, mass=1.0, radius=0.5, load=None, turns=True):
        place = np.resize(np.append(np.array(place, float), np.zeros(3)), 3)
        load = np.zeros(3) if load is None else np.resize(np.append(np.array(load, float), np.zeros(3)), 3)
        inertia = (0.5 if self.dimension == 2 else 0.4) * mass * radius**2
        self.bodies.append((place, mass, inertia if turns else np.inf, load))
        return len(self.bodies) - 1

    def add_contact(self, candidate, antagonist, normal, radius=0.5, wall=0.0, point=None, friction=None):
        """wall: velocity of the wall, along the normal or as a vector, where antagonist is None. Returns the number of the contact."""
        normal = np.resize(np.append(np.array(normal, float), np.zeros(3)), 3)
        point = self.bodies[candidate][0] - radius * normal if point is None else np.array(point, float)
        wall = wall * normal if np.isscalar(wall) else np.array(wall, float)
        self.contacts.append((candidate, antagonist, point, normal, wall, self.friction if friction is None else friction))
        return len(self.contacts) - 1

    def frame(self, normal):
        if self.dimension == 2:
            return np.array([normal, [-normal[1], normal[0], 0]])
        t = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        t /= np.linalg.norm(t)
        return np.array([normal, t, np.cross(normal, t)])

    def matrices(self):
        """H (6 bodies, unknowns), the inverse masses (6 bodies), f (6 bodies), velocities of the walls (unknowns) and mu."""
        d = self.dimension
        h = np.zeros((6 * len(self.bodies), d * len(self.contacts)))
        walls = np.zeros(h.shape[1])
        for c, (candidate, antagonist, point, normal, wall, _) in enumerate(self.contacts):
            axes = self.frame(normal)
            for body, sign in ((candidate, 1), (antagonist, -1)):
                if body is None:
                    walls[d * c:d * c + d] = axes @ wall
                    continue
                arm = point - self.bodies[body][0]
                h[6 * body:6 * body + 3, d * c:d * c + d] = sign * axes.T
                h[6 * body + 3:6 * body + 6, d * c:d * c + d] = sign * np.cross(arm, axes).T
        inverse = np.concatenate([np.repeat([1 / mass, 1 / inertia], 3) for _, mass, inertia, _ in self.bodies])
        f = np.concatenate([np.append(load, np.zeros(3)) for *_, load in self.bodies])
        return h, inverse, f, walls, np.array([contact[-1] for contact in self.contacts])

    def problem(self):
        """W, q, mu."""
        h, inverse, f, walls, mu = self.matrices()
        return (h.T * inverse) @ h, (h.T * inverse) @ f - walls, mu

    def squeeze(self, contacts):
        """The problem, after a check that equal normal impulses on these contacts are in balance and oppose the walls."""
        w, q, mu = self.problem()
        z = np.zeros(len(q))
        z[np.array(contacts) * self.dimension] = 1
        assert np.abs(self.matrices()[0] @ z).max() <= 1e-14 and q @ z < -1e-9 * np.abs(q).max(), (w @ z, q @ z)
        return w, q, mu


def line(scene, count, speeds, masses=None, axis=0, at=(0, 0, 0), load=None):
    """Grains in a row between two walls, of the given speeds along the axis. Returns the contacts of the row."""
    direction = np.eye(3)[axis]
    bodies = [scene.add_body(np.array(at) + k * direction, 1.0 if masses is None else masses[k], load=load) for k in range(count)]
    row = [scene.add_contact(bodies[0], None, direction, wall=speeds[0] * direction)]
    for first, second in zip(bodies, bodies[1:]):
        row.append(scene.add_contact(second, first, direction))
    row.append(scene.add_contact(bodies[-1], None, -direction, wall=speeds[1] * direction))
    return row


def block(scene, counts, speeds, friction_load=None):
    """Grains on a square or cubic lattice, with walls on all sides. speeds: (axes, 2). Returns the rows of each axis."""
    axes = range(scene.dimension)
    index = {place: scene.add_body(place, load=friction_load) for place in np.ndindex(*counts)}
    rows = []
    for axis in axes:
        direction = np.eye(3)[axis]
        for place, body in index.items():
            if place[axis] > 0:
                continue
            row = [scene.add_contact(body, None, direction, wall=speeds[axis][0] * direction)]
            for k in range(1, counts[axis]):
                before, after = (tuple(place[i] + (j if i == axis else 0) for i in axes) for j in (k - 1, k))
                row.append(scene.add_contact(index[after], index[before], direction))
            last = tuple(place[i] + (counts[axis] - 1 if i == axis else 0) for i in axes)
            row.append(scene.add_contact(index[last], None, -direction, wall=speeds[axis][1] * direction))
            rows.append((axis, row))
    return rows


def falling_beside(scene, count=2):
    """Grains one on the other on a floor, under a load: solvable contacts that share no body with the others."""
    up = np.eye(3)[1]
    below = None
    for k in range(count):
        body = scene.add_body((100, 0.5 + k, 0), load=(0.02, -0.1, 0))
        scene.add_contact(body, below, up)
        below = body


def one_grain(dimension, friction, speeds=(1.0, -1.0), mass=1.0, count=1, masses=None, load=None, beside=0):
    scene = Scene(dimension, friction)
    if beside:
        falling_beside(scene, beside)
    row = line(scene, count, speeds, [mass] * count if masses is None else masses, load=load)
    return scene, row


def boxes(count, friction, lift):
    """Unit cubes one on the other, four contacts a face, on a floor that rises against a ceiling at rest."""
    scene = Scene(3, friction)
    up = np.eye(3)[2]
    bodies = [scene.add_body((0, 0, k + 0.5), 2.0, radius=0.65, load=(0, 0, -0.2)) for k in range(count)]
    faces = []
    for k in range(count + 1):
        for x, y in ((0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5)):
            if k < count:
                faces.append(scene.add_contact(bodies[k], bodies[k - 1] if k else None, up, wall=lift, point=(x, y, k)))
            else:
                faces.append(scene.add_contact(bodies[-1], None, -up, point=(x, y, k)))
    return scene, faces


def wedge(dimension, friction, angle, speed=1.0, load=0.0, mass=1.0):
    """A grain that does not turn, in a wedge that is open along y."""
    scene = Scene(dimension, friction)
    body = scene.add_body((0, 0, 0), mass, load=(0, load, 0), turns=False)
    for side in (1, -1):
        scene.add_contact(body, None, (side * np.cos(angle), np.sin(angle)), wall=speed)
    return scene


def triangle(friction, speed):
    """A disk between three walls at 120 degrees."""
    scene = Scene(2, friction)
    body = scene.add_body((0, 0))
    angles = np.pi * (0.5 + np.array([0, 2, 4]) / 3)
    return scene, [scene.add_contact(body, None, (np.cos(a), np.sin(a)), wall=speed) for a in angles]


def zigzag(count, friction, bend, speed=0.01):
    """A chain that is not straight: without friction it gives way to the sides."""
    scene = Scene(2, friction)
    places = [np.array([k * np.cos(bend), (k % 2) * np.sin(bend), 0]) for k in range(count)]
    bodies = [scene.add_body(place) for place in places]
    scene.add_contact(bodies[0], None, (1, 0), wall=speed)
    for k in range(1, count):
        scene.add_contact(bodies[k], bodies[k - 1], places[k] - places[k - 1])
    scene.add_contact(bodies[-1], None, (-1, 0), wall=speed)
    return scene


def impossible():
    """{name: (W, q, mu, dimension)} of problems without a solution."""
    found = {}

    def keep(name, scene, contacts=None):
        found[name] = (*(scene.problem() if contacts is None else scene.squeeze(contacts)), scene.dimension)

    for dimension in (2, 3):
        for friction in (0.0, 0.3, 1.0):
            keep(f"grain_{dimension}d_{friction}", *one_grain(dimension, friction))
        for mass in (1e-3, 1e3):
            keep(f"grain_{dimension}d_mass_{mass:g}", *one_grain(dimension, 0.5, mass=mass))
        for count in (3, 10):
            keep(f"chain_{dimension}d_{count}", *one_grain(dimension, 0.3, count=count))
        keep(f"chain_{dimension}d_load", *one_grain(dimension, 0.5, (0.01, 0.0), count=4, load=(0.1, -0.2, 0)))
        keep(f"chain_{dimension}d_beside", *one_grain(dimension, 0.3, count=3, beside=4))
    keep("chain_2d_10_smooth", *one_grain(2, 0.0, count=10))
    keep("chain_2d_30", *one_grain(2, 0.4, count=30))
    keep("chain_2d_masses", *one_grain(2, 0.3, count=6, masses=[1e-3, 1e3] * 3))
    keep("chain_3d_masses", *one_grain(3, 0.3, count=4, masses=[1e3, 1.0, 1e-3, 1.0]))
    keep("grain_2d_one_wall_follows", *one_grain(2, 0.3, (1.0, 0.9)))
    keep("grain_3d_slow_walls", *one_grain(3, 0.3, (1e-4, -1e-4), load=(0, -1.0, 0)))
    keep("triangle_2d_0", *triangle(0.0, 0.1))
    keep("triangle_2d_0.6", *triangle(0.6, 0.1))
    for name, dimension, counts, speeds in [
            ("square_2d", 2, (1, 1), [(1, -1), (1, -1)]), ("cube_3d", 3, (1, 1, 1), [(1, -1)] * 3),
            ("block_2d_5x5", 2, (5, 5), [(1, -1), (0, 0)]), ("block_2d_4x4_both", 2, (4, 4), [(1, -1), (0.5, 0)]),
            ("block_3d_3x3x3", 3, (3, 3, 3), [(0, 0), (0, 0), (0.1, -0.1)])]:
        scene = Scene(dimension, 0.4)
        rows = block(scene, counts, speeds, (0, -0.1, 0))
        moving = [axis for axis in range(dimension) if speeds[axis][0] > speeds[axis][1]]
        keep(name, scene, [c for axis, row in rows if axis in moving for c in row])
    for count, friction in ((1, 0.0), (1, 0.5), (4, 0.3)):
        keep(f"boxes_3d_{count}_{friction}", *boxes(count, friction, 0.05))
    for dimension, friction, angle, load in ((2, 0.5, 0.3, 0.0), (2, 1.0, 0.5, -0.2), (3, 0.7, 0.4, -0.1), (3, 0.5, 0.2, 0.0)):
        assert friction >= np.tan(angle) and load <= 0
        keep(f"wedge_{dimension}d_{friction}_{angle}", wedge(dimension, friction, angle, load=load))
    keep("wedge_3d_mass_0.001", wedge(3, 0.5, 0.2, mass=1e-3))
    keep("wedge_2d_mass_1000", wedge(2, 0.5, 0.2, mass=1e3))
    return found


def solvable():
    """{name: (W, q, mu, dimension)} of near neighbours that have a solution."""
    found = {}

    def keep(name, scene, *_):
        found[name] = (*scene.problem(), scene.dimension)

    for dimension in (2, 3):
        for name, speeds in (("opening", (-1.0, 1.0)), ("moving_alike", (1.0, 1.0)), ("at_rest", (0.0, 0.0))):
            for friction in (0.0, 0.5):
                keep(f"{name}_{dimension}d_{friction}", *one_grain(dimension, friction, speeds, load=(0.3, -0.2, 0)))
            keep(f"chain_{name}_{dimension}d", *one_grain(dimension, 0.3, speeds, count=10, load=(0.3, -0.2, 0), beside=2))
        keep(f"masses_{dimension}d", *one_grain(dimension, 0.3, (1.0, 1.0), count=6, masses=[1e-3, 1e3] * 3))
        keep(f"loaded_{dimension}d_mass_1000", *one_grain(dimension, 0.5, (1.0, 1.0), mass=1e3, load=(100, -200, 0)))
        # the walls close a little slower than the grain slides out; no friction, little of it, a load that takes the grain out
        for friction, angle, load in ((0.0, 0.01, 0.0), (0.0, 0.3, 0.0), (0.2, 0.3, 0.0), (0.5, 0.3, 20.0), (1.0, 0.2, 20.0)):
            keep(f"wedge_{dimension}d_{friction}_{angle}_{load:g}", wedge(dimension, friction, angle, load=load))
        keep(f"wedge_opens_{dimension}d", wedge(dimension, 0.5, 0.2, -1.0, load=-0.5))
    keep("zigzag_3", zigzag(3, 0.0, 0.2))
    keep("zigzag_10", zigzag(10, 0.0, 0.3))
    for name, dimension, counts, speeds in [
            ("block_2d_alike", 2, (5, 5), [(1, 1), (0, 0)]), ("block_3d_alike", 3, (2, 2, 2), [(1, 1), (0, 0), (-1, 1)])]:
        scene = Scene(dimension, 0.4)
        keep(name, scene, block(scene, counts, speeds, (0.1, -0.1, 0)))
    keep("boxes_4", *boxes(4, 0.3, 0.0))
    keep("boxes_fall", *boxes(4, 0.3, -0.01))
    keep("triangle_opens", *triangle(0.6, -0.1))
    return found


def write_problems(directory):
    """Write all. Returns the directories of both kinds."""
    directories = []
    for kind, problems in (("impossible", impossible()), ("solvable", solvable())):
        directories.append(os.path.join(directory, kind))
        os.makedirs(directories[-1], exist_ok=True)
        for name, (w, q, mu, dimension) in problems.items():
            write_local(os.path.join(directories[-1], f"{name}.h5"), w, q, mu, dimension=dimension)
    return directories


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    write_problems(sys.argv[1])
