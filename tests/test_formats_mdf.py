"""MDF 4 files: values of asammdf's writer; without the library one line."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from rig.core.errors import BadInput
from rig.log.recordings.formats.known import open_log
from rig.log.recordings.read import read
from rig.log.recordings.vote_config import config_of


def written(path: Path) -> dict[str, np.ndarray]:
    from asammdf import MDF, Signal

    time_s = np.arange(200) / 100
    columns = {f"gyro_{i}": np.sin(time_s) + 0.001 * i for i in range(3)}
    with MDF() as file:
        signals = [Signal(values, time_s, unit="rad/s", name=name) for name, values in columns.items()]
        signals.append(Signal(np.arange(200, dtype=np.uint8), time_s, name="count"))
        file.append(signals, comment="imu")
        slow = Signal(np.arange(20, dtype=np.float32), np.arange(20) / 10 + 0.05, unit="Pa", name="p")
        file.append([slow], comment="baro")
        file.save(path, overwrite=True)
    return columns


def test_values_times_and_units_are_those_that_were_written(tmp_path: Path):
    columns = written(tmp_path / "x.mf4")
    log = open_log(tmp_path / "x.mf4")
    assert log is not None
    first, second = log.contents.topics
    source = log.source(first, [*columns, "count"])
    for name, values in columns.items():
        np.testing.assert_array_equal(source.fields[name], values)
    np.testing.assert_array_equal(source.fields["count"], np.arange(200))
    np.testing.assert_array_equal(source.time_s, np.arange(200) / 100)
    assert (first.name, first.units["gyro_0"], first.rows) == ("group_0", "rad/s", 200)
    assert (second.name, second.units, second.rate_hz) == ("group_1", {"p": "Pa"}, pytest.approx(10.0))


def test_a_mapping_names_its_channels(tmp_path: Path):
    columns = written(tmp_path / "x.mf4")
    mapping = {f"gyro.{i + 1}": f"group_0:gyro_{i}" for i in range(3)}
    config = config_of({"default": {"threshold": 0.1}, "mapping": mapping}, Path("c"))
    recording = read(tmp_path / "x.mf4", config)
    for i, name in enumerate(columns):
        np.testing.assert_array_equal(recording.signals["gyro"].channels[i], columns[name])


def test_samples_that_are_marked_invalid_are_missing(tmp_path: Path):
    from asammdf import MDF, Signal

    time_s = np.arange(50) / 10
    invalid = np.zeros(50, bool)
    invalid[[3, 7]] = True
    with MDF() as file:
        file.append(
            [Signal(np.arange(50.0), time_s, name="x", invalidation_bits=invalid), Signal(time_s, time_s, name="y")]
        )
        file.save(tmp_path / "x.mf4", overwrite=True)
    log = open_log(tmp_path / "x.mf4")
    assert log is not None
    x = log.source(log.contents.topics[0], ["x"]).fields["x"]
    assert np.flatnonzero(np.isnan(x)).tolist() == [3, 7]


def test_without_the_library_one_line_names_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    written(tmp_path / "x.mf4")
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(BadInput, match=r"x\.mf4: a MDF 4 log needs a package: pip install 'jsbsim-rig\[mdf\]'"):
        open_log(tmp_path / "x.mf4")


@pytest.mark.parametrize("kept", [8, 64, 2000, *(pytest.param(kept, marks=pytest.mark.long) for kept in (63, 200))])
def test_a_cut_file_is_refused_in_one_line_and_nothing_is_printed(
    tmp_path: Path, kept: int, capfd: pytest.CaptureFixture
):
    written(tmp_path / "x.mf4")
    data = (tmp_path / "x.mf4").read_bytes()
    (tmp_path / "x.mf4").write_bytes(data[:kept])
    capfd.readouterr()
    with pytest.raises(BadInput, match=r"x\.mf4: ") as refused:
        open_log(tmp_path / "x.mf4")
    assert "\n" not in str(refused.value)
    assert capfd.readouterr() == ("", "")
