"""Where a heap or a collapsed column ends, how high it is, and the slopes of its flanks."""
import numpy as np

from .linked_grains import components, near_pairs
from .mixing import free_grains, states_since
from .shapes import ball
from .tables import ResultsError, Table
from .wall_tests import ALONG

#: grains below this share, by number, may lie under the floor
LOWEST = 0.01
#: gap up to which grains hang together, in mean diameters; breadth of the strips, or sectors at the rim, over which an end in space is a mean
LINK, STRIP = 0.5, 2.0
#: part of the breadth between walls, or of a period, from which on grains fill it
FILLED = 0.75
#: a flank has at least so many columns
FEWEST = 3
#: places of the columns, over which slopes are means
SHIFTS = 4


def heap(run, along=None, shares=(0.1, 0.9), width=None, floor=None, since=0.0):
    """Size and slopes of a heap in each written state of a run, a row a state: step, time, height [m], front_low, front_high [m], length [m],
    run_out, angle_low, angle_high [degrees]; of a round heap in space height, length, the radius, run_out and angle.

    In space `along` is the axis "x" or "y" of a heap in a channel; without it the heap is round, and one that fills a channel is refused. The heap ends
    with the last grain that hangs together with it, over gaps of at most half a mean diameter; in space this is a mean over its breadth or its rim. Heights are
    those of columns of edge `width` [m], two mean diameters unless told, above `floor` [m], by default the lowest grains. The slope of a flank is that of the
    line of least squares through the columns between the `shares` of the height; a flank of fewer than three such columns has NaN. run_out is length over
    that of the first state with grains, less 1; states before the time `since` [s] are left out. Single grains away from the others do not count.
    doc/measures.md has the definitions."""
    round_one = _is_round(run, along)
    low, high = shares
    if not 0.0 <= low < high <= 1.0:
        raise ResultsError(f"shares {low:g} and {high:g}: expected two numbers from 0 to 1, the first one smaller")
    if width is not None and not 0.0 < width < np.inf:
        raise ResultsError(f"width {width:g}: expected a length above 0")
    names = ("height", "length", "angle") if round_one else ("height", "front_low", "front_high", "length", "angle_low", "angle_high")
    states, rows = states_since(run, since), []
    if round_one:
        _check_round(run, [step for step, _ in states])
    for step, _ in states:
        bodies = free_grains(run, step)
        found = _measure(run, bodies, along, (width, floor, shares)) if len(bodies) else (np.nan,) * len(names)
        rows.append(found)
    table = Table({name: np.array(values, dtype=float) for name, values in zip(names, zip(*rows))})
    known = table.length[np.isfinite(table.length)]
    if len(known) == 0:
        raise ResultsError(f"{run.path}: no written state has grains; expected a heap")
    if floor is not None and not np.any(table.height > 0.0):
        raise ResultsError(f"{run.path}: floor {floor:g}: above all grains of all states; expected the height of the floor [m]")
    table["run_out"] = table.length / known[0] - 1.0
    order = [*names[:names.index("length") + 1], "run_out", *names[names.index("length") + 1:]]
    return Table({"step": np.array([step for step, _ in states]), "time": np.array([time for _, time in states]), **{name: table[name] for name in order}})


def heap_of(position, size, gap, images=()):
    """The rows of the grains of the heap: of the balls of radius `size` that hang together over gaps of at most `gap` [m] the ones of most volume. `images` are ways to
    images of a channel that is periodic."""
    places, sizes, rows = [position], [size], [np.arange(len(position))]
    for way in images:
        # images of what is near the lower side, at the upper one
        across = position @ way / np.dot(way, way)
        near = np.flatnonzero((across - across.min()) * np.linalg.norm(way) < 2.0 * size.max() + gap)
        places, sizes, rows = [*places, position[near] + way], [*sizes, size[near]], [*rows, near]
    rows = np.concatenate(rows)
    label = components(len(position), *(rows[pair] for pair in near_pairs(np.concatenate(places), np.concatenate(sizes), gap)))
    return np.flatnonzero(label == np.bincount(label, size**position.shape[1]).argmax())


def end(place, size, beside, strip):
    """Where the grains of a heap end that begins at 0: the mean over strips of their farthest surface. `place` (n) are distances from the beginning
    [m], `size` (n) radii, `beside` (n) where they are across, `strip` the breadth of strips; 0 for one of all."""
    low, breadth = beside.min(), np.ptp(beside)
    number = max(1, int(breadth / strip)) if strip > 0.0 else 1
    row = np.minimum((beside - low) / max(breadth, 1e-300) * number, number - 1).astype(int)
    farthest = np.full(number, -np.inf)
    np.maximum.at(farthest, row, place + size)
    return farthest[np.isfinite(farthest)].mean()


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


