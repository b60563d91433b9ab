"""Recordings as users have them: units, clocks, separators and names, and what is told or refused of each."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
import tomli_w

DEG = np.pi / 180
N = 400
T = np.arange(N) / 50
RNG = np.random.default_rng(3)
RATES = {f"pitch_rate.{c}": 0.2 * np.sin(T) + RNG.normal(0, 0.002, N) for c in range(1, 5)}  # rad/s
RATES["pitch_rate.3"][200:] += 0.1
HEADINGS = {f"hdg.{c}": (350 + 20 * np.sin(T) + RNG.normal(0, 0.1, N)) % 360 for c in range(1, 5)}  # deg
PITCH: dict[str, Any] = {"signal": {"pitch_rate": {"threshold": 0.03}}}
IN_DEG: dict[str, Any] = {"signal": {"pitch_rate": {"threshold": 0.03 / DEG, "unit": "deg/s"}}}


def frame(columns: dict[str, Any], time_s: Any = T, name: str = "time_s") -> pl.DataFrame:
    return pl.DataFrame({name: time_s, **columns})


@pytest.fixture
def vote(rig_command: Any) -> Any:
    """vote(file, **config) -> exit code, what was printed or the error, the JSON summary."""

    def voted(file: str, out: str = "o.csv", **config: Any) -> tuple[int, str, dict[str, Any]]:
        Path("c.toml").write_text(tomli_w.dumps(config))
        Path(out).unlink(missing_ok=True)
        code, said, error = rig_command("vote", file, "--config", "c.toml", "--out", out)
        if code:
            assert error.count("\n") == 1 and said == "" and not Path(out).exists()
            return code, error, {}
        return code, said, json.loads(rig_command("vote", file, "--config", "c.toml", "--out", out, "--json")[1])

    return voted


def unwritten(out: dict[str, Any]) -> dict[str, Any]:
    """What a vote found, without its amounts, file names and seconds."""
    channels = {name: signal["channels"] for name, signal in out["signals"].items()}
    return {"channels": channels, "time_s": out["time_s"], "rows": out["rows"]}


@pytest.fixture
def plain(vote: Any) -> dict[str, Any]:
    """The vote on the same rates in rad/s and seconds."""
    frame(RATES).write_csv("plain.csv")
    code, _, found = vote("plain.csv", **PITCH)
    assert code == 0 and found["warnings"] == [] and found["remarks"] == []
    assert found["signals"]["pitch_rate"]["channels"][2]["failed"][0]["frame"] == 208
    return found


def test_a_rate_in_degrees_with_its_unit_is_voted_as_one_in_radians(vote: Any, plain: dict[str, Any]):
    frame({name: x / DEG for name, x in RATES.items()}).write_csv("in.csv")
    votes = pl.read_csv("o.csv")["pitch_rate.voted"].to_numpy()
    code, said, found = vote("in.csv", **IN_DEG)
    assert code == 0 and unwritten(found) == unwritten(plain) and "deg/s" in said
    signal = found["signals"]["pitch_rate"]
    assert signal["unit"] == "deg/s" and signal["threshold"] == pytest.approx(0.03 / DEG)
    assert signal["spread"]["max"] == pytest.approx(plain["signals"]["pitch_rate"]["spread"]["max"] / DEG)
    assert pl.read_csv("o.csv")["pitch_rate.voted"].to_numpy() == pytest.approx(votes / DEG)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_tables_are_in_the_unit_of_the_signal_and_an_mcap_in_si(ending: str, vote: Any):
    frame({name: x / DEG for name, x in RATES.items()}).write_csv("in.csv")
    assert vote("in.csv", f"o.{ending}", **IN_DEG)[0] == 0
    table = pl.read_csv("o.csv") if ending == "csv" else pl.read_parquet("o.parquet")
    assert vote("in.csv", "o.mcap", **IN_DEG)[0] == 0
    code, _, again = vote("o.mcap", "again.csv", **IN_DEG)  # a file of the rig's: not converted a second time
    assert code == 0 and again["signals"]["pitch_rate"]["unit"] == "deg/s"
    assert pl.read_csv("again.csv")["pitch_rate.voted"].to_numpy() == pytest.approx(
        table["pitch_rate.voted"].to_numpy()
    )
    assert vote("o.mcap", "si.csv", **PITCH)[2]["signals"]["pitch_rate"]["unit"] == "rad/s"
    assert pl.read_csv("si.csv")["pitch_rate.voted"].to_numpy() / DEG == pytest.approx(
        table["pitch_rate.voted"].to_numpy()
    )


def test_the_unit_holds_for_range_reference_and_every_threshold(vote: Any):
    samples = {f"alt.{c}": np.full(N, 1000.0 + c) for c in range(1, 4)}
    samples["alt.2"][100:110] = 5000.0  # out of range, in ft
    frame({**samples, "alt.ref": np.full(N, 1002.0)}).write_csv("in.csv")
    signal = {"threshold": 3.5, "threshold_duplex": 1.0, "reference_threshold": 5.0, "range": [0.0, 4000.0]}
    code, _, found = vote("in.csv", signal={"alt": {**signal, "unit": "ft"}})
    without = vote("in.csv", signal={"alt": signal})[2]
    assert code == 0 and unwritten(found) == unwritten(without) and found["signals"]["alt"]["unit"] == "ft"
    assert found["signals"]["alt"]["channels"][1]["failed"] == [
        {"frame": 108, "time_s": 2.14, "why": "invalid", "since_first_row_s": 2.14}
    ]
    assert found["signals"]["alt"]["voted"]["max"] == pytest.approx(without["signals"]["alt"]["voted"]["max"])
    assert without["signals"]["alt"]["unit"] is None


def test_a_unit_of_another_quantity_is_refused_with_those_allowed(vote: Any):
    frame(RATES).write_csv("in.csv")
    code, error, _ = vote("in.csv", signal={"pitch_rate": {"threshold": 1.0, "unit": "ft"}})
    assert code == 2 and "c.toml: signal.pitch_rate: unit: 'ft' is not a unit of this quantity" in error
    assert "allowed: rad/s, deg/s, rpm" in error


def test_an_angle_in_degrees_with_its_unit_is_voted_over_north(vote: Any):
    frame(HEADINGS).write_csv("in.csv")
    code, _, found = vote(
        "in.csv", signal={"hdg": {"threshold": 2.0, "wraps": True, "range": [0.0, 360.0], "unit": "deg"}}
    )
    voted = pl.read_csv("o.csv")["hdg.voted"].to_numpy()
    assert code == 0 and found["signals"]["hdg"]["level"] == 4
    assert np.abs((voted - (350 + 20 * np.sin(T)) + 180) % 360 - 180).max() < 0.5


@pytest.mark.parametrize("limits", [[0.0, 360.0], [-180.0, 180.0]])
def test_a_range_of_an_angle_that_is_not_one_turn_asks_for_the_unit(limits: list[float], vote: Any):
    frame(HEADINGS).write_csv("in.csv")
    code, error, _ = vote("in.csv", signal={"hdg": {"threshold": 2.0, "wraps": True, "range": limits}})
    assert code == 2 and "signal.hdg: range: 360 is not one turn in rad" in error
    assert 'is the file in degrees? unit = "deg"' in error
    code, error, _ = vote(
        "in.csv", signal={"hdg": {"threshold": 2.0, "wraps": True, "range": [0.0, 180.0], "unit": "deg"}}
    )
    assert code == 2 and "180 is not one turn in deg (360)" in error


@pytest.mark.parametrize(
    ("columns", "signal", "says"),
    [
        (
            RATES,
            {"pitch_rate": {"threshold": 1.7}},
            'out of range [-1.5, 1.5] rad/s: if the file is in deg/s, set unit = "deg',
        ),
        (
            HEADINGS,
            {"hdg": {"threshold": 2.0, "wraps": True}},
            'range [-3.142, 3.142] rad: if the file is in deg, set unit = "deg"',
        ),
    ],
)
def test_samples_that_all_leave_a_range_that_is_not_given_are_refused(
    columns: dict[str, Any], signal: dict[str, Any], says: str, vote: Any
):
    in_degrees = {name: x / DEG if "pitch" in name else x for name, x in columns.items()}
    frame(in_degrees).write_csv("in.csv")
    code, error, _ = vote("in.csv", signal=signal)
    assert code == 2 and says in error
    outside = [100 * np.mean(np.abs(x) > (1.5 if "pitch" in name else np.pi)) for name, x in in_degrees.items()]
    share = re.search(r"([\d.]+)(?: to ([\d.]+))? % of the samples of every channel", error)
    assert share is not None and float(share[1]) == pytest.approx(min(outside), rel=1e-2)
    assert float(share[2] or share[1]) == pytest.approx(max(outside), rel=1e-2)


def test_samples_out_of_the_users_own_range_are_told_and_voted(vote: Any):
    frame({name: x / DEG for name, x in RATES.items()}).write_csv("in.csv")
    code, said, found = vote("in.csv", signal={"pitch_rate": {"threshold": 1.7, "range": [-1.5, 1.5]}})
    (warning,) = found["warnings"]
    assert code == 0 and warning in " ".join(said.split())
    assert "of every channel are out of range [-1.5, 1.5]" in warning and 'unit = "deg/s"' in warning
    failed = [channel["failed"][0]["why"] for channel in found["signals"]["pitch_rate"]["channels"]]
    assert failed == ["invalid"] * 4


def test_a_channel_that_is_often_no_sample_is_told_by_name_and_share(vote: Any):
    columns = {name: x.copy() for name, x in RATES.items()}
    columns["pitch_rate.2"][:100] = np.nan
    columns["pitch_rate.4"][:120] = 40.0
    frame(columns).write_csv("in.csv")
    found = vote("in.csv", **PITCH)[2]
    assert [line.split(": ", 1)[1] for line in found["warnings"]] == [
        "pitch_rate.4: 30 % of the samples are out of range [-1.5, 1.5] rad/s: if the file is in deg/s, "
        'set unit = "deg/s"; otherwise give its range in CONFIG',
        "pitch_rate.2: 25 % of the samples are not numbers: check the recorder, or leave the channel out",
    ]
    columns["pitch_rate.2"][:100] = RATES["pitch_rate.2"][:100]
    columns["pitch_rate.4"][60:] = RATES["pitch_rate.4"][60:]  # 15 %: as a fault may leave it
    frame(columns).write_csv("in.csv")
    assert vote("in.csv", **PITCH)[2]["warnings"] == []


def test_thresholds_say_of_the_same_data_what_the_vote_says(rig_command: Any):
    frame({name: x / DEG for name, x in RATES.items()}).write_csv("in.csv")
    options = ("--budget", "30", "--persistence", "8", "--filter", "0", "--levels", "4", "--out", "d.toml")
    for signal, says in (
        ({"threshold": 1.7}, "of every channel are out of range [-1.5, 1.5] rad/s: if the file is in deg/s"),
        ({"range": [-1.5, 1.5]}, "pitch_rate.1: 8 samples or more in a row are not valid ("),
        ({"range": [-1.5, 1.5]}, "correct it (unit or range in CONFIG, or --align) or leave it out"),
    ):
        Path("c.toml").write_text(tomli_w.dumps({"signal": {"pitch_rate": signal}}))
        code, _, error = rig_command("thresholds", "in.csv", "--config", "c.toml", *options)
        assert code == 2 and says in error and not Path("d.toml").exists()


def test_thresholds_are_designed_in_the_unit_of_the_signal(rig_command: Any):
    healthy = {name: x.copy() for name, x in RATES.items()}
    healthy["pitch_rate.3"][200:] -= 0.1
    options = ("--budget", "300", "--persistence", "2", "--filter", "0", "--levels", "4", "--json")
    found = {}
    for unit, factor in (("rad/s", 1.0), ("deg/s", 1 / DEG)):
        frame({name: np.tile(x, 3) * factor for name, x in healthy.items()}, np.arange(3 * N) / 50).write_csv("in.csv")
        Path("c.toml").write_text(tomli_w.dumps({"signal": {"pitch_rate": {"unit": unit}}}))
        code, said, error = rig_command("thresholds", "in.csv", "--config", "c.toml", "--out", "d.toml", *options)
        assert code == 0, error
        written = re.search(r"^threshold = ([\d.]+)$", Path("d.toml").read_text(), re.MULTILINE)
        assert written is not None and f'unit = "{unit}"' in Path("d.toml").read_text()
        found[unit] = (float(written[1]), json.loads(said)["signals"]["pitch_rate"])
    (threshold, si), (in_deg, shown) = found["rad/s"], found["deg/s"]
    assert in_deg * DEG == pytest.approx(threshold, rel=2e-3) and shown["unit"] == "deg/s"
    assert shown["motion"]["value"] * DEG == pytest.approx(si["motion"]["value"])
    assert shown["chosen"]["threshold"] == in_deg


@pytest.mark.parametrize(("unit", "scale"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_time_in_another_unit_is_suspected_by_its_rate_and_read_by_its_unit(
    unit: str, scale: float, vote: Any, plain: dict[str, Any]
):
    frame(RATES, T * scale).write_csv("in.csv")
    code, said, found = vote("in.csv", **PITCH)
    assert code == 0 and f'if time is not in seconds, time_unit = "{unit}"' in said and len(found["warnings"]) == 1
    code, _, found = vote("in.csv", time_unit=unit, **PITCH)
    assert code == 0 and found["warnings"] == [] and found["time_s"] == pytest.approx(plain["time_s"])
    assert [c["state"] for c in found["signals"]["pitch_rate"]["channels"]] == ["ok", "ok", "failed", "ok"]


def test_a_unit_that_is_none_of_time_is_refused(vote: Any):
    frame(RATES).write_csv("in.csv")
    code, error, _ = vote("in.csv", time_unit="deg", **PITCH)
    assert code == 2 and "c.toml: time_unit: 'deg' is not a unit of this quantity; allowed: s, ms, us" in error


def test_a_rate_that_no_recorder_has_is_told(vote: Any):
    frame(RATES, T / 3600).write_csv("in.csv")
    assert (
        '1.8e+05 rows a second: if time is not in seconds, time_unit = "h"' in vote("in.csv", **PITCH)[2]["warnings"][0]
    )


def test_a_hole_is_told_with_its_length_and_time(vote: Any):
    cut = frame(RATES)
    pl.concat([cut[:100], cut[300:]]).write_csv("in.csv")
    (warning,) = vote("in.csv", **PITCH)[2]["warnings"]
    assert "in.csv: gap of 4.02 s at 1.98 s: the rows before and after count as consecutive" in warning
    pl.concat([cut[:100], cut[110:200], cut[300:]]).write_csv("in.csv")
    (warning,) = vote("in.csv", **PITCH)[2]["warnings"]
    assert "2 gaps of more than 5 rows, the largest a gap of 2.02 s at 3.98 s" in warning
    pl.concat([cut[:100], cut[104:]]).write_csv("in.csv")
    assert vote("in.csv", **PITCH)[2]["warnings"] == []


def test_a_hole_of_any_recorder_in_a_folder_is_told(vote: Any):
    Path("flight").mkdir()
    for c in (1, 2):
        one = pl.DataFrame({"time_s": T, "q": RATES[f"pitch_rate.{c}"]})
        (one if c == 1 else pl.concat([one[:100], one[150:]])).write_csv(f"flight/{c}.csv")
    mapping = {f"pitch_rate.{c}": f"{c}.csv:q" for c in (1, 2)}
    (warning,) = vote("flight", mapping=mapping, **PITCH)[2]["warnings"]
    assert warning.startswith("flight: 2.csv: gap of 1.02 s at 1.98 s")


@pytest.mark.parametrize(("separator", "name"), [(";", "';'"), ("\t", "tabs")])
def test_other_separators_are_found(separator: str, name: str, vote: Any, plain: dict[str, Any]):
    frame(RATES).write_csv("in.csv", separator=separator)
    code, said, found = vote("in.csv", **PITCH)
    assert code == 0 and unwritten(found) == unwritten(plain) and f"columns separated by {name}" in said


def test_a_separator_of_ones_own_is_set(vote: Any, plain: dict[str, Any]):
    frame(RATES).write_csv("in.csv", separator="|")
    code, error, _ = vote("in.csv", **PITCH)
    assert code == 2 and "docs/reference/recordings.md" in error
    assert unwritten(vote("in.csv", separator="|", **PITCH)[2]) == unwritten(plain)


def test_a_decimal_comma_is_found_and_told(vote: Any, plain: dict[str, Any]):
    text = frame(RATES).write_csv(separator=";")
    head, rows = text.split("\n", 1)
    Path("in.csv").write_text(f"{head}\n{rows.replace('.', ',')}")
    code, said, found = vote("in.csv", **PITCH)
    assert code == 0 and unwritten(found) == unwritten(plain) and "separated by ';', decimal comma" in said
    Path("in.csv").write_text(f"{head}\n{rows.replace('.', ',')}9;0,1;one;0,1;0,1\n")
    code, error, _ = vote("in.csv", **PITCH)
    assert code == 2 and f"in.csv: row {N + 1}, column 'pitch_rate.2': 'one' is not a number" in error
    code, error, _ = vote("in.csv", decimal=".", **PITCH)
    assert code == 2 and "in.csv: row 1, column 'time_s': '0,0' is not a number" in error


def test_a_decimal_comma_within_commas_points_to_the_way_out(vote: Any):
    Path("in.csv").write_text("time_s,x.1,x.2\n0,0,1,0,2,0\n")
    code, error, _ = vote("in.csv", default={"threshold": 1.0})
    assert code == 2 and "row 1 has 6 cells, the header 3" in error and "separator or decimal in CONFIG" in error


STAMPS = {
    "UTC": ("2024-05-01T12:00:%06.3fZ", "2024-05-01 12:00:00Z"),
    "of a zone": ("2024-05-01T12:00:%06.3f+02:00", "2024-05-01 10:00:00Z"),
    "local": ("2024-05-01 12:00:%06.3f", "2024-05-01 12:00:00"),
    "of day": ("12:00:%06.3f", "12:00:00"),
}


@pytest.mark.parametrize("kind", STAMPS)
def test_a_time_of_the_calendar_is_read_as_seconds_since_the_first_row(kind: str, vote: Any, plain: dict[str, Any]):
    form, began = STAMPS[kind]
    frame(RATES, [form % t for t in T]).write_csv("in.csv")
    code, said, found = vote("in.csv", **PITCH)
    assert code == 0 and unwritten(found) == unwritten(plain)
    assert f"in.csv: time_s in seconds since {began}, its first row" in said


def test_a_stamp_that_is_none_is_refused_by_its_row(vote: Any):
    stamps = [f"2024-05-01T12:00:{t:06.3f}Z" for t in T]
    for bad, says in (("noon", "'noon' is not a time like that of the first"), ("", "row 4: time_s is not a number")):
        frame(RATES, [*stamps[:3], bad, *stamps[4:]]).write_csv("in.csv")
        code, error, _ = vote("in.csv", **PITCH)
        assert code == 2 and "in.csv: row 4" in error and says in error
    frame(RATES, ["noon", *stamps[1:]]).write_csv("in.csv")
    code, error, _ = vote("in.csv", **PITCH)
    assert code == 2 and "row 1, column 'time_s': 'noon' is not a number" in error and "2024-05-01T12:00:00.02" in error


def test_a_parquet_column_of_time_stamps_is_read(vote: Any, plain: dict[str, Any]):
    stamps = pa.array(np.rint(T * 1e9).astype("int64") + 1_714_564_800_000_000_000).cast(pa.timestamp("ns"))
    pq.write_table(pa.table({"time_s": stamps, **RATES}), "in.parquet")
    code, said, found = vote("in.parquet", **PITCH)
    assert code == 0 and unwritten(found) == unwritten(plain) and "since 2024-05-01 12:00:00, its first row" in said


def test_recorders_of_one_calendar_share_its_zero(vote: Any):
    Path("flight").mkdir()
    for c in (1, 2):
        stamps = [f"12:00:{t + 0.02 * (c - 1):06.3f}" for t in T]
        pl.DataFrame({"time_s": stamps, "q": np.arange(N) + c - 1.0}).write_csv(f"flight/{c}.csv")
    mapping = {f"x.{c}": f"{c}.csv:q" for c in (1, 2)}
    code, _, found = vote("flight", mapping=mapping, default={"threshold": 0.5})
    assert code == 0 and found["signals"]["x"]["spread"]["p95"] == 0.0  # its row at the same time of day
    pl.DataFrame({"time_s": T, "q": T}).write_csv("flight/2.csv")
    code, error, _ = vote("flight", mapping=mapping, default={"threshold": 0.5})
    assert code == 2 and "a time of the calendar in one source and a number in another" in error


def test_a_column_of_another_name_points_to_the_mapping(vote: Any, plain: dict[str, Any]):
    frame({**RATES, "altitude": T}).write_csv("in.csv")
    code, error, _ = vote("in.csv", **PITCH)
    assert (
        code == 2
        and "unknown column 'altitude'" in error
        and "[mapping] in CONFIG: docs/reference/recordings.md" in error
    )
    own = {f"Q_{c}": RATES[f"pitch_rate.{c}"] for c in range(1, 5)}
    frame(own, name="Time").write_csv("in.csv")
    code, error, _ = vote("in.csv", **PITCH)
    assert code == 2 and "no column 'time_s'; there are: Time, Q_1, Q_2, Q_3, Q_4; name" in error
    assert "time_column and [mapping] in CONFIG: docs/reference/recordings.md" in error
    mapping = {f"pitch_rate.{c}": f"Q_{c}" for c in range(1, 5)}
    assert unwritten(vote("in.csv", time_column="Time", mapping=mapping, **PITCH)[2]) == unwritten(plain)
    frame(RATES, name="Time").write_csv("in.csv")  # time alone has another name
    assert unwritten(vote("in.csv", time_column="Time", **PITCH)[2]) == unwritten(plain)


def test_a_missing_channel_is_named(vote: Any):
    frame({name: x for name, x in RATES.items() if name != "pitch_rate.2"}).write_csv("in.csv")
    code, error, _ = vote("in.csv", **PITCH)
    assert code == 2 and "signal 'pitch_rate' has a channel 4 but no channel 2" in error


def test_a_header_that_is_no_utf_8_is_refused(vote: Any):
    Path("in.csv").write_bytes("time_s,x.1,x.2,°\n0,1,1,1\n".encode("latin-1"))
    code, error, _ = vote("in.csv", default={"threshold": 1.0})
    assert code == 2 and "in.csv: must be encoded in UTF-8" in error


def test_settings_of_tables_are_refused_for_messages(vote: Any):
    frame(RATES).write_csv("in.csv")
    assert vote("in.csv", "in.mcap", **PITCH)[0] == 0
    code, error, _ = vote("in.mcap", time_unit="ms", **PITCH)
    assert code == 2 and "in.mcap: time_unit, separator and decimal are those of tables" in error


def test_a_heading_counted_from_north_is_told_its_range(vote: Any):
    frame(HEADINGS).write_csv("in.csv")
    wrong = {"signal": {"hdg": {"threshold": 2.0, "wraps": True, "unit": "deg"}}}
    code, error, _ = vote("in.csv", **wrong)
    assert code == 2 and error.endswith("give its range in CONFIG: range = [0, 360]\n")
    wrong["signal"]["hdg"]["range"] = [0.0, 360.0]
    code, _, found = vote("in.csv", **wrong)
    assert code == 0 and [c["state"] for c in found["signals"]["hdg"]["channels"]] == ["ok"] * 4


@pytest.mark.parametrize(
    ("kind", "module", "reader"), [("csv", pyarrow.csv, "read_csv"), ("parquet", pq, "ParquetFile")]
)
def test_no_file_of_pythons_is_left_to_the_threads_that_read_a_table(
    kind: str, module: Any, reader: str, rig_command: Any, monkeypatch: pytest.MonkeyPatch
):
    """One that is let go of while the process ends aborts it: exit code 134 in place of 2."""
    table = pl.DataFrame({"time_s": [0.0, 0.01], "q.1": [1.0, 2.0]})
    (table.write_csv if kind == "csv" else table.write_parquet)(f"in.{kind}")
    Path("config.toml").write_text("[signal.q]\nthreshold = 0.1\n")
    given, plain = [], getattr(module, reader)
    monkeypatch.setattr(module, reader, lambda file, *more: given.append(file) or plain(file, *more))
    code, _, error = rig_command("vote", f"in.{kind}", "--config", "config.toml", "--out", "out.csv")
    assert code == 2 and "one channel" in error
    assert given and all(isinstance(file, pa.OSFile) for file in given)
