"""The scenarios of the atlas violate their requirement when they are flown; the page names all of them."""

import re
from pathlib import Path
from xml.sax.saxutils import escape

import pytest
from atlas_page import LEGEND, MET_NOW, MIXED, look

from rig.core.palette import BLUE, LIGHT_BLUE, PALE_BLUE, PALE_RED
from rig.scenario.scenario import load
from rig.verdict.requirements.measure import fly_requirements
from rig.verdict.requirements.requirement import load_requirements

ROOT = Path(__file__).parents[1]
WORST = sorted((ROOT / "faults" / "worst").glob("*.toml"))
PAGE, DRAWN = ((ROOT / "docs" / name).read_text() for name in ("results/measured/worst.md", "pictures/worst.svg"))
HATCH = r'<rect [^>]*fill="url\(#some\)"/>'
PICTURE = re.sub(HATCH, "", DRAWN)
OURS = [path for path in WORST if path.stem.endswith("cross_channel")]

STILL = [path for path in OURS if path.stem not in MET_NOW]


def test_all_can_be_loaded_and_carry_their_requirement():
    assert 5 <= len(WORST) <= 12 and len(OURS) >= 4
    for path in WORST:
        scenario = load(path)
        assert scenario.requirements == ["redundancy"] and "vote violated in" in scenario.title
        assert scenario.redundancy.manager.replace("-", "_") in path.stem


@pytest.mark.parametrize("path", [STILL[0], WORST[-1]], ids=lambda path: path.stem)
def test_one_violates_when_it_is_flown(path: Path):
    vote = [each for each in load_requirements(["redundancy"]) if each.id == "vote"]
    assert [verdict.status for verdict in fly_requirements(load(path), vote)] == ["violated"]


def test_one_that_is_settled_by_now_is_met():
    vote = [each for each in load_requirements(["redundancy"]) if each.id == "vote"]
    path = ROOT / "faults" / "worst" / f"{MET_NOW[0]}.toml"
    assert [verdict.status for verdict in fly_requirements(load(path), vote)] == ["met"]
    assert all(f"`{name}`" in (ROOT / "docs" / "results" / "measured" / "worst.md").read_text() for name in MET_NOW)


def cells_of_the_page() -> list[tuple[str, int, int]]:
    """Robustness, flights that violate, flights, of each row of the tables, in their order."""
    rows = re.findall(r"^\| [a-z ]+ \| \d \| (-?[\d.]+) \| (\d+) of (\d+) \|", PAGE, re.MULTILINE)
    return [(robustness, int(violated), int(flights)) for robustness, violated, flights in rows]


def test_the_page_and_the_picture_have_every_scenario_and_the_picture_leads_nowhere():
    for path in WORST:
        assert f"| `{path.stem}` |" in PAGE
    assert len(re.findall(r'<rect [^>]* class="edge"/><text', PICTURE)) == len(WORST)
    assert "href" not in PICTURE  # the site has no scenarios


def test_the_picture_has_the_numbers_of_the_page_and_no_cell_with_a_violating_flight_is_blue():
    cells = re.findall(
        r'fill="([^"]+)" [^>]*/><text [^>]*>([^<]+)</text><text [^>]*>(\d+) of (\d+)</text></g>', PICTURE
    )
    assert len(cells) == len(cells_of_the_page()) == 108
    blue, mixed = {BLUE, LIGHT_BLUE, PALE_BLUE}, MIXED[0]
    for (fill, robustness, *count), (told, violated, flights) in zip(cells, cells_of_the_page(), strict=True):
        assert [int(each) for each in count] == [violated, flights]
        assert float(robustness) == pytest.approx(float(told), abs=0.051)
        assert (fill in blue) == (violated == 0) and (fill == mixed) == (0 < violated < flights)
    assert all(f">{escape(what)}<" in PICTURE for _, what in LEGEND)


def test_the_sentences_of_the_page_count_what_its_tables_have():
    numbers = re.findall(r"in all flights of (\d+) cells, in some of (\d+), in none of (\d+)", PAGE)
    violated = [violated for _, violated, _ in cells_of_the_page()]
    every, some, none = (sum(int(each) for each in of) for of in zip(*numbers, strict=True))
    assert len(numbers) == 9 and (every, none) == (violated.count(5), violated.count(0)) and every + some + none == 108


def test_one_violating_flight_is_enough_for_a_cell_not_to_be_met():
    row = {"flown_violated": 1, "seeds": 5, "flown_robustness": 0.49}
    assert look(row) == MIXED and look({**row, "flown_violated": 0})[0] == LIGHT_BLUE
    assert look({**row, "flown_violated": 5, "flown_robustness": -0.5})[0] == PALE_RED


def test_a_scenario_of_the_folder_is_named_within_it():
    assert load("worst/" + OURS[0].stem).title == load(OURS[0]).title


def test_cells_with_both_kinds_of_flights_are_hatched_too():
    mixed = [violated for _, violated, flights in cells_of_the_page() if 0 < violated < flights]
    assert len(re.findall(HATCH, DRAWN)) == len(mixed) + 1  # and the legend's
    assert len(re.findall(rf'fill="{MIXED[0]}" [^>]*/>\s*{HATCH}', DRAWN)) == len(mixed) + 1 and "<desc>" in DRAWN
