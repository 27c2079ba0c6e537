"""Where things are in a picture: the direction of the view, the box of a scene, its axes and its walls."""
import matplotlib.pyplot as plt
import numpy
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator
from picture_style import WALLS

import gravier

#: angles of the points of a circle
ARC = numpy.linspace(0.0, 2.0 * numpy.pi, 97)
#: of a step, by which the time of a removal is rounded
ROUNDED = 1e-6
#: a normal whose component is above this lies along an axis
ALONG = 0.999
#: a frame leaves grains out only if there are so many of them; the part of them that lies beyond the percentiles on each side; a frame leaves grains
#: out only if they would make it so many times as large
MANY, OUTERMOST, TOO_LARGE = 100, 0.005, 3.0
#: pieces of an edge of a rectangle, which bodies hide one by one
PIECES = 60


class View:
    """Directions across and up the picture, and towards the eye, of a scene in 2D or 3D."""

    def __init__(self, dimension, azimuth, elevation):
        self.flat = dimension == 2
        a, e = numpy.radians([azimuth, elevation])
        self.axes = numpy.array([[-numpy.sin(a), numpy.cos(a), 0.0],
                                 [-numpy.sin(e) * numpy.cos(a), -numpy.sin(e) * numpy.sin(a), numpy.cos(e)]])
        self.eye = numpy.array([numpy.cos(e) * numpy.cos(a), numpy.cos(e) * numpy.sin(a), numpy.sin(e)])

    def place(self, points):
        """(..., d) to (..., 2)."""
        return points if self.flat else points @ self.axes.T

    def order(self, points):
        """What is nearest to the eye comes last."""
        return numpy.arange(len(points)) if self.flat else numpy.argsort(points @ self.eye, kind="stable")

    def extent(self, low, high):
        """Corners of the picture of a box, with a margin; in 3D it has room for the numbers of the axes."""
        corners = self.place(box_corners(low, high))
        first, last = corners.min(axis=0), corners.max(axis=0)
        margin = (last - first).max() * (numpy.full(2, 0.015) if self.flat else numpy.array([0.14, 0.11]))
        return first - margin, last + margin


class Walls:
    """Boundaries that are there in a step: their rows, the keys of each in the case, and facets of mesh walls (n, d, d). One that is removed at the
    end of a step has forces in this step."""

    def __init__(self, run, step):
        rows = run.boundaries(step)
        known = {keys.get("name", f"boundary {k}"): keys for k, keys in enumerate(run.case.get("boundary", []), 1)}
        ends = numpy.array([known.get(name, {}).get("remove_at", numpy.inf) for name in rows.name], dtype=float)
        # the beginning of the step; what goes at the very start is never there
        began = max(run.time(step) - (1.0 - ROUNDED) * run.time_step(), 0.0) if numpy.isfinite(ends).any() else 0.0
        there = began < ends
        self.rows = gravier.Table({key: values[there] for key, values in rows.items()})
        self.keys = [known.get(name, {}) for name in rows.name[there]]
        facets = run.facets(step)
        self.facets = numpy.zeros((0, run.dimension, run.dimension))
        if facets is not None:
            self.facets = facets.corners[numpy.isin(facets.boundary, self.rows.id)]

    def keep(self, low, high):
        """Leave out facets that are outside of a box."""
        ends = self.facets.min(axis=1), self.facets.max(axis=1)
        self.facets = self.facets[numpy.all((ends[1] >= low) & (ends[0] <= high), axis=1)]

    def planes(self):
        """Points and normals (n, d)."""
        chosen = self.rows.shape == "plane"
        return self.rows.position[chosen], self.rows.normal[chosen]

    def polygons(self):
        """Corners of segments and rectangles (c, d) and points of circles, where they are now; results of older versions do not tell."""
        for k, (shape, point, keys) in enumerate(zip(self.rows.shape, self.rows.position, self.keys)):
            if shape == "segment" and "edges" in self.rows:
                yield numpy.array([point, point + self.rows.edges[k, 0]])
            elif shape == "rectangle" and "edges" in self.rows:
                a, b = self.rows.edges[k]
                yield numpy.array([point, point + a, point + a + b, point + b])
            elif shape == "circle" and "radius" in keys:
                yield point + keys["radius"] * numpy.column_stack([numpy.cos(ARC), numpy.sin(ARC)])

    def cylinders(self):
        """Point, direction and radius of each."""
        for k, (shape, point, keys) in enumerate(zip(self.rows.shape, self.rows.position, self.keys)):
            if shape == "cylinder" and "radius" in keys and "axis" in self.rows:
                yield point, self.rows.axis[k], float(keys["radius"])


