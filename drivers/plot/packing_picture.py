"""Pictures of bodies: coloured by a quantity, with their walls and force chains, one state or several of a movie."""
import matplotlib.pyplot as plt
import numpy
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.ticker import MaxNLocator
from palette import CHAINS, PLAIN, PULLS
from picture_regions import draw_regions, region_corners
from picture_space import View, Walls, box_around, chosen, draw_flat_walls, draw_space, frame_around, newell
from picture_style import SPEEDS, TURNS, PictureError, colours_of_kinds, scaled

import gravier

WIDEST = 4.0  # chain of the largest force, points
FAINTEST = 0.02  # forces below this part of the largest are not drawn
MOST_SHADED = 20000  # spheres that get a highlight each
VIEW = (-60.0, 20.0)  # where the eye is unless told, degrees
COLOURS = ("speed", "velocity_x", "velocity_y", "velocity_z", "rotation", "pressure", "radius", "material", "subdomain", "none")
#: values of a state that stand for all of its bodies in the colours of a movie, at most
SAMPLES = 2001
#: width of a character of a title, inches
CHARACTER = 0.068
#: numbers of things, not quantities
KINDS = ("material", "subdomain")


# ---- colours

def quantity(run, step, bodies, kind):
    """Values to colour bodies by, their unit and their name; values None for no colour."""
    if kind == "none" or (kind == "radius" and bodies.radius.min() == bodies.radius.max()):
        return None, None, None
    if kind == "radius":
        return bodies.radius, "m", "radius"
    if kind == "pressure":
        return run.pressure(step), "N/m" if run.dimension == 2 else "Pa", "pressure"
    if "velocity" not in bodies:
        raise PictureError(f"{run.path}: no velocities; expected another --colour")
    if kind == "rotation" and run.dimension == 2:
        return bodies.spin[:, 0], "rad/s", "rotation, anticlockwise"
    if kind == "rotation":
        return numpy.linalg.norm(bodies.spin, axis=1), "rad/s", "rotation"
    if kind.startswith("velocity_"):
        axis = "xyz".index(kind[-1])
        if axis >= run.dimension:
            raise PictureError(f"{run.path}: a scene of the plane has no {kind}; expected velocity_x or velocity_y")
        return bodies.velocity[:, axis], "m/s", f"velocity along {kind[-1]}"
    return numpy.linalg.norm(bodies.velocity, axis=1), "m/s", "speed"


def error_speeds(run):
    """Speeds that are not told from errors of the solve of a step, its accuracy times U [m/s]: {step: speed}."""
    if isinstance(run, gravier.BodiesFile):
        return {}
    history = run.history()
    if "velocity_scale" not in history:
        return {}
    accuracy = [run.case_at(step).get("solver", [{}])[0].get("accuracy", 0.1) for step in history.step]
    return dict(zip(history.step.astype(int), accuracy * history.velocity_scale))


def least_colour(kind, speed, bodies):
    """What colours tell apart at least: bodies at rest must not be coloured by rounding."""
    if kind == "speed" or kind.startswith("velocity_"):
        return speed
    return speed / bodies.radius.mean() if kind == "rotation" else 0.0


def spread(values, kind, least=0.0):
    """Least and largest value of the colours: a few extreme bodies must not make all others look alike, nor colours end below `least`."""
    if len(values) == 0:
        return 0.0, least or 1.0
    top = max(numpy.quantile(numpy.abs(values), 0.98), least) or numpy.abs(values).max() or 1.0
    if values.min() < 0.0 or kind.startswith("velocity_"):
        return -top, top
    return (values.min(), top) if kind == "radius" and values.min() < top else (0.0, top)


