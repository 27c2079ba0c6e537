#!/usr/bin/env python3
"""Make a report of a run as one HTML page: whether it was right, what was asked, curves, pictures, where the time went, warnings."""
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "plot"), str(HERE.parent / "python")]
try:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    import gravier
except ImportError as missing:
    sys.exit(f"gravier_report: error: {missing}; expected a python3 with h5py, numpy and matplotlib")
import figures  # noqa: E402
import page  # noqa: E402
import verdict  # noqa: E402
from asked import asked_rows, changed_rows, key_reference  # noqa: E402
from gravier.histories import read_history  # noqa: E402
from one_line import OneLineParser, plain, run_tool  # noqa: E402
from run_log import STATUSES, RunLog  # noqa: E402
from whole_file import claim, written  # noqa: E402

#: end of the title of a page, and what a page begins with up to there
TITLE = "report of a run of Gravier"
PAGES = {".html": rb"(?si)<!doctype html>.*<title>[^<]*" + TITLE.encode() + b"</title>"}
#: warnings that are shown
MOST_WARNINGS = 40


class Folder:
    """What a run has left in its directory; files that are missing or damaged are named in `notes`."""

    def __init__(self, directory):
        self.directory, self.notes = Path(directory), []
        names = [name for name in ("run.log", "history.csv", "results.h5") if (self.directory / name).is_file()]
        if not names:
            raise gravier.ResultsError(f"{directory}: no run.log, history.csv or results.h5; expected the output directory of a run")
        text = ""
        try:
            text = (self.directory / "run.log").read_text(encoding="utf-8", errors="replace")
        except OSError as reason:
            self.notes.append(f"run.log: {reason.strerror}.")
        self.log = RunLog(text)
        self.history = self._read(lambda: read_history(self.directory), gravier.Table())
        self.run = self._read(lambda: gravier.Run(self.directory), None)
        if self.run:
            self._read(self._read_states, None)
        self._compare()
        last = max((self.directory / name).stat().st_mtime for name in names)
        self.written = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(last))

    def _read(self, read, otherwise):
        try:
            return read()
        except gravier.ResultsError as reason:
            self.notes.append(f"{reason}.")
            return otherwise

    def _read_states(self):
        """Read what pictures show, which finds damage."""
        for step in self.run.steps[[0, -1]] if len(self.run.steps) > 0 else []:
            self.run.bodies(step)
            self.run.boundaries(step)
            self.run.contacts(step)

    def _compare(self):
        """Note files that are of another run than the log: of one that has come to its end, they end with another step."""
        word, _ = self.log.end()
        last = self.log.last_step((self.options().get("time") or [{}])[0].get("steps"))
        reached = {"history.csv": self.history.step[-1:] if len(self.history) > 0 else (), "results.h5": self.run.steps[-1:] if self.run else ()}
        for name, steps in reached.items():
            # the last state may not have been kept
            if word == "finished" and last is not None and any(step > last or (name == "history.csv" and step < last) for step in steps):
                self.notes.append(f"run.log ends with step {last}, {name} with step {int(steps[0])}: they are not of one run.")

    def groups(self):
        """The case by groups, or the keys in force where results.h5 does not have it."""
        return self.run.case if self.run else self.log.options()

    def options(self):
        """Keys in force, or those of the case where the log does not have them, or is that of a restart without a step."""
        return self.groups() if self.run and self.log.is_idle() else self.log.options() or self.groups()

    def solvers(self):
        """First steps and keys of &solver of the starts of the run."""
        starts = self.run.starts[:-1] if self.run else []
        last = (self.run.starts[-1].step if self.run else 0, (self.options().get("solver") or [{}])[0])
        return [(start.step, (start.case.get("solver") or [{}])[0]) for start in starts] + [last]


def verdict_section(folder):
    log, found = folder.log, verdict.answers(folder.log, folder.history, folder.options(), folder.notes, folder.solvers())
    grade, sentence = verdict.headline(found, log)
    status = log.status()
    below = f"Exit status {status} by its last words: {page.text(STATUSES[status])}." if status is not None else "There is no exit status to tell of."
    rows = [(page.mark(answer.grade), ("question", page.text(answer.question)), ("answer", page.text(answer.text))) for answer in found]
    words = "\n".join(log.last_words())
    last = f"<h3>The last words of the log</h3><pre id=\"last-words\">{page.text(words)}</pre>" if words else ""
    return page.banner(grade, sentence, below) + page.table([], rows, "answers") + last


