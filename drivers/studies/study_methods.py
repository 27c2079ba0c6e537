#!/usr/bin/env python3
"""The four decomposition methods side by side: iterations to a velocity error and to a residual, and seconds, of one step of settled
packings, and on columns.

    ./gravier study methods [--out DIR] [--quick | --large] [--redraw]

Packings of disks and spheres settle in a box; then each method solves one step of them from zero impulses: NSCDD, NSCDD-EP,
Schwarz and Schwarz-EC, with 1 to 64 subdomains, 1 to 50 sweeps an iteration, friction 0 and 0.3, search directions from 0 to
1e12, plain and with momentum. Columns of 4 disks a subdomain show what a growing number of subdomains costs. Writes
methods.csv, methods_columns.csv and methods.svg into DIR and prints the tables of doc/methods.md; --redraw draws and prints from the CSV
files that are there. --quick takes fewer cases. --large takes packings of 10^4 and 10^5 grains instead, without columns, and writes
methods_large.csv and methods_large.svg; an enriched method is left out of it where its interface solves, or its factors, take more
than minutes. The closing table has each measured quantity beside what is accepted. Exit status: 0 all are held; 1 one is missed.
"""

import argparse
import csv
import re

import numpy as np
from bounds_of_methods import accepted, differences
from study_support import OneLineParser, claimed, plt, read_history, run, run_study, write_csv
from whole_file import save_figure

#: name: dimension, grains along each axis, steps of settling; 1e5 as high as 1e4
PACKINGS = {"disks 1e3": (2, [32, 31], 500), "disks 1e4": (2, [100, 100], 900), "disks 1e5": (2, [1000, 100], 900),
            "spheres 1e3": (3, [10, 10, 10], 450), "spheres 1e4": (3, [21, 21, 23], 600), "spheres 1e5": (3, [66, 66, 23], 600)}
SMALL = ("disks 1e3", "spheres 1e3")
# packings whose interfaces are solved by conjugate gradients
BY_CG = ("spheres 1e4", "spheres 1e5")
#: residuals; velocity errors over g h
TOLERANCES = (1e-2, 1e-3, 1e-4)
ERRORS = (0.3, 0.1, 0.03)
SPEED = 9.81e-3
PHASES = {"seconds in sweeps": "sweeps", "in interface": "interface solve", "in factors": "factorisation"}
COLUMNS = ["packing", "friction", "method", "direction", "contacts", "momentum", "subdomains", "sweeps"]
COLOURS = {"nscdd": "#0072b2", "nscdd_ep": "#d55e00", "schwarz": "#009e73", "schwarz_ec": "#cc79a7"}


def settle(directory, packing):
    """The bodies file of a packing, made once."""
    dimension, count, steps = PACKINGS[packing]
    place = directory / packing.replace(" ", "_")
    if not (place / "final_bodies.h5").exists():
        run(place, {"scene": {"dimension": dimension, "bodies": "lattice", "lattice_count": count, "radius_min": 0.008,
                              "radius_max": 0.012, "friction": 0.3},
                    "time": {"step": 1e-3, "steps": steps},
                    "solver": {"criterion": "residual", "tolerance": 1e-3, "max_iterations": 300, "acceleration": "momentum"},
                    "output": {"directory": ".", "every": 0, "contacts": False, "final_bodies": True}})
    return place / "final_bodies.h5"


def phase_seconds(log):
    """{phase: mean seconds} of the closing table."""
    found = {}
    for key, name in PHASES.items():
        match = re.search(rf"^{name} +([0-9.]+)", log, re.MULTILINE)
        found[key] = float(match.group(1)) if match else 0.0
    return found


