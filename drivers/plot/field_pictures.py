"""Fields on a grid: panels of coloured cells over two axes, or profiles along one."""
import matplotlib.pyplot as plt
import numpy
from curve_pictures import TIMES, draw_columns, label_of, limits_of
from matplotlib.colors import LogNorm
from matplotlib.ticker import FuncFormatter, MaxNLocator
from picture_space import draw_flat_walls
from picture_style import TURNS, PictureError, scaled

import gravier

#: columns that are drawn unless told, as far as the fields have them
SHOWN = ("solid_fraction", "velocity", "granular_temperature", "pressure", "shear_ratio", "inertial_number")
#: colours cover the values but for this part at either end
BEYOND = 0.01
#: solid fraction below which a cell is blank
BLANK = 0.01
#: arrows along the longer side of a panel; width and height of a figure [inches] at most
ARROWS, WIDTH, HEIGHT = 18, 7.6, 8.6
#: of a panel beside its cells: its bar of colours and what is below it [inches]
BESIDE, BELOW = 1.05, 0.55


def columns_of(fields, asked=None):
    """The columns to draw: those that are asked for, which the fields must have, or SHOWN. A column of vectors is drawn with arrows; of tensors components are, such as contact_stress_xy."""
    known = [name for name, values in fields.items() if values.ndim == 2 or (values.ndim == 3 and len(fields.axes) == 1)] + [name for name in fields.flat() if name not in ("step", "time", "states", "x", "y", "z")]
    for name in asked or []:
        if name not in known:
            raise PictureError(f"no column {name} of these fields; expected one of {', '.join(known)}")
    return asked or [name for name in SHOWN if name in known]


def draw_fields(fields, asked=None, walls=None):
    """A figure of gravier.Fields: a panel for each column. `walls` are those of a scene in the plane."""
    columns = columns_of(fields, asked)
    if len(fields.axes) == 1:
        return draw_along(fields, columns)
    if len(fields.axes) == 3:
        raise PictureError("fields over x, y and z; expected two axes or one for a picture")
    return draw_cells(fields, columns, walls)


def draw_along(fields, columns):
    axis = "xyz".index(fields.axes)
    centre = numpy.zeros((len(fields), fields.dimension))
    centre[:, axis] = fields[fields.axes]
    table = gravier.Table({**fields, **fields.flat(), "centre": centre})
    figure, _, _ = draw_columns([table], columns, (fields.dimension, axis), [fields.time[0]])
    figure.suptitle(title_of(fields), fontsize=9, x=0.01, ha="left")
    return figure


def title_of(fields):
    states = int(fields.states[0])
    return f"step {fields.step[0]}, t = {fields.time[0]:.4g} s" if states == 1 else f"mean of {states} states up to step {fields.step[0]}, t = {fields.time[0]:.4g} s"


