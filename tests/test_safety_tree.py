"""The fault tree: exact probabilities, the chain beside it, and wrong trees that differ from it."""

import importlib
import json
import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from itertools import permutations, product
from math import comb, exp
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import outside
import polars as pl
import pytest
from test_reliability_result import NO_ALARMS, table

from rig.studies.reliability import compute_results as run_module
from rig.studies.reliability.chain import solve_file
from rig.studies.reliability.rates_file import Layer
from rig.studies.reliability.tally import Cells
from rig.studies.safety.fault_tree import FaultTree, cut_sets, direct_sum, open_psa, probability
from rig.studies.safety.mode_tree import ModeModel, mode_chain, mode_tree
from rig.studies.safety.signal_chain import chain_file, lost, transitions
from rig.studies.safety.signal_tree import SignalModel, signal_tree
from rig.studies.safety.tree_picture import picture
from rig.studies.safety.tree_result import solve

HOURS = (1.0, 10.0, 100.0, 1000.0)
LAMBDA, TAU_H = 1e-3, 0.1 / 3600.0
SCHEMA = Path("/usr/share/scram/input.rng")
LAYER = Layer(name="computers", channels=4, per_hour=3e-5, not_covered=[1e-4, 1e-3, 0.5, 1.0], source="a test")


def model(n: int = 4, per_hour: float = LAMBDA, beta: float = 0.0, **given) -> SignalModel:
    pair = beta * per_hour / comb(n, 2)
    chances = {
        "single": {4: 1e-6, 3: 1e-4, 2: 0.2},
        "alike": {4: 1e-3, 3: 0.5, 2: 1.0},
        "near": {4: 0.01, 3: 0.1, 2: 0.3},
    }
    return SignalModel(
        "pitch_rate", n, (1 - beta) * per_hour, pair, **{"box_per_hour": 0.0, "settle_h": TAU_H, **chances, **given}
    )


# Single then pair lost 227 of 300 flights, pair then single 42 of 300.
ORDER_DECIDES: dict[str, Any] = {"single": {4: 0.0, 3: 0.0, 2: 42 / 300}, "alike": {4: 0.0, 3: 227 / 300, 2: 1.0}}
NEAR_DECIDES: dict[str, Any] = {"single": {4: 0.0, 3: 0.0, 2: 0.1}, "near": {4: 1.0, 3: 0.0, 2: 0.0}}


def differences(of: SignalModel, tree: FaultTree | None = None) -> list[float]:
    """Of the tree from the chain, by hours."""
    return [each.differs for each in solve(tree or signal_tree(of), transitions(of), HOURS, {}).at]


def scram(tree: FaultTree, hours: float, folder: Path) -> float:
    (folder / "tree.xml").write_text(open_psa(tree))
    command = ["scram", "--bdd", "--probability", "1", "--mission-time", repr(hours), str(folder / "tree.xml")]
    report = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    found = ET.fromstring(report).find(".//sum-of-products")
    assert found is not None
    return float(found.attrib["probability"])


@pytest.mark.parametrize(
    "given", [{}, {"box_per_hour": 3e-4}, {"layers": (LAYER,)}], ids=["channels", "boxes", "layer"]
)
@pytest.mark.parametrize("n", [2, 3, 4])
def test_without_common_cause_the_tree_is_the_chain(n, given):
    assert max(map(abs, differences(model(n, near={4: 0.0, 3: 0.0, 2: 0.0}, **given)))) < 1e-4


@pytest.mark.parametrize("per_hour", [1e-5, 1e-4, 1e-3, 2e-3])
@pytest.mark.parametrize("given", [{}, ORDER_DECIDES], ids=["any", "order decides"])
def test_with_pairs_the_tree_is_the_chain_to_first_order(given, per_hour):
    one, ten, *_ = differences(model(per_hour=per_hour, beta=0.01, **given))
    assert abs(one) < 0.01 and abs(ten) < 0.02


def test_near_faults_are_one_event():
    assert max(map(abs, differences(model(**NEAR_DECIDES)))) < 0.01


def test_the_event_of_near_faults_is_what_decides_there():
    assert differences(model(**NEAR_DECIDES), without(signal_tree(model(**NEAR_DECIDES)), "not_correct_near"))[0] < -0.4


def without(tree: FaultTree, event: str) -> FaultTree:
    return replace(tree, events={**tree.events, event: replace(tree.events[event], chance=0.0)})


