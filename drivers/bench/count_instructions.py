#!/usr/bin/env python3
"""Instructions per relaxation of each kernel, counted by callgrind: what one sweep more costs, over the contacts of a sweep.

Valgrind knows no AVX-512: build for it with -DGRAVIER_ARCH=x86-64-v3. The count is exact and the same on every machine that runs
the same program."""
import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

KERNELS = ["2d_frictionless", "2d_friction", "2d_shaped", "3d_frictionless", "3d_friction", "3d_shaped"]
#: only what runs inside the sweeps is counted: the start of MPI does not take the same number of instructions each time
INSIDE = "__gravier_contact_kernels_MOD_sweep*"


def run(program, kernel, recording, contacts, sweeps):
    """(instructions inside the sweeps, contacts) of one run."""
    with tempfile.TemporaryDirectory() as directory:
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={directory}/callgrind.out", f"--toggle-collect={INSIDE}",
                   str(program), "--kernel", kernel, "--contacts", str(contacts), "--sweeps", str(sweeps)]
        done = subprocess.run(command + ["--recording"] * recording, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              env={"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", **os.environ})
    said = done.stdout.decode(errors="replace") + done.stderr.decode(errors="replace")
    collected = re.search(r"Collected : (\d+)", said)
    size = re.search(r": (\d+) contacts, ", said)
    if done.returncode != 0 or not collected or not size or int(collected[1]) == 0:
        sys.exit(f"count_instructions.py: {' '.join(command)}: no count; expected a build that valgrind can run "
                 f"(-DGRAVIER_ARCH=x86-64-v3)\n{said[-2000:]}")
    return int(collected[1]), int(size[1])


def count(program, kernel, recording, contacts, sweeps):
    """Instructions per relaxation."""
    few, size = run(program, kernel, recording, contacts, sweeps)
    many, _ = run(program, kernel, recording, contacts, 2 * sweeps)
    return (many - few) / (size * sweeps)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program", type=Path, metavar="GRAVIER_BENCH", help="path of gravier_bench")
    parser.add_argument("--kernel", choices=KERNELS, help="this one only")
    parser.add_argument("--contacts", type=int, default=2000, help="contacts of the problem, about (2000)")
    parser.add_argument("--sweeps", type=int, default=10, help="sweeps of the first run; the second does twice as many (10)")
    options = parser.parse_args()
    if not shutil.which("valgrind"):
        sys.exit("count_instructions.py: no valgrind in PATH")
    print("| kernel | instructions | with recording |\n|---|---|---|")
    for kernel in [options.kernel] if options.kernel else KERNELS:
        counts = [count(options.program, kernel, recording, options.contacts, options.sweeps) for recording in (False, True)]
        print(f"| `{kernel}` | {counts[0]:.1f} | {counts[1]:.1f} |", flush=True)


if __name__ == "__main__":
    main()
