"""Part of study_error.py: columns and a stack at rest, at the default settings of the program."""
from pathlib import Path

import h5py
import numpy as np
from study_support import BINARIES, gravier, write_measured

#: ground force over the weight less 1; speed over g h
GROUND, SPEED = 0.05, 0.05


def play(groups, directory, steps, program):
    """Run a case for so many steps: exit status, ground force over the weight and largest speed over g h of each step, seconds of
    its solves and iterations."""
    groups = {**groups, "time": {**groups["time"], "steps": steps},
              "output": {"directory": "results", "every": 1, "contacts": False, "boundary_forces": True}}
    status = gravier.run(groups, directory, 1, Path(program).resolve())
    history = gravier.read_table(directory / "results/history.csv")
    h = groups["time"]["step"]
    with h5py.File(directory / "results/results.h5") as file:
        radii = file["steps/0/bodies/radius"][:]
        speeds = np.array([np.sqrt((file[f"steps/{int(step)}/bodies/velocity"][:, :2]**2).sum(1)).max() for step in history["step"]])
    (directory / "results/results.h5").unlink()
    weight = groups["scene"]["density"] * np.pi * (radii**2).sum() * 9.81
    carried = -sum(history[name] for name in history if name.startswith("force_y:"))
    return status, carried / weight, speeds / (9.81 * h), history["solve_seconds"].sum(), history["iterations"].sum()


def study_rest(scenes, out, steps, beside):
    """Rows of the table and the bounds that do not hold; `scenes` are (name, make)."""
    print(f"\nat rest from the first step on, {steps} steps at default settings: the ground carries the weight within {GROUND:g}, and "
          f"nothing moves faster than {SPEED:g} g h,\nor the run says with status 3 that it did not get there\n")
    print(f"{'scene':28}{'status':>7}{'ground / weight, first':>24}{'of all steps':>18}{'fastest, first':>16}{'of all':>8}{'iterations':>12}"
          f"{'solves, s':>11}" + (f"{'older: s':>11}{'ground':>16}{'fastest':>9}" if beside else ""))
    rows, failures = [], []
    for name, make in scenes:
        place = out / ("rest " + name).replace(" ", "_")
        place.mkdir(parents=True, exist_ok=True)
        groups = make(place)
        groups["scene"]["bodies_file"] = str(place / "bodies.h5")
        status, ground, speed, seconds, iterations = play(groups, place, steps, BINARIES / "gravier")
        line = (f"{name:28}{status:7d}{ground[0]:24.4f}{ground.min():9.4f} -{ground.max():7.4f}{speed[0]:16.3f}{speed.max():8.3f}"
                f"{iterations:12.0f}{seconds:11.3f}")
        older = (np.nan,) * 4
        if beside:
            _, old_ground, old_speed, old_seconds, _ = play(groups, place / "older", steps, beside)
            older = (old_seconds, old_ground.min(), old_ground.max(), old_speed.max())
            line += f"{old_seconds:11.3f}{old_ground.min():8.3f} -{old_ground.max():6.3f}{old_speed.max():9.3f}"
        held = status == 3 or (np.all(np.abs(ground - 1.0) <= GROUND) and speed.max() <= SPEED)
        print(line + ("" if held else "  *"), flush=True)
        rows.append((name, steps, status, ground[0], ground.min(), ground.max(), speed[0], speed.max(), iterations, seconds, *older))
        if not held:
            failures.append(f"{name}: the ground carries {ground.min():.3f} to {ground.max():.3f} of the weight, the fastest grain has "
                            f"{speed.max():.3f} g h in {int((speed > SPEED).sum())} of {steps} steps beyond {SPEED:g}, and the status is {status}")
    names = ("scene", "steps", "status", "ground_first", "ground_low", "ground_high", "speed_first", "speed_high", "iterations",
             "solve_seconds", "older_solve_seconds", "older_ground_low", "older_ground_high", "older_speed_high")
    write_measured(out / "error_rest.csv", dict(zip(names, zip(*rows))))
    return failures
