#!/usr/bin/env python3
"""Draw the performance profile that `gravier_fclib --profile FILE` wrote."""
import argparse
import csv
import sys
from pathlib import Path

try:
    import matplotlib
except ImportError as missing:
    sys.exit(f"plot_fclib.py: {missing}; expected a python3 with matplotlib")
matplotlib.use("Agg")
import matplotlib.pyplot as plt
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from whole_file import PICTURES, claim, save_figure  # noqa: E402

# one colour a method (Okabe and Ito, safe for the colour-blind)
STYLES = {
    "auto": ("auto", "#000000", "-"),
    "nlgs": ("NLGS", "#D55E00", "-"),
    "momentum": ("NLGS with momentum", "#0072B2", (0, (5, 1.5))),
    "newton": ("proximal Newton", "#009E73", "-"),
}


def read_profile(path):
    """{column: numbers} of the table."""
    try:
        with open(path, newline="") as file:
            rows = list(csv.DictReader(file))
        return {name: [float(row[name]) for row in rows] for name in rows[0]}
    except (OSError, IndexError, ValueError, TypeError) as reason:
        sys.exit(f"plot_fclib.py: {path}: {reason}; expected a table written by gravier_fclib --profile")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("profile", type=Path, metavar="FILE", help="the table")
    parser.add_argument("--out", type=Path, default=Path("fclib.png"), metavar="FIGURE", help="*.png or *.svg (fclib.png)")
    arguments = parser.parse_args()
    claim(arguments.out, PICTURES)

    profile = read_profile(arguments.profile)
    ratio = profile.pop("ratio", None)
    if ratio is None or not profile.keys() <= STYLES.keys():
        sys.exit(f"plot_fclib.py: {arguments.profile}: expected the columns ratio and some of {', '.join(STYLES)}")
    plt.rcParams.update({"font.size": 9, "svg.hashsalt": "gravier", "svg.fonttype": "none"})
    figure, axes = plt.subplots(figsize=(5.2, 3.4), layout="constrained")
    for method, fractions in profile.items():
        label, colour, line = STYLES[method]
        axes.step(ratio, fractions, where="post", label=label, color=colour, linestyle=line, linewidth=1.3)
    axes.set_xscale("log")
    axes.set_xlim(1, ratio[-1])
    axes.set_ylim(0, 1.02)
    axes.set_xlabel("seconds, relative to the fastest method")
    axes.set_ylabel("problems solved")
    axes.grid(True, which="major", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.legend(loc="lower right", frameon=False)
    # the file does not say when it was made or by which version
    svg = arguments.out.suffix == ".svg"
    save_figure(figure, arguments.out, dpi=200, metadata={"Date": None, "Creator": None} if svg else {"Software": None})


if __name__ == "__main__":
    main()
