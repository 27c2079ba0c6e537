#!/usr/bin/env python3
"""How dense the five Platonic solids pack when they are poured, against experiments: Baker and Kudrolli, Physical Review E 82 (2010) 061304.

    python3 drivers/studies/study_platonic.py [--out DIR] [--quick] [--count N] [--solids NAME...]

Solids of one size rain at a constant speed into a box that is periodic on its sides, with a floor, and come to rest under gravity. The solid
fraction is measured in the middle of the height: the share of random points there that lie in a solid. It has to lie between what the experiments
found for solids that were poured and for solids that were shaken. --quick pours fewer of them. Leaves DIR/study_platonic.csv and the runs.
Exit status: 0 all within; 1 one is not."""
import argparse
import sys
from pathlib import Path

import numpy as np
from study_support import OneLineParser, claimed, emptied, gravier, run, run_study, whole, write_csv

from gravier.shapes import axes_of

#: solid: volume in a sphere of radius 1, solid fraction poured and shaken (Baker and Kudrolli), densest packing known
SOLIDS = {
    "tetrahedron": (8.0 * 3.0**0.5 / 27.0, 0.51, 0.64, 0.8563),
    "cube": (8.0 / 3.0**1.5, 0.54, 0.67, 1.0),
    "octahedron": (4.0 / 3.0, 0.52, 0.64, 0.9474),
    "dodecahedron": (2.78516386, 0.51, 0.63, 0.9045),
    "icosahedron": (2.53615071, 0.50, 0.59, 0.8364),
}
SIZE = 0.01  # m, the edge of a cube of the same volume
FRICTION = 0.5
#: of the radius; faces and volumes stay those of the sharp solid
ROUNDING = 0.005
STEP = 5.0e-4  # s
RAIN = 1.0  # m/s
#: of the box, of the balls that hold the solids, as they are placed
LOOSE = 0.25
#: half a unit of the last digit of the experiments
DIGIT = 0.005
POINTS = 200_000


def pour(solid, count, width, folder):
    """Run the case; the run."""
    radius = SIZE / np.cbrt(SOLIDS[solid][0])
    box = width * SIZE
    height = count * 4.0 / 3.0 * np.pi * radius**3 / LOOSE / box**2
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "solid.shapes").write_text(f"shape {solid}\nrounding {ROUNDING}\n{solid} 1\n", encoding="ascii")
    # a push, then nearly no weight while they rain, then gravity
    push, fall = 0.02, height / RAIN + 0.1
    (folder / "gravity.csv").write_text(f"time,gx,gy,gz\n0,0,0,{-RAIN / push}\n{push},0,0,{-RAIN / push}\n{push + STEP},0,0,-0.2\n"
                                        f"{fall},0,0,-0.2\n{fall + 0.05},0,0,-9.81\n", encoding="ascii")
    run(folder, {
        "scene": {"dimension": 3, "bodies": "sample", "shapes": "solid.shapes", "friction": FRICTION, "density": 1000.0,
                  "period": [box, box, 0.0], "gravity_table": "gravity.csv"},
        "sample": {"count": count, "radius": radius, "solid_fraction": LOOSE},
        "time": {"step": STEP, "steps": int((fall + 0.5) / STEP)},
        "solver": {"tolerance": 1.0e-3, "max_iterations": 1000},
        "output": {"directory": ".", "every": 0, "contacts": True}})
    return gravier.Run(folder)


def solid_fraction(made, width, rng):
    """Share of points in the middle that lie in a solid, and its standard error by parts of the height."""
    bodies, shape = made.bodies(), made.shapes()[0]
    box = width * SIZE
    faces = [np.asarray(points) for points in shape.polygons()]
    normal = np.array([np.cross(points[1] - points[0], points[2] - points[1]) for points in faces])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    offset = np.array([face @ points[0] for face, points in zip(normal, faces)])
    low, high = 2.0 * SIZE, 0.75 * np.quantile(bodies.position[:, 2], 0.95)
    place = np.column_stack([rng.random((POINTS, 2)) * box, low + (high - low) * rng.random(POINTS)])
    # by height, so that each solid looks at the points of its own height alone
    place = place[np.argsort(place[:, 2])]
    inside = np.zeros(POINTS, bool)
    for centre, radius, axes in zip(bodies.position, bodies.radius, axes_of(bodies.orientation)):
        first, last = np.searchsorted(place[:, 2], [centre[2] - radius, centre[2] + radius])
        way = place[first:last] - centre
        way[:, :2] -= box * np.round(way[:, :2] / box)
        near = np.flatnonzero((way**2).sum(axis=1) < radius**2)
        within = np.all(way[near] @ axes @ normal.T <= offset * radius, axis=1)
        inside[first + near[within]] = True
    part = np.minimum(((place[:, 2] - low) / (high - low) * 4).astype(int), 3)
    parts = np.array([inside[part == k].mean() for k in range(4)])
    return inside.mean(), parts.std(ddof=1) / 2.0, (high - low) / SIZE


def main():
    parser = OneLineParser(prog="study_platonic", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/platonic"), help="default: out/platonic")
    parser.add_argument("--quick", action="store_true", help="200 of each in the place of 600")
    parser.add_argument("--count", type=whole(1), metavar="N", help="solids of each kind")
    parser.add_argument("--solids", nargs="+", choices=list(SOLIDS), default=list(SOLIDS), metavar="NAME", help=", ".join(SOLIDS))
    options = parser.parse_args()
    count = options.count or (200 if options.quick else 600)
    # as high as wide and a half: the floor and the top are left out
    width = np.cbrt(count / 0.55 / 1.6)
    if count < 20:
        parser.error(f"--count {count}: expected 20 or more")
    claimed(options.out)
    rows = []
    for solid in options.solids:
        _, loose, dense, densest = SOLIDS[solid]
        folder = options.out / solid
        emptied(folder)
        made = pour(solid, count, width, folder)
        measured, error, height = solid_fraction(made, width, np.random.default_rng(2010))
        history = made.history()
        speed = np.sqrt(2.0 * float(history.kinetic_energy[-1]) / (count * 1000.0 * SIZE**3))
        accepted = loose - DIGIT <= measured <= dense + DIGIT and measured <= densest
        rows.append((solid, count, measured, error, loose, dense, densest, height, float(history.max_overlap.max()) / SIZE,
                     float(history.max_overlap[-1]) / SIZE, speed, int(np.sum(history.converged == 0)), "yes" if accepted else "NO"))
        print(f"{solid:12s} solid fraction {measured:.3f} +- {error:.3f}, poured {loose:.2f}, shaken {dense:.2f}, densest {densest:.3f}: "
              f"{'within' if accepted else 'NOT WITHIN'}", flush=True)
    names = "solid count measured error poured shaken densest height_in_sizes largest_overlap overlap_at_end speed_at_end failed_solves accepted".split()
    write_csv(options.out / "study_platonic.csv", {name: [row[k] for row in rows] for k, name in enumerate(names)})
    sys.exit(0 if all(row[-1] == "yes" for row in rows) else 1)


if __name__ == "__main__":
    run_study(main)
