#!/usr/bin/env python3
"""Iterations to a velocity error beside iterations to a residual: momentum, heights, subdomains, methods, warm starts, Newton's method,
many grains.

    ./gravier study convergence                 all: minutes on two cores
    ./gravier study convergence --quick         momentum, heights and newton, with smaller scenes
    ./gravier study convergence --parts LIST    some of momentum,heights,subdomains,methods,warm,newton,large

Packings of disks and spheres settle in a box. One step of each is solved from zero impulses by sweeps without a layered start, looked
at after every iteration (plain sweeps after every tenth), and by the program as it is. A tolerance of the residual is met with the
first iteration at or below it, a velocity error with the first iteration from which on the estimate stays at or below it, as far as
the run goes. The estimate is that of doc/theory.md, section 24, over the velocity scale. The heights have the true error too, that to
the solution of the same step. The solves of warm starts, of Newton's method and of 16 000 grains end by their
own criterion each. `large` takes an hour and is made only where --parts names it.

leaves in out/convergence or the directory of --out a table a part, convergence_PART.csv, and prints them. The closing table has
each measured quantity beside what is accepted. Exit status: 0 all are held; 1 one is missed."""
import argparse
import csv
import re
from pathlib import Path

from bounds_of_convergence import BOUNDS
from oracle_table import Bounds
from study_error import measure
from study_support import SOURCE, OneLineParser, claimed, gravier, read_history, run, run_study, sized, write_measured

PARTS = ("momentum", "heights", "subdomains", "methods", "warm", "newton")
LONG_PARTS = ("large",)
RESIDUALS = (1e-3, 1e-4)
ERRORS = (0.1, 0.03)
#: name: dimension, grains along each axis of the lattice that falls, steps of settling
PACKINGS = {"1000 disks": (2, [32, 31], 700), "1000 spheres": (3, [10, 10, 10], 650), "10^4 spheres": (3, [21, 21, 23], 700)}
HEIGHTS = (10, 20, 40, 80)
#: lattice cells across the packings of several heights
ACROSS = 10
#: grains along each axis of packings that have fallen for 350 steps at friction 0.3, and frictions of the step that is solved
TIGHT_PACKINGS = {"343 spheres": ([7, 7, 7], (0.3, 0.5, 0.8))}
TIGHT_GOALS = [{"accuracy": accuracy} for accuracy in (0.1, 0.03, 0.01, 0.001)]
#: grains along each axis of the lattice of data/large/settle.nml, made narrower
LARGE = [14, 14, 80]
#: parts of the quick form, and its scenes in the place of those above
QUICK_PARTS = ("momentum", "heights", "newton")
QUICK = {"PACKINGS": {"1000 disks": PACKINGS["1000 disks"]}, "HEIGHTS": (10, 20, 40), "ACROSS": 5,
         "TIGHT_PACKINGS": {"343 spheres": ([7, 7, 7], (0.3, 0.5))}, "TIGHT_GOALS": TIGHT_GOALS[:2]}
#: iterations with momentum, of plain ones three times as many; residual at which a run ends before
MOST, TIGHT = 1500, 1e-6


def settle(out, dimension, count, steps, **scene):
    """The bodies file of a lattice that has fallen into a box, made once."""
    place = out / "settled" / ("x".join(map(str, count)) + ("_smooth" if scene else ""))
    if not (place / "final_bodies.h5").exists():
        run(place, {"scene": {"dimension": dimension, "bodies": "lattice", "lattice_count": count, "radius_min": 0.008,
                              "radius_max": 0.012, "friction": 0.3, **scene},
                    "time": {"step": 1e-3, "steps": steps},
                    "solver": {"max_iterations": 500},
                    "output": {"directory": ".", "every": 0, "contacts": False, "final_bodies": True}})
    return (place / "final_bodies.h5").resolve()


def first_kept(trace, bound):
    """The first iteration looked at from which on the estimate stays at or below the bound; '-' where there is none."""
    # an estimate that is no number is above any bound
    late = [k for k, (_, _, error) in enumerate(trace) if not error <= bound]
    after = late[-1] + 1 if late else 0
    return trace[after][0] if after < len(trace) else "-"


