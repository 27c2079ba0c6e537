#!/usr/bin/env python3
"""Copies of a packing in a box side by side along x and along y, or a part of one: a larger or smaller bodies file.

    python3 drivers/studies/tile_bodies.py IN.h5 OUT.h5 [--copies N [M]] [--keep N]

The box has planes whose normals are along the axes, as lattices and samples have. `--keep N` takes the N bodies of least x first and
puts the plane of greatest x against them. The memory of one copy suffices.
"""

import argparse
import sys
from pathlib import Path

import h5py
import numpy as np
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from whole_file import claim, hdf5_file, written  # noqa: E402

PROGRAM = "tile_bodies"
KINDS = {".h5": PROGRAM}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source")
    parser.add_argument("target")
    parser.add_argument("--copies", type=int, nargs="+", default=[1], help="along x, and along y")
    parser.add_argument("--keep", type=int, help="bodies of one copy")
    options = parser.parse_args()
    claim(options.target, KINDS, [options.source])
    with h5py.File(options.source) as file:
        bodies = {name: data[:] for name, data in file["bodies"].items()}
        walls = {name: data[:] for name, data in file["walls"].items()}
    if options.keep:
        kept = np.sort(np.argsort(bodies["position"][:, 0])[:options.keep])
        bodies = {name: data[kept] for name, data in bodies.items()}
        walls["point"][walls["normal"][:, 0] < -0.5, 0] = (bodies["position"][:, 0] + bodies["radius"]).max()
    along = (options.copies + [1])[:2]
    width = np.array([spread(walls, axis, number) for axis, number in enumerate(along)])
    n, copies = len(bodies["id"]), along[0] * along[1]
    walls["id"] = np.arange(copies * n + 1, copies * n + 1 + len(walls["id"]))
    with written(options.target, KINDS, [options.source]) as part, hdf5_file(part, PROGRAM) as file:
        for name, data in walls.items():
            file[f"walls/{name}"] = data
        for name, data in bodies.items():
            file.create_dataset(f"bodies/{name}", (copies * n, *data.shape[1:]), data.dtype)
        for copy in range(copies):
            here = dict(bodies, id=np.arange(copy * n + 1, copy * n + n + 1), position=bodies["position"].copy())
            here["position"][:, :2] += width * divmod(copy, along[1])
            for name, data in here.items():
                file[f"bodies/{name}"][copy * n:copy * n + n] = data


def spread(walls, axis, number):
    """Move the plane of greatest coordinate out to make room for so many copies; the width of one, 0 where there is no other."""
    if number == 1:
        return 0.0
    low, high = walls["normal"][:, axis] > 0.5, walls["normal"][:, axis] < -0.5
    width = walls["point"][high, axis].min() - walls["point"][low, axis].max()
    walls["point"][high, axis] += (number - 1) * width
    return width


if __name__ == "__main__":
    main()