def test_a_tree_without_order_is_twice_the_chain():
    tree = signal_tree(model(beta=0.01, **ORDER_DECIDES))
    events = {
        name: replace(event, chance=min(1.0, 2.0 * event.chance)) if "P(order)" in event.label else event
        for name, event in tree.events.items()
    }
    assert differences(model(beta=0.01, **ORDER_DECIDES), replace(tree, events=events))[0] == pytest.approx(
        1.0, abs=0.25
    )


def test_a_tree_in_which_common_cause_fails_all_channels_is_found():
    of = model(beta=0.01, **ORDER_DECIDES)
    tree = signal_tree(of)
    tree.any_of("signal_lost", [*tree.gates["signal_lost"].inputs, "pair"])  # Open-PSA's beta factor
    assert differences(of, tree)[0] > 10.0


def test_a_tree_that_lacks_one_not_correct_is_found():
    of = model()
    for event in ("not_correct_4_good", "not_correct_3_good", "not_correct_2_good"):
        assert min(differences(of, without(signal_tree(of), event))) < -0.02, event


def test_the_direct_sum_is_above_the_probability():
    tree = signal_tree(model())
    sums = [direct_sum(tree, cut_sets(tree), hours) / probability(tree, hours) - 1.0 for hours in HOURS]
    assert 1e-4 < sums[0] < sums[1] < sums[2] < sums[3] and sums[2] > 0.05


def test_the_verdict_says_what_the_tree_is():
    assert solve(signal_tree(model()), transitions(model()), HOURS, {}).static == "exact"
    with_pairs = model(beta=0.01)
    assert solve(signal_tree(with_pairs), transitions(with_pairs), HOURS, {}).static == "upper bound"
    tree = without(signal_tree(with_pairs), "alike_not_correct_4_good")
    assert solve(tree, transitions(with_pairs), HOURS, {}).static == "approximate"


def brute_force(tree: FaultTree, hours: float) -> float:
    """Sum over all combinations of events."""
    names, total = list(tree.events), 0.0
    for happened in product((False, True), repeat=len(names)):
        true, chance = dict(zip(names, happened, strict=True)), 1.0

        def of(name: str, true: dict[str, bool] = true) -> bool:
            return true[name] if name in true else sum(map(of, tree.gates[name].inputs)) >= tree.gates[name].least

        for name, value in true.items():
            p = tree.events[name].probability(hours)
            chance *= p if value else 1.0 - p
        total += chance * of(tree.top)
    return total


def test_the_diagram_gives_what_all_combinations_give():
    tree = signal_tree(model(3, beta=0.2, per_hour=0.02))
    assert probability(tree, 10.0) == pytest.approx(brute_force(tree, 10.0), rel=1e-12)


# Three trees of the text books, with the probability that is computed by hand beside each.
def two_trains() -> FaultTree:
    """Two trains of a valve (0.5) and a pump (0.7): (1 - 0.5 x 0.3)^2."""
    tree = FaultTree("two_trains", "top")
    for train in ("one", "two"):
        parts = [tree.event(f"valve_{train}", "", chance=0.5), tree.event(f"pump_{train}", "", chance=0.7)]
        tree.any_of(f"train_{train}", parts)
    tree.all_of("top", ["train_one", "train_two"])
    return tree


def bridge() -> FaultTree:
    """The bridge of five equal parts q: 2 q^2 + 2 q^3 - 5 q^4 + 2 q^5, paths cut (Barlow and Proschan)."""
    tree = FaultTree("bridge", "top")
    for i in "12345":
        tree.event(f"part_{i}", "", chance=0.1)
    cuts = [tree.all_of(f"cut_{cut}", [f"part_{i}" for i in cut]) for cut in ("14", "25", "135", "234")]
    tree.any_of("top", cuts)
    return tree


def two_of_three() -> FaultTree:
    """Two of three of rate 1e-3 after 100 h: 3 q^2 - 2 q^3, q = 1 - exp(-0.1)."""
    tree = FaultTree("two_of_three", "top")
    tree.at_least("top", 2, [tree.event(f"unit_{i}", "", per_hour=1e-3) for i in range(3)])
    return tree


Q = 1.0 - exp(-0.1)
TEXTBOOK: list[tuple[Callable[[], FaultTree], float]] = [
    (two_trains, 0.85**2),
    (bridge, 2e-2 + 2e-3 - 5e-4 + 2e-5),
    (two_of_three, 3 * Q**2 - 2 * Q**3),
]


@pytest.mark.parametrize(("made", "expected"), TEXTBOOK, ids=lambda value: getattr(value, "__name__", ""))
def test_textbook_trees(made, expected):
    assert probability(made(), 100.0) == pytest.approx(expected, rel=1e-12)


