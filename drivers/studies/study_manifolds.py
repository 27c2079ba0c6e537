#!/usr/bin/env python3
"""Distance, normal and points of contact of random and degenerate pairs of polyhedra, against independent computations.

    python3 drivers/studies/study_manifolds.py [--quick] [--count N] [--seed N] [--jobs N]

The program test_hard_polyhedron_fuzz makes the pairs and judges them: the distance of the cores is proved by duality for each pair, and compared with a
quadratic program in quadruple precision for some; no corner of two parallel faces may lack a point; along lines of places the normal and what the points carry
may not jump. The table has its figures, the worst over all jobs, beside what is accepted. --quick takes 200 000 pairs in place of 10^7.
Exit status: 0 all within; 1 one is not."""
import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

from study_support import OneLineParser, run_study, whole

#: column of the program's table: what is accepted (of duality: in parts of what rounding allows, 1e-12 of the size and more for short ways)
ACCEPTED = {"duality": 1.0, "distance": 1e-12, "normal": 1e-9}
#: share of the lines along which what the points carry may jump
JUMPS = 0.005


#: what makes the pairs; the launcher reads this line, and builds the program before it runs the study
TEST_PROGRAM = "test_hard_polyhedron_fuzz"


def program():
    path = Path(os.environ.get("GRAVIER_BIN_DIR", "")).parent / "tests" / "bin" / TEST_PROGRAM
    if not path.is_file():
        sys.exit(f"study_manifolds: {path}: no such program: build with -DGRAVIER_TESTS=ON")
    return path


def start(count, seed):
    return subprocess.Popen([program(), str(count), str(seed)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def read(text):
    """Families with their figures, lines and jumps, and checks passed and failed."""
    families, columns = {}, None
    for line in text.splitlines():
        if line.startswith("family"):
            columns = line.split()[1:]
        elif columns and (cells := line.rsplit(maxsplit=len(columns)))[1:] and len(cells) == len(columns) + 1 and cells[1].isdigit():
            families[cells[0].strip()] = dict(zip(columns, map(float, cells[1:])))
    lines = re.search(r"(\d+) lines, in (\d+) of them", text)
    checks = re.search(r"(\d+) passed, (\d+) failed", text)
    if not families or not lines or not checks:
        sys.exit("study_manifolds: the program did not end as expected:\n" + text[-2000:])
    return families, [int(n) for n in lines.groups()], [int(n) for n in checks.groups()]


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--count", type=whole(1), help="pairs, of all jobs together")
    parser.add_argument("--seed", type=whole(0), default=101)
    parser.add_argument("--jobs", type=whole(1), default=1)
    options = parser.parse_args()
    count = options.count or (200_000 if options.quick else 10_000_000)
    jobs = [start(count//options.jobs, options.seed + k) for k in range(options.jobs)]
    said = [job.communicate()[0] for job in jobs]
    results = [read(text) for text in said]
    missed = 0

    def row(what, measured, accepted, good):
        nonlocal missed
        missed += not good
        print(f"{what:<52} {measured:>12} {accepted:>12}   {'yes' if good else 'NO'}", flush=True)

    print(f"{count} pairs, seeds {options.seed} to {options.seed + options.jobs - 1}")
    print(f"{'':<52} {'measured':>12} {'accepted':>12}   within")
    for family in results[0][0]:
        for column, accepted in ACCEPTED.items():
            found = [families[family][column] for families, _, _ in results]
            # a number that is none counts as the worst
            worst = max(found) if all(value == value for value in found) else float("nan")
            row(f"{family}: error of {column}", f"{worst:.1e}", f"{accepted:.0e}", worst <= accepted)
    total, jumps = (sum(lines[k] for _, lines, _ in results) for k in (0, 1))
    row(f"lines of places, {total}: those with a jump", str(jumps), f"{JUMPS*total:.1f}", jumps <= JUMPS*total)
    passed, failed = (sum(checks[k] for _, _, checks in results) for k in (0, 1))
    row(f"checks of the program, {passed + failed}: those that fail", str(failed), "0", failed == 0)
    for line in [line for text in said for line in text.splitlines() if line.startswith("FAILED")][:20]:
        print(line)
    return int(missed > 0)


if __name__ == "__main__":
    run_study(main)
