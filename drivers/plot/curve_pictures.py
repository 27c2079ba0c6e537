"""Curves: panels of history.csv against time or another column, convergence of a solve, profiles of means over the bins of a region."""
import re
import textwrap

import matplotlib.pyplot as plt
import numpy
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.ticker import FuncFormatter, MaxNLocator
from one_line import plain
from palette import LINES, SHADES
from picture_style import PictureError, scaled

from gravier.histories import History
from gravier.measured import read_measured
from gravier.outflows import FORMER, former_name

#: early steps are light, late ones dark
TIMES = LinearSegmentedColormap.from_list("times", SHADES[1:])
#: the same without a hue, where components have their own
GREYS = LinearSegmentedColormap.from_list("greys", ["0.8", "0.15"])
STYLES = ["-", "--", ":", "-."]
#: of the components of a profile, which are five at most
PARTS = [*STYLES, (0, (7, 1.5, 1, 1.5, 1, 1.5))]
UNITS = [(r"kinetic_|potential_energy|[a-z]+_work$|dissipated_|carried_away|energy_error|.*energy$", "J"), (r"time$|wall_seconds|solve_seconds", "s"),
         (r"force_[xyz]:|force_mean|force_max|body_f[xyz]:", "N"), (r"moment_[xyz]:|body_m[xyz]:", "N m"), (r"(position|body)_[xyz]:|max_overlap|overlap_mean", "m"), (r"entered_mass|(total_)?left_mass", "kg"),
         (r".*granular_temperature|temperature(_[xyz])?$", "m²/s²"), (r"velocity_error|velocity_scale|body_v[xyz]:|.*velocity_[xyz]|velocity$|speed$", "m/s"), (r"body_(omega|w[xyz]):|spin_[xyz]:", "rad/s"), (r"power:", "W"),
         (r"gravity_[xyz]", "m/s²"), (r"(gradient(_[xyz]{2})?|shear_rate|number_rate)$", "1/s"), (r"mass_rate$", "kg/s"), (r"(height_difference|height|front_low|front_high|length)$", "m"), (r"angle(_low|_high)?$", "degrees")]
#: columns of places: their origin says nothing, so that their axes need not begin there
PLACES = re.compile(r"(position|body)_[xyz]:|front_")
#: an axis begins at 0 where the least value is below this part of the largest one; a range below this part of the values has a base of its own
NEAR, NARROW = 0.2, 1e-3
#: of the label of a panel at most
MOST_LINES = 4
NAMES = {"shear_ratio": "shear stress ratio |τ|/p", "max_overlap": "largest overlap", "overlap_mean": "mean overlap", "wall_seconds": "wall time of a step", "solve_seconds": "wall time of a solve",
         "velocity_scale": "velocity scale U", "left": "grains that leave in a step", "left_mass": "mass that leaves in a step", "entered": "grains that enter in a step", "entered_mass": "mass that enters in a step",
         "total_left": "grains that have left", "total_left_mass": "mass that has left", "number_rate": "grains that leave", "mass_rate": "mass that leaves", "fast": "grains that are too fast",
         "converged": "converged (1) or not (0)", "force_mean": "mean normal force", "force_max": "largest normal force", "dissipated_normal": "dissipated by impacts", "dissipated_friction": "dissipated by friction",
         "mixing": "Lacey's index M", "sin_phi": "sin φ", "run_out": "run-out"}
#: columns of boundaries and bodies: what stands for the text before the sign
OF_BOUNDARY = re.compile(r"(force|moment|position|velocity|spin|power)(?:_([xyz]))?:(.*)", re.S)
OF_BODY = re.compile(r"body_(v|omega|w|f|m)?([xyz])?:(.*)", re.S)
BODY_WORDS = {None: "place", "v": "velocity", "omega": "spin", "w": "spin", "f": "force", "m": "moment"}
#: columns that decay over decades, or begin at 0: on an axis of logarithms their zeros may be missing
DECAYS = re.compile(r"residual|jump|velocity_error|energy_error|.*kinetic|.*granular_temperature|max_overlap|overlap_mean|dissipated_")


def times_of(component):
    """The shades of a component, by its number from 0: from a light one of its colour to a dark one; those of the first are TIMES."""
    colour = numpy.array(to_rgb(LINES[component % len(LINES)]))
    return TIMES if component == 0 else LinearSegmentedColormap.from_list(f"times {component}", [1.0 - 0.5 * (1.0 - colour), colour, 0.65 * colour])


