#!/usr/bin/env python3
"""What the subdomains of a packing exchange, by grains a subdomain, and an estimate for 1e9 grains on 1e5 cores.

    ./gravier study communication BODIES.h5 [--out DIR] [--gravier PROGRAM] [--subdomains 2,4,...]
    ./gravier study communication --quick [--out DIR]        a lattice of 32 768 spheres in the place of BODIES.h5

Every run makes one step on one process: the program counts what each subdomain sends whether its neighbours are on other
ranks or on its own. Writes communication.csv and communication.svg into DIR. On a lattice of touching spheres in a grid of
subdomains messages and numbers are counted anew by their definition. The closing table has each measured quantity beside what is
accepted. Exit status: 0 all are held; 1 one is missed.
"""

import argparse
import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
from oracle_table import Bounds
from study_support import BINARIES, OneLineParser, claimed, plt, run_study, write_hdf5

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from gravier.case import value_text  # noqa: E402
from whole_file import save_figure, whole_file  # noqa: E402

CASE = """&scene
  dimension = {dimension}
  bodies = 'file'
  bodies_file = {bodies}
  friction = 0.3
/
&time
  step = 1.0e-4
  steps = 1
/
&solver
  method = 'nscdd'
  acceleration = 'none'
  max_iterations = 1
/
&decomposition
  partition = '{partition}'
  subdomains = {subdomains}
/
&output
  directory = {directory}
  every = 0
  contacts = .false.
/
"""
#: grains and cores of the estimate
LARGE = (1e9, 1e5)
FULL, QUICK = {"subdomains": "2,4,8,16,32,64,128,256,512"}, {"subdomains": "2,32,64,128"}
#: spheres along each axis of the lattice, their radius [m], and how far they are from its points, over the radius
EDGE, RADIUS, SHIFT = 32, 0.01, 0.002
#: subdomains along each axis of the grids whose exchange is counted anew
GRIDS = (2, 4)
#: how far the exponent of data against grains may be below that of a surface: small subdomains have edges and corners
BELOW = 1.0 / 6.0


def arguments():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bodies", nargs="?", help="bodies file of a dense packing; not with --quick")
    parser.add_argument("--out", default="out/communication", help="directory of the results; default: out/communication")
    parser.add_argument("--quick", action="store_true", help="a lattice in the place of the bodies file, and fewer subdomains")
    parser.add_argument("--gravier", default=str(BINARIES / "gravier"), help="the program")
    parser.add_argument("--subdomains", help=f"numbers of subdomains; {FULL['subdomains']}, quick {QUICK['subdomains']}")
    options = parser.parse_args()
    if (options.bodies is None) != options.quick:
        parser.error("expected either a bodies file of a dense packing or --quick")
    if options.bodies and not os.path.isfile(options.bodies):
        parser.error(f"{options.bodies}: no such file; expected a bodies file of a dense packing")
    options.subdomains = options.subdomains or (QUICK if options.quick else FULL)["subdomains"]
    return options


def run_case(program, bodies, dimension, partition, subdomains):
    """The row of history.csv of one step."""
    with tempfile.TemporaryDirectory() as scratch:
        case = os.path.join(scratch, "case.nml")
        with whole_file(case) as part, open(part, "w", encoding="utf-8") as file:
            file.write(CASE.format(dimension=dimension, bodies=value_text(bodies), partition=partition, subdomains=subdomains,
                                   directory=value_text(os.path.join(scratch, "out"))))
        run = subprocess.run([program, case], capture_output=True, text=True, check=False)
        # one iteration does not converge: status 3
        if run.returncode not in (0, 3):
            sys.exit(run.stdout[-2000:] + run.stderr)
        with open(os.path.join(scratch, "out", "history.csv"), encoding="utf-8") as file:
            return next(csv.DictReader(file))


def lattice_of_spheres():
    """Centres of touching spheres, moved at random by a little, so that none is on a side between subdomains."""
    points = np.stack(np.meshgrid(*[np.arange(EDGE)] * 3, indexing="ij"), -1).reshape(-1, 3)
    return 2.0 * RADIUS * points + SHIFT * RADIUS * np.random.default_rng(6).uniform(-1.0, 1.0, points.shape)


def counted(centres, boxes):
    """Messages, numbers and shared spheres of the lattice in a grid of so many boxes along each axis, by their definition: a
    contact is in the box
    that holds the middle between its spheres, a sphere has a copy in each box of its contacts, and each copy sends six numbers to
    each other."""
    low, size = centres.min(0) - RADIUS, np.ptp(centres, axis=0) + 2.0 * RADIUS
    number = np.arange(EDGE**3).reshape([EDGE] * 3)
    pairs = np.concatenate([np.stack([np.delete(number, -1, axis).ravel(), np.delete(number, 0, axis).ravel()], 1)
                            for axis in range(3)])
    middle = centres[pairs].mean(1)
    box = np.minimum(((middle - low) / size * boxes).astype(int), boxes - 1) @ [boxes**2, boxes, 1]
    held = np.zeros((EDGE**3, boxes**3), int)
    held[pairs.ravel(), np.repeat(box, 2)] = 1
    copies = held.sum(1)
    together = held.T @ held
    return (together > 0).sum() - boxes**3, 6 * (copies * (copies - 1)).sum(), (copies > 1).sum()


