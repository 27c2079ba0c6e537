"""The site that `./gravier docs` builds: every link and anchor leads somewhere, formulas are drawn, the search finds words, and a browser shows
tables, pictures and formulas whole.

A python3 with mkdocs is looked for as GRAVIER_DOCS_PYTHON and in build/docs, a browser as GRAVIER_BROWSER, chromium, chromium-browser or
google-chrome; without one the test says so and is skipped.
"""
import html.parser
import json
import os
import re
import shutil
import subprocess
import tempfile
import unittest
import urllib.parse
from pathlib import Path

SOURCE = Path(os.environ.get("GRAVIER_SOURCE_DIR", Path(__file__).resolve().parents[2])).resolve()
PYTHON = os.environ.get("GRAVIER_DOCS_PYTHON") or str(SOURCE / "build/docs/bin/python")

BROWSER = os.environ.get("GRAVIER_BROWSER") or next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
#: measures a page within the browser: widths of the window, and of tables and formulas with that of what they show, and pictures
MEASURE = """<script>window.addEventListener('load', () => setTimeout(() => {
  const cut = (one) => [one.scrollWidth, one.clientWidth, one.textContent.trim().slice(0, 60)];
  const found = { across: document.documentElement.scrollWidth, window: window.innerWidth,
    tables: [...document.querySelectorAll('.rst-content table, .wy-table-responsive')].map(cut),
    formulas: [...document.querySelectorAll('math')].map((one) => one.getBoundingClientRect().height),
    images: [...document.images].map((one) => [one.complete, one.naturalWidth, one.clientWidth, one.parentElement.clientWidth, one.src]) };
  const place = document.createElement('pre'); place.id = 'measured'; place.textContent = JSON.stringify(found);
  document.body.append(place); }, 500));</script>"""


