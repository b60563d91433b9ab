"""Foreign MCAP files that claim, or expand to, more than they are: one line, little memory, no output."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import hostile_mcap as by_hand
import lz4.frame
import pytest
import zstandard
from mcap.records import Chunk

from rig.core.errors import BadLog
from rig.log import foreign
from rig.log import mcap_messages as limits
from rig.log.decode import CHUNK_LIMIT
from rig.log.mcap_messages import MESSAGE_LIMIT, most_bytes

GIGABYTES = 6_000_000_000
LARGE = 200_000_000  # within the limit of one chunk
WHOLE = b"".join(by_hand.record(by_hand.message(k)) for k in range(20))

# A child that may take no more address space than 3 GiB, and tells what each file came to and its highest memory.
CHILD = """
import contextlib, io, json, resource, sys
resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))
from rig.cli import main as cli
said = []
for name in sys.argv[1:]:
    sys.argv = ["rig", "vote", name, "--config", "c.toml", "--out", "o.csv"]
    error, code = io.StringIO(), None
    with contextlib.redirect_stderr(error):
        try:
            cli.main()
        except SystemExit as end:
            code = end.code
    said.append((code, error.getvalue()))
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(json.dumps({"said": said, "highest_kb": int(status["VmHWM"].split()[0])}))
"""


def compressed(data: bytes) -> bytes:
    return zstandard.ZstdCompressor().compress(data)


def lz4_zeros(count: int) -> bytes:
    packer = lz4.frame.LZ4FrameCompressor(block_linked=False, auto_flush=True)
    head, block = packer.begin(), packer.compress(bytes(1 << 24))  # blocks stand alone: one is written many times
    return head + block * (count >> 24) + packer.flush()


BOMBS: dict[str, tuple[list[Chunk], str]] = {
    "as stated": (
        [by_hand.chunk(by_hand.zeros(GIGABYTES, GIGABYTES), GIGABYTES, "zstd")],
        "a chunk declares 6000000000 b",
    ),
    "claims less than its frame": (
        [by_hand.chunk(by_hand.zeros(GIGABYTES, GIGABYTES), 1000, "zstd")],
        "a chunk declares 1000 bytes and its contents 6000000000",
    ),
    "claims less, frame without size": ([by_hand.chunk(by_hand.zeros(GIGABYTES), 1000, "zstd")], "damaged"),
    "claims nothing": ([by_hand.chunk(by_hand.zeros(GIGABYTES), 0, "zstd")], "no rows"),
    "claims the most there is": ([by_hand.chunk(b"", 2**64 - 1, "zstd")], f"declares {2**64 - 1} bytes"),
    "in many chunks": (
        [by_hand.chunk(by_hand.zeros(LARGE, LARGE + 9, by_hand.skipped(LARGE)), LARGE + 9, "zstd")] * 3,
        "expands to more than",
    ),
    "lz4": ([by_hand.chunk(lz4_zeros(1 << 30), 1000, "lz4")], "a chunk declares 1000 bytes and has 1001"),
    "unknown compression": ([by_hand.chunk(compressed(WHOLE), len(WHOLE), "zsty")], "unknown compression 'zsty'"),
    "a record beyond its chunk": (
        [by_hand.chunk(b"\5" + b"\xff" * 8 + WHOLE, len(WHOLE) + 9)],
        "longer than its chunk",
    ),
}


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is read from /proc")
@pytest.mark.long
def test_bombs_are_refused_in_one_line_with_little_memory(tmp_path: Path):
    for k, (chunks, _) in enumerate(BOMBS.values()):
        by_hand.write(tmp_path / f"{k}.mcap", chunks)
    by_hand.write(tmp_path / "summary.mcap", BOMBS["as stated"][0], summary_at=len(by_hand.MAGIC))
    assert (tmp_path / "0.mcap").stat().st_size < 200_000
    (tmp_path / "c.toml").write_text('[default]\nthreshold = 1.0\n[mapping]\n"x.1" = "/imu:x"\n"x.2" = "/imu:x"\n')
    names = [f"{k}.mcap" for k in range(len(BOMBS))] + ["summary.mcap"]
    ran = subprocess.run(
        [sys.executable, "-c", CHILD, *names], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    found = json.loads(ran.stdout)
    for (code, line), (name, says) in zip(
        found["said"], [*((n, s) for n, (_, s) in BOMBS.items()), ("", "")], strict=True
    ):
        assert code == 2 and line.startswith("error: ") and line.count("\n") == 1 and says in line, (name, line)
    assert found["highest_kb"] < 1_000_000
    assert not list(tmp_path.glob("o.csv*"))


@pytest.mark.parametrize("compression", ["", "zstd", "lz4"])
def test_what_is_within_the_limits_is_read(compression: str, tmp_path: Path):
    pack: dict[str, Any] = {"": bytes, "zstd": compressed, "lz4": lz4.frame.compress}
    by_hand.write(tmp_path / "a.mcap", [by_hand.chunk(pack[compression](WHOLE), len(WHOLE), compression)] * 2)
    source = foreign.read(tmp_path / "a.mcap", {"/imu": {"x"}})["/imu"]
    assert source.fields["x"].tolist() == [1.0] * 40
    assert source.time_s.tolist() == [k // 2 / 100 for k in range(40)]  # by time, not by chunk


def test_columns_count_as_memory_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Short messages, from which many columns are taken: the sum of both is limited."""
    monkeypatch.setattr(limits, "CHUNK_LIMIT", 1 << 20)
    bodies = by_hand.record(by_hand.message(0, b"[1]")) * 5000
    by_hand.write(tmp_path / "a.mcap", [by_hand.chunk(compressed(bodies), len(bodies), "zstd")])
    fields = {"0" * k for k in range(1, 50)}  # element 0, under many names
    assert len(bodies) < most_bytes((tmp_path / "a.mcap").stat().st_size) < 5000 * 8 * len(fields)
    with pytest.raises(BadLog, match="expands to more than"):
        foreign.read(tmp_path / "a.mcap", {"/imu": fields})
    assert len(foreign.read(tmp_path / "a.mcap", {"/imu": {"0"}})["/imu"].time_s) == 5000


