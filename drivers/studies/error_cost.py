"""Part of study_error.py: what a cold start of packings of several heights costs, by the program and by sweeps with momentum alone."""
import h5py
import numpy as np
from study_support import lattice, run, write_hdf5, write_measured

# study_support names the place of the package
from gravier.case import write_case

#: true velocity error [g h] that a solve has to reach
GOAL = 0.1
#: cost of the highest packing over that of the lowest; at HEIGHT, cost over that of momentum alone
GROWTH, GAIN, HEIGHT = 1.5, 0.6, 44
HEIGHTS = (13, 26, HEIGHT, 100)  # diameters

#: iterations at which states are looked at
LOOKS = sorted({int(round(6 * 1.07**k)) for k in range(84)})


def settle(directory, centres, radii, wide, diameter, step, steps):
    """Let spheres come to rest, in solves that need not be exact: centres and radii."""
    directory.mkdir(parents=True, exist_ok=True)
    write_hdf5(directory / "bodies.h5", centres, radii)
    groups = {**case(wide, diameter, step, steps), "solver": {"accuracy": 0.3, "max_iterations": 200}, "output": {"directory": ".", "every": 0, "contacts": False, "final_bodies": True}}
    run(directory, groups, groups.pop("boundary"))
    with h5py.File(directory / "final_bodies.h5") as file:
        return file["bodies/position"][:], file["bodies/radius"][:]


def case(wide, diameter, step, steps=1, bodies="bodies.h5"):
    """A layer without sides, periodic along x and y: the floor bears all."""
    return {"scene": {"dimension": 3, "bodies": "file", "bodies_file": bodies, "density": 2500.0, "friction": 0.5,
                      "alert_distance": 0.1 * diameter, "period": [wide, wide, 0.0]},
            "time": {"step": step, "steps": steps}, "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 0.0, 1.0]}]}


def packings(out, heights, across, diameter, step):
    """Directories of packings so many diameters high, by height: one that has settled, and copies of it on each other that have
    settled again."""
    wide = across * diameter
    rng = np.random.default_rng(11)
    lowest = min(heights)
    centres, radii = lattice([0.0, 0.0, 0.0], [wide, wide, 1.7 * lowest * diameter], 0.4 * diameter, 0.6 * diameter, rng)
    centres, radii = settle(out / "height_loose", centres, radii, wide, diameter, step, 600)
    period = (centres[:, 2] + radii).max()
    found = {}
    for height in heights:
        copies = int(np.ceil(height * diameter / (0.8 * period)))
        piled = np.concatenate([centres + [0.0, 0.0, k * period] for k in range(copies)])
        sizes = np.tile(radii, copies)
        kept = piled[:, 2] <= height * diameter
        settled, sizes = settle(out / f"height_{height}", piled[kept], sizes[kept], wide, diameter, step, 600)
        write_hdf5(out / f"height_{height}/bodies.h5", settled, sizes)
        found[height] = out / f"height_{height}"
    return found


def first_below(rows):
    """The row from which on the true error stays below the goal; None where it does not get there."""
    late = [k for k, row in enumerate(rows) if float(row["true_error"]) > GOAL * float(row["velocity_scale"])]
    after = late[-1] + 1 if late else 0
    return rows[after] if after < len(rows) else None


def study_cost(out, heights, across, diameter, step, measure):
    """The bounds that do not hold; measure(name, directory, options) gives rows of gravier_error."""
    print(f"\nsweeps from zero impulses to a true velocity error of {GOAL:g} g h, layers of spheres, periodic over {across} diameters; a pass "
          "over layers is in them.\nWhere the program ends: its sweeps, its whole time in sweeps, the true error and the estimate then\n")
    print(f"{'height':>8}{'spheres':>9}{'momentum':>10}{'program':>9}{'layered':>9}{'ratio':>7}   |{'ends at':>9}{'all in':>8}{'true':>8}"
          f"{'estimate':>10}{'known to':>10}")
    rows, failures, costs = [], [], {}
    for height, place in packings(out, heights, across, diameter, step).items():
        write_case(case(across * diameter, diameter, step), place)
        found = measure(f"height {height}", place, ["--iterations", ",".join(map(str, LOOKS)), "--situations", "cold,program", "--limit",
                                                   "3000", "--sweeps", "4000"])
        alone = [row for row in found if row["situation"] == "zero impulses"]
        program = [row for row in found if row["situation"] == "zero impulses, by the program"]
        end = next(row for row in found if row["situation"].endswith("ends it"))
        scale = float(end["velocity_scale"])
        by_momentum, by_program = first_below(alone), first_below(program)
        sweep = float(alone[-1]["seconds"]) / float(alone[-1]["sweeps"])
        cost = [float(row["sweeps"]) if row else np.nan for row in (by_momentum, by_program)]
        costs[height] = cost
        all_in = float(end["seconds"]) / sweep
        ratio = cost[1] / cost[0]
        spread = float(end["reference_spread"]) / scale
        print(f"{height:8d}{end['grains']:>9}{cost[0]:10.0f}{cost[1]:9.0f}{float(end['layered_sweeps']):9.0f}{ratio:7.2f}   |"
              f"{float(end['sweeps']):9.0f}{all_in:8.0f}{float(end['true_error']) / scale:8.3f}{float(end['estimate']) / scale:10.3f}"
              f"{spread:10.3f}", flush=True)
        rows.append((height, int(end["grains"]), *cost, float(end["layered_sweeps"]), float(end["sweeps"]), all_in,
                     float(end["true_error"]) / scale, float(end["estimate"]) / scale, spread))
    names = ("height", "grains", "sweeps_momentum", "sweeps_program", "layered_sweeps", "sweeps_at_end", "all_in_sweeps_at_end",
             "true_error_at_end", "estimate_at_end", "reference_spread")
    write_measured(out / "error_cost.csv", dict(zip(names, zip(*rows))))
    growth = costs[max(heights)][1] / costs[min(heights)][1]
    print(f"\ngrowth from {min(heights)} to {max(heights)} diameters: {growth:.2f} by the program, "
          f"{costs[max(heights)][0] / costs[min(heights)][0]:.2f} by momentum alone")
    if not growth <= GROWTH:
        failures.append(f"the cost of a cold start grows {growth:.2f} times from {min(heights)} to {max(heights)} diameters, expected {GROWTH:g}")
    if HEIGHT in costs and not costs[HEIGHT][1] <= GAIN * costs[HEIGHT][0]:
        failures.append(f"at {HEIGHT} diameters the program takes {costs[HEIGHT][1] / costs[HEIGHT][0]:.2f} of the sweeps of momentum alone, "
                        f"expected {GAIN:g}")
    return failures