def solve(directory, bodies, case, iterations):
    """One step: iterations to each tolerance, '' where not in `iterations` iterations, and seconds by phase. An error is met from the
    iteration on after which the estimate stays below it; the solve goes on until its criterion meets the least of them."""
    groups = {
        "scene": {"dimension": PACKINGS[case["packing"]][0], "bodies": "file", "bodies_file": str(bodies.resolve()),
                  "friction": case["friction"]},
        "time": {"step": 1e-3, "steps": 1},
        "solver": {"method": case["method"], "sweeps": case["sweeps"], "accuracy": ERRORS[-1], "tolerance": TOLERANCES[1], "check_every": 1,
                   "max_iterations": iterations, "acceleration": "momentum" if case["momentum"] else "none",
                   "warm_start": False, "layered_start": False},
        "decomposition": {"subdomains": case["subdomains"], "partition": "metis" if case["subdomains"] > 1 else "grid"},
        "output": {"directory": "results", "every": 0, "contacts": False, "trace": True},
    }
    if case["method"].startswith("schwarz"):
        groups["solver"]["relaxation"] = 0.7
    if case["direction"] != "" and case["direction"] != "automatic":
        groups["enriched"] = {"direction": float(case["direction"]), "contacts": case["contacts"]}
    if case["packing"] in BY_CG and case["method"] == "nscdd_ep":
        # MUMPS makes dense blocks of interfaces this wide
        groups.setdefault("enriched", {}).update({"interface": "cg", "cg_tolerance": 1e-6})
    name = " ".join(str(case[key]) for key in COLUMNS).replace(" ", "_")
    place = directory / "runs" / name
    run(place, groups)
    with open(place / "results" / "trace.csv", encoding="ascii") as file:
        trace = [(int(row["iteration"]), float(row["residual"]), float(row["velocity_error"]) / SPEED) for row in csv.DictReader(file)]
    row = dict(case)
    for tolerance in TOLERANCES:
        row[f"to {tolerance:g}"] = next((k for k, residual, _ in trace if residual <= tolerance), "")
    for bound in ERRORS:
        late = [place for place, (_, _, error) in enumerate(trace) if error > bound]
        after = late[-1] + 1 if late else 0
        row[f"to error {bound:g}"] = trace[after][0] if after < len(trace) else ""
    log = (place / "results" / "run.log").read_text()
    row.update(phase_seconds(log))
    row["done"], row["residual"], row["error"] = trace[-1]
    lowered = re.search(r"; (\d+) reductions? of l$", log, re.MULTILINE)
    row["lowered"] = int(lowered.group(1)) if lowered else 0
    return row