def draw_cells(fields, columns, walls=None):
    """Cells of two axes, blank where they hold less than BLANK of grains; the cells of a periodic cell lean as its mean does."""
    first, second = ("xyz".index(axis) for axis in fields.axes)
    x, y = corners_of(fields, first, second)
    wide, high = numpy.ptp(x), numpy.ptp(y)
    across, size = layout(len(columns), high / wide)
    figure, places = plt.subplots(-(-len(columns) // across), across, squeeze=False, sharex=True, sharey=True, figsize=size, layout="constrained")
    there = fields.grid("solid_fraction") >= BLANK
    for axes, name in zip(places.ravel(), columns):
        draw_panel(axes, (x, y), fields, name, there)
        if walls is not None:
            draw_flat_walls(axes, walls, *(numpy.array([side(x), side(y)]) for side in (numpy.min, numpy.max)))
        axes.set(aspect="equal", xlim=(x.min(), x.max()), ylim=(y.min(), y.max()))
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        axes.tick_params(labelsize=8)
    for axes in places.ravel()[len(columns):]:
        axes.remove()
    for row in range(len(places)):
        places[row, 0].set_ylabel(f"{fields.axes[1]} [m]")
    for column in range(across):
        last = (len(columns) - 1 - column) // across
        places[last, column].set_xlabel(f"{fields.axes[0]} [m]")
        places[last, column].tick_params(labelbottom=True)
    figure.suptitle(title_of(fields), fontsize=9, x=0.01, ha="left")
    return figure


def corners_of(fields, first, second):
    """Places of the corners of the cells in the picture (n + 1, m + 1) [m]."""
    i, j = numpy.meshgrid(*(numpy.arange(count + 1) / count for count in fields.shape), indexing="ij")
    # in the middle of the axis over which fields are means
    middle = fields.corner + sum(0.5 * fields.edges[axis] for axis in range(fields.dimension) if axis not in (first, second))
    points = middle + i[..., None] * fields.edges[first] + j[..., None] * fields.edges[second]
    return points[..., first], points[..., second]


def layout(count, slope):
    """How many panels stand beside each other, and the size of the figure, so that panels of a slope, height over width, are as large as they can be."""
    found = []
    for across in range(1, min(count, 4) + 1):
        rows = -(-count // across)
        wide = min(WIDTH / across - BESIDE, (HEIGHT / rows - BELOW) / slope)
        found.append((wide * wide * slope, across, (across * (wide + BESIDE), rows * (wide * slope + BELOW) + 0.3)))
    _, across, size = max(found)
    return across, (max(size[0], 3.2), max(size[1], 1.6))


def draw_panel(axes, corners, fields, name, there):
    values = fields.grid(name) if name in fields else gravier.Table(fields.flat())[name].reshape(fields.shape)
    arrows = values if values.ndim > len(fields.shape) else None
    if arrows is not None:
        values = numpy.linalg.norm(values, axis=-1)
    shown = numpy.where(there & numpy.isfinite(values), values, numpy.nan)
    style, ends = colours_of(shown)
    label = label_of("speed" if name == "velocity" else name, fields.dimension)
    drawn = axes.pcolormesh(*corners, numpy.ma.masked_invalid(shown), **style, linewidth=0.0, rasterized=True)
    bar = axes.figure.colorbar(drawn, ax=axes, extend=ends, aspect=22, pad=0.03, shrink=0.95)
    bar.ax.tick_params(labelsize=7.5)
    norm = style["norm"]
    top = max(abs(norm.vmin), abs(norm.vmax))
    if not isinstance(norm, LogNorm):
        bar.locator = MaxNLocator(5, steps=[1, 2, 5, 10])
        if not 1e-2 <= top < 1e4:
            power, ten = scaled(top, "")
            bar.formatter = FuncFormatter(lambda value, _: f"{value / 10.0**power:.6g}")
            words, _, unit = label.partition(" [")
            label = f"{words} [{(ten + unit.removesuffix(']')).strip()}]"
        bar.update_ticks()
    axes.set_title(label, fontsize=9, loc="left")
    if arrows is not None:
        first, second = ("xyz".index(axis) for axis in fields.axes)
        draw_arrows(axes, corners, arrows[..., (first, second)], there)


def colours_of(values):
    """Map and norm of the colours of an array with NaN, and which ends have values beyond them: logarithms where curves have them, and orange against violet for both signs."""
    known = values[numpy.isfinite(values)]
    if len(known) == 0:
        return {"cmap": TIMES, "norm": plt.Normalize(0.0, 1.0)}, "neither"
    low, high = numpy.quantile(known, (BEYOND, 1.0 - BEYOND))
    least, most, cmap = known.min(), known.max(), TIMES
    if limits_of(known, zeros=True)[0] == "log":
        # what is 0 has no logarithm, and the colour of the least
        low = max(low, 1e-4 * high)
        norm = LogNorm(low, high)
    elif low < 0.0 < high and min(-low, high) > 0.05 * max(-low, high):
        high = max(-low, high)
        low, cmap, norm = -high, TURNS, plt.Normalize(-high, high)
    else:
        low, high = (0.0 if 0.0 <= low < 0.3 * high else low), (0.0 if 0.3 * low < high <= 0.0 else high)
        if not high > low:
            low, high = low - 0.05 * (abs(low) or 1.0), high + 0.05 * (abs(high) or 1.0)
        cmap, norm = (TIMES if high > 0.0 else TIMES.reversed()), plt.Normalize(low, high)
    below, above = bool(least < low - 1e-9 * (high - low)), bool(most > high + 1e-9 * (high - low))
    return {"cmap": cmap, "norm": norm}, {(True, True): "both", (True, False): "min", (False, True): "max"}.get((below, above), "neither")


def draw_arrows(axes, corners, vectors, there):
    """Arrows of a field of vectors, at some of the cells; the longest ones reach to the next."""
    step = max(1, -(-max(there.shape) // ARROWS))
    chosen = (slice(step // 2, None, step),) * 2
    x, y = (0.25 * (c[:-1, :-1] + c[1:, :-1] + c[:-1, 1:] + c[1:, 1:]) for c in corners)
    u, v = (numpy.where(there, vectors[..., k], numpy.nan)[chosen] for k in (0, 1))
    speed = numpy.hypot(u, v)
    speed = speed[numpy.isfinite(speed)]
    if len(speed) == 0 or not speed.max() > 0.0:
        return
    wide = step * min(numpy.ptp(c) / n for c, n in zip(corners, there.shape))
    axes.quiver(x[chosen], y[chosen], u, v, color="0.15", angles="xy", scale_units="xy", scale=numpy.quantile(speed, 1.0 - BEYOND) / (1.1 * wide), width=0.006, pivot="middle")
