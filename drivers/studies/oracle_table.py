"""The table of studies that compare with oracles: a row an oracle, with what was measured beside what is accepted."""
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


def bound(value):
    """One digit, or two where one is not all of it."""
    return f"{value:.0e}" if float(f"{value:.0e}") == value else f"{value:.1e}"


def text(value):
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(value)
    return f"{value:.7g}"


def say(words):
    """A remark between the rows."""
    print(words, file=sys.stderr, flush=True)
