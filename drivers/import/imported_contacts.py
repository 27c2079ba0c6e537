"""Contacts of a DATBOX as contacts of the bodies file, from whose forces the first solve starts."""
from dataclasses import dataclass

import numpy as np
from imported_grain import Grain


@dataclass
class Start:
    """Rows of /contacts. `antagonist` is a grain, or the name of a boundary."""
    candidate: list
    antagonist: list
    normal: list
    force: list
    point: list

    def names(self):
        """Names of the boundaries, each once."""
        return list(dict.fromkeys(other for other in self.antagonist if isinstance(other, str)))

    def write(self, file):
        names = self.names()
        file["contacts/candidate"] = np.array([grain.identifier for grain in self.candidate], dtype=np.int64)
        file["contacts/antagonist"] = np.array([-1 - names.index(other) if isinstance(other, str) else other.identifier
                                                for other in self.antagonist], dtype=np.int64)
        if names:
            file["contacts/boundaries"] = np.array(["\n".join(names).encode()])
        for name in ("normal", "force", "point"):
            file[f"contacts/{name}"] = np.array(getattr(self, name))


def distance(part, point):
    """From a point to the surface of a grain that is a ball, or of a boundary with these keys; 0 of a grain with a shape."""
    if not isinstance(part, dict):
        return 0.0 if part.shape else abs(np.linalg.norm(point - part.position) - part.radius)
    way = point - np.array(part["point"])
    if part["shape"] == "circle":
        return abs(np.linalg.norm(way) - part["radius"])
    if part["shape"] == "cylinder":
        axis = np.array(part["axis"])
        return abs(np.linalg.norm(way - (way @ axis) * axis) - part["radius"])
    if part["shape"] == "plane":
        return abs(way @ np.array(part["normal"]))
    if part["shape"] == "segment":
        sides = [np.array(part["end"]) - part["point"]]
    else:
        sides = [np.array(part["edge_a"]), np.array(part["edge_b"])]
    # sides are at right angles
    return np.linalg.norm(way - sum(np.clip(way @ side / (side @ side), 0.0, 1.0) * side for side in sides))


def place_of(case, contact):
    """Where a contact is; one without a place is on the surface of its candidate, where this is a ball."""
    if np.all(np.isfinite(contact.point)):
        return contact.point[:case.dimension]
    part = next(iter(case.parts[contact.candidate]), None)
    ball = isinstance(part, Grain) and not part.shape
    return part.position - part.radius * contact.normal[:case.dimension] if ball else np.full(case.dimension, np.nan)


def start_of(case, contacts):
    """The contacts that press as rows of the bodies file; what LMGC90 has as one body is the nearest of its parts here. None where
    there are none."""
    start, d = Start([], [], [], [], []), case.dimension
    attracts = any(keys["kind"] in ("adhesive", "bonded") for keys in case.laws.met.values())
    for contact in contacts or []:
        if not (contact.along[0] > 0.0 or attracts and np.any(contact.force != 0.0)):
            continue
        point = place_of(case, contact)
        if not (np.all(np.isfinite(point)) and np.all(np.isfinite(contact.force))):
            continue
        sides = [min(case.parts[rank], key=lambda part: distance(part, point), default=None) for rank in (contact.candidate, contact.antagonist)]
        if None in sides or all(isinstance(side, dict) for side in sides):
            continue
        sense = -1.0 if isinstance(sides[0], dict) else 1.0
        candidate, antagonist = sides if sense > 0.0 else sides[::-1]
        start.candidate.append(candidate)
        start.antagonist.append(antagonist["name"] if isinstance(antagonist, dict) else antagonist)
        start.normal.append(sense * contact.normal[:d])
        start.force.append(sense * contact.force[:d])
        start.point.append(point)
    return start if start.candidate else None
