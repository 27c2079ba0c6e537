"""Walls of a DATBOX as boundaries: their surfaces, and the motion that drives prescribe."""
import numpy as np
from body_shapes import ShapeOfBody
from datbox import HULLS, ROUND
from datbox_drives import Function
from imported_grain import Grain


def motion(case, body, whole):
    """Keys of the boundary of a body, from its drives. `whole`: it is one boundary, so that forces may move it."""
    d = case.dimension
    keys, columns = {}, {}
    names = ("vx vy omega" if d == 2 else "vx vy vz wx wy wz").split()
    velocity, free, force = [0.0] * len(names), [False] * d, case.gravity[:d] * 0.0
    mass = case.bulks.mass_of(body)
    swing, swings = [0.0] * len(names), None
    for k, name in enumerate(names):
        kind, function, entry = body.drives.get(k + 1, ("force", Function(), body.start))
        # the first wave is the one that the boundary can have; others are tables, as are rotations about axes of a body in space
        if kind == "vlocy" and function.wave and (k < d or d == 2) and swings in (None, function.wave[2:]):
            velocity[k], amplitude, *swings = function.wave
            swings = tuple(swings)
            swing[k] = amplitude / swings[0]
            continue
        if function.until is not None:
            case.remarks.append(f"formulas of drives are written up to the last step, {function.until:g} s, and constant afterwards: import with "
                                "more --steps for a longer run")
        if kind == "vlocy":
            if function.table is None:
                velocity[k] = function.constant
            else:
                columns[name] = function
            continue
        if k >= d:
            entry.refuse(f"body {body.rank} ({body.contactors[0].words[0]}) turns freely", f"vlocy {k + 1} in DRV_DOF.DAT")
        if not whole:
            entry.refuse(f"body {body.rank} ({body.contactors[0].words[0]}) is moved by forces and has grains on both sides, or ends",
                         "grains on one side, and --planes for rectangles with round ends")
        # what moves freely bears its weight, which a boundary here does not
        weight = mass * case.gravity[k]
        free[k] = True
        velocity[k] = float(body.velocity()[k])
        if function.table is None:
            force[k] = function.constant + weight
        else:
            columns["f" + name[1]] = Function(table=function.table + [0.0, weight])
    spin = np.array(velocity[d:])
    if d == 3:
        # axes of inertia: those of DOF.INI or, without it, those that BODIES.DAT gives the contactor of a body with one
        frame = axes_of(body, body.contactors[0])[1] if body.initial is None and len(body.contactors) == 1 else body.frame()
        if not np.allclose(frame, np.eye(3)) and any(name in columns for name in names[3:]):
            body.start.refuse(f"body {body.rank} turns at a changing rate about axes that are not those of space", "a constant rate")
        spin = frame @ spin
    if swings:
        keys.update({name: part for name, part in (("oscillation", swing[:d]), ("rotation_oscillation", swing[d:])) if any(part)},
                    frequency=swings[0] / (2.0 * np.pi), phase=swings[1])
    if any(velocity[:d]):
        keys["velocity"] = velocity[:d]
    if np.any(spin != 0.0):
        keys["rotation"] = list(spin)
    if np.any(spin != 0.0) or any(swing[d:]) or any(name in columns for name in names[d:]):
        keys["pivot"] = list(body.centre(ShapeOfBody(body).centre) if body.contactors[0].words[0] in HULLS else body.place())
    if any(free):
        keys.update(free=free, mass=mass)
        if np.any(force != 0.0):
            keys["force"] = list(force)
    return keys, columns


def axes_of(body, contactor):
    """Centre of a contactor and its axes as columns."""
    frame, d = body.frame(), body.dimension
    place = body.place() + frame @ contactor.shift(d)
    if d == 3 and "localframe" in contactor.words:
        frame = frame @ np.stack([contactor.vector(name, 3) for name in ("alp", "bet", "gam")], axis=1)
    return place, frame


