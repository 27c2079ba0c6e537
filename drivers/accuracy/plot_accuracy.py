#!/usr/bin/env python3
"""Draw accuracy.png and accuracy.svg from the table of gravier_accuracy in a directory: the criterion of a solve against seconds;
errors against seconds and against the step or the tolerance, with the knee; or iterations and seconds against what was varied.
With --markdown print the tables of doc/accuracy.md instead."""
import argparse
import csv
import math
import sys
from pathlib import Path

try:
    import matplotlib
except ImportError as missing:
    sys.exit(f"plot_accuracy.py: {missing}; expected a python3 with matplotlib")
matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import NullFormatter
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from whole_file import save_figure  # noqa: E402

# one colour a variant (Okabe and Ito, safe for the colour-blind), one marker an error
COLOURS = ["#000000", "#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9", "#F0E442"]
MARKERS = "osd^vPX*"
ERRORS = {"position_error": "positions", "velocity_error": "velocities", "force_error": "impulses", "stress_error": "mean stress"}


def read(path):
    """Rows of a table as dictionaries."""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except OSError as reason:
        sys.exit(f"plot_accuracy.py: {path}: {reason.strerror}; expected a table written by gravier_accuracy")
    return rows


def by_variant(rows):
    """{variant: rows}, in the order of the table, without the reference of a study of runs."""
    variants = {}
    for row in rows:
        if row["kind"] == "solve" or row["value"]:
            variants.setdefault(row["variant"], []).append(row)
    return variants


def number(cell):
    """NaN for an empty cell or a text."""
    try:
        return float(cell)
    except ValueError:
        return math.nan


def column(rows, name):
    return [number(row[name]) for row in rows]


def quantities(rows):
    """Names of the quantities that are compared: columns that have a column of errors."""
    return [name for name in rows[0] if name + "_error" in rows[0]]


def is_there(rows, name):
    return any(number(row[name]) > 0 for row in rows)


def styles(variants):
    return {name: COLOURS[k % len(COLOURS)] for k, name in enumerate(variants)}


def has_positive(axes, coordinate):
    """Whether a curve has a number above 0 along x (0) or y (1)."""
    return any(value > 0 for line in axes.lines for value in line.get_data()[coordinate])


def finish(axes, x, y, log=True):
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    # where no iteration was made there is no number above 0, and no logarithmic scale
    if log and has_positive(axes, 0):
        axes.set_xscale("log")
        axes.xaxis.set_minor_formatter(NullFormatter())
    if log and has_positive(axes, 1):
        axes.set_yscale("log")
    axes.grid(True, which="major", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)


def draw_solve(variants, panels):
    """Criterion against iterations and against seconds."""
    criterion = "error" if any(is_there(rows, "error") for rows in variants.values()) else "residual"
    label = "relative error of the impulses" if criterion == "error" else "residual"
    for axes, x, name in zip(panels, ("iteration", "seconds"), ("iterations", "seconds of iterations")):
        for variant, colour in styles(variants).items():
            rows = [row for row in variants[variant] if number(row["iteration"]) > 0 and number(row[criterion]) > 0]
            axes.plot(column(rows, x), column(rows, criterion), color=colour, linewidth=1.2, label=variant)
        finish(axes, name, label)


def draw_errors(variants, axes, x, label):
    """Every error that is known against column `x`."""
    rows = [row for several in variants.values() for row in several]
    known = [name for name in ERRORS if is_there(rows, name)]
    for variant, colour in styles(variants).items():
        for name, marker in zip(known, MARKERS):
            axes.plot(column(variants[variant], x), column(variants[variant], name), color=colour, marker=marker, markersize=4,
                      markerfacecolor="white", linewidth=1.0)
    finish(axes, label, "error")
    name_markers(axes, [text(name) for name in known])


def name_markers(axes, labels):
    """What each marker is, above the panel: within it a curve would run through the names."""
    axes.legend(handles=[plt.Line2D([], [], color="0.4", marker=marker, markersize=4, markerfacecolor="white", linestyle="", label=label)
                         for label, marker in zip(labels, MARKERS)],
                loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.1, ncol=max(1, len(labels)), columnspacing=0.8,
                handlelength=0.8, handletextpad=0.3, frameon=False, fontsize=7)


def text(name):
    """An error and its unit."""
    units = {"position_error": " [m]", "velocity_error": " [m/s]"}
    return ERRORS[name] + units.get(name, ", relative")


def draw_tolerance(variants, panels, compared):
    draw_errors(variants, panels[0], "solve_seconds", "seconds in solves")
    axes = panels[1]
    if not compared:
        draw_errors(variants, axes, "tolerance", "tolerance")
        return
    for variant, colour in styles(variants).items():
        for name, marker in zip(compared, MARKERS):
            axes.plot(column(variants[variant], "tolerance"), column(variants[variant], name + "_error"), color=colour,
                      marker=marker, markersize=4, markerfacecolor="white", linewidth=1.0)
    finish(axes, "tolerance", "deviation of the mean, relative")
    axes.axhline(number(next(iter(variants.values()))[0]["knee"]), color="0.6", linewidth=0.8, linestyle="--")
    name_markers(axes, [name.replace("_", " ") for name in compared])


