#!/usr/bin/env python3
"""Make the bodies files and the meshes of data/scenes anew, from fixed seeds; compacted bodies by the program itself.

    python3 drivers/studies/scene_bodies.py data/scenes        half a minute; GRAVIER_BIN_DIR says where gravier is"""
import argparse
import tempfile
from pathlib import Path

import numpy as np
from study_support import lattice, loose, radii_by_volume, read_bodies, run, states, write_hdf5

AXES = "xyz"


def write_bodies(path, remark, centres, radii, group=None):
    """A bodies file in CSV, to a micrometre and less."""
    d = centres.shape[1]
    lines = [f"# {remark}", "id," + ",".join(AXES[:d]) + ",radius" + (",group" if group is not None else "")]
    for k, (centre, radius) in enumerate(zip(centres, radii)):
        cells = [str(k + 1), *(f"{x:.7f}" for x in centre), f"{radius:.7f}"]
        lines.append(",".join(cells + ([str(group[k])] if group is not None else [])))
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    print(f"{path}: {len(radii)} grains")


def compact(centres, radii, size, pressure, steps):
    """Press grains together, without friction or gravity, with as large a pressure on each side: centres and the size of the
    box they leave."""
    d = len(size)
    mass = 2500.0 * np.prod(size) / 5.0
    planes = []
    for k in range(d):
        normal = np.eye(d)[k]
        planes.append({"name": f"low {AXES[k]}", "shape": "plane", "normal": normal})
        planes.append({"name": f"high {AXES[k]}", "shape": "plane", "point": size[k] * normal, "normal": -normal,
                       "free": list(normal > 0.5), "pressure": pressure, "mass": mass})
    with tempfile.TemporaryDirectory() as scratch:
        write_hdf5(Path(scratch) / "loose.h5", centres, radii)
        run(scratch, {
            "scene": {"dimension": d, "gravity": [0.0] * d, "bodies": "file", "bodies_file": "loose.h5", "density": 2500.0},
            "time": {"step": 5.0e-4, "steps": steps},
            "solver": {"acceleration": "none", "tolerance": 1.0e-4, "max_iterations": 2000},
            "output": {"directory": ".", "every": 0, "final_bodies": True}}, planes)
        position = [state["boundaries/position"][:] for _, _, state in states(Path(scratch) / "results.h5")][-1]
        centres, _, _ = read_bodies(Path(scratch) / "final_bodies.h5")
    return centres, np.array([position[2 * k + 1, k] for k in range(d)])


def biaxial(folder, rng):
    radii = radii_by_volume(800, 0.005, 0.015, 2, rng)
    size = np.array([1.0, 1.5]) * np.sqrt(np.pi * (radii**2).sum() / 0.55 / 1.5)
    centres, size = compact(loose(radii, [0.0, 0.0], size, rng), radii, size, 1000.0, 2000)
    write_bodies(folder / "biaxial.csv", "compacted without friction between 0 and "
                 f"({size[0]:.7f}, {size[1]:.7f}) m", centres, radii)


def triaxial(folder, rng):
    radii = 0.004 + 0.002 * rng.random(800)
    size = np.array([1.0, 1.0, 1.5]) * np.cbrt(4.0 / 3.0 * np.pi * (radii**3).sum() / 0.35 / 1.5)
    centres, size = compact(loose(radii, np.zeros(3), size, rng), radii, size, 1000.0, 1500)
    write_bodies(folder / "triaxial.csv", "compacted without friction between 0 and "
                 f"({size[0]:.7f}, {size[1]:.7f}, {size[2]:.7f}) m", centres, radii)


def shear(folder, rng):
    """Two rows of glued grains, 0.8 m long, and loose ones between them."""
    row = (np.arange(40) + 0.5) * 0.02
    centres, radii = lattice([0.0, 0.02], [0.8, 0.52], 0.008, 0.011, rng)
    top = centres[:, 1].max() + 0.022
    bottom_row, top_row = np.column_stack([row, 0.0 * row]), np.column_stack([row, 0.0 * row + top])
    write_bodies(folder / "shear.csv", "group 1: the bottom row, group 2: the top row",
                 np.concatenate([bottom_row, top_row, centres]), np.concatenate([np.full(80, 0.01), radii]), [1] * 40 + [2] * 40 + [0] * len(radii))


def funnel(folder, rng, sides=48):
    """A cone on a tube below and a cylinder above as triangles of a binary STL file, open at both ends; spheres on a lattice in the
    cylinder."""
    profile = [(0.03, -0.03), (0.03, 0.0), (0.07, 0.06), (0.07, 0.2)]
    angle = 2.0 * np.pi * np.arange(sides + 1) / sides
    ring = [np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides + 1, height)], axis=1) for radius, height in profile]
    triangles = []
    for below, above in zip(ring[:-1], ring[1:]):
        for k in range(sides):
            triangles += [(below[k], below[k + 1], above[k + 1]), (below[k], above[k + 1], above[k])]
    record = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["corners"] = triangles
    head = b"funnel of drivers/studies/scene_bodies.py, in m".ljust(80)
    (folder / "funnel.stl").write_bytes(head + np.uint32(len(record)).tobytes() + record.tobytes())
    print(f"{folder / 'funnel.stl'}: {len(record)} triangles")
    inside = lambda x, largest: np.hypot(x[:, 0], x[:, 1]) < 0.069 - 1.03 * largest
    write_bodies(folder / "funnel.csv", "a lattice in a cylinder", *lattice([-0.07, -0.07, 0.065], [0.07, 0.07, 0.155], 0.005, 0.006, rng, inside))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="FOLDER", type=Path)
    folder = parser.parse_args().folder
    rng = np.random.default_rng(7)
    biaxial(folder, rng)
    triaxial(folder, rng)
    shear(folder, rng)
    write_bodies(folder / "drum.csv", "a lattice in a circle of 0.2 m", *lattice(
        [-0.2, -0.2], [0.2, 0.04], 0.004, 0.006, rng, lambda x, largest: np.linalg.norm(x, axis=1) < 0.2 - 1.03 * largest))
    write_bodies(folder / "drum_3d.csv", "a lattice in a cylinder of 0.1 m along y", *lattice(
        [-0.1, 0.0, -0.1], [0.1, 0.062, 0.03], 0.004, 0.005, rng,
        lambda x, largest: np.hypot(x[:, 0], x[:, 2]) < 0.1 - 1.03 * largest))
    # above the slopes of the hopper
    slope = lambda x, largest: x[:, -1] > abs(x[:, 0]) - 0.03 + 1.5 * largest
    write_bodies(folder / "hopper.csv", "a lattice above two slopes", *lattice(
        [-0.25, 0.02], [0.25, 0.75], 0.004, 0.006, rng, lambda x, largest: x[:, 1] > 0.8 * abs(x[:, 0]) + 1.5 * largest))
    write_bodies(folder / "hopper_3d.csv", "a lattice above two slopes", *lattice(
        [-0.1, 0.0, 0.0], [0.1, 0.0616, 0.22], 0.004, 0.005, rng, slope))
    funnel(folder, np.random.default_rng(8))
    write_bodies(folder / "collapse.csv", "a lattice", *lattice([0.0, 0.0], [0.2, 0.8], 0.004, 0.006, rng))


if __name__ == "__main__":
    main()
