"""Fields on a grid from the states of a run: density, velocity, granular temperature, stress and what follows from them, by coarse-graining after Goldhirsch (2010)."""
import itertools

import numpy as np

from .field_files import write_image
from .field_grid import Grid, Kernel, reach_of, shifted
from .field_sums import Motion, contact_sums, motion_sums
from .mixing import states_since
from .tables import ResultsError, Table

#: of a period, by which a box may miss it
NEARLY = 1e-9
#: cells of a grid at most
MOST_CELLS = 1000000
#: a normal whose component is above this lies along an axis
ALONG = 0.999
#: of a direction in which neighbours tell too little of a gradient
OPEN = 1e-9
#: part of the largest density below which a cell counts as empty: what a kernel leaves there
EMPTY = 1e-9


class Fields(Table):
    """A table of fields, a row a cell, the last axis the fastest. `axes`, a text such as "xz", are those of the grid, `shape` its cells along them, `size` the edges of a cell [m]; `corner` (d) and `edges` (d, d), a row an
    axis, the box of the cells."""

    def grid(self, name):
        """A column as an array over the grid, (shape, components)."""
        return self[name].reshape(*self.shape, *self[name].shape[1:])

    def write_vtk(self, path):
        """The fields as a file for ParaView: image data, or a structured grid of a periodic cell that leans."""
        write_image(path, self)


def fields(run, cell, axes=None, steps=None, smooth=0.0, box=None, since=0.0):
    """Fields of a run on a grid of cells of about the edge `cell` [m], means over written states: a table with a row a cell and the columns step and time, of the last state, states, x, y, z, the middle of the cell along the axes
    of the grid [m], grains, solid_fraction, density, velocity (d), temperature (d), granular_temperature, gradient (d, d), of the velocity along the row by the place along the column, shear_rate, and where the states have contacts contact_stress and kinetic_stress (d, d),
    compression positive, pressure, shear_ratio, coordination and inertial_number. What a cell without grains does not have is NaN.

    `axes` are those of the grid, "xz" for instance, all unless told; fields are means along the others. `steps` are the states, one or as in `run.steps_in`, all after the start from the time `since` [s] on unless told. `smooth` is the width of
    the kernel [m], 0 for means over the cells. `box` x0, x1, y0, y1[, z0, z1] is the box of the grid [m], that of the grains and planes unless told. doc/measures.md has the definitions."""
    return Chosen(run, cell, axes, smooth, box).of(_states(run, steps, since))


def fields_of_states(run, cell, axes=None, steps=None, smooth=0.0, box=None, since=0.0):
    """The tables of `fields` of each state by itself, on one grid, a list."""
    states, chosen = _states(run, steps, since), Chosen(run, cell, axes, smooth, box)
    chosen.frame(states)
    return [chosen.of([state]) for state in states]


def _states(run, steps, since):
    chosen = run.steps_in("all" if steps is None else [steps] if isinstance(steps, (int, np.integer)) else steps)
    found = [step for step, _ in states_since(run, since) if step in chosen]
    if not found:
        raise ResultsError(f"{run.path}: no written state of steps {chosen[0]} to {chosen[-1]} from {since:g} s on; expected one at least")
    return found


