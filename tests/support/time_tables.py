"""Tables against time in Python: their text, and the means over steps that the program takes from them, by integrals."""
import numpy as np


class TimeTable:
    """Columns of values at ascending times; with `repeats` the table begins anew at its end."""

    def __init__(self, times, columns, repeats=False):
        self.times, self.repeats = np.array(times, dtype=float), repeats
        self.columns = {name: np.array(values, dtype=float) for name, values in columns.items()}

    @property
    def text(self):
        rows = np.column_stack([self.times, *self.columns.values()])
        return ",".join(["time", *self.columns]) + "\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist())

    def integral(self, name, at):
        """Of a column, from time 0 to the times `at`."""
        return self._from_first(name, np.asarray(at, dtype=float)) - self._from_first(name, np.zeros(1))[0]

    def _from_first(self, name, at):
        times, values = self.times, self.columns[name]
        areas = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(times) * (values[1:] + values[:-1]))])
        cycles = np.zeros_like(at)
        if self.repeats:
            period = times[-1] - times[0]
            cycles = np.maximum(np.floor((at - times[0]) / period), 0.0)
            at = at - cycles * period
        row = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 1)
        return cycles * areas[-1] + areas[row] + 0.5 * (at - times[row]) * (values[row] + np.interp(at, times, values))

    def loads(self, name, step, steps):
        """What acts in each step: the mean over it."""
        return np.diff(self.integral(name, step * np.arange(steps + 1))) / step

    def rates(self, name, step, steps):
        """What moves something at the start and at the end of each step: the mean from half a step before to half a step after it."""
        middles = self.integral(name, step * np.concatenate([[0.0], np.arange(steps + 1) + 0.5]))
        return np.diff(middles) / np.concatenate([[0.5 * step], np.full(steps, step)])

    def ways(self, name, step, steps):
        """Ways at the start and at the end of each step: the mean of the integrals half a step before and after it."""
        times = step * np.arange(1, steps + 1)
        return np.concatenate([[0.0], 0.5 * (self.integral(name, times - 0.5 * step) + self.integral(name, times + 0.5 * step))])
