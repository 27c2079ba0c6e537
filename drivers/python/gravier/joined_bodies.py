"""Bodies added to a sample: several bodies files as one, renumbered, once nothing overlaps."""
from pathlib import Path

import numpy as np
from whole_file import hdf5_file, whole_file

from .bodies_table import BodiesTable
from .linked_grains import pairs_of_ranges
from .restarts import claim_bodies_file, make_parent
from .results import BodiesFile
from .shapes import ball
from .starts import text_of
from .tables import ResultsError, Table

#: what its bodies files say of their origin
PROGRAM = "gravier.join_bodies"
#: overlap that is allowed unless told, in mean radii, as in a run; overlaps of less than the other part of two radii are rounding
LARGEST, ROUNDING = 0.01, 1e-9


def join_bodies(files, path, shift=None, above=None, overlap=None, density=None):
    """Write the bodies of several bodies files as one, `path`. The first file keeps its numbers, walls, periods and forces. The bodies of the others
    get the numbers after the largest one of its bodies and walls, in their order; their walls and forces are left out. They are moved by `shift` (d) [m]
    and, with `above`, so far along the last axis that the lowest point of their enclosing balls is `above` [m] over the highest one of the bodies before.
    Disks and spheres of different files that overlap by more than `overlap` [m], or reach as far behind a wall, are refused; unless told it is a hundredth of
    the mean radius of the first file, as in a run. Bodies without a mass, in a file beside others that have some, have that of `density`. A file that
    is there is replaced where this function has made it.

    Returns a table with a row a file: file, first and last number of its bodies, walls and forces that are left out, and near, the number of pairs of
    enclosing balls that meet where one of the two bodies has a shape."""
    read = [opened_file(one) for one in files]
    if len(read) < 2:
        raise ResultsError(f"{len(read)} bodies files; expected two at least")
    claim_bodies_file(path, PROGRAM, *(one.path for one in read))
    _check(read, shift, above, overlap, density)
    first = read[0]
    parts = [dict(first.bodies())]
    walls = first.boundaries()
    overlap = LARGEST * parts[0]["radius"].mean() if overlap is None else overlap
    last = max(parts[0]["id"].max(initial=0), walls.id.max(initial=0))
    rows = [(str(first.path), parts[0]["id"].min(), parts[0]["id"].max(), 0, 0, 0)]
    for one in read[1:]:
        part = dict(one.bodies())
        part["position"] = part["position"] + _move(parts, part, shift, above)
        part["id"] = last + 1 + np.arange(len(part["id"]))
        near = _compare(read, parts, part, one, overlap)
        _compare_walls(first, walls, part, one, overlap)
        rows.append((str(one.path), last + 1, part["id"][-1], len(one.boundaries()), _count_contacts(one), near))
        last = part["id"][-1]
        parts.append(part)
    _write(read, path, _merged(read, parts, density))
    return Table({name: np.array(values) for name, values in zip(("file", "first", "last", "walls", "forces", "near"), zip(*rows))})


def opened_file(path):
    """A bodies file, .h5 or .csv, to be read."""
    return path if isinstance(path, BodiesFile) else BodiesTable(Path(path)) if Path(path).suffix == ".csv" else BodiesFile(path)


def _check(read, shift, above, overlap, density):
    """Refuse figures and files that do not fit together."""
    dimension = read[0].dimension
    if shift is not None and (np.shape(shift) != (dimension,) or not np.isfinite(shift).all()):
        raise ResultsError(f"shift {shift}: expected {dimension} numbers")
    if above is not None and not np.isfinite(above):
        raise ResultsError(f"above {above}: expected a number")
    if overlap is not None and not 0.0 <= overlap < np.inf:
        raise ResultsError(f"overlap {overlap:g}: expected a length of 0 or more")
    if density is not None and not 0.0 < density < np.inf:
        raise ResultsError(f"density {density:g}: expected a number above 0")
    for one in read[1:]:
        if one.dimension != dimension:
            raise ResultsError(f"{one.path}: bodies in {one.dimension}D; expected {dimension}D, as in {read[0].path}")
        period = getattr(one, "period", np.zeros(dimension))
        if np.any(period > 0.0) and not np.array_equal(period, getattr(read[0], "period", np.zeros(dimension))):
            raise ResultsError(f"{one.path}: periods of another size than those of {read[0].path}; expected the same, or none")
    if not all(len(one.bodies()) for one in read):
        raise ResultsError(f"{next(one for one in read if not len(one.bodies())).path}: no body; expected one at least")


