"""Part of study_masonry.py: stones that were poured, and then lie for many steps."""
import contextlib
import io
import tempfile
from pathlib import Path

import numpy as np
from masonry_scene import GRAVITY
from study_support import BINARIES, read_history, run, states

#: random hulls of twelve corners
SHAPES = """shape flat
random_hull 1 12 1.2 1 0.8
shape round
random_hull 2 12 1 1 1
shape long
random_hull 3 12 1.4 1 0.7
"""
RADIUS, BOX, DENSITY = 0.01, 0.1, 2500.0


def pile(table, quick):
    """150 stones that have settled, and the last half of their steps: what still moves, and the iterations that they take, with the settings
    that a user gets, and with a finer accuracy. In the first two seconds some stones still roll to a better place."""
    steps = 5000 if quick else 10000
    with tempfile.TemporaryDirectory(prefix="gravier-masonry-") as name:
        folder = Path(name)
        (folder / "stones.shapes").write_text(SHAPES, encoding="ascii")
        scene = {"dimension": 3, "shapes": "stones.shapes", "friction": 0.5, "density": DENSITY}
        # the study prints its rows alone
        with contextlib.redirect_stdout(io.StringIO()):
            run(folder, {"scene": {**scene, "bodies": "sample"},
                         "sample": {"preparation": "settled", "count": 150, "radii": "uniform", "radius_min": 0.8 * RADIUS,
                                    "radius_max": 1.2 * RADIUS, "grain_shapes": "flat, round, long", "box": [BOX, BOX],
                                    "file": "stones.h5"},
                         "time": {"step": 5e-4, "steps": 0}, "solver": {"max_iterations": 5000}}, program=BINARIES / "gravier_sample")
        for settings, solver, place in (("defaults", {}, "default"), ("accuracy 0.01", {"accuracy": 0.01}, "fine")):
            with contextlib.redirect_stdout(io.StringIO()):
                run(folder, {"scene": {**scene, "bodies": "file", "bodies_file": "stones.h5"}, "time": {"step": 1e-3, "steps": steps},
                             "solver": {"max_iterations": 5000, **solver},
                             "output": {"directory": place, "every": steps // 10, "contacts": False}})
            lies(table, folder / place, f"pile of 150 hulls, {settings}, {steps} steps", steps)


def lies(table, folder, words, steps):
    """The rows of a run."""
    history = read_history(folder)
    bodies = [(time, group["bodies/position"][:], group["bodies/orientation"][:], group["bodies/mass"][:])
              for _, time, group in states(folder / "results.h5")]
    late = history["iterations"][-steps // 5:].mean()
    table.add("rest", f"{words}: iterations a step, first 200 steps", history["iterations"][:200].mean())
    table.add("rest", f"{words}: iterations a step, all steps", history["iterations"].mean())
    table.add("rest", f"{words}: iterations a step at rest", late, "at most 5", max(0.0, late - 5.0), 0.0)
    table.add("rest", f"{words}: solves that missed the accuracy, all steps", int((history["converged"] == 0).sum()), 0, None, 0.0)
    (begin, place, turn, mass), (end, last_place, last_turn, _) = bodies[5], bodies[-1]
    speed = np.linalg.norm(last_place - place, axis=1).max() / (end - begin)
    over = speed / history["velocity_error"][-steps // 2:].max()
    table.add("rest", f"{words}: speed of the fastest stone over the largest estimate of the error, last half", over, "at most 1",
              max(0.0, over - 1.0), 0.0)
    angle = 2.0 * np.arccos(np.clip(np.abs((turn * last_turn).sum(axis=1)), 0.0, 1.0)).max()
    table.add("rest", f"{words}: largest turn in the last half [rad]", angle, 0.0, None, 1.0e-2)
    energy = history["kinetic_energy"][-steps // 5:].max() / (mass.sum() * GRAVITY * RADIUS)
    table.add("rest", f"{words}: kinetic energy at rest over m g radius", energy, 0.0, None, 1.0e-7)
