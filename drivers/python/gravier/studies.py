"""Studies of parameters: a case with several values of its keys, a run each."""
import csv
import itertools
import re
import warnings

import numpy as np
from whole_file import whole_file

from .case import CaseError, claim, ended, made_directory, run, value_text
from .results import Run
from .run_words import doubts

#: what the table of a study begins with
HEADER = ("run", "status")
#: its columns behind those of the keys: solves that missed their goal, the largest velocity error over U, and what else the last words doubt
JUDGED = ("steps_missed", "worst_error", "doubts")


def study(base, changes, directory, ranks=1, results=None, fresh=False):
    """Run `base` with every combination of `changes`, {(group, key): [values]}, each in a directory of its own below
    `directory`. Yields, when each run is over, ({(group, key): value}, its directory, its exit status). A key of a group that stands several
    times is (group, name, key), with the `name` of the group, or its number from 1. Keys that change together are a tuple of such keys, whose
    values are tuples: {(("time", "step"), ("time", "steps")): [(1e-3, 100), (5e-4, 200)]}. study.csv in `directory` has a row for each run that
    ended with status 0 or 3: its directory, its exit status, its values, how many of its steps missed their goal, its worst velocity error over U,
    and its doubts, by the last words of its log. `results` is a function of a finished run, a gravier.Run, that returns {column: value}: these columns
    follow. A run that has ended with the same case stays as it is, unless a file of this case has changed since, or `fresh`. Warns of these runs, and of
    runs that an older, larger study has left."""
    points = _points(changes)
    directory = made_directory(directory)
    claim(directory / "study.csv", {".csv": ",".join(HEADER).encode()})
    older = sorted(int(place.name[4:]) for place in directory.glob("run_*") if place.name[4:].isdigit() and int(place.name[4:]) > len(points))
    if older:
        warnings.warn(f"{directory}: {', '.join(f'run_{number}' for number in older)} of an older study stay; this one has run_1 to run_{len(points)}",
                      stacklevel=2)
    cases = [_case_of(base, point) for point in points]
    known = {} if fresh else {number: status for number, groups in enumerate(cases, 1) if (status := ended(groups, directory / f"run_{number}")) is not None}
    if known:
        warnings.warn(f"{directory}: kept, as ended with the same case: {', '.join(f'run_{number}' for number in known)}; fresh=True runs all", stacklevel=2)
    rows = []
    if points:
        _write_table(directory / "study.csv", points[0], rows, ())
    own = None
    for number, (point, groups) in enumerate(zip(points, cases), 1):
        place = directory / f"run_{number}"
        status = known[number] if number in known else run(groups, place, ranks)
        found = _own_results(results, groups, place, point, own)
        own = list(found)
        values = (value if isinstance(value, str) else value_text(value) for value in [*point.values(), *_judged(place), *found.values()])
        rows.append([place.name, status, *values])
        _write_table(directory / "study.csv", point, rows, own)
        yield point, place, status


def _case_of(base, point):
    """The case of a run."""
    groups = {group: [dict(one) for one in keys] if isinstance(keys, list) else dict(keys) for group, keys in base.items()}
    for what, value in point.items():
        _group_of(groups, *what)[what[-1]] = value
    return groups


def _judged(place):
    """How many steps of a run missed their goal, its worst velocity error over U, and its doubts, which are the last words of its log; None where they do
    not tell it."""
    said = (place / "terminal.log").read_text(encoding="utf-8", errors="replace")
    missed = re.search(r"^converged +(?:NO: (\d+) of \d+ solves? did not reach|)", said, re.M)
    worst = re.search(r"^accuracy +velocity error at most (\S+) of U", said, re.M)
    return int(missed[1] or 0) if missed else None, float(worst[1]) if worst else None, doubts(said)


def _own_results(results, groups, place, point, known):
    """What the function of the user makes of a run, {column: value}; `known` are the columns of the runs before, None for the first one."""
    if results is None:
        return {}
    found = results(Run(place / _group_of(groups, "output", "directory").get("directory", "results")))
    if not isinstance(found, dict) or not all(isinstance(name, str) for name in found):
        raise CaseError(f"results of {place.name}: {found!r}; expected a dictionary of values by the names of their columns")
    if known is not None and set(found) != set(known):
        raise CaseError(f"results of {place.name}: columns {', '.join(found)}; expected those of the runs before, {', '.join(known)}")
    taken = {*HEADER, *_key_names(point), *JUDGED}.intersection(found)
    if taken:
        raise CaseError(f"results of {place.name}: {', '.join(sorted(taken))}: study.csv has a column of this name; expected another one")
    return {name: found[name] for name in (found if known is None else known)}


def _points(changes):
    """Values of the keys of each run, {(group, key): value}."""
    series, known = [], set()
    for what, values in changes.items():
        tied = isinstance(what, tuple) and what and all(isinstance(one, tuple) for one in what)
        keys = what if tied else (what,)
        for one in keys:
            if not (isinstance(one, tuple) and len(one) in (2, 3)):
                raise CaseError(f"{one!r}: expected (group, key), or (group, name, key) of a group that stands several times")
            if one in known:
                raise CaseError(f"{one!r}: changed twice; expected each key once")
            known.add(one)
        if isinstance(values, str) or not np.iterable(values):
            raise CaseError(f"{what}: {values!r}; expected a list of values")
        several = list(values) if tied else [(value,) for value in values]
        for value in several:
            if isinstance(value, str) or not np.iterable(value) or len(value) != len(keys):
                raise CaseError(f"{what}: {value!r}; expected a value for each of these {len(keys)} keys")
        series.append([dict(zip(keys, value)) for value in several])
    return [{key: value for part in parts for key, value in part.items()} for parts in itertools.product(*series)]


def _key_names(point):
    """The columns of the keys that change."""
    return [".".join(str(part) for part in key) for key in point]


def _write_table(path, point, rows, own):
    """The runs that are over, in the place of those known before."""
    with whole_file(path) as part, open(part, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*HEADER, *_key_names(point), *JUDGED, *own])
        writer.writerows(rows)


def _group_of(groups, group, *rest):
    """The keys of a group, of one that stands several times by its name or number."""
    found = groups.setdefault(group, {})
    *which, key = rest
    several = found if isinstance(found, list) else [found]
    if which:
        own = [one for number, one in enumerate(several, 1) if which[0] in (number, one.get("name"))]
        if len(own) != 1:
            known = ", ".join(repr(one.get("name", number)) for number, one in enumerate(several, 1))
            raise CaseError(f"&{group} {which[0]!r}: {'no' if not own else 'more than one'} group of this name or number; expected one of {known}")
        return own[0]
    if len(several) == 1:
        return several[0]
    if isinstance(found, list):
        raise CaseError(f"&{group} {key}: the group stands several times; expected ('{group}', name, '{key}'), with the name or number of one of them")
    return found
