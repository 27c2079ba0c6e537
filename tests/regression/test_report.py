"""gravier_report: the page says what the files of a run say, of runs that end well, badly or not at all; it loads nothing; a browser shows
it without overlaps and within its window, wide and narrow.

A browser is looked for as $GRAVIER_BROWSER, chromium, chromium-browser or google-chrome; without one the test says so and is skipped."""
import base64
import contextlib
import html
import html.parser
import io
import json
import os
import re
import shutil
import subprocess
import sys
import unittest
import unittest.mock

import h5py
import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
from gravier_runs import SOURCE, RunTestCase, merged

import gravier

sys.path.insert(0, os.path.join(SOURCE, "drivers/report"))
import gravier_report  # noqa: E402
import figures  # noqa: E402
from asked import is_default  # noqa: E402
from run_log import RunLog  # noqa: E402
import verdict  # noqa: E402

BROWSER = os.environ.get("GRAVIER_BROWSER") or next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
CASE = {"scene": {"title": "disks <in> a box & a lid", "bodies": "lattice", "lattice_count": [6, 6], "radius_min": 0.008, "radius_max": 0.012,
                  "friction": 0.3, "density": 2500.0},
        "boundary": [{"name": "lid", "shape": "plane", "point": [0.0, 0.3], "normal": [0.0, -1.0], "velocity": [0.0, -0.2]}],
        "region": [{"name": "layers", "axis": "y", "bins": 4}],
        "time": {"step": 1e-3, "steps": 120},
        "output": {"directory": "results", "every": 60, "energy": True, "stress": True, "boundary_forces": True}}
#: solves that end far too soon
POOR = merged(CASE, {"scene": {"title": ""}, "boundary": [], "region": [], "solver": {"max_iterations": 3, "accuracy": 1e-6},
                     "output": {"energy": None, "stress": None, "boundary_forces": None}})
#: measures the page within the browser: the test reads what it leaves in the document
MEASURE = """<script>window.addEventListener('load', () => {
  const box = (one) => { const r = one.getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom]; };
  const found = { across: document.documentElement.scrollWidth, window: window.innerWidth,
    images: [...document.images].map((one) => [one.complete, one.naturalWidth, ...box(one)]),
    blocks: [...document.querySelectorAll('section > *')].map(box) };
  const place = document.createElement('pre'); place.id = 'measured'; place.textContent = JSON.stringify(found);
  document.body.append(place); });</script>"""


def undrawn(figure, words, dpi=120):
    """In place of a picture of a report: an element that shows nothing."""
    plt.close(figure)
    return f'<img src="data:image/png;base64," alt="{html.escape(words)}">'


class Page(html.parser.HTMLParser):
    """Elements of a page: text by identifier, cells of tables, headings, pictures, whatever it would load."""

    def __init__(self, text):
        super().__init__()
        self.open, self.text, self.rows, self.headings, self.images, self.loads, self.alt = [], {}, {}, [], [], [], []
        self.attributes, self.widths = {}, []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        identifier = attributes.get("id")
        if identifier:
            self.attributes[identifier] = attributes
        if tag == "img":
            self.images.append(attributes["src"])
            self.alt.append(attributes.get("alt", ""))
        self.loads += [value for name, value in attributes.items()
                       if name in ("src", "href", "data", "action") and not re.match("#|data:image/png", value)]
        self.loads += [tag] if tag in ("script", "link", "iframe", "object") else []
        width = re.fullmatch(r"width:([\d.]+)%", attributes.get("style", ""))
        if width:
            self.widths.append(float(width[1]))
        if tag in ("meta", "img", "br"):
            return
        self.open.append((tag, identifier))
        if tag == "tr":
            self.rows.setdefault(self.inside("table"), []).append([])
        if tag == "td":
            self.rows[self.inside("table")][-1].append("")

    def inside(self, tag):
        return next((identifier for name, identifier in reversed(self.open) if name == tag), None)

    def handle_endtag(self, tag):
        assert self.open[-1][0] == tag, f"</{tag}> ends {self.open[-1]}"
        self.open.pop()

    def handle_data(self, data):
        for _, identifier in self.open:
            if identifier:
                self.text[identifier] = self.text.get(identifier, "") + data
        if any(name == "td" for name, _ in self.open):
            self.rows[self.inside("table")][-1][-1] += data
        if self.open and self.open[-1][0] in ("h1", "h2"):
            self.headings.append(data)


