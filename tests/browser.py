"""A page in Chromium without a network: what its console says, and where its texts are on a screen of a given width."""

from __future__ import annotations

import json
import re
import subprocess
from html import unescape
from pathlib import Path
from typing import Any, NamedTuple

import outside

_FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update", "--enable-logging=stderr", "--dump-dom"),
    *("--virtual-time-budget=10000", "--window-size=1400,900"),
    "--proxy-server=127.0.0.1:9",  # whatever is asked of a network fails
)
_MEASURE = """<script>setTimeout(() => {
  const box = each => { const r = each.getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom]; };
  const texts = [...document.querySelectorAll(".figure text")].map(each => ({
    figure: each.closest(".figure").id, what: `${each.getAttribute("class") || ""} ${each.closest("g").getAttribute("class") || ""}`,
    text: each.textContent, box: box(each)}));
  const wide = [...document.querySelectorAll("body *")].filter(each => !each.closest(".wide") && !each.closest("svg"));
  const right = Math.max(...wide.map(each => each.getBoundingClientRect().right));
  const hidden = Math.max(0, ...[...document.querySelectorAll(".wide")].map(each => each.scrollWidth - each.clientWidth));
  parent.postMessage(JSON.stringify({texts, right, hidden, drawn: document.querySelectorAll(".figure .main-svg").length}), "*");
}, 2000)</script>"""  # noqa: E501
_FRAME = """<pre id="w{width}"></pre>
<iframe name="w{width}" src="{page}" style="border: 0; width: {width}px; height: 800px"></iframe>"""
_TOLD = """<script>onmessage = told => {
  const from = [...document.querySelectorAll("iframe")].find(each => each.contentWindow === told.source);
  document.getElementById(from.name).textContent = told.data;
}</script>"""


class Text(NamedTuple):
    """A text of a figure; ``what``: its classes and those of its group; px from the left and top of the screen."""

    figure: str
    what: str
    text: str
    left: float
    top: float
    right: float
    bottom: float

    @property
    def middle(self) -> tuple[float, float]:
        """Its x and y."""
        return (self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0

    def covers(self, other: Text) -> bool:
        """Return True if more than a pixel of the other lies under it."""
        across = min(self.right, other.right) - max(self.left, other.left)
        return across > 1.0 and min(self.bottom, other.bottom) - max(self.top, other.top) > 1.0


class Visit(NamedTuple):
    """A page that was opened: errors and warnings, texts, figures drawn, right end of what does not scroll, px.

    hidden : px of the widest table that are reached by scrolling alone
    """

    console: list[str]
    texts: list[Text]
    drawn: int
    right: float
    hidden: float

    def of(self, figure: str, what: str) -> list[Text]:
        """Return the texts of a figure whose classes hold ``what``."""
        return [text for text in self.texts if text.figure == figure and what in text.what]


def visit(page: Path, tmp_path: Path, *widths: int) -> list[Visit]:
    """Open a page on screens so many px wide; what the console says is of all of them."""
    copy, frame = tmp_path / "copy.html", tmp_path / "frame.html"
    copy.write_text(page.read_text().replace("</body>\n</html>", f"{_MEASURE}</body>\n</html>"))
    frame.write_text(_TOLD + "".join(_FRAME.format(page=copy.name, width=width) for width in widths))
    command = [str(outside.chromium()), *_FLAGS, f"--user-data-dir={tmp_path / 'profile'}", frame.as_uri()]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    console = [line for line in ran.stderr.splitlines() if ":CONSOLE" in line and "chrome://" not in line]
    console = [line for line in console if "chrome.t" not in line]
    seen = []
    for width in widths:
        found: Any = re.search(rf'<pre id="w{width}">(.+?)</pre>', ran.stdout, re.DOTALL)
        assert found is not None, ran.stderr
        told = json.loads(unescape(found.group(1)))
        texts = [Text(each["figure"], each["what"], each["text"], *each["box"]) for each in told["texts"]]
        seen.append(Visit(console, texts, told["drawn"], told["right"], told["hidden"]))
    return seen