CASES = {
    "plain": model(),
    "boxes": model(box_per_hour=3e-4),
    "pairs": model(beta=0.01),
    "order": model(beta=0.01, **ORDER_DECIDES),
    "near": model(**NEAR_DECIDES),
    "layer": model(3, beta=0.01, layers=(LAYER,)),
}


@outside.needs("scram")
@pytest.mark.parametrize("name", CASES)
def test_scram_gives_the_same_six_digits(name, tmp_path: Path):
    tree = signal_tree(CASES[name])
    for hours in HOURS:
        assert scram(tree, hours, tmp_path) == pytest.approx(probability(tree, hours), rel=6e-6)


@outside.needs("scram")
def test_scram_gives_the_textbook_trees(tmp_path: Path):
    for made, expected in TEXTBOOK:
        assert scram(made(), 100.0, tmp_path) == pytest.approx(expected, rel=6e-6)


@outside.needs("scram")
@pytest.mark.parametrize("name", CASES)
def test_the_xml_is_valid_by_the_schema_of_scram(name):
    etree = importlib.import_module("lxml.etree")
    schema = etree.RelaxNG(etree.parse(str(SCHEMA)))
    document = etree.fromstring(open_psa(signal_tree(CASES[name])).encode())
    assert schema.validate(document), schema.error_log


def test_the_chain_file_gives_the_probability_of_the_chain(tmp_path: Path):
    steps = transitions(CASES["layer"])
    (tmp_path / "chain.toml").write_text(chain_file(steps, 10.0, "a test"))
    assert solve_file(tmp_path / "chain.toml").of_death == pytest.approx(lost(steps, 10.0), rel=1e-12)


# Two stuck in level flight and any third, in every order: a fifth of the faults are stuck.
OTHERS = {"hardover": 0.2e-3, "offset": 0.2e-3, "drift": 0.2e-3, "dropout": 0.2e-3}
TWINS = ModeModel(
    "pitch_rate",
    4,
    {"stuck": 0.2e-3, **OTHERS},
    {order: 1.0 for third in ("stuck", *OTHERS) for order in set(permutations(("stuck", "stuck", third)))},
)


def test_modes_of_a_channel_as_separate_events_are_an_upper_bound():
    found = solve(mode_tree(TWINS), mode_chain(TWINS), HOURS, {})
    assert found.static == "upper bound"
    assert [100 * each.differs for each in found.at] == pytest.approx([0.07, 0.7, 6.0, 18.0], rel=0.15)


def test_stuck_together_are_what_the_chain_of_hardovers_leaves_out():
    without = ModeModel("pitch_rate", 4, TWINS.per_hour, {})
    assert lost(mode_chain(without), 1.0) == pytest.approx(9.98e-13, rel=1e-3)
    assert lost(mode_chain(TWINS), 1.0) == pytest.approx(4.2e-10, rel=0.02)
    # By hand: 4 lambda^3 of three failed, times the chance that two or three of them are stuck.
    assert lost(mode_chain(TWINS), 1.0) == pytest.approx(4e-9 * (3 * 0.2**2 * 0.8 + 0.2**3), rel=0.01)


def test_each_order_has_its_own_chance_in_the_chain_and_their_mean_in_the_tree():
    orders = {("stuck", "offset"): 0.9, ("offset", "stuck"): 0.1}
    of = ModeModel("pitch_rate", 3, {"stuck": 1e-4, "offset": 3e-4}, orders)
    assert of.sets() == {("offset", "stuck"): 0.5}
    assert solve(mode_tree(of), mode_chain(of), (1.0,), {}).at[0].differs == pytest.approx(0.0, abs=1e-3)


def test_the_picture_draws_every_way_to_lose_the_signal_and_one_of_what_is_alike():
    tree = signal_tree(CASES["layer"])
    root = ET.fromstring(picture(tree, 1.0))
    texts = [each.text or "" for each in root.iter("{http://www.w3.org/2000/svg}text")]
    assert "and 2 more like it" in texts and "layer computers lost" in texts
    whole = " ".join(texts)
    for name in tree.gates["signal_lost"].inputs:
        first = tree.gates[name].label.split()[0]
        assert first in whole, name
    boxes = list(root.iter("{http://www.w3.org/2000/svg}rect"))
    drawn_apart = sum(len(gate.inputs) for gate in tree.gates.values())
    assert len(boxes) < drawn_apart and "computers 2 fails" not in texts


