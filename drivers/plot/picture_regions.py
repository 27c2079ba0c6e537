"""The regions of a case in a picture: boxes of means with their bins, boxes and balls in which grains enter."""
import numpy
from matplotlib.collections import LineCollection
from picture_space import ARC

import gravier

#: of regions of means and of insertions; both stand out from blue disks and red chains
MEANS, ENTRIES = "#000000", "#E69F00"
#: a side beyond this is none
NO_SIDE = 1e29


def corners_of(keys, low, high):
    """Lower and upper corner of a box of a case; a side that is none is that of the box from `low` to `high`."""
    found = [gravier.entries(keys, name, side) for name, side in (("lower", low), ("upper", high))]
    return [numpy.where(numpy.abs(corner) < NO_SIDE, corner, side) for corner, side in zip(found, (low, high))]


def box_lines(low, high):
    """Edges of a box as segments (n, 2, d)."""
    corners = numpy.stack(numpy.meshgrid(*zip(low, high), indexing="ij"), axis=-1).reshape(-1, len(low))
    count = len(corners)
    return [corners[[k, k | bit]] for k in range(count) for bit in (1 << b for b in range(len(low))) if not k & bit]


def ball_lines(centre, radius):
    """A circle in the plane, three of them in space."""
    rings = []
    for a in range(len(centre)):
        for b in range(a + 1, len(centre)):
            ring = numpy.tile(centre, (len(ARC), 1))
            ring[:, a] += radius * numpy.cos(ARC)
            ring[:, b] += radius * numpy.sin(ARC)
            rings.append(ring)
    return rings


def bins_of(keys, low, high):
    """Corners of the bins of a region, of equal width along its axis; of one without bins its own."""
    count, axis = (int(keys["bins"]), "xyz".index(keys["axis"])) if "bins" in keys and "axis" in keys else (1, 0)
    ends = numpy.linspace(low[axis], high[axis], count + 1)
    boxes = []
    for first, last in zip(ends[:-1], ends[1:]):
        boxes.append((low.copy(), high.copy()))
        boxes[-1][0][axis], boxes[-1][1][axis] = first, last
    return boxes


def draw_regions(axes, run, step, view, low, high):
    """Outlines of the regions of a run: those of means with their bins as they are in this step, those in which grains enter. `low` and `high` are
    the ends of a scene that is not periodic. There end those without a side that no means tell of."""
    dimension = len(low)
    low, high = numpy.where(run.period > 0.0, run.origin, low), numpy.where(run.period > 0.0, run.origin + run.period, high)
    for keys in run.case_at(step).get("region", []):
        name = keys.get("name", "")
        if name in run.regions(step):
            rows = run.region(name, step)
            boxes = list(zip(rows.lower, rows.upper))
        else:
            boxes = bins_of(keys, *corners_of(keys, low, high))
        for first, last in boxes if len(boxes) > 1 else []:
            draw_lines(axes, view, box_lines(first, last), MEANS, ":")
        first, last = boxes[0][0], boxes[-1][1]
        draw_lines(axes, view, box_lines(first, last), MEANS, "--", f"region {name}", last)
    for number, keys in enumerate(run.case.get("insertion", []), 1):
        name = keys.get("name", f"insertion {number}")
        if keys.get("region", "box") == "ball":
            centre, radius = gravier.entries(keys, "centre", numpy.zeros(dimension)), float(keys["region_radius"])
            draw_lines(axes, view, ball_lines(centre, radius), ENTRIES, "-", name, centre + numpy.array([0.7] * 2 + [0.0])[:dimension] * radius)
        else:
            first, last = corners_of(keys, low, high)
            draw_lines(axes, view, box_lines(first, last), ENTRIES, "-", name, last)


def region_corners(case, dimension):
    """Corners of regions in which grains enter (n, d), which a picture of them must hold."""
    found = []
    for keys in case.get("insertion", []):
        if keys.get("region", "box") == "ball":
            centre = gravier.entries(keys, "centre", numpy.zeros(dimension))
            found += [centre - float(keys["region_radius"]), centre + float(keys["region_radius"])]
        else:
            found += corners_of(keys, numpy.zeros(dimension), numpy.zeros(dimension))
    return numpy.array(found).reshape(-1, dimension)


def draw_lines(axes, view, lines, colour, dash, name=None, place=None):
    if not lines:
        return
    axes.add_collection(LineCollection([view.place(line) for line in lines], colors=colour, linewidths=1.2 if name else 0.9,
                                       linestyles=dash, zorder=3.5))
    if name:
        # a corner may be outside of the picture
        inside = numpy.clip(view.place(place), *numpy.transpose([axes.get_xlim(), axes.get_ylim()]))
        axes.annotate(name, inside, xytext=(-2, -2), textcoords="offset points", ha="right", va="top", fontsize=8, zorder=4,
                      bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8})
