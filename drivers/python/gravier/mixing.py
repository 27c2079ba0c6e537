"""How well two kinds of grains are mixed: Lacey's index over cells, and which kind lies higher."""
import numpy as np

from .tables import ResultsError, Table

#: edge of the cells in mean diameters, in the plane and in space: about 20 grains lie in a cell of a dense bed
CELL = {2: 5.0, 3: 3.5}
#: heights farther than so many interquartile ranges from the quartiles are those of stray grains
FENCE = 3.0
#: part of the range of radii below which a gap between two kinds is none
GAP = 0.1


def mixing(run, by="size", value=None, cell=None, since=0.0):
    """Mixing and segregation of two kinds of grains in each written state of a run, a row a state: step, time, mixing, height_difference [m],
    segregation, share (of the first kind, by number), grains, cells.

    `by` says what the first kind is: "size": grains with radii above `value` [m], by default the mean of the least and the largest radius;
    "material": grains of the material `value`, a name or a number, by default 2; "x", "y" or "z": grains whose coordinate in the first state is above
    `value` [m], by default the median. `cell` is the edge of the cells [m], 5 mean diameters in the plane and 3.5 in space unless told; diameters
    are those of the first state. States before the time `since` [s] are left out, and the first state is the first one with grains. Grains
    glued to boundaries do not count. A state that does not hold both kinds has NaN. doc/measures.md has the formulae."""
    rows, is_first = [], None
    for step, time in states_since(run, since):
        bodies = free_grains(run, step)
        volume = run.volumes(bodies)
        if is_first is None and len(bodies):
            is_first = _kind(run, step, bodies, by, value)
            cell = _cell(run, bodies, cell)
        chosen = is_first(bodies) if is_first else np.zeros(0, dtype=bool)
        if chosen.all() or not chosen.any():
            rows.append((step, time, np.nan, np.nan, np.nan, np.nan, len(bodies), 0))
            continue
        _, number = np.unique(np.floor(bodies.position / cell).astype(np.int64), axis=0, return_inverse=True)
        rows.append((step, time, lacey(number.ravel(), chosen), *heights(bodies.position[:, -1], volume, chosen, bodies.radius.mean()),
                     chosen.mean(), len(bodies), number.max() + 1))
    if not any(np.isfinite(row[5]) for row in rows):
        raise ResultsError(f"{run.path}: {_only_kind(run, by, value, since)}")
    names = ("step", "time", "mixing", "height_difference", "segregation", "share", "grains", "cells")
    return Table({name: np.array(values) for name, values in zip(names, zip(*rows))})


def split_radius(run, value=None, since=0.0):
    """The radius [m] above which grains are of the first kind by size, and whether radii are spread on both sides of it without a gap, so that it divides one
    range of sizes and not two kinds."""
    bodies = next(bodies for bodies in (free_grains(run, step) for step, _ in states_since(run, since)) if len(bodies))
    limit = _size_limit(bodies, value)
    below, above = bodies.radius[bodies.radius <= limit], bodies.radius[bodies.radius > limit]
    return limit, len(below) > 0 and len(above) > 0 and above.min() - below.max() < GAP * (bodies.radius.max() - bodies.radius.min())


def states_since(run, since):
    """Step and time of the written states from a time on [s], which rounding may miss."""
    found = [(step, time) for step, time in zip(run.steps, run.times) if time >= since - 1e-9 * max(abs(since), time)]
    if not found:
        raise ResultsError(f"{run.path}: no written state from {since:g} s on; expected a time of at most {max(run.times, default=0.0):g} s")
    return found


def free_grains(run, step):
    """The bodies of a state that are not glued to a boundary."""
    bodies = run.bodies(step)
    if "boundary" not in bodies:
        return bodies
    return Table({name: values[bodies.boundary == 0] for name, values in bodies.items()})


def lacey(number, chosen):
    """Lacey's index of n grains in cells, from the number of the cell of each and from whether it is of the first kind: (s0² - s²)/(s0² - sr²). s²
    is the variance of the share of the first kind among the cells, each weighted by its grains, so that cells of few grains count little;
    s0² = p (1 - p) is that of separate kinds, sr² = p (1 - p)(C - 1)/(n - 1) that which is to be expected of n grains dealt out at random to C cells."""
    n, p = len(number), np.mean(chosen)
    count = np.bincount(number)
    count, first = count[count > 0], np.bincount(number, weights=chosen)[count > 0]
    if len(count) in (1, n):
        return np.nan
    separate = p * (1.0 - p)
    return float((separate - np.sum((first - p * count)**2 / count) / n) / (separate * (1.0 - (len(count) - 1) / (n - 1))))


