"""Kind ``recording``: INPUT of rig vote, a table or a foreign MCAP with one thing wrong."""

from __future__ import annotations

import struct
from pathlib import Path
from random import Random
from typing import Any, Final

from hostile_cases.case import Case, Draw
from hostile_cases.logs import records
from hostile_cases.store import Store
from hostile_cases.values import NUMBERS, TEXTS

OUT: Final = ("o.csv", "o.csv", "o.parquet", "o.mcap")
_CHUNK, _FOOTER_AND_MAGIC = 6, 28
_CELLS: Final = [*[n for n in NUMBERS if len(n) < 500], *TEXTS, "true", "1e999", '"', "1,1", "1\n2", "\ufeff1", "0x10"]


def recording(draw: Draw, store: Store) -> Case:
    """A table or a foreign MCAP with one thing wrong."""
    how = draw.turn(sorted(_INPUTS))
    name, seed = _INPUTS[how][0], draw.rng.random()
    config = "foreign.toml" if name.endswith(".mcap") else "vote.toml"
    argv = ["vote", name, "--config", config, "--out", draw.rng.choice(OUT)]
    argv += draw.rng.choice([[], [], ["--json"], ["--align"], ["--align", "--align-from", "0.1"]])

    def make(folder: Path) -> None:
        store.copy(config, folder)
        _INPUTS[how][1](folder / name, store.folder, Random(seed))

    return draw.case(argv, how, make)


def _lines(source: Path) -> list[list[str]]:
    return [line.split(",") for line in (source / "in.csv").read_text().splitlines()]


def _table(change: Any) -> Any:
    def make(path: Path, source: Path, rng: Random) -> None:
        rows = _lines(source)
        rows = change(rows, rng) or rows
        path.write_text("\n".join(map(",".join, rows)) + "\n", encoding="utf-8", errors="surrogatepass")

    return make


def _cell(rows: list[list[str]], rng: Random) -> None:
    row = rng.choice([1, 1, 2, len(rows) - 1])
    rows[row][rng.randrange(len(rows[0]))] = rng.choice(_CELLS)


def _column(rows: list[list[str]], rng: Random) -> None:
    place, cell = rng.randrange(len(rows[0])), rng.choice(["nan", "inf", "-inf", "1e300", "1.7e308", "", "5e-324"])
    for row in rows[1 : rng.choice([2, len(rows)])]:
        row[place] = cell


def _head(rows: list[list[str]], rng: Random) -> None:
    names = [*TEXTS, "x.1", "[/red].1", "x.ref", "pitch_rate.5", "pitch_rate.ilm.1", "time_s", ".1", "pitch_rate.1"]
    rows[0][rng.randrange(len(rows[0]))] = rng.choice(names)


def _signal(rows: list[list[str]], rng: Random) -> None:
    """A signal of a hostile name, with all that belongs to it."""
    name = rng.choice([text for text in TEXTS if "\n" not in text and "," not in text])
    rows[0] = [cell.replace("roll_angle", name) for cell in rows[0]]


def _times(rows: list[list[str]], rng: Random) -> None:
    first, last, how = rng.randrange(1, 20), rng.randrange(20, 50), rng.randrange(4)
    if how == 0:
        rows[first][0] = rows[last][0]
    elif how == 1:
        rows[first:last] = rows[first:last][::-1]
    elif how == 2:
        for k, row in enumerate(rows[1:]):
            row[0] = str(k * rng.choice([1e300, 1e-320, 1e15]))
    else:
        rows.insert(first, list(rows[first]))


def _ragged(rows: list[list[str]], rng: Random) -> None:
    row = rows[rng.randrange(len(rows))]
    row[:] = row[: rng.randrange(len(row))] if rng.random() < 0.5 else [*row, "1"] * 3


def _parquet(path: Path, source: Path, rng: Random) -> None:
    """Columns of other types."""
    import polars as pl

    table = pl.read_parquet(source / "in.parquet")
    name, n = rng.choice(table.columns), table.height
    columns: list[Any] = [
        *(["x"] * n, [None] * n, [[1.0]] * n, [{"a": 1}] * n, [True] * n, [2**63 - 1] * n, [b"\xff"] * n),
        *([float("inf")] * n, [float("nan")] * n),
    ]
    table = table.with_columns(pl.Series(name, rng.choice(columns), strict=False))
    if rng.random() < 0.3:
        table = table.rename({name: rng.choice(TEXTS)})
    table.head(rng.choice([0, 1, 2, n])).write_parquet(path)


