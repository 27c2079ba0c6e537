"""Rough walls of glued grains from the sides of a sample."""
import numpy as np
from whole_file import hdf5_file, whole_file

from .restarts import claim_bodies_file, make_parent
from .results import BodiesFile
from .tables import ResultsError

#: what its bodies files say of their origin
PROGRAM = "gravier.rough_walls"
#: a normal whose component is above this lies along an axis
ALONG = 0.99


def rough_walls(sample, path, sides, depth=None):
    """Write the bodies file `sample` as `path`, with rough walls of its own grains in the place of planes. `sides` has the group of each side,
    {"-y": 1, "+y": 2}: it goes to the grains whose centres are nearer to the plane on that side than `depth` [m], the mean diameter unless told.
    The plane is left out, and so are the forces of contacts with it and within a group. Returns the number of grains of each side. In the case
    of the next run each group needs a &boundary of shape 'grains'. A file that is there is replaced where this function has made it."""
    bodies = BodiesFile(sample)
    claim_bodies_file(path, PROGRAM, bodies.path)
    table, planes = bodies.bodies(), bodies.boundaries()
    depth = 2.0 * table.radius.mean() if depth is None else depth
    if not depth > 0.0:
        raise ResultsError(f"depth = {depth}: expected a length above 0")
    group = table.group.copy() if "group" in table else np.zeros(len(table), dtype=np.int64)
    chosen = {side: _plane(bodies, planes, side) for side in sides}
    found = {}
    for side, number in sides.items():
        if not (isinstance(number, (int, np.integer)) and number > 0):
            raise ResultsError(f"{side}: group {number!r}: expected a whole number above 0")
        plane = chosen[side]
        near = (table.position - planes.position[plane]) @ planes.normal[plane] < depth
        if np.any(near & (group > 0)):
            raise ResultsError(f"{bodies.path}: grains near {side} are in group {group[near].max()} already; expected sides farther apart, or a smaller depth")
        if not np.any(near):
            raise ResultsError(f"{bodies.path}: no grain nearer to {side} than {depth:g} m; expected a larger depth")
        group[near] = number
        found[side] = int(np.sum(near))
    _write(bodies, path, table.id, group, list(chosen.values()))
    return found


def _plane(bodies, planes, side):
    """The row of the plane on a side."""
    axes = "xyz"[:bodies.dimension]
    if not (isinstance(side, str) and len(side) == 2 and side[0] in "+-" and side[1] in axes):
        raise ResultsError(f"side {side!r}: expected + or - and one of {', '.join(axes)}")
    inward = planes.normal[:, axes.index(side[1])] * (1.0 if side[0] == "-" else -1.0)
    found = np.flatnonzero(inward > ALONG)
    if len(found) != 1:
        raise ResultsError(f"{bodies.path}: {len(found)} planes on the side {side}; expected one")
    return found[0]


def _write(bodies, path, numbers, group, removed):
    """Copy what stays as it is; grains get groups, planes `removed` and their contacts go."""
    make_parent(path)
    with bodies._open() as old, whole_file(path) as part, hdf5_file(part, PROGRAM) as file:
        for name in old:
            if name not in ("walls", "contacts"):
                old.copy(name, file)
        if "group" in file["bodies"]:
            del file["bodies/group"]
        file["bodies/group"] = group
        gone = old["walls/id"][()][removed]
        stays = ~np.isin(old["walls/id"][()], gone)
        if np.any(stays):
            for name, values in old["walls"].items():
                file[f"walls/{name}"] = values[()][stays]
        if "contacts" in old:
            _write_contacts(old["contacts"], file, dict(zip(numbers, group)), {f"wall {number}" for number in gone})


def _write_contacts(contacts, file, group_of, gone):
    """Contacts whose boundary stays and whose grains are not both in one group."""
    names = contacts["boundaries"][0].decode(errors="replace").split("\n") if "boundaries" in contacts else []
    left = [name for name in names if name not in gone]
    place = {-1 - k: -1 - left.index(name) for k, name in enumerate(names) if name in left}
    candidate, antagonist = contacts["candidate"][()], contacts["antagonist"][()]
    keep = np.array([other in place if other < 0 else not 0 < group_of[one] == group_of[other] for one, other in zip(candidate, antagonist)], dtype=bool)
    if not np.any(keep):
        return
    for name, values in contacts.items():
        if name not in ("boundaries", "antagonist"):
            file[f"contacts/{name}"] = values[()][keep]
    file["contacts/antagonist"] = np.array([place.get(other, other) for other in antagonist[keep]], dtype=np.int64)
    file["contacts/boundaries"] = np.array(["\n".join(left).encode() or b" "])