class Chosen:
    """What is asked for: cells, axes of the grid, width of the kernel and box."""

    def __init__(self, run, cell, axes, smooth, box):
        self.run, d = run, run.dimension
        for name, value, least in (("cell", cell, "above 0"), ("smooth", smooth, "of at least 0")):
            if not isinstance(value, (int, float, np.integer, np.floating)) or not (0.0 if least == "above 0" else -1e-300) < value < np.inf:
                raise ResultsError(f"{name} {value!r}: expected a length {least}")
        self.axes = "xyz"[:d] if axes is None else "".join(axes)
        if not self.axes or len(set(self.axes)) < len(self.axes) or not set(self.axes) <= set("xyz"[:d]):
            raise ResultsError(f"axes {self.axes!r}: expected some of {', '.join('xyz'[:d])}")
        self.axes = "".join(sorted(self.axes))
        self.cell, self.smooth, self.box = float(cell), float(smooth), None
        if box is not None:
            self.box = np.array(box, dtype=float).ravel()
            if len(self.box) != 2 * d or not np.all(self.box[::2] < self.box[1::2]):
                raise ResultsError(f"box {' '.join(f'{side:g}' for side in self.box)}: expected x0 x1 y0 y1{' z0 z1' if d == 3 else ''}, each lower side below the upper one")
        self.low = self.high = self.lengths = None

    def frame(self, states):
        """Lay the grid over all of some states."""
        run, d = self.run, self.run.dimension
        cells = [run.cell(step) for step in states]
        if cells[-1] is not None:
            self.lengths = np.mean([np.diag(cell.edge) for cell in cells], axis=0)
        if self.box is not None:
            if cells[-1] is not None:
                raise ResultsError(f"{run.path}: a periodic cell that moves; expected no box")
            self.low, self.high = self.box[::2], self.box[1::2]
            if np.any((run.period > 0.0) & (self.high - self.low > (1.0 + NEARLY) * run.period)):
                raise ResultsError(f"box {' '.join(f'{side:g}' for side in self.box)}: expected a box of at most a period")
            return
        periodic = bool(np.all(run.period > 0.0))
        ends = [(run.origin, run.origin + run.period) if periodic else self._ends(step) for step in states]
        self.low, self.high = np.min([low for low, _ in ends], axis=0), np.max([high for _, high in ends], axis=0)
        for axis in range(d):
            if run.period[axis] > 0.0:
                self.low[axis], self.high[axis] = run.origin[axis], run.origin[axis] + run.period[axis]
        if not np.all(self.high > self.low):
            raise ResultsError(f"{run.path}: no grains in the chosen states; expected some")

    def _ends(self, step):
        """The box of the grains of a state and of the planes across the axes; along an axis a plane is the end of the scene."""
        bodies = self.run.bodies(step)
        if len(bodies) == 0:
            return np.full(self.run.dimension, np.inf), np.full(self.run.dimension, -np.inf)
        low, high = (bodies.position - bodies.radius[:, None]).min(axis=0), (bodies.position + bodies.radius[:, None]).max(axis=0)
        rows, removed = self.run.boundaries(step), [group.get("name") for group in self.run.case.get("boundary", []) if "remove_at" in group]
        for name, shape, point, normal in zip(rows.name, rows.shape, rows.position, rows.normal):
            axis = int(np.argmax(np.abs(normal)))
            if shape == "plane" and abs(normal[axis]) > ALONG and name not in removed:
                (low if normal[axis] > 0.0 else high)[axis] = point[axis]
        return low, high

    def grid_of(self, cell):
        """The grid of a state, whose periodic cell, if it moves, is given."""
        d, run = self.run.dimension, self.run
        # a box of a whole period repeats itself
        wraps = (run.period > 0.0) & (np.abs(self.high - self.low - run.period) <= NEARLY * run.period)
        if cell is None:
            corner, edges, lengths = self.low, np.diag(self.high - self.low), self.high - self.low
        else:
            corner, edges, wraps, lengths = cell.origin[:, 0], cell.edge, np.ones(d, dtype=bool), self.lengths
        count = np.array([max(1, round(float(length / self.cell))) if axis in self.axes else 1 for axis, length in zip("xyz", lengths)])
        width = np.array([self.smooth / length * n if axis in self.axes else 0.0 for axis, n, length in zip("xyz", count, np.linalg.norm(edges, axis=1))])
        pad = [reach_of(w) for w in width]
        if np.prod(count + 2 * np.where(wraps, 0, pad), dtype=float) > MOST_CELLS:
            raise ResultsError(f"cell {self.cell:g}: {' x '.join(map(str, count))} cells{' and those for the kernel' if self.smooth else ''}; expected {MOST_CELLS} at most, by larger cells, fewer axes or a box")
        repeat = np.where(wraps | (run.period <= 0.0), 0.0, run.period / lengths * count)
        return Grid(count, wraps, corner, edges, (self.box is None, pad, repeat)), Kernel(width)

    def of(self, states):
        """The fields of some states together."""
        if self.low is None:
            self.frame(states)
        total, edges, corners, gradient, with_contacts = {}, [], [], 0.0, 0
        for step in states:
            bodies, contacts, cell = self.run.bodies(step), self.run.contacts(step), self.run.cell(step)
            grid, kernel = self.grid_of(cell)
            motion = Motion(self.run, cell)
            sums = motion_sums(self.run, bodies, grid, motion)
            if contacts is not None:
                with_contacts += 1
                sums.update(contact_sums(self.run, step, bodies, contacts, grid))
            for name, values in sums.items():
                total[name] = total.get(name, 0.0) + values / grid.volume
            total["number"] = total.get("number", 0.0) + sums["grains"]
            edges.append(grid.edges)
            corners.append(grid.corner)
            gradient = gradient + motion.gradient / len(states)
            middle = motion.middle
        for name in total:
            total[name] = total[name] / (with_contacts if name in ("stress", "neighbours") else len(states))
        grid = Grid(grid.count, grid.wraps, np.mean(corners, axis=0), np.mean(edges, axis=0), (grid.is_open, grid.pad, grid.repeat))
        means = _smoothed(total, grid, kernel)
        if not grid.is_open:
            means = {name: grid.inner(values) for name, values in means.items()}
        return self._table(states, (means, grid), (gradient, middle))

    def _table(self, states, means_and_grid, motion):
        (means, grid), (gradient, middle) = means_and_grid, motion
        kept = [axis for axis in range(self.run.dimension) if "xyz"[axis] in self.axes]
        shape = np.array(grid.shape) if grid.is_open else grid.count
        centres = grid.centres() if grid.is_open else grid.inner(grid.centres().T).T
        rows = int(np.prod(shape))
        table = Fields(step=np.full(rows, states[-1]), time=np.full(rows, self.run.time(states[-1])), states=np.full(rows, len(states)))
        table.update({"xyz"[axis]: centres[:, axis] for axis in kept})
        table.update(_figures(means, grid, tuple(shape), gradient))
        table["velocity"] = table.velocity + (centres - middle) @ gradient.T
        table.axes, table.shape, table.dimension = self.axes, tuple(int(n) for n in shape[kept]), self.run.dimension
        table.corner, table.edges = grid.corner, grid.edges * (shape / grid.count)[:, None]
        if grid.is_open:
            table.corner = grid.corner - grid.pad / grid.count @ grid.edges
        table.size = np.linalg.norm(grid.edges, axis=1)[kept] / grid.count[kept]
        return table


