"""What MkDocs lacks to make a site of these pages, which are written for GitHub:

- links to files outside doc/ lead to copies of them in the site: pages are pages there, sources are text, folders are lists;
- formulas, `$...$` and blocks `math`, become MathML, which browsers draw without a script;
- anchors of headings are those of GitHub;
- a list needs no blank line before it.
"""
import html
import posixpath
import re
from pathlib import Path

from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[2]
#: pages at the root of the tree and what they are called in the site
ROOT_PAGES = {"README.md": "readme.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
#: files that a browser draws or shows as they are; others are copied as text
SHOWN = {".png", ".svg", ".csv", ".txt", ".yml"}
#: a fenced block, or code within a line: nothing in it is a link or a formula
CODE = re.compile(r"(^ *```.*?^ *```[^\n]*$|``[^\n]+?``|`[^`\n]+`)", re.S | re.M)
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
FORMULA = re.compile(r"(?<![\\\w$])\$(?=\S)((?:[^$\n]|\n(?!\n))+?)(?<=\S)\$(?![\w$])")
FORMULA_BLOCK = re.compile(r"^( *)```math\n(.*?)^ *```[^\n]*$", re.S | re.M)

#: places in the tree, and in the site, of what the site has; formulas of the page at work
placed, formulas = {}, []


def github_anchor(heading, separator="-"):
    """What GitHub makes of a heading."""
    return re.sub(r"[^\w\- ]", "", html.unescape(heading).lower()).replace(" ", separator)


def in_prose(text, change):
    """A page with its prose changed and its code as it is."""
    parts = CODE.split(text)
    return "".join(part if k % 2 else change(part) for k, part in enumerate(parts))


def links(text):
    """Targets of a page's links to other files of the tree, without anchors."""
    found = []
    in_prose(text, lambda part: found.extend(target for _, target, _ in LINK.findall(part)) or part)
    return [target.partition("#")[0] for target in found if not re.match(r"[a-z]+:|#", target)]


def place_of(path):
    """Where a file or folder of the tree stands in the site."""
    name = path.relative_to(ROOT).as_posix()
    if name in ROOT_PAGES:
        return ROOT_PAGES[name]
    if name.startswith("doc/") and not name.startswith("doc/site/") and path.is_file():
        return name[len("doc/"):]
    if path.is_dir():
        return f"tree/{name}/index.md"
    if path.suffix == ".md":
        return f"tree/{name}"
    return f"tree/{name}" if path.suffix in SHOWN else f"tree/{name}.txt"


def listing(folder):
    """The page of a folder: its files, with links."""
    name = folder.relative_to(ROOT).as_posix()
    rows = [f"- [{path.name}]({path.name})" for path in sorted(folder.iterdir())
            if path.name[0] not in "._" and (path.is_file() or (path.is_dir() and any(path.iterdir())))]
    return f"# {name}\n\n" + "\n".join(rows) + "\n"


def on_config(config):
    config["mdx_configs"].setdefault("toc", {})["slugify"] = github_anchor
    next(part["Development"] for part in config["nav"] if "Development" in part).append({"Interfaces of the modules": "api/index.html"})
    reference = next(part["Reference"] for part in config["nav"] if "Reference" in part)
    for kind in ("effect", "boundary", "law"):
        reference.append({f"{kind.capitalize()} pages": [f"reference/{path.name}" for path in sorted(ROOT.glob(f"doc/reference/{kind}_*.md"))]})
    return config


def on_files(files, config):
    """Add what the pages of doc/ lead to, and what these lead to in turn."""
    placed.clear()
    waiting = [Path(file.abs_src_path) for file in files.documentation_pages()] + [ROOT / name for name in ROOT_PAGES]
    while waiting:
        path = waiting.pop()
        if path in placed:
            continue
        placed[path] = place = place_of(path)
        text = listing(path) if path.is_dir() else path.read_text(encoding="utf-8") if path.suffix == ".md" else None
        if files.get_file_from_path(place) is None:
            content = text if text is not None else path.read_bytes()
            files.append(File.generated(config, place, content=content))
        if text is None:
            continue
        base = path if path.is_dir() else path.parent
        for target in links(text):
            led_to = (base / target).resolve()
            if not led_to.exists():
                raise SystemExit(f"{path.relative_to(ROOT)}: {target}: no such file")
            # what a folder holds is not followed into its own folders
            if not (path.is_dir() and led_to.is_dir()):
                waiting.append(led_to)
    # FORD's pages take this place afterwards
    files.append(File.generated(config, "api/index.html", content="<p>FORD has not made the pages of the modules: pip install ford pcpp.</p>"))
    files.append(File.generated(config, "site.css", content=(ROOT / "doc/site/site.css").read_text(encoding="utf-8")))
    return files


def on_page_markdown(markdown, page, config, files):
    at = next(path for path, place in placed.items() if place == page.file.src_uri)
    base, here = at if at.is_dir() else at.parent, posixpath.dirname(page.file.src_uri)

    def lead(match):
        target, mark, anchor = match[2].partition("#")
        if not target or re.match(r"[a-z]+:", match[2]):
            return match[0]
        place = placed.get((base / target).resolve())
        if place is None:  # a folder within a listed folder
            return match[0][:2] + "#" + match[3] if at.is_dir() else match[0]
        return match[1] + posixpath.relpath(place, here or ".") + mark + anchor + match[3]

    formulas.clear()
    markdown = FORMULA_BLOCK.sub(lambda match: f"\n{keep(match[2], 'block')}\n", markdown)
    markdown = in_prose(markdown, lambda part: LINK.sub(lead, FORMULA.sub(lambda match: keep(match[1], "inline"), part)))
    return spaced_lists(markdown)


def spaced_lists(markdown):
    """A blank line before each list that follows a line of text."""
    lines, fenced = [], False
    for line in markdown.split("\n"):
        if re.match(r"(?:[-*]|\d+\.) ", line) and not fenced and lines and re.match(r"(?![-*|#\s]|\d+\. )\S", lines[-1]):
            lines.append("")
        lines.append(line)
        fenced ^= line.lstrip().startswith("```")
    return "\n".join(lines)


def keep(formula, display):
    """A word in the place of a formula, until the page is HTML."""
    formulas.append((" ".join(formula.split()), display))
    return f"FORMULA{len(formulas) - 1}STANDSHERE"


def on_page_content(content, page, config, files):
    from latex2mathml.converter import convert

    def draw(match):
        formula, display = formulas[int(match[1])]
        return convert(formula, display=display)

    return re.sub(r"FORMULA(\d+)STANDSHERE", draw, content)