def _bytes(name: str) -> Any:
    def make(path: Path, source: Path, rng: Random) -> None:
        data = bytearray((source / name).read_bytes())
        for _ in range(rng.choice([0, 1, 30])):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path.write_bytes(bytes(data[: rng.choice([len(data), rng.randrange(len(data))])]))

    return make


def _lengths(path: Path, source: Path, rng: Random) -> None:
    """Sizes in a foreign MCAP: of a record, or the first numbers inside one."""
    data = bytearray((source / "foreign.mcap").read_bytes())
    at = rng.choice(records(bytes(data)))[0]
    at += 1 if rng.random() < 0.4 else 9 + 4 * rng.randrange(10)
    data[at : at + 8] = struct.pack("<Q", rng.choice([0, 1, 2**31, 2**40, 2**63, 2**64 - 1]))
    path.write_bytes(bytes(data))


def _messages(path: Path, source: Path, rng: Random) -> None:
    """Messages that hold something else than a number."""
    from mcap.writer import Writer

    texts = ('{"data": {"x": "[/red]"}}', "{", "[" * 100_000, '{"data": {"x": 1e999}}', '{"data": 5}', "\xff")
    text = rng.choice((*texts, '{"data": {"x": ' + "9" * 5000 + "}}", "null", '{"data": {"x": true}}'))
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile=rng.choice(["", "[/red]", "\x1b[2J"]))
        schema = writer.register_schema(rng.choice(["imu", "\x1b[2J"]), rng.choice(["jsonschema", "protobuf"]), b"\xff")
        encoding = rng.choice(["json", "json", "protobuf", "ros1", "\x1b[2J"])
        for c in (1, 2, 3):
            channel = writer.register_channel(rng.choice([f"/imu{c}", "\x1b[2J", f"/imu{c}"]), encoding, schema)
            for k in rng.choice([range(5), range(5, 0, -1), [0, 0, 0], []]):
                writer.add_message(channel, k * rng.choice([10**7, 2**60]), text.encode(), 0)
        writer.finish()


def _bomb(path: Path, source: Path, rng: Random) -> None:
    """A small file with one chunk of 3 GB of zeros, which its summary finds: no sums (0) that would give it away."""
    import zstandard

    size, piece = 3 << 30, bytes(1 << 24)
    packer = zstandard.ZstdCompressor().compressobj(size=size)
    packed = b"".join(packer.compress(piece) for _ in range(size // len(piece))) + packer.flush()
    said = rng.choice([size, size, 100, 2**64 - 1])
    head = struct.pack("<QQQII", 0, 1, said, 0, 4) + b"zstd" + struct.pack("<Q", len(packed))
    chunk = b"\x06" + struct.pack("<Q", len(head) + len(packed)) + head + packed
    data = (source / "foreign.mcap").read_bytes()
    first = next(at for at, opcode in records(data) if opcode == _CHUNK)
    end = first + 9 + struct.unpack_from("<Q", data, first + 1)[0]
    longer = len(chunk) - (end - first)
    summary, offsets = struct.unpack_from("<QQ", data, len(data) - _FOOTER_AND_MAGIC)
    footer = struct.pack("<QQI", summary + longer, offsets + longer, 0)
    path.write_bytes(data[:first] + chunk + data[end:-_FOOTER_AND_MAGIC] + footer + data[-8:])


_INPUTS: Final[dict[str, tuple[str, Any]]] = {
    "a cell of CSV": ("i.csv", _table(_cell)),
    "another cell of CSV": ("i.csv", _table(_cell)),
    "a column of CSV": ("i.csv", _table(_column)),
    "a heading of CSV": ("i.csv", _table(_head)),
    "a signal's name in CSV": ("i.csv", _table(_signal)),
    "times of CSV": ("i.csv", _table(_times)),
    "a ragged row of CSV": ("i.csv", _table(_ragged)),
    "bytes of CSV": ("i.csv", _bytes("in.csv")),
    "a column of Parquet": ("i.parquet", _parquet),
    "bytes of Parquet": ("i.parquet", _bytes("in.parquet")),
    "CSV called Parquet": ("i.parquet", _bytes("in.csv")),
    "Parquet called CSV": ("i.csv", _bytes("in.parquet")),
    "bytes of a foreign MCAP": ("i.mcap", _bytes("foreign.mcap")),
    "sizes in a foreign MCAP": ("i.mcap", _lengths),
    "messages of a foreign MCAP": ("i.mcap", _messages),
    "a chunk that unpacks to 3 GB": ("i.mcap", _bomb),
}
