"""Sequences of faults: which there are, what they came to, which sets are minimal, and how they are flown again."""

import itertools
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from rig.core import sealed
from rig.core.errors import BadInput
from rig.core.outputs import CUTSETS, SETS
from rig.core.trust import Trust
from rig.scenario.aircraft import folder
from rig.studies.campaign.folder import open_folder
from rig.studies.campaign.tables import sha256
from rig.studies.campaign.worker import fly_batch
from rig.studies.safety import confirm_sets as confirm
from rig.studies.safety.cutset_plan import NO_CODE, STUDY, Asked, plan, read_asked
from rig.studies.safety.cutset_plan import fly as fly_sequences
from rig.studies.safety.cutsets import ANNOUNCED, WRONG, Counted, jeffreys, lost_flights, minimal, subsets
from rig.studies.safety.sequences import CONDITIONS, KINDS, LARGEST, LEAST, NEAR_S, REFERENCE, flights, sequences

LATENT = "level-then-manoeuvre-settled"
ASKED = Asked("f16", "pitch_rate", 3, 20, (LATENT,), 0, {})


def test_sequences_of_five_kinds_and_with_the_reference_once():
    assert len(sequences(3, KINDS)) == 5 + 25 + 125
    assert len(sequences(3)) == 7 + 45 + 275  # two modes of the reference, which fails once at most
    assert all(sum(mode in REFERENCE for mode in each) <= 1 for each in sequences(3))


@pytest.mark.parametrize("condition", CONDITIONS)
def test_the_faults_of_a_flight_come_in_order_on_channels_of_their_own(condition: str):
    when = CONDITIONS[condition]
    for each in flights("pitch_rate", ("stuck", "offset", "hardover"), range(1, 5), when, 50, 1):
        starts = [fault["start_s"] for fault in each]
        gaps = [later - before for before, later in itertools.pairwise(starts)]
        assert len({fault["channels"][0] for fault in each}) == 3
        assert all(-1e-9 <= gap <= NEAR_S + 0.01 if when.gap == "near" else gap > 0.7 for gap in gaps)
        assert LEAST <= abs(each[1]["offset_thresholds"]) <= LARGEST
        begin_s = when.manoeuvre_s[0] if when.manoeuvre_s else 0.0
        assert starts[-1] < begin_s if condition == LATENT else starts[0] > begin_s


def test_a_flight_depends_on_the_seed_and_its_sequence_alone():
    draw: Callable[..., Any] = lambda seed, *modes: flights(  # noqa: E731
        "pitch_rate", modes, range(1, 5), CONDITIONS[LATENT], 3, seed
    )
    assert draw(1, "stuck") == draw(1, "stuck") != draw(2, "stuck")
    of_plan = plan(replace(ASKED, order=1, flights=3, seed=1), LATENT, NO_CODE)
    assert of_plan.choices[3]["sequence"] == "stuck" and [of_plan.data(n)["faults"] for n in (3, 4, 5)] == draw(
        1, "stuck"
    )


def test_a_duplex_signal_has_no_sequences_of_three_channels():
    made = plan(replace(ASKED, flights=1, set={"sensors.pitch_rate.channels": 2}), LATENT, NO_CODE)
    longest = [choice["sequence"].split(", ") for choice in made.choices if choice["sequence"].count(",") == 2]
    assert longest and all(sum(mode in REFERENCE for mode in each) == 1 for each in longest)


def tables(*flown: tuple[str, bool, list[dict[str, Any]], float]) -> dict[str, pl.DataFrame]:
    """Runs: sequence, survived, their windows, and the seconds at level 0 of the signal."""
    window = {"signal": "pitch_rate", "vote_correct": True, "lost_s": 0.0, "wrong_vote_first": False}
    runs = [
        {"run": i, "outcome": "flown", "sequence": name, "survived": ok} for i, (name, ok, _, _) in enumerate(flown)
    ]
    faults = [
        {**window, "run": i, "onset_s": float(k), **one}
        for i, (_, _, of_run, _) in enumerate(flown)
        for k, one in enumerate(of_run)
    ]
    signals = [{"run": i, "signal": "pitch_rate", "lost_s": lost} for i, (*_, lost) in enumerate(flown)]
    return {"runs": pl.DataFrame(runs), "faults": pl.DataFrame(faults), "signals": pl.DataFrame(signals)}


OFF, DECLARED = {"vote_correct": False}, {"lost_s": 0.4}