def label_of_all(name, dimensions):
    """Name of a column of history.csv of several runs: with both units where those of the plane have another one."""
    labels = [label_of(name, dimension) for dimension in sorted(set(dimensions))]
    if len(set(labels)) == 1:
        return labels[0]
    name, units = labels[0].split(" [")[0], [label.split(" [")[1].removesuffix("]") for label in labels]
    return f"{name} [{units[0]} in 2D, {units[1]} in 3D]"


def label_of(name, dimension):
    """Name of a column of history.csv with its unit."""
    text = NAMES.get(name, words_of_place(name) or name.replace("_", " "))
    if re.search(r"(^|_)(stress(_[xyz]{2})?|pressure|axial_stress|lateral_stress)$", name):
        return f"{text} [{'N/m' if dimension == 2 else 'Pa'}]"
    if re.search(r"(^|_)volume$", name):
        return f"{text} [{'m²' if dimension == 2 else 'm³'}]"
    if name == "density":
        return f"{text} [{'kg/m²' if dimension == 2 else 'kg/m³'}]"
    unit = next((unit for pattern, unit in UNITS if re.match(pattern, name)), None)
    return f"{text} [{unit}]" if unit else text


def words_of_place(name):
    """Words for a column of a boundary or of a tracked body; None for others."""
    found = OF_BOUNDARY.fullmatch(name)
    if found:
        kind, axis, place = found.groups()
        return f"{kind}{f' {axis}' if axis else ''} {'on' if kind in ('force', 'moment') else 'of'} {place.replace('_', ' ')}"
    found = OF_BODY.fullmatch(name)
    if found:
        kind, axis, number = found.groups()
        return f"{BODY_WORDS[kind]}{f' {axis}' if axis else ''} {'on' if kind in ('f', 'm') else 'of'} body {number}"
    return None


def names_of(runs):
    """What tells the directories of runs apart: their paths without what all begin and end with."""
    parts = [run.directory.resolve().parts for run in runs]
    if len(set(parts)) < len(parts):
        return [str(run.directory) for run in runs]
    shortest = min(len(path) for path in parts)
    first = next((k for k in range(shortest) if len({path[k] for path in parts}) > 1), shortest - 1)
    last = next((k for k in range(1, shortest - first) if len({path[-k] for path in parts}) > 1), shortest - first)
    return ["/".join(path[first:len(path) - last + 1]) for path in parts]


def limits_of(values, logarithms=True, places=False, zeros=False):
    """Scale and limits of an axis on which the values are seen: logarithms where the largest is far above a quarter of them, but no more
    than three decades for the least twentieth; from 0 where that is near. Values of 0 have no place on logarithms: there are none with them unless `zeros`
    may be missing. The axis of places fits them, wherever 0 is."""
    values = values[numpy.isfinite(values)]
    positive = values[values > 0.0]
    if len(values) == 0:
        return "linear", 0.0, 1.0
    low, high = values.min(), values.max()
    if logarithms and not places and (low > 0.0 or zeros and low == 0.0) and 2 * len(positive) > len(values):
        if high > 30.0 * numpy.quantile(positive, 0.25):
            return "log", max(positive.min(), 1e-3 * numpy.quantile(positive, 0.05)) / 1.5, 1.5 * high
    if not places and 0.0 <= low < NEAR * high:
        return "linear", 0.0, 1.05 * high
    if not places and NEAR * low < high <= 0.0:
        return "linear", 1.05 * low, 0.0
    top = max(abs(low), abs(high))
    # what differs by rounding alone is constant
    margin = 0.05 * (high - low) if high - low > 1e-12 * top else 0.05 * top or 0.5
    return "linear", low - margin, high + margin


def base_of(low, high):
    """What all numbers of an axis would begin with, and its text: a multiple of a power of ten above the range, where that is narrow."""
    if high - low >= NARROW * max(abs(low), abs(high)):
        return 0.0, ""
    digits = -int(numpy.ceil(numpy.log10(high - low)))
    base = float(numpy.floor(low * 10.0**digits) / 10.0**digits)
    return base, f"{'−' if base > 0.0 else '+'} {abs(base):.{max(0, digits)}f}"


def fit_axis(axis, values, label, logarithms=True, places=False, zeros=False):
    """Scale, limits and label of an axis for these values."""
    name = axis.axis_name
    scale, low, high = limits_of(values, logarithms, places, zeros)
    axis.axes.set(**{f"{name}scale": scale, f"{name}lim": (low, high)})
    name_axis(axis, (low, high), label, scale)


