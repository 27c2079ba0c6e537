"""Text files of a DATBOX of LMGC90 as entries: keywords, words and values `name= number`."""
import math
import re
import sys

import numpy as np

#: the least number above 0
ABOVE_0 = sys.float_info.min

#: other names of parameters of laws, as LMGC90 itself writes them, in full or in four letters, and those of its pre-processor
OLDER = {"dfric": "dyfr", "dfrc": "dyfr", "sfric": "stfr", "sfrc": "stfr", "cohen": "cohn", "cohet": "coht", "Wethk": "Wthk", "Weth": "Wthk",
         "restn": "rstn", "restt": "rstt"}
#: `name= number`; forces and gaps of contacts stand without the sign. What begins as a number has to be one up to the next blank
VALUE = re.compile(r"(?:([A-Za-z]\w*(?:\(\d\))?)\s*=|\b(rl[nts]/H|gapTT))\s*([-+]?\.?\d[^\s=]*)")
#: as Fortran writes it
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[DdEe][-+]?\d+|[-+]\d{3})?")


class Refused(Exception):
    """Input that has no counterpart, or is not a DATBOX."""


def number(text):
    """A real number as Fortran writes it."""
    return float(re.sub(r"(?<=[\d.])([-+]\d{3})$", r"E\1", re.sub("[Dd]", "E", text)))


class Entry:
    """A line that begins a thing, with the values `name= number` of it and of the lines that continue it."""

    def __init__(self, path, line, words):
        self.path, self.line, self.words, self.values = path, line, words, {}
        #: the values of each line by itself
        self.rows = []

    def add(self, text):
        # ax1 is the older name of axe1
        self.rows.append({OLDER.get(name, re.sub(r"^ax(?=\d$)", "axe", name or bare)): self.number(value, f"{name}= " if name else f"{bare} ")
                          for name, bare, value in VALUE.findall(text)})
        self.values.update(self.rows[-1])

    def number(self, text, name=""):
        """A word that is a number."""
        if not NUMBER.fullmatch(text):
            self.refuse(f"{name}{text}", "a number")
        return number(text)

    def size(self, place, name):
        """A size of a contactor: LMGC90 reads it by its place on the first line, whatever its name."""
        row = list(self.rows[0].values())
        return self.get(name) if name in self.values or len(row) < place else row[place - 1]

    def shift(self, count):
        """Place of a contactor in its body: coo1, coo2, ... after its sizes, which may have these names too. The node where there is none."""
        for k, row in enumerate(self.rows):
            start = list(row).index("coo1") if "coo1" in row else len(row)
            if len(row) - start >= count and k + start > 0:
                return np.array(list(row.values())[start:start + count])
        return np.zeros(count)

    def get(self, name, default=None):
        if name in self.values:
            return self.values[name]
        if default is None:
            names = [name] + [older for older, newer in OLDER.items() if newer == name]
            self.refuse(f"{'=, '.join(names[:-1])}{'= or ' if names[1:] else ''}{names[-1]}= is missing", "a value")
        return default

    def within(self, name, least=0.0, most=math.inf):
        """A value from `least` on, 0 or ABOVE_0, to `most`."""
        return self.check(name, self.get(name), least, most)

    def check(self, name, value, least=0.0, most=math.inf):
        if not (least <= value <= most and math.isfinite(value)):
            self.refuse(f"{name}= {value:g}", f"a finite number {'>' if least else '>='} 0{f' and <= {most:g}' if most < math.inf else ''}")
        return value

    def vector(self, name, count, default=None):
        """The values name1, name2, ... or name(1), name(2), ..."""
        names = [f"{name}({k + 1})" if f"{name}({k + 1})" in self.values else f"{name}{k + 1}" for k in range(count)]
        return np.array([self.get(each, default) for each in names])

    def table(self, prefix, counted, count):
        """The values of as many lines that begin with prefix1= as the value `counted`, or its singular, says. LMGC90 reads them by their
        places: the third may have another name."""
        rows = [list(row.values())[:count] for row in self.rows if next(iter(row), "") == f"{prefix}1" and len(row) >= count]
        wanted = self.get(counted, self.values.get(counted.removesuffix("s")))
        if len(rows) != wanted:
            self.refuse(f"{self.words[0]} with {counted}= {wanted:g} and {len(rows)} lines of {prefix}1= to {prefix}{count}=", "a line for each")
        return np.array(rows)

    def refuse(self, found, expected):
        raise Refused(f"{self.path}: line {self.line}: {found}: expected {expected}")


def entries(path):
    """The file as [(keyword, Entry)]: a line of text after a keyword line `$...` begins an entry, one whose columns 2 to 6 are blank
    continues the last."""
    found, keyword = [], ""
    for count, text in enumerate(path.read_text(encoding="latin-1").expandtabs().splitlines(), 1):
        if not text.strip() or text.lstrip()[0] in "!#":
            continue
        if text.startswith("$"):
            keyword = text.split()[0]
            found.append((keyword, Entry(path, count, text.split()[1:])))
            found[-1][1].add(text)
        elif text[1:6].strip() or not found:
            words = text.split("=")[0].split()
            found.append((keyword, Entry(path, count, words)))
            found[-1][1].add(text)
        else:
            found[-1][1].add(text)
            found[-1][1].words += re.findall(r"^\s+(localframe)", text)
    return found
