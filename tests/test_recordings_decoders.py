"""CSV as decoders and spreadsheets write it: the same rows as of the plain file, and what was left out is told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.core.errors import BadInput
from rig.log.recordings.read import load
from rig.log.recordings.recording import Recording
from rig.log.recordings.vote_config import RecordedSignal, config_of

N = 60
RNG = np.random.default_rng(5)
TIMES = np.arange(N) / 50
GYROS = {f"gyro.{c}": np.round(0.2 * np.sin(TIMES) + RNG.normal(0, 0.002, N), 6) for c in (1, 2, 3)}
NAMES = ["time_s", *GYROS]
ROWS = [[repr(float(cell)) for cell in row] for row in np.stack([TIMES, *GYROS.values()], axis=1)]
ONE: dict[str, Any] = {"signal": {"gyro": {"threshold": 0.05}}}


def lines(rows: list[list[str]] = ROWS, names: list[str] = NAMES, between: str = ",", end: str = "\n") -> list[str]:
    return [between.join(row) + end for row in [names, *rows]]


def commented(made: list[str]) -> str:
    return "".join([*made[:20], "# a remark, with commas\n", "#\n", *made[20:], "# the end\n"])


def in_full(path: Path, text: str, **config: Any) -> tuple[Recording, dict[str, RecordedSignal]]:
    path.write_bytes(text.encode())
    return load(path, config_of({**ONE, **config}, path), "c.toml")


AS_WRITTEN: dict[str, tuple[str, str]] = {
    "plain": ("".join(lines()), ""),
    "blanks behind commas": ("".join(lines(between=", ")), ""),
    "blanks on both sides": ("".join(lines(between=" , ", end="  \n")), ""),
    "tabs for blanks": ("".join(lines(between=",\t")), ""),
    "a separator at each end": ("".join(lines(end=",\n")), ""),
    "two separators at each end": ("".join(lines(end=",,\n")), ""),
    "a separator at the end of rows alone": (",".join(NAMES) + "\n" + "".join(lines(end=",\n")[1:]), ""),
    "a separator at the end of the header alone": (",".join(NAMES) + ",\n" + "".join(lines()[1:]), ""),
    "blanks and a separator": ("".join(lines(between=", ", end=", \n")), ""),
    "comments at the top": ("# by a decoder\n#\n# gyro, rad/s\n" + "".join(lines()), ""),
    "comments within": (commented(lines()), "3 lines that begin with # were left out"),
    "comments and blanks": ("# x\n" + commented(lines(between=", ")), "3 lines that begin with # were left out"),
    "comments with carriage returns": (
        commented(lines(end="\r\n")).replace("\n", "\r\n").replace("\r\r", "\r"),
        "3 lines",
    ),
    "a header in a comment": ("# numpy wrote this\n# " + "".join(lines(between=" , ")), ""),
    "a header in quotes": (",".join(f'"{name}"' for name in NAMES) + "\n" + "".join(lines()[1:]), ""),
    "a header in quotes behind blanks": (", ".join(f'"{name}"' for name in NAMES) + "\n" + "".join(lines()[1:]), ""),
    "all in quotes": ("".join(lines([[f'"{c}"' for c in row] for row in ROWS], [f'"{n}"' for n in NAMES])), ""),
    "all in quotes behind blanks": (
        "".join(lines([[f'"{c}"' for c in row] for row in ROWS], [f'"{n}"' for n in NAMES], between=", ")),
        "",
    ),
    "a mark of the byte order": ("\ufeff" + "".join(lines()), ""),
    "a mark and blanks": ("\ufeff" + "".join(lines(between=", ")), ""),
    "a mark and a comment": ("\ufeff# x\n" + "".join(lines()), ""),
    "empty lines": ("\n\n" + "".join(lines()).replace("\n", "\n\n"), ""),
    "settings before the header": (
        "Product,A recorder\nFirmware,4.5\nP interval,2\n" + "".join(lines()),
        "columns are named in line 4; 3 lines before it were left out",
    ),
    "a column without a name": (
        "".join(lines([[str(k), *row] for k, row in enumerate(ROWS)], ["", *NAMES])),
        "column 1 has no name: left out",
    ),
    "semicolons, commas and blanks": (
        "".join(lines([[c.replace(".", ",") for c in row] for row in ROWS], between="; ", end=" ;\n")),
        "decimal comma",
    ),
    "tabs at each end": ("".join(lines(between="\t", end="\t\n")), "tabs"),
}


@pytest.mark.parametrize("name", AS_WRITTEN)
def test_what_stands_beside_names_and_numbers_changes_nothing(name: str, tmp_path: Path):
    text, says = AS_WRITTEN[name]
    recorded, _ = in_full(tmp_path / "a.csv", text)
    assert recorded.time_s.tolist() == TIMES.tolist()
    channels = recorded.signals["gyro"].channels
    assert [channel.tolist() for channel in channels] == [values.tolist() for values in GYROS.values()]
    assert says in " ".join(recorded.remarks)
    assert not recorded.warnings


@pytest.mark.parametrize("between", [",", ", ", " , "])
def test_empty_cells_among_blanks_are_no_sample(between: str, tmp_path: Path):
    rows = [[*row] for row in ROWS]
    rows[3][2], rows[4][3], rows[5][1] = "", "nan", " "
    recorded, _ = in_full(tmp_path / "a.csv", "".join(lines(rows, between=between)))
    channels = recorded.signals["gyro"].channels
    assert [np.flatnonzero(np.isnan(channel)).tolist() for channel in channels] == [[5], [3], [4]]


@pytest.mark.parametrize("head", ["", "# x\n"])
@pytest.mark.parametrize("between", [",", ", "])
def test_a_cell_that_is_no_number_is_told_by_its_row_and_name(head: str, between: str, tmp_path: Path):
    rows = [[*row] for row in ROWS]
    rows[6][2] = "off"
    with pytest.raises(BadInput, match=r"row 7, column 'gyro.2': 'off' is not a number"):
        in_full(tmp_path / "a.csv", head + "".join(lines(rows, between=between)))


@pytest.mark.parametrize("head", ["", "# x\n"])
def test_a_row_of_another_length_is_told_by_its_number(head: str, tmp_path: Path):
    rows = [[*row] for row in ROWS]
    del rows[6][2]
    with pytest.raises(BadInput, match="row 7 has 3 cells, the header 4"):
        in_full(tmp_path / "a.csv", head + "".join(lines(rows)))


def with_units(units: list[str], factor: float = 1.0, tick: float = 1.0) -> str:
    rows = [[repr(float(row[0]) / tick), *(repr(float(cell) / factor) for cell in row[1:])] for row in ROWS]
    return "".join([*lines(rows)[:1], ",".join(units) + "\n", *lines(rows)[1:]])


@pytest.mark.parametrize("bracket", ["{}", "[{}]", "({})", " [ {} ] "])
def test_a_row_of_units_gives_the_unit_that_config_does_not(bracket: str, tmp_path: Path):
    units = [bracket.format(unit) for unit in ("ms", "deg/s", "deg/s", "deg/s")]
    recorded, settings = in_full(tmp_path / "a.csv", with_units(units, np.pi / 180, 1e-3))
    assert recorded.time_s == pytest.approx(TIMES)
    assert recorded.signals["gyro"].channels[0] == pytest.approx(GYROS["gyro.1"])
    assert settings["gyro"].unit == "deg/s" and settings["gyro"].threshold == pytest.approx(0.05 * np.pi / 180)
    said = " ".join(recorded.remarks)
    assert "gyro and its amounts in CONFIG are in deg/s, by the row of units" in said
    assert "time in ms, by its row of units" in said


def test_units_of_config_come_before_those_of_the_row(tmp_path: Path):
    text = with_units(["ms", "deg/s", "deg/s", "deg/s"])
    recorded, settings = in_full(
        tmp_path / "a.csv", text, time_unit="s", signal={"gyro": {"threshold": 0.05, "unit": "rad/s"}}
    )
    assert recorded.time_s == pytest.approx(TIMES) and settings["gyro"].unit == "rad/s"
    assert (
        "gyro.1 in deg/s, gyro.2 in deg/s, gyro.3 in deg/s; the unit of CONFIG is taken, rad/s" in recorded.remarks[-1]
    )


def test_units_that_are_not_known_are_told_and_not_used(tmp_path: Path):
    recorded, settings = in_full(tmp_path / "a.csv", with_units(["ticks", "adus", "adus", "adus"]))
    assert settings["gyro"].unit is None and recorded.time_s == pytest.approx(TIMES)
    said = " ".join(recorded.remarks)
    assert "'ticks' is no unit of time: s is taken" in said and "'adus' of gyro is not used" in said


def test_channels_of_one_signal_in_several_units_are_refused(tmp_path: Path):
    with pytest.raises(BadInput, match=r"gyro.1 in deg/s, gyro.2 in rad/s, gyro.3 in deg/s: a signal has one unit"):
        in_full(tmp_path / "a.csv", with_units(["s", "deg/s", "rad/s", "deg/s"]))


def test_a_row_of_units_of_mapped_columns_and_of_files_in_a_folder_counts(tmp_path: Path):
    text = with_units(["s", "deg/s", "deg/s", "deg/s"], np.pi / 180).replace("gyro.", "w").replace("time_s", "t", 1)
    mapping = {"gyro.1": "w1", "gyro.2": "w2"}
    _, settings = in_full(tmp_path / "a.csv", text, time_column="t", mapping=mapping)
    assert settings["gyro"].unit == "deg/s"
    (tmp_path / "f").mkdir()
    for name in "ab":
        (tmp_path / "f" / f"{name}.csv").write_text(text)
    config = config_of({**ONE, "time_column": "t", "mapping": {"gyro.1": "a.csv:w1", "gyro.2": "b.csv:w2"}}, Path("c"))
    recorded, settings = load(tmp_path / "f", config, "c.toml")
    assert settings["gyro"].unit == "deg/s" and recorded.signals["gyro"].channels[1] == pytest.approx(GYROS["gyro.2"])


def test_columns_with_colons_in_their_names_are_named(tmp_path: Path):
    (tmp_path / "f").mkdir()
    for name in "ab":
        (tmp_path / "f" / f"{name}.csv").write_text("".join(lines(names=["time_s", "imu:gyro:x", "y", "z"])))
    mapping = {"gyro.1": "a.csv:imu:gyro:x", "gyro.2": "b.csv:imu:gyro:x"}
    recorded, _ = load(tmp_path / "f", config_of({**ONE, "mapping": mapping}, Path("c")), "c.toml")
    assert recorded.signals["gyro"].channels[1].tolist() == GYROS["gyro.1"].tolist()


def test_the_signal_that_is_not_there_is_named_with_those_that_are(tmp_path: Path):
    """Never with a name that looks the same as the one that was asked for."""
    with pytest.raises(BadInput, match="signal 'gyro' is not in the input; allowed: rate"):
        in_full(tmp_path / "a.csv", "".join(lines(names=[name.replace("gyro", " rate") for name in NAMES])))


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("time_s", "t", 1),
        lambda text: "#" + text.replace("\n", "\n#"),
        lambda text: "a,b\n" * 3000 + text,
        lambda text: text[:20],
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(change: Callable[[str], str], tmp_path: Path):
    with pytest.raises(BadInput) as refusal:
        in_full(tmp_path / "a.csv", change("".join(lines())))
    assert str(refusal.value).startswith(str(tmp_path / "a.csv")) and "\n" not in str(refusal.value)
