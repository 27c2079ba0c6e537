"""Cases as dictionaries: input files written and read, runs of the program."""
import os
import re
import subprocess
from pathlib import Path

import numpy as np
from whole_file import Locked, Misplaced, check_place, output_lock, whole_file

from .run_words import said_of, starts_of


class CaseError(Exception):
    """A case that cannot be read, or a run that failed: one line."""


def value_text(value):
    """A value as a namelist has it; None, an entry of a list that nothing is said of, is empty."""
    if value is None:
        return ""
    if isinstance(value, (bool, np.bool_)):
        return ".true." if value else ".false."
    if isinstance(value, (str, Path)):
        if "\n" in str(value):
            raise CaseError(f"{str(value)!r}: expected a text on one line")
        return "'" + str(value).replace("'", "''") + "'"
    if isinstance(value, (list, tuple, np.ndarray)):
        return ", ".join(value_text(one) for one in value)
    return repr(value.item() if isinstance(value, np.generic) else value)


def namelist(groups):
    """Text of an input file from {group: {key: value}}; of a group that stands several times, {group: [{key: value}, ...]}."""
    text = ""
    for group, several in groups.items():
        for keys in several if isinstance(several, list) else [several]:
            text += f"&{group}\n" + "".join(f"  {key} = {value_text(value)}\n" for key, value in keys.items()) + "/\n"
    return text


def entries(keys, name, missing):
    """An array of a group as {key: value}, however its entries are given, `lower = 0.0, , 1.0` or `lower(2) = 0.1`; those that nothing is said
    of are those of `missing`."""
    full = np.array(missing, dtype=float)
    for key, value in keys.items():
        found = re.fullmatch(rf"{name}(?:\(\s*(\d*)\s*(?::.*)?\))?", key)
        if found:
            first = int(found[1] or 1) - 1
            for k, entry in enumerate(value if isinstance(value, list) else [value], first):
                if entry is not None and k < len(full):
                    full[k] = entry
    return full


TOKEN = re.compile(r"""\s*(?:!.*|(?P<text>(?:\d+\*)?(?:'(?:[^'\n]|'')*'|"(?:[^"\n]|"")*"))|(?P<group>&\w+)|"""
                   r"""(?P<key>[A-Za-z]\w*)\s*(?P<index>\([^()]*\))?\s*=|(?P<mark>[/,])|(?P<word>[^\s&/=,!'"()]+)|(?P<odd>\S))""")


def parse_namelist(text):
    """{group: [{key: value}, ...]} of an input file; a value is a bool, an int, a float, a text, or a list of these, with None for an entry
    that nothing is said of (`0.0, , 1.0`, `lower(3) = 1.0`). CaseError where the text is no namelist, or says an entry twice."""
    groups, keys, name, into = {}, None, None, None
    for token in TOKEN.finditer(text):
        kind = token.lastgroup if token["key"] is None else "key"
        if kind == "group" and keys is None:
            name, keys, into = token["group"][1:].lower(), {}, None
            groups.setdefault(name, []).append(keys)
        elif token["mark"] == "/" or kind == "group" and token["group"].lower() == "&end":
            if keys is None:
                raise CaseError(f"'{token[0].strip()}' outside a group")
            keys.update({key: entry.value() for key, entry in keys.items()})
            keys = None
        elif kind == "key" and keys is not None:
            into = keys.setdefault(token["key"].lower(), _Entry(f"&{name} {token['key'].lower()}"))
            into.begin(token["index"])
        elif kind == "mark" and into is not None:
            into.comma()
        elif kind in ("text", "word") and into is not None and keys is not None:
            into.take(_values(token))
        elif kind is not None:
            raise CaseError(f"'{token[0].strip()}' " + ("outside a group" if keys is None else f"in &{name}: expected `key = value` or /"))
    if keys is not None:
        raise CaseError(f"&{name} is not closed: expected /")
    return groups


class _Entry:
    """What a group says of a key, in one assignment or in several of its entries."""

    def __init__(self, name):
        self.name, self.found, self.last, self.is_array = name, {}, 0, False

    def begin(self, index):
        """`key =` or `key(index) =`: where its values go."""
        if index is None and self.found:
            raise CaseError(f"{self.name} is given twice")
        first, _, rest = (index or "()")[1:-1].partition(":")
        last, _, step = rest.partition(":")
        try:
            self.place, self.step = int(first.strip() or 1), int(step.strip() or 1)
            int(last.strip() or 1)
        except ValueError:
            raise CaseError(f"{self.name}{index}: expected an index as (2) or (2:3)") from None
        self.is_array = self.is_array or index is not None
        # commas before the next value, of which each but the first after a value stands for an entry
        self.commas, self.is_first = 0, True

    def comma(self):
        self.commas += 1

    def take(self, values):
        for value in [None] * (self.commas if self.is_first else max(0, self.commas - 1)) + values:
            if self.place in self.found:
                raise CaseError(f"{self.name}({self.place}) is given twice")
            if value is not None:
                self.found[self.place] = value
            self.last = self.place
            self.place += self.step
        self.commas, self.is_first = 0, False

    def value(self):
        """A scalar where it was written as one."""
        found = [self.found.get(place) for place in range(1, max([self.last, *self.found]) + 1)]
        return found[0] if len(found) == 1 and not self.is_array else found