def has_mkdocs():
    try:
        return subprocess.run([PYTHON, "-c", "import mkdocs, latex2mathml"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


class Page(html.parser.HTMLParser):
    """Links and anchors of a page, and its text outside code."""

    def __init__(self, text):
        super().__init__()
        self.links, self.anchors, self.words, self.code, self.formulas = [], set(), [], 0, 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        for name in ("href", "src"):
            if attributes.get(name):
                self.links.append(attributes[name])
        for name in ("id", "name"):
            if attributes.get(name):
                self.anchors.add(attributes[name])
        self.code += tag in ("code", "pre", "script", "style")
        self.formulas += tag == "math"

    def handle_endtag(self, tag):
        self.code -= tag in ("code", "pre", "script", "style")

    def handle_data(self, data):
        if self.code <= 0:
            self.words.append(data)


class Site(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        if not has_mkdocs():
            words = f"NO MKDOCS: {PYTHON} has no mkdocs with latex2mathml: the site is not checked; ./gravier docs installs them in build/docs"
            print(words)
            raise unittest.SkipTest(words)
        cls.place = Path(tempfile.mkdtemp(prefix="gravier-site-"))
        cls.addClassCleanup(shutil.rmtree, cls.place, ignore_errors=True)
        done = subprocess.run([PYTHON, "-m", "mkdocs", "build", "--strict", "-f", str(SOURCE / "mkdocs.yml"), "-d", str(cls.place)],
                              capture_output=True, text=True, check=False, cwd=SOURCE)
        cls.said = done.stdout + done.stderr
        cls.status = done.returncode
        cls.pages = {path.relative_to(cls.place).as_posix(): Page(path.read_text(encoding="utf-8")) for path in cls.place.rglob("*.html")}

    def test_it_builds_without_a_warning(self):
        self.assertEqual(self.status, 0, self.said)
        self.assertGreater(len(self.pages), 50)

    def test_links_and_anchors_lead_somewhere(self):
        count = 0
        for name, page in self.pages.items():
            if name == "404.html":  # its links are those of the root of a server
                continue
            for link in page.links:
                address = urllib.parse.urlsplit(link)
                if address.scheme or address.netloc:
                    self.assertIn(address.scheme, ("http", "https", "data", "mailto"), f"{name}: {link}")
                    continue
                count += 1
                path = urllib.parse.unquote(address.path)
                target = (self.place / name).parent / path if path else self.place / name
                self.assertTrue(target.exists(), f"{name}: {link}: no such file in the site")
                anchor = urllib.parse.unquote(address.fragment)
                if anchor and target.suffix == ".html":
                    led_to = self.pages[target.resolve().relative_to(self.place.resolve()).as_posix()]
                    self.assertIn(anchor, led_to.anchors, f"{name}: {link}: no such anchor")
        self.assertGreater(count, 2000)

    def test_nothing_is_fetched_from_elsewhere(self):
        """Scripts, styles and pictures are files of the site."""
        for path in self.place.rglob("*.html"):
            for found in re.findall(r"<(?:script|img|link)\b[^>]*?(?:src|href)=\"((?:https?:)?//[^\"]+)\"", path.read_text(encoding="utf-8")):
                self.assertFalse(found, f"{path.name}: {found}")

    def test_formulas_are_drawn(self):
        """As many as the theory has, and no dollar or placeholder is left in a text."""
        self.assertGreater(self.pages["theory.html"].formulas, 300)
        for name, page in self.pages.items():
            if not name.startswith("tree/"):
                left = re.search(r"STANDSHERE|\$[^$\n]*\\[a-z]+", "".join(page.words))
                self.assertIsNone(left, f"{name}: {left and left[0]}")

    def test_no_markdown_is_left_in_a_text(self):
        """Tables, lists, fences and bold words have become HTML."""
        for name, page in self.pages.items():
            if not name.startswith("tree/"):
                left = re.search(r"^\s*\|.*\|\s*$|^```|\*\*\w", "".join(page.words), re.M)
                self.assertIsNone(left, f"{name}: {left and left[0]}")

    def measured(self, name, width):
        """What MEASURE finds on a page in a window of a width [pixels]."""
        page = self.place / name
        copy = page.with_name("measured_" + page.name)
        copy.write_text(page.read_text(encoding="utf-8").replace("</head>", MEASURE + "</head>"), encoding="utf-8")
        try:
            done = subprocess.run([BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=20000",
                                   f"--user-data-dir={self.place / 'profile'}", f"--window-size={width},900", "--dump-dom", f"file://{copy}"],
                                  capture_output=True, text=True, timeout=300, check=False, env={**os.environ, "HOME": str(self.place)})
        finally:
            copy.unlink()
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(html.unescape(re.search(r'<pre id="measured">(.*?)</pre>', done.stdout, re.S)[1]))

    @unittest.skipUnless(BROWSER, "NO BROWSER: no chromium is found; apt-get install chromium, or set GRAVIER_BROWSER")
    def test_in_a_browser(self):
        """On a screen no table is wider than its place, pictures are there and fit, formulas have a height; on a telephone nothing makes the
        page wider than the window."""
        for name in ("index.html", "validation.html", "reference/effect_stops.html", "theory.html"):
            found = self.measured(name, 1300)
            self.assertLessEqual(found["across"], 1300, name)
            for whole, shown, words in found["tables"]:
                self.assertLessEqual(whole, shown + 1, f"{name}: the table '{words}' is cut")
            self.assertGreaterEqual(len(found["tables"]), 1, name)
            for complete, natural, width, place, source in found["images"]:
                self.assertTrue(complete and natural > 100 and 100 < width <= place, f"{name}: {source}")
            self.assertTrue(all(height > 5 for height in found["formulas"]), name)
            self.assertLessEqual(self.measured(name, 500)["across"], 500, name)
        self.assertGreater(len(found["formulas"]), 300)

    def test_all_pages_of_the_sources_are_there(self):
        for path in [*(SOURCE / "doc").glob("*.md"), *(SOURCE / "doc/reference").glob("*.md")]:
            name = path.relative_to(SOURCE / "doc").with_suffix(".html").as_posix()
            self.assertIn(name, self.pages)
        for name in ("readme.html", "changelog.html", "contributing.html"):
            self.assertIn(name, self.pages)

    def test_the_search_finds_words(self):
        index = json.loads((self.place / "search/search_index.json").read_text(encoding="utf-8"))
        for word, page in (("capillarity", "reference/law_capillary.html"), ("Nesterov", "acceleration.html"), ("walltime", "checkpoints.html"),
                           *((word, "processes.html") for word in ("Bagnold", "repose", "ntruder", "ibrated", "edometer", "irect shear"))):
            self.assertTrue(any(word in entry["text"] and entry["location"].startswith(page) for entry in index["docs"]), word)


if __name__ == "__main__":
    unittest.main()
