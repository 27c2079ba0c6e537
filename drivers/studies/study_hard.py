#!/usr/bin/env python3
"""The hard cases of tests/hard by every method, on 1 and 2 ranks: what converges, in how many iterations, and what does not.

    python3 drivers/studies/study_hard.py [--out DIR] [--cases REGEX] [--methods TITLE...] [--ranks 1 2] [--several METHOD] [--short]     30 minutes on two cores

leaves DIR/hard_cases.csv, a row a run, and DIR/hard_cases.md, the page with an overview of it. --short leaves out the long runs. With
--cases and --methods the rows of others that DIR/hard_cases.csv has already stay."""
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
from whole_file import whole_file  # noqa: E402

COLUMNS = ["case", "method", "ranks", "subdomains", "steps", "iterations", "residual", "energy_change", "overlap", "status", "wrong"]
#: methods that run the long cases at full length: minutes each
LONG = ("nlgs",)


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
            shutil.rmtree(directory, ignore_errors=True)
            long = case.long > 0 and title in LONG and ranks == 1 and not options.short
            played = play(case, title, groups, ranks, str(directory), long)
            wrong = played.complaints()
            if reference is None:
                reference = played
            elif played.figures is not None and played.figures.steps == reference.figures.steps:
                wrong += disagreement(reference, played)
            if wanted:
                rows.append(row(case, title, groups, ranks, played, wrong))
                options.failed += len(wrong)
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
    """The overview as Markdown: a line a case, with the methods of fewest and most iterations and how the others ended."""
    text = "\n| case | why it is hard | runs that converged | fewest, most iterations of all steps | how the others ended |\n"
    text += "|---|---|---:|---|---|\n"
    for name, case in cases().items():
        own = [r for r in rows if r["case"] == name]
        if not own:
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


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/hard"), help="default: out/hard")
    parser.add_argument("--cases", default="", help="names of cases that match")
    parser.add_argument("--methods", nargs="+", help="titles of the methods; all")
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--several", nargs="+", help="titles of the methods that run on more than the first of the ranks; all")
    parser.add_argument("--short", action="store_true", help="no long runs")
    parser.add_argument("--workers", type=int, default=2, help="cases side by side")
    options = parser.parse_args()
    options.failed = 0
    options.out.mkdir(parents=True, exist_ok=True)
    chosen = [case for name, case in cases().items() if re.search(options.cases, name)]
    found = gravier_runs.each(study, [(options, case) for case in chosen], options.workers)
    rows = joined(options.out / "hard_cases.csv", [r for several in found for r in several])
    with whole_file(options.out / "hard_cases.csv") as part, open(part, "w", encoding="ascii", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    head = (SOURCE / "doc" / "hard_cases.md").read_text(encoding="utf-8").split(MARK)[0] + MARK
    (options.out / "hard_cases.md").write_text(head + "\n" + page(rows), encoding="utf-8")
    converged = sum(r["status"] == "converged" for r in rows)
    print(f"{len(rows)} runs of {len({r['case'] for r in rows})} cases, {converged} that converged; "
          f"{options.failed} failures of this time")
    return 1 if options.failed else 0


MARK = "<!-- what follows is written by drivers/studies/study_hard.py -->"

if __name__ == "__main__":
    sys.exit(main())
