"""Where a heap or a collapsed column ends, how high it is, and the slopes of its flanks."""
import numpy as np

from .mixing import free_grains, states_since
from .shapes import ball
from .tables import ResultsError, Table

#: grains below this share, by number, may lie under the floor
LOWEST = 0.01
#: part of a full row of grains above which it belongs to a heap
FULL = 0.75
#: a flank has at least so many columns
FEWEST = 3
#: places of the first bin in which an end is looked for; places of the columns, over which slopes are means
PLACES, SHIFTS = 20, 4


def heap(run, along=None, shares=(0.1, 0.9), width=None, floor=None, since=0.0):
    """Size and slopes of a heap in each written state of a run, a row a state: step, time, height [m], front_low, front_high [m], length [m],
    run_out, angle_low, angle_high [degrees]; of a round heap in space height, length, the radius, run_out and angle.

    In space `along` is the axis "x" or "y" of a heap in a channel; without it the heap is round. Heights are those of columns of edge `width` [m], two
    mean diameters unless told, above `floor` [m], by default the lowest grains. The slope of a flank is that of the line of least squares through the
    columns between the `shares` of the height; a flank of fewer than three such columns has NaN. run_out is length over that of the first state with
    grains, less 1; states before the time `since` [s] are left out. Single grains away from the others do not count. doc/measures.md has the
    definitions."""
    round_one = _is_round(run, along)
    low, high = shares
    if not 0.0 <= low < high <= 1.0:
        raise ResultsError(f"shares {low:g} and {high:g}: expected two numbers from 0 to 1, the first one smaller")
    if width is not None and not 0.0 < width < np.inf:
        raise ResultsError(f"width {width:g}: expected a length above 0")
    names = ("height", "length", "angle") if round_one else ("height", "front_low", "front_high", "length", "angle_low", "angle_high")
    states, rows = states_since(run, since), []
    for step, _ in states:
        bodies = free_grains(run, step)
        found = _measure(run, bodies, along, (width, floor, shares)) if len(bodies) else (np.nan,) * len(names)
        rows.append(found)
    table = Table({name: np.array(values, dtype=float) for name, values in zip(names, zip(*rows))})
    known = table.length[np.isfinite(table.length)]
    if len(known) == 0:
        raise ResultsError(f"{run.path}: no written state has grains; expected a heap")
    table["run_out"] = table.length / known[0] - 1.0
    order = [*names[:names.index("length") + 1], "run_out", *names[names.index("length") + 1:]]
    return Table({"step": np.array([step for step, _ in states]), "time": np.array([time for _, time in states]), **{name: table[name] for name in order}})


def ends(place, volume, ground, layer, bins):
    """Where a layer of grains ends that begins at 0: from each of the first bins on the first bin whose grains, over its ground, are thinner than
    `layer` [m], its lower end. `place` (n) are distances from the beginning [m], `volume` (n) those of grains, `ground` gives area or length
    between 0 and a distance, `bins` the width of bins, the number of places of the first bin and the place from which bins count [m]."""
    wide, places, inner = bins
    found = []
    for first in np.arange(places) / places * wide:
        # one of more bins than grains is empty, however far away a grain is
        edges = np.arange(first, min(place.max(initial=0.0) + 3.0 * wide, first + (len(place) + 5) * wide), wide)
        thickness = np.histogram(place, edges, weights=volume)[0] / np.diff(ground(edges))
        thickness[edges[:-1] < inner] = np.inf
        found.append(edges[np.flatnonzero(thickness < layer)[0]])
    return np.array(found)


def columns(position, size, width, floor):
    """The columns of edge `width` that hold grains: their numbers along the axes of the ground, (c, d - 1), and their heights above the floor (c).
    Climbing from the floor, a column ends below the first gap that the largest grain fits into: what is above flies, or was thrown there."""
    cells, column = np.unique(np.floor(position[:, :-1] / width).astype(np.int64), axis=0, return_inverse=True)
    bottom, top = position[:, -1] - size - floor, position[:, -1] + size - floor
    order = np.lexsort((bottom, column.ravel()))
    height, gap = np.zeros(len(cells)), 2.0 * size.max()
    for number, rows in enumerate(np.split(order, np.flatnonzero(np.diff(column.ravel()[order])) + 1)):
        reached = np.maximum.accumulate(np.concatenate([[0.0], top[rows]]))
        loose = np.flatnonzero(bottom[rows] - reached[:-1] > gap)
        height[number] = reached[loose[0] if len(loose) else -1]
    return cells, height


