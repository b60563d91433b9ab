"""Two logs, field by field: equal, within a tolerance, different, missing; every file one clear line or a verdict."""

import json
import os
import sys
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_log_writer import random_block, write

from rig.bench.replay.before_after import diff, side
from rig.bench.replay.compare_flights import Tolerances, compare, of_column, tolerances
from rig.cli import main as cli
from rig.core.errors import BadInput
from rig.core.frame import FLAT, INDEX, TIMING, Table, new_block
from rig.log import read_log
from rig.log.columns import COLUMNS, unit_of
from rig.log.schema import OLDEST, SCHEMA_VERSION
from rig.log.writer import LogWriter

Q = INDEX["pitch_rate"]


def logged(path: Path, rows, rate: float = 100.0, **metadata: str) -> Path:
    with LogWriter(path, rate, metadata) as writer:
        writer.write(Table(rows, timing=np.zeros(len(rows), TIMING)))
    return path


def column(a, b, tolerance=0.0, wraps=False):
    a, b = np.asarray(a, float), np.asarray(b, float)
    return of_column("x", a, b, np.arange(len(a)), tolerance, wraps)


def test_the_columns_are_all_numbers_of_a_frame_each_once():
    elements = {(name, index) for name in FLAT.names or () for index in np.ndindex(FLAT[name].shape)}
    elements -= {("frame", ())}
    assert {(c.field, c.index) for c in COLUMNS} == elements
    assert len({c.path for c in COLUMNS}) == len(COLUMNS) == len(elements)


def test_random_rows_are_equal_to_themselves_nan_and_infinity_included():
    rows = random_block(50)
    assert {field.verdict for field in compare(Table(rows), Table(rows.copy()))} == {"equal"}


def test_each_number_of_a_frame_is_seen_to_differ():
    """Half of them in turn, by the bits of their places: those that are changed are those that are named."""
    for bit in range(len(COLUMNS).bit_length()):
        a, b = new_block(3), new_block(3)
        changed = [which for place, which in enumerate(COLUMNS, 1) if place >> bit & 1]
        for which in changed:
            b[which.field][(1, *which.index)] = 1
        different = [
            (f.name, f.first_frame, f.frames, f.largest) for f in compare(Table(a), Table(b)) if f.verdict != "equal"
        ]
        assert sorted(different) == sorted((which.path, 1, 1, 1.0) for which in changed)


def test_the_first_frame_the_count_and_the_largest():
    found = column([0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.25, 0.0, -4.0, 1.0])
    assert (found.verdict, found.frames, found.first_frame, found.largest) == ("different", 3, 1, 4.0)


def test_within_a_tolerance_is_neither_equal_nor_different():
    found = column([0.0, 0.0, 0.0], [0.0, 0.25, -0.5], 0.5)
    assert (found.verdict, found.frames, found.first_frame, found.largest) == ("within", 2, 1, 0.5)
    found = column([0.0, 0.0, 0.0], [0.0, 0.25, -0.5], 0.25)
    assert (found.verdict, found.frames, found.first_frame, found.largest) == ("different", 1, 2, 0.5)


def test_nan_equals_nan_and_nothing_else():
    nan = float("nan")
    assert column([nan, 1.0], [nan, 1.0]).verdict == "equal"
    found = column([nan, 1.0], [1.0, 1.0], 1e300)
    assert (found.verdict, found.frames, found.largest) == ("different", 1, None)


def test_minus_zero_is_zero_by_value_but_not_to_the_bit():
    assert column([0.0], [-0.0]).verdict == "within"


def test_an_angle_on_the_circle_differs_the_short_way_round():
    found = column([0.001], [2 * pi - 0.001], 0.01, wraps=True)
    assert found.verdict == "within" and found.largest == pytest.approx(0.002)
    assert column([0.001], [2 * pi - 0.001], 0.01).verdict == "different"
    angles = {c.owner for c in COLUMNS if c.wraps}
    assert angles == {"roll_angle", "heading"}


def test_the_last_tolerance_that_fits_a_field_decides():
    names = ["pitch_rate.ch_1", "pitch_rate.voted", "flight.mach"]
    allowed = tolerances(["1e-9", "pitch_rate.*=0.01", "*.voted=0.5"], names)
    assert [allowed.of(name) for name in names] == [0.01, 0.5, 1e-9]
    assert Tolerances().of("flight.mach") == 0.0


