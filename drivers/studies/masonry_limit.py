"""Limit analysis of blocks with friction by linear programs: whether, or up to which load, impulses in the corners of joints can
hold each block. Blocks are rigid, joints bear no tension, and |r_t| <= mu r_n.

The program of each is the static theorem: unknown r_n and r_t of each contact, three equations of equilibrium a block."""
import sys
from pathlib import Path

import numpy as np


def least(cost, equal, right, below=None, bounds=(None, None)):
    """The least cost of x with equal x = right and below x <= 0; nan where there is none."""
    # who only runs the blocks needs no scipy
    try:
        from scipy.optimize import linprog
    except ImportError as missing:
        sys.exit(f"{Path(sys.argv[0]).name}: {missing}; expected a python3 with scipy")

    found = linprog(cost, A_ub=below, b_ub=None if below is None else np.zeros(len(below)), A_eq=equal, b_eq=right, bounds=bounds,
                    method="highs")
    return found.x @ cost if found.status == 0 else np.nan


class Blocks:
    """Blocks by their centres, and contacts between them or with the ground."""

    def __init__(self):
        self.centres, self.weights, self.contacts = [], [], []

    def add(self, centre, weight):
        self.centres.append(np.asarray(centre, float))
        self.weights.append(weight)
        return len(self.centres) - 1

    def touch(self, i, j, point, normal):
        """A contact of block i with block j, or with the ground where j is None; the normal points to i."""
        self.contacts.append((i, j, np.asarray(point, float), np.asarray(normal, float)))

    def joint(self, i, j, ends, normal):
        for end in ends:
            self.touch(i, j, end, normal)

    def matrix(self):
        """Forces and moments on the blocks (3 a block) from r_n and r_t of all contacts."""
        matrix = np.zeros((3 * len(self.centres), 2 * len(self.contacts)))
        for k, (i, j, point, normal) in enumerate(self.contacts):
            for column, way in ((2 * k, normal), (2 * k + 1, np.array([-normal[1], normal[0]]))):
                for body, sign in ((i, 1.0), (j, -1.0)):
                    if body is None:
                        continue
                    arm = point - self.centres[body]
                    matrix[3 * body:3 * body + 3, column] += sign * np.array([*way, arm[0] * way[1] - arm[1] * way[0]])
        return matrix

    def cone(self, friction):
        """Rows of |r_t| - mu r_n <= 0."""
        n = len(self.contacts)
        k = np.arange(n)
        rows = np.zeros((2 * n, 2 * n))
        rows[k, 2 * k] = rows[n + k, 2 * k] = -friction
        rows[k, 2 * k + 1], rows[n + k, 2 * k + 1] = 1.0, -1.0
        return rows

    def loads(self, direction):
        """The weights along a direction, over the mean weight."""
        load = np.zeros(3 * len(self.centres))
        load[0::3] = np.multiply(self.weights, direction[0])
        load[1::3] = np.multiply(self.weights, direction[1])
        return load / np.mean(self.weights)

    def lack(self, friction, direction=(0.0, -1.0)):
        """By how much the cones must be widened, in units of the mean weight, for equilibrium: at most 0 where the blocks stand."""
        n = len(self.contacts)
        normal = np.zeros((n, 2 * n))
        normal[np.arange(n), 2 * np.arange(n)] = -1.0
        below = np.hstack([np.vstack([self.cone(friction), normal]), -np.ones((3 * n, 1))])
        equal = np.hstack([self.matrix(), np.zeros((3 * len(self.centres), 1))])
        cost = np.zeros(2 * n + 1)
        cost[-1] = 1.0
        # a lower bound keeps a program that has room to spare from running away
        return least(cost, equal, -self.loads(direction), below, [(None, None)] * (2 * n) + [(-1.0, None)])

    def largest(self, friction, live, dead=(0.0, -1.0)):
        """The largest factor of the live load that the blocks bear beside the dead load; loads are directions of the weights."""
        return -self._factor(-1.0, friction, live, dead)

    def least_of_motion(self, friction, velocities, live, dead=(0.0, -1.0)):
        """The least factor of the live load under which a motion can begin: joints that open bear nothing, joints that slide bear
        their full friction against it. Friction does not lift blocks that slide, so that this may be below what the blocks could
        bear. Velocities are vx, vy and spin of each block."""
        n = len(self.contacts)
        still = 1.0e-3 * np.abs(velocities).max()
        opens, slides = np.zeros(n, bool), []
        for k, (i, j, point, normal) in enumerate(self.contacts):
            slip = np.zeros(2)
            for body, sign in ((i, 1.0), (j, -1.0)):
                if body is not None:
                    arm = point - self.centres[body]
                    slip += sign * (velocities[body][:2] + velocities[body][2] * np.array([-arm[1], arm[0]]))
            along = slip @ [-normal[1], normal[0]]
            opens[k] = slip @ normal > still
            if not opens[k] and abs(along) > still:
                row = np.zeros(2 * n + 1)
                row[2 * k], row[2 * k + 1] = friction * np.sign(along), 1.0
                slides.append(row)
        return self._factor(1.0, friction, live, dead, opens, slides)

    def _factor(self, sign, friction, live, dead, opens=None, slides=()):
        """The least of sign times the factor; contacts that open bear nothing, and rows for those that slide are 0."""
        n = len(self.contacts)
        equal = np.vstack([np.hstack([self.matrix(), self.loads(live)[:, None]]), *slides])
        right = np.concatenate([-self.loads(dead), np.zeros(len(slides))])
        bounds = [(0.0, None), (None, None)] * n + [(0.0, None)]
        for k in np.flatnonzero(opens) if opens is not None else ():
            bounds[2 * k] = bounds[2 * k + 1] = (0.0, 0.0)
        cost = np.zeros(2 * n + 1)
        cost[-1] = sign
        return least(cost, equal, right, np.hstack([self.cone(friction), np.zeros((2 * n, 1))]), bounds)


def threshold(lacking, falls, stands, width=1.0e-7):
    """The place where `lacking` changes its sign: above 0 at `falls`."""
    while abs(stands - falls) > width:
        middle = 0.5 * (falls + stands)
        if lacking(middle) > 1.0e-9:
            falls = middle
        else:
            stands = middle
    return 0.5 * (falls + stands)