def test_a_message_too_long_for_numbers_is_refused(tmp_path: Path):
    long = by_hand.record(by_hand.message(0, b'{"x":1,"y":"' + b"a" * MESSAGE_LIMIT + b'"}'))
    by_hand.write(tmp_path / "a.mcap", [by_hand.chunk(compressed(long), len(long), "zstd")])
    with pytest.raises(BadLog, match="a message of 4194"):
        foreign.read(tmp_path / "a.mcap", {"/imu": {"x"}})


@pytest.mark.parametrize(
    ("body", "reads"),
    [
        (b'{"x": 1e999}', "inf"),
        (b'{"x": true}', "1.0"),
        (b'{"x": null}', "nan"),
        (b'{"x": 1' + b"0" * 400 + b"}", "nan"),
    ],
)
def test_json_values_become_numbers(body: bytes, reads: str, tmp_path: Path):
    one = by_hand.record(by_hand.message(0, body))
    by_hand.write(tmp_path / "a.mcap", [by_hand.chunk(one, len(one))])
    assert str(foreign.read(tmp_path / "a.mcap", {"/imu": {"x"}})["/imu"].fields["x"][0]) == reads


@pytest.mark.parametrize("body", [b"[" * 100_000, b'{"x": 1' + b"0" * 5000 + b"}", b'{"x": "\xff"}', b""])
def test_json_that_cannot_be_read_is_damage(body: bytes, tmp_path: Path):
    one = by_hand.record(by_hand.message(0, body))
    by_hand.write(tmp_path / "a.mcap", [by_hand.chunk(one, len(one))])
    with pytest.raises(BadLog, match="damaged"):
        foreign.read(tmp_path / "a.mcap", {"/imu": {"x"}})


def test_a_wrong_checksum_of_a_chunk_is_damage(tmp_path: Path):
    by_hand.write(tmp_path / "a.mcap", [by_hand.chunk(WHOLE, len(WHOLE), crc=5)])
    with pytest.raises(BadLog, match="checksum of a chunk"):
        foreign.read(tmp_path / "a.mcap", {"/imu": {"x"}})


def test_the_limit_of_a_chunk_is_that_of_our_own_logs():
    assert most_bytes(0) == CHUNK_LIMIT == 256 << 20
