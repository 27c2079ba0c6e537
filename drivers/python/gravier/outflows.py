"""Discharge: how many grains have left a scene through outlets, their mass, and the rates."""
import numpy as np

from .tables import ResultsError, Table

#: columns that had other names before, in the table of what has left
FORMER = {"left": "total_left", "left_mass": "total_left_mass"}


def former_name(name):
    """What is said of a name that a column of an outflow had before."""
    return f"column {name} of an outflow is now {FORMER[name]}; {name} is that of single steps, in history.csv"


class Outflow(Table):
    """The table of `outflow`. Names of columns of earlier versions, which history.csv has for single steps, are refused with the new ones."""

    def __getattr__(self, name):
        if name in FORMER:
            raise AttributeError(former_name(name))
        return super().__getattr__(name)

    def __missing__(self, name):
        raise KeyError(former_name(name) if name in FORMER else name)


def outflow(run, mean=1, since=0.0):
    """What has left through outlets, from history.csv: a row for `mean` steps after each other, or for 1 each row of history.csv, with step and time of their end, total_left and
    total_left_mass, the number and the mass [kg] of the grains that have left since the time `since` [s], number_rate [1/s] and mass_rate [kg/s] over these steps. Steps behind
    the last whole block are left out. In the plane masses are those of a length of 1 m."""
    if not isinstance(mean, (int, np.integer)) or mean < 1:
        raise ResultsError(f"mean {mean!r}: expected a whole number of steps above 0")
    history = run.history()
    if "left_mass" not in history:
        raise ResultsError(f"{run.directory}/history.csv: no column left_mass; expected a run with a boundary of shape outlet")
    rows = history.after(since)
    if rows.steps() < mean:
        raise ResultsError(f"{run.directory}/history.csv: {rows.steps()} steps after {since:g} s; expected {mean} at least")
    step = rows.step if mean == 1 else rows.start + mean * np.arange(1.0, rows.steps() // mean + 1)
    # each step in which grains leave has a row
    last = np.searchsorted(rows.step, step, side="right")
    found = {"step": step, "time": history.time_of(step)}
    for total, name in (("total_left", "left"), ("total_left_mass", "left_mass")):
        found[total] = np.append(0.0, np.cumsum(rows[name]))[last]
    for rate, total in (("number_rate", "total_left"), ("mass_rate", "total_left_mass")):
        found[rate] = np.diff(found[total], prepend=0.0) / np.diff(found["time"], prepend=history.time_of(rows.start))
    return Outflow(found)