def one_step(place, groups, momentum, layered, method="nlgs", subdomains=1, most=MOST, tight=TIGHT, looks=True):
    """Solve one step from zero impulses: iterations to each residual and error, or where the program ends by itself."""
    solver = {"method": method, "warm_start": False, "layered_start": layered, "max_iterations": most}
    if momentum is not None:
        solver["acceleration"] = "momentum" if momentum else "none"
    if looks:
        # a tolerance that is not met until the trace has what is asked for; the trace has the estimate with any criterion
        solver.update({"criterion": "residual", "tolerance": tight, "check_every": 1 if momentum is not False else 10})
    groups = {**groups, "time": {"step": groups.get("time", {}).get("step", 1e-3), "steps": 1}, "solver": solver,
              "output": {"directory": "results", "every": 0, "contacts": False, "trace": looks}}
    if method != "nlgs":
        groups["decomposition"] = {"subdomains": subdomains, "partition": "metis" if subdomains > 1 else "grid"}
    run(place, groups)
    history = read_history(place / "results")
    scale = float(history["velocity_scale"][0])
    if not looks:
        layers = re.search(r"the passes took as much work as (\d+) sweeps", (place / "results/run.log").read_text(encoding="utf-8"))
        return {"iterations": int(history["iterations"][0]), "pass": int(layers.group(1)) if layers else 0,
                "error": float(history["velocity_error"][0]) / scale,
                "residual": float(history["residual"][0]), "converged": int(history["converged"][0])}
    with open(place / "results/trace.csv", encoding="ascii") as file:
        trace = [(int(row["iteration"]), float(row["residual"]), float(row["velocity_error"]) / scale) for row in csv.DictReader(file)]
    row = {}
    for bound in RESIDUALS:
        at = next(((k, error) for k, residual, error in trace if residual <= bound), ("-", "-"))
        row[f"to residual {bound:g}"], row[f"error at {bound:g}"] = at
    for bound in ERRORS:
        row[f"to error {bound:g}"] = first_kept(trace, bound)
    return row


def both(out, name, groups, **more):
    """Rows of a scene: plain sweeps, momentum, and the program as it is."""
    place = out / "runs" / name.replace(" ", "_").replace("^", "")
    rows = []
    for momentum in (False, True):
        rows.append({"by": "momentum" if momentum else "plain",
                     **one_step(place / f"{momentum}", groups, momentum, False, most=MOST if momentum else 3 * MOST, **more)})
    more.pop("tight", None)
    ended = one_step(place / "program", groups, None, True, looks=False, most=10000, **more)
    rows[-1].update({f"program: {key}": value for key, value in ended.items()})
    for row in rows[:-1]:
        row.update({f"program: {key}": "" for key in ended})
    return rows


def on_file(dimension, bodies, friction=0.3, **scene):
    return {"scene": {"dimension": dimension, "bodies": "file", "bodies_file": str(bodies), "friction": friction, **scene}}


def column(count):
    return {"scene": {"bodies": "column", "column_count": count}, "time": {"step": 1e-3}}


def study_momentum(out):
    rows = []
    for count in (20, 60):
        rows += [{"scene": f"column of {count}", "friction": "-", **row} for row in both(out, f"column {count}", column(count), tight=1e-9)]
        show(rows[-2:])
    for name, (dimension, count, steps) in PACKINGS.items():
        bodies = settle(out, dimension, count, steps)
        for friction in (0.0, 0.3):
            rows += [{"scene": name, "friction": friction, **row}
                     for row in both(out, f"{name} {friction}", on_file(dimension, bodies, friction))]
            show(rows[-2:])
    return rows


def study_heights(out):
    """Spheres in boxes of some lattice cells across, whose walls have no friction."""
    rows = []
    for high in HEIGHTS:
        bodies = settle(out, 3, [ACROSS, ACROSS, high], 600 + 5 * high, wall_friction=0.0)
        groups = on_file(3, bodies, wall_friction=0.0)
        rows += [{"high": high, **row} for row in both(out, f"high {high}", groups)]
        rows[-1].update(by_true_error(out / "runs" / f"high_{high}" / "true", groups))
        show(rows[-2:])
    return rows