def asked_section(folder):
    log, groups = folder.log, folder.groups()
    facts = [(name, log.value(word)) for name, word in (("Case", "case"), ("Ranks", "ranks"), ("Bodies", "bodies"), ("Effects", "effects"))]
    facts += [("Program", "; ".join(log.version()))]
    if folder.run:
        facts += [("Command" if start.step == 0 else f"From step {start.step} on", start.command) for start in folder.run.starts]
    if log.restarts:
        facts += [("Restarts", f"{log.restarts}; what the log says of the end is since the last one")]
    facts += [("Last written", folder.written)]
    rows = [(("question", page.text(name)), page.text(value)) for name, value in facts if value]
    reference = key_reference()
    asked, usual = asked_rows(groups, reference)
    head = ["group", "key", "value", "unit", "default", "meaning"] if reference else ["group", "key", "value"]
    cells, group = [], None
    for row in asked:
        first = page.text(row[0]) if row[0] != group else ""
        group = row[0]
        cells.append([("key", f"<code>{first}</code>"), ("key", f"<code>{page.text(row[1])}</code>"), ("value", f"<code>{page.text(row[2])}</code>"),
                      *(page.text(cell) for cell in row[3:])][:len(head)])
    more = f"; {usual} more are given and have theirs" if usual else ""
    note = f"Keys whose values are not the defaults{more}." if reference else "Keys of the case."
    changed = [[("number", page.text(step)), *(("key", f"<code>{page.text(cell)}</code>") for cell in cells_of)]
               for step, *cells_of in changed_rows(folder.run.starts if folder.run else [], reference)]
    if changed:
        note = note[:-1] + ", as they are at the end; restarts have changed some."
    restarts = page.table(["from step", "group", "key", "before", "then"], changed, "changes") if changed else ""
    return page.table([], rows, "facts") + f'<p class="soft">{note}</p>' + page.table(head, cells, "keys") + restarts


def curves_section(folder):
    if len(folder.history) == 0:
        return "<p>history.csv has no step.</p>"
    dimension = folder.run.dimension if folder.run else int(verdict.number((folder.options().get("scene") or [{}])[0], "dimension", 2))
    groups = figures.curve_groups(folder.history, folder.solvers(), dimension)
    return "".join(page.figure(title, image) for title, image in groups)


def pictures_section(folder):
    if folder.run is None:
        return "<p>There is no results.h5 that can be read, and so no picture.</p>"
    try:
        states, why = figures.states(folder.run)
        profiles = figures.profiles(folder.run)
    except gravier.ResultsError as reason:
        return f"<p>No picture: {page.text(reason)}.</p>"
    if why:
        return f"<p>{page.text(why)}</p>"
    return (f'<div class="states">{"".join(page.figure(*one) for one in states)}</div>' + "".join(page.figure(*one) for one in profiles)
            + '<p class="soft">Pictures have one scale of colours. <code>gravier_plot</code> draws other steps and other colours.</p>')


def time_section(folder):
    log, phases = folder.log, folder.log.phases()
    facts = [(name, log.value(word)) for name, word in (("Whole run", "time"), ("To halve it", "to halve it"), ("Solver", "solver"), ("Cost", "cost"),
                                                        ("Memory", "memory"), ("Messages", "messages"), ("Neighbour lists", "lists"))]
    if not phases:
        spent = float(folder.history.wall_seconds.sum()) if "wall_seconds" in folder.history else 0.0
        return f"<p>The log has no table of times: it comes at the end of a run. The steps in history.csv took {spent:.3g} s.</p>"
    longest = phases[0][1] or 1.0
    rows = [(page.text(name), page.bar(mean / longest), ("number", f"{mean:.3g} s"), ("number", f"{share:.1f} %"),
             ("number", f"{least:.3g} to {most:.3g} s"))
            for name, mean, least, most, share in phases if mean > 0.0]
    table = page.table(["phase", "", "mean over ranks", "of the run", "least to most on a rank"], rows, "phases")
    return table + page.table([], [(("question", page.text(name)), page.text(value)) for name, value in facts if value], "costs")


def warnings_section(folder):
    found = folder.notes + folder.log.warnings()
    if not found:
        return "<p>None.</p>"
    more = f"<p>and {len(found) - MOST_WARNINGS} more in run.log.</p>" if len(found) > MOST_WARNINGS else ""
    counted = folder.log.value("warnings")
    said = f"<p>Counted by the program: {page.text(counted)}.</p>" if counted else ""
    return said + "<ul>" + "".join(f"<li>{page.text(line)}</li>" for line in found[:MOST_WARNINGS]) + "</ul>" + more


def report(folder):
    """The page."""
    scene = (folder.groups().get("scene") or [{}])[0]
    title = scene.get("title") or folder.log.value("case").split("  ")[0] or folder.directory.resolve().name
    head = f'<p class="soft">Report of a run of Gravier, <code>{page.text(folder.directory)}</code></p><h1>{page.text(title)}</h1>'
    sections = [("verdict", "", head + verdict_section(folder)), ("asked", "What was asked", asked_section(folder)),
                ("pictures", "Pictures", pictures_section(folder)), ("curves", "Curves", curves_section(folder)),
                ("time", "Where the time went", time_section(folder)), ("warnings", "Warnings", warnings_section(folder))]
    return page.page(f"{title}: {TITLE}", sections)


def main(arguments=None):
    parser = OneLineParser(prog="gravier_report", description=__doc__)
    parser.add_argument("directory", type=Path, metavar="OUT", help="output directory of a run: finished, failed, or under way")
    parser.add_argument("-o", "--out", type=Path, metavar="FILE", help="the page (report.html in OUT)")
    options = parser.parse_args(arguments)
    plt.rcParams.update({"font.size": 9})
    out = options.out or options.directory / "report.html"
    claim(out, PAGES)
    try:
        text = report(Folder(options.directory))
    except gravier.ResultsError as reason:
        print(f"gravier_report: error: {plain(reason)}", file=sys.stderr)
        return 2
    with written(out, PAGES) as part:
        part.write_text(text, encoding="utf-8")
    print(out)
    return 0


if __name__ == "__main__":
    run_tool(main)
