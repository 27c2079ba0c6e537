"""Cells over a scene: which of them hold points, which parts of lines and of balls lie in them, and sums over them that a kernel smooths."""
import math

import numpy as np

from .linked_grains import pairs_of_ranges

#: widths of a kernel after which it ends
REACH = 3.0
#: parts of balls in cells that are computed at a time
MOST_PARTS = 2000000


class Grid:
    """Cells of one size: `count` along each axis (d) over the box with the lower corner `corner` and the edges `edges` (d, d), a row an axis. Along axes that `wrap` (d) the cells
    repeat themselves. `rims` are three things of the others: whether they are open, so that what lies beyond the cells belongs to the last one, and is not left out; `pad` (d), cells on both
    sides for which sums are kept, too; and `repeat` (d), after how many cells the scene repeats itself, 0 where it does not: of the images of a point the one counts that is nearest to the middle."""

    def __init__(self, count, wraps, corner, edges, rims):
        self.count, self.wraps, self.corner, self.edges = np.array(count), np.array(wraps), np.array(corner, dtype=float), np.array(edges, dtype=float)
        self.is_open, pad, self.repeat = rims
        self.pad = np.where(self.wraps, 0, pad)
        self.inverse = np.linalg.inv(self.edges)
        self.shape = tuple(self.count + 2 * self.pad)
        self.size = int(np.prod(self.shape))
        #: of a cell [m³, m² in the plane]
        self.volume = abs(np.linalg.det(self.edges)) / np.prod(self.count)

    def places(self, points):
        """Points (n, d) in cells from the corner."""
        found = (points - self.corner) @ self.inverse * self.count
        for axis in np.flatnonzero(self.repeat > 0.0):
            low = 0.5 * (self.count[axis] - self.repeat[axis])
            found[:, axis] = low + np.mod(found[:, axis] - low, self.repeat[axis])
        return found

    def ways(self, vectors):
        """Vectors (n, d) in cells."""
        return vectors @ self.inverse * self.count

    def centres(self):
        """Of all cells that sums are kept for, the last axis the fastest (cells, d) [m]."""
        axes = np.meshgrid(*((np.arange(n) - pad + 0.5) / count for n, pad, count in zip(self.shape, self.pad, self.count)), indexing="ij")
        return self.corner + np.stack([axis.ravel() for axis in axes], axis=1) @ self.edges

    def cells_along(self, axis, number):
        """Numbers of cells along an axis in the sums, and whether they are there, of whole numbers from the corner."""
        n, pad, total = self.count[axis], self.pad[axis], self.shape[axis]
        if self.wraps[axis]:
            return np.mod(number, n), np.ones(np.shape(number), dtype=bool)
        if self.is_open:
            return np.clip(number, 0, n - 1) + pad, np.ones(np.shape(number), dtype=bool)
        return np.clip(number + pad, 0, total - 1), (number >= -pad) & (number < total - pad)

    def cells(self, places):
        """Numbers of the cells of places (n, d), -1 outside (n)."""
        found, inside = np.zeros(len(places), dtype=np.int64), np.ones(len(places), dtype=bool)
        for axis in range(len(self.count)):
            number, there = self.cells_along(axis, np.floor(places[:, axis]).astype(np.int64))
            found, inside = found * self.shape[axis] + number, inside & there
        return np.where(inside, found, -1)

    def sums(self, cells, values):
        """The sum over each cell of values (n, k) of what lies in `cells` (n): (k, cells)."""
        inside = cells >= 0
        return np.stack([np.bincount(cells[inside], column, self.size) for column in values[inside].T])

    def parts_of_lines(self, starts, ways):
        """The parts of straight lines in the cells: rows of lines, numbers of cells, and shares of the length, which add up to 1 over a line that lies inside. Lines go from places
        `starts` (n, d) along `ways` (n, d), both in cells."""
        ends = starts + ways
        low, high = np.floor(np.minimum(starts, ends)).astype(np.int64), np.floor(np.maximum(starts, ends)).astype(np.int64)
        # no side of a cell lies between the ends of the only cell of an axis
        sides = (self.count > 1) | ~(self.wraps | self.is_open)
        crosses = np.any((low != high) & sides, axis=1)
        rows, shares = [np.flatnonzero(crosses)] * 2, [np.zeros(crosses.sum()), np.ones(crosses.sum())]
        for axis in np.flatnonzero(sides):
            for line, side in pairs_of_ranges(low[:, axis] + 1, high[:, axis] + 1):
                rows.append(line)
                shares.append(np.clip((side - starts[line, axis]) / ways[line, axis], 0.0, 1.0))
        rows, shares = np.concatenate(rows), np.concatenate(shares)
        order = np.lexsort((shares, rows))
        rows, shares = rows[order], shares[order]
        same = np.flatnonzero(np.diff(rows) == 0)
        line, part, middle = rows[same], shares[same + 1] - shares[same], 0.5 * (shares[same + 1] + shares[same])
        whole = np.flatnonzero(~crosses)
        line, part = np.concatenate([whole, line]), np.concatenate([np.ones(len(whole)), part])
        middle = np.concatenate([np.full(len(whole), 0.5), middle])
        cells = self.cells(starts[line] + middle[:, None] * ways[line])
        return line[cells >= 0], cells[cells >= 0], part[cells >= 0]

    def volumes_of_balls(self, points, radii):
        """The sum over each cell of the parts of balls, disks in the plane, in it (cells) [m³, m²]. Sides of one axis cut a ball exactly; where sides of several axes do, the parts along
        these are multiplied, so that parts in all cells add up to the ball."""
        places, half = self.places(points), radii[:, None] * np.linalg.norm(self.inverse, axis=0) * self.count
        first = np.floor(places - half).astype(np.int64)
        most = np.max(np.floor(places + half).astype(np.int64) - first, axis=0, initial=0) + 1
        most[(self.count == 1) & (self.wraps | self.is_open)] = 1
        total = np.zeros(self.size)
        ball = (np.pi if len(self.count) == 2 else 4.0 / 3.0 * np.pi) * radii**len(self.count)
        step = max(1, MOST_PARTS // int(np.prod(most)))
        for begin in range(0, len(points), step):
            rows = slice(begin, begin + step)
            cells, part = np.zeros((len(ball[rows]), 1), dtype=np.int64), ball[rows, None]
            for axis, number in enumerate(most):
                along = first[rows, axis, None] + np.arange(number)
                if number == 1 and self.count[axis] == 1 and (self.wraps[axis] or self.is_open):
                    share = np.ones(along.shape)
                else:
                    sides = (first[rows, axis, None] + np.arange(number + 1) - places[rows, axis, None]) / half[rows, axis, None]
                    share = np.diff(_ball_below(sides, len(self.count)), axis=1)
                along, there = self.cells_along(axis, along)
                cells = (cells[:, :, None] * self.shape[axis] + along[:, None, :]).reshape(len(cells), -1)
                part = (part[:, :, None] * np.where(there, share, 0.0)[:, None, :]).reshape(len(cells), -1)
            total += np.bincount(cells.ravel(), part.ravel(), self.size)
        return total

    def inner(self, values):
        """Of values over all cells (..., cells) those of the cells without the ones beside them."""
        box = values.reshape(values.shape[:-1] + self.shape)
        box = box[(..., *(slice(pad, total - pad) for pad, total in zip(self.pad, self.shape)))]
        return box.reshape(values.shape[:-1] + (-1,))


def _ball_below(x, dimension):
    """The part of a ball of radius 1 below a plane at x from its centre."""
    x = np.clip(x, -1.0, 1.0)
    if dimension == 2:
        return 0.5 + (x * np.sqrt(1.0 - x * x) + np.arcsin(x)) / np.pi
    return 0.25 * (2.0 + x * (3.0 - x * x))


class Kernel:
    """Weights that smooth sums over the cells of a grid: along each axis those of a Gauss curve of a width (d) in cells, its integral over each cell, cut after REACH widths and with the
    sum 1. An axis of width 0 is not smoothed."""

    def __init__(self, width):
        self.weights = []
        for w in width:
            reach = reach_of(w)
            sides = np.array([0.5 * math.erf((k - 0.5) / (w * math.sqrt(2.0))) for k in range(-reach, reach + 2)]) if reach else np.array([0.0, 1.0])
            self.weights.append(np.diff(sides) / (sides[-1] - sides[0]))

    def smooth(self, grid, values, moments=()):
        """Values (k, cells) smoothed; with `moments` these times the way along each of these axes from the cell that they come to, in cells."""
        box = values.reshape(len(values), *grid.shape)
        for axis, weights in enumerate(self.weights):
            reach = len(weights) // 2
            factors = weights * np.arange(-reach, reach + 1.0)**list(moments).count(axis)
            found = np.zeros_like(box)
            for way, factor in zip(range(-reach, reach + 1), factors):
                if factor != 0.0:
                    # what lies `way` cells above comes here
                    found += factor * shifted(box, axis + 1, way, grid.wraps[axis])
            box = found
        return box.reshape(len(values), -1)


def reach_of(width):
    """Cells after which a kernel of a width in cells ends."""
    return int(math.ceil(REACH * width - 1e-9)) if width > 0.0 else 0


def shifted(box, axis, way, wraps):
    """What lies `way` cells above each cell along an axis, 0 beyond the ends unless the axis wraps."""
    if wraps or way == 0:
        return np.roll(box, -way, axis=axis)
    found = np.zeros_like(box)
    if abs(way) < box.shape[axis]:
        to, out_of = (slice(None, -way), slice(way, None)) if way > 0 else (slice(-way, None), slice(None, way))
        lead = (slice(None),) * axis
        found[(*lead, to)] = box[(*lead, out_of)]
    return found
