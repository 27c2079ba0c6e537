#!/usr/bin/env python3
"""Write the tables of keys of these pages, and the lists of the index, anew from what `gravier --keys` prints.

usage: write_keys.py [--check] [GRAVIER]

A page has a line `<!-- keys of &GROUP where KEY = 'WORD' -->` or `<!-- keys of &GROUP: NAME, NAME ... -->` above a table; the table
follows it up to the line `<!-- end of keys -->`. A new page begins as a copy of another one, with an empty table. With --check nothing
is written, and pages that differ are named with status 1.
"""
import re
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SECTIONS = ["Syntax", "Example", "What it does", "Restrictions", "Related"]
HEAD = "| key | value | unit | default | meaning |\n|---|---|---|---|---|\n"
KINDS = {"effect": "Effects", "boundary": "Boundaries", "law": "Laws"}
TABLE = re.compile(r"(<!-- keys of &(\w+)(?: where (\w+) = '(\w+)'|: ([\w, ]+)) -->\n).*?(?=<!-- end of keys -->)", re.S)
ONLY = re.compile(r" \(only with `(\w+)` = ((?:'\w+'(?:, | or )?)+)\)")


def printed_keys(program):
    """{group: {key: row}} of the reference that the program prints."""
    groups, group = {}, None
    for line in subprocess.run([program, "--keys"], capture_output=True, text=True, check=True).stdout.splitlines():
        if line.startswith("## &"):
            group = groups.setdefault(line[4:], {})
        row = re.match(r"\| `(\w+)` \|", line)
        if row:
            group[row[1]] = line
    return groups


def table(groups, group, chooser, word, names):
    """Rows of the keys by name, or of those that go with a word; links lead from here."""
    rows = []
    for key, row in groups[group].items():
        only = ONLY.search(row)
        if names:
            wanted = key in names
        else:
            wanted = key != chooser and (only is None or only[1] != chooser or f"'{word}'" in only[2])
            row = ONLY.sub("", row) if only and only[1] == chooser else row
        if wanted:
            rows.append(re.sub(r"\]\((?!\w+:|#)", "](../", row))
    missing = set(names or ()) - set(groups[group])
    if missing or not rows:
        raise SystemExit(f"&{group}: no such key: {', '.join(sorted(missing))}")
    return HEAD + "\n".join(rows) + "\n"


def filled(text, groups):
    """A page with its tables as they have to be."""
    def fill(match):
        names = [name.strip() for name in match[5].split(",")] if match[5] else None
        return match[1] + "\n" + table(groups, match[2], match[3], match[4], names) + "\n"

    return TABLE.sub(fill, text)


def pages(kind):
    """Pages of an effect, a boundary or a law, with title and first sentence."""
    for path in sorted(HERE.glob(f"{kind}_*.md")):
        lines = path.read_text(encoding="utf-8").splitlines()
        yield path, lines[0].removeprefix("# "), re.split(r"(?<=\.)\s", " ".join(lines[2:5]))[0]


def index():
    """The page that lists the others."""
    text = ["# Reference: effects, boundaries, laws", "",
            "Each page has the same sections: syntax, an example that runs, what it does, restrictions, related pages. The tables of keys come",
            "from `gravier --keys`; `python3 doc/reference/write_keys.py` writes them and this page. [Input keys](../keys.md) has all keys.", ""]
    for kind, heading in KINDS.items():
        text += [f"## {heading}", "", "| page | what it is |", "|---|---|"]
        text += [f"| [{title}]({path.name}) | {first} |" for path, title, first in pages(kind)]
        text.append("")
    return "\n".join(text)


def main():
    arguments = [word for word in sys.argv[1:] if word != "--check"]
    groups = printed_keys(arguments[0] if arguments else "gravier")
    wanted = {path: filled(path.read_text(encoding="utf-8"), groups) for path in HERE.glob("*_*.md")}
    wanted[HERE / "index.md"] = index()
    old = [path for path, text in wanted.items() if not path.exists() or path.read_text(encoding="utf-8") != text]
    if "--check" in sys.argv:
        for path in old:
            print(f"{path.name}: not as write_keys.py writes it")
        raise SystemExit(1 if old else 0)
    for path in old:
        path.write_text(wanted[path], encoding="utf-8")


if __name__ == "__main__":
    main()