def slope(place, height, top, shares):
    """Angle [degrees] of the line through the columns of a flank, from its upper end outwards, between the shares of the height `top`; positive where
    the flank falls, NaN where there are fewer than three columns."""
    low, high = shares
    first = np.flatnonzero(height <= high * top)
    if len(first) == 0:
        return np.nan
    below = np.flatnonzero(height[first[0]:] < low * top)
    last = first[0] + below[0] if len(below) else len(height)
    if last - first[0] < FEWEST:
        return np.nan
    return float(np.degrees(np.arctan(-np.polyfit(place[first[0]:last], height[first[0]:last], 1)[0])))


def _is_round(run, along):
    axes = "xyz"[:run.dimension - 1]
    if along is not None and along not in tuple(axes):
        raise ResultsError(f"along {along!r}: expected {' or '.join(axes)}")
    return run.dimension == 3 and along is None


def _measure(run, bodies, along, how):
    """The row of a state with grains."""
    width, floor, shares = how
    volume = run.volumes(bodies)
    # of shapes: of balls as large
    size = (volume / ball(run.dimension).volume)**(1.0 / run.dimension)
    mean = size.mean()
    width = 4.0 * mean if width is None else width
    position, axis = bodies.position, "xy".index(along or "x")
    floor = np.quantile(position[:, -1] - size, LOWEST) if floor is None else floor
    middle = _median(position[:, :-1], volume)
    # between a full row or layer of grains, each on a square of its diameter, and one grain alone in a bin
    layer = FULL * volume.mean() / (2.0 * mean)**(run.dimension - 1)
    round_one, breadth = _is_round(run, along), 1.0 if run.dimension == 2 else _breadth(run, position[:, 1 - axis], mean, 1 - axis)
    if round_one:
        place = np.linalg.norm(position[:, :-1] - middle, axis=1)
        fronts = [ends(place, volume, lambda r: np.pi * r**2, layer, (width, PLACES, 2.0 * width)).min() + mean]
    else:
        fronts = []
        for side in (-1.0, 1.0):
            place = side * (position[:, axis] - middle[axis])
            beyond = place >= 0.0
            end = ends(place[beyond], volume[beyond], lambda x: breadth * x, layer, (width, PLACES, 0.0)).min() + mean
            fronts.append(middle[axis] + side * end)
    heights, angles = [], []
    for shift in np.arange(SHIFTS) / SHIFTS * width:
        cells, height = columns(position + shift * np.append(np.ones(run.dimension - 1), 0.0), size, width, floor)
        heights.append(height.max())
        if round_one:
            ring = np.linalg.norm((cells + 0.5) * width - shift - middle, axis=1) / width
            angles.append([slope(*_profile(ring, height, (0.0, fronts[0] / width), width), height.max(), shares)])
            continue
        centre, profile = _profile(cells[:, axis], height, tuple((front + shift) / width for front in fronts), width)
        peak = int(profile.argmax())
        angles.append([slope(-centre[peak::-1], profile[peak::-1], profile[peak], shares), slope(centre[peak:], profile[peak:], profile[peak], shares)])
    return max(heights), *(fronts if round_one else (*fronts, fronts[1] - fronts[0])), *_means(angles)


def _means(rows):
    """Of each column of the rows, those that are NaN left out; NaN where all are."""
    known = np.isfinite(rows)
    count = known.sum(axis=0)
    return np.where(count > 0, np.where(known, rows, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)


def _median(place, volume):
    """Where half of the volume lies on either side, along each axis."""
    order = np.argsort(place, axis=0)
    return np.array([along[rows][np.searchsorted(np.cumsum(volume[rows]), 0.5 * volume.sum())] for along, rows in zip(place.T, order.T)])


def _breadth(run, place, mean, axis):
    """Of a channel: its period, or what the grains take up, without the outermost ones."""
    if run.period[axis] > 0.0:
        return run.period[axis]
    low, high = np.quantile(place, (LOWEST, 1.0 - LOWEST))
    return high - low + 2.0 * mean


def _profile(place, height, between, width):
    """Places and mean heights of the columns beside each other, or of rings of them, from a place to another; places in units of the width."""
    first, last = (int(np.floor(place)) for place in between)
    number = np.floor(place).astype(np.int64) - first
    inside = (number >= 0) & (number <= last - first)
    count, total = (np.bincount(number[inside], weights=weights, minlength=last - first + 1) for weights in (None, height[inside]))
    return (np.arange(first, last + 1) + 0.5) * width, total / np.maximum(count, 1)
