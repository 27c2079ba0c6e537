"""Tables that are measured from a run, which know of which one: a table of an older run in the same directory is not taken for one of the new one."""
import zlib

import h5py
import numpy as np

from .outflows import former_name
from .tables import ResultsError, Table, read_table, write_table

#: the column, behind the others
COLUMN = "run_checksum"
#: columns of history.csv that differ where the same steps are made once more
CLOCKS = ("wall_seconds", "solve_seconds")


def run_checksum(run, last):
    """A number of what a run has computed up to a step, from the checksums of its written states and from history.csv. A restart that goes on with the run
    does not change it."""
    number = 0
    with run._open() as file:
        for step in run.steps[run.steps <= last]:
            group = file[f"steps/{step}"]
            sums = [int(values.attrs.get("checksum", 0)) for name in ("bodies", "boundaries") if name in group for values in group[name].values()
                    if isinstance(values, h5py.Dataset)]
            number = zlib.crc32(np.array([step, *sums], dtype=np.int64).tobytes(), number)
    if (run.directory / "history.csv").exists():
        history = run.history()
        rows = [values[history.step <= last] for name, values in history.items() if name not in CLOCKS]
        number = zlib.crc32(np.array(rows).tobytes(), number)
    return number


def write_measured(path, run, table):
    """A table with the column step, measured from a run, as a CSV file that knows of which one."""
    number = run_checksum(run, np.max(table.step, initial=0.0))
    write_table(path, {**table, COLUMN: np.full(len(table), number, dtype=np.int64)}, 9)


def read_measured(run, name):
    """A table in the directory of a run, without the number of the run. One that was measured from another run is refused; a table without this number,
    of another program or of an earlier version, is taken as it is."""
    path = run.directory / name
    table = read_table(path, ("time",))
    number = table.pop(COLUMN, None)
    if "left_mass" in table and "mass_rate" in table:
        raise ResultsError(f"{path}: {former_name('left_mass')}; expected the table of gravier_measure outflow of this version")
    if number is not None and len(number) > 0 and "step" in table and number[-1] != run_checksum(run, table.step.max()):
        raise ResultsError(f"{path}: measured from another run than the one whose results are in {run.directory}; expected a table of this run, which gravier_measure makes "
                           "anew")
    return Table(table)
