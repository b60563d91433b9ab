"""What the pages say is what the program does."""

import re
from pathlib import Path

import numpy as np
import pytest
import requirements

from rig.cli.catalogue import signal_rows
from rig.core.files import bundled
from rig.core.frame import INDEX, Block, State
from rig.flight.loop import Rig, frames
from rig.scenario import aircraft, scenario

ROOT = Path(__file__).parent.parent
EXAMPLE = ROOT / "docs" / "examples" / "manager" / "mine.py"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def test_the_table_of_signals_is_that_of_the_frame():
    page = (ROOT / "docs" / "reference" / "faults-and-signals.md").read_text()
    for name, _, unit, span, _, _, topic in signal_rows():
        assert re.search(rf"^\| `{name}` \|.* \| `{topic}` \|$", page, re.MULTILINE)
        assert unit == "0 or 1" or (f" | {unit} | " in page and f" | {span} | " in page)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_named_file_exists(page: Path):
    named = set(re.findall(r"`((?:rig|aircraft|faults|tests|docs)/[\w/.]+\.(?:py|toml|md))`", page.read_text()))
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_the_readme_names_every_bundled_aircraft():
    text = (ROOT / "README.md").read_text()
    assert all(name in text for name in aircraft.names())


def test_every_bundled_scenario_is_described():
    page = (ROOT / "docs" / "reference" / "gallery.md").read_text()
    for path in bundled("faults").glob("*.toml"):
        assert f"| `rig fly {path.stem}` |" in page


def test_every_test_named_as_evidence_exists():
    defined = {
        name for path in (ROOT / "tests").glob("test_*.py") for name in re.findall(r"def (test_\w+)", path.read_text())
    }
    for page in PAGES:
        assert set(re.findall(r"`(test_\w+)`", page.read_text())) <= defined


@pytest.fixture
def documented(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The managers of docs/examples/manager as ``mine.py`` in the current folder."""
    (tmp_path / "mine.py").write_text(EXAMPLE.read_text())
    monkeypatch.chdir(tmp_path)


def flown(name: str | None, *sets: str, seed: int | None = None) -> Block:
    which = scenario.load(name, ["redundancy.manager=mine:Smoothed", *sets], seed)
    return np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)])


@pytest.mark.usefixtures("documented")
def test_the_manager_in_the_docs_fails_the_faulty_channel():
    rows = flown(None, "duration_s=3", "faults.0.start_s=1")
    assert rows["state"][-1, INDEX["pitch_rate"], 2] == State.FAILED and len(rows) == 300
    assert (rows["state"][-1] == State.FAILED).sum() == 1


@pytest.mark.long
@pytest.mark.usefixtures("documented")
def test_the_manager_in_the_docs_fails_no_healthy_channel_in_a_hundred_flights():
    """Heading north, where the channels of heading lie on both sides of the end of the circle."""
    for seed in range(100):
        point = ("20000ft_m06", "10000ft_m08")[seed % 2]
        sets = ("faults=[]", "duration_s=0.5", f"flight_point={point}", "turbulence=moderate")
        rows = flown("f16_pitch_rate_offset_in_manoeuvre", *sets, seed=seed)
        assert not (rows["state"] == State.FAILED).any(), seed


@pytest.mark.usefixtures("documented")
def test_the_manager_in_the_docs_turns_through_north_without_failing_anybody():
    """A turn to the left from north: heading goes through the end of its circle, roll angle to its limit and back."""
    turn = "pilot.manoeuvres=[{kind='step', axis='heading', start_s=1.0, amplitude=-0.2}]"
    rows = flown(None, "faults=[]", "duration_s=15", turn)
    heading = rows["truth"][:, INDEX["heading"]]
    assert heading.max() > 6.0 and heading.min() < 0.1
    assert not (rows["state"] == State.FAILED).any()
    off = rows["voted"][:, INDEX["heading"]] - heading
    assert np.abs((off + np.pi) % (2 * np.pi) - np.pi).max() < 0.02


def test_the_manager_on_the_page_is_the_one_of_the_example():
    page = (ROOT / "docs" / "reference" / "sensors-and-redundancy.md").read_text()
    (on_the_page,) = re.findall(r"```python title=\"first.py\"\n(.*?)```", page, re.DOTALL)
    imports, _, manager = on_the_page.partition("\n\n")
    assert manager in EXAMPLE.read_text() and imports in EXAMPLE.read_text()


@pytest.mark.usefixtures("documented")
def test_the_compiled_manager_in_the_docs_votes_the_first_valid_channel():
    rows = flown("f16_pitch_rate_hardover", "duration_s=2", "redundancy.manager=mine:first_valid", "faults.0.start_s=1")
    assert np.array_equal(rows["voted"], rows["channels"][:, :, 0])


def test_the_page_of_requirements_is_what_the_tests_say():
    collected = requirements.collect(ROOT / "tests")
    assert requirements.PAGE.read_text() == requirements.written(collected)
    assert sum(map(len, collected.values())) > 50