def _move(parts, part, shift, above):
    """The way of the bodies of a file."""
    way = np.zeros(part["position"].shape[1]) if shift is None else np.array(shift, dtype=float)
    if above is not None:
        top = max(np.max(held["position"][:, -1] + held["radius"]) for held in parts)
        way[-1] = top + above - np.min(part["position"][:, -1] - part["radius"])
    return way


def _shaped(part):
    return part.get("shape", np.zeros(len(part["id"]), dtype=int)) > 0


def _compare(read, parts, part, one, overlap):
    """Refuse disks and spheres that overlap with those of the files before; the number of pairs of enclosing balls that do, where one body has
    a shape."""
    near, found = 0, []
    for held, other in zip(read, parts):
        depth, i, j = _overlaps(part, other, _images(read[0]), overlap)
        round_ones = ~(_shaped(part)[i] | _shaped(other)[j])
        near += int(np.sum(~round_ones))
        found += [(d, part["id"][a], held, other["id"][b]) for d, a, b in zip(depth[round_ones], i[round_ones], j[round_ones])]
    if found:
        depth, number, held, with_number = max(found, key=lambda pair: pair[0])
        row = int(number - part["id"][0])
        raise ResultsError(f"{one.path}: body {one.bodies().id[row]} overlaps body {with_number} of {held.path} by {depth:.3g} m, the deepest of {len(found)} "
                           f"overlap{'s' if len(found) > 1 else ''}; expected bodies apart, which a shift may bring about")
    return near


def _images(first):
    """Ways to the images of a body in the periods of the first file."""
    if not isinstance(first, BodiesFile):
        return [np.zeros(first.dimension)]
    edges, ways = first._edges(None), [np.zeros(first.dimension)]
    for edge in edges:
        ways = [way + k * edge for way in ways for k in (-1, 0, 1)]
    return ways


def _overlaps(part, other, ways, allowed):
    """Pairs of bodies of two tables that overlap by more than is allowed: depth [m], rows in either table. Bodies outside the box of the others,
    and those that are too far apart along x, are passed over."""
    found = [(np.zeros(0), np.zeros(0, dtype=int), np.zeros(0, dtype=int))]
    for way in ways:
        mine = _near_box(part["position"] + way, part["radius"], other["position"], other["radius"])
        theirs = _near_box(other["position"], other["radius"], part["position"][mine] + way, part["radius"][mine])
        theirs = theirs[np.argsort(other["position"][theirs, 0])]
        place, there, radius = part["position"][mine] + way, other["position"][theirs], other["radius"][theirs]
        if len(mine) == 0 or len(theirs) == 0:
            continue
        reach = part["radius"][mine] + radius.max()
        low, high = (np.searchsorted(there[:, 0], place[:, 0] + sign * reach) for sign in (-1.0, 1.0))
        for i, j in pairs_of_ranges(low, high):
            both = part["radius"][mine[i]] + radius[j]
            depth = both - np.linalg.norm(place[i] - there[j], axis=1)
            deep = depth > allowed + ROUNDING * both
            found.append((depth[deep], mine[i[deep]], theirs[j[deep]]))
    return tuple(np.concatenate(columns) for columns in zip(*found))


def _near_box(place, radius, others, others_radius):
    """Rows of the bodies that reach into the box of others."""
    if len(others) == 0:
        return np.zeros(0, dtype=int)
    low, high = (others - others_radius[:, None]).min(axis=0), (others + others_radius[:, None]).max(axis=0)
    return np.flatnonzero(np.all((place + radius[:, None] > low) & (place - radius[:, None] < high), axis=1))


