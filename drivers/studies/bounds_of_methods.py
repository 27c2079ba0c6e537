"""Part of study_methods.py: bounds of the iterations of the methods, and whether they find the same velocities."""
import numpy as np
from oracle_table import Bounds
from study_support import read_bodies, run

PAGE = "doc/methods.md"
#: accuracy of the solves that are compared, and the part of a true error that an estimate may be at least
TIGHT, LEAST_ESTIMATE = 1e-3, 0.61
METHODS = ("nlgs", "nscdd", "nscdd_ep", "schwarz", "schwarz_ec", "newton")


def differences(directory, packing, dimension, bodies):
    """Of the velocities of a step without friction, which are unique: root mean square over g h of each method against the
    first."""
    found = {}
    for method in METHODS:
        place = directory / "agreement" / f"{packing} {method}".replace(" ", "_")
        groups = {"scene": {"dimension": dimension, "bodies": "file", "bodies_file": str(bodies.resolve()), "friction": 0.0},
                  "time": {"step": 1e-3, "steps": 1},
                  "solver": {"method": method, "accuracy": TIGHT, "max_iterations": 20000, "warm_start": False,
                             "layered_start": False},
                  "output": {"directory": ".", "every": 0, "contacts": False, "final_bodies": True}}
        if method != "nlgs":
            groups["decomposition"] = {"subdomains": 8, "partition": "metis"}
        run(place, groups)
        found[method] = read_bodies(place / "final_bodies.h5")[2][:, :dimension]
    first = found[METHODS[0]]
    return {method: np.sqrt(((velocity - first)**2).sum(1).mean()) / 9.81e-3 for method, velocity in found.items()
            if method != METHODS[0]}


def count(row, goal):
    """Iterations to a goal; infinitely many where it is not reached."""
    return float(row[f"to {goal}"]) if row[f"to {goal}"] != "" else np.inf


def ratios(rows, goal, one, other, free=0, **wanted):
    """Iterations of one kind of rows, less those that are free, over those of another that are the same else, where one of both
    gets to the goal.
    A kind is values of columns; so is `wanted`."""
    same = [name for name in ("packing", "friction", "subdomains", "sweeps", "momentum") if name not in one]
    of = {tuple(row[name] for name in same): count(row, goal) for row in rows
          if all(row[name] in value for name, value in other.items())}
    found = []
    for row in rows:
        if all(row[name] in value for name, value in {**one, **wanted}.items()):
            pair = count(row, goal), of.get(tuple(row[name] for name in same), np.inf)
            if min(pair) < np.inf:
                found.append((pair[0] - free) / pair[1])
    return found


def add_worst(table, words, found, most, source):
    """A row of the largest of some ratios; none where nothing was compared."""
    if found:
        table.add(f"{words}, the most of {len(found)}", max(found), None, most, source)


def add_packings(table, rows):
    enriched, plain = {"method": ("nscdd_ep",), "direction": ("automatic",)}, {"method": ("nscdd",)}
    for goal, words in (("error 0.3", "an error of 0.3 g h"), ("0.001", "a residual of 1e-3")):
        add_worst(table, f"iterations of NSCDD-EP over NSCDD to {words}", ratios(rows, goal, enriched, plain), 1.0,
                  f"{PAGE}: in iterations the best on nearly all packings")
    usual = {"friction": ("0.3",), "subdomains": ("8",), "sweeps": ("1", "3", "10"), "momentum": ("True",),
             "packing": ("disks 1e3", "spheres 1e3")}
    add_worst(table, "the same, both accelerated, 1000 grains, friction 0.3, 8 subdomains, to an error of 0.3 g h",
              ratios(rows, "error 0.3", enriched, plain, **usual), 0.4, f"{PAGE}: a third; a fifth of it more")
    add_worst(table, "the same to a residual of 1e-3", ratios(rows, "0.001", enriched, plain, **usual), 0.506,
              f"{PAGE}: 0.40 to 0.46; a tenth more")
    for method in ("nscdd", "nscdd_ep"):
        one = {"method": (method,), "direction": ("", "automatic"), "momentum": ("True",)}
        found = ratios(rows, "error 0.3", one, {**one, "momentum": ("False",)}, free=1)
        add_worst(table, f"accelerated iterations of {method}, less one, over plain ones to an error of 0.3 g h", found, 1.1,
                  "doc/acceleration.md, The safeguard: a tenth and one check more at most")
    add_worst(table, "iterations of Schwarz-EC over Schwarz to an error of 0.3 g h",
              ratios(rows, "error 0.3", {"method": ("schwarz_ec",)}, {"method": ("schwarz",)}), 1.0, f"{PAGE}: 0 to 8 % fewer")
    many = max(int(row["subdomains"]) for row in rows)
    for packing in dict.fromkeys(row["packing"] for row in rows):
        where = {"packing": (packing,), "friction": ("0.3",), "sweeps": ("3",), "momentum": ("True",), "method": ("nscdd",)}
        found = ratios(rows, "error 0.3", {**where, "subdomains": (str(many),)}, {**where, "subdomains": ("1",)})
        add_worst(table, f"{packing}, accelerated NSCDD: iterations in {many} subdomains over those in 1", found, 3.1 * 1.1,
                  f"{PAGE}: 2.6 to 3.1 from 1 to 64; a tenth more")


def accepted(rows, columns, agreement):
    """The closing table; agreement: by packing, what `differences` gives."""
    table = Bounds()
    for packing, found in agreement.items():
        for method, difference in found.items():
            table.add(f"{packing}, velocities without friction: {method} less {METHODS[0]}, over g h", difference, None,
                      2.0 * TIGHT / LEAST_ESTIMATE,
                      f"unique; two solves to {TIGHT:g}, estimates at least {LEAST_ESTIMATE:g} of the error (doc/theory.md, 24)")
    for sweeps in dict.fromkeys(row["sweeps"] for row in columns):
        # the ratio of solves none of which ends is no number, and is missed
        found = [float(row["iterations"] or np.inf) for row in columns if row["method"] == "NSCDD-EP, l = 1e4, all" and
                 row["sweeps"] == sweeps and int(row["subdomains"]) <= 16]
        table.add(f"columns, NSCDD-EP, l = 1e4, {sweeps} sweeps: most over fewest iterations in 2 to 16 subdomains",
                  max(found) / min(found), 1.0,
                  1.25, f"{PAGE}, Columns: no dependence up to 16; 10 and 8 there")
    add_packings(table, rows)
    return table.close()