def test_the_picture_begins_with_the_top_event_and_is_as_wide_as_it_is_deep():
    for of in CASES.values():
        root = ET.fromstring(picture(signal_tree(of), 1.0))
        boxes = [each.attrib for each in root.iter("{http://www.w3.org/2000/svg}rect")]
        places = {(float(box["x"]), float(box["y"])) for box in boxes}
        assert len(places) == len(boxes) and min(places) == (14.0, 14.0)  # none on another, the top event first
        assert max(float(box["x"]) + float(box["width"]) for box in boxes) <= float(root.attrib["width"]) <= 1400


RATES = """
[pitch_rate]
per_hour = [1e-3]
source = "a test"
beta = [0.01]
kinds = { hardover = 0.5, drift = 0.5 }
"""


def alike(bad: int) -> pl.DataFrame:
    """Counts of two alike."""
    return table(bad=bad).filter(pl.col("good_before") > 1).with_columns(design=pl.lit("alike"))


@pytest.fixture
def flown(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """Arguments of the command: a folder whose cells are constructed, rates, and where to write."""
    counts = {
        "a": Cells("cross-channel", pl.concat([table(bad=1), alike(bad=3)]), NO_ALARMS),
        "b": Cells("mean", table(), NO_ALARMS),
    }
    monkeypatch.setattr(run_module, "cells", lambda folder: counts[str(folder)])
    (tmp_path / "rates.toml").write_text(RATES)
    return ["reliability", "tree", "a", "--rates", str(tmp_path / "rates.toml"), "--out", str(tmp_path / "tree.xml")]


def test_the_command_writes_tree_chain_and_picture(rig_command, flown, tmp_path: Path):
    code, out, err = rig_command(
        *flown, "--chain", str(tmp_path / "chain.toml"), "--svg", str(tmp_path / "tree.svg"), "--json"
    )
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert list(told["tree"]) == ["1", "10", "100", "1000"] and told["static"] in ("upper bound", "exact")
    assert told["chain"]["1"] == pytest.approx(solve_file(tmp_path / "chain.toml").of_death, rel=1e-9)
    assert list(told["not_correct"]) == ["4 good", "3 good", "2 good", "1 good"]
    assert ET.parse(tmp_path / "tree.xml").getroot().tag == "opsa-mef"
    assert ET.parse(tmp_path / "tree.svg").getroot().tag.endswith("svg")


def test_the_command_prints_how_far_the_tree_is_from_the_chain(rig_command, flown):
    code, out, _ = rig_command(*flown)
    assert code == 0 and re.search(r"static tree: .*differs from the chain by at most", out)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[1e-3]", "[1e-3, 2e-3]", r"pitch_rate.per_hour: a tree needs one value, got 2"),
        ("[0.01]", "[0.0, 0.01]", r"pitch_rate.beta: a tree needs one value, got 2"),
        ("[1e-3]", "[-1e-3]", r"per_hour: rates per hour must be above 0"),
        ("[1e-3]", "[inf]", r"per_hour"),
        ("[1e-3]", "[nan]", r"per_hour"),
        ('source = "a test"', 'source = "a test"\nbox_per_hour = -1.0', r"box_per_hour"),
    ],
)
def test_bad_rates_are_one_line_and_nothing_is_written(rig_command, flown, tmp_path: Path, old, new, message):
    (tmp_path / "rates.toml").write_text(RATES.replace(old, new))
    code, _, err = rig_command(*flown)
    assert code == 2 and err.count("\n") == 1 and re.search(message, err)
    assert not (tmp_path / "tree.xml").exists()


def test_a_name_that_xml_forbids_is_refused(rig_command, flown, tmp_path: Path):
    layer = (
        '[[layers]]\nname = "flight <computers>"\nchannels = 1\nper_hour = 1e-5\nnot_covered = [1.0]\nsource = "x"\n'
    )
    (tmp_path / "rates.toml").write_text(RATES + layer)
    code, _, err = rig_command(*flown)
    assert code == 2 and "layers.0.name: 'flight <computers>' cannot be a name in the tree's XML" in err
    assert not (tmp_path / "tree.xml").exists()


def test_several_managers_are_refused(rig_command, flown):
    code, _, err = rig_command(*flown[:3], "b", *flown[3:])
    assert code == 2 and err == "error: a, b: a tree needs one manager, got cross-channel, mean\n"


def test_hours_are_checked(rig_command, flown):
    for hours in ("0", "nan", "1,x", "1e9"):
        code, _, err = rig_command(*flown, "--hours", hours)
        assert code == 2 and err.startswith("error: --hours: must be hours above 0")


def test_the_chain_may_not_be_the_tree(rig_command, flown, tmp_path: Path):
    code, _, err = rig_command(*flown, "--chain", str(tmp_path / "tree.xml"))
    assert code == 2 and "is the file of --out too" in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rates.toml"]
