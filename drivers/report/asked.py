"""What was asked of a run: the keys of its case that are not at their defaults, with units and meanings where the program can say them."""
import os
import re
import subprocess

import gravier
from gravier.case import ENVIRONMENT, find_program
from gravier.starts import changed_keys


def key_reference(program=None):
    """{(group, key): (unit, default, meaning)} as `gravier --keys` prints them; empty where there is no program."""
    try:
        done = subprocess.run([program or find_program(), "--keys"], capture_output=True, text=True, timeout=30, check=False,
                              env={**ENVIRONMENT, **os.environ})
    except (OSError, subprocess.SubprocessError):
        return {}
    found, group = {}, None
    for line in done.stdout.splitlines() if done.returncode == 0 else []:
        if line.startswith("## &"):
            group = line[4:].strip()
        row = re.match(r"\| `(\w+)` \|([^|]*)\|([^|]*)\|([^|]*)\|(.*)\|$", line)
        if row and group:
            found[group, row[1]] = tuple(text.strip() for text in row.groups()[2:])
    return found


def is_default(key, value, default):
    """Whether a value is the one that a key has without being given, as far as its text tells."""
    written = re.fullmatch(r"`(.*)`", default)
    if not written or "(" in key:
        return False
    try:
        meant = gravier.parse_namelist(f"&x {key} = {written[1]} /")["x"][0].get(key)
    except (gravier.CaseError, KeyError, IndexError, ValueError):
        return False
    if isinstance(meant, list) and isinstance(value, list) and len(value) < len(meant):
        value = value + [meant[k] for k in range(len(value), len(meant))]
    return meant == value


def shown_value(value, most=12):
    """A value as a case has it, shortened where it is long."""
    if isinstance(value, list) and len(value) > most:
        return gravier.value_text(value[:most]) + f", ... ({len(value)} in all)"
    return gravier.value_text(value)


def asked_rows(groups, reference):
    """Rows (group, key, value, unit, default, meaning) of what is not at its default, and the number of keys that are."""
    rows, usual = [], 0
    for group, several in groups.items():
        for number, keys in enumerate(several, 1):
            title = f"&{group}" + (f" {keys.get('name', number)}" if len(several) > 1 or "name" in keys else "")
            for key, value in keys.items():
                unit, default, meaning = reference.get((group, key.split("(")[0]), ("", "", ""))
                if is_default(key, value, default):
                    usual += 1
                elif key != "name":
                    rows.append((title, key, shown_value(value), unit, default.replace("`", ""), meaning.replace("`", "")))
    return rows, usual


def changed_rows(starts, reference):
    """Rows (first step, group, key, value before, value from that step on) of the restarts of a run that changed keys. A key that is not given has its
    default."""
    def value(title, key, given):
        default = reference.get((title.split()[0][1:], key.split("(")[0]), ("", "", ""))[1].replace("`", "")
        return shown_value(given) if given is not None else f"not given{f' ({default})' if default else ''}"
    return [(str(after.step), title, key, value(title, key, old), value(title, key, new)) for before, after in zip(starts, starts[1:])
            for title, key, old, new in changed_keys(before.case, after.case)]
