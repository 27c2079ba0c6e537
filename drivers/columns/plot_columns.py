#!/usr/bin/env python3
"""Draw columns.png and columns.svg from the tables that gravier_columns wrote: error against DDM iteration."""
import argparse
import csv
import sys
from pathlib import Path

try:
    import matplotlib
except ImportError as missing:
    sys.exit(f"plot_columns.py: {missing}; expected a python3 with matplotlib")
matplotlib.use("Agg")
import matplotlib.pyplot as plt
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from whole_file import save_figure  # noqa: E402

SWEEPS = 1  # n_GS of the curves
# one colour a method (Okabe and Ito, safe for the colour-blind), one line style and marker a search direction
STYLES = {
    ("nlgs", ""): ("NLGS", "#000000", "-", None),
    ("schwarz", ""): ("Schwarz-NSCD", "#D55E00", "-", None),
    ("schwarz_ec", "1"): ("Schwarz-NSCD-EC, $l = 1$", "#E69F00", (0, (5, 1.5)), None),
    ("schwarz_ec", "1e4"): ("Schwarz-NSCD-EC, $l = 10^4$", "#E69F00", "-", None),
    ("nscdd", ""): ("NSCDD", "#0072B2", "-", None),
    ("nscdd_ep", "1"): ("NSCDD-EP, $l = 1$", "#009E73", (0, (5, 1.5)), None),
    ("nscdd_ep", "100"): ("NSCDD-EP, $l = 100$", "#009E73", "-", "s"),
    ("nscdd_ep", "1e4"): ("NSCDD-EP, $l = 10^4$", "#009E73", "-", "o"),
}


def read_rows(path):
    """Rows of a table as dictionaries."""
    try:
        with open(path, newline="") as file:
            return list(csv.DictReader(file))
    except OSError as reason:
        sys.exit(f"plot_columns.py: {path}: {reason.strerror}; expected a table written by gravier_columns")


def read_curves(path):
    """{problem: {(method, l): (iterations, errors)}} of the solves with SWEEPS sweeps an iteration."""
    curves = {}
    for row in read_rows(path):
        if int(row["n_gs"]) != SWEEPS:
            continue
        curve = curves.setdefault(row["problem"], {}).setdefault((row["method"], row["l"]), ([], []))
        curve[0].append(int(row["iteration"]))
        curve[1].append(float(row["error"]))
    return curves


def draw_panel(axes, curves):
    """All methods on one column; each curve ends where it met the tolerance."""
    for case, (label, colour, line, marker) in STYLES.items():
        if case in curves:
            axes.semilogy(*curves[case], label=label, color=colour, linestyle=line, linewidth=1.3,
                          marker=marker, markevery=max(1, len(curves[case][0]) // 20),
                          markersize=3.2, markerfacecolor="white", markeredgewidth=0.9)
    axes.set_xlabel(f"DDM iteration, $n_\\mathrm{{GS}} = {SWEEPS}$")
    axes.grid(True, which="major", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)


def last_iteration(curves):
    """End of the axes: all curves but the longest one fit, so that the shortest stay legible."""
    ends = sorted(curve[0][-1] for panel in curves.values() for curve in panel.values())
    return max(1.06 * ends[-2], 10)


def say_who_leaves(axes, curves, last):
    """Where a curve leaves the axes, write the iteration at which it ends."""
    for case, (iterations, errors) in curves.items():
        if iterations[-1] <= last or case not in STYLES:
            continue
        height = errors[iterations.index(int(last))]
        axes.annotate(f"to {iterations[-1]}", (last, height), xytext=(-3, -4), textcoords="offset points", ha="right", va="top",
                      fontsize=8.5, color=STYLES[case][1])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path, metavar="DIR", help="where columns_table.csv and columns_error.csv are")
    directory = parser.parse_args().directory

    curves = read_curves(directory / "columns_error.csv")
    if not curves:
        sys.exit(f"plot_columns.py: {directory / 'columns_error.csv'}: no row with n_gs = {SWEEPS}")
    columns = {row["problem"]: row for row in read_rows(directory / "columns_table.csv")}

    plt.rcParams.update({"font.size": 9, "svg.hashsalt": "gravier", "svg.fonttype": "none"})
    width, legend = 3.6 * len(curves) + 0.6, 0.9 / len(curves)  # inches
    height = 3.6 + legend
    figure, panels = plt.subplots(1, len(curves), figsize=(width, height), sharey=True, sharex=True, squeeze=False)
    figure.subplots_adjust(left=0.62 / width, right=1 - 0.15 / width, bottom=(legend + 0.55) / height, top=1 - 0.25 / height,
                           wspace=0.07)
    last = last_iteration(curves)
    for letter, axes, (problem, curve) in zip(("(a) ", "(b) ") if len(curves) > 1 else ("",), panels[0], curves.items()):
        draw_panel(axes, curve)
        axes.set_title(f"{letter}{columns[problem]['disks']} disks, {columns[problem]['subdomains']} subdomains", fontsize=9)
        say_who_leaves(axes, curve, last)
    panels[0, 0].set_xlim(0, last)
    panels[0, 0].set_ylabel("relative error on the impulses")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncol=2 * len(curves), frameon=False, fontsize=8.5,
                  columnspacing=1.4)
    # neither file says when it was made or by which version
    save_figure(figure, directory / "columns.png", dpi=200, metadata={"Software": None})
    save_figure(figure, directory / "columns.svg", metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    main()
