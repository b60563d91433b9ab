"""Files under a checksum: every bit of them, and the place for which they were written."""

from pathlib import Path

import polars as pl
import pytest

from rig.core import sealed
from rig.core.errors import BadInput

FRAME = pl.DataFrame({"run": [1, 2, 3], "text": ["rig.sha256=" + "0" * 64, "b", None]})


def test_every_flipped_bit_of_a_table_is_seen(tmp_path: Path):
    data = sealed.table(FRAME, "here")
    (tmp_path / "t.parquet").write_bytes(data)
    assert sealed.read_table(tmp_path / "t.parquet", "here", "").equals(FRAME)
    assert pl.read_parquet(tmp_path / "t.parquet").equals(FRAME)  # others read it too
    for bit in range(8 * len(data)):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        assert sealed.fault(bytes(flipped))
    for end in range(len(data)):
        assert sealed.fault(data[:end])


def test_every_flipped_bit_of_a_json_file_is_refused_in_one_line(tmp_path: Path):
    content = {"format": 2, "text": 'rig.sha256=" {', "number": 0.1}
    data, path = sealed.to_json(content, "here"), tmp_path / "a.json"
    path.write_bytes(data)
    assert sealed.read_json(path, "", "here", (2, 1)) == content
    for bit in range(8 * len(data)):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        path.write_bytes(bytes(flipped))
        with pytest.raises(BadInput) as error:
            sealed.read_json(path, "", "here", (2, 1))
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["[1]", "1", "null", "{}", "[" * 100_000, '{"a": 1e999}', "\udcff", ""])
def test_what_is_no_file_of_ours_is_refused_in_one_line(tmp_path: Path, text: str):
    path = tmp_path / "a.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(BadInput, match=r"a\.json: (is damaged|cannot be read).*; do this"):
        sealed.read_json(path, "do this")
    with pytest.raises(BadInput, match="no checksum; do this"):
        sealed.read_table(path, "here", "do this")


def test_a_file_of_another_place_is_refused(tmp_path: Path):
    (tmp_path / "t.parquet").write_bytes(sealed.table(FRAME, "there"))
    (tmp_path / "a.json").write_bytes(sealed.to_json({}, "there"))
    with pytest.raises(BadInput, match="written for another place"):
        sealed.read_table(tmp_path / "t.parquet", "here", "")
    with pytest.raises(BadInput, match="written for another place"):
        sealed.read_json(tmp_path / "a.json", "", "here")


def test_the_same_table_has_the_same_bytes():
    assert sealed.table(FRAME, "here") == sealed.table(FRAME.clone(), "here")