def test_what_came_first_decides_what_a_flight_is():
    found = lost_flights(
        tables(
            ("stuck", True, [{}], 0.0),
            ("stuck", False, [OFF], 0.0),
            ("stuck", True, [{**OFF, **DECLARED}], 0.4),
            ("stuck", True, [{**OFF, **DECLARED, "wrong_vote_first": True}], 0.4),
            ("stuck, stuck", True, [OFF, {}], 0.0),  # off when the next fault came, within a monitor's time
            ("stuck, stuck", True, [DECLARED, OFF], 0.4),
            ("reference offset", True, [], 0.4),  # on no channel: the signal's own seconds
        ),
        "pitch_rate",
    )
    assert found["first"].to_list() == [None, WRONG, ANNOUNCED, WRONG, None, ANNOUNCED, ANNOUNCED]


def test_jeffreys_interval_is_the_published_one():
    # Brown, Cai and DasGupta (2001), table 5: n = 7, of 0 to 3, to three digits.
    expected = {0: (0.0, 0.292), 1: (0.016, 0.501), 2: (0.065, 0.648), 3: (0.139, 0.766)}
    for count, ends in expected.items():
        assert jeffreys(count, 7) == pytest.approx(ends, abs=6e-4)
    assert jeffreys(7, 7)[1] == 1.0 and jeffreys(0, 20)[1] == pytest.approx(0.12, abs=0.005)


def test_a_set_is_minimal_when_its_interval_is_above_those_of_its_subsets():
    counts = {
        ("stuck",): Counted(20),
        ("hardover",): Counted(20),
        ("stuck", "stuck"): Counted(20),
        ("hardover", "stuck"): Counted(20),
        ("stuck", "hardover"): Counted(20, 1),  # seen once: its interval overlaps
        ("hardover", "stuck", "stuck"): Counted(20),  # an order that never loses
        ("stuck", "hardover", "stuck"): Counted(20, 12, 8),
        ("stuck", "stuck", "hardover"): Counted(20, 20, aircraft_lost=20),
    }
    (found,) = minimal(ASKED, {LATENT: counts})
    assert found.modes in (("stuck", "hardover", "stuck"), ("stuck", "stuck", "hardover"))
    told = found.as_dict()
    assert told["lost"] == [40, 60] and told["wrong_vote_first"] == 32 and told["announced_first"] == 8
    assert [order["lost"] for order in told["orders"]] == [[0, 20], [20, 20], [20, 20]]
    assert (told["condition"], told["gap"]) == ("level then manoeuvre", "settled")


def test_a_larger_set_is_not_minimal_when_a_part_of_it_loses_as_often():
    counts = {("stuck",): Counted(20, 20), ("hardover",): Counted(20), ("hardover", "stuck"): Counted(40, 40)}
    assert [each.modes for each in minimal(ASKED, {LATENT: counts})] == [("stuck",)]


def test_proper_subsets_are_of_modes_not_of_places():
    assert subsets(("stuck", "stuck", "hardover")) == {
        ("stuck",), ("hardover",), ("stuck", "stuck"), ("hardover", "stuck")
    }  # fmt: skip


CHECK = "rig.studies.safety.cutset_plan.fly_alone"  # of a condition without a fault, in a process of its own


def small(**given: Any) -> Asked:
    return replace(ASKED, order=1, flights=2, conditions=("manoeuvre-near",), **given)


