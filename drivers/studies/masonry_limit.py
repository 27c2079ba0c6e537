"""Limit analysis of blocks with friction by linear programs: whether, or up to which load, impulses in the corners of joints can
hold each block. Blocks are rigid, joints bear no tension, and |r_t| <= mu r_n.

The program of each is the static theorem: unknown r_n and r_t of each contact, three equations of equilibrium a block."""
import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_matrix, hstack, vstack


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
        rows, columns, values = [], [], []
        for k, (i, j, point, normal) in enumerate(self.contacts):
            tangent = np.array([-normal[1], normal[0]])
            for part, way in enumerate((normal, tangent)):
                for body, sign in ((i, 1.0), (j, -1.0)):
                    if body is None:
                        continue
                    arm = point - self.centres[body]
                    rows += [3 * body, 3 * body + 1, 3 * body + 2]
                    columns += 3 * [2 * k + part]
                    values += [sign * way[0], sign * way[1], sign * (arm[0] * way[1] - arm[1] * way[0])]
        return coo_matrix((values, (rows, columns)), shape=(3 * len(self.centres), 2 * len(self.contacts))).tocsr()

    def cone(self, friction):
        """Rows of |r_t| - mu r_n <= 0."""
        n = len(self.contacts)
        k = np.arange(n)
        rows = np.concatenate([k, k, n + k, n + k])
        columns = np.concatenate([2 * k, 2 * k + 1, 2 * k, 2 * k + 1])
        ones = np.ones(n)
        values = np.concatenate([-friction * ones, ones, -friction * ones, -ones])
        return coo_matrix((values, (rows, columns)), shape=(2 * n, 2 * n))

    def loads(self, direction):
        """The weights along a direction."""
        load = np.zeros(3 * len(self.centres))
        load[0::3] = np.multiply(self.weights, direction[0])
        load[1::3] = np.multiply(self.weights, direction[1])
        return load

    def lack(self, friction, direction=(0.0, -1.0)):
        """By how much the cones must be widened, in units of the mean weight, for equilibrium: at most 0 where the blocks stand."""
        n = len(self.contacts)
        mean = np.mean(self.weights)
        equal = hstack([self.matrix(), coo_matrix((3 * len(self.centres), 1))]).tocsr()
        cone = hstack([self.cone(friction), coo_matrix(-np.ones((2 * n, 1)))])
        k = np.arange(n)
        normal = coo_matrix((-np.ones(2 * n), (np.concatenate([k, k]), np.concatenate([2 * k, np.full(n, 2 * n)]))))
        below = coo_matrix(np.vstack([cone.toarray(), normal.toarray()]))
        cost = np.zeros(2 * n + 1)
        cost[-1] = 1.0
        # a lower bound keeps a program that has room to spare from running away
        found = linprog(cost, A_ub=below, b_ub=np.zeros(3 * n), A_eq=equal, b_eq=-self.loads(direction) / mean,
                        bounds=[(None, None)] * (2 * n) + [(-1.0, None)], method="highs")
        return found.x[-1] if found.status == 0 else np.nan

    def largest(self, friction, live, dead=(0.0, -1.0)):
        """The largest factor of the live load that the blocks bear beside the dead load; loads are directions of the weights."""
        n = len(self.contacts)
        mean = np.mean(self.weights)
        equal = hstack([self.matrix(), coo_matrix((self.loads(live) / mean)[:, None])]).tocsr()
        below = hstack([self.cone(friction), coo_matrix((2 * n, 1))]).tocsr()
        cost = np.zeros(2 * n + 1)
        cost[-1] = -1.0
        bounds = [(0.0, None), (None, None)] * n + [(0.0, None)]
        found = linprog(cost, A_ub=below, b_ub=np.zeros(2 * n), A_eq=equal, b_eq=-self.loads(dead) / mean, bounds=bounds,
                        method="highs")
        return found.x[-1] if found.status == 0 else np.nan

    def least_of_motion(self, friction, velocities, live, dead=(0.0, -1.0)):
        """The least factor of the live load under which a motion can begin: joints that open bear nothing, joints that slide bear
        their full friction against it. Friction does not lift blocks that slide, so that this may be below what the blocks could
        bear. Velocities are vx, vy and spin of each block."""
        n = len(self.contacts)
        still = 1.0e-3 * np.abs(velocities).max()
        # of r_t over mu r_n where a joint slides, else 0
        full_friction, opens = np.zeros(n), np.zeros(n, bool)
        for k, (i, j, point, normal) in enumerate(self.contacts):
            slip = np.zeros(2)
            for body, sign in ((i, 1.0), (j, -1.0)):
                if body is not None:
                    arm = point - self.centres[body]
                    slip += sign * (velocities[body][:2] + velocities[body][2] * np.array([-arm[1], arm[0]]))
            along = slip @ [-normal[1], normal[0]]
            if slip @ normal > still:
                opens[k] = True
            elif abs(along) > still:
                full_friction[k] = -np.sign(along)
        slides = np.flatnonzero(full_friction)
        mean = np.mean(self.weights)
        equal = hstack([self.matrix(), coo_matrix((self.loads(live) / mean)[:, None])]).tocsr()
        rows, columns = np.tile(np.arange(len(slides)), 2), np.concatenate([2 * slides, 2 * slides + 1])
        values = np.concatenate([-friction * full_friction[slides], np.ones(len(slides))])
        full = coo_matrix((values, (rows, columns)), shape=(len(slides), 2 * n + 1))
        below = hstack([self.cone(friction), coo_matrix((2 * n, 1))]).tocsr()
        bounds = [(0.0, None), (None, None)] * n + [(0.0, None)]
        for k in np.flatnonzero(opens):
            bounds[2 * k] = bounds[2 * k + 1] = (0.0, 0.0)
        cost = np.zeros(2 * n + 1)
        cost[-1] = 1.0
        found = linprog(cost, A_ub=below, b_ub=np.zeros(2 * n), A_eq=vstack([equal, full]).tocsr(),
                        b_eq=np.concatenate([-self.loads(dead) / mean, np.zeros(len(slides))]), bounds=bounds, method="highs")
        return found.x[-1] if found.status == 0 else np.nan


def threshold(lacking, falls, stands, width=1.0e-7):
    """The place where `lacking` changes its sign: above 0 at `falls`."""
    while abs(stands - falls) > width:
        middle = 0.5 * (falls + stands)
        if lacking(middle) > 1.0e-9:
            falls = middle
        else:
            stands = middle
    return 0.5 * (falls + stands)