def kinds(run, step, bodies, kind):
    """Numbers to colour bodies by, from 1, and the names of all of them."""
    if kind == "subdomain":
        values, asked = run.subdomain(step), run.case.get("decomposition", [{}])[0]
        # a subdomain without a body has its colour, too
        count = int(asked.get("subdomains", numpy.prod(gravier.entries(asked, "grid", numpy.ones(run.dimension)))))
        return values, [str(number) for number in range(1, max(count, values.max()) + 1)]
    if "material" not in bodies:
        raise PictureError(f"{run.path}: no materials; expected another --colour")
    values = bodies.material.astype(int)
    named = [keys.get("name", str(number)) for number, keys in enumerate(run.case.get("material", []), 1)]
    return values, named + [str(number) for number in range(len(named) + 1, values.max() + 1)]


def colours(run, step, bodies, kind, limits=None, seen=slice(None)):
    """Values to colour the bodies by that are seen, their label, and how: a dictionary for a collection; values None for no colour. `limits`
    are those of the colours where several pictures share them."""
    if kind in KINDS:
        values, names = kinds(run, step, bodies, kind)
        return values[seen], kind, colours_of_kinds(len(names))
    values, unit, name = quantity(run, step, bodies, kind)
    if values is None:
        return None, None, {}
    values = values[seen]
    low, top = limits or spread(values, kind, least_colour(kind, error_speeds(run).get(step, 0.0), bodies))
    power, unit = scaled(top, unit)
    norm = plt.Normalize(low / 10.0**power, top / 10.0**power)
    return values / 10.0**power, f"{name} [{unit}]", {"cmap": plt.get_cmap(TURNS if low < 0.0 else SPEEDS), "norm": norm}


def add_legend(figure, axes, values, label, how, names=None):
    """A bar of colours beside the picture; pointed where values lie beyond it. Of kinds, their names."""
    norm = how["norm"]
    ends = "neither"
    if names is None:
        below, above = values.min() < norm.vmin - 1e-9 * abs(norm.vmin), values.max() > norm.vmax + 1e-9 * abs(norm.vmax)
        ends = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[below, above]
    # a narrow picture has a bar of some width, too
    place = axes.get_position(original=True)
    wide = min(figure.get_figwidth() * place.width, figure.get_figheight() * place.height * numpy.ptp(axes.get_xlim()) / numpy.ptp(axes.get_ylim()))
    bar = figure.colorbar(ScalarMappable(**how), cax=axes.inset_axes([1.0 + max(0.02, 0.1 / wide), 0.0, max(0.025, 0.12 / wide), 1.0]), label=label,
                          extend=ends)
    if names is not None:
        bar.set_ticks(numpy.arange(len(names)) + 1, labels=names)


# ---- bodies

def shaped(bodies):
    """Whether some body is neither a disk nor a sphere."""
    return "shape" in bodies and "orientation" in bodies and bool(numpy.any(bodies.shape > 0))


def visible_polygons(outlines, view, order):
    """Polygons of bodies in the plane of the picture, in the order in which they are drawn, and the body of each: in 3D those that face
    the eye, the nearest last."""
    polygons, body = [], []
    for k in order:
        found = outlines[k]
        if not view.flat:
            found = [points for points in found if numpy.dot(newell(points), view.eye) > 0.0]
            found.sort(key=lambda points: numpy.mean(points @ view.eye))
        polygons += [view.place(points) for points in found]
        body += [k] * len(found)
    return polygons, numpy.array(body)


def draw_bodies(axes, view, bodies, outlines, values, style):
    """Bodies as polygons where `outlines` are given, else as disks; `style` has the keys of a collection."""
    order, diameter = view.order(bodies.position), 2.0 * bodies.radius
    if outlines is not None:
        polygons, order = visible_polygons(outlines, view, order)
        drawn = PolyCollection(polygons, **style)
    elif not view.flat and style["alpha"] == 1.0 and len(bodies) <= MOST_SHADED:
        axes.add_collection(shaded_spheres(view.place(bodies.position)[order], diameter[order], None if values is None else values[order],
                                           style, axes))
        return
    else:
        drawn = EllipseCollection(diameter[order], diameter[order], numpy.zeros_like(diameter), units="xy",
                                  offsets=view.place(bodies.position)[order], offset_transform=axes.transData, **style)
    if values is None:
        drawn.set_facecolor(PLAIN)
    else:
        drawn.set_array(values[order])
    axes.add_collection(drawn)