def cases(quick):
    """(case, iterations allowed) of the study."""
    def case(packing, friction, method, direction="", contacts="", momentum=False, subdomains=8, sweeps=1):
        return dict(zip(COLUMNS, (packing, friction, method, direction, contacts, momentum, subdomains, sweeps)))

    def methods(packing, friction, allowed, **more):
        for momentum in (False, True):
            yield case(packing, friction, "nscdd", momentum=momentum, **more), allowed
            yield case(packing, friction, "nscdd_ep", "automatic", "active", momentum=momentum, **more), allowed

    small = 2000
    for packing in SMALL if quick else ():
        for friction in (0.3, 0.0):
            # 146 iterations are the most that a page has of NSCDD-EP to an error of 0.3
            for one, allowed in methods(packing, friction, small // 4, sweeps=3):
                yield one, 150 if one["method"] == "nscdd_ep" else allowed
            yield case(packing, friction, "schwarz"), small // 4
            yield case(packing, friction, "schwarz_ec", "3", "all"), small // 4
        for subdomains in (1, 32):
            yield case(packing, 0.3, "nscdd", momentum=True, subdomains=subdomains, sweeps=3), small // 4
    for packing in () if quick else SMALL:
        for friction in (0.3, 0.0):
            for sweeps in (1, 3, 10, 50):
                yield from methods(packing, friction, small if sweeps < 10 else small // 2, sweeps=sweeps)
            for sweeps in (1, 10):
                yield case(packing, friction, "schwarz", sweeps=sweeps), small // 2
                yield case(packing, friction, "schwarz_ec", "3", "all", sweeps=sweeps), small // 2
        for subdomains in (1, 2, 4, 16, 32, 64):
            yield from methods(packing, 0.3, small, subdomains=subdomains, sweeps=3)
        for direction in ("1", "10", "1000", "1e12"):
            for momentum in (False, True):
                yield case(packing, 0.3, "nscdd_ep", direction, "active", momentum, sweeps=3), small // 2
        for direction in ("1", "3", "100", "1e12"):
            yield case(packing, 0.3, "nscdd_ep", direction, "all", sweeps=3), small // 2


def large_cases():
    """(case, iterations allowed) on packings of 10^4 and 10^5 grains, the quick ones first."""
    def case(packing, friction, method, momentum, subdomains, sweeps, direction="automatic"):
        enriched = (direction, "active") if method == "nscdd_ep" else ("3", "all") if method == "schwarz_ec" else ("", "")
        return dict(zip(COLUMNS, (packing, friction, method, *enriched, momentum, subdomains, sweeps)))

    for packing in ("disks 1e4", "spheres 1e4", "disks 1e5", "spheres 1e5"):
        allowed, parts = 600, ((1, 3), (8, 3), (32, 1), (32, 3), (32, 10), (64, 3))
        if packing.endswith("1e5"):
            allowed, parts = 300, ((1, 3), (32, 3), (64, 3))
        for friction in (0.3, 0.0):
            for momentum in (False, True):
                for subdomains, sweeps in parts:
                    yield case(packing, friction, "nscdd", momentum, subdomains, sweeps), allowed
            yield case(packing, friction, "schwarz", False, 32, 3), allowed
    for friction, subdomains, sweeps, allowed in ((0.3, 32, 3, 400), (0.0, 32, 3, 100), (0.3, 8, 3, 400), (0.3, 1, 3, 400),
                                                  (0.3, 32, 10, 200), (0.3, 64, 3, 400)):
        for momentum in (True, False):
            yield case("disks 1e4", friction, "nscdd_ep", momentum, subdomains, sweeps), allowed
    for direction in ("10", "1000"):
        yield case("disks 1e4", 0.3, "nscdd_ep", True, 32, 3, direction), 30
    yield case("disks 1e4", 0.3, "schwarz_ec", False, 32, 3), 50
    for friction, subdomains in ((0.3, 8), (0.3, 32), (0.0, 32)):
        for momentum in (True, False):
            yield case("spheres 1e4", friction, "nscdd_ep", momentum, subdomains, 3), 40
    yield case("spheres 1e5", 0.0, "nscdd_ep", True, 64, 3), 16
    # one domain: factors, no interface
    for packing in ("spheres 1e4", "disks 1e5"):
        for friction in (0.3, 0.0):
            yield case(packing, friction, "nscdd_ep", True, 1, 3), 30


def column(directory, subdomains, method, acceleration, groups, sweeps):
    """Iterations on a column of 4 disks a subdomain, until the error on the impulses is below 1e-6."""
    place = directory / "columns" / f"{method}_{acceleration}_{subdomains}_{sweeps}_{len(groups)}"
    run(place, {"scene": {"bodies": "column", "column_count": 4 * subdomains, "gravity": [0.0, -1.0, 0.0]},
                "time": {"step": 1.0, "steps": 1},
                "solver": {"method": method, "sweeps": sweeps, "criterion": "error", "tolerance": 1e-6, "check_every": 1,
                           "max_iterations": 2000, "acceleration": acceleration},
                "decomposition": {"subdomains": subdomains}, **groups,
                "output": {"directory": "results", "every": 0}})
    history = read_history(place / "results")
    return int(history["iterations"][0]) if history["converged"][0] else ""


def study_columns(directory, quick):
    given = {"enriched": {"direction": 1e4, "direction_unit": "absolute"}}
    kinds = {"NSCDD": ("nscdd", "none", {}), "NSCDD-EP, l = 1e4, all": ("nscdd_ep", "none", given),
             "NSCDD-EP, automatic": ("nscdd_ep", "none", {}), "Schwarz": ("schwarz", "none", {}),
             "Schwarz-EC, l = 1e4": ("schwarz_ec", "none", given), "NSCDD, momentum": ("nscdd", "momentum", {}),
             "NSCDD-EP, automatic, momentum": ("nscdd_ep", "momentum", {})}
    if quick:
        kinds = {name: kinds[name] for name in ("NSCDD-EP, l = 1e4, all", "NSCDD, momentum")}
    rows = []
    for sweeps in (10,) if quick else (1, 10):
        for name, kind in kinds.items():
            for subdomains in (2, 4, 8, 16) if quick else (2, 4, 8, 16, 32, 64):
                rows.append({"method": name, "sweeps": sweeps, "subdomains": subdomains,
                             "iterations": column(directory, subdomains, *kind, sweeps)})
    return rows


def read_rows(path):
    with open(path, encoding="ascii") as file:
        return list(csv.DictReader(file))


def draw(rows, columns, path):
    """Iterations to an error of 0.3 against sweeps and against subdomains, and on columns."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 5))
    labels = {"nscdd": "NSCDD", "nscdd_ep": "NSCDD-EP"}
    for axis, along, fixed in ((axes[0], "sweeps", ("subdomains", "8")), (axes[1], "subdomains", ("sweeps", "3"))):
        for method in ("nscdd", "nscdd_ep"):
            for momentum in ("False", "True"):
                points = sorted((int(row[along]), int(row["to error 0.3"])) for row in rows
                                if row["packing"] == "disks 1e3" and row["friction"] == "0.3" and row["method"] == method and
                                row["momentum"] == momentum and row["direction"] in ("", "automatic") and
                                row[fixed[0]] == fixed[1] and row["to error 0.3"] != "")
                if points:
                    axis.loglog(*np.array(points).T, "o-" if momentum == "False" else "s--", color=COLOURS[method],
                                label=labels[method] + (", momentum" if momentum == "True" else ""))
        axis.set_xlabel({"sweeps": "sweeps an iteration", "subdomains": "subdomains"}[along])
        axis.set_ylabel("iterations to a velocity error of 0.3 g h")
        mark(axis, {"sweeps": (1, 3, 10, 50), "subdomains": (1, 2, 4, 8, 16, 32, 64)}[along], (30, 100, 300))
    axes[0].set_title("1000 disks, friction 0.3, 8 subdomains", fontsize=9)
    axes[1].set_title("1000 disks, friction 0.3, 3 sweeps", fontsize=9)
    for name in dict.fromkeys(row["method"] for row in columns):
        points = [(int(row["subdomains"]), int(row["iterations"])) for row in columns
                  if row["method"] == name and row["sweeps"] == "10" and row["iterations"] != ""]
        if points:
            axes[2].loglog(*np.array(points).T, "o-", label=name)
    axes[2].set_xlabel("subdomains of 4 disks")
    axes[2].set_ylabel("iterations to an error of 1e-6")
    axes[2].set_title("columns, 10 sweeps", fontsize=9)
    mark(axes[2], sorted({int(row["subdomains"]) for row in columns}), (10, 100, 1000))
    figure.tight_layout()
    save_figure(figure, path)


def mark(axis, across, up):
    """Ticks at given numbers, and a legend below that covers nothing."""
    for one, values in ((axis.xaxis, across), (axis.yaxis, up)):
        one.set_ticks(values, [str(value) for value in values])
        one.set_ticks([], minor=True)
    axis.legend(frameon=False, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncol=2)


def cell(rows, **wanted):
    """Iterations to errors of 0.3 and 0.1 and, in brackets, to a residual of 1e-3 of the row that has what is wanted."""
    for row in rows:
        if has(row, wanted):
            return "{} / {} ({})".format(*(row[f"to {goal}"] or "-" for goal in ("error 0.3", "error 0.1", "0.001")))
    return ""


def has(row, wanted):
    """Whether a row of a CSV file has some values."""
    return all(row[key] == (f"{value:g}" if isinstance(value, float) else str(value)) for key, value in wanted.items())


def print_tables(rows):
    """The tables of the page, each cell as `cell` says."""
    pairs = [("nscdd", "", False), ("nscdd_ep", "automatic", False), ("nscdd", "", True), ("nscdd_ep", "automatic", True)]
    for packing in SMALL:
        print(f"\n{packing}\n\n| friction | sweeps | NSCDD | NSCDD-EP | NSCDD, accelerated | NSCDD-EP, accelerated | Schwarz | Schwarz-EC |")
        for friction in (0.3, 0.0):
            for sweeps in (1, 3, 10, 50):
                same = {"packing": packing, "friction": friction, "subdomains": 8, "sweeps": sweeps}
                cells = [cell(rows, **same, method=method, direction=direction, momentum=momentum) for method, direction, momentum in pairs]
                cells += [cell(rows, **same, method=method) for method in ("schwarz", "schwarz_ec")]
                print(f"| {friction:g} | {sweeps} | {' | '.join(cells)} |")
        print("\n| subdomains | NSCDD | NSCDD-EP | NSCDD, accelerated | NSCDD-EP, accelerated |")
        for subdomains in (1, 2, 4, 8, 16, 32, 64):
            same = {"packing": packing, "friction": 0.3, "subdomains": subdomains, "sweeps": 3}
            cells = [cell(rows, **same, method=method, direction=direction, momentum=momentum) for method, direction, momentum in pairs]
            print(f"| {subdomains} | {' | '.join(cells)} |")
        print("\n| l, in 1/W_aa | active contacts | active, accelerated | all contacts | lowered |")
        for direction in ("1", "3", "10", "100", "automatic", "1000", "1e12"):
            same = {"packing": packing, "friction": 0.3, "subdomains": 8, "sweeps": 3, "method": "nscdd_ep", "direction": direction}
            cells = [cell(rows, **same, contacts="active", momentum=momentum) for momentum in (False, True)] + [cell(rows, **same, contacts="all")]
            lowered = [row["lowered"] for row in rows if row["contacts"] == "all" and has(row, same)]
            print(f"| {direction} | {' | '.join(cells)} | {''.join(lowered)} |")


def print_large(rows):
    """The tables of the large packings, each cell as `cell` says."""
    kinds = [("nscdd", False), ("nscdd", True), ("nscdd_ep", False), ("nscdd_ep", True), ("schwarz", False)]
    for friction in (0.3, 0.0):
        print(f"\nfriction {friction:g}\n\n| packing | sweeps | subdomains | NSCDD | NSCDD, accelerated | NSCDD-EP | NSCDD-EP, accelerated | Schwarz |")
        places = dict.fromkeys((row["packing"], int(row["sweeps"]), int(row["subdomains"])) for row in rows if float(row["friction"]) == friction)
        for packing, sweeps, subdomains in sorted(places, key=lambda place: (list(PACKINGS).index(place[0]), place[1] != 3, *place[1:])):
            cells = [cell(rows, packing=packing, friction=friction, sweeps=sweeps, subdomains=subdomains, method=method, momentum=momentum,
                          direction="automatic" if method == "nscdd_ep" else "") for method, momentum in kinds]
            print(f"| {packing} | {sweeps} | {subdomains} | {' | '.join(cells)} |")


def draw_large(rows, path):
    """Iterations to an error of 0.3 against subdomains, of each large packing: spheres with friction, disks without, because those with
    friction do not get there."""
    packings = [name for name in PACKINGS if name not in SMALL]
    figure, axes = plt.subplots(1, len(packings), figsize=(13, 3.6), sharey=True)
    labels = {"nscdd": "NSCDD", "nscdd_ep": "NSCDD-EP"}
    for axis, packing in zip(axes, packings):
        friction = "0.3" if packing.startswith("spheres") else "0.0"
        for method in labels:
            for momentum in ("False", "True"):
                points = sorted((int(row["subdomains"]), int(row["to error 0.3"])) for row in rows
                                if row["packing"] == packing and row["friction"] == friction and row["method"] == method and
                                row["momentum"] == momentum and row["direction"] in ("", "automatic") and
                                row["sweeps"] == "3" and row["to error 0.3"] != "")
                if points:
                    axis.loglog(*np.array(points).T, "o-" if momentum == "False" else "s--", color=COLOURS[method],
                                label=labels[method] + (", momentum" if momentum == "True" else ""))
        axis.set_title(f"{packing}, friction {friction}, 3 sweeps", fontsize=9)
        axis.set_xlabel("subdomains")
        axis.xaxis.set_ticks((1, 8, 32, 64), ("1", "8", "32", "64"))
        axis.xaxis.set_ticks([], minor=True)
    axes[0].set_ylabel("iterations to a velocity error of 0.3 g h")
    handles = {label: line for axis in axes for line, label in zip(*axis.get_legend_handles_labels())}
    figure.legend(handles.values(), handles.keys(), frameon=False, fontsize=8, loc="lower center", ncol=4)
    figure.tight_layout(rect=(0.0, 0.07, 1.0, 1.0))
    save_figure(figure, path)


def study(directory, listed, path):
    """Solve each case into the table `path`."""
    rows = []
    for case, iterations in listed:
        rows.append(solve(directory, settle(directory, case["packing"]), case, iterations))
        # after every case: a study that is stopped has what it has done
        write_csv(path, {key: [row[key] for row in rows] for key in rows[0]})


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", default="out/methods", help="directory of the results; default: out/methods")
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--quick", action="store_true", help="fewer cases")
    size.add_argument("--large", action="store_true", help="packings of 10^4 and 10^5 grains")
    parser.add_argument("--redraw", action="store_true", help="draw from the CSV files")
    options = parser.parse_args()
    directory = claimed(options.out)
    if options.large:
        if not options.redraw:
            study(directory, large_cases(), directory / "methods_large.csv")
        print_large(read_rows(directory / "methods_large.csv"))
        draw_large(read_rows(directory / "methods_large.csv"), directory / "methods_large.svg")
        return accepted(read_rows(directory / "methods_large.csv"), [], {})
    if not options.redraw:
        columns = study_columns(directory, options.quick)
        write_csv(directory / "methods_columns.csv", {key: [row[key] for row in columns] for key in columns[0]})
        study(directory, cases(options.quick), directory / "methods.csv")
    print_tables(read_rows(directory / "methods.csv"))
    rows, columns = read_rows(directory / "methods.csv"), read_rows(directory / "methods_columns.csv")
    draw(rows, columns, directory / "methods.svg")
    agreement = {packing: differences(directory, packing, PACKINGS[packing][0], settle(directory, packing)) for packing in SMALL}
    return accepted(rows, columns, agreement)


if __name__ == "__main__":
    run_study(main)
