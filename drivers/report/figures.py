"""Figures of a report as pictures within the page: curves of history.csv, the state at the start and at the end, profiles."""
import base64
import html
import io
import re
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy
from curve_pictures import Panel, draw_panels, draw_profile, label_of
from packing_picture import draw_packing, shared_frame
from picture_style import PictureError
from verdict import error_ratio, goals_of, number

import gravier

#: of a curve: more are drawn as the least and largest value of pieces
MOST_POINTS = 3000
#: in a panel: more would not be told apart
MOST_CURVES = 10


def picture(figure, words, dpi=120):
    """An element <img> with the picture in it; `words` say what it shows."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=dpi, bbox_inches="tight", metadata={"Software": None})
    plt.close(figure)
    data = base64.b64encode(file.getvalue()).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" alt="{html.escape(words)}">'


def thinned(x, y):
    """A curve with few enough points, which keeps its peaks."""
    if len(x) <= MOST_POINTS:
        return x, y
    pieces = numpy.array_split(numpy.arange(len(x)), MOST_POINTS // 2)
    shown = numpy.where(numpy.isfinite(y), y, 0.0)
    chosen = sorted({piece[k] for piece in pieces for k in (numpy.argmin(shown[piece]), numpy.argmax(shown[piece]))})
    return x[chosen], y[chosen]


def panel(history, label, columns, goals=(), counts=False, places=False, zeros=False):
    """A panel of columns, (name of the curve or None, values) each."""
    return Panel(label, [(*thinned(history.time, values), name) for name, values in columns[:MOST_CURVES]], goals, counts, places, zeros)


# ---- curves

def accuracy_panels(history, solvers):
    """Velocity error, residual, iterations and overlaps, with what was asked for from the first steps of `solvers` on."""
    panels, (_, solver) = [], solvers[-1]
    if "velocity_error" in history and numpy.isfinite(error_ratio(history)).any():
        goals = [(goal, f"goal from step {first} on" if first > 0 else "goal") for first, goal in goals_of(solvers) if numpy.isfinite(goal)]
        panels.append(panel(history, "velocity error / U", [(None, error_ratio(history))], goals, zeros=True))
    if "residual" in history:
        tolerance = number(solver, "tolerance", None)
        panels.append(panel(history, "residual", [(None, history.residual)], [(float(tolerance), "tolerance")] if tolerance else [], zeros=True))
    if "iterations" in history:
        panels.append(panel(history, "iterations", [(None, history.iterations)], counts=True))
    if "max_overlap" in history:
        panels.append(panel(history, "largest overlap [m]", [(None, history.max_overlap)], zeros=True))
    return panels


def motion_panels(history):
    """Energies, contacts and grains."""
    terms = [name for name in ("potential_energy", "dissipated_normal", "dissipated_friction", "elastic_energy", "boundary_work") if name in history]
    panels = []
    if "kinetic_energy" in history:
        panels.append(panel(history, "kinetic energy [J]", [(None, history.kinetic_energy)], zeros=True))
    if terms:
        panels.append(panel(history, "energies [J]", [(name.replace("_", " "), history[name]) for name in terms], zeros=True))
    if "contacts" in history:
        panels.append(panel(history, "contacts", [(None, history.contacts)], counts=True))
    if "grains" in history and numpy.ptp(history.grains) > 0:
        panels.append(panel(history, "grains", [(None, history.grains)], counts=True))
    return panels


def stress_panels(history, dimension):
    """Stresses and solid fractions, of the scene and of regions, and the deformation of a cell that moves. Of the shear stresses those above the diagonal
    stand for all."""
    unit = "N/m" if dimension == 2 else "Pa"
    stress = [(name.removeprefix("stress_"), history[name]) for name in history if re.fullmatch(r"stress_([xyz])\1", name)]
    stress += [(name.removeprefix("stress_"), history[name]) for name in history if re.fullmatch(r"stress_(xy|xz|yz)", name)]
    cell = [(name.removeprefix("cell_").replace("_", " "), history[name]) for name in history if re.match(r"cell_(strain|shear)_", name)]
    cell = [(name, values) for name, values in cell if numpy.abs(values).max(initial=0.0) > 0.0]
    pressure = [(name.removesuffix("_pressure"), history[name]) for name in history if name.endswith("_pressure")]
    if "pressure" in history:
        stress.append(("pressure", history.pressure))
    fraction = [(name.removesuffix("solid_fraction").rstrip("_") or "scene", history[name]) for name in history if name.endswith("solid_fraction")]
    named = ((f"stress [{unit}]", stress), (f"pressure of regions [{unit}]", pressure), ("solid fraction", fraction),
             ("deformation of the cell", cell))
    panels = [panel(history, label, columns) for label, columns in named if columns]
    return panels + [panel(history, label_of(name, dimension), [(None, history[name])]) for name in ("coordination",) if name in history]


def boundary_panels(history):
    """Forces on boundaries and where these are, a panel a component that is not always zero."""
    panels = []
    for kind, unit in (("force", "N"), ("position", "m")):
        for axis in "xyz":
            columns = [(name.split(":", 1)[1], history[name]) for name in history if name.startswith(f"{kind}_{axis}:")]
            columns = [(name, values) for name, values in columns if (numpy.ptp(values) if kind == "position" else numpy.abs(values).max()) > 0.0]
            if columns:
                panels.append(panel(history, f"{kind} along {axis} [{unit}]", columns, places=kind == "position"))
    return panels


def curve_groups(history, solvers, dimension):
    """Titles and pictures of all curves that the run has."""
    groups = (("Accuracy and iterations of each step", accuracy_panels(history, solvers)), ("Energies and contacts", motion_panels(history)),
              ("Stress and solid fraction", stress_panels(history, dimension)), ("Boundaries", boundary_panels(history)))
    return [(title, picture(draw_panels(panels, width=7.2, height=1.5), f"{title}, against time: " + ", ".join(one.label for one in panels)))
            for title, panels in groups if panels]


# ---- states

def states(run, colour="speed"):
    """Captions and pictures of the first and the last written state, in one frame; or one line that says why there are none."""
    steps = [step for step in run.steps if len(run.bodies(step)) > 0]
    if not steps:
        return [], "No written state has a body."
    options = SimpleNamespace(view=None, size=5.0, colour=colour, chains=run.dimension == 2, regions=False, box=None)
    chosen = sorted({steps[0], steps[-1]})
    try:
        frame = shared_frame(run, chosen, options)
        found = []
        for step in chosen:
            caption = "The start" if step == steps[0] else "The last written state"
            image = picture(draw_packing(run, step, options, frame), f"{caption}: bodies by {colour}")
            found.append((f"{caption}, step {step} at {run.time(step):.4g} s", image))
        return found, ""
    except (gravier.ResultsError, PictureError) as reason:
        return [], f"No picture: {reason}"


def profiles(run):
    """Captions and pictures of the regions with bins in the last written state."""
    found = []
    for keys in run.case.get("region", []):
        if "bins" in keys and "axis" in keys and keys.get("name") in run.regions():
            figure = draw_profile(run, keys["name"], None, ["solid_fraction", "velocity", "stress"], False)
            found.append((f"Means over the bins of region {keys['name']}, last written state", picture(figure, f"Profiles of region {keys['name']}")))
    return found