def test_a_folder_of_something_else_is_refused_before_any_flight(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    flown = list[Any]()
    monkeypatch.setattr(CHECK, lambda *given: flown.append(given))
    (tmp_path / "mine.txt").write_text("x")
    with pytest.raises(BadInput, match="is not empty"):
        fly_sequences(small(), tmp_path, 1)
    assert not flown and [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.long
def test_an_interrupted_enumeration_gives_the_same_tables_with_any_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(CHECK, fly_batch)
    fly_sequences(small(), tmp_path / "out", 2)
    folder = tmp_path / "out" / "manoeuvre-near"
    whole = sha256(open_folder(folder).tables)
    (part,) = (folder / "runs").glob("*.parquet")
    part.unlink()  # what a kill leaves: tables without their runs
    fly_sequences(small(), tmp_path / "out", 1)
    assert sha256(open_folder(folder).tables) == whole
    assert open_folder(folder).tables["runs"]["outcome"].to_list() == ["flown"] * 14


def test_a_folder_that_was_asked_otherwise_is_refused(tmp_path: Path):
    with STUDY.held(tmp_path / "out", small().as_dict()):
        pass
    for other, named in (
        (small(aircraft="b747"), "aircraft was f16, is b747"),
        (small(set={"redundancy.manager": "mean"}), "set was {}, is {'redundancy.manager': 'mean'}"),
    ):
        of_other = STUDY.held(tmp_path / "out", other.as_dict())
        with pytest.raises(BadInput, match=f"contains other flights: {named}"), of_other:
            pass
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "notes.txt").write_text("mine")
    of_user = STUDY.held(tmp_path / "x", small().as_dict())
    with pytest.raises(BadInput, match="is not empty and not a folder of cut sets"), of_user:
        pass


FALLS = """
class Falls:
    \"\"\"Fails where a sample is far off, so no healthy flight shows it.\"\"\"
    def __init__(self, params):
        pass

    def step(self, bus, fcc, k):
        if abs(bus[k]["channels"][0]).max() > 1.0:
            raise RuntimeError("far off")
        fcc[k]["voted"][:] = bus[k]["channels"][:, 0]
        fcc[k]["level"][:] = 4
"""


def test_sequences_that_could_not_be_flown_are_told_and_flown_again(
    rig_command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(CHECK, fly_batch)
    (tmp_path / "falls.py").write_text(FALLS)
    asked = ("--order", "1", "--flights", "1", "--conditions", "level-settled", "--workers", "1", "--out", "out")
    for _ in range(2):
        code, out, err = rig_command("reliability", "cutsets", *asked, "--set", "redundancy.manager=falls:Falls")
        assert code == 1 and "sequences" not in out
        assert "could not be flown; run " in err and "far off" in err
        assert err.endswith("the same command flies them again\n")
    outcomes = set(open_folder(tmp_path / "out" / "level-settled").tables["runs"]["outcome"])
    assert outcomes == {"flown", "failed"} and not (tmp_path / "out" / SETS).exists()


def test_a_class_that_a_folder_names_flies_again_with_permission_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "permitted.py").write_text(FALLS)
    monkeypatch.syspath_prepend(tmp_path)
    found = claimed(tmp_path, {"stuck": [20, 20]}, {})
    asked = replace(ASKED, set={"redundancy.manager": "permitted:Falls"})
    with pytest.raises(BadInput, match=r"cutsets.json: redundancy.manager: 'permitted:Falls' is code, .* --allow-code"):
        confirm.plans(asked, found, ["f16"], [], 5, 7, Trust("cutsets.json"))[f"f16-{LATENT}"].check()
    confirm.plans(asked, found, ["f16"], [], 5, 7, Trust("cutsets.json", allow_code=True))[f"f16-{LATENT}"].check()


@pytest.mark.long
def test_a_condition_that_loses_the_signal_without_a_fault_is_refused_before_the_first_flight(
    rig_command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    asked = ("--order", "1", "--flights", "1", "--conditions", "level-settled", "--out", "out")
    noisy = ("--set", "sensors.pitch_rate.noise_std=0.5")
    code, _, err = rig_command("reliability", "cutsets", *asked, *noisy)
    assert code == 2 and "error: --conditions level-settled: the voted pitch_rate is wrong for" in err
    run, signal = {"outcome": "flown", "survived": True}, {"signal": "pitch_rate", "vote_above_threshold_s": 0.0}
    for rows, what in (
        ({"runs": [run], "signals": [{**signal, "lost_s": 2.5}]}, "pitch_rate is lost for 2.5 s"),
        ({"runs": [{**run, "survived": False}], "signals": [{**signal, "lost_s": 0.0}]}, "the aircraft is lost"),
    ):
        monkeypatch.setattr(CHECK, lambda *_, rows=rows: rows)
        code, _, err = rig_command("reliability", "cutsets", *asked)
        assert code == 2 and f"level-settled: {what} already without a fault, so no sequence can be" in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--order", "4"), "--order 4: must be from 1 to 3"),
        (("--order", "0"), "--order 0: must be from 1 to 3"),
        (("--signal", "pitch_rat"), "--signal: unknown signal 'pitch_rat', nearest: pitch_rate"),
        (("--conditions", "turn"), "--conditions: unknown 'turn'"),
        (("--conditions", ","), "--conditions: must be names, separated by commas, got ,"),
        (("--conditions", ""), "--conditions: must be names, separated by commas, got nothing"),
        (("--aircraft", "f61"), "f61"),
        (("--set", "redundancy.manager=nobody"), "nobody"),
    ],
)
def test_bad_options_of_cutsets_are_one_line(rig_command, tmp_path: Path, options, message):
    code, _, err = rig_command("reliability", "cutsets", "--out", str(tmp_path / "out"), *options)
    assert code == 2 and err.count("\n") == 1 and message in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 99}', '{"format": 1}', '{"format": 1, "aircraft": 3}'])
