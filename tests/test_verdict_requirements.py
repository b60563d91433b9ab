"""Formulas with a robustness: against brute force and rtamt, and case by case as the definition says."""

import math
import re
import warnings
from dataclasses import replace
from random import Random

import numpy as np
import pytest
import requirement_formulas as formulas

from rig.core.errors import BadInput
from rig.core.frame import INDEX, End, State, Table, new_block
from rig.flight.loop import fly_rows
from rig.scenario import scenario
from rig.verdict.requirements.along import plain
from rig.verdict.requirements.measure import check_rows
from rig.verdict.requirements.requirement import Requirement, load_requirements, names
from rig.verdict.requirements.requirement_recorder import AT_ONCE, RequirementsRecorder
from rig.verdict.requirements.robustness import LEAST, MOST, robustness_text

Q, P = INDEX["pitch_rate"], INDEX["roll_rate"]


def flown(n=20, lost=False, **fields):
    """Rows of a flight of n frames, 0.01 s each: q of the truth, and fields that are whole."""
    rows = new_block(n)
    rows["truth"][:, Q] = fields.pop("q", 0.0)
    rows["level"] = 4
    for field, values in fields.items():
        rows[field] = values
    if lost:
        rows["end"][-1] = End.DEPARTURE_RATE
    return rows


def measured(formula, rows, **keys):
    """The verdict on the first signal; the instant is frame 0 when nothing else is said."""
    recorder = RequirementsRecorder([Requirement(id="one", formula=formula, **keys)], formulas.SUBJECT)
    recorder.record(Table(rows))
    return recorder.finish()[0]


def robustness(formula, rows, **keys):
    return measured(formula, rows, **keys).robustness


@pytest.mark.parametrize("first", range(0, 300, 50))
def test_random_formulas_have_verdict_and_robustness_of_brute_force(first):
    assert [number for number in range(first, first + 50) if not formulas.agree(number)] == []