@pytest.mark.parametrize("text", ["x", "-1", "nan", "inf", "pitch_rate.*=x", "pitsch_rate.*=1"])
def test_a_tolerance_that_cannot_be_is_refused(text):
    with pytest.raises(BadInput, match=f"--tolerance {text.replace('*', '.')}"):
        tolerances([text], ["pitch_rate.voted"])


def test_two_logs_of_one_flight_are_identical_and_one_bit_is_found(tmp_path, rig_command):
    rows = random_block(120)
    a, b = logged(tmp_path / "a.mcap", rows), tmp_path / "b.mcap"
    rows["truth"][77, Q] = 0.0
    logged(tmp_path / "zero.mcap", rows)
    rows["truth"][77, Q] = 5e-324
    logged(b, rows)
    assert rig_command("diff", a, a)[0] == 0
    code, text, _ = rig_command("diff", tmp_path / "zero.mcap", b, "--json")
    found = json.loads(text)
    assert code == 1 and found["same"] is False
    assert [(f["name"], f["first_frame"], f["largest"]) for f in found["fields"]] == [("pitch_rate.truth", 77, 5e-324)]
    code, text, _ = rig_command("diff", tmp_path / "zero.mcap", b, "--tolerance", "1e-9", "--json")
    found = json.loads(text)
    assert code == 0 and found["same"] and not found["identical"] and found["counts"]["within"] == 1


def test_other_aircraft_rates_and_lengths_are_said(tmp_path, rig_command):
    a = logged(tmp_path / "a.mcap", new_block(120), aircraft="f16", seed="1")
    b = logged(tmp_path / "b.mcap", new_block(100), 50.0, aircraft="b747", seed="2")
    code, text, _ = rig_command("diff", a, b)
    assert code == 1
    for said in ("lengths differ: 120 and 100", "rates differ: 100 and 50 Hz", "aircraft differ: f16 and b747"):
        assert said in text
    assert "seed: 1 and 2" in text and f"{len(COLUMNS)} equal" in text


def test_for_people_a_difference_has_seconds_frame_and_unit(tmp_path, rig_command):
    rows, other = new_block(90), new_block(90)
    other["voted"][77:, INDEX["pitch_rate"]] = np.radians(2.0)
    a, b = logged(tmp_path / "a.mcap", rows), logged(tmp_path / "b.mcap", other)
    _, text, _ = rig_command("diff", a, b)
    assert "pitch_rate.voted different 13 0.77 s (frame 77) 2 deg/s" in " ".join(text.split())
    _, text, _ = rig_command("diff", a, logged(tmp_path / "c.mcap", other, 50.0))
    assert "frame 77 2 deg/s" in " ".join(text.split())  # two rates: no time


@pytest.mark.parametrize(
    ("path", "unit"),
    [
        *(("pitch_rate.ch_1", "rad/s"), ("heading.reference", "rad"), ("static_pressure.truth", "Pa")),
        *(("pitch_rate.st_1", ""), ("pitch_rate.level", ""), ("gear_down.ch_1", ""), ("nobody.ch_1", "")),
        *(("control.command_pitch_rate_rad_s", "rad/s"), ("flight.altitude_m", "m"), ("flight.mach", "")),
        ("inertial.specific_force_down_m_s2", "m/s2"),
    ],
)
def test_every_number_of_a_log_has_its_unit(path, unit):
    assert unit_of(path) == unit


def test_what_only_one_side_has_is_named(tmp_path, capsys, monkeypatch, rig_command):
    """A log beside what ``rig vote`` made of one of its signals."""
    rows = new_block(60)
    rows["valid"], rows["ilm"], rows["state"] = 1, 2, 0
    a = logged(tmp_path / "a.mcap", rows)
    (tmp_path / "vote.toml").write_text("[signal.pitch_rate]\nthreshold = 0.1\n")
    config = ["--config", tmp_path / "vote.toml"]
    monkeypatch.setattr(sys, "argv", ["rig", "vote", str(a), *map(str, config), "--out", str(tmp_path / "b.mcap")])
    with pytest.raises(SystemExit):
        cli.main()
    capsys.readouterr()
    code, text, _ = rig_command("diff", a, tmp_path / "b.mcap", "--json")
    fields = {field["name"]: field["verdict"] for field in json.loads(text)["fields"]}
    assert code == 1
    assert fields["heading.voted"] == fields["flight.mach"] == "missing in B"
    assert "pitch_rate.ch_1" not in fields and "pitch_rate.voted" not in fields  # equal
    swapped = diff(side(tmp_path / "b.mcap"), side(a))
    assert {f.verdict for f in swapped.fields if f.name.startswith("heading")} == {"missing in A"}


