"""Strains, void ratio and strength of a sample between walls: biaxial and triaxial tests, oedometers."""
import numpy as np

from .histories import History
from .tables import ResultsError, Table

#: a normal whose component is above this lies along an axis
ALONG = 0.99
#: part of the largest strain of a test above which a way through air is told
TOLD = 0.01


def wall_test(run, axial=None, lateral=None, mean=1, since=0.0):
    """Measures of a test whose sample lies between planes, from history.csv with boundary_forces = .true.: a row of means of `mean` steps after
    each other, or for 1 each row of history.csv, with step, time, axial_strain, lateral_strain_x, ..., volumetric_strain, void_ratio, solid_fraction, axial_stress, lateral_stress,
    stress_ratio and sin_phi.

    `axial` is the axis of the load, the last one unless told, `lateral` the axes, such as "x", whose mean stress it is compared with, all others unless
    told. Strains are shortenings over the sizes at the end of the first step after the time `since` [s], which a row of history.csv or a written state has; earlier rows are
    left out. Along periodic axes the period is the size. Stresses are those of the columns `stress_xx`, ... where history.csv has them, else forces on planes over their areas; along a
    periodic axis they need the columns. With the columns sin_phi is that of the largest and the smallest principal stress, else that of the axial and the
    lateral one, and below 0 where the axial one is smaller."""
    axes = "xyz"[:run.dimension]
    axial, lateral = _chosen_axes(axes, axial, lateral)
    if not isinstance(mean, (int, np.integer)) or mean < 1:
        raise ResultsError(f"mean {mean!r}: expected a whole number of steps above 0")
    axes, history = "xyz"[:run.dimension], run.history().after(since)
    planes = {axis: _planes(run, history, axis) for axis in axes}
    rows = _with_sizes(run, history, planes)
    if rows.steps() < mean:
        raise ResultsError(f"{run.directory}/history.csv: {rows.steps()} steps after {since:g} s; expected {mean} at least")
    start = _sizes_at_start(run, rows, planes, since)
    volume = _solid_volume(run, history)
    rows = rows if mean == 1 else rows.means(int(mean))
    size = {axis: rows[f"size_{axis}"] for axis in axes}
    found = {"step": rows.step, "time": rows.time, "axial_strain": 1.0 - size[axial] / start[axial]}
    found.update({f"lateral_strain_{axis}": 1.0 - size[axis] / start[axis] for axis in axes if axis != axial})
    box = np.prod([size[axis] for axis in axes], axis=0)
    found["volumetric_strain"] = 1.0 - box / np.prod(list(start.values()))
    found["void_ratio"], found["solid_fraction"] = box / volume - 1.0, volume / box
    found["axial_stress"] = rows[f"stress_{axial}"]
    found["lateral_stress"] = np.mean([rows[f"stress_{axis}"] for axis in lateral], axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        found["stress_ratio"] = found["axial_stress"] / found["lateral_stress"]
    found["sin_phi"] = _sine(rows, axes, found["axial_stress"], found["lateral_stress"])
    return Table(found)


def _sizes_at_start(run, rows, planes, since):
    """The sizes of the box by axis at the end of the first step after the time `since`: those of its row, or of the written state of this step."""
    first = rows.start + 1
    if rows.step[0] == first:
        return {axis: rows[f"size_{axis}"][0] for axis in planes}
    if first not in run.steps:
        known = np.union1d(run.history().step, run.steps[run.steps > 0])
        near = int(known[known < first].max(initial=1))
        raise ResultsError(f"{run.directory}/history.csv: no row and no written state of step {first}, the first one after {since:g} s, to which strains refer; expected a time before "
                           f"a step that has one, such as {_just_before(run.history(), near):.6g} s, before step {near}")
    cell, walls = run.cell(first), run.boundaries(first)
    place = dict(zip(_in_history(walls.name), walls.position))
    return {axis: place[names[1]][k] - place[names[0]][k] if names else run.period[k] if cell is None else cell.edge[k, k] for k, (axis, names) in enumerate(planes.items())}


def _just_before(history, step):
    """A time in the middle of a step, after which the step is the first one."""
    return float(history.time_of(step - 0.5))


def _sine(rows, axes, axial, lateral):
    """sin_phi of each row: of the principal stresses where there are shear stresses, else of the axial and the lateral one."""
    largest, smallest = _principal(rows, axes) if "shear_xy" in rows else (axial, lateral)
    with np.errstate(divide="ignore", invalid="ignore"):
        return (largest - smallest) / (largest + smallest)


def sine_of_means(run, options, first, since=0.0):
    """sin_phi of the mean stresses of all rows of wall_test from row `first` on, which is not the mean of a ratio; `options` are axial, lateral and mean."""
    axes, (axial, lateral, mean) = "xyz"[:run.dimension], options
    axial, lateral = _chosen_axes(axes, axial, lateral)
    history = run.history().after(since)
    rows = _with_sizes(run, history, {axis: _planes(run, history, axis) for axis in axes})
    whole = rows.steps() // mean * mean
    rows = rows.after_step(rows.start + first * mean if mean > 1 or first == 0 else rows.step[first - 1])
    rows = rows.means(whole + history.start - rows.start)
    return float(_sine(rows, axes, rows[f"stress_{axial}"], np.mean([rows[f"stress_{axis}"] for axis in lateral], axis=0))[0])


def ways_through_air(run, since=0.0):
    """Planes that bear nothing at first after the time `since` [s], and move: rows (name, time at which each first bears [s], strain until then, time from which on it is left out [s])."""
    history, found = run.history().after(since), []
    if len(history) == 0:
        return found
    planes = {axis: _planes(run, history, axis) for axis in "xyz"[:run.dimension]}
    start = _sizes_at_start(run, _with_sizes(run, history, planes), planes, since)
    for axis, names in planes.items():
        if names is None:
            continue
        strain = 1.0 - (history[f"position_{axis}:{names[1]}"] - history[f"position_{axis}:{names[0]}"]) / start[axis]
        for name in names:
            bears, place = np.flatnonzero(history[f"force_{axis}:{name}"] != 0.0), history[f"position_{axis}:{name}"]
            if len(bears) > 0 and abs(place[bears[0]] - place[0]) > TOLD * np.abs(strain).max() * start[axis]:
                step, time = history.step[bears[0]], float(history.time[bears[0]])
                later = time if step + 1 in history.step or step + 1 in run.steps else _just_before(history, step)
                found.append((name, time, float(strain[bears[0]]), later))
    return found


def stresses_from(run):
    """Where the stresses of wall_test come from, in words."""
    return "means over the contacts" if "stress_xx" in run.history() else "forces on planes"


def _principal(rows, axes):
    """The largest and the smallest principal stress of each row."""
    stress = np.zeros((len(rows), len(axes), len(axes)))
    for a, one in enumerate(axes):
        stress[:, a, a] = rows[f"stress_{one}"]
        for b, other in enumerate(axes[:a]):
            stress[:, a, b] = stress[:, b, a] = rows[f"shear_{other}{one}"]
    principal = np.linalg.eigvalsh(stress)
    return principal[:, -1], principal[:, 0]


def _chosen_axes(axes, axial, lateral):
    axial = axes[-1] if axial is None else axial
    lateral = [axis for axis in axes if axis != axial] if lateral is None else list(lateral)
    if axial not in tuple(axes) or not lateral or len(set(lateral)) < len(lateral) or not set(lateral) <= set(axes) - {axial}:
        raise ResultsError(f"axial {axial!r}, lateral {''.join(lateral)!r}: expected one of {', '.join(axes)} and others of them")
    return axial, lateral


def _planes(run, history, axis):
    """The names of the planes below and above along an axis, as in history.csv; None where the axis is periodic."""
    number = "xyz".index(axis)
    if run.period[number] > 0.0:
        return None
    rows, found = run.boundaries(), []
    removed = [group.get("name") for group in run.case.get("boundary", []) if "remove_at" in group]
    for sign in (1.0, -1.0):
        names = _in_history([name for name, shape, normal in zip(rows.name, rows.shape, rows.normal)
                             if shape == "plane" and sign * normal[number] > ALONG and name not in removed])
        if len(names) != 1:
            side = f"{'-' if sign > 0.0 else '+'}{axis}"
            raise ResultsError(f"{run.path}: {len(names)} planes on the side {side}{': ' if names else ''}{', '.join(names)}; expected one on each side, or a period")
        if f"position_{axis}:{names[0]}" not in history:
            raise ResultsError(f"{run.directory}/history.csv: no column position_{axis}:{names[0]}; &output boundary_forces = .true. writes it")
        found.append(names[0])
    return found


def _in_history(names):
    """Names of boundaries as those of columns have them."""
    return [name.replace(",", "_").replace('"', "_") for name in names]


def _with_sizes(run, history, planes):
    """Sizes of the box and stresses in each step, compression positive: normal ones along the axes and, where history.csv has them, shear stresses."""
    rows = History({"step": history.step, "time": history.time}, history.start)
    for number, (axis, names) in enumerate(planes.items()):
        if names is None:
            rows[f"size_{axis}"] = run.period[number] * np.exp(history.get(f"cell_strain_{axis}", np.zeros(len(rows))))
        else:
            rows[f"size_{axis}"] = history[f"position_{axis}:{names[1]}"] - history[f"position_{axis}:{names[0]}"]
    for axis, names in planes.items():
        if f"stress_{axis}{axis}" in history:
            rows[f"stress_{axis}"] = history[f"stress_{axis}{axis}"]
            # the two differ where grains turn ever faster
            rows.update({f"shear_{other}{axis}": 0.5 * (history[f"stress_{other}{axis}"] + history[f"stress_{axis}{other}"]) for other in planes if other < axis})
        elif names is None:
            raise ResultsError(f"{run.directory}/history.csv: no column stress_{axis}{axis}, which a periodic axis needs; &output stress = .true. writes it")
        else:
            area = np.prod([rows[f"size_{other}"] for other in planes if other != axis], axis=0)
            rows[f"stress_{axis}"] = 0.5 * (history[f"force_{axis}:{names[1]}"] - history[f"force_{axis}:{names[0]}"]) / area
    return rows


def _solid_volume(run, history):
    """Of all grains, which have to be the same in all steps [m³, m²]."""
    if np.any(history.grains != history.grains[0]):
        raise ResultsError(f"{run.directory}/history.csv: {history.grains.min():g} to {history.grains.max():g} grains; expected a test in which no grain "
                           "enters or leaves")
    return float(np.sum(run.volumes(run.bodies())))
