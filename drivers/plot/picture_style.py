"""What all pictures of matplotlib share: maps of colours, powers of ten, fonts, files, and the error of one line."""
import matplotlib.pyplot as plt
import numpy
from matplotlib.colors import BoundaryNorm, LinearSegmentedColormap, ListedColormap, to_rgb
from palette import KINDS, SHADES
from whole_file import save_figure

SPEEDS = LinearSegmentedColormap.from_list("speeds", SHADES)
TURNS = "PuOr"
WALLS = "0.25"
#: settings of matplotlib; the names of parts of an SVG are those of every run
SETTINGS = {"font.size": 9, "svg.hashsalt": "gravier"}


class PictureError(Exception):
    """One line: what cannot be drawn, and what was expected."""


def colours_of_kinds(count):
    """A map and a norm for numbers from 1 to `count`: eight colours, then the same ones lighter, then again from the first."""
    lighter = [1.0 - 0.45 * (1.0 - numpy.array(to_rgb(colour))) for colour in KINDS]
    shades = [to_rgb(colour) for colour in KINDS] + [tuple(colour) for colour in lighter]
    listed = [shades[k % len(shades)] for k in range(max(count, 1))]
    return {"cmap": ListedColormap(listed), "norm": BoundaryNorm(numpy.arange(len(listed) + 1) + 0.5, len(listed))}


def scaled(top, unit):
    """A power of ten that makes `top` a number from 1 to 1000, and the unit with it."""
    power = 3 * int(numpy.floor(numpy.log10(top) / 3.0))
    return power, f"$10^{{{power}}}$ {unit}" if power != 0 else unit


def save_picture(figure, path, dpi=200):
    """PNG or SVG, by the ending of the path, without what would tell when."""
    save_figure(figure, path, dpi=dpi, bbox_inches="tight", metadata={"Software": None} if path.suffix == ".png" else {"Date": None})
    plt.close(figure)