def heights(height, volume, chosen, radius):
    """The height of the centre of mass of the first kind less that of the second [m], by volume, and this over its size where the first kind fills
    the upper, or if it is below 0 the lower part of the same bed: 1 if it lies above the second kind, -1 below it. Heights far outside the others do not count: those that are
    farther from the quartiles than FENCE interquartile ranges, or as many mean diameters where these are more."""
    low, high = np.quantile(height, (0.25, 0.75))
    margin = FENCE * max(high - low, 2.0 * radius)
    near = (height >= low - margin) & (height <= high + margin)
    height, volume, chosen = height[near], volume[near], chosen[near]
    if chosen.all() or not chosen.any():
        return np.nan, np.nan
    first, both = np.sum(volume[chosen]), np.sum(volume)
    difference = np.sum((height * volume)[chosen]) / first - np.sum((height * volume)[~chosen]) / (both - first)
    # the volume of each grain that is in the upper or lower part of the bed, whose volume is that of the first kind
    order = np.argsort(height if difference < 0.0 else -height)
    part = np.clip(first - np.cumsum(volume[order]) + volume[order], 0.0, volume[order])
    largest = np.sum(height[order] * part) / first - np.sum(height[order] * (volume[order] - part)) / (both - first)
    return difference, difference / abs(largest) if largest != 0.0 else np.nan


def _kind(run, step, bodies, by, value):
    """The function that finds the grains of the first kind among bodies; `bodies` are the free ones of the first state, which is that of `step`."""
    if by == "material":
        number = _material(run, value)
        return lambda held: held.material == number
    if by == "size":
        limit = _size_limit(bodies, value)
        return lambda held: held.radius > limit
    axes = "xyz"[:run.dimension]
    if by not in tuple(axes):
        raise ResultsError(f"by {by!r}: expected one of size, material, {', '.join(axes)}")
    limit, known = np.median(bodies.position[:, axes.index(by)]) if value is None else _number(value, by), run.bodies(step)
    above = known.id[known.position[:, axes.index(by)] > limit]

    def is_above(held):
        late = held.id[~np.isin(held.id, known.id)]
        if len(late):
            raise ResultsError(f"{run.path}: grain {late[0]} has entered after the first state, of step {step}, and has no place {by} in it; expected mixing by size or material, or "
                               "a time since at which all grains are there")
        return np.isin(held.id, above)

    return is_above


def _only_kind(run, by, value, since):
    """What all grains of the written states share, so that they are of one kind, and what was expected."""
    states = [bodies for bodies in (free_grains(run, step) for step, _ in states_since(run, since)) if len(bodies)]
    if not states:
        return "no written state has grains; expected grains of two kinds"
    if by == "material":
        names = [group.get("name") for group in run.case.get("material", [])]
        found = [names[number - 1] for number in np.unique(np.concatenate([bodies.material for bodies in states]))]
        return f"the grains of each written state are of one kind, of the materials {', '.join(found)}; expected grains of material {names[_material(run, value) - 1]} and others together"
    values, what = (states[0].position[:, "xyz".index(by)], f"began at {by} =") if by in tuple("xyz") else (np.concatenate([bodies.radius for bodies in states]), "have radii of")
    low, high = values.min(), values.max()
    if value is None and low == high:
        return f"all grains {what} {low:.6g} m; expected two sizes or places, or another of --by size, material, {', '.join('xyz'[:run.dimension])}"
    return f"the grains of each written state are of one kind, and {what} {low:.6g} to {high:.6g} m; expected a value that divides them" + ("" if value is None else f", and not {value}")


def _size_limit(bodies, value):
    return 0.5 * (bodies.radius.min() + bodies.radius.max()) if value is None else _number(value, "radius")


def _material(run, value):
    """The number of a material, from its name or its number."""
    names = [group.get("name") for group in run.case.get("material", [])]
    if value is None and len(names) > 1:
        return 2
    if value in names:
        return names.index(value) + 1
    try:
        number = int(value)
    except (TypeError, ValueError):
        number = 0
    if not 1 <= number <= len(names):
        case = f"a case whose only material is {names[0]}" if len(names) == 1 else "a case without &material, whose grains are of one material"
        if len(names) < 2:
            raise ResultsError(f"{run.path}: mixing by material of {case}; expected a second &material, or mixing by size or by {', '.join('xyz'[:run.dimension])}, where grains were at the start")
        raise ResultsError(f"{run.path}: material {value!r}; expected one of {', '.join(map(str, names))}")
    return number


def _number(value, what):
    try:
        found = float(value)
    except (TypeError, ValueError):
        found = np.nan
    if not np.isfinite(found):
        raise ResultsError(f"{what} {value!r}: expected a number")
    return found


def _cell(run, bodies, cell):
    if cell is None:
        return CELL[run.dimension] * 2.0 * bodies.radius.mean()
    if not 0.0 < _number(cell, "cell") < np.inf:
        raise ResultsError(f"cell {cell!r}: expected a length above 0")
    return float(cell)