def box_corners(low, high):
    """Corners of a box (2^d, d)."""
    return numpy.stack(numpy.meshgrid(*zip(low, high), indexing="ij"), axis=-1).reshape(-1, len(low))


def box_around(bodies, walls, points=()):
    """Corners of the box that holds the bodies, some points and the walls: of planes, which have no end, the points nearest to the middle. Balls
    around bodies with shapes reach through planes, which cut them off."""
    low, high = (bodies.position - bodies.radius[:, None]).min(axis=0), (bodies.position + bodies.radius[:, None]).max(axis=0)
    for point, normal in zip(*walls.planes()):
        a = numpy.argmax(numpy.abs(normal))
        if normal[a] > ALONG:
            low[a] = max(low[a], min(point[a], bodies.position[:, a].min()))
        elif normal[a] < -ALONG:
            high[a] = min(high[a], max(point[a], bodies.position[:, a].max()))
    parts = [*walls.polygons(), *walls.facets] + ([points] if len(points) > 0 else [])
    for point, axis, radius in walls.cylinders():
        reach = radius * numpy.sqrt(numpy.maximum(1.0 - axis**2, 0.0))
        across = reach > 0.5 * radius
        ends = numpy.array([numpy.where(across, point + side * reach, 0.5 * (low + high)) for side in (-1.0, 1.0)])
        parts.append(ends)
    if parts:
        points = numpy.concatenate(parts)
        low, high = numpy.minimum(low, points.min(axis=0)), numpy.maximum(high, points.max(axis=0))
    middle = 0.5 * (low + high)
    for point, normal in zip(*walls.planes()):
        foot = middle - numpy.dot(middle - point, normal) * normal
        low, high = numpy.minimum(low, foot), numpy.maximum(high, foot)
    return low, high


def frame_around(bodies, walls, points=()):
    """Corners of the box that a picture shows. It holds the bodies, some points and the walls. Grains that are far off along an axis are left out if they
    would make it more than three times as large. Along an axis most grains lie between the percentiles 0.5 and 99.5 of their places. A grain is far
    off if its distance from the middle of this range is more than the length of the range and a diameter."""
    low, high = box_around(bodies, walls, points)
    shown = numpy.ones(len(bodies), dtype=bool)
    if len(bodies) < MANY:
        return low, high
    count = int(numpy.ceil(OUTERMOST * len(bodies)))
    places = numpy.sort(bodies.position, axis=0)
    first, last = places[count], places[-1 - count]
    for a in range(len(low)):
        near = numpy.abs(bodies.position[:, a] - 0.5 * (first[a] + last[a])) <= last[a] - first[a] + 2.0 * numpy.median(bodies.radius)
        inner = box_around(chosen(bodies, near), walls, points)
        if high[a] - low[a] > TOO_LARGE * (inner[1][a] - inner[0][a]):
            shown &= near
    return (low, high) if shown.all() or not shown.any() else box_around(chosen(bodies, shown), walls, points)


def chosen(bodies, rows):
    """Some of the bodies, as a table."""
    return gravier.Table({name: values[rows] for name, values in bodies.items()})


# ---- in the plane

def draw_flat_walls(axes, walls, low, high):
    """Boundaries of a scene in 2D: planes as lines across the picture, cut where another plane leaves them behind, segments, circles and
    facets."""
    style = {"color": WALLS, "linewidth": 1.5, "solid_capstyle": "butt", "zorder": 3}
    length = numpy.linalg.norm(high - low)
    places, normals = walls.planes()
    for point, normal in zip(places, normals):
        tangent = numpy.array([-normal[1], normal[0]])
        start = point + numpy.dot(0.5 * (low + high) - point, tangent) * tangent
        line = start + numpy.linspace(-length, length, 4001)[:, None] * tangent
        free = numpy.ones(len(line), dtype=bool)
        for other, other_normal in zip(places, normals):
            free &= (line - other) @ other_normal > -1e-3 * length
        axes.plot(*line[free].T, **style)
    for points in walls.polygons():
        axes.plot(*points.T, **style)
    axes.add_collection(LineCollection(walls.facets, colors=WALLS, linewidths=1.5, capstyle="round", zorder=3))


# ---- in space

def newell(points):
    """Normal of a polygon in space, as long as twice its area."""
    return numpy.cross(points, numpy.roll(points, -1, axis=0)).sum(axis=0)


