#!/usr/bin/env python3
"""Make a case of Gravier from a DATBOX of LMGC90.

    gravier_import DATBOX --step H [--steps N] [--out NAME] [--period LX LY [LZ]] [--planes] [--slip V] [--homogeneous] [--drop-g0] [--last]

--period takes two numbers in 2D and three in 3D, 0 along an axis that is not periodic.
Reads BODIES.DAT, BULK_BEHAV.DAT and TACT_BEHAV.DAT and, where they are there, DRV_DOF.DAT, DOF.INI and Vloc_Rloc.INI; writes NAME.nml,
NAME.h5 (bodies, and the forces of Vloc_Rloc.INI, from which the first solve starts), NAME.shapes (where bodies have shapes), NAME_drive_K.csv
(drives that change in time) and NAME_contacts.csv (the contacts of Vloc_Rloc.INI). With --last the state is that which LMGC90 has left in OUTBOX
beside DATBOX, DOF.LAST and Vloc_Rloc.LAST or else the last DOF.OUT.n and Vloc_Rloc.OUT.n.
What has no counterpart is named, with file and line, and refused: status 2, nothing is written. So is a case that `gravier --check`
refuses: the program of $GRAVIER_PROGRAM, or the one beside this script or in PATH, reads it before its files get their names."""
import argparse
import math
import sys
from pathlib import Path

try:
    import h5py  # noqa: F401
    import numpy  # noqa: F401
except ImportError as missing:
    sys.exit(f"gravier_import: error: {missing}: expected a python3 with h5py and numpy (apt install python3-h5py)")

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
from one_line import OneLineParser, counted, plain, run_tool  # noqa: E402
from whole_file import Locked, output_lock  # noqa: E402
from case_files import write_files  # noqa: E402
from datbox import read_bodies, read_bulk, read_contacts, read_initial, read_laws  # noqa: E402
from datbox_drives import read_drives  # noqa: E402
from datbox_text import Refused  # noqa: E402
from imported_case import Case  # noqa: E402
from imported_contacts import start_of  # noqa: E402

#: relative difference of times in files of seven digits that are the same
SAME_TIME = 1e-5


def parse():
    parser = OneLineParser(prog="gravier_import", description="Make a case of Gravier from a DATBOX of LMGC90.")
    parser.add_argument("datbox", type=Path, metavar="DATBOX", help="the directory, with BODIES.DAT and the other files")
    parser.add_argument("--step", type=float, required=True, metavar="H", help="time step [s]: the command script of LMGC90 has it")
    parser.add_argument("--steps", type=int, default=100, metavar="N", help="number of steps (100)")
    parser.add_argument("--out", default="imported", metavar="NAME", help="the files are NAME.nml, NAME.h5 and so on (imported)")
    parser.add_argument("--period", type=float, nargs="+", metavar="L",
                        help="lengths of the periodic cell, which the command script has: LX LY in 2D, LX LY LZ in 3D, 0 along an axis that is "
                        "not periodic")
    parser.add_argument("--planes", action="store_true", help="walls with all grains on one side become endless planes")
    parser.add_argument("--slip", type=float, metavar="V",
                        help="slip [m/s] over which friction falls from static to dynamic, for IQS_DS_CLB and RST_DS_CLB")
    parser.add_argument("--homogeneous", action="store_true",
                        help="bodies with shapes have the inertia and the centre of mass of these, where BODIES.DAT says otherwise")
    parser.add_argument("--drop-g0", action="store_true", help="take IQS_CLB_g0 for IQS_CLB: gaps that are open at the start may close")
    parser.add_argument("--last", action="store_true", help="start from the last state of LMGC90 in OUTBOX beside DATBOX, not from DATBOX/*.INI")
    options = parser.parse_args()
    if not (math.isfinite(options.step) and options.step > 0.0) or options.steps < 0:
        parser.error("--step: expected a finite number > 0, and --steps at least 0")
    if options.slip is not None and not (math.isfinite(options.slip) and options.slip > 0.0):
        parser.error("--slip: expected a finite number > 0")
    return options


