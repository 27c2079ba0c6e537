"""Strains, void ratio and strength of a sample between walls: biaxial and triaxial tests, oedometers."""
import numpy as np

from .tables import ResultsError, Table

#: a normal whose component is above this lies along an axis
ALONG = 0.99
#: part of the largest strain of a test above which a way through air is told
TOLD = 0.01


def wall_test(run, axial=None, lateral=None, mean=1, since=0.0):
    """Measures of a test whose sample lies between planes, from history.csv with boundary_forces = .true.: a row of means of `mean` rows after
    each other, with step, time, axial_strain, lateral_strain_x, ..., volumetric_strain, void_ratio, solid_fraction, axial_stress, lateral_stress,
    stress_ratio and sin_phi.

    `axial` is the axis of the load, the last one unless told, `lateral` the axes, such as "x", whose mean stress it is compared with, all others unless
    told. Strains are shortenings over the sizes at the end of the first step after the time `since` [s]; earlier rows are left out. Along periodic axes
    the period is the size. Stresses are those of the columns `stress_xx`, ... where history.csv has them, else forces on planes over their areas; along a
    periodic axis they need the columns. With the columns sin_phi is that of the largest and the smallest principal stress, else that of the axial and the
    lateral one, and below 0 where the axial one is smaller."""
    axes = "xyz"[:run.dimension]
    axial, lateral = _chosen_axes(axes, axial, lateral)
    if not isinstance(mean, (int, np.integer)) or mean < 1:
        raise ResultsError(f"mean {mean!r}: expected a whole number of rows above 0")
    _check_start(run, since)
    return _measures(run, axial, lateral, mean, since)


def _check_start(run, since):
    """Refuse a time of a run whose history.csv has no row of the step after it, to which strains refer."""
    history = run.history()
    steps = history.step[history.time > since]
    if len(steps) == 0:
        return
    first = int(since * history.step[-1] / history.time[-1] + 1e-6) + 1
    if steps[0] > first:
        raise ResultsError(f"{run.directory}/history.csv: no row of step {first}, the first one after {since:g} s, to which strains refer; expected one, as with "
                           "&output history_every = 1")


def _measures(run, axial, lateral, mean, since):
    """The rows of wall_test, with strains over the sizes in the first row after the time `since`."""
    axes = "xyz"[:run.dimension]
    history = _history_since(run, since)
    planes = {axis: _planes(run, history, axis) for axis in axes}
    rows = _with_sizes(run, history, planes)
    if len(rows) < mean:
        raise ResultsError(f"{run.directory}/history.csv: {len(rows)} rows after {since:g} s; expected {mean} at least")
    start = {axis: rows[f"size_{axis}"][0] for axis in axes}
    volume = _solid_volume(run, history)
    rows = rows.means(int(mean))
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
        largest, smallest = _principal(rows, axes) if "shear_xy" in rows else (found["axial_stress"], found["lateral_stress"])
        found["sin_phi"] = (largest - smallest) / (largest + smallest)
    return Table(found)


def sine_of_means(run, options, first, since=0.0):
    """sin_phi of the mean stresses of all rows of wall_test from row `first` on, which is not the mean of a ratio; `options` are axial, lateral and mean."""
    axial, lateral, mean = options
    time = run.history().time
    time = time[time > since]
    rows = len(time) // mean - first
    return float(_measures(run, *_chosen_axes("xyz"[:run.dimension], axial, lateral), rows * mean, since if first == 0 else time[first * mean - 1]).sin_phi[0])


def ways_through_air(run, since=0.0):
    """Planes that bear nothing at first after the time `since` [s], and move: rows (name, time at which each first bears [s], strain until then)."""
    history, found = _history_since(run, since), []
    for axis in "xyz"[:run.dimension]:
        names = _planes(run, history, axis)
        if names is None or len(history) == 0:
            continue
        size = history[f"position_{axis}:{names[1]}"] - history[f"position_{axis}:{names[0]}"]
        strain = 1.0 - size / size[0]
        for name in names:
            bears, place = np.flatnonzero(history[f"force_{axis}:{name}"] != 0.0), history[f"position_{axis}:{name}"]
            if len(bears) > 0 and abs(place[bears[0]] - place[0]) > TOLD * np.abs(strain).max() * size[0]:
                found.append((name, float(history.time[bears[0]]), float(strain[bears[0]])))
    return found


def stresses_from(run):
    """Where the stresses of wall_test come from, in words."""
    return "means over the contacts" if "stress_xx" in run.history() else "forces on planes"


def _history_since(run, since):
    history = run.history()
    return Table({name: values[history.time > since] for name, values in history.items()})


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
        names = [name.replace(",", "_").replace('"', "_") for name, shape, normal in zip(rows.name, rows.shape, rows.normal)
                 if shape == "plane" and sign * normal[number] > ALONG and name not in removed]
        if len(names) != 1:
            side = f"{'-' if sign > 0.0 else '+'}{axis}"
            raise ResultsError(f"{run.path}: {len(names)} planes on the side {side}{': ' if names else ''}{', '.join(names)}; expected one on each side, or a period")
        if f"position_{axis}:{names[0]}" not in history:
            raise ResultsError(f"{run.directory}/history.csv: no column position_{axis}:{names[0]}; &output boundary_forces = .true. writes it")
        found.append(names[0])
    return found


def _with_sizes(run, history, planes):
    """Sizes of the box and stresses in each step, compression positive: normal ones along the axes and, where history.csv has them, shear stresses."""
    rows = Table(step=history.step, time=history.time)
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
