#!/usr/bin/env python3
"""What the subdomains of a packing exchange, against grains a subdomain, and what 1e9 grains on 1e5 cores would.

    python3 drivers/studies/study_communication.py BODIES.h5 [--out DIR] [--gravier PROGRAM] [--subdomains 2,4,...]

Every run makes one step on one process: the program counts what each subdomain sends whether its neighbours are on other
ranks or on its own. Writes communication.csv and communication.svg into DIR.
"""

import argparse
import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from whole_file import save_figure, whole_file  # noqa: E402

CASE = """&scene
  dimension = {dimension}
  bodies = 'file'
  bodies_file = '{bodies}'
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
  directory = '{directory}'
  every = 0
  contacts = .false.
/
"""
#: grains and cores of the estimate
LARGE = (1e9, 1e5)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bodies", help="bodies file of a dense packing")
    parser.add_argument("--out", default="out/communication", help="directory of the results; default: out/communication")
    parser.add_argument("--gravier", default="build/release/bin/gravier", help="the program")
    parser.add_argument("--subdomains", default="2,4,8,16,32,64,128,256,512", help="numbers of subdomains")
    return parser.parse_args()


def run_case(program, bodies, dimension, partition, subdomains):
    """The row of history.csv of one step."""
    with tempfile.TemporaryDirectory() as scratch:
        case = os.path.join(scratch, "case.nml")
        with whole_file(case) as part, open(part, "w", encoding="utf-8") as file:
            file.write(CASE.format(dimension=dimension, bodies=bodies, partition=partition, subdomains=subdomains,
                                   directory=os.path.join(scratch, "out")))
        run = subprocess.run([program, case], capture_output=True, text=True, check=False)
        # one iteration does not converge: status 3
        if run.returncode not in (0, 3):
            sys.exit(run.stdout[-2000:] + run.stderr)
        with open(os.path.join(scratch, "out", "history.csv"), encoding="utf-8") as file:
            return next(csv.DictReader(file))


def main():
    options = arguments()
    os.makedirs(options.out, exist_ok=True)
    bodies = os.path.abspath(options.bodies)
    with h5py.File(bodies) as file:
        grains, dimension = file["bodies/position"].shape
    words = 3 if dimension == 2 else 6
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
    figure, axes = plt.subplots(figsize=(6, 4))
    for partition in ("grid", "metis"):
        rows = [row for row in table if row["partition"] == partition]
        inner = [row for row in rows if row["subdomains"] >= 32] or rows
        per_subdomain = np.array([row["grains_a_subdomain"] for row in inner])
        # subdomains at the sides of the box have fewer neighbours: the fullest one is inside
        sent = np.array([row["most_bytes"] for row in inner])
        slope, intercept = np.polyfit(np.log(per_subdomain), np.log(sent), 1)
        surface = 1 - 1 / dimension
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
    save_figure(figure, os.path.join(options.out, "communication.svg"))


if __name__ == "__main__":
    main()