def shaded_spheres(place, diameter, values, style, axes):
    """Disks in this order, each with a lighter one on it, up and to the left, as light makes it."""
    style = dict(style)
    cmap, norm = style.pop("cmap", None), style.pop("norm", None)
    face = numpy.tile(to_rgba(PLAIN), (len(place), 1)) if values is None else cmap(norm(values))
    edge = numpy.tile(to_rgba(style.pop("edgecolors")), (len(place), 1))
    light = 0.55 * face + 0.45
    light[:, 3] = 0.55
    offsets = numpy.stack([place, place + 0.13 * diameter[:, None] * numpy.array([-1.0, 1.0])], axis=1).reshape(-1, 2)
    widths = numpy.stack([diameter, 0.5 * diameter], axis=1).ravel()
    edge = numpy.stack([edge, numpy.zeros_like(edge)], axis=1).reshape(-1, 4)
    style.pop("alpha")
    return EllipseCollection(widths, widths, numpy.zeros_like(widths), units="xy", offsets=offsets, offset_transform=axes.transData,
                             facecolors=numpy.stack([face, light], axis=1).reshape(-1, 4), edgecolors=edge, **style)


def draw_chains(axes, run, step, view, force, box=None):
    """Force chains: a segment for each loaded contact, as thick as its normal force, in another colour where it pulls; `force` is that of
    the thickest. With a box (low, high), those that begin or end in it."""
    segments, normal = run.chains(step)
    segments = segments + shifts_into_cell(run, step, segments[:, 0])[:, None]
    if box is not None:
        inside = numpy.all((segments >= box[0]) & (segments <= box[1]), axis=2).any(axis=1)
        segments, normal = segments[inside], normal[inside]
    top = force or numpy.abs(normal).max(initial=0.0)
    for sign, colour, what in ((1.0, CHAINS, "normal force"), (-1.0, PULLS, "pull")):
        loaded = sign * normal > FAINTEST * top
        if not loaded.any():
            continue
        axes.add_collection(LineCollection(view.place(segments[loaded]), linewidths=WIDEST * numpy.abs(normal[loaded]) / top, colors=colour,
                                           capstyle="round", zorder=2))
        axes.plot([], [], color=colour, linewidth=WIDEST, label=f"{what} {float(f'{top:.2g}'):g} N")
        axes.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.0, frameon=False, fontsize=8, ncol=2)


def cell_corners(run, step):
    """Corners of a periodic cell of the plane that moves, in order around it (5, 2), from the corner of the box that bodies are kept in."""
    cell = run.cell(step) if run.dimension == 2 else None
    if cell is None:
        return numpy.zeros((0, run.dimension))
    return cell.origin.ravel() + numpy.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) @ cell.edge


def shifts_into_cell(run, step, points):
    """The edges by which points (n, d) lie outside of a periodic cell of the plane that moves (n, d): bodies are kept in an upright box."""
    cell = run.cell(step) if run.dimension == 2 else None
    if cell is None:
        return numpy.zeros_like(points)
    return -numpy.floor((points - cell.origin.ravel()) @ numpy.linalg.inv(cell.edge)) @ cell.edge


def bodies_shown(run, step):
    """The bodies where a picture has them: in the cell that it shows."""
    bodies = run.bodies(step)
    return gravier.Table({**bodies, "position": bodies.position + shifts_into_cell(run, step, bodies.position)})


def outlines_shown(run, step, bodies):
    """The outlines of bodies with shapes where a picture has them."""
    shifts = bodies.position - run.bodies(step).position
    return [[points + shift for points in outline] for outline, shift in zip(run.outlines(step), shifts)]


