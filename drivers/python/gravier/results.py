"""What a run left in its directory, as numpy arrays."""
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from .case import CaseError, entries
from .checksum import is_whole
from .histories import read_history
from .run_words import doubts, verdict
from .shapes import axes_of, ball, shapes_of
from .starts import Start, starts_in, text_of
from .tables import ResultsError, Table, one_line, read_table

#: columns without which nothing can be drawn
FINITE = ("position", "radius", "velocity", "normal", "gap", "impulse", "force", "point", "orientation", "edge", "origin")


@contextmanager
def _opened(path, kind):
    """An HDF5 file, open; what cannot be read of it is an error of one line."""
    if not Path(path).exists():
        raise ResultsError(f"{path}: no such file; expected {kind}")
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (ArithmeticError, AttributeError, CaseError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError) as reason:
        # h5py and numpy have all of these for what is not as a run wrote it
        raise ResultsError(f"{path}: cannot read this file; expected {kind}: {one_line(reason)}") from None


def tangents(normal):
    """The tangents t, and in 3D s, of unit normals (n, d), as modules/contact/local/find_frame.fypi makes them: (n, d) each."""
    if normal.shape[1] == 2:
        return [np.stack([-normal[:, 1], normal[:, 0]], axis=1)]
    x, y, z = normal.T
    side = np.copysign(1.0, z)
    a = -1.0 / (side + z)
    b = x * y * a
    return [np.stack([1.0 + side * x * x * a, side * b, -side * x], axis=1), np.stack([b, side + y * y * a, -y], axis=1)]


def along(parts, axes):
    """Vectors in global axes (n, d) of their parts (n, k) along as many axes (n, d) each. A moment in space has its parts along n, t, s."""
    return sum(part[:, None] * axis for part, axis in zip(parts.T, axes))


