#!/usr/bin/env python3
"""Small scenes that are hard to solve, by every method, on 1 and 2 ranks: what converges, in how many iterations, and what does not.

    ./gravier study hard [--out DIR] [--cases REGEX] [--methods TITLE...] [--ranks 1 2] [--several METHOD] [--short]
    ./gravier study hard --quick [--out DIR]

leaves DIR/hard_cases.csv, a row a run, and DIR/hard_cases.md, the page with an overview of it. --short leaves out the long runs.
--quick takes three methods on one rank, without the long runs and the cases with slow solves. With --cases and --methods the rows
of others that DIR/hard_cases.csv has already stay. The closing table has the failures of this run, and the solves that the table of
the page has and this run has not. Exit status: 0 there are none; 1 there are."""
import argparse
import csv
import re
import shutil
import sys
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(SOURCE / "tests" / "hard"), str(SOURCE / "tests" / "support")]
import gravier_runs  # noqa: E402
from hard_cases import cases, disagreement, methods_of, play  # noqa: E402
from oracle_table import Bounds  # noqa: E402
from study_support import OneLineParser, claimed, emptied, run_study, sized, whole  # noqa: E402
from whole_file import whole_file  # noqa: E402

COLUMNS = ["case", "method", "ranks", "subdomains", "steps", "iterations", "residual", "energy_change", "overlap", "status", "wrong"]
#: methods that run the long cases at full length: minutes each
LONG = ("nlgs",)
FULL = {"ranks": [1, 2]}
QUICK = {"ranks": [1], "methods": ["nlgs", "nscdd, accelerated", "nscdd_ep"]}


def row(case, title, groups, ranks, played, wrong):
    figures = played.figures
    found = dict.fromkeys(COLUMNS, "")
    found.update(case=case.name, method=title, ranks=ranks, status="refused", wrong="; ".join(wrong),
                 subdomains=case.subdomains if groups["solver"]["method"] != "nlgs" else 1)
    if figures is not None:
        found.update(steps=figures.steps, iterations=figures.iterations, residual=f"{figures.residual:.1e}",
                     energy_change=f"{figures.energy:.1e}", overlap=f"{figures.overlap:.1e}", status=figures.words)
    return found


def study(options, case):
    """Rows of a case."""
    reference, rows = None, []
    for title, groups in methods_of(case).items():
        wanted = not options.methods or title in options.methods
        # the first one is what the others are compared with
        if not wanted and reference is not None:
            continue
        several = groups["solver"]["method"] != "nlgs" and (not options.several or title in options.several)
        for ranks in options.ranks if several and wanted else options.ranks[:1]:
            directory = options.out / "runs" / re.sub(r"\W+", "_", f"{case.name} {title} {ranks}")
            emptied(directory)
            long = case.long > 0 and title in LONG and ranks == 1 and not options.short
            played = play(case, title, groups, ranks, str(directory), long)
            wrong = played.complaints()
            options.broken.append((case.name, title, ranks) if wrong else None)
            if reference is None:
                reference = played
            elif played.figures is not None and played.figures.steps == reference.figures.steps:
                apart = disagreement(reference, played)
                options.apart.append(bool(apart))
                wrong += apart
            if wanted:
                rows.append(row(case, title, groups, ranks, played, wrong))
                print(*rows[-1].values(), sep=", ", flush=True)
            if played is not reference:
                shutil.rmtree(directory, ignore_errors=True)
    shutil.rmtree(reference.run.directory, ignore_errors=True)
    return rows


def joined(path, rows):
    """New rows and those of the file of cases and methods that were not run, in the order of the cases and their methods."""
    if path.exists():
        with open(path, encoding="ascii", newline="") as file:
            done = {(r["case"], r["method"]) for r in rows}
            rows = rows + [r for r in csv.DictReader(file) if (r["case"], r["method"]) not in done]
    order = [(name, title) for name, case in cases().items() for title in methods_of(case)]
    rows = [r for r in rows if (r["case"], r["method"]) in order]
    return sorted(rows, key=lambda r: (order.index((r["case"], r["method"])), int(r["ranks"])))


