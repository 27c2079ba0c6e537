#!/usr/bin/env python3
"""Which of a directory of examples of LMGC90 import and run: each DATBOX below it by gravier_import, with the step, the number of steps and
the periods of the command script beside it.

    ./gravier study lmgc90 EXAMPLES [--out DIR] [--quick] [--steps N] [--seconds S] [--pylmgc90 PATH] [--only NAME...]

EXAMPLES is a directory such as examples/RIGID_2D of the sources of LMGC90. Each run makes at most N steps (200, quick 20) in at
most S seconds (120, quick 10). Where an example has a script gen_sample.py in the place of a DATBOX, the pre-processor of LMGC90
makes one in DIR: PATH is the directory that holds pylmgc90. Imports are made with --homogeneous, --drop-g0 and --slip 1e-4. Leaves
DIR/study_lmgc90.csv, the table DIR/study_lmgc90.md, cases and runs. The closing table compares with that of doc/lmgc90.md, without
the examples that want a pre-processor which is not there. Exit status: 0 all examples that import have run, and all that import there
do here; 1 one has not."""
import csv
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from oracle_table import Bounds
from study_support import BINARIES, ENVIRONMENT, SOURCE, OneLineParser, claimed, emptied, positive, run_study, sized, whole, write_csv


OPTIONS = ["--homogeneous", "--drop-g0", "--slip", "1e-4"]
FULL, QUICK = {"steps": 200, "seconds": 120.0}, {"steps": 20, "seconds": 10.0}
#: what an example lacks that is not tried
UNTRIED = "wants the pre-processor of LMGC90 (--pylmgc90)"
#: assignments of command scripts
NUMBER = r"^\s*(?:{})\s*=\s*([-+\d.eEdD/* ]+)"


def value_of(text, names):
    """The last number that a script assigns to one of the names; None where it assigns none."""
    found = re.findall(NUMBER.format(names), text, re.MULTILINE | re.IGNORECASE)
    try:
        # products and quotients of numbers, as `1./60`
        return float(eval(found[-1].lower().replace("d", "e"), {"__builtins__": {}})) if found else None
    except (NameError, SyntaxError, TypeError, ZeroDivisionError):
        return None


def command_of(folder):
    """Step [s], number of steps and periods of the command script of an example; None for what it does not say in numbers."""
    scripts = sorted(folder.glob("command*.py")) + sorted(folder.glob("run*.py"))
    text = scripts[0].read_text(encoding="latin-1") if scripts else ""
    called = re.sub(r"^\s*#.*$", "", text, flags=re.MULTILINE)
    periods = [value_of(text, f"{axis}periode?") or (value_of(text, "lx") if axis == "x" else None) for axis in "xy"] \
        if re.search(r"PeriodicCondition\(", called) else []
    return value_of(text, "dt"), value_of(text, "nb_?steps|nb_iter"), periods