def draw_step(variants, panels):
    draw_errors(variants, panels[0], "step", "step [s]")
    draw_errors(variants, panels[1], "solve_seconds", "seconds in solves")


def draw_size(variants, panels):
    rows = [row for several in variants.values() for row in several]
    vary = rows[0]["vary"]
    x, label = "value", vary
    if len({row["grains"] for row in rows}) > 1:
        x, label = "grains", "grains"
    for axes, name, of in zip(panels, ("iterations", "solve_seconds"), ("iterations", "seconds in solves")):
        for variant, colour in styles(variants).items():
            axes.plot(column(variants[variant], x), column(variants[variant], name), color=colour, marker="o", markersize=4,
                      markerfacecolor="white", linewidth=1.0, label=variant)
        finish(axes, label, of)


def table(head, lines):
    """A table in Markdown, numbers to the right."""
    print("| " + " | ".join(head) + " |")
    print("|" + "|".join("---" if k == 0 else "---:" for k in range(len(head))) + "|")
    for line in lines:
        print("| " + " | ".join(line) + " |")
    print()


def short(value, digits=3):
    if math.isnan(value):
        return "-"
    shown = f"{value:.{digits}g}"
    return shown.replace("e-0", "e-").replace("e+0", "e")


def print_solve(variants):
    criterion = "error" if any(is_there(rows, "error") for rows in variants.values()) else "residual"
    levels = [d for d in range(1, 13) if any(number(row[criterion]) <= 10.0**-d for rows in variants.values() for row in rows)]

    def reached(rows, d):
        for row in rows:
            if number(row[criterion]) <= 10.0**-d:
                return f"{row['iteration']} / {short(number(row['seconds']), 2)}"
        return "-"
    table([f"iterations / seconds to {'an error' if criterion == 'error' else 'a residual'} of", *(f"1e-{d}" for d in levels)],
          [[variant, *(reached(rows, d) for d in levels)] for variant, rows in variants.items()])


def print_runs(variants, rows):
    known = [name for name in ERRORS if is_there(rows, name)]
    compared = quantities(rows)
    table(["variant", rows[0]["vary"], "grains", "subdomains", "iterations", "seconds in solves", *(text(name) for name in known),
           *(name.replace("_", " ") + ", relative" for name in compared)],
          [[variant, row["value"].strip("'"), row["grains"], row["subdomains"], row["iterations"] + " *" * (number(row["failed"]) > 0),
            short(number(row["solve_seconds"])), *(short(number(row[name]), 2) for name in known),
            *(short(number(row[name + "_error"]), 2) for name in compared)]
           for variant, several in variants.items() for row in several])


def print_tables(directory, rows):
    variants = by_variant(rows)
    if rows[0]["kind"] == "solve":
        print_solve(variants)
        return
    print_runs(variants, rows)
    summary = read(directory / "accuracy_summary.csv")
    figures = list(dict.fromkeys(row["figure"] for row in summary))
    if figures:
        found = {(row["variant"], row["figure"]): number(row["value"]) for row in summary}
        table(["variant", *(figure.replace("_", " ").replace(":", ", ") for figure in figures)],
              [[variant, *(short(found.get((variant, figure), math.nan)) for figure in figures)] for variant in variants])


def draw(directory, rows):
    variants = by_variant(rows)
    plt.rcParams.update({"font.size": 9, "svg.hashsalt": "gravier", "svg.fonttype": "none"})
    figure, panels = plt.subplots(1, 2, figsize=(8, 4.2))
    vary = rows[0].get("vary", "")
    if rows[0]["kind"] == "solve":
        draw_solve(variants, panels)
    elif vary == "step":
        draw_step(variants, panels)
    elif vary == "tolerance" and any(is_there(rows, name) for name in ERRORS):
        draw_tolerance(variants, panels, quantities(rows))
    else:
        draw_size(variants, panels)
    handles = [plt.Line2D([], [], color=colour, label=variant) for variant, colour in styles(variants).items()]
    columns = min(4, len(handles))
    figure.legend(handles=handles, loc="lower center", ncol=columns, frameon=False, fontsize=8)
    figure.subplots_adjust(left=0.09, right=0.98, top=0.89, wspace=0.28, bottom=0.15 + 0.045 * -(-len(handles) // columns))
    figure.suptitle(rows[0]["title"], fontsize=10)
    # neither file says when it was made or by which version
    save_figure(figure, directory / "accuracy.png", dpi=200, metadata={"Software": None})
    save_figure(figure, directory / "accuracy.svg", metadata={"Date": None, "Creator": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path, metavar="DIR", help="where accuracy.csv is")
    parser.add_argument("--markdown", action="store_true", help="print tables, draw nothing")
    options = parser.parse_args()
    rows = read(options.directory / "accuracy.csv")
    if not rows or "variant" not in rows[0]:
        sys.exit(f"plot_accuracy.py: {options.directory}/accuracy.csv: expected rows of a table written by gravier_accuracy")
    if options.markdown:
        print_tables(options.directory, rows)
    else:
        draw(options.directory, rows)


if __name__ == "__main__":
    main()
