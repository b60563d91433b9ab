"""The generated pages of docs/reference/ are what the source gives now, and leave nothing out."""

import dataclasses
import inspect
import re
import tomllib

import pytest
import reference_pages
import reference_source

import rig
from rig.core.files import bundled
from rig.core.frame import DISCRETES, SIGNALS
from rig.log.recordings.vote_config import read_config
from rig.world.faults import KINDS
from rig.world.faults.fault_catalogue import entries
from rig.world.faults.fault_settings import Triggered


def page(name: str) -> str:
    return (reference_pages.FOLDER / f"{name}.md").read_text()


@pytest.mark.parametrize("name", reference_pages.PAGES)
def test_a_generated_page_is_what_its_template_and_the_source_give(name: str):
    """To renew it: ``make reference``."""
    assert page(name) == reference_pages.written(name)


def test_every_bundled_scenario_is_in_one_group_of_the_gallery():
    grouped = [name for names in reference_pages.GROUPS.values() for name in names.split()]
    assert sorted(grouped) == sorted(path.stem for path in bundled("faults").glob("*.toml"))
    assert page("gallery").count("| `rig fly ") == len(grouped)


def test_every_bundled_scenario_has_a_title_and_a_description():
    for path in bundled("faults").glob("*.toml"):
        assert path.read_text().startswith("# ") and "\ntitle = " in path.read_text(), path.stem


def test_every_kind_of_fault_has_a_section_with_its_keys():
    text = page("faults-and-signals")
    shared, channelled = set(reference_pages.SHARED), {e.kind for e in entries() if reference_pages.channelled(e)}
    for kind, model in KINDS.items():
        section = text.partition(f"\n### {kind}\n")[2].partition("\n### ")[0]
        keys = set(model.model_fields) - set(Triggered.model_fields) - {"kind"}
        assert all(f"| `{key}` |" in section for key in keys - shared), kind
        assert all(f"`{key}`" in section for key in keys & shared - {"channels"}), kind
        assert ("`channels`" in section) == (kind in channelled), kind
    assert all(f"| `{key}` |" in text for key in {*Triggered.model_fields, *shared})


def test_every_signal_has_a_unit_and_a_sign():
    assert set(reference_pages.SIGNS) == {signal.name for signal in SIGNALS}
    text = page("faults-and-signals")
    for one in (*SIGNALS, *DISCRETES):
        assert f"| `{one.name}` |" in text and f"| `{one.topic}` |" in text


def test_the_api_has_every_field_of_a_flight_and_every_parameter_of_a_function():
    sections = {part.partition("\n")[0]: part for part in re.split(r"^### ", page("api"), flags=re.MULTILINE)}
    for name in sorted({*rig.__all__} - {"write_report"}):
        one = getattr(rig, name)
        if inspect.isclass(one):
            continue
        for parameter in inspect.signature(one).parameters:
            assert f"| `{parameter}` |" in sections[f"rig.{name}"], (name, parameter)
    fields = [field.name for field in dataclasses.fields(rig.Flight)]
    assert len(fields) > 20 and all(f"| `{name}` |" in sections["rig.Flight"] for name in fields)
    for one in (rig.Flight, rig.Log):
        public = [name for name, _ in inspect.getmembers(one) if name[0] != "_" and name not in reference_pages.HIDDEN]
        missing = [name for name in public if not re.search(rf"\| `{name}[`(]", sections[f"rig.{one.__name__}"])]
        assert missing == []
    assert set(rig.__all__) - {"write_report"} <= {head.removeprefix("rig.") for head in sections}


def test_a_field_without_a_comment_and_a_parameter_without_a_meaning_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(reference_source, "ROOT", tmp_path)
    (tmp_path / "bare_field.py").write_text("class Bare:\n    size: int\n")
    (tmp_path / "bare_call.py").write_text('def call(size: int):\n    """Return it."""\n')
    with pytest.raises(KeyError, match="size has no comment"):
        reference_source.class_of([("bare_field.py", "Bare")], "Bare")
    with pytest.raises(KeyError, match="size has no meaning"):
        reference_source.function("bare_call.py", "call", "call")


@pytest.mark.parametrize("name", ["faults-and-signals", "scenario"])
def test_every_example_of_a_scenario_can_be_loaded(name: str):
    blocks = re.findall(r"^```toml\n(.*?)^```", page(name), re.DOTALL | re.MULTILINE)
    assert blocks
    for text in blocks:
        table = tomllib.loads(text)
        assert rig.load({"duration_s": 20.0, **table}).frames == 2000 and table.keys() <= {"faults", "live"}


def test_the_example_of_a_configuration_is_accepted(tmp_path):
    (text,) = re.findall(r"^```toml\n(.*?)^```", page("recordings"), re.DOTALL | re.MULTILINE)
    (tmp_path / "config.toml").write_text(text)
    config = read_config(tmp_path / "config.toml")
    assert config.signal["heading"]["wraps"] and list(config.mapping) == [f"pitch_rate.{c}" for c in (1, 2, 3)]