def hidden(points, view, bodies, outlines):
    """Which points (n) are behind a body: behind the surface of a sphere, or a face of a body with `outlines` that faces the eye."""
    place, depth = view.place(points), points @ view.eye
    centres, depths = view.place(bodies.position), bodies.position @ view.eye
    found = numpy.zeros(len(points), dtype=bool)
    for k, at in enumerate(place):
        rest = bodies.radius**2 - ((centres - at)**2).sum(axis=1)
        near = numpy.flatnonzero((rest > 0.0) & (depths + numpy.sqrt(numpy.maximum(rest, 0.0)) > depth[k]))
        if outlines is None:
            found[k] = len(near) > 0
            continue
        faces = (face for body in near for face in outlines[body] if numpy.dot(newell(face), view.eye) > 0.0)
        found[k] = any(numpy.mean(face @ view.eye) > depth[k] and Path(view.place(face)).contains_point(at) for face in faces)
    return found


def draw_outline(axes, view, points, bodies, outlines):
    """The edges of a rectangle among the bodies, but for what these hide."""
    ends = points[:, None] + numpy.linspace(0.0, 1.0, PIECES + 1)[:, None] * (numpy.roll(points, -1, axis=0) - points)[:, None]
    pieces = numpy.stack([ends[:, :-1], ends[:, 1:]], axis=2).reshape(-1, 2, 3)
    seen = ~hidden(pieces.mean(axis=1), view, bodies, outlines)
    axes.add_collection(LineCollection(view.place(pieces[seen]), colors="0.35", linewidths=0.8, zorder=3.0))


def draw_space(axes, view, walls, low, high, bodies=None, outlines=None):
    """The box around a scene in 3D with numbers along three of its edges, and the walls: what is behind the bodies is filled, what is in
    front of them is an outline. Where `bodies` are told, which are not transparent, they hide parts of the outlines of rectangles."""
    draw_box(axes, view, walls, low, high)
    middle = 0.5 * (low + high)
    for points in walls.polygons():
        before = numpy.dot(points.mean(axis=0) - middle, view.eye) > 0.0
        if before and bodies is not None:
            draw_outline(axes, view, points, bodies, outlines)
        else:
            draw_wall(axes, view, points, before)
    for point, normal in zip(*walls.planes()):
        if not is_face(point, normal, low, high):
            points = cut_box(point, normal, low, high)
            if len(points) >= 3:
                draw_wall(axes, view, points, numpy.dot(normal, view.eye) < 0.0)
    for point, axis, radius in walls.cylinders():
        draw_cylinder(axes, view, (point, axis, radius), low, high)
    if len(walls.facets) > 0:
        axes.add_collection(PolyCollection(view.place(walls.facets), facecolors="none", edgecolors="0.6", linewidths=0.3, zorder=0.5))


def is_face(point, normal, low, high):
    """Whether a plane is a face of the box, or nearly so, with the box on its free side."""
    a = numpy.argmax(numpy.abs(normal))
    return abs(normal[a]) > ALONG and abs(point[a] - (low if normal[a] > 0.0 else high)[a]) < 0.02 * numpy.max(high - low)


def draw_wall(axes, view, points, before):
    """A wall with these corners, in front of the bodies or behind them."""
    axes.add_patch(plt.Polygon(view.place(points), closed=True, facecolor="none" if before else "0.88", edgecolor="0.35",
                               linewidth=0.8, zorder=3.0 if before else 0.4))


def cut_box(point, normal, low, high):
    """Corners of the part of a plane within a box, in order around it (n, 3)."""
    corners = box_corners(low, high)
    side = (corners - point) @ normal
    found = []
    for k in range(8):
        for bit in (1, 2, 4):
            other = k ^ bit
            if k < other and side[k] * side[other] < 0.0:
                found.append(corners[k] + side[k] / (side[k] - side[other]) * (corners[other] - corners[k]))
    found = numpy.array(found).reshape(-1, 3)
    if len(found) < 3:
        return found
    first = found[0] - found.mean(axis=0)
    first /= numpy.linalg.norm(first)
    around = numpy.arctan2((found - found.mean(axis=0)) @ numpy.cross(normal, first), (found - found.mean(axis=0)) @ first)
    return found[numpy.argsort(around)]


def draw_cylinder(axes, view, cylinder, low, high):
    """A cylinder from end to end of the box: the far end and the side filled, the near end as an outline."""
    point, axis, radius = cylinder
    one = numpy.cross(axis, numpy.eye(3)[numpy.argmin(numpy.abs(axis))])
    one /= numpy.linalg.norm(one)
    ring = radius * (numpy.outer(numpy.cos(ARC), one) + numpy.outer(numpy.sin(ARC), numpy.cross(axis, one)))
    along = (box_corners(low, high) - point) @ axis
    towards = 1.0 if numpy.dot(axis, view.eye) > 0.0 else -1.0
    far, near = (point + place * axis for place in sorted((along.min(), along.max()), key=lambda place: towards * place))
    draw_wall(axes, view, far + ring, before=False)
    draw_wall(axes, view, near + ring, before=True)
    side = numpy.cross(axis, view.eye)
    if numpy.linalg.norm(side) > 1e-6:
        for sign in (-1.0, 1.0):
            reach = sign * radius * side / numpy.linalg.norm(side)
            axes.plot(*view.place(numpy.array([far + reach, near + reach])).T, color="0.35", linewidth=0.8, zorder=0.45)


