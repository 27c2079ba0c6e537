"""Sums over the cells of a grid in one state of a run: masses, momenta and their squares, volumes, contacts and the forces along their branches."""
import numpy as np

from .field_grid import MOST_PARTS, Grid
from .force_networks import ends_of
from .results import along, tangents
from .shapes import axes_of
from .tables import ResultsError

#: that fill a body with a shape
POINTS = 512
#: names of the sums of a state without contacts, with the number of their rows by the dimension
ROWS = {"grains": lambda d: 1, "diameters": lambda d: 1, "volume": lambda d: 1, "mass": lambda d: 1, "momentum": lambda d: d, "squares": lambda d: d * d, "places": lambda d: d,
        "carried": lambda d: d * d, "spread": lambda d: d * d}


class Motion:
    """The homogeneous motion of a periodic cell that moves: `gradient` (d, d), of the velocity along the row by the place along the column, 0 about `middle`."""

    def __init__(self, run, cell):
        self.gradient, self.middle = np.zeros((run.dimension, run.dimension)), np.zeros(run.dimension)
        if cell is not None:
            # edges move with their ends, and the middle of the box, whose lengths are the diagonal, stays
            self.gradient = (np.linalg.inv(cell.edge) @ cell.velocity).T
            self.middle = cell.origin[:, 0] + 0.5 * np.diag(cell.edge)

    def at(self, points):
        """The velocity at points (n, d)."""
        return (points - self.middle) @ self.gradient.T


def motion_sums(run, bodies, grid, motion):
    """Sums over the cells, by name (rows, cells): of the free bodies whose centres are there grains, diameters [m], volume, mass, momentum, the squares m v v (d d), and places, m times the way from the
    middle of the cell, in cells, the products carried, m v times this way, and spread, m times its squares (d d); `solid`, the volume of the parts of all bodies that are in a cell. Velocities are those beside the homogeneous motion of a periodic cell."""
    if "mass" not in bodies:
        raise ResultsError(f"{run.path}: no mass of the bodies; expected the results of a run")
    d = run.dimension
    volume = run.volumes(bodies)
    balls = (volume / run.ball_volume())**(1.0 / d)
    free = bodies.boundary == 0 if "boundary" in bodies else np.ones(len(bodies), dtype=bool)
    mass, velocity, place = bodies.mass[free], bodies.velocity[free] - motion.at(bodies.position[free]), grid.places(bodies.position[free])
    momentum = mass[:, None] * velocity
    way = place - np.floor(place) - 0.5
    columns = [np.ones(len(mass)), 2.0 * balls[free], volume[free], mass, *momentum.T, *_products(momentum, velocity), *(mass[:, None] * way).T, *_products(momentum, way), *_products(mass[:, None] * way, way)]
    sums = grid.sums(grid.cells(place), np.stack(columns, axis=1))
    found, first = {}, 0
    for name, rows in ROWS.items():
        found[name] = sums[first:first + rows(d)]
        first += rows(d)
    found["solid"] = solid_volumes(run, bodies, grid, balls)[None]
    return found


def solid_volumes(run, bodies, grid, balls):
    """The volume of the parts of bodies in each cell (cells), of disks and spheres with the radii `balls`; of a body with a shape that of POINTS points that fill it, which stand for equal parts of it."""
    shape = bodies.get("shape", np.zeros(len(bodies), dtype=int))
    total = grid.volumes_of_balls(bodies.position[shape == 0], balls[shape == 0])
    shapes, volumes = run.shapes() if np.any(shape > 0) else [], run.volumes(bodies)
    for number in np.unique(shape[shape > 0]):
        points, rows = shapes[number - 1].points(POINTS), np.flatnonzero(shape == number)
        for some in np.array_split(rows, -(-len(rows) * POINTS // MOST_PARTS)):
            places = bodies.position[some][:, None] + bodies.radius[some][:, None, None] * (points @ axes_of(bodies.orientation[some]).transpose(0, 2, 1))
            cells = grid.cells(grid.places(places.reshape(-1, run.dimension)))
            total += grid.sums(cells, np.repeat(volumes[some] / POINTS, POINTS)[:, None])[0]
    return total


def _products(one, other):
    """Of the vectors of two arrays (n, d), a row a product (d d, n)."""
    return (one[:, :, None] * other[:, None, :]).reshape(len(one), one.shape[1] * other.shape[1]).T


def contact_sums(run, step, bodies, contacts, grid):
    """Sums over the cells, by name (rows, cells): `stress`, those of -f_a l_b (d d) [N m] over the parts of the ways l from the centres of bodies to contacts that lie in a cell, with the force f on the body, and
    `neighbours`, which push the free bodies whose centres are there."""
    moved, cell = run.in_the_middle(step)
    body, contact, way, sign = half_branches(run, (step, None if cell is None else cell.edge[::-1]), moved, contacts)
    force = sign[:, None] * along(contacts.impulse, [contacts.normal, *tangents(contacts.normal)])[contact] / run.time_step()
    if cell is not None:
        grid = Grid(grid.count, grid.wraps, cell.origin[:, 0], cell.edge, (grid.is_open, grid.pad, grid.repeat))
    line, cells, part = grid.parts_of_lines(grid.places(moved.position[body]), grid.ways(way))
    products = -_products(force, way).T
    row, other = run._rows(bodies, contacts)
    _, neighbours = ends_of(contacts, row, other, contacts.impulse[:, 0] > 0.0, len(bodies) + 1)
    free = bodies.boundary == 0 if "boundary" in bodies else np.ones(len(bodies), dtype=bool)
    return {"stress": grid.sums(cells, products[line] * part[:, None]),
            "neighbours": grid.sums(grid.cells(grid.places(bodies.position[free])), neighbours[:-1][free, None])}


def half_branches(run, step_and_edges, bodies, contacts):
    """Of the contacts of free bodies, a row for each of these: row of the body, row of the contact, way from the centre of the body to the contact (d), and 1 for the candidate, -1 for the antagonist, which
    feels the opposite force. `bodies`, and the edges of a cell that moves, are those of the middle of the step. The contact of two bodies is half-way between their surfaces, that with a boundary or a glued grain on the surface of this."""
    row, other = run._rows(bodies, contacts)
    free = np.append(bodies.boundary == 0 if "boundary" in bodies else np.ones(len(bodies), dtype=bool), False)
    if "point" in contacts:
        body, contact, way = run._arms(step_and_edges[0], bodies, contacts, step_and_edges[1])
        sign = np.where(np.arange(len(body)) < len(contacts), 1.0, -1.0)
        # from the middle of the gap on to the surface
        rest = np.where(free[row] & free[other], 0.0, 0.5) * contacts.gap
        way = way - (sign * rest[contact])[:, None] * contacts.normal[contact]
    else:
        gap = np.where(free[row] & free[other], 0.5, 1.0) * contacts.gap
        held = other >= 0
        body, contact = np.concatenate([row, other[held]]), np.concatenate([np.arange(len(row)), np.flatnonzero(held)])
        sign = np.where(np.arange(len(body)) < len(row), 1.0, -1.0)
        way = -(sign * (bodies.radius[body] + gap[contact]))[:, None] * contacts.normal[contact]
    chosen = free[body]
    return body[chosen], contact[chosen], way[chosen], sign[chosen]