@pytest.fixture(scope="module")
def bad(tmp_path_factory) -> dict[str, Path]:
    """A file of each kind that cannot be read."""
    folder = tmp_path_factory.mktemp("bad")
    whole = folder / "whole.mcap"
    write(whole, 250, result={"survived": "True"})
    content = whole.read_bytes()
    flipped = bytearray(content)
    flipped[len(content) // 2] ^= 4
    files = {
        "truncated": content[: len(content) * 2 // 3],
        "flipped": bytes(flipped),
        "empty": b"",
        "foreign": b"time,alpha\n0,1\n" * 50,
        "future": content.replace(
            b"schema_version\x01\x00\x00\x00%d" % SCHEMA_VERSION, b"schema_version\x01\x00\x00\x009"
        ),
    }
    for name, data in files.items():
        (folder / f"{name}.mcap").write_bytes(data)
    os.mkfifo(folder / "pipe.mcap")
    return {name: folder / f"{name}.mcap" for name in [*files, "pipe", "whole", "missing"]}


SAYS = {
    "truncated": "truncated at byte",
    "flipped": "damaged at byte",
    "empty": "not an MCAP file",
    "foreign": "not an MCAP file",
    "future": "schema version 9",
    "missing": "no such file",
    "pipe": "is a pipe",
}


@pytest.mark.parametrize("kind", SAYS)
@pytest.mark.parametrize("command", ["replay", "diff", "info", "export"])
def test_a_bad_file_is_one_clear_line_and_exit_code_2(bad, kind, command, rig_command):
    rest = {"diff": [bad["whole"]], "export": ["--to", "csv"]}.get(command, [])
    code, out, err = rig_command(command, bad[kind], *rest)
    assert code == 2 and err.count("\n") == 1 and err.startswith("error: ")
    assert SAYS[kind] in err and str(bad[kind]) in err
    assert out == "" or (command == "info" and kind in ("truncated", "flipped"))


def test_another_schema_is_refused_with_both_versions_and_who_wrote_it(tmp_path, monkeypatch, rig_command):
    monkeypatch.setattr("rig.log.writer.SCHEMA_VERSION", 1)
    about: dict[str, Any] = {"version jsbsim-rig": "0.0.9", "git commit": "abc123"}
    old = logged(tmp_path / "a.mcap", new_block(3), **about)
    code, _, err = rig_command("replay", old)
    assert code == 2
    read = f"this one reads {OLDEST} to {SCHEMA_VERSION}"
    assert f"schema version 1 (written by jsbsim-rig 0.0.9, commit abc123); {read}" in err


def test_a_truncated_log_is_recovered_and_then_read(bad, tmp_path, rig_command):
    out = tmp_path / "mended.mcap"
    code, _, _ = rig_command("recover", bad["truncated"], "--out", out)
    assert code == 0
    code, text, _ = rig_command("info", out, "--json")
    found = json.loads(text)
    assert code == 0 and found["frames"] == len(read_log(out).rows) > 0
    assert found["damage"] is None and "recovered from a log that was truncated" in found["health"]


def test_settings_that_differ_are_named_with_both_values(tmp_path, rig_command):
    rows = random_block(4)
    scenarios = (
        {"seed": 1, "redundancy": {"persistence": 8, "boxes": {}}, "faults": [{"kind": "offset", "offset": 0.1}]},
        {"seed": 1, "redundancy": {"persistence": 12, "boxes": {}}, "faults": [{"kind": "offset"}], "title": "T"},
    )
    logs = [logged(tmp_path / f"{i}.mcap", rows, scenario=json.dumps(each)) for i, each in enumerate(scenarios)]
    code, out, _ = rig_command("diff", *logs)
    assert code == 0
    for said in ("redundancy.persistence: 8 and 12", "faults.0.offset: 0.1 and not set", 'title: not set and "T"'):
        assert said in out
    assert "seed" not in out and "boxes" not in out
    many = [
        logged(tmp_path / f"m{i}.mcap", rows, scenario=json.dumps({f"k{n}": n + i for n in range(30)})) for i in (0, 1)
    ]
    assert "and 10 more settings that differ" in rig_command("diff", *many)[1]
