"""history.csv, whose rows may be thinned: what its rows stand for, and means over steps."""
import numpy as np

from .tables import ResultsError, Table, read_table

#: columns of counts in single steps: each step in which they are above 0 has a row
COUNTS = ("left", "left_mass", "entered", "entered_mass", "fast")
#: a time is the end of a step but for rounding, in parts of a step
ROUNDING = 1e-6


class History(Table):
    """Rows of history.csv. A row has the figures of the step at its end, and stands for the steps since the row before it, the first one for those since the end of the step `start`."""

    def __init__(self, columns, start=None):
        super().__init__(columns)
        # the first step of a run has a row
        self.start = start if start is not None else int(self["step"][0]) - 1 if len(self) else 0

    def steps(self):
        """How many steps the rows stand for, all together."""
        return int(self["step"][-1]) - self.start if len(self) else 0

    def after(self, time):
        """The rows of the steps after the one that ends last up to a time [s]."""
        return self.between(time, np.inf)

    def between(self, low, high):
        """The rows with times after `low` and up to `high` [s]."""
        chosen = (self["time"] > low) & (self["time"] <= high)
        if not chosen.any():
            return History({name: values[:0] for name, values in self.items()}, self.start)
        first = int(np.argmax(chosen))
        before, until = (self["step"][first - 1], self["time"][first - 1]) if first else (self.start, self._time_of_start())
        share = (low - until) / (self["time"][first] - until) if self["time"][first] > until else 0.0
        reached = int(before + max(0.0, share) * (self["step"][first] - before) + ROUNDING)
        return History({name: values[chosen] for name, values in self.items()}, int(min(reached, self["step"][first] - 1)))

    def after_step(self, step):
        """The rows after the end of a step. What stands for steps on both sides of it stands for the later ones."""
        chosen = self["step"] > step
        return History({name: values[chosen] for name, values in self.items()}, int(step))

    def time_of(self, step):
        """The times at the end of steps, or of parts of them [s]: steps between rows have one length."""
        return np.interp(step, np.append(self.start, self["step"]), np.append(self._time_of_start(), self["time"]))

    def _time_of_start(self):
        """From the length of all steps of a run together, or of those of the rows."""
        if self.start == 0:
            return 0.0
        step, time = self["step"], self["time"]
        length = (time[-1] - time[0]) / (step[-1] - step[0]) if len(step) > 1 else time[0] / step[0]
        return float(time[0] - (step[0] - self.start) * length)

    def means(self, steps):
        """The means of so many steps after each other, as a table; steps behind the last whole block are left out. A row counts in a block as often as it stands for steps of it;
        counts of single steps are those of all steps."""
        if steps < 1 or steps > self.steps():
            raise ResultsError(f"means of {steps} steps; expected 1 to {self.steps()}, the steps that there are")
        if len(self) == self.steps():
            return super().means(steps)
        gap = int(np.diff(self["step"], prepend=self.start).max())
        if steps < gap:
            raise ResultsError(f"means of {steps} steps of a history.csv with a row each {gap} steps; expected {gap} at least")
        ends = self.start + steps * np.arange(1, self.steps() // steps + 1)
        # pieces of steps that lie in one block and belong to one row
        piece = np.unique(np.concatenate([ends, self["step"][self["step"] <= ends[-1]]]))
        row, block = np.searchsorted(self["step"], piece), np.searchsorted(ends, piece)
        share, own = np.diff(piece, prepend=self.start) / steps, (self["step"][row] == piece) / steps

        def mean(values, weight):
            return np.bincount(block, weights=weight * values[row])

        found = {name: mean(values, own if name in COUNTS else share) for name, values in self.items()}
        if "converged" in self:
            # each step that missed its goal has a row
            found["converged"] = 1.0 - mean(1.0 - self["converged"], own)
        return Table(found)


def read_history(directory):
    """history.csv of the output directory of a run."""
    return History(read_table(directory / "history.csv", ("step", "time")))
