#!/usr/bin/env python3
"""Three processes beside smooth DEM (LAMMPS): what comes out, and the seconds that it takes on one core or several.

    ./gravier study dem [--quick] [--parts NAME...] [--ranks N] [--lammps PROGRAM] [--out DIR]     a quarter of an hour, quick 2 minutes

The processes are spheres that settle in a box, simple shear at a pressure, and the discharge of the box through a slot. LAMMPS is the
program lmp of PATH unless told; where it is not there, or with --lammps none, what Gravier finds is compared with stored figures of
data/studies/dem.csv and seconds are not compared. It prints a row a quantity with what Gravier measured, what LAMMPS has and what is
accepted, and a table of settings of Gravier with their seconds. Percentages behind a quantity are standard errors of both codes
together, by batches of the run. Seconds are those of the processor, and with --ranks, which both codes then have, those on the clock.
Small scenes scatter more, and have wider bounds of physics. It ends with status 1 where a row is out of its bounds. With --out it
leaves DIR/study_dem.csv, the settings, DIR/study_dem.md, both tables, and the runs; --record writes the stored figures anew."""
import csv
import datetime
import os
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path

from dem_codes import Log, lammps_version, run_gravier, run_lammps
from dem_scenes import Discharge, Settling, Shear
from oracle_table import Table, say
from study_support import BINARIES, ENVIRONMENT, SOURCE, OneLineParser, claimed, run_study, whole, write_measured


STORED = SOURCE / "data/studies/dem.csv"
PARTS = ("settling", "shear", "discharge")
FASTER, SWEEPS = 5.0, 0.6
RIGID = {"solid fraction": 0.005, "stress ratio": 0.03, "volume over that at the start": 0.03, "flow [kg/s]": 0.03}
COMPLIANT = {"solid fraction": 0.01, "stress ratio": 0.01, "contacts a grain": 0.01}
# of small scenes: solid fraction and flow by two standard deviations of the difference of two runs, from six starts by LAMMPS; stress
# ratio and contacts by twice the root mean square of the differences between both codes, which share the start, from two samples
SMALL = {"solid fraction": 0.013, "stress ratio": 0.12, "flow [kg/s]": 0.14, "contacts a grain": 0.053}
SECONDS = "seconds"
# columns of the table of settings: parts of a run
PHASES = {"sweeps": ["sweeps"], "checks": ["residual checks", "reductions of the solve"],
          "set_up": ["set-up of the solve", "interface: shared bodies"], "lists": ["neighbour lists and ghosts"],
          "detection": ["detection of contacts"], "motion": ["motion and migration"], "projection": ["projection of overlaps"]}