def draw_box(axes, view, walls, low, high):
    """The three faces of a box that are behind the bodies, grey where a plane is there, and axes with numbers on its outline."""
    ends, size = (low, high), numpy.max(high - low)
    faces = [normal for point, normal in zip(*walls.planes()) if is_face(point, normal, low, high)]
    for a in range(3):
        side = int(view.eye[a] < 0.0)
        corners = box_corners(low, high)
        face = corners[numpy.isclose(corners[:, a], ends[side][a], atol=1e-9 * size)][[0, 1, 3, 2]]
        wall = any(normal[a] * (1 - 2 * side) > ALONG for normal in faces)
        axes.add_patch(plt.Polygon(view.place(face), closed=True, facecolor="0.94" if wall else "none", edgecolor="0.6", linewidth=0.6, zorder=0.2))
    numbered = []
    for a in range(3):
        edge = outline_edge(view, a, low, high)
        if edge is not None:
            draw_axis(axes, view, a, edge, 0.5 * (low + high), numbered)


def outline_edge(view, a, low, high):
    """Ends of the edge along axis a that is on the outline of the box, the lowest of two, of the vertical ones the leftmost; None for an
    axis that the eye looks along."""
    if numpy.linalg.norm(view.axes[:, a]) < 0.15:
        return None
    b, c = [k for k in range(3) if k != a]
    found = []
    for at_b in (0, 1):
        for at_c in (0, 1):
            if (view.eye[b] >= 0.0) == bool(at_b) and (view.eye[c] >= 0.0) == bool(at_c):
                continue
            if (view.eye[b] >= 0.0) != bool(at_b) and (view.eye[c] >= 0.0) != bool(at_c):
                continue
            edge = numpy.array([low, high])
            edge[:, b], edge[:, c] = (low, high)[at_b][b], (low, high)[at_c][c]
            found.append(edge)
    upright = numpy.abs(view.axes[1, a]) > numpy.abs(view.axes[0, a])
    return min(found, key=lambda edge: view.place(edge).mean(axis=0)[0 if upright else 1])


def draw_axis(axes, view, a, edge, middle, numbered):
    """Numbers and a name along an edge of the box, outside of it. `numbered` are the places of numbers [inches]: none stands on another."""
    ends = view.place(edge)
    along = (ends[1] - ends[0]) / numpy.linalg.norm(ends[1] - ends[0])
    out = ends.mean(axis=0) - view.place(middle)
    out -= numpy.dot(out, along) * along
    out /= numpy.linalg.norm(out)
    style = {"ha": "right" if out[0] < -0.35 else "left" if out[0] > 0.35 else "center",
             "va": "top" if out[1] < -0.35 else "bottom" if out[1] > 0.35 else "center", "fontsize": 8, "color": "0.3", "zorder": 4}
    # about a number for every inch
    length = numpy.linalg.norm(axes.transData.transform(ends[1]) - axes.transData.transform(ends[0])) / axes.figure.dpi
    low, high = edge[:, a]
    values = MaxNLocator(nbins=int(numpy.clip(1.6 * length, 2, 6)), steps=[1, 2, 5, 10]).tick_values(low, high)
    for value in values[(values >= low - 1e-9 * (high - low)) & (values <= high + 1e-9 * (high - low))]:
        place = ends[0] + (value - low) / (high - low) * (ends[1] - ends[0])
        inches = axes.transData.transform(place) / axes.figure.dpi
        if any(numpy.linalg.norm(inches - other) < 0.2 for other in numbered):
            continue
        numbered.append(inches)
        axes.annotate("", place, xytext=4.0 * out, textcoords="offset points", annotation_clip=False,
                      arrowprops={"arrowstyle": "-", "color": "0.6", "linewidth": 0.6, "shrinkA": 0.0, "shrinkB": 0.0})
        axes.annotate(f"{0.0 if abs(value) < 1e-9 * (high - low) else value:g}", place, xytext=6.0 * out, textcoords="offset points",
                      annotation_clip=False, **style)
    axes.annotate(f"{'xyz'[a]} [m]", ends.mean(axis=0), xytext=(31.0 if abs(out[0]) > 0.8 else 21.0) * out, textcoords="offset points",
                  annotation_clip=False, **style)