def by_true_error(place, groups):
    """Sweeps to the true velocity error by momentum alone and by the program, and the true error where the program ends."""
    place.mkdir(parents=True, exist_ok=True)
    (place / "case.nml").write_text(gravier.namelist({**groups, "time": {"step": 1e-3, "steps": 1}}), encoding="utf-8")
    looks = ",".join(str(k) for k in sorted({round(5 * 1.1**k) for k in range(54)}))
    rows = measure(str(place), place, ["--iterations", looks, "--situations", "cold,program", "--limit", "2500", "--sweeps", "4000"])
    found = {}
    for name, ending in (("momentum", "zero impulses"), ("program", "by the program"), ("end", "ends it")):
        kept = [row for row in rows if row["situation"].endswith(ending)]
        errors = [float(row["true_error"]) / float(row["velocity_scale"]) for row in kept]
        if name == "end":
            found["true error at the end"] = errors[-1]
            continue
        for bound in ERRORS:
            late = [k for k, error in enumerate(errors) if error > bound]
            after = late[-1] + 1 if late else 0
            found[f"{name}: sweeps to true error {bound:g}"] = round(float(kept[after]["sweeps"])) if after < len(kept) else "-"
    return found


def study_subdomains(out):
    rows = []
    for name in ("1000 disks", "10^4 spheres"):
        dimension, count, steps = PACKINGS[name]
        bodies = settle(out, dimension, count, steps)
        for subdomains in (1, 8, 32):
            rows += [{"scene": name, "subdomains": subdomains, **row}
                     for row in both(out, f"{name} in {subdomains}", on_file(dimension, bodies), method="nscdd", subdomains=subdomains)]
            show(rows[-2:])
    return rows


def study_methods(out):
    rows = []
    for name in ("1000 disks", "1000 spheres"):
        dimension, count, steps = PACKINGS[name]
        groups = on_file(dimension, settle(out, dimension, count, steps))
        for method, momenta in (("nlgs", (False, True)), ("nscdd", (False, True)), ("schwarz", (False, True)), ("schwarz_ec", (False,)),
                                ("nscdd_ep", (False, True)), ("newton", (True,))):
            for momentum in momenta:
                place = out / "runs" / f"{name} {method} {momentum}".replace(" ", "_")
                given = momentum if method != "newton" else None
                subdomains = 1 if method == "nlgs" else 8
                found = one_step(place, groups, given, False, method, subdomains, most=200 if method == "nscdd_ep" else MOST)
                rows.append({"scene": name, "method": method, "by": "momentum" if momentum else "plain", **found})
                show(rows[-1:])
    return rows


def study_warm(out):
    """Runs of many steps, ended by a residual and by the velocity error."""
    rows = []
    for name, steps in (("shear", 100), ("triaxial", 30)):
        for momentum in (False, True):
            for criterion in ({"criterion": "residual", "tolerance": 1e-3}, {"criterion": "residual", "tolerance": 1e-4},
                              {"accuracy": 0.1}, {"accuracy": 0.03}):
                place = out / "runs" / f"{name}_{momentum}_{'_'.join(map(str, criterion.values()))}"
                groups, boundaries = scene(name)
                groups["time"]["steps"] = steps
                groups["solver"] = {**groups.get("solver", {}), "acceleration": "momentum" if momentum else "none"}
                groups["solver"].pop("tolerance", None)
                groups["solver"].update(criterion)
                groups["output"] = {"directory": "results", "every": 0, "contacts": False}
                run(place, groups, boundaries)
                history = read_history(place / "results")
                errors = history["velocity_error"] / history["velocity_scale"]
                ends_by = " ".join(map(str, criterion.values())) if "criterion" in criterion else f"error {criterion['accuracy']}"
                rows.append({"scene": name, "steps": steps, "by": "momentum" if momentum else "plain", "ends by": ends_by,
                             "iterations": int(history["iterations"].sum()), "mean error": float(errors.mean()),
                             "largest error": float(errors.max())})
                show(rows[-1:])
    return rows


def ends(place, groups, goal, **solver):
    """A row for each step of a run that ends its solves by a goal."""
    groups = {**groups, "solver": {"max_iterations": 20000, **solver, **goal},
              "output": {"directory": "results", "every": 0, "contacts": False}}
    run(place, groups)
    history = read_history(place / "results")
    log = (place / "results/run.log").read_text(encoding="utf-8")
    layers = re.search(r"the passes took as much work as (\d+) sweeps?", log)
    factors = re.search(r"(\d+) factorisations?\n", log)
    by = f"residual {goal['tolerance']:g}" if "criterion" in goal else f"error {goal['accuracy']:g}"
    return [{"ends by": by, "step": k + 1, "contacts": int(history["contacts"][k]), "iterations": int(history["iterations"][k]),
             "sweeps of passes, all steps": int(layers[1]) if layers else 0, "factorisations, all steps": int(factors[1]) if factors else 0,
             "residual": float(history["residual"][k]), "error": float(history["velocity_error"][k] / history["velocity_scale"][k]),
             "jump": float(history["jump"][k]), "overlap": float(history["max_overlap"][k]), "converged": int(history["converged"][k]),
             "solve seconds": float(history["solve_seconds"][k])} for k in range(len(history["step"]))]