def _compare_walls(first, walls, part, one, overlap):
    """Refuse disks and spheres that reach behind a wall."""
    for number, point, normal in zip(walls.id, walls.position, walls.normal):
        depth = np.where(_shaped(part), -np.inf, part["radius"] - (part["position"] - point) @ normal)
        row = int(np.argmax(depth))
        if depth[row] > overlap + ROUNDING * part["radius"][row]:
            raise ResultsError(f"{one.path}: body {one.bodies().id[row]} reaches {depth[row]:.3g} m behind wall {number} of {first.path}; expected bodies on its free side")


def _count_contacts(one):
    if isinstance(one, BodiesTable):
        return 0
    with one._open() as file:
        return len(file["contacts/candidate"]) if "contacts" in file else 0


def _merged(read, parts, density):
    """The columns of all bodies, {name: values}, and the names of their shapes."""
    dimension = read[0].dimension
    spins = 2 * dimension - 3
    columns = {"id": np.concatenate([part["id"] for part in parts]).astype(np.int64)}
    for name in ("position", "radius"):
        columns[name] = np.concatenate([part[name] for part in parts])
    columns["velocity"] = np.concatenate([np.concatenate([part[key] if key in part else np.zeros((len(part["id"]), count)) for key, count in
                                                          (("velocity", dimension), ("spin", spins))], axis=1) for part in parts])
    if any("mass" in part for part in parts):
        columns["mass"] = np.concatenate([_masses(one, part, density) for one, part in zip(read, parts)])
    for name, default in (("group", 0), ("material", 1)):
        if any(np.any(part.get(name, default) != default) for part in parts):
            columns[name] = np.concatenate([part.get(name, np.full(len(part["id"]), default)) for part in parts]).astype(np.int64)
    if any(np.any(_shaped(part)) for part in parts):
        columns.update(_shape_columns(read, parts))
    return columns


def _masses(one, part, density):
    if "mass" in part:
        return part["mass"]
    if density is None or np.any(_shaped(part)):
        raise ResultsError(f"{one.path}: no masses; expected masses in all files or in none, or a density for its disks or spheres")
    return density * ball(one.dimension).volume * part["radius"]**one.dimension


def _shape_columns(read, parts):
    """Numbers of shapes by common names, and orientations, which all shapes have to have along the same axes."""
    names, numbers, turns, axes = [], [], [], {}
    width = 1 if read[0].dimension == 2 else 4
    for one, part in zip(read, parts):
        number, turn = np.zeros(len(part["id"]), dtype=np.int64), np.tile(np.eye(4)[0] if width == 4 else [0.0], (len(part["id"]), 1))
        if np.any(_shaped(part)):
            with one._open() as file:
                own = text_of(file["bodies/shape"].attrs["names"]).split(",")
                if "orientation" in part:
                    turn = part["orientation"].reshape(-1, width)
                    axes.setdefault(text_of(file["bodies/orientation"].attrs.get("axes", "written")), one.path)
            names += [name for name in own if name not in names]
            number = np.array([0, *(names.index(name) + 1 for name in own)])[part["shape"]]
        numbers.append(number)
        turns.append(turn)
    if len(axes) > 1:
        raise ResultsError(f"{', '.join(f'{path}: orientations of {kind} axes' for kind, path in axes.items())}; expected one kind, as in files of gravier_sample "
                           "and final_bodies")
    return {"shape": np.concatenate(numbers), "orientation": np.concatenate(turns), "names": ",".join(names), "axes": next(iter(axes), "written")}


def _write(read, path, columns):
    """Bodies, and of the first file all the rest."""
    first = read[0]
    names, axes = columns.pop("names", None), columns.pop("axes", None)
    make_parent(path)
    with whole_file(path) as part, hdf5_file(part, PROGRAM) as file:
        for name, values in columns.items():
            file[f"bodies/{name}"] = values
        if names is not None:
            file["bodies/shape"].attrs["names"] = np.bytes_(names)
            if axes != "written":
                file["bodies/orientation"].attrs["axes"] = np.bytes_(axes)
        if isinstance(first, BodiesFile):
            with first._open() as old:
                for name in old:
                    if name != "bodies":
                        old.copy(name, file)
            return
        walls = first.boundaries()
        if len(walls):
            file["walls/id"], file["walls/point"], file["walls/normal"] = walls.id, walls.position, walls.normal
