"""Bodies files in CSV, of disks and spheres: what modules/bodies/files/bodies_csv.f90 reads without a file of shapes."""
import csv

import numpy as np

from .checksum import sealed_as
from .tables import ResultsError, Table

#: columns by the dimension: those that each table has, those that grains may have
REQUIRED = {2: ("id", "x", "y", "radius"), 3: ("id", "x", "y", "z", "radius")}
VELOCITY = {2: ("vx", "vy", "omega"), 3: ("vx", "vy", "vz", "wx", "wy", "wz")}
NORMAL = {2: ("nx", "ny"), 3: ("nx", "ny", "nz")}


class BodiesTable:
    """A bodies file in CSV: `bodies()` and `boundaries()`, its walls, as a gravier.BodiesFile has them."""

    def __init__(self, path):
        self.path = path
        header, rows = self._rows()
        self.dimension = 3 if "z" in header else 2
        known = (*REQUIRED[self.dimension], *VELOCITY[self.dimension], "mass", "shape", *NORMAL[self.dimension], "group", "material")
        for name in header:
            if name not in known or header.count(name) > 1:
                raise ResultsError(f"{path}: column {name}; expected each of {', '.join(known)} once at most. A body with a shape needs a bodies file in HDF5")
        for name in REQUIRED[self.dimension]:
            if name not in header:
                raise ResultsError(f"{path}: no column {name}; expected {', '.join(REQUIRED[self.dimension])}")
        self._grains, self._planes = [], []
        for line, cells in rows:
            if len(cells) != len(header):
                raise ResultsError(f"{path}: line {line}: {len(cells)} cells; expected {len(header)}, as many as columns")
            row = {"line": line, **dict(zip(header, (cell.strip() for cell in cells)))}
            what = row.get("shape", "").lower()
            if what not in ("", "grain", "plane"):
                raise ResultsError(f"{path}: line {line}: shape {what}; expected grain or plane, or a bodies file in HDF5 for a body with a shape")
            (self._planes if what == "plane" else self._grains).append(row)
        if not self._grains:
            raise ResultsError(f"{path}: no body; expected one at least")

    def _rows(self):
        """The names of the columns, and the line and the cells of each row."""
        try:
            with open(self.path, "rb") as file:
                text = file.read()
            # comments may have any letters
            lines = text.decode(errors="replace").splitlines()
        except OSError as reason:
            raise ResultsError(f"{self.path}: {reason.strerror}; expected a bodies file") from None
        if not sealed_as(text):
            raise ResultsError(f"{self.path}: the checksum in its first line is not that of what it holds: the file is damaged, or was changed since it was sealed")
        rows = [(number, next(csv.reader([line]))) for number, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
        if not rows:
            raise ResultsError(f"{self.path}: no row; expected a table of bodies")
        return [name.strip().lower() for name in rows[0][1]], rows[1:]

    def _column(self, rows, name, kind=float, empty=None):
        """Numbers of a column; `empty` where a cell is."""
        found = []
        for row in rows:
            try:
                found.append(kind(row[name]) if row.get(name, "") != "" else empty)
                if found[-1] is None or not np.isfinite(found[-1]):
                    raise ValueError
            except ValueError:
                raise ResultsError(f"{self.path}: line {row['line']}: {name} '{row.get(name, '')}'; expected {'an integer' if kind is int else 'a number'}") from None
        return np.array(found, dtype=kind)

    def _vectors(self, rows, names, empty=None):
        return np.stack([self._column(rows, name, empty=empty) for name in names], axis=1)

    def bodies(self):
        rows, axes = self._grains, "xyz"[:self.dimension]
        table = Table(id=self._column(rows, "id", int), position=self._vectors(rows, axes), radius=self._column(rows, "radius"),
                      velocity=self._vectors(rows, VELOCITY[self.dimension][:self.dimension], 0.0),
                      spin=self._vectors(rows, VELOCITY[self.dimension][self.dimension:], 0.0), group=self._column(rows, "group", int, 0),
                      material=self._column(rows, "material", int, 1))
        if any(row.get("mass", "") != "" for row in rows):
            table["mass"] = self._column(rows, "mass")
        for name, least in (("radius", 0.0), ("mass", 0.0)):
            if name in table and not np.all(table[name] > least):
                raise ResultsError(f"{self.path}: line {rows[int(np.argmin(table[name]))]['line']}: {name} {table[name].min():g}; expected a number above 0")
        return table

    def boundaries(self):
        rows, axes = self._planes, "xyz"[:self.dimension]
        if not rows:
            return Table(id=np.zeros(0, dtype=int), position=np.zeros((0, self.dimension)), normal=np.zeros((0, self.dimension)))
        normal = self._vectors(rows, NORMAL[self.dimension])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        if not np.all(length > 0.0):
            raise ResultsError(f"{self.path}: line {rows[int(np.argmin(length))]['line']}: a normal of 0; expected another one")
        return Table(id=self._column(rows, "id", int), position=self._vectors(rows, axes), normal=normal / length)
