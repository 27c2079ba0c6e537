"""The tables of studies: each row has what was measured beside what is accepted."""
import sys


class Table:
    """Rows are printed as they come; `misses` are those out of their bounds. Values are texts, or numbers; a row without a bound
    is there to be read."""

    HEADER = ("oracle", "quantity", "measured", "expected", "off by", "accepted", "within")

    def __init__(self, quiet=False):
        self.rows, self.quiet = [], quiet

    def add(self, oracle, quantity, measured, expected="", off=None, accepted=None):
        """`off`: how far it is off, the difference of both numbers unless told; `accepted`: the most that it may be."""
        if off is None and accepted is not None:
            off = abs(measured - expected)
        # nan is a miss
        good = accepted is None or off <= accepted
        row = (oracle, quantity, text(measured), text(expected), "" if off is None else f"{off:.1e}",
               "" if accepted is None else bound(accepted), "" if accepted is None else "yes" if good else "NO")
        self.rows.append(row)
        if not self.quiet:
            print("  ".join(f"{cell:<{width}}" for cell, width in zip(row, (10, 70, 14, 14, 9, 9, 3))).rstrip(), flush=True)
        return good

    @property
    def misses(self):
        return [row for row in self.rows if row[-1] == "NO"]

    def markdown(self):
        lines = ["| " + " | ".join(self.HEADER) + " |", "|---|---|---:|---:|---:|---:|---|"]
        return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in self.rows]) + "\n"


class Bounds:
    """The closing table of a study: each quantity with the range that is accepted, and the source of that range."""

    HEADER = ("quantity", "measured", "accepted", "source of the bound", "outcome")

    def __init__(self):
        self.rows = []

    def add(self, quantity, measured, low, high, source):
        """The quantity is held if it lies from `low` to `high`; None means that there is no bound on that side."""
        # a comparison with nan is false
        held = (low is None or measured >= low) and (high is None or measured <= high) and measured == measured
        accepted = f"at most {short(high)}" if low is None else f"at least {short(low)}" if high is None else \
            short(low) if low == high else f"{short(low)} to {short(high)}"
        self.rows.append((quantity, short(measured), accepted, source, "held" if held else "missed"))
        return held

    def near(self, quantity, measured, expected, difference, source):
        """The quantity is held if it differs from the expected value by at most the given difference."""
        return self.add(quantity, measured, expected - difference, expected + difference, source)

    def close(self):
        """The table is printed; the exit status is 0 if there are rows and all of them are held."""
        widths = [max(len(row[k]) for row in (self.HEADER, *self.rows)) for k in range(len(self.HEADER))]
        print()
        for row in (self.HEADER, *self.rows):
            print(" | ".join(f"{cell:<{width}}" for cell, width in zip(row, widths)).rstrip())
        missed = sum(row[-1] == "missed" for row in self.rows)
        print(f"{len(self.rows) - missed} of {len(self.rows)} within their bounds", flush=True)
        return int(missed > 0 or not self.rows)


def bound(value):
    """One digit, or two where one is not all of it."""
    return f"{value:.0e}" if float(f"{value:.0e}") == value else f"{value:.1e}"


def text(value):
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(value)
    return f"{value:.7g}"


def short(value):
    """Four digits of a number."""
    return f"{float(value):.4g}"


def say(words):
    """A remark between the rows."""
    print(words, file=sys.stderr, flush=True)