def measure(options, bodies, grains, dimension):
    """Rows of the table."""
    table = []
    for partition in ("grid", "metis"):
        for n in (int(word) for word in options.subdomains.split(",")):
            row = run_case(options.gravier, bodies, dimension, partition, n)
            table.append({"partition": partition, "subdomains": n, "grains_a_subdomain": grains / n,
                          "messages_an_iteration": int(row["exchange_messages"]) / n,
                          "bytes_an_iteration": 8 * int(row["exchange_values"]) / n,
                          "most_messages": int(row["most_messages"]), "most_bytes": 8 * int(row["most_values"]),
                          "ghosts_a_step": int(row["ghosts"]) / n,
                          "shared_share": int(row["interface_bodies"]) / grains})
            print(", ".join(f"{key} {value:.5g}" if not isinstance(value, str) else value for key, value in table[-1].items()))
    with whole_file(os.path.join(options.out, "communication.csv")) as part, open(part, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, table[0].keys())
        writer.writeheader()
        writer.writerows(table)
    return table


def draw(table, dimension, path):
    """Bytes against grains; the exponent of each partition."""
    words = 3 if dimension == 2 else 6
    surface = 1 - 1 / dimension
    figure, axes = plt.subplots(figsize=(6, 4))
    slopes = {}
    for partition in ("grid", "metis"):
        rows = [row for row in table if row["partition"] == partition]
        inner = [row for row in rows if row["subdomains"] >= 32]
        inner = inner if len(inner) > 1 else rows
        per_subdomain = np.array([row["grains_a_subdomain"] for row in inner])
        # subdomains at the sides of the box have fewer neighbours: the fullest one is inside
        sent = np.array([row["most_bytes"] for row in inner])
        slopes[partition] = slope = np.polyfit(np.log(per_subdomain), np.log(sent), 1)[0]
        factor = np.exp(np.mean(np.log(sent) - surface * np.log(per_subdomain)))
        axes.loglog([row["grains_a_subdomain"] for row in rows], [row["most_bytes"] for row in rows], "o",
                    label=f"{partition}: exponent {slope:.2f}")
        axes.loglog(per_subdomain, factor * per_subdomain**surface, "-", lw=0.8, color="0.5")
        each = LARGE[0] / LARGE[1]
        print(f"{partition}: bytes an iteration ~ grains^{slope:.3f}; surface law {factor:.4g} grains^{surface:.3f}")
        print(f"computed, not run: {LARGE[0]:.0e} grains on {LARGE[1]:.0e} cores, {each:.0e} grains a core: "
              f"{factor * each**surface / 1024:.1f} KiB an iteration and core in {max(row['most_messages'] for row in inner)} "
              f"messages, {factor * each**surface / (8 * words):.0f} copies of grains")
    axes.set_xlabel("grains a subdomain")
    axes.set_ylabel("bytes sent an iteration by the subdomain that sends most")
    axes.legend(frameon=False)
    figure.tight_layout()
    save_figure(figure, path)
    return slopes


def accepted(options, table, slopes, grains, dimension):
    """The closing table."""
    page, bounds = "doc/large_scenes.md, What subdomains exchange", Bounds()
    centres = lattice_of_spheres()
    with tempfile.TemporaryDirectory() as scratch:
        bodies = os.path.join(scratch, "lattice.h5")
        write_hdf5(bodies, centres, np.full(len(centres), RADIUS))
        for boxes in GRIDS:
            row = run_case(options.gravier, bodies, 3, "grid", boxes**3)
            for name, column, exact in zip(("messages", "numbers", "shared spheres"),
                                           ("exchange_messages", "exchange_values", "interface_bodies"),
                                           counted(centres, boxes)):
                bounds.near(f"lattice of {len(centres)} spheres in a grid of {boxes**3}: {name} of an exchange", int(row[column]),
                            exact, 0.0,
                            "counted by their definition (doc/theory.md, 7)")
    for row in table:
        if row["subdomains"] == 2:
            copies = row["bytes_an_iteration"] / (8 * (3 if dimension == 2 else 6) * row["shared_share"] * grains)
            bounds.near(f"{row['partition']}, 2 subdomains: copies that each sends, over the shared grains", copies, 1.0, 1e-9,
                        "each subdomain has one copy of each shared grain")
            bounds.near(f"{row['partition']}, 2 subdomains: messages of each", row["messages_an_iteration"], 1.0, 0.0,
                        "one other subdomain")
    most = {(row["partition"], row["subdomains"]): row["most_bytes"] for row in table}
    several = [n for partition, n in most if partition == "grid" and n > 2]
    if several:
        bounds.add("most bytes by METIS over those by a grid, the most of all numbers of subdomains above 2",
                   max(most["metis", n] / most["grid", n] for n in several), None, 1.33 * 1.1,
                   f"{page}: 1.18 to 1.33; a tenth more")
    surface = 1.0 - 1.0 / dimension
    for partition, slope in slopes.items():
        # cells of METIS are a little wider than a sphere: on a lattice some have two layers of spheres, and its sides are uneven
        if options.quick and partition == "metis":
            continue
        bounds.add(f"{partition}: exponent of the most bytes against grains a subdomain", slope, surface - BELOW, surface,
                   f"surface law, {surface:.3g}; {page}: 0.57 and 0.59 from 32 subdomains on, less by edges and corners")
    return bounds.close()


def main():
    options = arguments()
    claimed(options.out)
    bodies = os.path.abspath(options.bodies or os.path.join(options.out, "lattice.h5"))
    if options.quick:
        centres = lattice_of_spheres()
        write_hdf5(bodies, centres, np.full(len(centres), RADIUS))
    with h5py.File(bodies) as file:
        grains, dimension = file["bodies/position"].shape
    table = measure(options, bodies, grains, dimension)
    slopes = draw(table, dimension, os.path.join(options.out, "communication.svg"))
    return accepted(options, table, slopes, grains, dimension)


if __name__ == "__main__":
    run_study(main)
