"""Page and picture of the atlas of worst cases: docs/results/measured/worst.md and docs/pictures/worst.svg."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final
from xml.sax.saxutils import escape

from rig.core.palette import BLUE, LIGHT_BLUE, PALE_BLUE, PALE_RED, RED
from rig.verdict.context import listed

Row = dict[str, Any]
WIDTH, HEIGHT, LEFT, TOP = 62, 36, 178, 64  # of a cell; of labels
GROUP: Final = 12  # px between groups
MET: Final = ((0.6, BLUE, "#ffffff"), (0.3, LIGHT_BLUE, "#1d2630"), (-1e9, PALE_BLUE, "#1d2630"))
VIOLATED: Final = ((-1.0, PALE_RED, "#1d2630"), (-5.0, "#e08077", "#1d2630"), (-1e9, RED, "#ffffff"))
MIXED: Final = "#fff2ac", "#1d2630"  # hatched too, for readers who do not see the colour
HATCH: Final = (
    '<defs><pattern id="some" width="8" height="8" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
    '<path d="M0 0V8" stroke="#8a6d00" stroke-opacity="0.35" stroke-width="3"/></pattern></defs>'
)
LEGEND: Final = (  # a cell's look and what it is of; edge: with a scenario
    (BLUE, "met in all, median 0.6 or more"), (LIGHT_BLUE, "met in all, 0.3 to 0.6"),
    (PALE_BLUE, "met in all, below 0.3"), (MIXED[0], "violated in some (hatched)"),
    (PALE_RED, "violated in all, down to -1"),
    ("#e08077", "violated in all, -1 to -5"), (RED, "violated in all, below -5"),
    ("none", "outlined: a scenario file in faults/worst"),
)  # fmt: skip
STYLE: Final = (
    "text{font:13px system-ui,sans-serif;text-anchor:middle;fill:#1d2630}"
    ".row{text-anchor:end}.small{font-size:10px}.key{text-anchor:start;font-size:11px}.soft{fill:#5b6773}.edge{stroke:#1d2630;stroke-width:2}"
    "@media(prefers-color-scheme:dark){.label{fill:#e8edf2}.soft{fill:#a9b4bf}.edge{stroke:#e8edf2}}"
)
HEAD: Final = """# Worst cases

This page lists the worst effect of 1, 2 and 3 faults of one sign on the vote of one signal, by manager and aircraft.
A [search](../../how-to/campaigns-and-worst-case.md) looks for the flight with the least robustness of the
[requirement](../../how-to/requirements-and-ci.md) `vote`: the voted value stays within its error limit, or the
signal is lost and the loss is annunciated. The result is flown on {seeds} new seeds. A robustness is in thresholds of
the signal; below 0 the requirement is violated.

![Median robustness of the voted value, by manager, aircraft, signal and faults](../../pictures/worst.svg)

The upper number of a cell is the median robustness of its {seeds} flights. The lower one counts the flights that
violate the requirement. Blue: none violates. Yellow and hatched: some violate. Red: all violate. An outlined cell has
a scenario in `faults/worst/` from an earlier search, which may be worse than the result of this one. The tables below
have the same numbers, the faults and the reasons.

- Space: drifts (0.05 to 5 thresholds a second) or offsets (0.4 to 10 thresholds) on the first channels, each from 3
  to 6 s of 14 s in light turbulence.
- Budget: {trials} open-loop trials a cell, 24 of them at random; the candidate of the least robustness is then flown on
  {seeds} new seeds. This small budget finds only what is easy to find: a blue cell is no proof. `first` is the first
  trial that violated.
- Again: `python tests/tools/atlas.py search OUT.json`, `scenarios`, `page`. {total} trials and {flights} flights.

{findings}

## Scenarios

Flights reduced each scenario to few and round numbers, with a seed that violated the requirement when it was found:
`rig fly worst/NAME --requirements redundancy`. Managers have changed since{met}.