def state_files(box, last):
    """The files of the state to start from: places, and contacts."""
    if not last:
        return box / "DOF.INI", box / "Vloc_Rloc.INI"
    out = box.parent / "OUTBOX"
    numbers = [path.name.removeprefix("DOF.OUT.") for path in out.glob("DOF.OUT.*")]
    endings = ["LAST"] * (out / "DOF.LAST").is_file() + [f"OUT.{number}" for number in sorted(filter(str.isdigit, numbers), key=int, reverse=True)[:1]]
    if not endings:
        raise Refused(f"{out}: no DOF.LAST and no DOF.OUT.n: expected the last state of a run of LMGC90 beside {box.name}")
    return out / f"DOF.{endings[0]}", out / f"Vloc_Rloc.{endings[0]}"


def read(options):
    """The case of a DATBOX, and the rows of its contacts; None where there is no file of contacts."""
    box = options.datbox
    for name in ("BODIES.DAT", "BULK_BEHAV.DAT", "TACT_BEHAV.DAT"):
        if not (box / name).is_file():
            raise Refused(f"{box / name}: no such file: expected the files of a DATBOX")
    bodies = read_bodies(box / "BODIES.DAT")
    density, gravity = read_bulk(box / "BULK_BEHAV.DAT")
    laws, sees = read_laws(box / "TACT_BEHAV.DAT")
    places, forces = state_files(box, options.last)
    start = read_initial(places, bodies) if places.is_file() else 0.0
    if (box / "DRV_DOF.DAT").is_file():
        read_drives(box / "DRV_DOF.DAT", bodies, start, start + options.step * options.steps)
    contacts, time = read_contacts(forces, bodies, laws) if forces.is_file() else (None, start)
    if options.period and len(options.period) != bodies[0].dimension:
        raise Refused(f"--period: {len(options.period)} {'numbers' if options.period[1:] else 'number'}: expected {bodies[0].dimension}, for "
                      f"bodies {bodies[0].kind} in {bodies[0].dimension}D, 0 along an axis that is not periodic")
    if options.period and not all(math.isfinite(length) and length >= 0.0 for length in options.period):
        raise Refused(f"--period {' '.join(f'{length:g}' for length in options.period)}: expected finite numbers >= 0")
    case = Case(bodies, density, gravity, laws, sees, options)
    case.build()
    known = sum(body.initial is not None for body in bodies)
    if 0 < known < len(bodies):
        case.remarks.append(f"{places.name} has {known} of the {len(bodies)} bodies: the others are at rest where BODIES.DAT has them")
    if abs(time - start) > SAME_TIME * max(abs(time), abs(start)):
        case.remarks.append(f"{forces.name} is of {time:g} s and {places.name} of {start:g} s: the first solve does not start from its forces")
    else:
        case.start = start_of(case, contacts)
    return case, contacts


def main():
    options = parse()
    try:
        case, contacts = read(options)
        with output_lock(options.out + ".nml", "gravier_import"):
            made = write_files(case, options.out, options, contacts)
    except (Refused, Locked) as refused:
        print(f"gravier_import: error: {plain(refused)}", file=sys.stderr)
        return 2
    except (ValueError, IndexError) as problem:
        print(f"gravier_import: error: {options.datbox}: {plain(problem)}: expected the files of a DATBOX as LMGC90 writes them", file=sys.stderr)
        return 2
    except OSError as problem:
        print(f"gravier_import: error: {problem.filename or options.out}: {' '.join(str(problem.strerror or problem).split())}", file=sys.stderr)
        return 4
    for remark in dict.fromkeys(case.remarks):
        print(f"gravier_import: note: {plain(remark)}", file=sys.stderr)
    boundaries = "1 boundary" if len(case.boundaries) == 1 else f"{len(case.boundaries)} boundaries"
    print(f"{counted(len(case.free), 'grain')}, {boundaries}" + (f", {counted(len(contacts), 'contact')}" if contacts is not None else "")
          + f": {', '.join(made)}")
    return 0


if __name__ == "__main__":
    run_tool(main)
