"""Packings that tests start from, as files in tests/packings. A packing that each run of a test made anew would be another one whenever
the program sweeps contacts in another order, and bounds on iterations would be those of another scene.

    GRAVIER_BIN_DIR=build/release/bin python3 tests/support/packings.py
makes all of them anew, with the program as it is: bounds of tests then have to be looked at again.
"""
import os
import shutil

from gravier_runs import SOURCE, run_case
from shaped_scenes import box, lattice, prepare, shaped_case

FOLDER = os.path.join(SOURCE, "tests/packings")
#: columns and rows of disks, spheres along each edge; steps of 1 ms that they settle. After 250 steps disks lie on each other and still
#: move (kinetic energy 1 % of its peak), after 400 steps they are at rest (0.01 %)
DISKS = (((24, 25), 400), ((24, 25), 340), ((24, 25), 250), ((24, 23), 400), ((18, 16), 250), ((16, 16), 400), ((14, 12), 400), ((12, 13), 400))
SPHERES = ((7, 350), (10, 450))
#: bodies with shapes that fall together, by dimension: their counts along the axes of a lattice, its spacing [m], steps of 1 ms
POURS = {2: ((6, 6), 0.17, 300), 3: ((3, 3, 4), 0.19, 220)}


def settled_disks(directory, steps=400, count=(24, 25)):
    """Disks that have settled in a box, 600 of them: path of a copy of the bodies file in the directory."""
    return copied(directory, count, steps)


def settled_spheres(directory, edge, steps):
    """The same of edge^3 spheres."""
    return copied(directory, (edge,) * 3, steps)


def poured_shapes(directory, dimension):
    """The same of bodies with shapes that fall together, and the file of shapes beside it."""
    counts, _, steps = POURS[dimension]
    prepare(directory, dimension, [])
    return shutil.copy(kept(counts, steps, "shapes_"), os.path.join(directory, "bodies.h5"))


def copied(directory, count, steps):
    os.makedirs(directory, exist_ok=True)
    return shutil.copy(kept(count, steps), os.path.join(directory, "final_bodies.h5"))


def kept(count, steps, kind=""):
    """Path of the file of a packing in the tree."""
    return os.path.join(FOLDER, f"{kind}{'x'.join(map(str, count))}_{steps}.h5")


def settle(count, steps, directory):
    """Fill a box and let it settle by plain sweeps; the bodies file is kept."""
    run = run_case({
        "scene": {"dimension": len(count), "bodies": "lattice", "lattice_count": list(count), "radius_min": 0.008, "radius_max": 0.012,
                  "friction": 0.3},
        "time": {"step": 1e-3, "steps": steps},
        "solver": {"acceleration": "none", "criterion": "residual", "tolerance": 1e-3, "max_iterations": 2000},
        "output": {"directory": ".", "every": 0, "final_bodies": True},
    }, directory=directory)
    if run.status != 0:
        raise SystemExit(f"the packing was not made: {run}")
    shutil.copy(run.path("final_bodies.h5"), kept(count, steps))


def pour(dimension, directory):
    """Let bodies with shapes fall together; the bodies file is kept."""
    counts, spacing, steps = POURS[dimension]
    prepare(directory, dimension, lattice(counts, spacing=spacing))
    run = run_case(shaped_case(dimension, box(counts, spacing), {"scene": {"friction": 0.3}, "time": {"steps": steps},
                                                                 "output": {"final_bodies": True}}), 1, directory)
    if run.status != 0:
        raise SystemExit(f"the packing was not made: {run}")
    shutil.copy(run.path("results", "final_bodies.h5"), kept(counts, steps, "shapes_"))


def main():
    import tempfile
    with tempfile.TemporaryDirectory() as scratch:
        for count, steps in (*DISKS, *(((edge,) * 3, steps) for edge, steps in SPHERES)):
            settle(count, steps, os.path.join(scratch, os.path.basename(kept(count, steps))))
            print(kept(count, steps))
        for dimension, (counts, _, steps) in POURS.items():
            pour(dimension, os.path.join(scratch, f"shapes_{dimension}"))
            print(kept(counts, steps, "shapes_"))


if __name__ == "__main__":
    main()