class Report(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        if gravier.run(CASE, cls.here(cls, "good")) != 0:
            raise AssertionError("the run did not converge")
        if gravier.run(POOR, cls.here(cls, "poor")) != 3:
            raise AssertionError("the run converged")
        cls.good = None

    def good_page(self):
        """The page of the good run, made once."""
        if Report.good is None:
            Report.good = self.page_of(self.here("good/results"))
        return Report.good

    def report(self, *arguments):
        """Status and text of gravier_report."""
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            try:
                status = gravier_report.main(list(arguments))
            except SystemExit as end:
                status = end.code
        return status, said.getvalue()

    def page_of(self, directory, drawn=True):
        """The page of a run; it loads nothing, and each picture is one, with words for who does not see it. Pictures that are the same
        as of another run need not be drawn, which takes nine tenths of the time."""
        place = os.path.dirname(directory) if os.path.basename(directory) == "results" else directory
        out = self.here(f"{os.path.basename(place)}.html")
        with contextlib.ExitStack() as instead:
            if not drawn:
                instead.enter_context(unittest.mock.patch.object(figures, "picture", undrawn))
                instead.enter_context(unittest.mock.patch.object(figures, "draw_panels", lambda *_, **__: plt.figure()))
            status, said = self.report(directory, "-o", out)
        self.assertEqual((status, said), (0, out + "\n"))
        with open(out, encoding="utf-8") as file:
            text = file.read()
        page = Page(text)
        self.assertEqual((page.open, page.loads), ([], []))
        self.assertIn("default-src 'none'", text)
        for image in page.images if drawn else ():
            pixels = matplotlib.image.imread(io.BytesIO(base64.b64decode(image.split(",", 1)[1])), format="png")
            self.assertGreater(min(pixels.shape[:2]), 150)
            self.assertGreater(pixels[:, :, :3].std(), 0.02, "a blank picture")
        self.assertTrue(all(page.alt))
        return page

    def answer(self, page, question):
        return next(row for row in page.rows["answers"] if row[1].startswith(question))

    def test_good(self):
        page, log = self.good_page(), gravier.Run(self.here("good/results"))
        self.assertEqual(page.headings, ["disks <in> a box & a lid", "What was asked", "Pictures", "Curves", "Where the time went", "Warnings"])
        self.assertEqual(page.attributes["headline"]["data-grade"], "good", page.text["headline"])
        self.assertIn("Exit status 0 by its last words: done, every solve converged.", page.text["headline"])
        self.assertEqual([row[0] for row in page.rows["answers"]], ["✓"] * 5)
        self.assertEqual(self.answer(page, "Did it come")[2], "Yes: 120 of 120 steps.")
        history = log.history()
        worst = (history.velocity_error / history.velocity_scale).max()
        self.assertIn(f"at most {worst:.2g} of U", self.answer(page, "Was the accuracy")[2])
        self.assertIn(f"was {history.max_overlap.max():.2g} m", self.answer(page, "Were overlaps")[2])
        # start and end, a profile, four groups of curves
        self.assertEqual(len(page.images), 2 + 1 + 4)
        with open(self.here("good/results/run.log"), encoding="utf-8") as file:
            said = file.read()
        self.assertTrue(said.endswith(page.text["last-words"] + "\n"))
        self.assertIn("\nconverged ", page.text["last-words"])
        self.assertNotIn("sweeps            ", page.text["last-words"])

    def test_balance(self):
        """A balance that is off by a part of its terms is none."""
        for off, grade in (("1.0E-13", "good"), ("1.0E-03", "doubt"), ("2.1E+00", "bad")):
            (answer,) = verdict.balanced(RunLog(f"energy      balance off by {off} J; the sizes of its terms sum up to 2.09E+00 J\n"))
            self.assertEqual(answer.grade, grade)
            self.assertNotIn("since", answer.text)
        self.assertEqual(verdict.balanced(RunLog("")), [])
        (answer,) = verdict.balanced(RunLog(2 * "Gravier 0.1.0 (a), dense\n" + "energy      balance off by 0.0 J; the sizes of its terms sum up to 1.0 J\n"))
        self.assertIn("since the last restart", answer.text)

    def test_other_doubts(self):
        """What the last words doubt and no other question asks for is marked; what is harmless or has its own question is not."""
        log = "Gravier 0.1.0 (a), dense\nfinished    all 9 steps reached the accuracy; overlaps came to 0.3 of the mean radius; 2 grains had fallen below all boundaries; results in r\n"
        (answer,) = verdict.doubted(RunLog(log))
        self.assertEqual((answer.grade, answer.text), ("doubt", "Yes: 2 grains had fallen below all boundaries."))
        self.assertEqual(verdict.doubted(RunLog(log.replace("2 grains had fallen below all boundaries; ", ""))), [])

    def test_rows_that_are_left_out(self):
        """The largest overlap and velocity error are those of the run, of all starts, where history.csv has other steps: the log has them."""
        history = gravier.results.Table(step=np.array([100]), max_overlap=np.array([1e-4]), projected=np.zeros(1), velocity_error=np.array([1e-3]),
                                        velocity_scale=np.array([1e-1]), converged=np.ones(1))
        start = "Gravier 0.1.0 (a), dense\naccuracy    velocity error at most {} of U at the end of a solve, accuracy 1.00E-01; residual at most 1E-2\n" \
                "overlaps    in the first step at most {} m, later at most {} m, 7.0E-02 of the mean radius\n"
        by_residual = {"criterion": "residual"}
        for starts, solver, error, overlap, grade in (
                ([("9.0E-03", "0.0E+00", "7.14E-05")], {}, "0.01", "0.0001", "good"),
                ([("9.00E-02", "3.0E-05", "7.14E-04")], {}, "0.09", "0.00071", "good"),
                ([("1.68E+00", "3.0E-03", "7.14E-04")], {}, "1.7", "0.003", "doubt"),
                ([("5.0E-02", "0.0E+00", "9.00E-03"), ("9.0E-02", "0.0E+00", "7.14E-04")], {}, "0.09", "0.009", "good"),
                ([("9.0E-02", "0.0E+00", "0.0E+00")], by_residual, "0.09", "0.0001", "good"),
                ([("1.68E+00", "0.0E+00", "0.0E+00")], by_residual, "1.7", "0.0001", "bad")):
            log = RunLog("".join(start.format(*values) for values in starts))
            said = verdict.accurate(log, history, [(0, solver)])
            self.assertIn(f"the velocity error was at most {error} of U", said.text)
            self.assertEqual(said.grade, grade, starts)
            self.assertIn(f"The largest overlap was {overlap} m", verdict.projected(log, history).text)

    def test_projected(self):
        """Projections are judged as the last words judge them, by how often and how far they shift grains; those before a restart count."""
        def history(steps, projected):
            table = gravier.results.Table(step=np.arange(1, steps + 1), max_overlap=np.full(steps, 1e-4), projected=np.zeros(steps))
            table["projected"][:projected] = 1
            return table
        often = "            projected in 30 of 100 steps (30 %): shifts of a grain add up to 1.0E-09 m on average, {} of its path of 1.0E-03 m\n"
        seldom = often.replace("30 of", "3 of").replace("(30 %)", "(3 %)")
        none = "            no step projected overlaps\n"
        head = "Gravier 0.1.0 (a), dense\n"
        restart = 2 * head + "restart     from the checkpoint of step 200\n"
        for text, steps, projected, grade, words in (
                (head + often.format("1.8E-07"), 100, 30, "good", "Often, but by too little to matter: projected in 30 of 100 steps"),
                (head + often.format("2.0E-03"), 100, 30, "doubt", "Yes, often: projected in 30 of 100 steps"),
                (head + often.format("2.0E-02"), 100, 30, "bad", "Yes, often: projected in 30 of 100 steps"),
                (head + seldom.format("1.8E-07"), 100, 3, "good", "A little: projected in 3 of 100 steps"),
                (head + seldom.format("2.0E-02"), 100, 3, "doubt", "A little: projected in 3 of 100 steps"),
                (head + none, 100, 100, "good", "No step projected overlaps"),
                (head, 100, 30, "doubt", "Yes, often: projected in 30 % of the steps"),
                (restart + none, 300, 42, "doubt", "Yes, often: before the restart, projected in 21 % of 200 steps"),
                (restart + seldom.format("1.8E-07"), 300, 0, "good", "A little: projected in 3 of 100 steps"),
                (restart + often.format("2.0E-02"), 300, 2, "bad", "before the restart, projected in 1 % of 200 steps")):
            answer = verdict.projected(RunLog(text), history(steps, projected))
            self.assertEqual(answer.grade, grade, text)
            self.assertIn(words, answer.text)

    def test_depth(self):
        """Overlaps that are deep are no good sign, though none was projected."""
        history = gravier.results.Table(step=np.arange(1, 5), max_overlap=np.full(4, 1e-4), projected=np.zeros(4))
        for depth, grade in (("1.9E-02", "good"), ("2.1E-02", "doubt"), ("9.0E-02", "doubt"), ("4.8E-01", "bad")):
            answer = verdict.projected(RunLog(f"overlaps    in the first step at most 0.00E+00 m, later at most 4.80E-03 m, {depth} of the mean radius\n"
                                              "            no step projected overlaps\n"), history)
            self.assertEqual(answer.grade, grade, answer.text)
            self.assertEqual(f"{depth} of the mean radius" in answer.text, grade != "good")
            self.assertEqual(answer.text.rsplit(": ", 1)[-1] if grade != "good" else "", {
                "good": "", "doubt": f"{depth} of the mean radius. Half of the step shows whether the results depend on it.",
                "bad": f"{depth} of the mean radius. Take a smaller step."}[grade])

    def test_axes_of_places(self):
        """Curves of places fit their panel, wherever 0 is; those of forces do not."""
        table = gravier.results.Table({"time": np.arange(4.0), "force_y:lid": np.arange(1.0, 5.0), "position_y:lid": np.array([0.3, 0.2, 0.1, 0.01])})
        self.assertEqual([(panel.label, panel.places) for panel in figures.boundary_panels(table)], [("force along y [N]", False), ("position along y [m]", True)])

    def test_shear(self):
        """A sheared cell has its shear stresses and its deformation among the curves; what stays 0 is left out."""
        table = gravier.results.Table(time=np.arange(3.0), stress_xx=np.ones(3), stress_xy=np.ones(3), stress_yx=np.ones(3), stress_yy=np.ones(3),
                                      pressure=np.ones(3), cell_strain_x=np.zeros(3), cell_strain_y=np.arange(3.0), cell_shear_xy=np.arange(3.0))
        self.assertEqual([(panel.label, [name for *_, name in panel.curves]) for panel in figures.stress_panels(table, 2)],
                         [("stress [N/m]", ["xx", "yy", "xy", "pressure"]), ("deformation of the cell", ["strain y", "shear xy"])])

    def test_steps_above_the_goal(self):
        """One step that missed its goal is one step, not steps; what missed something else is said beside it."""
        for above, missed, words in ((2, 2, "It was above this goal in 2 steps."), (1, 1, "It was above this goal in 1 step."),
                                     (1, 2, "It was above this goal in 1 step, and in 1 more what else the criterion asks for was missed.")):
            step = np.arange(1, 5)
            history = gravier.results.Table(step=step, velocity_error=np.where(step <= above, 2e-3, 1e-4), velocity_scale=np.full(4, 1e-2), converged=step > missed)
            answer = verdict.accurate(RunLog("Gravier 0.1.0 (a), dense\n"), history, [(0, {})])
            self.assertEqual(answer.grade, "bad")
            self.assertTrue(answer.text.endswith(words), answer.text)

    def test_drift(self):
        """Motion below the errors of solves casts doubt on an accuracy that was reached."""
        history = gravier.results.Table(step=np.arange(1, 5), velocity_error=np.full(4, 1e-4), velocity_scale=np.full(4, 1e-2), converged=np.ones(4))
        said = "in 4 of 4 steps bodies moved no faster than twice the velocity error of the solve, and came 0.42 mean diameters away as a whole"
        for text, grade in (("", "good"), (f"drift       {said}\n            that motion may be nothing but errors\n", "doubt")):
            answer = verdict.accurate(RunLog("Gravier 0.1.0 (a), dense\n" + text), history, [(0, {})])
            self.assertEqual(answer.grade, grade, answer.text)
            self.assertEqual(said in answer.text, grade == "doubt")

    def test_too_fast(self):
        """What moved too far for the step is marked, as the last words have it."""
        table = gravier.results.Table(step=np.arange(1, 5), fast=np.array([0, 3, 1, 0]))
        (answer,) = verdict.too_fast(table)
        self.assertEqual(answer.grade, "doubt")
        self.assertIn("4 times something moved by more than half of its thickness in a step, in 2 steps", answer.text)
        table["fast"][:] = [0, 0, 1, 0]
        self.assertIn("Not always: 1 time something moved by more than half of its thickness in a step, in 1 step.", verdict.too_fast(table)[0].text)
        table["fast"][:] = 0
        self.assertEqual(verdict.too_fast(table), [])

    def test_what_was_asked(self):
        """Keys with other values than the defaults, with units, defaults and meanings; a density that is the default is left out."""
        page = self.good_page()
        rows = {row[1]: row for row in page.rows["keys"] if row}
        self.assertEqual(rows["friction"][2:5], ["0.3", "", "0.0"])
        self.assertEqual(rows["radius_min"][2:5], ["0.008", "m", "required"])
        self.assertEqual(rows["velocity"][2], "0.0, -0.2")
        self.assertIn("steps between two written states", rows["every"][5])
        self.assertEqual("density" in rows, not is_default("density", 2500.0, self.default("density")))
        self.assertIn("&boundary lid", [row[0] for row in page.rows["keys"] if row])
        facts = dict(page.rows["facts"])
        self.assertIn("36 grains, 4 boundaries", facts["Bodies"])
        self.assertTrue(facts["Ranks"].startswith("1, subdomains 1"))
        self.assertTrue(is_default("restitution", 0.0, "`0.0`") and is_default("body_force", [0.0, 0.0], "`3*0`"))
        self.assertFalse(is_default("restitution", 0.1, "`0.0`") or is_default("steps", 3, "required") or is_default("lower(2)", 0.0, "`0.0`"))

    def default(self, key):
        return gravier_report.key_reference()["scene", key][1]

    def test_where_the_time_went(self):
        """Phases of the log, the dearest first, with bars as long as they are dear."""
        page = self.good_page()
        with open(self.here("good/results/run.log"), encoding="utf-8") as file:
            table = {row[1].strip(): float(row[2]) for row in re.finditer(r"^(\S.{27})\s*([\d.]+)\s+[\d.]+\s+[\d.]+\s+[\d.]+ %$", file.read(), re.M)}
        rows = [row for row in page.rows["phases"] if row]
        shown = [row[0] for row in rows]
        self.assertGreater(len(shown), 5)
        self.assertEqual(sorted(shown), sorted(name for name, seconds in table.items() if seconds > 0.0))
        seconds = np.array([table[name] for name in shown])
        self.assertTrue(np.all(np.diff(seconds) <= 0.0))
        np.testing.assert_allclose(page.widths[:len(shown)], 100.0 * seconds / seconds[0], atol=0.06)
        self.assertIn("MiB on a rank", dict(page.rows["costs"])["Memory"])

    def test_poor(self):
        page = self.page_of(self.here("poor/results"))
        self.assertEqual(page.attributes["headline"]["data-grade"], "bad")
        self.assertIn("Exit status 3 by its last words: a solve did not converge.", page.text["headline"])
        row = self.answer(page, "Did every solve")
        self.assertEqual(row[0], "✗")
        self.assertRegex(row[2], r"^NO: \d+ of 120 solves did not reach the accuracy 1.00E-06")
        history = gravier.Run(self.here("poor/results")).history()
        missed = history.converged == 0
        above = (missed & (history.velocity_error > 1e-6 * history.velocity_scale)).sum()
        self.assertIn(f"with a goal of 1e-06. It was above this goal in {above} steps", self.answer(page, "Was the accuracy")[2])
        # a solve may miss another condition of the criterion
        self.assertEqual(f"and in {missed.sum() - above} more" in self.answer(page, "Was the accuracy")[2], missed.sum() > above)
        self.assertIn("NOT CONVERGED", page.text["warnings"])
        self.assertEqual(page.headings[0], "case.nml")

    def test_under_way(self):
        """A run that was cut off: no table of times, no last state, no verdict; and one of which nothing but a log is left."""
        place = self.here("cut")
        os.makedirs(place)
        with open(self.here("good/results/run.log"), encoding="utf-8") as file:
            lines = file.read().split("\nphase ")[0].splitlines()
        with open(os.path.join(place, "run.log"), "w", encoding="utf-8") as file:
            file.write("\n".join(lines[:-3]) + "\n")
        self.assertIn("There is no results.h5", self.page_of(place).text["pictures"])
        with open(self.here("good/results/history.csv"), encoding="utf-8") as file:
            rows = file.read().splitlines()
        with open(os.path.join(place, "history.csv"), "w", encoding="utf-8") as file:
            file.write("\n".join(rows[:41]) + "\n12,0.0")
        page = self.page_of(place)
        self.assertEqual(page.attributes["headline"]["data-grade"], "bad", "results.h5 is missing")
        self.assertIn("This run has not come to its end. There is no exit status", page.text["headline"].replace("end.There", "end. There"))
        self.assertIn("It has made 40 of 120 steps.", self.answer(page, "Did it come")[2])
        self.assertEqual(self.answer(page, "Did every solve")[2], "Yes, all 40 solves so far.")
        self.assertIn("no table of times", page.text["time"])
        # keys come from the log, which has all of them
        self.assertIn("friction", [row[1] for row in page.rows["keys"] if row])
        self.assertEqual(len(page.images), 4)

    def test_ends(self):
        """The status that each last line belongs to; after a restart, that of the last part."""
        head = "Gravier 0.1.0 (abc), dense\nbuilt by x\n"
        for last, status in (("finished    all 3 steps reached the accuracy; results in x", 0), ("finished    *** 1 of the steps did NOT reach", 3),
                             ("interrupted *** by SIGTERM after step 3", 4), ("stopped     *** by an error after 3 steps", 4),
                             ("lost        *** files of this run", 4), ("       3   1.0E-3", None)):
            self.assertEqual(RunLog(f"{head}{last}\n").status(), status, last)
        log = RunLog(f"{head}interrupted *** by SIGTERM\n{head}finished    all 9 steps\n")
        self.assertEqual((log.status(), log.restarts), (0, 1))

    def test_damaged_and_refused(self):
        place = self.here("damaged")
        shutil.copytree(self.here("good/results"), place)
        with h5py.File(os.path.join(place, "results.h5"), "r+") as file:
            file["steps/120/bodies/position"][0, 0] += 1.0
        page = self.page_of(place, drawn=False)
        self.assertIn("its attribute checksum is not that of what it holds", page.text["pictures"])
        self.assertIn("its attribute checksum", self.answer(page, "Are its files")[2])
        with h5py.File(os.path.join(place, "results.h5"), "r+") as file:
            del file["steps/120/bodies/position"], file["steps/120/bodies/id"]
            file["steps/120/bodies/position"], file["steps/120/bodies/id"] = np.ones((36, 2)), np.ones(36, int)
        self.assertIn("bodies whose ids do not ascend", self.page_of(place, drawn=False).text["pictures"])
        with open(os.path.join(place, "results.h5"), "wb") as file:
            file.write(b"nothing")
        page = self.page_of(place, drawn=False)
        self.assertIn("results.h5: cannot read this file", page.text["warnings"])
        self.assertIn("There is no results.h5", page.text["pictures"])
        self.assertEqual(page.attributes["headline"]["data-grade"], "bad")
        self.assertEqual(self.answer(page, "Did every solve")[0], "✓")
        self.assertIn("This run ended, but not all of its files are there and whole.", page.text["headline"])
        self.assertEqual(self.answer(page, "Did it come")[2], "Yes: 120 of 120 steps.")
        os.makedirs(self.here("empty"))
        for arguments, words in (((self.here("empty"),), "no run.log, history.csv or results.h5; expected the output directory of a run"),
                                 ((self.here("nowhere"),), "no run.log, history.csv or results.h5; expected the output directory of a run"),
                                 ((self.here("good/results"), "-o", self.here("good/case.nml/page.html")), "expected a file that can be written"),
                                 ((), "the following arguments are required: OUT")):
            status, said = self.report(*arguments)
            self.assertEqual((status, len(said.splitlines())), (2, 1), said)
            self.assertIn(words, said)

    def test_without_a_history(self):
        """What the last words know is told of a run whose history is missing; the headline says so, and does not condemn the run."""
        place = self.here("bare")
        shutil.copytree(self.here("good/results"), place)
        os.remove(os.path.join(place, "history.csv"))
        page = self.page_of(place, drawn=False)
        self.assertIn("This run ended, but not all of its files are there and whole.", page.text["headline"])
        self.assertEqual([row[0] for row in page.rows["answers"]], ["✓"] * 5 + ["✗"])
        self.assertEqual(self.answer(page, "Did it come")[2], "Yes: 120 of 120 steps.")
        history = gravier.Run(self.here("good/results")).history()
        worst = (history.velocity_error / history.velocity_scale).max()
        self.assertIn(f"at most {worst:.2g} of U", self.answer(page, "Was the accuracy")[2])
        self.assertRegex(self.answer(page, "Were overlaps")[2], "The largest overlap was in the first step at most .* of the mean radius")
        self.assertRegex(self.answer(page, "Are its files")[2], r"^Not all: \S+history.csv: No such file or directory; ")

    def test_files_of_two_runs(self):
        """A log that ends with another step than the tables is of another run."""
        place = self.here("two")
        shutil.copytree(self.here("good/results"), place)
        with open(self.here("good/results/run.log"), encoding="utf-8") as file:
            said = file.read()
        for last, names in (("100", ("history.csv", "results.h5")), ("130", ("history.csv",))):
            with open(os.path.join(place, "run.log"), "w", encoding="utf-8") as file:
                file.write(said.replace("    steps = 120\n", f"    steps = {last}\n"))
            page = self.page_of(place, drawn=False)
            self.assertEqual(self.answer(page, "Are its files")[2], "Not all: " + " ".join(
                f"run.log ends with step {last}, {name} with step 120: they are not of one run." for name in names))
            self.assertIn("not all of its files are there and whole", page.text["headline"])
        for text, step in (("finished    all 9 steps reached the accuracy", 9), ("ended       after step 5 of 9: a plane\nfinished    all 5 steps reached", 5),
                           ("at rest     after step 6 of 9: x\nfinished    *** 1 of the steps did NOT", 6), ("interrupted *** by SIGTERM after step 3 of 9", 3),
                           ("  *** DIVERGED: step 4 after 10 iterations of nlgs\nfinished    *** 3 of the steps did NOT", 3),
                           ("finished    no step was left to make after step 9", 9), ("lost        *** files of this run", None), ("       3   1.0E-3", None)):
            self.assertEqual(RunLog(text + "\n").last_step(9), step, text)

    def browse(self, *arguments):
        done = subprocess.run([BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=20000",
                               f"--user-data-dir={self.here('profile')}", *arguments], capture_output=True, text=True, timeout=300, check=False,
                              env={**os.environ, "HOME": self.scratch})
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    @unittest.skipUnless(BROWSER, "NO BROWSER: no chromium is found; apt-get install chromium, or set GRAVIER_BROWSER")
    def test_in_a_browser(self):
        """Pictures are loaded; nothing lies on another thing, and nothing reaches beyond the window, on a screen and on a telephone."""
        self.good_page()
        out = self.here("good.html")
        with open(out, encoding="utf-8") as file:
            text = file.read()
        with open(self.here("measured.html"), "w", encoding="utf-8") as file:
            file.write(re.sub(r"<meta http-equiv[^>]*>", "", text).replace("</head>", MEASURE + "</head>"))
        for width in (1200, 500):
            shown = self.browse(f"--window-size={width},900", "--dump-dom", f"file://{self.here('measured.html')}")
            found = json.loads(html.unescape(re.search(r'<pre id="measured">(.*?)</pre>', shown, re.S)[1]))
            self.assertEqual(found["window"], width)
            self.assertLessEqual(found["across"], width, "the page is wider than its window")
            self.assertEqual(len(found["images"]), 7)
            for complete, natural, left, _, right, _ in found["images"]:
                self.assertTrue(complete and natural > 300 and right - left > 250 and right <= width, found["images"])
            blocks = found["blocks"]
            self.assertGreater(len(blocks), 15)
            for one, other in zip(blocks, blocks[1:]):
                self.assertGreaterEqual(other[1], one[3] - 1.0, f"{one} and {other} overlap")
        # as it is, with its policy of loading nothing: the banner's blue and the chains' red are on the screen
        self.browse("--window-size=1200,4000", f"--screenshot={self.here('shown.png')}", f"file://{out}")
        screen = matplotlib.image.imread(self.here("shown.png"))[:, :, :3]
        self.assertEqual(screen.shape[1], 1200)
        for colour in ("0072B2", "b2182b"):
            wanted = np.array([int(colour[k:k + 2], 16) for k in (0, 2, 4)]) / 255
            self.assertGreater((np.abs(screen - wanted).max(axis=2) < 0.02).sum(), 300, colour)


if __name__ == "__main__":
    unittest.main()
