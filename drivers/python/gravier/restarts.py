"""Bodies files from states of a run, from which other runs start."""
from pathlib import Path

import numpy as np
from whole_file import Misplaced, check_place, hdf5_file, whole_file

from .tables import ResultsError

#: what its bodies files say of their origin
PROGRAM = "gravier.write_bodies"


def claim_bodies_file(path, program, *sources):
    """Refuse a path at which a bodies file of `program`, made from `sources`, is not to be written."""
    try:
        check_place(path, dict.fromkeys((".h5", ".hdf5"), program), sources)
    except Misplaced as refused:
        raise ResultsError(str(refused)) from None


def make_parent(path):
    """Make the directory of a file, if need be."""
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
    except OSError as what:
        raise ResultsError(f"{path}: {what.strerror}; expected a place for a file") from None


def given_contacts(run, step=None):
    """Contacts of a state with their forces, as the group /contacts of a bodies file has them: (datasets by name, names of boundaries).
    Forces are impulses over the time step."""
    bodies, contacts, boundaries = run.bodies(step), run._contacts_or_error(step), run.boundaries(step)
    forces = run.forces(step)
    known = np.isin(contacts.antagonist, bodies.id)
    place = {number: -1 - k for k, number in enumerate(boundaries.id)}
    antagonist = np.array([other if body else place[other] for other, body in zip(contacts.antagonist, known)], dtype=np.int64)
    # the bodies of the file are where they are at the end of the step
    rows, _ = run._rows(bodies, contacts)
    point = contacts.point if "point" in contacts else \
        bodies.position[rows] - (bodies.radius[rows] + 0.5 * contacts.gap)[:, None] * contacts.normal
    found = {"candidate": contacts.candidate, "antagonist": antagonist, "normal": contacts.normal, "force": forces.force, "point": point}
    if "moment" in forces:
        found["moment"] = forces.moment
    if "elongation" in contacts:
        found["elongation"] = contacts.elongation
    # what bears nothing starts from nothing
    bears = np.any(forces.force != 0.0, axis=1)
    return {name: values[bears] for name, values in found.items()}, list(boundaries.name)


def walls_of_bodies(run, boundaries, step=None):
    """Rows of the boundaries of a state that are walls of the bodies: those that no &boundary is, and of those that one is what has not been
    removed."""
    groups = run.case.get("boundary", [])
    own = len(boundaries) - len(groups)
    # a boundary is removed in the first step that begins at its time or later
    begun = run.time(step) - (1.0 - 1e-6) * run.time_step()
    return [*range(own), *(own + k for k, group in enumerate(groups) if group.get("shape") == "wall" and group.get("remove_at", np.inf) > begun)]


def write_bodies(run, path, step=None):
    """Write a state of a run of disks or spheres as a bodies file with the forces of its contacts, for another run. Boundaries and periods of
    the input of that run are its own; walls of the bodies, where they are in this state, and periods of a bodies file are in this one, and
    the edges of a cell that moves with their velocities. A file that is there is replaced where this function has made it."""
    claim_bodies_file(path, PROGRAM, run.path)
    if run.shapes() or any(boundary.get("shape") == "grains" for boundary in run.case.get("boundary", [])):
        raise ResultsError(f"{run.path}: bodies with shapes or grains glued to boundaries: expected disks or spheres; final_forces = .true. of "
                           "&output writes such a file of the last state")
    bodies, boundaries, cell = run.bodies(step), run.boundaries(step), run.cell(step)
    contacts, names = given_contacts(run, step)
    make_parent(path)
    with whole_file(path) as part, hdf5_file(part, PROGRAM) as file:
        for name in ("id", "position", "radius", "mass", "material"):
            if name in bodies:
                file[f"bodies/{name}"] = bodies[name]
        spins = 2 * run.dimension - 3
        spin = bodies.spin if bodies.spin.size else np.zeros((len(bodies), spins))
        file["bodies/velocity"] = np.concatenate([bodies.velocity, spin], axis=1)
        walls = walls_of_bodies(run, boundaries, step)
        names = [f"wall {boundaries.id[k]}" if k in walls else name for k, name in enumerate(names)]
        if walls:
            file["walls/id"], file["walls/point"], file["walls/normal"] = (boundaries[key][walls] for key in ("id", "position", "normal"))
        if cell is not None:
            file["box/origin"], file["box/period"] = cell.origin[:, 0], np.diag(cell.edge)
            file["box/edge"], file["box/velocity"] = cell.edge, cell.velocity
        elif np.any(run.period > 0.0) and "period" not in run.case.get("scene", [{}])[0]:
            file["box/origin"], file["box/period"] = run.origin, run.period
        if len(contacts["candidate"]):
            for name, values in contacts.items():
                file[f"contacts/{name}"] = values
            file["contacts/boundaries"] = np.array(["\n".join(names).encode()])
