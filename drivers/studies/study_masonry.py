#!/usr/bin/env python3
"""Blocks, arches and walls against analytic values and linear programs.

    python3 drivers/studies/study_masonry.py [--quick] [--parts NAME...] [--out DIR]     15 minutes on one core, quick 1 minute

The parts are slopes, prisms, sliding and toppling, rocking, overhangs, wedges, arches, walls that lean, dominoes, long rests,
a pile of stones, landings, and scenes turned and mirrored. It prints a row an oracle with what was measured, expected and accepted, and ends with
status 1 where one is out of its bounds. With --out it leaves DIR/masonry.md, the table, and DIR/masonry.csv."""
import argparse
import time
from pathlib import Path

import masonry_blocks as blocks
import masonry_motion as motion
import masonry_pile
import masonry_walls as walls
from oracle_table import Table, say
from study_support import OneLineParser, claimed, run_study, write_measured

PARTS = {"slope": blocks.slope, "prisms": blocks.prisms, "map": blocks.slide_topple, "rocking": blocks.rocking,
         "overhang": blocks.overhang, "wedge": blocks.wedge, "arch": walls.arches, "tilt": walls.tilts, "dominoes": motion.dominoes,
         "rest": walls.rest, "pile": masonry_pile.pile, "landing": motion.landing, "turned": motion.invariance}


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer cases and steps")
    parser.add_argument("--parts", nargs="+", choices=list(PARTS), default=list(PARTS))
    parser.add_argument("--out", metavar="DIR", type=Path)
    options = parser.parse_args()
    if options.out:
        claimed(options.out)
    table = Table()
    for name in options.parts:
        start = time.time()
        PARTS[name](table, options.quick)
        say(f"{name}: {time.time() - start:.0f} s")
    if options.out:
        (options.out / "masonry.md").write_text(table.markdown(), encoding="utf-8")
        write_measured(options.out / "masonry.csv", {name: [row[k] for row in table.rows] for k, name in enumerate(table.HEADER)})
    bounded = [row for row in table.rows if row[-1]]
    print(f"{len(bounded) - len(table.misses)} of {len(bounded)} within their bounds")
    return 1 if table.misses else 0


if __name__ == "__main__":
    run_study(main)