def test_a_damaged_folder_is_one_line(rig_command, tmp_path: Path, text: str):
    (tmp_path / CUTSETS).write_text(text)
    code, _, err = rig_command("reliability", "confirm", str(tmp_path))
    assert code == 2 and err.count("\n") == 1 and CUTSETS in err
    with pytest.raises(BadInput, match=CUTSETS):
        read_asked(tmp_path)


def test_a_foreign_folder_and_an_enumeration_that_did_not_end_are_refused(rig_command, tmp_path: Path):
    code, _, err = rig_command("reliability", "confirm", str(tmp_path))
    assert code == 2 and "not a folder of cut sets" in err
    with STUDY.held(tmp_path / "out", small().as_dict()):
        pass
    code, _, err = rig_command("reliability", "confirm", str(tmp_path / "out"))
    assert code == 2 and "sets.json is missing" in err


def claimed(folder: Path, orders: dict[str, list[int]], parts: dict[str, list[int]]) -> list[confirm.Claim]:
    rows = [[{"modes": name.split(", "), "lost": lost} for name, lost in of.items()] for of in (orders, parts)]
    one = dict.fromkeys(confirm.SHOWN, 0)
    one |= {"condition": "level then manoeuvre", "gap": "settled", "modes": ["stuck", "offset"]}
    confirm.write_sets(folder, {"format": 1, "flown": {}, "sets": [{**one, "orders": rows[0], "subsets": rows[1]}]})
    return confirm.claims(folder)


def test_a_set_whose_chances_are_swapped_between_two_orders_is_named(monkeypatch, tmp_path: Path):
    """Planted: the enumeration is said to lose offset then stuck, and flights lose stuck then offset."""
    found = claimed(
        tmp_path, {"stuck, offset": [0, 20], "offset, stuck": [20, 20]}, {"stuck": [0, 20], "offset": [0, 20]}
    )
    truth = {
        ("stuck", "offset"): Counted(20, 20),
        ("offset", "stuck"): Counted(20),
        ("stuck",): Counted(20),
        ("offset",): Counted(20, 1),
    }
    monkeypatch.setattr(confirm, "of_campaign", lambda folder, signal: truth)
    made = confirm.plans(ASKED, found, ["f16"], [], 20, 7)
    rows = confirm.rows(tmp_path, "pitch_rate", found, made)
    assert [(", ".join(row.modes), row.agrees) for row in rows[:2]] == [
        ("offset, stuck", False),
        ("stuck, offset", False),
    ]
    assert [row.agrees for row in rows[2:]] == [True, True] and rows[0].p_value < 1e-9
    assert rows[0].shows == "p < 0.12 only"  # 0 of 20 shows no more


def test_sets_are_flown_again_on_one_aircraft_at_least(rig_command, tmp_path: Path):
    with STUDY.held(tmp_path / "out", ASKED.as_dict()):
        claimed(tmp_path / "out", {"stuck": [20, 20]}, {})
    code, _, err = rig_command("reliability", "confirm", str(tmp_path / "out"), "--aircraft", ",")
    assert (code, err) == (2, "error: --aircraft: must be names, separated by commas, got ,\n")


def test_sets_of_two_conditions_are_compared_each_with_its_own_flights(monkeypatch, tmp_path: Path):
    found = claimed(tmp_path, {"stuck": [20, 20]}, {})
    found += [replace(found[0], condition="manoeuvre-settled", sequences={("stuck",): (0, 20)})]
    truth = {f"f16-{LATENT}": Counted(20, 20), "f16-manoeuvre-settled": Counted(20)}
    monkeypatch.setattr(confirm, "of_campaign", lambda folder, signal: {("stuck",): truth[folder.name]})
    rows = confirm.rows(tmp_path, "pitch_rate", found, confirm.plans(ASKED, found, ["f16"], [], 20, 7))
    assert [(row.condition, row.agrees) for row in rows] == [(LATENT, True), ("manoeuvre-settled", True)]