def points_of(run, step, options):
    """Points that a picture must hold beside bodies and walls: corners of a moving cell, and of regions on request."""
    return numpy.concatenate([cell_corners(run, step), region_corners(run.case_at(step), run.dimension) if options.regions else numpy.zeros((0, run.dimension))])


# ---- a picture

class Frame:
    """What pictures of one movie share: the box, the limits of the colours, the force of the thickest chain."""

    def __init__(self, low=None, high=None, limits=None, force=None):
        self.low, self.high, self.limits, self.force = low, high, limits, force


def title_of(run, step, bodies, contacts, seen):
    """What is drawn: where and when, how many bodies, and how many contacts bear forces; `seen` (n) tells which of the bodies, None for all."""
    title = run.path.name if isinstance(run, gravier.BodiesFile) else f"step {step}, t = {run.time(step):.4g} s"
    part = "" if seen is None else f"{numpy.count_nonzero(seen)} of "
    title += f": {part}{len(bodies)} {'bodies' if shaped(bodies) else 'disks' if run.dimension == 2 else 'spheres'}"
    return title if contacts is None or part else f"{title}, {numpy.count_nonzero(contacts.impulse.any(axis=1))} carrying contacts"


def asked_box(run, numbers):
    """Lower and upper corner of the box that a picture is asked for; None for all there is."""
    if numbers is None:
        return None
    if len(numbers) != 2 * run.dimension or not all(low < high for low, high in zip(numbers[::2], numbers[1::2])):
        raise PictureError(f"--box {' '.join(f'{number:g}' for number in numbers)}: expected {2 * run.dimension} numbers, "
                           f"{'X0 X1 Y0 Y1 Z0 Z1'[:6 * run.dimension - 1]}, the lower one of each two first")
    return numpy.array(numbers[::2]), numpy.array(numbers[1::2])


def bodies_in(bodies, box):
    """Which bodies a picture of a box has (n): in the plane those that reach into it, in space those whose centres are in it."""
    reach = bodies.radius[:, None] if len(box[0]) == 2 else 0.0
    return numpy.all((bodies.position >= box[0] - reach) & (bodies.position <= box[1] + reach), axis=1)