def page(rows):
    """The overview as Markdown: the names of the cases that all methods solve, and of each other case a line with the methods of fewest and most
    iterations and how the others ended."""
    known = {name: [r for r in rows if r["case"] == name] for name in cases()}
    solved = [name for name, own in known.items() if own and all(r["status"] == "converged" and not r["wrong"] for r in own)]
    text = f"\nAll methods that serve them solve {len(solved)} of the {sum(map(bool, known.values()))} cases: {'; '.join(solved)}. These are the others:\n" if solved else ""
    text += "\n| case | why it is hard | runs that converged | fewest, most iterations of all steps | how the others ended |\n"
    text += "|---|---|---:|---|---|\n"
    for name, case in cases().items():
        own = known[name]
        if not own or name in solved:
            continue
        converged = sorted((int(r["iterations"]), r["method"]) for r in own if r["status"] == "converged")
        ends = {}
        for r in own:
            if r["status"] != "converged" or r["wrong"]:
                words = r["status"] + (f" **{r['wrong']}**" if r["wrong"] else "")
                methods = ends.setdefault(re.sub(r"\d+ of", "some of", words) if "steps" in words else words, [])
                if r["method"] not in methods:
                    methods.append(r["method"])
        count = ""
        if converged:
            count = f"{converged[0][0]} ({converged[0][1]})"
            if converged[-1][0] != converged[0][0]:
                count += f", {converged[-1][0]} ({converged[-1][1]})"
        others = "; ".join(f"{words}: {'; '.join(methods)}" if len(methods) < 5 else f"{words}: {len(methods)} methods"
                           for words, methods in ends.items())
        text += f"| {name} | {case.hard} | {len(converged)} of {len(own)} | {count} | {others} |\n"
    return text


def accepted(options, rows):
    """The closing table, of the runs of this time."""
    page = "doc/hard_cases.md"
    with open(SOURCE / "doc/figures/hard_cases.csv", encoding="ascii", newline="") as file:
        page_rows = {(r["case"], r["method"], int(r["ranks"])): r for r in csv.DictReader(file)}
    stored = {key for key, r in page_rows.items() if r["status"] == "converged"}
    broken = [key for key in options.broken if key and not page_rows.get(key, {"wrong": ""})["wrong"]]
    for key in broken:
        print(f"fails, but not in the table of the page: {', '.join(map(str, key))} ranks")
    known = [r for r in rows if (r["case"], r["method"], int(r["ranks"])) in stored]
    lost = [r for r in known if r["status"] != "converged"]
    for r in lost:
        print(f"did not converge, but does in the table of the page: {r['case']}, {r['method']}, {r['ranks']} ranks: {r['status']}")
    table = Bounds()
    table.add(f"runs that break a law or end otherwise than they may, beyond those of the page, of {len(options.broken)}",
              len(broken), 0, 0,
              f"{page}, What is checked, and Limits")
    table.add(f"runs whose velocities are unique and differ from those of the first method, of {len(options.apart)}",
              sum(options.apart), 0, 0,
              f"{page}, What is checked")
    table.add(f"runs that do not converge, of {len(known)} that do in the table of the page", len(lost), 0, 0,
              "doc/figures/hard_cases.csv")
    return table.close()


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/hard"), help="default: out/hard")
    parser.add_argument("--quick", action="store_true", help="three methods on one rank, short cases")
    parser.add_argument("--cases", default="", help="names of cases that match")
    parser.add_argument("--methods", nargs="+", help="titles of the methods; all")
    parser.add_argument("--ranks", type=whole(1), nargs="+", help="numbers of ranks; 1 2")
    parser.add_argument("--several", nargs="+", help="titles of the methods that run on more than the first of the ranks; all")
    parser.add_argument("--short", action="store_true", help="no long runs")
    parser.add_argument("--workers", type=whole(1), default=2, help="cases side by side")
    options = sized(parser.parse_args(), FULL, QUICK)
    options.short = options.short or options.quick
    options.broken, options.apart = [], []
    try:
        re.compile(options.cases)
    except re.error as error:
        parser.error(f"--cases {options.cases}: expected a regular expression: {error}")
    chosen = [case for name, case in cases().items() if re.search(options.cases, name) and not (options.quick and case.slow)]
    if not chosen:
        parser.error(f"--cases {options.cases}: no case has a name that matches")
    titles = {title for case in chosen for title in methods_of(case)}
    unknown = [title for title in options.methods or [] if title not in titles]
    if unknown:
        parser.error(f"--methods {unknown[0]}: expected one of {'; '.join(sorted(titles))}")
    claimed(options.out)
    found = gravier_runs.each(study, [(options, case) for case in chosen], options.workers)
    made = [r for several in found for r in several]
    rows = joined(options.out / "hard_cases.csv", made)
    with whole_file(options.out / "hard_cases.csv") as part, open(part, "w", encoding="ascii", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    head = (SOURCE / "doc" / "hard_cases.md").read_text(encoding="utf-8").split(MARK)[0] + MARK
    (options.out / "hard_cases.md").write_text(head + "\n" + page(rows), encoding="utf-8")
    converged = sum(r["status"] == "converged" for r in rows)
    print(f"{len(rows)} runs of {len({r['case'] for r in rows})} cases, {converged} that converged")
    return accepted(options, made)


MARK = "<!-- what follows is written by drivers/studies/study_hard.py -->"

if __name__ == "__main__":
    run_study(main)
