"""Which grains are near each other, and which of them hang together."""
import itertools

import numpy as np

#: pairs of grains that are compared at a time
MOST_PAIRS = 2000000


def near_pairs(position, radius, gap):
    """Pairs of balls whose gap is at most `gap` [m]: rows in either array, each pair once or twice. `position` (n, d), `radius` (n).

    Balls of a class, whose radii are within a factor of two, look for those of their class and of smaller ones, in cells as large as their reach."""
    level = np.floor(np.log2(radius / radius.min())).astype(int)
    found = [(np.zeros(0, dtype=int), np.zeros(0, dtype=int))]
    for chosen in np.unique(level):
        among = np.flatnonzero(level <= chosen)
        found += _pairs_of_level(position[among], radius[among], level[among] == chosen, gap, among)
    return tuple(np.concatenate(rows) for rows in zip(*found))


def pairs_of_ranges(low, high):
    """Rows i, and the rows j from low[i] on that are below high[i], as pairs (i, j), about MOST_PAIRS at a time."""
    counts = high - low
    for rows in np.split(np.arange(len(counts)), np.flatnonzero(np.diff(np.cumsum(counts) // MOST_PAIRS)) + 1):
        i = np.repeat(rows, counts[rows])
        yield i, np.arange(len(i)) - np.repeat(np.cumsum(counts[rows]) - counts[rows], counts[rows]) + np.repeat(low[rows], counts[rows])


def components(count, i, j):
    """The lowest row that each of `count` rows hangs together with by pairs (i, j) of rows."""
    label = np.arange(count)
    while True:
        one, other = label[i], label[j]
        if np.array_equal(one, other):
            return label
        np.minimum.at(label, np.maximum(one, other), np.minimum(one, other))
        while not np.array_equal(label, label[label]):
            label = label[label]


def _pairs_of_level(position, radius, own, gap, number):
    """near_pairs of the balls of a class with all that are given, which are not larger than they; `number` are the rows of these."""
    edge = 2.0 * radius.max() + gap
    cell = np.stack([_compressed(np.floor(along / edge)) for along in position.T], axis=1)
    stride = np.append(np.cumprod((cell.max(axis=0) + 2)[:0:-1])[::-1], 1)
    key = cell @ stride
    # those of a cell after each other in memory
    order = np.argsort(key, kind="stable")
    key, position, radius, number = key[order], position[order], radius[order], number[order]
    rows, found = np.flatnonzero(own[order]), []
    # the cells beside each other along the last axis have keys after each other
    for offset in itertools.product((-1, 0, 1), repeat=position.shape[1] - 1):
        target = key[rows] + np.dot(offset, stride[:-1])
        for place, j in pairs_of_ranges(np.searchsorted(key, target - 1, "left"), np.searchsorted(key, target + 1, "right")):
            i = rows[place]
            way = position[i] - position[j]
            near = (np.einsum("nd,nd->n", way, way) <= (radius[i] + radius[j] + gap)**2) & (i != j)
            found.append((number[i[near]], number[j[near]]))
    return found


def _compressed(cell):
    """Numbers of cells along an axis from 1 on, with empty ones between them left out but one, so that a ball far away makes no large number."""
    known, place = np.unique(cell, return_inverse=True)
    return (1 + np.concatenate([[0], np.cumsum(np.minimum(np.diff(known), 2.0))]).astype(np.int64))[place.ravel()]
