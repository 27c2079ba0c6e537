"""The documentation says what is: keys, links, procedures and commands exist, examples run.

Blocks of a page are run down the page in one directory that holds links to data/ and drivers/, with the programs on PATH:
- a block sh or python whose first line is `# tested` must end with status 0; any other one has a line
  `<!-- not run: REASON -->` above it, and the test lists them;
- a tested block with the line `<!-- in the long tests -->` above it runs in `./gravier test long` alone, and is parsed in the suite;
- a block fortran that is a complete case (it has &scene and &time) must pass `gravier --check`; a first line
  `! NAME.nml` leaves it under that name for the blocks after it.
"""
import functools
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import forked_scripts
import h5py
import matplotlib.pyplot  # noqa: F401

from gravier_runs import ALONE, ENVIRONMENT, LONG, PATIENCE

SOURCE = Path(os.environ.get("GRAVIER_SOURCE_DIR", Path(__file__).resolve().parents[2])).resolve()
PROGRAMS = Path(os.environ.get("GRAVIER_BIN_DIR", SOURCE / "build/release/bin")).resolve()
MPIEXEC = shutil.which(os.environ.get("MPIEXEC", "mpiexec")) or "mpiexec"
PAGES = [SOURCE / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")] + sorted(
    [*(SOURCE / "doc").glob("*.md"), *(SOURCE / "doc/reference").glob("*.md")])
BANNED = ["TODO", "FIXME", "XXX", "coming soon", "not yet implemented"]
# pages whose blocks need no line to say why they are not run
UNMARKED = {"README.md": "builds the program, or installs packages"}


class Block:
    """A fenced block of a page."""

    def __init__(self, page, line, language):
        self.page, self.line, self.language, self.lines = page, line, language, []
        #: why it is not run, and whether it is only where LONG is true
        self.reason, self.long = None, False

    @property
    def text(self):
        return "\n".join(self.lines) + "\n"

    @property
    def place(self):
        return f"{self.page.relative_to(SOURCE)}, line {self.line}"

    def is_tested(self):
        return self.language in ("sh", "python") and bool(self.lines) and self.lines[0].strip() == "# tested"

    def is_case(self):
        return self.language == "fortran" and all(re.search(rf"^\s*&{name}\b", self.text, re.I | re.M) for name in ("scene", "time"))

    def case_name(self):
        named = re.match(r"!\s*([\w.-]+\.nml)\b", self.text)
        return named[1] if named else f"line{self.line}.nml"


@functools.lru_cache(maxsize=None)
def read(page):
    """Blocks of a page, and its text without them (their lines left empty)."""
    blocks, prose, block = [], [], None
    before = ""
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        fence = re.match(r"\s*```(\w*)\s*$", line)
        if fence and block is None:
            block = Block(page, number, fence[1])
            reason = re.match(r"\s*<!-- not run: (.+) -->$", before)
            block.reason, block.long = reason[1] if reason else None, before.strip() == "<!-- in the long tests -->"
        elif fence:
            blocks.append(block)
            block = None
        elif block is not None:
            block.lines.append(line)
        prose.append("" if fence or block is not None else line)
        before = line
    if block is not None:
        raise AssertionError(f"{block.place}: this block is not closed")
    return blocks, "\n".join(prose)


