"""Discharge: how many grains have left a scene through outlets, their mass, and the rates."""
import numpy as np

from .tables import ResultsError, Table


def outflow(run, mean=1, since=0.0):
    """What has left through outlets, from history.csv: a row for `mean` steps after each other, with step and time of their end, left and left_mass, the
    number and the mass [kg] of the grains that have left since the time `since` [s], number_rate [1/s] and mass_rate [kg/s] over these steps. Rows behind
    the last whole block are left out. In the plane masses are those of a length of 1 m."""
    if not isinstance(mean, (int, np.integer)) or mean < 1:
        raise ResultsError(f"mean {mean!r}: expected a whole number of steps above 0")
    history = run.history()
    if "left_mass" not in history:
        raise ResultsError(f"{run.directory}/history.csv: no column left_mass; expected a run with a boundary of shape outlet")
    later = history.time > since
    rows = Table({name: history[name][later] for name in ("step", "time", "left", "left_mass")})
    if len(rows) < mean:
        raise ResultsError(f"{run.directory}/history.csv: {len(rows)} steps after {since:g} s; expected {mean} at least")
    last = np.arange(mean - 1, len(rows), mean)
    found = {"step": rows.step[last], "time": rows.time[last], "left": np.cumsum(rows.left)[last], "left_mass": np.cumsum(rows.left_mass)[last]}
    for rate, total in (("number_rate", "left"), ("mass_rate", "left_mass")):
        found[rate] = np.diff(found[total], prepend=0.0) / np.diff(found["time"], prepend=_begin(run, history, since))
    return Table(found)


def _begin(run, history, since):
    """The time from which the rows after `since` count: that of the row before them, or of the start of the first row."""
    before = history.time[history.time <= since]
    every = (run.case.get("output") or [{}])[0].get("history_every", 1)
    return before[-1] if len(before) else max(since, history.time[0] - every * run.time_step())
