"""Tables of what a run left: columns by name, from CSV files and for pandas."""
import csv

import numpy as np
from whole_file import whole_file


class ResultsError(Exception):
    """One line: what was found and what was expected."""


#: columns whose only component, in the plane, is about z
TURNS = ("spin", "moment")


class Table(dict):
    """Columns by name, as keys and as attributes: arrays (rows) or (rows, components)."""

    def __getattr__(self, name):
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"no column {name}; expected one of {', '.join(self) or 'none'}") from None

    def __len__(self):
        return len(next(iter(self.values()))) if self.keys() else 0

    def rows(self, chosen):
        """The chosen rows."""
        return Table({name: values[chosen] for name, values in self.items()})

    def means(self, rows):
        """The means of so many rows after each other, as a table; rows behind the last whole block are left out."""
        if rows < 1 or rows > len(self):
            raise ResultsError(f"means of {rows} rows; expected 1 to {len(self)}, the rows that there are")
        blocks = len(self) // rows
        return Table({name: values[:blocks * rows].reshape(blocks, rows, *values.shape[1:]).mean(axis=1) for name, values in self.items()})

    def frame(self):
        """A pandas DataFrame of the columns of `flat`."""
        try:
            import pandas
        except ImportError:
            raise ResultsError("frame: there is no pandas; expected a python3 that has it, or the arrays of the table") from None

        return pandas.DataFrame(self.flat())

    def flat(self):
        """Columns of one number a row, by name: component x of a column becomes NAME_x, component x, y of a tensor NAME_xy, component y of corner or edge 1 NAME_1y. Impulses
        and moments of contacts have NAME_n, NAME_t, NAME_s, quaternions NAME_w, NAME_x, NAME_y, NAME_z; what turns in the plane turns about z."""
        columns = {}
        for name, values in self.items():
            parts = values.reshape(len(values), int(np.prod(values.shape[1:])))
            columns.update({name + ending: part for ending, part in zip(self._endings(name, values.shape[1:]), parts.T)})
        return columns

    def _endings(self, name, shape):
        """What the components of a column of this shape have behind its name."""
        if shape in ((), (1,)):
            return ["_z" if name in TURNS else ""]
        axes = "nts" if name in ("impulse", "moment") and "impulse" in self else "wxyz" if shape == (4,) else "xyz"
        rows = [""] if len(shape) == 1 else "123" if name in ("corners", "edges") else axes
        return [f"_{row}{axis}" for row in rows[:shape[0] if len(shape) > 1 else 1] for axis in axes[:shape[-1]]]


def read_table(path, columns=()):
    """A CSV file with one row of names: numbers by column. `columns` are those that it must have. A last row without its end is left out."""
    try:
        with open(path, newline="", encoding="utf-8", errors="replace") as file:
            # the last row of a run that is under way or was killed may be cut off
            header, *rows = list(csv.reader(file.read().rpartition("\n")[0].splitlines())) or [[]]
    except OSError as reason:
        raise ResultsError(f"{path}: {reason.strerror}; expected a table that a run wrote") from None
    except (ValueError, csv.Error) as reason:
        raise ResultsError(f"{path}: {one_line(reason)}; expected a table that a run wrote") from None
    for line, row in enumerate(rows, 2):
        if len(row) != len(header):
            raise ResultsError(f"{path}: line {line}: {len(row)} values; expected {len(header)}, as many as names")
    try:
        values = np.array(rows, dtype=float).reshape(len(rows), len(header))
    except ValueError as reason:
        raise ResultsError(f"{path}: {reason}; expected numbers under a row of names") from None
    for name in columns:
        if name not in header:
            raise ResultsError(f"{path}: no column {name}; expected a table that a run wrote")
    return Table({name: values[:, k] for k, name in enumerate(header)})


def write_table(path, columns, digits=6):
    """Columns by name as a CSV file with one row of names."""
    with whole_file(path) as part, open(part, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows([f"{value:.{digits}g}" if isinstance(value, (float, np.floating)) else value for value in row]
                        for row in zip(*columns.values()))


def one_line(reason):
    """An error of a library on one line."""
    return " ".join(str(reason).split())