def pieces(case, body, contactor):
    """Boundaries that a contactor of a wall becomes, as [(name, keys)], and the disks at its ends."""
    shape, d = contactor.words[0], case.dimension
    centre, frame = axes_of(body, contactor)
    if shape in ("xKSID", "DNLYC"):
        keys = {"shape": "circle", "point": list(centre), "radius": contactor.get("byrd")}
        if shape == "DNLYC":
            keys.update(shape="cylinder", axis=list(frame[:, 2]))
            case.remarks.append(f"body {body.rank} DNLYC: the cylinder is endless here, its height "
                                f"2 x {contactor.get('High'):g} m is not kept")
        return [("", keys)], []
    half, thick = contactor.size(1, "axe1"), contactor.size(d, f"axe{d}")
    normal, along = frame[:, -1], frame[:, 0] * half
    height = (case.centres - centre) @ normal
    # both where all grains are in the middle of the wall
    sides = [side for side in (1.0, -1.0) if np.any(side * height > 0.0)] or [1.0, -1.0]
    across = frame[:, 1] * contactor.size(2, "axe2") if d == 3 else 0.0 * along
    spanned = spanned_axes(case, normal, np.abs(along) + np.abs(across))
    spans = bool(spanned)
    if spans and not case.planes and len(sides) == 1:
        others = [axis for k, axis in enumerate("xyz"[:d]) if axis not in spanned and abs(normal[k]) < 1.0 - ROUND]
        beyond = f", along {' and '.join(others)} too, where it has edges" if others else ""
        case.remarks.append(f"body {body.rank} {shape}: it is as wide as the period along {' and '.join(spanned)}, and becomes an endless plane{beyond}")
    endless = (case.planes or spans) and len(sides) == 1
    found = []
    for side in sides:
        face = centre + side * thick * normal
        label = "" if len(sides) == 1 else " above" if side > 0.0 else " below"
        if endless:
            keys = {"shape": "plane", "point": list(face), "normal": list(side * normal)}
        elif d == 2:
            keys = {"shape": "segment", "point": list(face - along), "end": list(face + along)}
        else:
            keys = {"shape": "rectangle", "point": list(face - along - across), "edge_a": list(2.0 * along),
                    "edge_b": list(2.0 * across)}
        found.append((label, keys))
    if d == 3 and not case.planes and not endless:
        case.remarks.append(f"body {body.rank} PLANx: its edges are sharp here, round with {thick:g} m in LMGC90")
    forced = any(kind == "force" for kind, _, _ in body.drives.values()) or len(body.drives) < 3 * d - 3
    ends = [] if d == 3 or case.planes or endless or forced else [(centre - along, thick), (centre + along, thick)]
    if forced and d == 2 and not case.planes and not endless:
        case.remarks.append(f"body {body.rank} JONCx: moved by forces, its ends are sharp here")
    return found, ends


def spanned_axes(case, normal, half):
    """The periodic axes, along which a flat wall of these half widths lies, that it reaches round."""
    return [axis for axis, length, across, width in zip("xyz", case.period, normal, half)
            if length > 0.0 and abs(across) < ROUND and 2.0 * width >= length * (1.0 - ROUND)]


def add_wall(case, body):
    """A driven body of rectangles or circles: a boundary for each side of each contactor that grains see."""
    for number_of, contactor in enumerate(body.contactors, 1):
        if not case.laws.meet(case.laws.thing(contactor)):
            case.remarks.append(f"body {body.rank} {contactor.words[0]}: no grain sees it, left out")
            continue
        material = case.laws.material(case.laws.thing(contactor))
        found, ends = pieces(case, body, contactor)
        keys, columns = motion(case, body, len(found) == 1 and not ends and len(body.contactors) == 1)
        name = f"body {body.rank}" + (f" contactor {number_of}" if len(body.contactors) > 1 else "")
        for label, shape in found:
            case.boundaries.append(({"name": name + label, **shape, **keys, "material": material}, columns))
            case.parts[body.rank].append(case.boundaries[-1][0])
        if ends:
            group = case.new_group()
            for place, radius in ends:
                case.keep(body, Grain(None, place, radius, case.bulks.ball(radius), material, group=group))
            case.boundaries.append(({"name": name + " ends", "shape": "grains", "group": group, **keys}, columns))
