"""The page itself: HTML with its style, which loads nothing."""
import html

#: marks, words and colours of grades, which differ by more than their hue
GRADES = {"good": ("✓", "good", "#0072B2"), "doubt": ("!", "mind this", "#B45F00"), "bad": ("✗", "bad", "#A3210F"),
          "unknown": ("?", "not known", "#666666")}

STYLE = """
:root { --ink: #1b1f24; --soft: #57606a; --line: #d8dee4; --fill: #f6f8fa; }
* { box-sizing: border-box; }
body { margin: 0; color: var(--ink); background: #fff; font: 16px/1.5 system-ui, "Segoe UI", "Helvetica Neue", "DejaVu Sans", Arial, sans-serif; }
main { max-width: 980px; margin: 0 auto; padding: 1.2rem 1.2rem 3rem; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0.4rem 0 0.2rem; }
h2 { font-size: 1.25rem; margin: 2.2rem 0 0.7rem; padding-bottom: 0.25rem; border-bottom: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 1.3rem 0 0.4rem; }
p { margin: 0.5rem 0; }
.soft { color: var(--soft); font-size: 0.9rem; }
nav { margin: 0.6rem 0 1rem; font-size: 0.9rem; }
nav a { margin-right: 1rem; color: #0550ae; }
.banner { border: 2px solid; border-radius: 8px; padding: 0.8rem 1rem; margin: 1rem 0; background: var(--fill); }
.banner strong { font-size: 1.2rem; }
.mark { display: inline-block; min-width: 1.5em; padding: 0 0.3em; border-radius: 4px; color: #fff; text-align: center; font-weight: 700; }
table { border-collapse: collapse; width: 100%; font-size: 0.92rem; }
th, td { text-align: left; vertical-align: top; padding: 0.32rem 0.6rem; border-bottom: 1px solid var(--line); }
th { font-weight: 600; background: var(--fill); }
td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.answer { width: 100%; }
td.question { white-space: nowrap; font-weight: 600; }
code, pre { font-family: ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace; font-size: 0.82rem; }
td code { overflow-wrap: anywhere; }
td.key { white-space: nowrap; }
td.value { min-width: 9em; }
pre { background: var(--fill); border: 1px solid var(--line); border-radius: 6px; padding: 0.7rem; white-space: pre-wrap; overflow-wrap: anywhere; }
.wide { overflow-x: auto; }
figure { margin: 0.8rem 0; }
figcaption { color: var(--soft); font-size: 0.9rem; margin-bottom: 0.3rem; }
img { max-width: 100%; height: auto; }
.states { display: flex; flex-wrap: wrap; gap: 1rem; }
.states figure { flex: 1 1 420px; min-width: 0; }
.bar { background: #d5dbe1; height: 0.95rem; min-width: 120px; }
.bar div { background: #0072B2; height: 100%; }
td.bars { width: 45%; vertical-align: middle; }
@media (max-width: 640px) { td.question { white-space: normal; } main { padding: 0.6rem; } }
@media print { nav { display: none; } h2 { break-after: avoid; } figure, tr { break-inside: avoid; } }
"""


def text(words):
    return html.escape(str(words))


def mark(grade):
    sign, word, colour = GRADES[grade]
    return f'<span class="mark" style="background:{colour}" title="{word}" role="img" aria-label="{word}">{sign}</span>'


def banner(grade, sentence, below):
    return (f'<div class="banner" id="headline" data-grade="{grade}" style="border-color:{GRADES[grade][2]}">{mark(grade)} '
            f"<strong>{text(sentence)}</strong><br>{below}</div>")


def table(head, rows, identifier):
    """Cells are HTML, or (class, HTML)."""
    def cell(value):
        return f'<td class="{value[0]}">{value[1]}</td>' if isinstance(value, tuple) else f"<td>{value}</td>"

    top = f"<thead><tr>{''.join(f'<th>{text(name)}</th>' for name in head)}</tr></thead>" if head else ""
    body = "".join(f"<tr>{''.join(cell(value) for value in row)}</tr>" for row in rows)
    return f'<div class="wide"><table id="{identifier}">{top}<tbody>{body}</tbody></table></div>'


def bar(share):
    """A bar of a part of the longest one."""
    return "bars", f'<div class="bar"><div style="width:{100.0 * share:.1f}%"></div></div>'


def figure(caption, image):
    return f"<figure><figcaption>{text(caption)}</figcaption>{image}</figure>"


def page(title, sections):
    """A whole page of sections (identifier, heading, HTML); the first one stands above the list of the others."""
    links = "".join(f'<a href="#{name}">{text(heading)}</a>' for name, heading, _ in sections[1:])
    first, *others = [f'<section id="{name}">{f"<h2>{text(heading)}</h2>" if heading else ""}{body}</section>' for name, heading, body in sections]
    parts = [first, f"<nav>{links}</nav>", *others]
    return ('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">\n"
            f"<title>{text(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body><main>\n" + "\n".join(parts) + "\n</main></body>\n</html>\n")