def anchors(page):
    """What GitHub makes of the headings of a page."""
    found = []
    for heading in re.findall(r"^#+ +(.*?) *#*$", read(page)[1], re.M):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)|[`*$]", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        found.append(slug if slug not in found else f"{slug}-{found.count(slug)}")
    return found


def run(command, directory, path=None, more=None):
    """Status and output of a command; a command that is not over in time is ended, with all that it started."""
    environment = {**ENVIRONMENT, **os.environ, **(more or {}), "LC_ALL": "C.UTF-8",
                   "PYTHONPATH": f"{SOURCE / 'drivers/python'}:{os.environ.get('PYTHONPATH', '')}"}
    if path:
        environment["PATH"] = f"{path}:{environment['PATH']}"
    process = subprocess.Popen(command, cwd=directory, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, start_new_session=True)
    try:
        output = process.communicate(timeout=PATIENCE)[0]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return None, process.communicate()[0].decode(errors="replace")
    return process.returncode, output.decode(errors="replace")


@functools.lru_cache(maxsize=None)
def key_reference():
    status, text = run([str(PROGRAMS / "gravier"), "--keys"], ".")
    if status != 0:
        raise AssertionError(f"gravier --keys: status {status}\n{text}")
    return text


def rows_by_group(text):
    """Rows of the tables of keys as {(group, key): row}."""
    rows, group = {}, None
    for line in text.splitlines():
        if line.startswith("## &"):
            group = line[4:]
        row = re.match(r"\| `(\w+)` \|", line)
        if row:
            rows[group, row[1]] = line
    return rows


class Keys(unittest.TestCase):

    def test_every_key_stands_in_keys_md_as_the_program_prints_it(self):
        printed, written = rows_by_group(key_reference()), rows_by_group((SOURCE / "doc/keys.md").read_text(encoding="utf-8"))
        self.assertGreater(len(printed), 30, "gravier --keys prints few keys")
        for key, row in printed.items():
            self.assertEqual(written.get(key), row, f"doc/keys.md, &{key[0]} {key[1]}: run gravier --keys > doc/keys.md")
        self.assertEqual(sorted(written), sorted(printed), "doc/keys.md has keys that the program does not know")

    def test_keys_and_words_in_the_prose_exist(self):
        rows = rows_by_group(key_reference())
        by_name = {}
        for (_, key), row in rows.items():
            by_name[key] = by_name.get(key, "") + row.split("|")[2]
        count = 0
        for page in PAGES:
            for key, value in re.findall(r"`([a-z]\w*) = ([^`,/]+?)(?:[,/][^`]*)?`", read(page)[1]):
                count += 1
                self.assertIn(key, by_name, f"{page.name}: `{key} = {value}`: no such key")
                word = re.fullmatch(r"'(\w+)'", value)
                if word and "' or '" in by_name[key]:
                    self.assertIn(value, by_name[key], f"{page.name}: `{key} = {value}`: no such word")
        self.assertGreater(count, 20)


class Links(unittest.TestCase):

    def test_relative_links_lead_somewhere(self):
        count = 0
        for page in PAGES:
            for target in re.findall(r"\]\(([^)\s]+)\)", read(page)[1]):
                if re.match(r"[a-z]+:", target):
                    continue
                count += 1
                path, _, anchor = target.partition("#")
                place = (page.parent / path).resolve() if path else page
                with self.subTest(page=page.name, target=target):
                    self.assertTrue(place.exists(), f"{page.name}: {target}: no such file")
                    self.assertTrue(place.is_relative_to(SOURCE), f"{page.name}: {target}: outside the project")
                    if anchor:
                        self.assertIn(anchor, anchors(place), f"{page.name}: {target}: no such heading")
        self.assertGreater(count, 100)

    def test_paths_in_the_prose_exist(self):
        for page in PAGES:
            for path in re.findall(r"`((?:modules|src|drivers|tests|data|doc|cmake)/[a-z0-9_./]*)`", read(page)[1]):
                self.assertTrue((SOURCE / path).exists(), f"{page.name}: `{path}`: no such file")

    def test_procedures_are_in_the_files_they_are_linked_to(self):
        count = 0
        for page in PAGES:
            for name, path in re.findall(r"\[`(\w+)`\]\(([^)#\s]+\.(?:f90|F90|fypp|fypi))\)", read(page)[1]):
                count += 1
                with self.subTest(page=page.name, procedure=name):
                    text = (page.parent / path).read_text(encoding="utf-8")
                    definition = rf"(?im)^ *[^!\n]*(?:\bsubroutine +|\bfunction +|\binterface +|\btype\b[^!\n]*:: *){name}\b"
                    self.assertTrue(re.search(definition, text), f"{page.name}: {name} is not defined in {path}")
        self.assertGreater(count, 50)


class Reference(unittest.TestCase):
    """A page an effect, a boundary and a law, all of one pattern."""

    DIRECTORY = SOURCE / "doc/reference"

    def test_tables_and_index_are_those_of_the_program(self):
        status, text = run([sys.executable, str(self.DIRECTORY / "write_keys.py"), "--check", str(PROGRAMS / "gravier")], ".")
        self.assertEqual(status, 0, f"{text}\nrun python3 doc/reference/write_keys.py {PROGRAMS / 'gravier'}")

    def test_pages_have_one_pattern(self):
        """Title, summary, five sections in their order, none of them empty, and an example that is a whole case."""
        pages = sorted(self.DIRECTORY.glob("*_*.md"))
        self.assertGreater(len(pages), 20)
        for page in pages:
            with self.subTest(page=page.name):
                text = page.read_text(encoding="utf-8")
                parts = re.split(r"^## (.+)\n", text, flags=re.M)
                self.assertEqual(parts[1::2], ["Syntax", "Example", "What it does", "Restrictions", "Related"])
                self.assertTrue(re.fullmatch(r"# .+\n\n[^\n]+\.\n\n", parts[0]), "expected a title and a sentence")
                for part in parts[2::2]:
                    self.assertGreater(len(part.strip()), 20)
                self.assertIn("<!-- keys of &", parts[2])
                self.assertEqual(sum(block.is_case() for block in read(page)[0]), 1, "expected one whole case")
                self.assertTrue(any(block.is_tested() for block in read(page)[0]), "expected a run of the case")

    def test_every_law_shape_and_effect_has_a_page(self):
        rows = rows_by_group(key_reference())
        for group, key, kind in (("boundary", "shape", "boundary"), ("law", "kind", "law")):
            words = re.findall(r"'(\w+)'", rows[group, key].split("|")[2])
            self.assertGreater(len(words), 4)
            self.assertEqual({path.stem.removeprefix(f"{kind}_") for path in self.DIRECTORY.glob(f"{kind}_*.md")}, set(words),
                             f"doc/reference: expected a page {kind}_WORD.md for each {key} of &{group} and no other")
        # the effects of the log, each in the page that explains it
        pages = {"drives": "drives", "driven by forces": "forces_on_boundaries", "glued grains": "boundary_grains.md", "bonds": "law_bonded.md", "periodic images": "periodic_cells", "moving cell": "periodic_cells",
                 "rolling resistance": "rolling_and_pivoting", "pivoting resistance": "rolling_and_pivoting", "body force": "gravity"}
        with tempfile.TemporaryDirectory() as directory:
            (Path(directory) / "case.nml").write_text("&scene bodies = 'column' /\n&time step = 0.01, steps = 1 /\n", encoding="ascii")
            status, text = run([str(PROGRAMS / "gravier"), "--check", "case.nml"], directory)
        self.assertEqual(status, 0, text)
        on, off = re.search(r"^effects +\dD: (.+)$", text, re.M)[1], re.search(r"^off +(.+)$", text, re.M)[1]
        effects = [name for name in f"{on}, {off}".split(", ") if name != "nothing"]
        self.assertGreater(len(effects), 12)
        for name in effects:
            page = pages.get(name, name.replace(" ", "_"))
            path = self.DIRECTORY / (page if page.endswith(".md") else f"effect_{page}.md")
            self.assertTrue(path.exists(), f"{path}: no page for the effect {name}")


class Words(unittest.TestCase):

    def test_formulas_by_themselves_are_blocks_of_math(self):
        """The site draws blocks ```math and formulas within a line; it knows no pair of double dollars."""
        for page in PAGES:
            self.assertNotIn("$$", read(page)[1], f"{page.name}: a formula between $$: write it as a block ```math")

    def test_no_promises(self):
        for page in PAGES:
            text = page.read_text(encoding="utf-8")
            for word in BANNED:
                self.assertFalse(re.search(rf"(?i)\b{word}\b", text), f"{page.name} says {word}")

    def test_commands_of_the_launcher_exist(self):
        usage = run(["sh", str(SOURCE / "gravier"), "--help"], ".")[1]
        known = set(re.findall(r"^ +\./gravier ([\w-]+)", usage, re.M))
        self.assertIn("demo", known, usage)
        for page in PAGES:
            for word in re.findall(r"\./gravier ([a-z]+)", page.read_text(encoding="utf-8")):
                self.assertIn(word, known, f"{page.name}: ./gravier {word}: no such command")

    def test_citations_have_the_version(self):
        version = re.search(r"project\(gravier VERSION ([\d.]+)", (SOURCE / "CMakeLists.txt").read_text(encoding="utf-8"))[1]
        for path, words in (("CITATION.cff", f"version: {version}\n"), ("doc/citing.md", f"version = {{{version}}}")):
            self.assertIn(words, (SOURCE / path).read_text(encoding="utf-8"), path)

    def test_options_of_the_programs_exist(self):
        count = 0
        for program in ("gravier", "gravier_accuracy", "gravier_columns", "gravier_error", "gravier_fclib", "gravier_import", "gravier_sample"):
            interpreter = [sys.executable] if program == "gravier_import" else []
            usage = run([*interpreter, str(PROGRAMS / program), "--help"], ".")[1]
            for page in PAGES:
                for option in re.findall(rf"(?<!/)\b{program} [^`\n]*?(--[a-z]+)", page.read_text(encoding="utf-8")):
                    count += 1
                    self.assertTrue(option in usage, f"{page.name}: {program} {option}: no such option")
        self.assertGreater(count, 5)


class Recipes(unittest.TestCase):

    def test_every_shipped_case_stands_in_the_gallery(self):
        """With a picture in its row."""
        rows = [line for line in read(SOURCE / "doc/gallery.md")[1].splitlines() if line.startswith("|")]
        for path in sorted((SOURCE / "data").rglob("*.nml")):
            link = f"](../{path.relative_to(SOURCE)})"
            self.assertTrue(any(link in row and "](figures/" in row for row in rows), f"{path}: no row with a picture in doc/gallery.md")

    def test_recipes_install_what_the_launcher_asks_for(self):
        launcher = (SOURCE / "gravier").read_text(encoding="utf-8")
        needed = set(re.findall(r"\|\| need ([a-z][\w.+-]*)", launcher))
        self.assertGreater(len(needed), 8, needed)
        for path in ("README.md", "doc/install.md", "doc/user_guide.md", "cmake/packaging/Dockerfile", "cmake/packaging/gravier.def"):
            text = (SOURCE / path).read_text(encoding="utf-8")
            self.assertEqual({name for name in needed if name not in text}, set(), path)
        recipe = SOURCE / "cmake/packaging/spack/packages/gravier/package.py"
        compile(recipe.read_text(encoding="utf-8"), str(recipe), "exec")
        names = re.findall(r"conda:[^)]*\) name=(?:\"'([^']*)'\"|([\w-]+)) *;;", launcher)
        conda = (SOURCE / "cmake/packaging/environment.yml").read_text(encoding="utf-8")
        self.assertGreaterEqual(len(names), 6)
        for name in (quoted or plain for quoted, plain in names):
            self.assertIn(f"- {name}\n", conda)


class Blocks(unittest.TestCase):

    def setUp(self):
        self.directory = Path(tempfile.mkdtemp(prefix="gravier-docs-"))
        self.addCleanup(shutil.rmtree, self.directory, ignore_errors=True)
        self.work, self.bin = self.directory / "work", self.directory / "bin"
        self.work.mkdir()
        self.bin.mkdir()
        # programs run without a launcher but where a block has one, which starts its ranks in the environment of the tests
        self.more = {**ALONE, "OMPI_MCA_orte_tmpdir_base": str(self.directory), "MPIEXEC": str(self.bin / "mpirun")}
        launched = "env " + " ".join(f'-u {name}' for name in self.more if name not in os.environ)
        launched += "".join(f" {name}='{os.environ[name]}'" for name in self.more if name in os.environ)
        for name in ("data", "drivers"):
            (self.work / name).symlink_to(SOURCE / name)
        # scripts of Gravier and blocks of Python run in copies of this program, which has what they import
        self.server = forked_scripts.Server(str(self.directory))
        self.addCleanup(self.server.stop)
        self.more["GRAVIER_PYTHON"] = self.server.interpreter(str(self.directory / "drawing"))
        for name in sorted(os.listdir(PROGRAMS)):
            if (PROGRAMS / name).resolve().suffix == ".py":
                self.server.program(self.bin / name, str(PROGRAMS / name))
        # `python3` is the one that has h5py
        for name, program in (("mpirun", f'{launched} "{MPIEXEC}"'), ("python3", f'"{sys.executable}"')):
            launcher = self.bin / name
            launcher.write_text(f'#!/bin/sh\nexec {program} "$@"\n', encoding="utf-8")
            launcher.chmod(0o755)

    def run_page(self, page):
        """Run the blocks of a page; how many."""
        count = 0
        for block in read(page)[0]:
            if block.is_case():
                (self.work / block.case_name()).write_text(block.text, encoding="utf-8")
                command = [str(PROGRAMS / "gravier"), "--check", block.case_name()]
            elif block.is_tested() and block.long and not LONG:
                self.assert_parses(block)
                continue
            elif block.is_tested():
                script = self.directory / f"line{block.line}"
                script.write_text(block.text, encoding="utf-8")
                command = ["sh", "-eu", script]
                if block.language == "python":
                    command = [self.directory / f"python{block.line}"]
                    self.server.program(*command, str(script))
            else:
                continue
            count += 1
            status, output = run(command, self.work, path=f"{self.bin}:{PROGRAMS}", more=self.more)
            if status != 0:
                how = "did not end" if status is None else f"status {status}"
                self.fail(f"{block.place}: {how}:\n{block.text}\n{output[-3000:]}")
        return count

    def assert_parses(self, block):
        if block.language == "python":
            compile(block.text, block.place, "exec")
        else:
            status, output = run(["sh", "-n", "-c", block.text], ".")
            self.assertEqual(status, 0, f"{block.place}: {output}")

    def test_blocks_that_are_not_run_say_why(self):
        """They are few, parse, and name files that exist."""
        left_out = []
        for page in PAGES:
            for block in read(page)[0]:
                if block.language not in ("sh", "python") or block.is_tested():
                    continue
                reason = block.reason or UNMARKED.get(page.name)
                self.assertTrue(reason, f"{block.place}: expected `# tested` as its first line, or <!-- not run: REASON --> above it")
                left_out.append(f"{block.place}: {reason}")
                self.assert_parses(block)
                for path in re.findall(r"(?<![\w/.])(?:data|doc|drivers|tests)/[\w./]+\w", block.text):
                    self.assertTrue((SOURCE / path).exists(), f"{block.place}: {path}: no such file")
        print("blocks that are not run:", *left_out, sep="\n  ")
        self.assertLessEqual(len(left_out), 25)

    def test_readme(self):
        self.assertGreaterEqual(self.run_page(SOURCE / "README.md"), 2)

    def test_user_guide(self):
        page = SOURCE / "doc/user_guide.md"
        self.assertGreaterEqual(self.run_page(page), 10)
        # columns and datasets are in a page of their own
        text = (SOURCE / "doc/results.md").read_text(encoding="utf-8")
        for column in (self.work / "heap/history.csv").read_text(encoding="ascii").splitlines()[0].split(","):
            self.assertTrue(f"`{column}`" in text, f"column {column} of history.csv is not in doc/results.md")
        names = set()
        with h5py.File(self.work / "heap/results.h5", "r") as file:
            file.visititems(lambda name, node: names.add(name.split("/")[-1]) if isinstance(node, h5py.Dataset) else None)
            names.update(file["run"].attrs)
        for name in names:
            self.assertTrue(re.search(rf"`[\w/<>]*\b{name}`", text), f"{name} of results.h5 is not in doc/results.md")

    def test_other_pages(self):
        for page in PAGES:
            if page.name not in ("README.md", "user_guide.md"):
                self.run_page(page)


if __name__ == "__main__":
    unittest.main()