def test_formulas_that_rtamt_speaks_have_its_margin():
    """Whole windows, no NaN, scale 1: where its semantics and ours are one."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # typing.io, which Python 3.13 has no more
        rtamt = pytest.importorskip("rtamt", reason="rtamt 0.4.10 is for Python below 3.13")
    numbers, rows = np.random.default_rng(3), flown(60)
    rows["truth"][:, Q], rows["voted"][:, Q] = numbers.normal(size=60), numbers.normal(size=60)
    for formula in RTAMT:
        spec = rtamt.StlDiscreteTimeOfflineSpecification()
        for name in "xyr":
            spec.declare_var(name, "float")
        spec.spec = f"r = {formula.replace('implies', '->')}"
        spec.parse()
        data = {"time": list(range(60)), "x": rows["truth"][:, Q].tolist(), "y": rows["voted"][:, Q].tolist()}
        theirs = [value for _, value in spec.evaluate({**data, "r": [0.0] * 60})]
        ours = re.sub(r"\b[xy]\b", lambda name: _NAMES[name[0]], formula).replace("!(", "not (")
        for k in range(10, 30):
            acting = np.zeros((60, 8), np.uint8)
            acting[k:, 0] = 1
            rows["acting"] = acting
            in_seconds = _seconds(ours)
            assert robustness(in_seconds, rows, at="each onset", scale=1.0) == pytest.approx(theirs[k], abs=1e-9), (
                formula
            )


RTAMT = (
    "x <= 0.5",
    "!(abs(x - y) <= 0.5)",
    "always[0, 7] x <= 0.5 * y + 1",
    "eventually[2, 9] (x >= 1 and y <= 0.3)",
    "once[1, 8] (x >= 1 or y >= 1)",
    "(x <= 1) until[2, 6] (y >= 0.5)",
    "always[0, 5] eventually[0, 4] x >= y",
    "eventually[1, 4] always[0, 6] (x <= 2 until[0, 5] y >= 0)",
    "always[3, 8] (x >= 0 or once[0, 6] y >= 1)",
    "always[0, 9] (x >= 1 implies eventually[0, 4] y >= 1)",
)


_NAMES = {"x": "truth.pitch_rate", "y": "voted.pitch_rate"}


def _seconds(formula):
    return re.sub(r"\[(\d+), (\d+)\]", lambda w: f"[{int(w[1]) / 100:g}, {int(w[2]) / 100:g}]", formula)


def test_robustness_of_comparisons():
    rows = flown(q=0.3)
    for formula, expected in [
        ("truth.pitch_rate < 0.5", 0.2 / 0.1),
        ("truth.pitch_rate >= 0.5", -0.2 / 0.1),
        ("truth.pitch_rate == 0.5", -0.2 / 0.1),
        ("truth.pitch_rate != 0.5", 0.2 / 0.1),
        ("not truth.pitch_rate < 0.5", -0.2 / 0.1),
        ("0.2 < truth.pitch_rate < 0.5", 0.1 / 0.1),
        ("truth.pitch_rate < 0.5 and truth.pitch_rate > 0.25", 0.05 / 0.1),
        ("truth.pitch_rate > 0.5 or truth.pitch_rate > 0.25", 0.05 / 0.1),
        ("truth.pitch_rate < 1e9", 1000.0),
        ("truth.pitch_rate > 1e9", -1000.0),
        ("truth.pitch_rate / 0 < 1", -1000.0),
        ("max(truth.pitch_rate, 0.4, -1) < min(0.5, 0.6)", 0.1 / 0.1),
    ]:
        assert robustness(formula, rows, scale=0.1) == pytest.approx(expected), formula


def test_a_margin_of_0_is_met_and_what_is_violated_is_below_it():
    rows = flown(q=0.5)
    assert measured("truth.pitch_rate <= 0.5", rows)[2:4] == ("met", 0.0)
    assert measured("truth.pitch_rate < 0.5", rows)[2:4] == ("violated", -LEAST)
    assert measured("truth.pitch_rate == 0.5", rows)[2:4] == ("met", 0.0)
    assert measured("not truth.pitch_rate <= 0.5", rows)[2:4] == ("violated", -LEAST)
    assert measured("not truth.pitch_rate < 0.5", rows)[2:4] == ("met", LEAST)
    assert measured("truth.pitch_rate != 0.5", rows)[2:4] == ("violated", -LEAST)
    assert (robustness_text(0.0), robustness_text(-LEAST), robustness_text(-0.25)) == ("0", "<0", "-0.25")


def test_a_state_has_no_distance_and_hides_none_of_what_it_excuses():
    """Excused: no number.  Not excused: the number of the rest, however far it is off."""
    rows = flown(q=0.5)
    for formula, status, expected in [
        ("state(truth.pitch_rate > 0) or truth.pitch_rate < 0.2", "met", MOST),
        ("state(truth.pitch_rate > 1) or truth.pitch_rate < 0.2", "violated", -3.0),
        ("not state(truth.pitch_rate > 0)", "violated", -MOST),
        ("always[0, 0.05] (state(truth.pitch_rate > 1) or truth.pitch_rate < 0.7)", "met", 2.0),
    ]:
        found = measured(formula, rows, scale=0.1)
        assert found[2:4] == (status, pytest.approx(expected)), formula
        assert (plain(found)["robustness"] is None) == (abs(expected) == MOST)
        assert (robustness_text(found.robustness) == "") == (abs(expected) == MOST)


def test_a_number_that_is_nan_violates_whatever_is_negated():
    rows = flown(q=np.nan)
    for formula in ("truth.pitch_rate < 1", "not truth.pitch_rate < 1", "not not truth.pitch_rate < 1"):
        assert measured(formula, rows)[2:4] == ("violated", -1000.0)
    assert measured("truth.pitch_rate < 1 or lost", rows)[2:4] == ("violated", -1.0)


def test_windows_bind_like_not():
    """Tighter than ``and``, looser than a comparison: ``always`` is of q alone here."""
    q = np.zeros(20)
    q[5:] = 1.0
    p = np.zeros(20)
    p[10:] = 1.0
    rows = flown(q=q)
    rows["voted"][:, Q] = p
    late = "voted.pitch_rate < 0.5"
    assert measured(f"always[0, 0.04] truth.pitch_rate < 0.5 and {late}", rows).status == "met"
    assert measured(f"always[0, 0.04] (truth.pitch_rate < 0.5 and {late})", rows).status == "met"
    assert measured(f"always[0, 0.09] truth.pitch_rate < 0.5 or {late}", rows).status == "met"
    assert measured(f"not always[0, 0.05] truth.pitch_rate < 0.5 and {late}", rows).status == "met"
    # (late) until (q), and so on: ``a and b until c`` is ``a and (b until c)``
    assert measured(f"{late} until[0, 0.1] truth.pitch_rate > 0.5 and {late}", rows).status == "met"
    assert measured(f"truth.pitch_rate < 0.5 and {late} until[0.05, 0.1] truth.pitch_rate > 0.5", rows).status == "met"


@pytest.mark.parametrize(("window", "status"), [("[0, 0.3333333]", "violated"), ("[0.35001, 0.5]", "met")])
def test_a_window_whose_ends_are_rounded_decimals_has_the_frames_there(window: str, status: str):
    """At 60 Hz frame 20 is at 0.3333333 s; 0.35001 s is after frame 21."""
    rows, subject = flown(40), replace(formulas.SUBJECT, rate_hz=60.0)
    rows["truth"][20:22, Q] = 1.0
    recorder = RequirementsRecorder([Requirement(id="one", formula=f"always{window} truth.pitch_rate < 0.5")], subject)
    recorder.record(Table(rows))
    assert recorder.finish()[0].status == status


def test_past_the_end_what_was_flown_counts_and_of_nothing_it_is_not_applicable():
    rows = flown(20, q=0.3)
    assert measured("always[0.1, 5] truth.pitch_rate < 0.5", rows).status == "met"
    nothing = measured("always[0.2, 5] truth.pitch_rate < 0.5", rows)
    assert nothing.status == "not applicable" and math.isnan(nothing.robustness) and nothing.values == {}
    assert measured("once[0.01, 5] truth.pitch_rate < 0.5", rows).status == "not applicable"
    assert measured("always[0.2, 5] truth.pitch_rate < 0.5 or lost", rows)[2:4] == ("violated", -1.0)


def test_a_lost_aircraft_violates_each_always_that_it_cuts():
    rows = flown(20, lost=True, q=0.3)  # frames 0 to 19 of 0 to 39: half of the window was not flown
    assert measured("always[0, 0.39] truth.pitch_rate < 0.5", rows)[2:4] == ("violated", -1.5)
    assert measured("always[0, 0.19] truth.pitch_rate < 0.5", rows).status == "met"
    assert measured("always[0.2, 0.39] truth.pitch_rate < 0.5", rows)[2:4] == ("violated", -2.0)
    assert measured("eventually[0, 0.39] truth.pitch_rate < 0.5", rows).status == "met"
    assert robustness("always[0, 0.39] truth.pitch_rate > 100", rows) == pytest.approx(-99.7 / 0.5)


def test_the_default_scale_is_the_threshold_of_the_signal_else_one():
    rows = flown(q=0.3)
    assert robustness("truth.pitch_rate < 0.5", rows) == pytest.approx(0.2 / 0.5)  # SUBJECT has 0.5 rad/s
    assert robustness("0.5 > mach", rows) == pytest.approx(0.5)
    formula = "truth.pitch_rate < 0.5 and mach < 0.7"
    assert robustness(formula, rows, scale=[0.1, 10.0]) == pytest.approx(0.07)
    with pytest.raises(BadInput, match="scale: 3 values for 2 comparisons, one each is needed"):
        robustness(formula, rows, scale=[0.1, 10.0, 1.0])


def test_the_instant_is_that_of_the_numbers_that_decide():
    q = np.zeros(40)
    q[17] = 0.4
    found = measured("always[0, 0.3] abs(truth.pitch_rate) <= threshold.pitch_rate", flown(40, q=q))
    assert found.instant_s == pytest.approx(0.17) and found.robustness == pytest.approx(0.2)
    assert found.values == {"truth.pitch_rate": (0.4, "rad/s"), "threshold.pitch_rate": (0.5, "rad/s")}
    late = measured("(truth.pitch_rate < 1) until[0, 0.3] (truth.pitch_rate > 0.3)", flown(40, q=q))
    assert late.instant_s == pytest.approx(0.17)


@pytest.mark.parametrize(
    ("formula", "same"),
    [
        ("lost or acting implies lost and acting", "not (lost or acting) or (lost and acting)"),
        ("always[0, 0.1] mach < 0 implies lost", "(not always[0, 0.1] mach < 0) or lost"),
        ("not lost implies mach > 3", "lost or mach > 3"),
        ("lost implies (acting implies lost)", "not lost or (not acting or lost)"),
        ("(lost implies acting) or lost", "not lost or acting or lost"),
        ("mach > 0 until[0, 0.1] mach > 1 implies lost", "not (mach > 0 until[0, 0.1] mach > 1) or lost"),
    ],
)
def test_implies_binds_less_than_every_other_word(formula, same):
    for number in range(20):
        rows = formulas.random_rows(Random(number))
        assert measured(formula, rows)[2:4] == measured(same, rows)[2:4], number


def test_each_onset_counts_once_and_the_least_is_kept():
    q = np.zeros(60)
    q[25:] = 0.3
    rows = flown(60, q=q)
    acting = np.zeros((60, 8), np.uint8)
    acting[10:, 0], acting[20:30, 0], acting[40:, 1] = 1, 3, 2
    rows["acting"] = acting
    keys = {"at": "each onset", "scale": 1.0}
    assert robustness("truth.pitch_rate <= 0.5", rows, **keys) == pytest.approx(0.2)  # at 0.4 s
    assert robustness("always[0, 0.1] truth.pitch_rate <= 0.5", rows[:24], **keys) == pytest.approx(0.5)
    assert measured("lost", flown(), at="each onset").status == "not applicable"


def test_each_loss_is_the_first_frame_of_level_0():
    rows = flown(60)
    rows["level"][20:30, Q] = rows["level"][45:, Q] = 0
    rows["truth"][:, Q] = np.arange(60) / 100
    found = measured("truth.{signal} <= 0.5", rows, at="each loss", scale=1.0)
    assert found.signal == "pitch_rate" and found.robustness == pytest.approx(0.05)
    assert found.instant_s == pytest.approx(0.45)
    assert measured("truth.{signal} <= 0.5", rows, at="each loss", signals=["roll_rate"]).status == "not applicable"


def test_counts_are_shares_of_the_persistence_below_one_until_failed():
    rows = flown(30)
    rows["state"][10:13, Q, 1] = State.SUSPECT
    rows["state"][15:25, Q, 1] = State.SUSPECT  # longer than the persistence of 5: a count that stands still
    rows["state"][25:, Q, 1] = State.FAILED
    for end, expected in ((9, 0.0), (12, 0.6), (14, 0.6), (24, 0.8), (25, 1.0)):
        formula = f"always[0, {end / 100:g}] count.pitch_rate.2 <= 0"
        assert robustness(formula, rows) == pytest.approx(-expected, abs=1e-12), end


def test_a_formula_of_two_hundred_nodes_is_measured():
    assert measured(" or ".join(["lost"] * 100), flown())[2:4] == ("violated", -1.0)
    assert measured("not " * 199 + "lost", flown())[2:4] == ("met", 1.0)


def test_memory_is_bounded_by_the_longest_window():
    requirement = Requirement(id="one", formula="always[0, 2] once[0, 3] truth.pitch_rate < 1", at="each onset")
    recorder, most = RequirementsRecorder([requirement], formulas.SUBJECT), 0
    for first in range(0, 200_000, 1000):
        recorder.record(Table(new_block(1000, first)))
        most = max(most, sum(part.size for part in recorder._parts))
    assert AT_ONCE <= most < AT_ONCE + 2000


def write(tmp_path, **keys):
    path = tmp_path / "mine.toml"
    table = {"id": "mine", "formula": "lost", **keys}
    lines = [f"{key} = {value if isinstance(value, list | float) else repr(value)}" for key, value in table.items()]
    path.write_text("\n".join(["[[requirements]]", *lines, ""]))
    return path


BAD = [
    ({"formula": "eror.pitch_rate < 1"}, "column 1: unknown quantity 'eror.pitch_rate', nearest: error."),
    ({"formula": "1 < truth.pitch_rate ** 2"}, "column 5: 'truth.pitch_rate\\*\\*2' is not a number"),
    ({"formula": "truth.pitch_rate @ 2 < 1"}, "column 1: 'truth.pitch_rate@2' is not a number"),
    ({"formula": "sometimes[0, 1] lost"}, "column 17"),
    ({"formula": "lost and always[2, 1] lost"}, "column 10: 'always\\[2, 1\\]': the window ends before it begins"),
    ({"formula": "always[-1, 1] lost"}, "column 1: .* must begin at 0 s or later"),
    ({"formula": "always[1] lost"}, "a window must be \\[begin, end\\] in s"),
    ({"formula": "always[0, 3600] lost"}, "windows of 3600 s, at most 60 s"),
    ({"formula": "always[0, 40] eventually[0, 21] lost"}, "windows of 61 s"),
    ({"formula": " and ".join(["lost"] * 120)}, "has 239 nodes, at most 200"),
    ({"formula": "lost and " * 10_000 + "lost"}, "at most 8000 characters"),
    ({"formula": "(" * 3000 + "lost" + ")" * 3000}, "not a condition"),
    ({"formula": "lost until[0, 1] lost until[0, 1] lost"}, "column 23: two until in a row"),
    ({"formula": "lost implies lost implies lost"}, "column 19: two implies in a row: put one of them in brackets"),
    ({"formula": "lost implies"}, "not a condition, such as"),
    ({"formula": "always lost"}, "not a condition, such as"),
    ({"formula": "failed.pitch_rate < 1"}, "unknown quantity 'failed.pitch_rate'"),
    ({"formula": "truth.pitch_rate"}, "column 1: 'truth.pitch_rate' is not a condition; compare it"),
    ({"formula": "pitch_rate < 1"}, "unknown quantity 'pitch_rate'"),
    ({"formula": "lös < 1"}, "only ASCII"),
    ({"at": "never"}, "requirements.0.at"),
    ({"scale": 0.0}, "requirements.0.scale"),
    ({"limit": 1.0}, "limit: unknown key"),
    ({"id": "a b"}, "requirements.0.id"),
]


@pytest.mark.parametrize(("keys", "says"), BAD)
def test_a_file_that_makes_no_sense_is_one_line(tmp_path, keys, says):
    with pytest.raises(BadInput, match=says) as refused:
        load_requirements([write(tmp_path, **keys)])
    assert "\n" not in str(refused.value) and str(refused.value).startswith(str(tmp_path))


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        (
            {"formula": "truth.altitude_ft > 1"},
            "column 1: 'truth.altitude_ft': the flight has no signal.* nearest: .*altitude_m",
        ),
        ({"formula": "lost or error.pich_rate < 1"}, "column 9: .*no signal 'pich_rate', nearest: pitch_rate"),
        ({"formula": "failed.pitch_rate.5"}, "pitch_rate has channels 1 to 4"),
        ({"formula": "error.gear_down < 1"}, "a discrete has no error"),
        ({"formula": "surface.canard < 1"}, "unknown surface 'canard'"),
        ({"formula": "lost < 1"}, "'lost' is a yes or no, not a number"),
        ({"formula": "baseline.mach < 1"}, "baseline.mach: the flight has no baseline here"),
        ({"formula": "always[0.001, 0.002] lost"}, "the window contains no frame at 100 frames a second"),
        ({"formula": "truth.{signal} < 1", "signals": ["canard"]}, "signals: the flight has no 'canard'"),
    ],
)
def test_what_a_flight_does_not_have_is_one_line(keys, says):
    with pytest.raises(BadInput, match=says) as refused:
        measured(rows=flown(), **keys)
    assert "\n" not in str(refused.value)


def test_ids_are_distinct_and_sets_are_found(tmp_path):
    with pytest.raises(BadInput, match=r"no_such: no such requirements file; bundled: .*redundancy"):
        load_requirements(["no_such"])
    other = tmp_path / "other.toml"
    other.write_text(write(tmp_path).read_text())
    with pytest.raises(BadInput, match="mine: the id is already used in"):
        load_requirements([tmp_path / "mine.toml", other])
    assert len(load_requirements([other, other])) == 1


def test_every_bundled_requirement_has_a_source_and_a_text():
    for name in names():
        assert all(each.source and each.text for each in load_requirements([name]))


@pytest.mark.parametrize("at", ["start", "each onset"])
def test_the_channels_measured_together_are_the_least_of_each_alone(at):
    """Formulas of one channel each are another way to the same verdict."""
    random = Random(7)
    formula = (
        "always[0.02, 0.3] (abs(error.{signal}.N) <= 1 or once[0.05, 0.1] failed.{signal}.N"
        " or not always[0, 0.05] level.{signal} > 1) and ((not failed.{signal}.N) until[0, 0.1] level.{signal} < 3)"
    )
    decided = set()
    for _ in range(20):
        rows = formulas.random_rows(random)
        keys = {"at": at, "signals": ["pitch_rate"], "scale": 0.3}
        together = measured(formula.replace("N", "{channel}"), rows, **keys)
        alone = [measured(formula.replace("N", str(channel)), rows, **keys) for channel in (1, 2, 3, 4)]
        least = min(alone, key=lambda one: (one.robustness, one.status == "met"))
        assert together == least or together.status == least.status == "not applicable"
        decided |= {int(name[-1]) for name in together.values if name[-1].isdigit()}
    assert decided == {1, 2, 3, 4}


def test_the_same_requirements_are_measured_on_the_faulted_signals_of_each_flight():
    """Formulas are kept from flight to flight; what they are over is each flight's own."""
    asked = load_requirements(["redundancy"])
    for signal in ("pitch_rate", "roll_rate", "pitch_rate"):
        fault = f'{{kind="hardover",signal="{signal}",channels=[1],start_s=0.5}}'
        flight = scenario.load(None, ["duration_s=1.0", f"faults=[{fault}]"])
        verdicts = check_rows(fly_rows(flight), flight, asked)
        assert {verdict.signal for verdict in verdicts} == {signal}
