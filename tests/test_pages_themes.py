"""Every colour of a report has its place on a dark screen, and every figure has a text alternative."""

import json
import re
import subprocess
from html import unescape
from pathlib import Path

import outside
import plotly.graph_objects as go
import pytest

from rig.core import palette
from rig.show.pages.page import lay_out, write_page
from rig.show.pages.themes import CSS, DARK, DARK_CSS, alternative

HEX = re.compile(r"#[0-9a-f]{6}")


def luminance(colour: str) -> float:
    linear = [(int(colour[i : i + 2], 16) / 255.0) ** 2.2 for i in (1, 3, 5)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_every_colour_of_the_palette_has_a_dark_one():
    assert set(HEX.findall(Path(palette.__file__).read_text())) == set(DARK)
    assert set(DARK_CSS) == set(CSS) and all(HEX.fullmatch(colour) for colour in DARK.values())


def test_texts_and_lines_are_readable_on_either_ground():
    for name in ("ink", "soft", "good", "bad"):
        assert contrast(CSS[name], CSS["ground"]) > 4.5 and contrast(DARK_CSS[name], DARK_CSS["ground"]) > 4.5
    for colour in palette.SERIES:
        assert contrast(colour, CSS["ground"]) > 3.0 and contrast(DARK[colour], DARK_CSS["ground"]) > 3.0


def test_a_figure_is_read_by_its_title_its_axes_and_its_lines(tmp_path: Path):
    figure = go.Figure()
    figure.add_scatter(x=[0, 1], y=[1, 2], name="ram")
    lay_out(figure, "position", 300)
    figure.update_xaxes(title="time, s")
    text = "position. axes: time, s. drawn: ram"
    assert alternative(json.loads(figure.to_json() or "")) == text
    described = go.Figure(figure).update_layout(meta={"alternative": "The ram moves."})
    page = tmp_path / "page.html"
    about = {"title": "pictures", "pictures": ["one", "other"]}
    write_page(page, "ding2015.html", {"one": figure, "other": described}, {}, **about)
    found = re.search(r'id="figures">(.*?)</script>', page.read_text(), re.DOTALL)
    assert found is not None
    figures = json.loads(found.group(1))
    assert [of["layout"]["meta"]["alternative"] for of in figures.values()] == [text, "The ram moves."]
    assert 'content="light dark"' in page.read_text() and "screen and (prefers-color-scheme: dark)" in page.read_text()


SHOWN = """<script>setTimeout(() => {
  const of = [...document.querySelectorAll(".figure")].map(each => [each.getAttribute("role"), each.getAttribute("aria-label")]);
  const look = getComputedStyle(document.body).backgroundColor;
  const line = document.querySelector("#lines .scatterlayer .js-line").style.stroke;
  const scale = document.getElementById("map").data[0].colorscale[1][1];
  const legend = [...document.querySelectorAll(".legend div")].map(each => each.innerText.replace(/\\s+/g, " ").trim());
  document.body.innerHTML = "<pre>" + JSON.stringify({of, look, line, scale, legend}) + "</pre>";
}, 1500)</script>"""  # noqa: E501


@pytest.mark.long
@pytest.mark.parametrize("dark", [False, True])
@outside.needs("chromium")
def test_figures_and_page_follow_the_setting_of_the_reader(tmp_path: Path, dark: bool):
    lines, grid = go.Figure(), go.Figure(go.Heatmap(z=[[0.0, 1.0]], colorscale=palette.SHARE_SCALE, name="share"))
    lines.add_scatter(x=[0, 1], y=[1, 2], name="ram", line_color=palette.BLUE, legendgrouptitle_text="position")
    lines.add_scatter(x=[0, 1], y=[2, 2], name="model", line_color=palette.RED, legendgrouptitle_text="computed")
    for figure in (lines, grid):
        lay_out(figure, "picture", 300)
    page = tmp_path / "page.html"
    about = {"title": "pictures", "pictures": ["lines", "map"]}
    write_page(page, "ding2015.html", {"lines": lines, "map": grid}, {}, **about)
    page.write_text(page.read_text().replace("</body>\n</html>", f"{SHOWN}</body>\n</html>"))
    flags = ("--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", "--virtual-time-budget=8000")
    setting = (f"--blink-settings=preferredColorScheme={int(not dark)}", f"--user-data-dir={tmp_path / 'profile'}")
    command = [str(outside.chromium()), *flags, *setting, page.as_uri()]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    found = json.loads(unescape(re.findall(r"<pre>(\{.+?\})</pre>", ran.stdout, re.DOTALL)[-1]))

    def of(colour: str) -> str:
        seen = DARK[colour] if dark else colour
        return f"rgb({', '.join(str(int(seen[i : i + 2], 16)) for i in (1, 3, 5))})"

    assert (found["look"], found["line"]) == (of(palette.WHITE), of(palette.BLUE))
    assert found["scale"] == (DARK[palette.PALE_RED] if dark else palette.PALE_RED)
    assert found["of"][0] == ["img", "picture. drawn: ram; model"]
    assert found["legend"] == ["position ram", "computed model", "share"]
