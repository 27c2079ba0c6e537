#!/usr/bin/env python3
"""Copies of a packing in a box side by side along x, or a part of one: a larger or smaller bodies file.

    python3 drivers/studies/tile_bodies.py IN.h5 OUT.h5 [--copies N] [--keep N]

The box has planes whose normals are along the axes, as lattices and samples have. `--keep N` takes the N bodies of least x first and
puts the plane of greatest x against them.
"""

import argparse
import sys
from pathlib import Path

import h5py
import numpy as np
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from whole_file import hdf5_file, written  # noqa: E402


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source")
    parser.add_argument("target")
    parser.add_argument("--copies", type=int, default=1)
    parser.add_argument("--keep", type=int, help="bodies of one copy")
    options = parser.parse_args()
    with h5py.File(options.source) as file:
        bodies = {name: data[:] for name, data in file["bodies"].items()}
        walls = {name: data[:] for name, data in file["walls"].items()}
    low, high = walls["normal"][:, 0] > 0.5, walls["normal"][:, 0] < -0.5
    if options.keep:
        kept = np.sort(np.argsort(bodies["position"][:, 0])[:options.keep])
        bodies = {name: data[kept] for name, data in bodies.items()}
        walls["point"][high, 0] = (bodies["position"][:, 0] + bodies["radius"]).max()
    width = walls["point"][high, 0].min() - walls["point"][low, 0].max()
    n = options.copies * len(bodies["id"])
    tiled = {name: np.concatenate([data] * options.copies) for name, data in bodies.items()}
    tiled["id"] = np.arange(1, n + 1)
    tiled["position"][:, 0] += width * np.repeat(np.arange(options.copies), len(bodies["id"]))
    walls["point"][high, 0] += (options.copies - 1) * width
    walls["id"] = np.arange(n + 1, n + 1 + len(walls["id"]))
    with written(options.target) as part, hdf5_file(part) as file:
        for group, rows in (("bodies", tiled), ("walls", walls)):
            for name, data in rows.items():
                file[f"{group}/{name}"] = data


if __name__ == "__main__":
    main()