class Lammps:
    """Figures of LAMMPS: by the program, or stored ones."""

    def __init__(self, program, scenes, ranks):
        self.program, self.scenes, self.ranks, self.figures = program, scenes, ranks, {}
        if program is None:
            with open(STORED, encoding="ascii", newline="") as file:
                rows = [row for row in csv.DictReader(file) if row["scenes"] == scenes]
            for row in rows:
                self.figures.setdefault(row["process"], {})[row["quantity"]] = (float(row["value"]), float(row["error"]))
            self.source = f"{rows[0]['program']}, stored figures of {rows[0]['date']}"
        else:
            self.source = f"{lammps_version(program)}, {program}"

    def run(self, process, *stiffer):
        """{quantity: (value, standard error)} of a process, with springs so many times as stiff."""
        name = " ".join([process.name, *(f"{times:g}" for times in stiffer)])
        if self.program is None:
            # seconds of another machine are no measure
            return {quantity: value for quantity, value in self.figures[name].items() if quantity != SECONDS}
        place = process.place / name.replace(process.name, "lammps").replace(" ", "_")
        seconds = run_lammps(self.program, place, process.script(*stiffer), self.ranks)
        self.figures[name] = {**process.of_lammps(place, *stiffer), SECONDS: (seconds, 0.0)}
        return self.figures[name]

    def record(self):
        """The figures into the file of stored ones, in the place of those of the same scenes and processes."""
        made = {(self.scenes, name) for name in self.figures}
        with open(STORED, encoding="ascii", newline="") as file:
            kept = [row for row in csv.DictReader(file) if (row["scenes"], row["process"]) not in made]
        same = {"program": lammps_version(self.program), "date": datetime.date.today().isoformat(), "machine": processor()}
        rows = kept + [{"scenes": self.scenes, "process": process, "quantity": quantity, "value": f"{value:.6g}",
                        "error": f"{error:.2g}", **same} for process, values in self.figures.items() for quantity, (value, error) in values.items()]
        with open(STORED, "w", encoding="ascii", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            table.writeheader()
            table.writerows(sorted(rows, key=lambda row: (row["scenes"], PARTS.index(row["process"].split()[0]), row["process"])))


def processor():
    if Path("/proc/cpuinfo").exists():
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.machine()


def version():
    said = subprocess.run([(BINARIES / "gravier").resolve(), "--version"], env={**ENVIRONMENT, **os.environ}, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, text=True, check=False).stdout
    return " ".join(said.split())


def relative_error(error, other, value):
    """Standard error of the difference of two values, over one of them."""
    return (error**2 + other**2)**0.5 / abs(value)


class Study:

    def __init__(self, lammps, quick):
        self.lammps, self.quick, self.table, self.rows = lammps, quick, Table(), []
        self.ranks = lammps.ranks

    def bounds(self, compliant):
        bounds = COMPLIANT if compliant else RIGID
        return {name: max(bound, SMALL.get(name, 0.0)) if self.quick else bound for name, bound in bounds.items()}

    def play(self, process):
        """Both codes, one after the other; the first setting of rigid contacts and the first two of compliant ones have bounds."""
        process.prepare()
        theirs = self.lammps.run(process)
        limit = self.lammps.run(process, process.stiffer) if process.name == "shear" else None
        for k, setting in enumerate(process.settings):
            name = "gravier" if k == 0 else f"gravier_{k + 1}"
            ours, log = self.measure(process, setting, name, limit or theirs)
            if k == 0:
                self.compare(process.name, "", ours, theirs, self.bounds(False))
                if limit:
                    self.compare(process.name, f"springs {process.stiffer:g} times as stiff: ", ours, limit, self.bounds(False))
                if process.name != "discharge":
                    self.at_least(process.name, "sweeps, part of a step", log.share("sweeps"), SWEEPS)
        for k, setting in enumerate(getattr(process, "compliant", ())):
            ours, _ = self.measure(process, setting, f"compliant_{k + 1}", theirs, compliant=True)
            if k < 2:
                self.compare("compliant", f"h = {1e3 * setting.step:.3g} ms: ", ours, theirs, self.bounds(True))
        if SECONDS in theirs and not self.quick:
            self.cheapest(process.name)

    def compare(self, label, case, ours, theirs, bounds):
        """A row a quantity, and one of the seconds if LAMMPS ran here; `case` begins the name of each quantity."""
        for quantity, (value, error) in ours.items():
            if quantity == SECONDS:
                continue
            expected, other = theirs[quantity]
            spread = relative_error(error, other, expected)
            self.table.add(label, case + quantity + (f" (+- {100 * spread:.1f} %)" if spread > 0.0 else ""), f"{value:.4g}", f"{expected:.4g}",
                           abs(value / expected - 1.0), bounds.get(quantity))
        if SECONDS in theirs:
            of_lammps, of_gravier = theirs[SECONDS][0], ours[SECONDS][0]
            self.at_least(label, f"{case}seconds of LAMMPS, {of_lammps:.1f}, over those of Gravier, {of_gravier:.1f}",
                          of_lammps / of_gravier, FASTER)

    def measure(self, process, setting, directory, theirs, compliant=False):
        """What Gravier finds with a setting, with its seconds, and its log; a row of the table of settings beside what LAMMPS has."""
        case = process.case(setting, compliant=True) if compliant else process.case(setting)
        seconds = run_gravier(process.place / directory, *case, ranks=self.ranks)
        ours = {**process.of_gravier(process.place / directory, compliant), SECONDS: (seconds, 0.0)}
        log = Log(process.place / directory)
        within = all(abs(ours[name][0] / theirs[name][0] - 1.0) <= max(bound, 2.0 * relative_error(ours[name][1], *theirs[name][::-1]))
                     for name, bound in self.bounds(compliant).items() if name in ours)
        self.rows.append({
            "process": process.name, "contacts": "compliant" if compliant else "rigid", "step_ms": 1e3 * setting.step,
            "accuracy": setting.accuracy, "other_keys": setting.others, "seconds": round(seconds, 1),
            "lammps_over_gravier": f"{theirs[SECONDS][0] / seconds:.2f}" if SECONDS in theirs else "",
            **{quantity: f"{ours[quantity][0]:.4g}" if quantity in ours else "" for quantity in (*RIGID, "contacts a grain")},
            "within": "yes" if within else "no", "iterations_a_step": f"{log.iterations / log.solves:.1f}",
            **{column: f"{log.share(*phases):.2f}" for column, phases in PHASES.items()}, "lists_built": log.lists,
            "steps_projected": log.projected, "steps_missed": log.missed, "steps": log.solves})
        say(f"{process.name}, {self.rows[-1]['contacts']}, h = {setting.step:g} s, accuracy {setting.accuracy}, {setting.others}: {seconds:.1f} s")
        return ours, log

    def at_least(self, process, quantity, value, least):
        self.table.add(process, quantity, f"{value:.3g}", f">= {least:g}", max(0.0, 1.0 - value / least), 0.0)

    def cheapest(self, process):
        """The setting that takes least among those whose quantities are within their bounds, or twice their standard errors."""
        right = [row for row in self.rows if row["process"] == process and row["contacts"] == "rigid" and row["within"] == "yes"]
        if right:
            row = min(right, key=lambda row: row["seconds"])
            self.table.add(process, f"the same of the cheapest setting within, h = {row['step_ms']:g} ms, accuracy {row['accuracy']}",
                           row["lammps_over_gravier"])

    def settings(self):
        """The table of settings, as Markdown."""
        names = [name for name in self.rows[0] if any(row[name] != "" for row in self.rows)]
        cells = [[name.replace("_", " ") for name in names], ["---"] * len(names)]
        cells += [[f"{row[name]:g}" if isinstance(row[name], float) else str(row[name]) for name in names] for row in self.rows]
        lines = ["| " + " | ".join(line) + " |" for line in cells]
        return "\n".join(lines) + "\n"


def find_lammps(asked, refuse):
    """Path of LAMMPS, or None where stored figures serve."""
    if asked == "none":
        return None
    program = shutil.which(asked or "lmp")
    if program and lammps_version(program):
        return str(Path(program).resolve())
    if asked:
        refuse(f"--lammps {asked}: expected LAMMPS, or none")
    return None


def main():
    parser = OneLineParser(prog="study_dem", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="smaller scenes, one setting of each")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), help="processes (all)")
    parser.add_argument("--ranks", metavar="N", type=whole(1), default=1, help="ranks of either code (1)")
    parser.add_argument("--lammps", metavar="PROGRAM", help="LAMMPS (lmp of PATH); none: stored figures")
    parser.add_argument("--seed", type=whole(0), default=1, help="of the radii and places at the start (1)")
    parser.add_argument("--out", metavar="DIR", type=Path, help="directory of the tables and the runs")
    parser.add_argument("--record", action="store_true", help=f"write what LAMMPS finds into {STORED.name}")
    options = parser.parse_args()
    program = find_lammps(options.lammps, parser.error)
    if options.record and program is None:
        parser.error("--record: expected LAMMPS on this machine")
    if options.record and options.ranks > 1:
        parser.error(f"--record with --ranks {options.ranks}: expected --ranks 1, by which stored figures are made")
    lammps = Lammps(program, "small" if options.quick else "full", options.ranks)
    with tempfile.TemporaryDirectory() as passing:
        place = (claimed(options.out) if options.out else Path(passing)).resolve()
        study = Study(lammps, options.quick)
        settling = Settling(place, options.quick, options.seed)
        processes = {"settling": settling, "shear": Shear(place, options.quick, options.seed),
                     "discharge": Discharge(place, options.quick, settling)}
        print(f"Gravier: {version()}\nLAMMPS: {lammps.source}")
        cores = "one core, user seconds" if options.ranks == 1 else f"{options.ranks} ranks, seconds on the clock"
        print(f"on {processor()}, {datetime.date.today().isoformat()}, {cores}\n", flush=True)
        for name in PARTS:
            if name in options.parts:
                study.play(processes[name])
            elif name == "settling" and "discharge" in options.parts:
                fill(settling, lammps)
        print("\n" + study.settings())
        if options.out:
            (place / "study_dem.md").write_text(study.table.markdown() + "\n" + study.settings(), encoding="utf-8")
            write_measured(place / "study_dem.csv", {name: [row[name] for row in study.rows] for name in study.rows[0]})
    if options.record:
        lammps.record()
    bounded = [row for row in study.table.rows if row[-1]]
    misses = study.table.misses
    if lammps.program is None:
        print("LAMMPS did not run: seconds are not compared.")
    print(f"{len(bounded) - len(misses)} of {len(bounded)} within their bounds")
    return 1 if misses else 0


def fill(settling, lammps):
    """The box that discharge begins with."""
    settling.prepare()
    if lammps.program:
        run_lammps(lammps.program, settling.place / "lammps", settling.script())
    run_gravier(settling.place / "gravier", *settling.case(settling.settings[0]))


if __name__ == "__main__":
    run_study(main)