def _smoothed(total, grid, kernel):
    """Mean sums per volume, smoothed; the ways in `places`, `carried` and `spread` are those from the middle of the cell to which they come."""
    means = {name: kernel.smooth(grid, values) for name, values in total.items()}
    d = len(grid.count)
    carried, spread = (means[name].reshape(d, d, -1) for name in ("carried", "spread"))
    for a in range(d):
        carried[:, a] += kernel.smooth(grid, total["momentum"], [a])
        for b in range(d):
            spread[a, b] += kernel.smooth(grid, total["places"][[a]], [b])[0] + kernel.smooth(grid, total["places"][[b]], [a])[0] + kernel.smooth(grid, total["mass"], [a, b])[0]
        means["places"][a] += kernel.smooth(grid, total["mass"], [a])[0]
    return means


def _figures(means, grid, shape, homogeneous):
    """The columns of the fields from mean sums per volume."""
    d, density = len(shape), means["mass"][0]
    filled = density > EMPTY * density.max(initial=0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        def over(values, by):
            return np.where(filled, values / np.where(filled, by, 1.0), np.nan)

        def products(name):
            return over(means[name], density).T.reshape(-1, d, d)

        velocity, places = over(means["momentum"], density).T, over(means["places"], density).T
        squares = products("squares") - velocity[:, :, None] * velocity[:, None, :]
        slopes = _slopes(velocity, places, np.where(filled, density, 0.0), (grid, shape))
        # the variance of what velocities are beside the linear field; where that is not known, beside their mean
        linear = np.nan_to_num(slopes)
        turned = linear @ (products("carried") - velocity[:, :, None] * places[:, None, :]).transpose(0, 2, 1)
        spread = products("spread") - places[:, :, None] * places[:, None, :]
        squares_beside = squares - turned - turned.transpose(0, 2, 1) + linear @ spread @ linear.transpose(0, 2, 1)
        temperature = np.maximum(np.einsum("caa->ca", squares_beside), 0.0)
        # in cells: a place along x is so many cells further along each axis
        gradient = slopes @ (grid.inverse * grid.count).T + homogeneous
        rates = 0.5 * (gradient + gradient.transpose(0, 2, 1))
        found = {"grains": means["number"][0], "solid_fraction": means["solid"][0], "density": density, "velocity": velocity, "temperature": temperature,
                 "granular_temperature": temperature.mean(axis=1), "gradient": gradient, "shear_rate": 2.0 * _size(_deviator(rates))}
        if "stress" not in means:
            return found
        kinetic = np.where(filled[:, None, None], density[:, None, None] * squares, 0.0)
        contact = means["stress"].T.reshape(-1, d, d)
        stress = contact + kinetic
        pressure = np.trace(stress, axis1=1, axis2=2) / d
        presses = pressure > EMPTY * pressure.max(initial=0.0)
        found.update(contact_stress=contact, kinetic_stress=kinetic, pressure=pressure,
                     shear_ratio=np.where(presses, _size(_deviator(0.5 * (stress + stress.transpose(0, 2, 1)))) / np.where(presses, pressure, 1.0), np.nan),
                     coordination=over(means["neighbours"][0], means["grains"][0]))
        solid_density, diameter = over(density, means["volume"][0]), over(means["diameters"][0], means["grains"][0])
        found["inertial_number"] = np.where(presses, found["shear_rate"] * diameter * np.sqrt(solid_density / np.where(presses, pressure, 1.0)), np.nan)
    return found


def _deviator(tensors):
    d = tensors.shape[1]
    return tensors - np.trace(tensors, axis1=1, axis2=2)[:, None, None] * np.eye(d) / d


def _size(tensors):
    """The root of half of the sum of the squares: of a simple shear stress its size."""
    return np.sqrt(0.5 * np.einsum("cab,cab->c", tensors, tensors))


def _slopes(velocity, places, weight, grid_and_shape):
    """Gradients of the velocity (cells, d, d), by cells along each axis of the grid: those of the linear field of least squares through the cell and those around it, each with its mean velocity at its centre of
    mass and weighted by its mass, so that a linear field is found to rounding. 0 along axes with one cell; NaN where neighbours do not tell it."""
    grid, shape = grid_and_shape
    d = len(shape)
    axes = [axis for axis in range(d) if shape[axis] > 1]
    found = np.zeros((len(velocity), d, d))
    if not axes:
        return np.where(weight[:, None, None] > 0.0, found, np.nan)
    fields = np.concatenate([np.nan_to_num(velocity), np.nan_to_num(places), weight[:, None]], axis=1).T.reshape(-1, *shape)
    own = fields.reshape(len(fields), -1)
    normal, right = np.zeros((len(velocity), len(axes), len(axes))), np.zeros((len(velocity), len(axes), d))
    for way in itertools.product((-1, 0, 1), repeat=len(axes)):
        other = fields
        for axis, step in zip(axes, way):
            other = shifted(other, axis + 1, step, grid.wraps[axis])
        other = other.reshape(len(fields), -1)
        apart = (other[d:2 * d] - own[d:2 * d])[axes].T + np.array(way)
        change = (other[:d] - own[:d]).T
        normal += other[2 * d][:, None, None] * apart[:, :, None] * apart[:, None, :]
        right += other[2 * d][:, None, None] * apart[:, :, None] * change[:, None, :]
    scale = np.trace(normal, axis1=1, axis2=2)
    told = (weight > 0.0) & (scale > 0.0)
    told[told] = np.linalg.eigvalsh(normal[told] / scale[told, None, None])[:, 0] > OPEN
    found[~told] = np.nan
    found[np.ix_(told, range(d), axes)] = np.linalg.solve(normal[told], right[told]).transpose(0, 2, 1)
    return found