def generate(folder, scratch, path):
    """Let a script of the pre-processor make the DATBOX of an example in a copy; where it is, or why there is none."""
    script = next(iter(sorted(folder.glob("gen*.py"))), None)
    if script is None:
        return None, "it has neither a DATBOX nor a script that makes one"
    if path is None:
        return None, f"{script.name} {UNTRIED}"
    if not scratch.exists():
        shutil.copytree(folder, scratch)
    (scratch / "DATBOX").mkdir(exist_ok=True)
    if (scratch / "DATBOX/BODIES.DAT").exists():
        return scratch, ""
    try:
        done = subprocess.run([sys.executable, script.name, "--novisu"], cwd=scratch, capture_output=True, text=True, check=False, timeout=300,
                              stdin=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": str(path.resolve()), "MPLBACKEND": "Agg"})
        said = (done.stderr.strip().splitlines() or [f"status {done.returncode}"])[-1]
    except subprocess.TimeoutExpired:
        said = "more than 300 s"
    return (scratch, "") if (scratch / "DATBOX/BODIES.DAT").exists() else (None, f"{script.name}: {said}")


def convert(folder, place, options):
    """Import an example; (step, steps wanted, steps of the run, what the importer says)."""
    step, wanted, periods = command_of(folder)
    steps = int(min(wanted or options.steps, options.steps))
    dimension = 2 if "RBDY2" in (folder / "DATBOX/BODIES.DAT").read_text(encoding="latin-1") else 3
    command = [sys.executable, str((BINARIES / "gravier_import").resolve()), str(folder / "DATBOX"), "--step", repr(step or 1e-3),
               "--steps", str(steps), "--out", "case", *OPTIONS]
    if periods and periods[0]:
        command += ["--period", *(repr(length or 0.0) for length in (periods + [0.0])[:dimension])]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    lines = done.stderr.strip().splitlines()
    said = next((line for line in lines if ": error: " in line), (lines or [""])[-1]).split(": error: ")[-1]
    # the file without the directories before it
    return step, wanted, steps, re.sub(r"^\S*/", "", said) if done.returncode else "", done.stdout.split(":")[0].strip()


def play(place, seconds):
    """Run the case; (status, last step)."""
    command = [str((BINARIES / "gravier").resolve()), "case.nml"]
    with open(place / "said.txt", "w", encoding="utf-8") as said:
        process = subprocess.Popen(command, cwd=place, stdout=said, stderr=said, stdin=subprocess.DEVNULL, env={**ENVIRONMENT, **os.environ})
        try:
            status = str(process.wait(timeout=seconds))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            status = f"stopped after {seconds:g} s"
    history = place / "case_results/history.csv"
    rows = list(csv.DictReader(history.open(encoding="utf-8"))) if history.exists() else []
    return status, int(rows[-1]["step"]) if rows else 0


def examples_of(root):
    """Directories with a DATBOX or a script that makes one."""
    found = {path.parent for path in root.rglob("DATBOX") if path.is_dir()}
    found |= {path.parent for path in root.rglob("gen*.py")} | {path.parent for path in root.rglob("command*.py")}
    return sorted(found)


def judge(folder, root, options):
    name = str(folder.relative_to(root.parent))
    place = options.out / name
    source, lacks = (folder, "") if (folder / "DATBOX/BODIES.DAT").exists() else generate(folder, options.out / "generated" / name, options.pylmgc90)
    row = {"example": name, "bodies": "", "imports": "no", "steps": "", "of": "", "status": "", "lacks": lacks}
    if source is None:
        return row
    emptied(place)
    step, wanted, steps, refused, made = convert(source, place, options)
    row["of"] = f"{wanted:g}" if wanted else "not said"
    if refused:
        row["lacks"] = refused
        return row
    row.update(imports="yes", bodies=made)
    row["status"], row["steps"] = play(place, options.seconds)
    if row["steps"] < steps:
        row["lacks"] = (place / "said.txt").read_text(encoding="utf-8").strip().splitlines()[-1][:300] if row["status"] not in ("0", "3") and \
            not row["status"].startswith("stopped") else ""
    row["lacks"] += "" if step else "step not in the script: 1e-3 s"
    return row


def accepted(rows):
    """The closing table."""
    page = "doc/lmgc90.md"
    there = set(re.findall(r"^\| (\S+) \| yes ", (SOURCE / page).read_text(encoding="utf-8"), re.MULTILINE))
    untried = [row["example"] for row in rows if row["example"] in there and row["lacks"].endswith(UNTRIED)]
    if untried:
        print(f"not tried, of the examples that import on the page: {len(untried)}, which {UNTRIED.replace('wants', 'want')}")
    known = [row for row in rows if row["example"] in there and row["example"] not in untried]
    imported = [row for row in rows if row["imports"] == "yes"]
    table = Bounds()
    table.add("examples", len(rows), 1, None, "one at least: a study of nothing shows nothing")
    table.add(f"examples that do not import, of {len(known)} that import on the page",
              sum(row["imports"] != "yes" for row in known), 0, 0, page)
    table.add(f"examples that make no step, of {len(imported)} that import", sum(not row["steps"] for row in imported), 0, 0,
              "what imports runs")
    table.add("examples that end with another status than 0, 3 or at the limit of seconds",
              sum(row["status"] not in ("0", "3") and not row["status"].startswith("stopped") for row in imported), 0, 0,
              "statuses of the program (doc/user_guide.md)")
    return table.close()


def main():
    parser = OneLineParser(prog="study_lmgc90", description=__doc__.splitlines()[0])
    parser.add_argument("examples", type=Path, nargs="+", help="directories of examples of LMGC90")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/lmgc90"), help="directory of the tables and runs; default: out/lmgc90")
    parser.add_argument("--quick", action="store_true", help="fewer steps")
    parser.add_argument("--steps", type=whole(1), help=f"most steps of a run ({FULL['steps']}, quick {QUICK['steps']})")
    parser.add_argument("--seconds", type=positive, help=f"most seconds of a run ({FULL['seconds']:g}, quick {QUICK['seconds']:g})")
    parser.add_argument("--pylmgc90", type=Path, help="directory that holds the Python package pylmgc90")
    parser.add_argument("--only", nargs="+", help="names of examples")
    options = sized(parser.parse_args(), FULL, QUICK)
    for root in options.examples:
        if not root.is_dir():
            parser.error(f"{root}: no such directory: expected examples of LMGC90, such as examples/RIGID_2D of its sources")
    options.out = options.out.resolve()
    claimed(options.out)
    rows = []
    for root in (root.resolve() for root in options.examples):
        for folder in examples_of(root):
            if options.only and folder.name not in options.only:
                continue
            rows.append(judge(folder, root, options))
            print(", ".join(f"{name} {value}" for name, value in rows[-1].items() if value != ""), flush=True)
    write_csv(options.out / "study_lmgc90.csv", {name: [row[name] for row in rows] for name in rows[0]} if rows else {})
    lines = ["| example | imports | steps | of | status | what it lacks |", "|---|---|---|---|---|---|"]
    lines += [f"| {row['example']} | {row['imports']}{': ' + row['bodies'] if row['bodies'] else ''} | {row['steps']} | {row['of']} | {row['status']} | "
              f"{row['lacks'].replace('|', '/')} |" for row in rows]
    imported = [row for row in rows if row["imports"] == "yes"]
    ran = [row for row in imported if row["steps"]]
    lines += ["", f"{len(imported)} of {len(rows)} examples import, {len(ran)} of these run."]
    (options.out / "study_lmgc90.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{lines[-1]} {options.out / 'study_lmgc90.md'}, from {SOURCE.name}")
    return accepted(rows)


if __name__ == "__main__":
    run_study(main)