def _check_round(run, steps):
    """Refuse a heap as round that fills the period, or the breadth between two walls, along one horizontal axis and not along the other one."""
    sides = [_sides(run, axis) for axis in (0, 1)]
    for step in (steps[0], steps[-1]):
        bodies = free_grains(run, step)
        if len(bodies) == 0:
            continue
        mean = radii_of(run, bodies).mean()
        filled = [breadth > 0.0 and _breadth(bodies.position[:, axis], mean) > FILLED * breadth for axis, (breadth, _) in enumerate(sides)]
        if sum(filled) == 1:
            axis = filled.index(True)
            raise ResultsError(f"{run.path}: the grains fill {sides[axis][1]}, so that the heap is not round; expected --along {'xy'[1 - axis]}, along=\"{'xy'[1 - axis]}\" "
                               "in Python")


def _sides(run, axis):
    """The period, or else the distance of two walls, along an axis, 0 without either [m]; and what it is, in words."""
    name = "xyz"[axis]
    if run.period[axis] > 0.0:
        return run.period[axis], f"the period along {name}"
    rows, facing = run.boundaries(run.steps[0]), {}
    removed = [group.get("name") for group in run.case.get("boundary", []) if "remove_at" in group]
    for title, shape, normal, place in zip(rows.name, rows.shape, rows.normal, rows.position):
        if shape in ("plane", "rectangle") and title not in removed and abs(normal[axis]) > ALONG:
            facing.setdefault(normal[axis] > 0.0, []).append(place[axis])
    if len(facing) < 2:
        return 0.0, ""
    return min(facing[False]) - max(facing[True]), f"the breadth between two walls along {name}"


def radii_of(run, bodies):
    """Radii of grains; of shapes those of balls as large."""
    return (run.volumes(bodies) / ball(run.dimension).volume)**(1.0 / run.dimension)


def _measure(run, bodies, along, how):
    """The row of a state with grains."""
    width, floor, shares = how
    size = radii_of(run, bodies)
    mean = size.mean()
    width = 4.0 * mean if width is None else width
    position, axis = bodies.position, "xy".index(along or "x")
    floor = np.quantile(position[:, -1] - size, LOWEST) if floor is None else floor
    round_one = _is_round(run, along)
    across = np.eye(run.dimension)[1 - axis] * run.period[1 - axis] if run.dimension == 3 and not round_one else np.zeros(run.dimension)
    # bodies with shapes hang together by the balls that hold them
    held = heap_of(position, bodies.radius, 2.0 * LINK * mean, [across] if np.any(across) else [])
    place, radius = position[held, :-1], size[held]
    middle = _median(place, radius**run.dimension)
    if round_one:
        out = np.linalg.norm(place - middle, axis=1)
        # a disk of this radius has the same moment of inertia
        rim = np.sqrt(2.0 * np.mean(out**2))
        fronts = [end(out, radius, rim * np.arctan2(*(place - middle).T), 2.0 * STRIP * mean)]
    else:
        fronts = []
        for side in (-1.0, 1.0):
            out = side * (place[:, axis] - middle[axis])
            beyond = out >= 0.0
            beside = place[:, 1 - axis] if run.dimension == 3 else np.zeros(len(place))
            fronts.append(middle[axis] + side * end(out[beyond], radius[beyond], beside[beyond], 2.0 * STRIP * mean if run.dimension == 3 else 0.0))
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


def _breadth(place, mean):
    """What the grains take up along an axis, without the outermost ones."""
    low, high = np.quantile(place, (LOWEST, 1.0 - LOWEST))
    return high - low + 2.0 * mean


def _profile(place, height, between, width):
    """Places and mean heights of the columns beside each other, or of rings of them, from a place to another; places in units of the width."""
    first, last = (int(np.floor(place)) for place in between)
    number = np.floor(place).astype(np.int64) - first
    inside = (number >= 0) & (number <= last - first)
    count, total = (np.bincount(number[inside], weights=weights, minlength=last - first + 1) for weights in (None, height[inside]))
    return (np.arange(first, last + 1) + 0.5) * width, total / np.maximum(count, 1)