def test_new_flights_are_of_every_order_and_subset_on_every_aircraft_and_point(tmp_path: Path):
    found = claimed(
        tmp_path, {"stuck, offset": [9, 20], "offset, stuck": [3, 20]}, {"stuck": [0, 20], "offset": [0, 20]}
    )
    made = confirm.plans(ASKED, found, ["f16", "b747"], [], 5, 7)
    assert list(made) == [f"f16-{LATENT}", f"b747-{LATENT}"]
    assert {choice["sequence"] for choice in made[f"b747-{LATENT}"].choices} == {
        "stuck", "offset", "stuck, offset", "offset, stuck"
    }  # fmt: skip
    assert made[f"f16-{LATENT}"][0].data["faults"] != plan(ASKED, LATENT, NO_CODE)[20].data["faults"]
    with pytest.raises(BadInput, match="the enumeration has this seed"):
        confirm.plans(ASKED, found, ["f16"], [], 5, ASKED.seed)
    (at_point,) = confirm.plans(ASKED, found, ["f16"], ["10000ft_m08"], 5, 7).values()
    assert at_point[0].scenario().flight_point == "10000ft_m08"


def test_flights_of_an_aircraft_of_ones_own_stay_in_the_folder(tmp_path: Path):
    found = claimed(tmp_path, {"stuck, offset": [9, 20], "offset, stuck": [3, 20]}, {"stuck": [0, 20]})
    own = tmp_path / "mine"
    shutil.copytree(folder("f16"), own)
    (name,) = confirm.plans(ASKED, found, [str(own)], [], 5, 7)
    assert Path("confirm", name).parent == Path("confirm") and name.endswith(f"_mine-{LATENT}")


def test_damaged_sets_are_one_line(tmp_path: Path):
    whole = {"format": 1, "flown": {}, "sets": [dict.fromkeys(confirm.SHOWN, 0)]}
    for data in ({"format": 1}, {"format": 1, "flown": {}, "sets": [{"orders": 3}]}, whole, {**whole, "format": 2}):
        (tmp_path / SETS).write_text(json.dumps(data))
        with pytest.raises(BadInput, match=r"sets\.json: is damaged"):
            confirm.claims(tmp_path)
    assert json.loads((tmp_path / SETS).read_text())  # left as it was
    of_this_version = sealed.to_json({"format": 2, "flown": {}, "sets": []})
    (tmp_path / SETS).write_bytes(of_this_version)
    assert confirm.claims(tmp_path) == []
    (tmp_path / SETS).write_bytes(of_this_version.replace(b"flown", b"flowm"))
    with pytest.raises(BadInput, match=r"sets\.json: is damaged: its bytes were changed after it was written"):
        confirm.claims(tmp_path)


RATES = """
[pitch_rate]
per_hour = [1e-3]
source = "a test"
kinds = { stuck = 0.5, offset = 0.5 }
"""


def test_the_tree_of_a_folder_of_cut_sets_is_of_its_minimal_sets(rig_command, tmp_path: Path):
    folder, rates = tmp_path / "sets", tmp_path / "rates.toml"
    rates.write_text(RATES)
    with STUDY.held(folder, ASKED.as_dict()):
        pass
    claimed(folder, {"stuck, offset": [15, 20], "offset, stuck": [5, 20]}, {"stuck": [0, 20], "offset": [0, 20]})
    command = ("reliability", "tree", str(folder), "--rates", str(rates), "--out", str(tmp_path / "tree.xml"))
    code, out, err = rig_command(*command, "--json")
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["not_correct"] == {"offset, stuck": 0.5} and told["static"] == "upper bound"
    # Two of four channels fail, in different modes by half, and lose by half.
    assert told["chain"]["1"] == pytest.approx(6 * 1e-6 * 0.5 * 0.5, rel=0.01)


def test_a_top_event_that_nothing_reaches_is_refused(rig_command, tmp_path: Path):
    folder, rates = tmp_path / "sets", tmp_path / "rates.toml"
    rates.write_text(RATES)
    with STUDY.held(folder, ASKED.as_dict()):
        pass
    claimed(folder, {"stuck, offset": [0, 20], "offset, stuck": [0, 20]}, {})
    command = ("reliability", "tree", str(folder), "--rates", str(rates), "--out", str(tmp_path / "tree.xml"))
    code, _, err = rig_command(*command)
    assert code == 2 and "the top event cannot happen" in err and not (tmp_path / "tree.xml").exists()
    rates.write_text(RATES.replace("pitch_rate", "roll_rate"))
    code, _, err = rig_command(*command)
    assert code == 2 and "cut sets of pitch_rate, not of roll_rate" in err