def draw_packing(run, step, options, frame=None):
    """A figure of one step: bodies by colour, walls, force chains by normal force; `options` has size, view, colour, chains, regions
    and box."""
    frame = frame or Frame()
    step = run.find_step(step)
    bodies, contacts = bodies_shown(run, step), run.contacts(step)
    if len(bodies) == 0:
        raise PictureError(f"{run.path}: no body in step {step}; expected one at least")
    view, walls, part = View(run.dimension, *options.view or VIEW), Walls(run, step), asked_box(run, options.box)
    seen, outside = None if part is None else bodies_in(bodies, part), 0
    title = title_of(run, step, bodies, contacts, seen)
    if part is not None:
        box = part
        walls.keep(*part)
    else:
        box = frame_around(bodies, walls, points_of(run, step, options)) if frame.low is None else (frame.low, frame.high)
        seen = bodies_in(bodies, box)
        outside = len(bodies) - numpy.count_nonzero(seen)
        part, seen = (None, None) if outside == 0 else (box, seen)
    if seen is not None and not seen.any() and frame.low is None:
        raise PictureError(f"{run.path}: no body in this --box; expected one at least of those from {numpy.array2string(bodies.position.min(axis=0), precision=4)} "
                           f"to {numpy.array2string(bodies.position.max(axis=0), precision=4)}")
    low, high = view.extent(*box)
    size = (high - low) / (high - low).max()
    figure, axes = plt.subplots(figsize=(options.size * size[0] + 1.3, options.size * size[1] + 0.9))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")

    values, label, how = colours(run, step, bodies, options.colour, frame.limits, slice(None) if seen is None else seen)
    outlines = outlines_shown(run, step, bodies) if shaped(bodies) else None
    drawn = bodies
    if seen is not None:
        drawn = chosen(bodies, seen)
        outlines = None if outlines is None else [outline for outline, is_seen in zip(outlines, seen) if is_seen]
    chains = options.chains and contacts is not None and len(contacts) > 0
    through = 0.25 if chains and not view.flat else 1.0
    # an outline would hide a body of a few points
    points = 72.0 * options.size / (high - low).max() * numpy.median(2.0 * bodies.radius)
    style = {"edgecolors": "0.55" if view.flat else "0.25", "linewidths": min(0.4, 0.06 * points), "alpha": through, **how}
    draw_bodies(axes, view, drawn, outlines, values, style)
    if chains:
        draw_chains(axes, run, step, view, frame.force, part)
    if view.flat:
        axes.plot(*cell_corners(run, step).T, color="0.35", linewidth=0.9, linestyle="--", zorder=1)
        draw_flat_walls(axes, walls, low, high)
        axes.set(xlabel="x [m]", ylabel="y [m]")
        # as many numbers as have room
        axes.xaxis.set_major_locator(MaxNLocator(nbins=max(1, min(8, round(2.0 * options.size * size[0])))))
    else:
        draw_space(axes, view, walls, *box, bodies=drawn if through == 1.0 else None, outlines=outlines)
        axes.set_axis_off()
    if options.regions:
        draw_regions(axes, run, step, view, *box_around(bodies, walls))
    if CHARACTER * len(title) > figure.get_figwidth() - 0.5:
        title = title.replace(": ", ":\n").replace(" disks, ", " disks,\n").replace(" spheres, ", " spheres,\n").replace(" bodies, ", " bodies,\n")
    axes.set_title(title, fontsize=9, loc="left", pad=18 if options.chains else 6)
    if outside > 0:
        # beside the name of the axis, or below it where there is no room
        down = 4 if not view.flat else 18 if options.size * size[0] >= 2.5 else 30
        axes.annotate(f"{outside} grain{'s' if outside > 1 else ''} outside", (1.0, 0.0), xycoords="axes fraction", xytext=(0, -down),
                      textcoords="offset points", ha="right", va="top", fontsize=7, color="0.35", annotation_clip=False)
    if values is not None and len(values) > 0:
        add_legend(figure, axes, values, label, how, kinds(run, step, bodies, options.colour)[1] if options.colour in KINDS else None)
    return figure


# ---- several

def shared_frame(run, steps, options):
    """Box, colours and forces that hold for all steps of a movie."""
    lows, highs, samples, leasts, force, errors = [], [], [], [], 0.0, error_speeds(run)
    part = asked_box(run, options.box)
    for step in steps:
        bodies = bodies_shown(run, step)
        low, high = frame_around(bodies, Walls(run, step), points_of(run, step, options))
        lows.append(low)
        highs.append(high)
        values = None if options.colour in KINDS else quantity(run, step, bodies, options.colour)[0]
        if values is not None and part is not None:
            values = values[bodies_in(bodies, part)]
        if values is not None and values.any():
            samples.append(values if len(values) <= SAMPLES else numpy.quantile(values, numpy.linspace(0.0, 1.0, SAMPLES)))
            leasts.append(least_colour(options.colour, errors.get(step, 0.0), bodies))
        if options.chains and run.contacts(step) is not None:
            force = max(force, numpy.abs(run.chains(step)[1]).max(initial=0.0))
    if not lows:
        raise PictureError(f"{run.path}: no body in any step; expected one at least")
    # of the bodies of all states together: a few states must not make all others pale
    limits = spread(numpy.concatenate(samples), options.colour, numpy.median(leasts)) if samples else None
    return Frame(numpy.min(lows, axis=0), numpy.max(highs, axis=0), limits, force or None)