def study_newton(out):
    """Newton's method beside accelerated sweeps, to errors and to a residual."""
    rows = []
    for name, (count, frictions) in TIGHT_PACKINGS.items():
        bodies = settle(out, 3, count, 350)
        for friction in frictions:
            for goal in TIGHT_GOALS:
                for method in ("nlgs", "newton"):
                    place = out / "runs" / "_".join(map(str, ("tight", name, friction, method, *goal.values()))).replace(" ", "_")
                    found = ends(place, {**on_file(3, bodies, friction), "time": {"step": 1e-3, "steps": 1}}, goal, method=method,
                                 warm_start=False, layered_start=False)
                    rows += [{"scene": name, "friction": friction, "method": method, **row} for row in found]
                    show(rows[-1:])
    return rows


def settle_large(out):
    """The bodies file of data/large/settle.nml with fewer grains along x and y, made once."""
    place = out / "settled/large"
    if not (place / "final_bodies.h5").exists():
        groups = {name: keys[0] for name, keys in gravier.parse_namelist(
            (SOURCE / "data/large/settle.nml").read_text(encoding="utf-8")).items()}
        groups["scene"]["lattice_count"] = LARGE
        groups["output"] = {"directory": ".", "every": 0, "contacts": False, "final_bodies": True}
        run(place, groups)
    return (place / "final_bodies.h5").resolve()


def study_large(out, bodies=None):
    """Four steps of many grains by each criterion."""
    bodies = bodies or settle_large(out)
    rows = []
    for momentum, layered in ((False, False), (True, False), (True, True)):
        for goal in ({"criterion": "residual", "tolerance": 1e-3}, {"accuracy": 0.1}):
            if layered and "criterion" in goal:
                continue
            by = "plain" if not momentum else "the program" if layered else "momentum"
            found = ends(out / "runs" / f"large_{by}_{len(goal)}".replace(" ", "_"), many(bodies, 16, 4), goal, method="nscdd",
                         acceleration="momentum" if momentum else "none", layered_start=layered)
            rows += [{"by": by, **row} for row in found]
            show(rows[-len(found):])
    return rows


def many(bodies, subdomains, steps):
    """Groups of some steps of a large packing."""
    return {**on_file(3, bodies, alert_distance=0.001), "time": {"step": 1e-3, "steps": steps},
            "decomposition": {"partition": "metis", "subdomains": subdomains}}


def scene(name):
    """Groups and boundaries of a case of data/scenes."""
    groups = gravier.parse_namelist((SOURCE / f"data/scenes/{name}.nml").read_text(encoding="utf-8"))
    boundaries = groups.pop("boundary", [])
    groups = {name: keys[0] for name, keys in groups.items()}
    groups["scene"]["bodies_file"] = str(SOURCE / groups["scene"]["bodies_file"])
    return groups, boundaries


def show(rows):
    for row in rows:
        told = (f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}" for key, value in row.items())
        print("  " + " | ".join(told), flush=True)


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/convergence"))
    parser.add_argument("--quick", action="store_true", help="smaller scenes")
    parser.add_argument("--parts", metavar="LIST", help=f"some of {','.join(PARTS + LONG_PARTS)}")
    parser.add_argument("--bodies", metavar="FILE", type=Path, help="the packing of large, made before")
    options = sized(parser.parse_args(), {"parts": ",".join(PARTS)}, {"parts": ",".join(QUICK_PARTS)})
    if options.quick:
        globals().update(QUICK)
    table = Bounds()
    if not set(options.parts.split(",")) <= set(PARTS + LONG_PARTS):
        parser.error(f"--parts {options.parts}: expected some of {','.join(PARTS + LONG_PARTS)}")
    out = claimed(options.out).resolve()
    for part in options.parts.split(","):
        more = {"bodies": options.bodies.resolve()} if part in LONG_PARTS and options.bodies else {}
        rows = globals()[f"study_{part}"](out, **more)
        names = list(dict.fromkeys(key for row in rows for key in row))
        write_measured(out / f"convergence_{part}.csv", {key: [row.get(key, "") for row in rows] for key in names})
        BOUNDS[part](table, rows)
    return table.close()


if __name__ == "__main__":
    run_study(main)