class Run:
    """The output directory of a run, finished or under way. Files are opened when something is read, and closed again.

    dimension: as in /run of results.h5; period, origin: of the start, 0 along axes that are not periodic; steps, times: what is written; starts: what
    was run from which step on, a Start for the begin and for each restart; version, command, input_text, case: those of the last start.
    """

    _kind = "the results of a run"
    #: columns that each table of a step has
    _columns = {"bodies": ("id", "position", "velocity", "radius"), "boundaries": ("position", "normal", "velocity", "force"),
                "cell": ("axis", "edge", "velocity", "origin"), "contacts": ("candidate", "antagonist", "normal", "gap", "impulse"),
                "regions": ("bin", "lower", "upper", "volume", "grains", "solid_fraction", "velocity", "granular_temperature", "stress",
                            "contacts_per_grain")}

    def __init__(self, directory):
        self.directory = _path(directory, "a directory")
        self.path = self.directory / "results.h5"
        with self._open() as file:
            what = file["run"].attrs
            self.dimension = int(what["dimension"])
            self.starts = starts_in(file["run"])
            self.version, self.command, self.input_text, self.case = self.starts[-1][1:]
            self.period, self.origin = (np.array([what.get(f"{name}_{axis}", 0.0) for axis in "xyz"[:self.dimension]]) for name in ("period", "origin"))
            self.steps = np.array(sorted(int(name) for name in file["steps"]), dtype=int)
            self.times = np.array([file[f"steps/{step}"].attrs["time"] for step in self.steps], dtype=float)
            if not any(name.startswith("period_") for name in what):
                # an earlier version wrote no period: that of the input
                self.period, self.origin = (entries(self.case.get("scene", [{}])[0], name, np.zeros(self.dimension)) for name in ("period", "period_origin"))

    @contextmanager
    def _open(self):
        """The file, open."""
        with _opened(self.path, self._kind) as file:
            self._check(file)
            yield file

    def _check(self, file):
        if "run" not in file or "steps" not in file:
            raise ResultsError(f"{self.path}: no groups /run and /steps; expected the results of a run")

    def case_at(self, step):
        """The input by groups that was in force in a step: a restart may change some of its keys."""
        return next(start.case for start in reversed(self.starts) if start.step <= step or start.step == 0)

    def find_step(self, step=None):
        """A step that is written: the last one unless told."""
        if step is None and len(self.steps) > 0:
            return int(self.steps[-1])
        if step is None or step not in self.steps:
            held = ", ".join(map(str, self.steps)) or "none, the file has no step"
            raise ResultsError(f"{self.path}: no step {step}; expected one of {held}")
        return int(step)

    def _group(self, step, name):
        step = self.find_step(step)
        with self._open() as file:
            group = file[f"steps/{step}"]
            return self._table(group[name], name) if name in group else None

    def _table(self, group, kind):
        table = Table({key: self._values(group[key]) for key in group})
        for key in self._columns[kind]:
            if key not in table:
                raise ResultsError(f"{self.path}: {group.name}: no {key}; expected {', '.join(self._columns[kind])}")
        for key, values in table.items():
            if len(values) != len(table):
                raise ResultsError(f"{self.path}: {group.name}/{key}: {len(values)} rows; expected {len(table)}, as in the others")
            if key not in ("name", "shape") and values.dtype.kind not in "iuf":
                raise ResultsError(f"{self.path}: {group.name}/{key}: values of type {values.dtype}; expected numbers")
            if key in FINITE and not np.isfinite(values).all():
                raise ResultsError(f"{self.path}: {group.name}/{key}: a value that is not a finite number")
            if key == "radius" and not np.all(values > 0.0):
                raise ResultsError(f"{self.path}: {group.name}/{key}: {values.min():g}; expected radii above 0")
            if key in ("position", "velocity", "normal", "impulse", "force", "point") and (values.ndim != 2 or values.shape[1] < self.dimension):
                raise ResultsError(f"{self.path}: {group.name}/{key}: shape {values.shape}; expected (rows, {self.dimension} or more)")
        return table

    def _values(self, dataset):
        """What a dataset holds, once it was found to be what was written."""
        if not isinstance(dataset, h5py.Dataset) or not dataset.shape:
            raise ResultsError(f"{self.path}: {dataset.name}: expected a dataset of rows")
        if dataset.size > 0 and dataset.id.get_storage_size() == 0:
            raise ResultsError(f"{self.path}: {dataset.name}: {len(dataset)} rows, of which none is in the file")
        values = dataset[()]
        if not is_whole(dataset, values):
            raise ResultsError(f"{self.path}: {dataset.name}: its attribute checksum is not that of what it holds: the file is damaged, or "
                               "was changed since it was written")
        return values

    def time(self, step=None):
        """Time of a step [s]."""
        return float(self.times[self.steps == self.find_step(step)][0])

    def velocity_error(self, step=None):
        """Estimated error of the velocities of a step [m/s]; NaN at the start, which no solve has led to."""
        return self._attribute(step, "velocity_error")

    def velocity_scale(self, step=None):
        """Velocity that the error of a step is compared with [m/s]; NaN at the start."""
        return self._attribute(step, "velocity_scale")

    def _attribute(self, step, name):
        with self._open() as file:
            return float(file[f"steps/{self.find_step(step)}"].attrs.get(name, np.nan))

    def bodies(self, step=None):
        """id, position (n, d), velocity (n, d), spin (n, 1 or 3), radius, image (n, d) in periodic scenes and, where bodies have shapes,
        shape (n), 0 for a disk or a sphere, else a row of `shapes` from 1 on, and orientation (n, 1 or 4)."""
        return self._split(self._group(step, "bodies"))

    def body(self, number):
        """A body, by its id, over the written states that have it, a row a state: step, time and the columns of `bodies`. In a periodic scene
        position does not jump where the body crosses the cell, and velocity does not where the cell is sheared or strained."""
        rows = []
        for step, time in zip(self.steps, self.times):
            bodies = self.bodies(step)
            row = np.flatnonzero(bodies.id == number)
            if len(row) == 0:
                continue
            one = {"step": step, "time": time, **{key: values[row[0]] for key, values in bodies.items()}}
            if "image" in one:
                cell = self.cell(step)
                one["position"] = one["position"] + one["image"] @ (np.diag(self.period) if cell is None else cell.edge)
                if cell is not None:
                    one["velocity"] = one["velocity"] + one["image"] @ cell.velocity
            rows.append(one)
        if not rows:
            raise ResultsError(f"{self.path}: no body {number} in the written states; expected an id of bodies()")
        return Table({key: np.array([one[key] for one in rows]) for key in rows[0] if all(key in one for one in rows)})

    def boundaries(self, step=None):
        """id, name, shape, position, normal, velocity, spin, force, a row each, and how they lie: edges (n, d - 1, d) where some are segments or
        rectangles, axis (n, d) where some are cylinders, axes (n, d, d) where some have facets."""
        rows = self._split(self._group(step, "boundaries"))
        with self._open() as file:
            for key in ("name", "shape"):
                if file[f"boundaries/{key}"].dtype.kind in "iuf":
                    raise ResultsError(f"{self.path}: /boundaries/{key}: numbers; expected texts")
                rows[key] = np.array([text_of(value) for value in self._values(file[f"boundaries/{key}"])], dtype=str)
        for key in {"edges", "axes"} & set(rows):
            rows[key] = rows[key].reshape(len(rows[key]), -1, self.dimension)
        return rows

    def cell(self, step=None):
        """The edges of a periodic cell that moves, a row an axis: Table with edge, velocity, origin; None where none does."""
        return self._group(step, "cell")

    def facets(self, step=None):
        """Facets of mesh walls where they are: boundary (its id) and corners (n, d, d), a row a corner [m]; None where there are none."""
        with self._open() as file:
            if "facets" not in file:
                return None
            boundary, corners = (self._values(file[f"facets/{key}"]) for key in ("boundary", "corners"))
        rows = self.boundaries(step)
        row = {number: k for k, number in enumerate(rows.id)}
        of = np.array([row[number] for number in boundary], dtype=int)
        corners = corners.reshape(-1, self.dimension, self.dimension)
        return Table({"boundary": boundary, "corners": corners @ rows.axes[of] + rows.position[of][:, None, :]})

    def contacts(self, step=None):
        """candidate, antagonist, normal (n, d), gap, impulse (n, d) as n, t[, s]; moment (n, 1 or 3) with rolling or pivoting friction,
        point (n, d) where bodies have shapes, elongation (n, d) with tangential springs; None where none are written."""
        return self._group(step, "contacts")

    def forces(self, step=None):
        """The force of each contact on its candidate in global axes: candidate, antagonist, force (n, d) [N], point (n, d) [m] half-way between
        the surfaces in the middle of the step, where it acts, and, with rolling or pivoting friction, moment (n, 1 or 3) [N m]."""
        bodies, contacts = self.bodies(step), self._contacts_or_error(step)
        axes = [contacts.normal, *tangents(contacts.normal)]
        found = {"candidate": contacts.candidate, "antagonist": contacts.antagonist, "force": along(contacts.impulse, axes) / self.time_step()}
        if "point" in contacts:
            found["point"] = contacts.point
        else:
            row, _ = self._rows(bodies, contacts)
            found["point"] = self.in_the_middle(step)[0].position[row] - (bodies.radius[row] + 0.5 * contacts.gap)[:, None] * contacts.normal
        if "moment" in contacts:
            moment = np.reshape(contacts.moment, (len(contacts), 2 * self.dimension - 3))
            found["moment"] = (moment if self.dimension == 2 else along(moment, axes)) / self.time_step()
        return Table(found)

    def in_the_middle(self, step=None):
        """The bodies with their places in the middle of a step, where contacts are found, and the periodic cell if it moves, else None."""
        bodies, cell = self.bodies(step), self.cell(step)
        way = float(self.case.get("time", [{}])[0].get("theta", 0.5)) * self.time_step()
        # the velocity of the end of the step leads to its place from that in the middle
        moved = Table({**bodies, "position": bodies.position - way * bodies.velocity})
        if cell is not None:
            edge = cell.edge - way * cell.velocity
            # the middle of the box, whose lengths are the diagonal, stays
            cell = Table({**cell, "edge": edge, "origin": cell.origin + 0.5 * np.diag(cell.edge - edge)[:, None]})
        return moved, cell

    def shapes(self):
        """Shapes of the bodies, a list: number k of a body is its item k - 1; empty where all are disks or spheres."""
        with self._open() as file:
            if "shapes" not in file:
                return []
            tables = {name: Table({key: self._values(value) for key, value in group.items() if isinstance(value, h5py.Dataset)})
                      for name, group in [("shapes", file["shapes"]), *file["shapes"].items()] if isinstance(group, h5py.Group)}
        tables["shapes"]["name"] = np.array([text_of(value) for value in tables["shapes"].name])
        return shapes_of(tables)

    def outlines(self, step=None):
        """Polygons of each body, a list of lists of arrays (points, d): outlines in 2D, surfaces in 3D, with sharp corners."""
        bodies, shapes = self.bodies(step), [ball(self.dimension), *self.shapes()]
        parts = [shape.polygons() for shape in shapes]
        if len(shapes) == 1 or "shape" not in bodies:
            return [[centre + radius * points for points in parts[0]] for centre, radius in zip(bodies.position, bodies.radius)]
        return [[centre + radius * points @ axes.T for points in parts[number]] for centre, radius, number, axes in
                zip(bodies.position, bodies.radius, bodies.shape, axes_of(bodies.orientation))]

    def diagnostics(self, step=None):
        """Figures of the step by name, as `&output` asked for; empty where none are written."""
        with self._open() as file:
            place = f"steps/{self.find_step(step)}/diagnostics"
            return {name: float(value) for name, value in file[place].attrs.items()} if place in file else {}

    def regions(self, step=None):
        """Names of the regions of means that a step has, those of the `&region` groups of the input."""
        with self._open() as file:
            place = f"steps/{self.find_step(step)}/regions"
            return list(file[place]) if place in file else []

    def region(self, name, step=None):
        """Means over a region, a row a bin: bin, lower (n, d), upper (n, d), centre (n, d), volume, grains, solid_fraction, velocity (n, d),
        granular_temperature, stress (n, d, d), force by branch, compression positive, pressure and contacts_per_grain."""
        step = self.find_step(step)
        with self._open() as file:
            place = f"steps/{step}/regions/{name}"
            held = list(file[f"steps/{step}/regions"]) if f"steps/{step}/regions" in file else []
            if name not in held:
                raise ResultsError(f"{self.path}: no region {name} in step {step}; expected one of {', '.join(held) or 'none, the step has no regions'}")
            rows = self._table(file[place], "regions")
        if any(values.ndim != 1 + (key in ("lower", "upper", "velocity", "stress")) for key, values in rows.items()):
            raise ResultsError(f"{self.path}: /{place}: an array of another shape than a run writes")
        if rows.stress.shape[1] != self.dimension**2:
            raise ResultsError(f"{self.path}: /{place}/stress: shape {rows.stress.shape}; expected (rows, {self.dimension**2})")
        rows["stress"] = rows.stress.reshape(-1, self.dimension, self.dimension)
        rows["centre"] = 0.5 * (rows.lower + rows.upper)
        rows["pressure"] = np.trace(rows.stress, axis1=1, axis2=2) / self.dimension
        return rows

    def steps_in(self, asked):
        """The written steps that are asked for, in their order: "all" after the start, or numbers, None for the last one, and pairs (first, last) for those from one step to another, whose ends are
        None where the run has its own."""
        written = [int(step) for step in self.steps if step > 0]
        if not written:
            raise ResultsError(f"{self.path}: no step after the start; expected one at least")
        chosen = set(written if isinstance(asked, str) and asked == "all" else [])
        for part in [] if isinstance(asked, str) and asked == "all" else asked:
            if not isinstance(part, tuple):
                chosen.add(self.find_step(part))
                continue
            first, last = part[0] or 0, written[-1] if part[1] is None else part[1]
            among = [step for step in written if first <= step <= last]
            if not among:
                raise ResultsError(f"{self.path}: no written step from {first} to {last}; expected some of {written[0]} to {written[-1]}")
            chosen.update(among)
        return sorted(chosen)

    def region_mean(self, name, steps=None):
        """The means over written steps, all after the start unless told, of a region, a row a bin with the columns of `region`. Velocities and
        granular temperatures are weighted by the volume of the grains in the bin, contacts_per_grain by their number. Empty bins have NaN."""
        steps = [step for step in self.steps if step > 0] if steps is None else list(steps)
        if not steps:
            raise ResultsError(f"{self.path}: no step with means over regions; expected one after the start")
        tables = [self.region(name, step) for step in steps]
        weights = {"velocity": [rows.solid_fraction * rows.volume for rows in tables], "contacts_per_grain": [rows.grains for rows in tables]}
        weights["granular_temperature"] = weights["velocity"]
        found = Table()
        for key in tables[0]:
            values = np.array([rows[key] for rows in tables], dtype=float)
            weight = np.array(weights.get(key, np.ones(values.shape[:2])), dtype=float).reshape(values.shape[:2] + (1,) * (values.ndim - 2))
            total = weight.sum(axis=0)
            found[key] = np.where(total > 0.0, (weight * np.where(weight > 0.0, values, 0.0)).sum(axis=0) / np.where(total > 0.0, total, 1.0), np.nan)
        return found

    def verdict(self):
        """What run.log says of the whole run, restarts with it: 'converged', 'converged with doubts', which `doubts` has, 'not converged', 'converged only by'
        another criterion than the velocity error, or 'not finished'."""
        return verdict(self._log())

    def doubts(self):
        """What makes the results less than converged ones, in the words of run.log: projected or large overlaps, grains too fast for the step, large errors of
        velocities, drift, fallen grains. Empty where there is nothing of the kind."""
        return doubts(self._log())

    def _log(self):
        try:
            return (self.directory / "run.log").read_text(encoding="utf-8", errors="replace")
        except OSError as reason:
            raise ResultsError(f"{self.directory / 'run.log'}: {reason.strerror}; expected the log of a run") from None

    def history(self):
        """history.csv: a row a step, or with history_every fewer. `history().means(100)` are the means of a hundred steps after each other."""
        return read_history(self.directory)

    def trace(self):
        """trace.csv: a row a check of a solve; written with `trace = .true.`."""
        self._check_own("trace.csv", "trace")
        return read_table(self.directory / "trace.csv", ("step", "iteration", "residual"))

    def _check_own(self, name, key):
        """Refuse a file of an older run in the same directory: one that no case of this run asks for."""
        path = self.directory / name
        if path.exists() and not any(keys.get(key) is True for start in self.starts for keys in start.case.get("output", [])):
            raise ResultsError(f"{path}: of an older run in this directory, since this one has no &output {key} = .true.; expected a run that writes it")

    def _split(self, rows):
        if rows is None:
            raise ResultsError(f"{self.path}: a step without bodies or boundaries; expected {self._kind}")
        if "velocity" in rows:
            rows["spin"] = rows["velocity"][:, self.dimension:]
            rows["velocity"] = rows["velocity"][:, :self.dimension]
        return rows

    # ---- derived

    def time_step(self):
        """Of the run [s], from the input."""
        try:
            return float(self.case["time"][0]["step"])
        except (LookupError, TypeError, ValueError):
            raise ResultsError(f"{self.path}: its case has no time step; expected {self._kind}") from None

    def chains(self, step=None):
        """Contacts as segments (n, 2, d), from the centre of the candidate to that of the antagonist's nearest image, or to
        the boundary, and their normal forces [N] (n). Where bodies have shapes: segments from each centre to the contact."""
        bodies, contacts = self.bodies(step), self._contacts_or_error(step)
        row, other = self._rows(bodies, contacts)
        if "point" in contacts:
            body, contact, arm = self._arms(step, bodies, contacts)
            segments = np.stack([bodies.position[body], bodies.position[body] + arm], axis=1)
            return segments, contacts.impulse[contact, 0] / self.time_step()
        start = bodies.position[row]
        segments = np.stack([start, start - self._branches(step, bodies, contacts)], axis=1)
        return segments, contacts.impulse[:, 0] / self.time_step()

    def pressure(self, step=None):
        """Mean pressure of the normal forces in each body [Pa, N/m in 2D] (n): R sum(normal forces)/(d V), with V its own volume or
        area; of bodies with shapes, the way from the centre to the contact along the normal in the place of R."""
        bodies, contacts = self.bodies(step), self._contacts_or_error(step)
        row, other = self._rows(bodies, contacts)
        force = contacts.impulse[:, 0] / self.time_step()
        if "point" in contacts:
            body, contact, arm = self._arms(step, bodies, contacts)
            sign = np.where(bodies.id[body] == contacts.candidate[contact], -1.0, 1.0)
            total = np.bincount(body, sign * force[contact] * (arm * contacts.normal[contact]).sum(axis=1), len(bodies))
            return total / (self.dimension * self.volumes(bodies))
        total = np.bincount(row, force, len(bodies))
        total += np.bincount(other[other >= 0], force[other >= 0], len(bodies))
        return bodies.radius * total / (self.dimension * self.volumes(bodies))

    def volumes(self, bodies):
        """Volume, in the plane area, of each body of a table of them (n)."""
        shapes = [ball(self.dimension), *(self.shapes() if "shape" in bodies else [])]
        number = bodies.shape if len(shapes) > 1 else np.zeros(len(bodies), dtype=int)
        return np.array([shape.volume for shape in shapes])[number] * bodies.radius**self.dimension

    def ball_volume(self):
        """Volume of a ball of radius 1, in the plane area of a disk."""
        return ball(self.dimension).volume

    def subdomain(self, step=None):
        """Subdomain that holds each body (n), from 1; from bodies.vtkhdf, which `vtk = .true.` writes."""
        step = self.find_step(step)
        path = self.directory / "bodies.vtkhdf"
        self._check_own("bodies.vtkhdf", "vtk")
        with _opened(path, "that of a run with &output vtk = .true.") as file:
            steps = file["VTKHDF/Steps"]
            count = int(steps.attrs["NSteps"])
            place = np.flatnonzero(file["step"][:count] == step)
            if len(place) == 0:
                raise ResultsError(f"{path}: no step {step}")
            if "VTKHDF/CellData/subdomain" in file:
                # polygons of bodies, one after the other
                first = int(steps["CellOffsets"][place[0]][2])
                number = int(file["VTKHDF/Polygons/NumberOfCells"][place[0]])
                cells = file["VTKHDF/CellData"]
                _, rows = np.unique(cells["id"][first:first + number], return_index=True)
                return cells["subdomain"][first:first + number].astype(int)[rows]
            first = int(steps["PointOffsets"][place[0]])
            number = int(file["VTKHDF/NumberOfPoints"][place[0]])
            return file["VTKHDF/PointData/subdomain"][first:first + number].astype(int)

    def _contacts_or_error(self, step):
        contacts = self.contacts(step)
        if contacts is None:
            raise ResultsError(f"{self.path}: no contacts in step {self.find_step(step)}; &output contacts = .true. writes them")
        return contacts

    def _arms(self, step, bodies, contacts, edges=None):
        """Row of the body, row of the contact and way from the centre to the contact, of both bodies of all contacts; of the images of a
        body in a periodic scene, by the edges of the step unless told, the one that is nearest to the contact counts."""
        row, other = self._rows(bodies, contacts)
        body, contact = np.concatenate([row, other]), np.tile(np.arange(len(contacts)), 2)
        body, contact = body[body >= 0], contact[body >= 0]
        arm = contacts.point[contact] - bodies.position[body]
        for edge in self._edges(step) if edges is None else edges:
            images = np.stack([arm, arm - edge, arm + edge])
            arm = images[np.argmin(np.linalg.norm(images, axis=2), axis=0), np.arange(len(arm))]
        return body, contact, arm

    def _branches(self, step, bodies, contacts):
        """The way from the centre of the antagonist's nearest image, or from a boundary, to that of the candidate, of each contact (n, d)."""
        row, other = self._rows(bodies, contacts)
        if "point" not in contacts:
            return (bodies.radius[row] + contacts.gap + np.where(other >= 0, bodies.radius[other], 0.0))[:, None] * contacts.normal
        _, _, arm = self._arms(step, bodies, contacts)
        way = -arm[:len(contacts)]
        way[other >= 0] += arm[len(contacts):]
        return way

    def _edges(self, step):
        """The edges of the period, a row each. The last one of a cell that is sheared comes first: it leans along the edges before it, which
        then bring what is shifted by it back."""
        cell = self.cell(step)
        if cell is not None:
            return cell.edge[::-1]
        return np.diag(self.period)[self.period > 0]

    def _rows(self, bodies, contacts):
        """Rows of candidates and antagonists in `bodies`, whose ids ascend; -1 for boundaries."""
        if np.any(np.diff(bodies.id) <= 0) or not np.isin(contacts.candidate, bodies.id).all():
            raise ResultsError(f"{self.path}: bodies whose ids do not ascend, or a contact whose candidate is none of them; expected {self._kind}")
        row = np.searchsorted(bodies.id, contacts.candidate)
        other = np.minimum(np.searchsorted(bodies.id, contacts.antagonist), len(bodies) - 1)
        return row, np.where(bodies.id[other] == contacts.antagonist, other, -1)