{scenarios}
"""
MET_NOW: Final = (  # tests/test_faults_worst.py
    "b737_angle_of_attack_3_cross_channel",
    "b747_angle_of_attack_2_cross_channel",
    "f16_normal_load_factor_3_cross_channel",
    "f16_pitch_rate_3_cross_channel",
)


def write(rows: Sequence[Row], root: Path, seeds: int) -> None:
    """Write page and picture."""
    names = sorted(path.stem for path in (root / "faults" / "worst").glob("*.toml"))
    (root / "docs" / "pictures" / "worst.svg").write_text(picture(rows, names), encoding="utf-8")
    (root / "docs" / "results" / "measured" / "worst.md").write_text(page(rows, names, root, seeds), encoding="utf-8")


def name_of(row: Row) -> str:
    """Return the name of a cell's scenario."""
    return f"{row['aircraft']}_{row['signal']}_{row['faults']}_{row['manager'].replace('-', '_')}"


def picture(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Return the heat map as SVG, on any ground."""
    columns = list(dict.fromkeys((row["signal"], row["faults"]) for row in rows))
    lines = list(dict.fromkeys((row["manager"], row["aircraft"]) for row in rows))
    signals = list(dict.fromkeys(signal for signal, _ in columns))
    managers = list(dict.fromkeys(manager for manager, _ in lines))
    x = {c: LEFT + i * WIDTH + signals.index(c[0]) * GROUP for i, c in enumerate(columns)}
    y = {each: TOP + i * HEIGHT + managers.index(each[0]) * GROUP for i, each in enumerate(lines)}
    parts = [
        *(_text(x[c] + WIDTH / 2, TOP - 8, f"{c[1]} fault{'s' if c[1] > 1 else ''}", "label soft") for c in columns),
        *(_text(x[signal, 2] + WIDTH / 2, TOP - 32, signal.replace("_", " "), "label") for signal in signals),
        *(_text(LEFT - 10, y[each] + HEIGHT / 2 + 5, f"{each[0]}, {each[1]}", "label row") for each in lines),
        *(_cell(row, x[row["signal"], row["faults"]], y[row["manager"], row["aircraft"]], names) for row in rows),
    ]
    width, height = max(x.values()) + WIDTH + 10, max(y.values()) + HEIGHT + 92
    parts += _legend(height - 72)
    size = f'viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">'
    title = "Median robustness of the vote, and flights that violate it, by manager, aircraft, signal and faults"
    about = (
        "A row a manager and aircraft, a column a signal and number of faults. A cell shows the median robustness, and"
    )
    about += " how many of its flights violate the requirement; yellow, hatched cells have both kinds of flights."
    text = [f"<title>{title}</title>", f"<desc>{about}</desc>", f"<style>{STYLE}</style>", HATCH]
    return "\n".join([head, *text, *parts, "</svg>\n"])


def _cell(row: Row, x: float, y: float, names: Sequence[str]) -> str:
    fill, ink = look(row)
    edge = 'class="edge"' if name_of(row) in names else 'stroke="none"'
    box = f'<rect x="{x + 1}" y="{y + 1}" width="{WIDTH - 2}" height="{HEIGHT - 2}" rx="3" fill="{fill}" {edge}/>'
    middle, ink = x + WIDTH / 2, f'style="fill:{ink}"'
    text = f'<text x="{middle}" y="{y + 16}" {ink}>{_short(row["flown_robustness"])}</text>'
    count = f'<text x="{middle}" y="{y + 29}" class="small" {ink}>{row["flown_violated"]} of {row["seeds"]}</text>'
    where = f"{row['manager']}, {row['aircraft']}, {row['signal']}, {row['faults']}"
    title = escape(f"{where}: {row['scenario']}: {row['why']}")
    return f"<g><title>{title}</title>{box}{hatch(fill, x + 1, y + 1, WIDTH - 2, HEIGHT - 2)}{text}{count}</g>"


def hatch(fill: str, x: float, y: float, width: float, height: float) -> str:
    """Return the hatch over a mixed cell, "" for another."""
    place = f'x="{x}" y="{y}" width="{width}" height="{height}"'
    return f'<rect {place} rx="3" fill="url(#some)"/>' if fill == MIXED[0] else ""


def look(row: Row) -> tuple[str, str]:
    """Return the colours of a cell and its text: blue if no flight violates, red if all do, otherwise yellow."""
    if 0 < row["flown_violated"] < row["seeds"]:
        return MIXED
    scale = VIOLATED if row["flown_violated"] else MET
    return next((fill, ink) for bound, fill, ink in scale if row["flown_robustness"] >= bound)


def _legend(top: float) -> list[str]:
    """Return the legend of the colours, three to a line."""
    parts = []
    for i, (fill, what) in enumerate(LEGEND):
        x, y = LEFT + i % 3 * 260, top + i // 3 * 22
        edge = 'class="edge"' if fill == "none" else 'stroke="none"'
        parts.append(f'<rect x="{x}" y="{y}" width="22" height="14" rx="2" fill="{fill}" {edge}/>')
        parts += filter(None, [hatch(fill, x, y, 22, 14)])
        parts.append(_text(x + 28, y + 11, what, "label key"))
    return parts


def _short(robustness: float) -> str:
    return f"{robustness:.2f}" if abs(robustness) < 1.0 else f"{robustness:.1f}"


def _text(x: float, y: float, text: str, kind: str) -> str:
    return f'<text x="{x:g}" y="{y:g}" class="{kind}">{escape(text)}</text>'


def page(rows: Sequence[Row], names: Sequence[str], root: Path, seeds: int) -> str:
    """Return the page."""
    total = sum(row["trials"] for row in rows)
    texts = [HEAD.format(
        seeds=seeds, trials=rows[0]["trials"], total=total, flights=seeds * len(rows),
        findings=findings(rows), scenarios=scenarios(names, root), met=met_now(names),
    )]  # fmt: skip
    for manager, plane in dict.fromkeys((row["manager"], row["aircraft"]) for row in rows):
        texts.append(f"\n## {manager} {plane}\n\n| signal | faults | robustness | violated | first | the case | why |")
        texts.append("|---|---|---|---|---|---|---|")
        texts += [_line(row, seeds) for row in rows if (row["manager"], row["aircraft"]) == (manager, plane)]
    return "\n".join(texts) + "\n"


def _line(row: Row, seeds: int) -> str:
    first = row["trials_to_first"] or "-"
    found = f"{row['flown_robustness']:.2f} | {row['flown_violated']} of {seeds} | {first}"
    name = row["signal"].replace("_", " ")
    return f"| {name} | {row['faults']} | {found} | {row['scenario']} | {row['why']} |"


def findings(rows: Sequence[Row]) -> str:
    """Return in how many cells of each manager all, some or none of the flights violate, a line each."""
    lines = []
    for manager in dict.fromkeys(row["manager"] for row in rows):
        told = []
        for count in dict.fromkeys(row["faults"] for row in rows):
            own = [row for row in rows if (row["manager"], row["faults"]) == (manager, count)]
            every = sum(row["flown_violated"] == row["seeds"] for row in own)
            some = sum(0 < row["flown_violated"] < row["seeds"] for row in own)
            least = min(row["flown_robustness"] for row in own)
            many = f"{count} fault{'s' if count > 1 else ''}"
            told.append(f"{many}: violated in all flights of {every} cells, in some of {some}, in none of "
                        f"{len(own) - every - some} (least median {least:.2f})")  # fmt: skip
        lines.append(f"- `{manager}`: {'; '.join(told)}.")
    return "\n".join(lines)


def met_now(names: Sequence[str]) -> str:
    """Return which scenarios are met by now, as the end of a sentence."""
    met = [f"`{name}`" for name in MET_NOW if name in names]
    return f"; the requirement is met now in {listed(met)}" if met else ""


def scenarios(names: Sequence[str], root: Path) -> str:
    """Return a table of the scenarios that are kept."""
    lines = ["| scenario | what is found |", "|---|---|"]
    for name in names:
        first = (root / "faults" / "worst" / f"{name}.toml").read_text(encoding="utf-8").splitlines()
        title = next(line for line in first if line.startswith("title")).partition('"')[2].rstrip('"')
        lines.append(f"| `{name}` | {title} |")
    return "\n".join(lines)