def _values(token):
    """What one token stands for: several values where it repeats one, as 3*0.0."""
    if token["text"]:
        quote = token["text"][-1]
        count, _, text = token["text"].partition(quote)
        return [text[:-1].replace(2 * quote, quote)] * int(count.rstrip("*") or 1)
    count, star, word = token["word"].rpartition("*")
    if star and not word:
        return [None] * (int(count) if count.isdigit() else 1)
    if re.fullmatch(r"\.?[tT](rue|RUE)?\.?", word) or re.fullmatch(r"\.?[fF](alse|ALSE)?\.?", word):
        value = word.strip(".")[0] in "tT"
    elif "_" in word:
        # of Python, but of no input file: 1_000
        value = word
    else:
        try:
            value = int(word)
        except ValueError:
            try:
                value = float(re.sub("[dD]", "e", word))
            except ValueError:
                value = word
    return [value] * (int(count) if count.isdigit() else 1)


def find_program(name="gravier"):
    """Path of a program: in $GRAVIER_BIN_DIR, in bin of the installation, in build/release/bin of the source tree, or its
    name alone, for PATH to find it."""
    here = Path(__file__).resolve()
    folders = [os.environ["GRAVIER_BIN_DIR"]] if "GRAVIER_BIN_DIR" in os.environ else []
    # share/gravier/python/gravier/case.py of an installation, drivers/python/gravier/case.py of a source tree
    folders += [here.parents[4] / "bin", here.parents[3] / "build/release/bin"]
    for folder in folders:
        if (Path(folder) / name).is_file():
            return str((Path(folder) / name).resolve())
    return name


#: of Open MPI, for one machine
ENVIRONMENT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
               "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe", "OPENBLAS_NUM_THREADS": "1"}


#: first line of the cases that `run` writes, and of its logs
MADE, MADE_LOG = "! made by gravier.run\n", "made by gravier.run\n"
#: what logs begin with that earlier versions made
EARLIER_LOGS = r"Gravier \d|gravier: error: "


def claim(path, kinds):
    """check_place, as an exception of this module."""
    try:
        check_place(path, kinds)
    except Misplaced as refused:
        raise CaseError(str(refused)) from None


def write_case(groups, directory):
    """Write `groups` as case.nml into `directory`, which is made if need be. A case.nml that is there is replaced where this function has made
    it, or where it is the same case."""
    case, text = Path(directory) / "case.nml", namelist(groups)
    if not (case.is_file() and case.read_bytes() == text.encode()):
        claim(case, {".nml": MADE.encode()})
    case.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(case) as part:
        part.write_text(MADE + text, encoding="utf-8")


def made_directory(directory):
    """A directory, made if need be."""
    directory = Path(directory)
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as what:
        raise CaseError(f"{directory}: {what.strerror}; expected a place for a directory") from None
    return directory


def run(groups, directory, ranks=1, program=None):
    """Write `groups` as case.nml into `directory` and run it there, with what it says in terminal.log. Paths in a case are relative to that
    directory. `program` is another program that reads a case, a name such as 'gravier_sample' or a path. Returns the exit status: 0, or 3 where a
    solve missed its tolerance. A directory where another `run` is under way, or where a
    case.nml or a terminal.log is of another origin, is refused, and nothing in it changes."""
    if not (isinstance(ranks, (int, float, np.integer, np.floating)) and ranks >= 1 and ranks % 1 == 0):
        raise CaseError(f"ranks = {ranks}: expected a whole number above 0")
    directory = made_directory(directory)
    try:
        with output_lock(directory / "terminal.log", "gravier.run"):
            return run_alone(groups, directory, ranks, program)
    except Locked as refused:
        raise CaseError(str(refused)) from None


def ended(groups, directory):
    """The exit status, 0 or 3, of a `run` of this case that has ended in `directory`; None where there is none whose results are there, or a file that the
    case names has changed since."""
    directory = Path(directory)
    output = groups.get("output") or {}
    results = (output[0] if isinstance(output, list) else output).get("directory", "results")
    case, said, log = (_text_of(directory / name) for name in ("case.nml", "terminal.log", Path(results) / "run.log"))
    words = said_of(said.splitlines(), "finished")
    if case != MADE + namelist(groups) or not words or said_of(starts_of(log)[-1], "finished") != words:
        return None
    texts = [value for several in groups.values() for keys in (several if isinstance(several, list) else [several])
             for given in keys.values() for value in (given if isinstance(given, (list, tuple)) else [given]) if isinstance(value, (str, Path))]
    made = (directory / "terminal.log").stat().st_mtime
    if any(os.path.isfile(directory / text) and os.path.getmtime(directory / text) > made for text in texts):
        return None
    return 3 if words.startswith("***") else 0


def _text_of(path):
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _command(program):
    """The path of a program that is given by its name or by a path, or its name alone, for PATH to find it."""
    name = str(program or "gravier")
    return str(Path(name).resolve()) if os.sep in name else find_program(name)


def run_alone(groups, directory, ranks, program):
    """What `run` does where no other one is under way."""
    claim(directory / "terminal.log", {".log": f"{MADE_LOG}|{EARLIER_LOGS}".encode()})
    write_case(groups, directory)
    launcher = os.environ.get("MPIEXEC", "mpiexec")
    with open(directory / "terminal.log", "w", encoding="utf-8") as log:
        print(MADE_LOG, end="", file=log, flush=True)
        done = subprocess.run([launcher, "-n", str(int(ranks)), _command(program), "case.nml"], cwd=directory,
                              env={**ENVIRONMENT, **os.environ}, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                              check=False)
    if done.returncode not in (0, 3):
        said = (directory / "terminal.log").read_text(encoding="utf-8", errors="replace").removeprefix(MADE_LOG)
        lines = re.findall(r"^gravier\w*: error: .*$", said, re.M) or said.strip().splitlines()[-1:]
        raise CaseError(f"{directory}: gravier ended with status {done.returncode}: {' '.join(lines)}")
    return done.returncode
