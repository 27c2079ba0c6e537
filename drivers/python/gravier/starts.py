"""What was run from which step on: the case of a run, and those of its restarts."""
from typing import NamedTuple

from .case import parse_namelist


class Start(NamedTuple):
    """From step `step` on, 0 at the start: the program, its command line, the input file, and the input by groups."""
    step: int
    version: str
    command: str
    input_text: str
    case: dict


def text_of(value):
    """A text of an HDF5 file. What is not UTF-8 in a name, which the program does not mind, becomes a replacement character, as in tables and logs."""
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def starts_in(run):
    """The starts that the open group /run of results.h5 tells of, the first one first."""
    # earlier versions kept no restarts
    restarts = run["restarts"] if "restarts" in run else {}
    return [_start_in(run, 0), *(_start_in(restarts[name], int(name)) for name in sorted(restarts, key=int))]


def _start_in(group, step):
    version, command, text = (text_of(group.attrs[name]) for name in ("version", "command", "input_text"))
    return Start(step, version, command, text, parse_namelist(text))


def changed_keys(before, after):
    """What differs between two cases by groups, rows (group, key, value before, value after); None where a case does not give the key."""
    rows = []
    for group in {**before, **after}:
        old, new = _named(group, before.get(group, [])), _named(group, after.get(group, []))
        for title in {**old, **new}:
            keys, others = old.get(title, {}), new.get(title, {})
            rows += [(title, key, keys.get(key), others.get(key)) for key in {**keys, **others} if keys.get(key) != others.get(key)]
    return rows


def _named(group, several):
    """The groups of a kind by their titles: with their names, or their numbers where they are several."""
    return {f"&{group}" + (f" {keys.get('name', number)}" if len(several) > 1 or "name" in keys else ""): keys for number, keys in enumerate(several, 1)}