class BodiesFile(Run):
    """A bodies file in HDF5, as gravier_sample and `final_bodies` leave it, read as a run of one step 0 without contacts: bodies, and
    the walls as boundaries, which are planes. What is optional in the file is there only where the file has it. It names shapes but
    does not hold them: outlines are those of the balls that hold the bodies."""

    _kind = "a bodies file"
    _columns = {"bodies": ("id", "position", "radius"), "walls": ("id", "point", "normal")}

    def __init__(self, path):
        self.path = _path(path, "a file")
        self.directory = self.path.parent
        with self._open() as file:
            self.dimension = int(file["bodies/position"].shape[1])
            self.period, self.origin = (self._values(file[f"box/{name}"]) if "box" in file else np.zeros(self.dimension) for name in ("period", "origin"))
        self.steps, self.times, self.case, self.starts = np.array([0]), np.array([0.0]), {}, [Start(0, "", "", "", {})]

    def _check(self, file):
        if any(f"bodies/{name}" not in file for name in ("id", "position", "radius")):
            raise ResultsError(f"{self.path}: no /bodies with id, position and radius; expected a bodies file")

    def _group(self, step, name):
        self.find_step(step)
        with self._open() as file:
            return self._table(file[name], name) if name in file else None

    def boundaries(self, step=None):
        """id, name, shape, position, normal."""
        rows = self._group(step, "walls") or Table(id=np.zeros(0, int), point=np.zeros((0, self.dimension)),
                                                   normal=np.zeros((0, self.dimension)))
        return Table(id=rows.id, name=np.array([f"wall {number}" for number in rows.id], dtype=str), shape=np.full(len(rows), "plane"),
                     position=rows.point, normal=rows.normal)

    def cell(self, step=None):
        """As that of a run: axis, edge, velocity, origin of a cell that may be sheared; None where the file has no edges."""
        self.find_step(step)
        with self._open() as file:
            if "box/edge" not in file:
                return None
            edge = self._values(file["box/edge"])
            velocity = self._values(file["box/velocity"]) if "box/velocity" in file else np.zeros_like(edge)
        return Table(axis=np.arange(1, self.dimension + 1), edge=edge, velocity=velocity, origin=self.origin[:, None])

    def facets(self, step=None):
        """None: a bodies file has no mesh walls."""
        self.find_step(step)

    def contacts(self, step=None):
        """None: the forces to start from that a bodies file may have are no contacts of a run."""
        self.find_step(step)

    def _contacts_or_error(self, step):
        self._missing("contacts")

    def _attribute(self, step, name):
        self.find_step(step)
        return np.nan

    def _missing(self, what):
        raise ResultsError(f"{self.path}: a bodies file has no {what}; expected the results of a run")

    def time_step(self):
        """An error, as the two below: a bodies file has none."""
        self._missing("time step")

    def history(self):
        self._missing("history")

    def trace(self):
        self._missing("trace")

    def subdomain(self, step=None):
        """An error: a bodies file has none."""
        self._missing("subdomains")


def _path(given, what):
    try:
        return Path(given)
    except TypeError:
        raise ResultsError(f"{given!r}: expected the path of {what}") from None