def name_axis(axis, limits, label, scale="linear"):
    """The label and the numbers of an axis with these limits. A power of ten stands in the label, beside the unit, not over the panel; what all
    numbers begin with stands in a second line of the label."""
    low, high = limits
    base, text = base_of(low, high) if scale == "linear" else (0.0, "")
    top = max(abs(low - base), abs(high - base))
    if scale == "linear" and (text or not 1e-2 <= top < 1e4):
        power, ten = (0, "") if 1e-2 <= top < 1e4 else scaled(top, "")
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{(value - base) / 10.0**power:.6g}"))
        words, _, unit = label.partition(" [")
        if text:
            words += f"\n{text} {unit.removesuffix(']')}".rstrip()
        label = f"{words} [{(ten + unit.removesuffix(']')).strip()}]" if ten or unit else words
    axis.set_label_text(label)


def legend_above(axes, columns=3):
    """The legend over the panel, where it covers nothing."""
    handles, names = axes.get_legend_handles_labels()
    if names:
        axes.legend(handles, names, loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.1, frameon=False, fontsize=8,
                    ncol=min(columns, len(names)), columnspacing=1.2, handlelength=1.6)


def grid(axes):
    axes.grid(True, color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)


class Panel:
    """Curves over one axis: `label` of the vertical axis, `curves` (x, y, name or None), `goals` (value, name); never with logarithms
    where `counts`; `places` fit the panel, wherever 0 is; `zeros` may be missing on logarithms."""

    def __init__(self, label, curves, goals=(), counts=False, places=False, zeros=False):
        self.label, self.curves, self.goals, self.counts, self.places, self.zeros = label, curves, list(goals), counts, places, zeros

    def draw(self, axes, colours=LINES):
        values = numpy.concatenate([numpy.asarray(y, float) for _, y, _ in self.curves] + [[value] for value, _ in self.goals])
        scale, low, _ = limits_of(values, not self.counts, self.places, self.zeros)
        missing = False
        for k, (x, y, name) in enumerate(self.curves):
            if scale == "log" and name and not (numpy.asarray(y) > 0.0).any():
                name += ": 0"
            else:
                missing = missing or scale == "log" and (numpy.asarray(y) == 0.0).any()
            axes.plot(x, y, color=colours[k % len(colours)], linestyle=STYLES[k // len(colours) % len(STYLES)], linewidth=1.2, label=name,
                      marker="o" if len(x) <= 50 else None, markersize=3)
        for value, name in self.goals:
            axes.axhline(value, color="0.35", linewidth=0.9, linestyle=(0, (5, 2)), label=name)
        grid(axes)
        fit_axis(axes.yaxis, values, self.label, not self.counts, self.places, self.zeros)
        positive = values[numpy.isfinite(values) & (values > 0.0)]
        if scale == "log" and (missing or positive.min() < low):
            axes.text(0.995, 0.03, f"values go down to {0.0 if missing else positive.min():.1g}", transform=axes.transAxes, ha="right", va="bottom", fontsize=7, color="0.35")
        legend_above(axes)


def draw_panels(panels, width=6.2, height=1.75, along="time [s]"):
    """A figure of panels one under the other, against time or what else is `along` them."""
    high = [height + 0.22 * any(name for _, _, name in panel.curves) for panel in panels]
    figure, places = plt.subplots(len(panels), 1, figsize=(width, 0.4 + sum(high)), sharex=True, squeeze=False, constrained_layout=True)
    for axes, panel in zip(places[:, 0], panels):
        panel.draw(axes)
    name_axis(places[-1, 0].xaxis, places[-1, 0].get_xlim(), along)
    figure.align_ylabels(places[:, 0])
    fit_labels(figure, [(axes.yaxis, axes) for axes in places[:, 0]] + [(places[-1, 0].xaxis, places[-1, 0])])
    return figure


def fit_labels(figure, labels):
    """Break the labels of axes, given with these, `(axis, panel)`, that are longer than their panels into lines of like lengths."""
    for _ in range(MOST_LINES):
        figure.canvas.draw()
        long = False
        for axis, panel in labels:
            upright = axis.axis_name == "y"
            room, length = (box.height if upright else box.width for box in (panel.get_window_extent(), axis.label.get_window_extent()))
            lines = axis.label.get_text().split("\n")
            if length > room and len(lines) < MOST_LINES:
                words = " ".join(lines)
                axis.label.set_text("\n".join(textwrap.wrap(words, max(8, len(words) // (len(lines) + 1) + 2), break_long_words=False)))
                long = True
        if not long:
            return


class Curve:
    """What a panel of a history shows: a column, its opposite `-A`, a ratio `A/B` or a difference `A-B` of two columns, and opposites of the first columns of these. A name that
    is a column is that column."""

    def __init__(self, text, known):
        self.text, self.sign, self.between, self.other = text, 1.0, "", None
        if text not in known and text.startswith("-"):
            self.sign, text = -1.0, text[1:]
        self.first = text
        if text not in known:
            # names of boundaries may have these signs
            places = [sign.span() for sign in re.finditer("[/-]", text[:-1]) if sign.start() > 0]
            places.sort(key=lambda place: (not (text[:place[0]] in known and text[place[1]:] in known), text[place[0]] == "-"))
            if places:
                self.first, self.between, self.other = text[:places[0][0]], text[places[0][0]], text[places[0][1]:]
        self.names = [name for name in (self.first, self.other) if name is not None]

    def values(self, history):
        """NaN where a ratio has none."""
        values = self.sign * numpy.asarray(history[self.first], float) if self.sign < 0.0 else history[self.first]
        if self.other is None:
            return values
        other = numpy.asarray(history[self.other], float)
        return values - other if self.between == "-" else numpy.divide(values, other, out=numpy.full(len(other), numpy.nan), where=other != 0.0)

    def label(self, dimensions):
        sign = "−" if self.sign < 0.0 else ""
        if self.other is None:
            return sign + label_of_all(self.first, dimensions)
        (first, unit), (last, other) = (label_of_all(name, dimensions).removesuffix("]").split(" [") if " [" in label_of_all(name, dimensions)
                                        else (label_of_all(name, dimensions), "") for name in self.names)
        words = f"{sign}{first} {'−' if self.between == '-' else '/'}{chr(10) if len(first + last) > 20 else ' '}{last}"
        if self.between == "-":
            if unit and other and unit != other:
                raise PictureError(f"{plain(self.text)}: a difference of [{unit}] and [{other}]; expected columns of one unit")
            return words + (f" [{unit or other}]" if unit or other else "")
        return words + ("" if unit == other else f" [{unit or 1}{f'/({other})' if other else ''}]")


def rows_between(run_and_table, history, since, until):
    """The rows of a table whose times are after `since` and up to `until`, of which None is no limit."""
    if since is None and until is None:
        return history
    low, high = -numpy.inf if since is None else since, numpy.inf if until is None else until
    inside = history.between(low, high) if isinstance(history, History) else history.rows((history["time"] > low) & (history["time"] <= high))
    if len(inside) == 0:
        window = f"after {since:g} s" if until is None else f"up to {until:g} s" if since is None else f"after {since:g} s and up to {until:g} s"
        raise PictureError(f"{run_and_table[0].directory / run_and_table[1]}: no row {window}; expected some of its times, {history['time'][0]:.6g} to {history['time'][-1]:.6g} s")
    return inside


def draw_history(runs, columns, against="time", mean=1, table="history.csv", window=(None, None)):
    """A figure with a panel for each column of a table of a run, history.csv unless told, against time or another column, a line a run; with `mean` of means of so
    many steps of history.csv, of rows of other tables. Columns, which may be the expressions of Curve, are all that the first run has numbers in unless told. `window` is that of `rows_between`."""
    histories = [run.history() if table == "history.csv" else read_measured(run, table) for run in runs]
    columns = columns or [name for name, values in histories[0].items() if name not in ("step", against) and numpy.isfinite(values).any()]
    for run, history in zip(runs, histories):
        if len(history) == 0:
            raise PictureError(f"{run.directory / table}: no row; expected one at least")
        for name in [name for column in [*columns, against] for name in Curve(column, history).names]:
            if name in FORMER and FORMER[name] in history:
                raise PictureError(f"{run.directory / table}: {former_name(name)}")
            if name not in history:
                raise PictureError(f"{run.directory / table}: no column {name}; expected one of {', '.join(history)}")
    histories = [rows_between((run, table), history, *window) for run, history in zip(runs, histories)]
    if mean > 1:
        histories = [history.means(mean) for history in histories]
    names = names_of(runs) if len(runs) > 1 else [None]
    dimensions = [run.dimension for run in runs]
    curves = [Curve(column, histories[0]) for column in columns]
    along = Curve(against, histories[0])
    panels = [Panel(curve.label(dimensions), [(along.values(history), curve.values(history), name if k == 0 else None) for name, history in zip(names, histories)],
                    counts=curve.text == "iterations", places=curve.other is None and bool(PLACES.match(curve.first)), zeros=curve.other is None and bool(DECAYS.match(curve.first)))
              for k, curve in enumerate(curves)]
    return draw_panels(panels, along=along.label(dimensions))


def velocity_scale(run, step):
    """U of a step, from history.csv; 0 where it has none."""
    history = run.history()
    if "velocity_scale" not in history or step not in history.step:
        return 0.0
    return float(history.velocity_scale[history.step == step][0])


def draw_convergence(runs, step):
    """A figure of residual, jump and velocity error over its scale against iterations, a line a run: of one step, that of most
    iterations unless told."""
    figure, axes = plt.subplots(figsize=(6.2, 4.0))
    for k, (run, label) in enumerate(zip(runs, names_of(runs))):
        trace = run.trace()
        held = numpy.unique(trace.step).astype(int) if len(trace) > 0 else []
        if len(held) == 0 or (step is not None and step not in held):
            raise PictureError(f"{run.directory}/trace.csv: no step {step}; expected one of "
                               f"{', '.join(map(str, held)) or 'none, it has no row'}")
        drawn = trace.step[numpy.argmax(trace.iteration)] if step is None else step
        chosen = trace.step == drawn
        begin = "" if len(runs) == 1 else f"{label}, step {drawn:.0f}, "
        curves = {name: trace[name][chosen] for name in ("error", "residual", "jump") if name in trace}
        scale = velocity_scale(run, drawn)
        if "velocity_error" in trace and scale > 0.0:
            # before some iterations the error is not known, and a huge number stands for it
            ratio = trace.velocity_error[chosen] / scale
            curves["velocity error / U"] = numpy.where(ratio < 1e6, ratio, numpy.nan)
        styles = {"error": "-", "residual": "-" if "error" not in trace else "--", "jump": ":", "velocity error / U": "-."}
        for name, values in curves.items():
            if (values > 0.0).any():
                axes.plot(trace.iteration[chosen], numpy.where(values > 0.0, values, numpy.nan), styles[name],
                          color=LINES[k % len(LINES)], linewidth=1.2, label=begin + name)
        tolerance = run.case_at(drawn).get("solver", [{}])[0].get("tolerance")
        if tolerance is not None:
            axes.axhline(tolerance, color=LINES[k % len(LINES)], linewidth=0.6, label=begin + "tolerance")
    axes.set(xlabel=f"iteration of step {drawn:.0f}" if len(runs) == 1 else "iteration", ylabel="residual, jump, velocity error / U",
             yscale="log")
    grid(axes)
    legend_above(axes, columns=4 if len(runs) == 1 else 2)
    return figure


# ---- profiles

#: components of the columns of a profile
PROFILES = ("solid_fraction", "velocity", "stress", "pressure", "granular_temperature", "contacts_per_grain", "grains")


def region_with_bins(run, name, step):
    """Name, axis and keys of a region with bins: the only one unless told."""
    held = {keys["name"]: keys for keys in run.case.get("region", []) if "bins" in keys and "axis" in keys}
    if name is None and len(held) == 1:
        name = next(iter(held))
    if name not in held:
        raise PictureError(f"{run.path}: {f'no region {name} with bins' if name else 'no single region has bins'}; expected one of "
                           f"{', '.join(held) or 'none, the case has none'}")
    run.region(name, step)
    return name, "xyz".index(held[name]["axis"])


#: columns that a bin has only with grains inside, and the one that tells whether it has
OF_GRAINS = {"velocity": "solid_fraction", "granular_temperature": "solid_fraction", "contacts_per_grain": "grains"}


def parts_of(dimension):
    """Components that are columns of their own: {name: (column, indices)}."""
    axes = range(dimension)
    return {**{f"velocity_{'xyz'[a]}": ("velocity", (a,)) for a in axes},
            **{f"stress_{'xyz'[a]}{'xyz'[b]}": ("stress", (a, b)) for a in axes for b in axes}}


def components(rows, column, dimension, axis):
    """Curves of a column over the bins: {name: values (bins)}, nan where a bin has no grains whose mean it would be. Of the stress these are the
    normal components and those that shear layers across the axis of the bins."""
    column, chosen = parts_of(dimension).get(column, (column, None))
    values = rows[column]
    if column in OF_GRAINS:
        there = rows[OF_GRAINS[column]] > 0.0
        values = numpy.where(there[:, None] if values.ndim == 2 else there, values, numpy.nan)
    if values.ndim == 1:
        return {None: values}
    if chosen:
        return {None: values[(slice(None), *chosen)]}
    shown = [(a,) for a in range(dimension)]
    if values.ndim == 3:
        shown = [(a, a) for a in range(dimension)] + [(min(a, axis), max(a, axis)) for a in range(dimension) if a != axis]
    return {"".join("xyz"[a] for a in part): values[(slice(None), *part)] for part in shown}


def draw_profile(run, name, steps, columns, mean):
    """A figure of a panel a column: means over the bins of a region against the position, of each step or, with `mean`, over them. Steps are
    as in `run.steps_in`, by default the last one or, with `mean`, all written ones. A position along the height is drawn upwards."""
    known = [*PROFILES, *parts_of(run.dimension)]
    for column in columns:
        if column not in known:
            raise PictureError(f"no column {column} of a profile; expected one of {', '.join(known)}")
    steps = run.steps_in("all" if mean and not steps else steps or [None])
    name, axis = region_with_bins(run, name, steps[-1])
    tables = [run.region_mean(name, steps)] if mean else [run.region(name, step) for step in steps]
    figure, places, bar = draw_columns(tables, columns, (run.dimension, axis), [run.time(step) for step in steps])
    what = f"region {name}, step {steps[0]}" + (f" to {steps[-1]}: {'mean of ' if mean else ''}{len(steps)} states" if len(steps) > 1 else
                                               f", t = {run.time(steps[0]):.4g} s")
    if "samples" in tables[-1]:
        what += f", {'each ' if len(steps) > 1 else ''}a mean of {tables[-1].samples[0]:.0f} steps"
    figure.suptitle(what, fontsize=9, x=0.01, ha="left")
    if len(tables) > 1:
        figure.colorbar(bar, ax=list(places), label="time [s]", aspect=35)
    return figure


def draw_columns(tables, columns, dimension_and_axis, times):
    """A figure of tables with `centre` (d) of each row: a panel a column against the place along an axis. Several tables are states at these times, whose shades go from light to dark."""
    dimension, axis = dimension_and_axis
    several = any(len(components(tables[0], column, dimension, axis)) > 1 for column in columns)
    bar = ScalarMappable(plt.Normalize(times[0], times[-1]), GREYS if several else TIMES)
    upright = axis == dimension - 1
    figure, places = plt.subplots(*((1, len(columns)) if upright else (len(columns), 1)), squeeze=False, constrained_layout=True,
                                  figsize=(0.9 + min(2.3, 10.0 / len(columns)) * len(columns), 3.9) if upright else (6.2, 0.6 + 1.95 * len(columns)),
                                  sharex=not upright, sharey=upright)
    places = places.ravel()
    if upright:
        figure.get_layout_engine().set(wspace=0.08)
    for axes, column in zip(places, columns):
        draw_column(axes, dimension, tables, column, axis, None if len(tables) == 1 else bar.norm(times))
        grid(axes)
        legend_above(axes, columns=4)
    (places[0].set_ylabel if upright else places[-1].set_xlabel)(f"{'xyz'[axis]} [m]")
    if upright:
        fit_labels(figure, [(axes.xaxis, axes) for axes in places])
    return figure, places, bar


def draw_column(axes, dimension, tables, column, axis, times):
    """Curves of a column: a colour and a dash a component, with `times` a shade a state, at that part of the time of all."""
    upright = axis == dimension - 1
    rows = [components(table, column, dimension, axis) for table in tables]
    centres = [table.centre[:, axis] for table in tables]
    for k, (centre, row) in enumerate(zip(centres, rows)):
        for c, (key, values) in enumerate(row.items()):
            colour = LINES[c % len(LINES)] if times is None else times_of(c)(times[k])
            x, y = (values, centre) if upright else (centre, values)
            axes.plot(x, y, linestyle=PARTS[c % len(PARTS)], color=colour, linewidth=1.2, marker="o", markersize=2.5, label=key if k == len(rows) - 1 else None)
    shown = numpy.concatenate([values for row in rows for values in row.values()])
    fit_axis(axes.xaxis if upright else axes.yaxis, shown, label_of(column, dimension), logarithms=False)
    if upright:
        # narrow panels side by side: numbers at their ends must not touch
        axes.xaxis.set_major_locator(MaxNLocator(nbins=4 if axes.figure.get_figwidth() > 2.2 * len(axes.figure.axes) else 3))
