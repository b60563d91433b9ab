"""Kind ``folder``: a campaign's folder that was damaged, or made to harm."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from random import Random
from typing import Any, Final

from hostile_cases.case import Case, Draw
from hostile_cases.store import Store
from hostile_cases.values import TEXTS

_TABLES: Final = ("runs", "faults", "alarms", "episodes", "signals")
_COMMANDS: Final[tuple[tuple[str, ...], ...]] = (
    ("campaign", "status", "camp"),
    ("campaign", "status", "camp", "--json"),
    ("campaign", "report", "camp"),
    ("campaign", "report", "camp", "--json"),
    ("campaign", "compare", "camp", "good"),
    ("campaign", "fly", "camp", "--run", "1"),
    ("campaign", "run", "campaign.toml", "--out", "camp"),
)


def folder(draw: Draw, store: Store) -> Case:
    """One damage of the folder, one command on it."""
    argv = _COMMANDS[draw.rng.choices(range(len(_COMMANDS)), (6, 1, 4, 1, 2, 2, 2))[0]]
    damage, seed = draw.turn(sorted(_DAMAGES)), draw.rng.random()

    def make(where: Path) -> None:
        store.copy("campaign.toml", where)
        camp = store.copy("camp", where)
        if "good" in argv:
            store.copy("camp", where, "good")
        _DAMAGES[damage](camp, Random(seed))

    return draw.case(argv, damage, make)


def _part(camp: Path, rng: Random, ending: str = "*.parquet") -> Path:
    return rng.choice(sorted((camp / rng.choice(["runs", *_TABLES])).glob(ending)))


def _emptied(camp: Path, rng: Random) -> None:
    _part(camp, rng).write_bytes(b"")


def _cut(camp: Path, rng: Random) -> None:
    part = _part(camp, rng)
    part.write_bytes(part.read_bytes()[: rng.randrange(part.stat().st_size)])


def _flipped(camp: Path, rng: Random) -> None:
    part = _part(camp, rng)
    data = bytearray(part.read_bytes())
    for _ in range(rng.choice([1, 20])):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    part.write_bytes(bytes(data))


def _folder_for_part(camp: Path, rng: Random) -> None:
    part = _part(camp, rng)
    part.unlink()
    part.mkdir()


def _again(camp: Path, rng: Random) -> None:
    name = rng.choice(["000004-000005", "copy", "[red]", "000000-000001 (1)"])
    for kind in rng.choice([["runs"], list(_TABLES)]):
        shutil.copyfile(camp / kind / "000000-000001.parquet", camp / kind / f"{name}.parquet")


def _column(camp: Path, rng: Random) -> None:
    """A column renamed, left out, or of another type."""
    import polars as pl

    part = _part(camp, rng)
    table = pl.read_parquet(part)
    name, how = rng.choice(table.columns), rng.randrange(5)
    if how == 0:
        table = table.rename({name: rng.choice(["[/red]", "x", "\x1b[2J"])})
    elif how == 1:
        table = table.drop(name)
    elif how == 2:
        table = table.with_columns(pl.lit(rng.choice(TEXTS[:12])).alias(name))
    elif how == 3:
        table = table.with_columns(pl.lit(rng.choice([float("nan"), float("inf"), -1.0])).alias(name))
    else:
        table = table.with_columns(pl.lit(None).alias(name))
    table.write_parquet(part)


def _values(camp: Path, rng: Random) -> None:
    """Text columns that say something else."""
    import polars as pl

    for part in sorted((camp / "runs").glob("*.parquet")):
        table = pl.read_parquet(part)
        name = rng.choice([column for column, kind in table.schema.items() if kind == pl.String])
        table.with_columns(pl.lit(rng.choice(TEXTS)).alias(name)).write_parquet(part)


def _other_rows(camp: Path, rng: Random) -> None:
    import polars as pl

    part = camp / "runs" / "000002-000003.parquet"
    numbers = rng.choice([[0, 1], [2, 2], [-1, 3], [7, 8], [2**62, 3]])
    pl.read_parquet(part).with_columns(pl.Series("run", numbers)).write_parquet(part)


def _linked_lock(camp: Path, rng: Random) -> None:
    (camp / "lock").unlink()
    (camp / "lock").symlink_to(rng.choice(["../../precious", "/dev/null", "lock", "nowhere"]))


def _about(camp: Path, rng: Random) -> None:
    """A leaf of campaign.json."""
    path = camp / "campaign.json"
    data = json.loads(path.read_text())
    node, key = data, rng.choice(sorted(data))
    while isinstance(node[key], dict) and node[key] and rng.random() < 0.8:
        node = node[key]
        key = rng.choice(sorted(node))
    odd: list[Any] = [None, 5, [], {}, "x", -1, 1e300, float("nan"), True, *TEXTS]
    node[key] = rng.choice(odd)
    path.write_text(json.dumps(data))


def _text(camp: Path, rng: Random) -> None:
    texts = ("", "{", "5", "[]", "null", '{"format": 1}', '{"format": 1, "campaign": 5}', "[" * 100_000)
    text = rng.choice((*texts, '{"format": ' + "9" * 5000 + "}", "\x00", '"\ud800"'))
    (camp / "campaign.json").write_text(text, encoding="utf-8", errors="surrogatepass")


def _stray(camp: Path, rng: Random) -> None:
    home = camp / rng.choice(["runs", "faults", "logs", "."])
    if rng.random() < 0.5:
        (home / rng.choice(["x.tmp", "x", "[red]"])).mkdir()
    else:
        (home / rng.choice(["x.parquet", "x.tmp", "\x1b[2J.parquet"])).write_bytes(b"x")


def _link_out(camp: Path, rng: Random) -> None:
    part = _part(camp, rng)
    part.unlink()
    part.symlink_to(rng.choice(["../../../precious", "/dev/zero", "/dev/null", part.name]))


_DAMAGES: Final[dict[str, Any]] = {
    "a part emptied": _emptied,
    "a part cut": _cut,
    "a part with bits flipped": _flipped,
    "a part missing": lambda camp, rng: _part(camp, rng).unlink(),
    "a folder in place of a part": _folder_for_part,
    "a part under another name too": _again,
    "a column changed": _column,
    "values changed": _values,
    "other numbers of runs": _other_rows,
    "the lock a link": _linked_lock,
    "the lock a folder": lambda camp, rng: ((camp / "lock").unlink(), (camp / "lock").mkdir()),
    "campaign.json changed": _about,
    "campaign.json other text": _text,
    "campaign.json a folder": lambda camp, rng: ((camp / "campaign.json").unlink(), (camp / "campaign.json").mkdir()),
    "campaign.json missing": lambda camp, rng: (camp / "campaign.json").unlink(),
    "a stray file or folder": _stray,
    "a part a link": _link_out,
    "a table's folder missing": lambda camp, rng: shutil.rmtree(camp / rng.choice(_TABLES)),
    "a table's folder a file": lambda camp, rng: _as_file(camp / rng.choice(["runs", "faults", "logs"])),
    "a file in place of the folder": lambda camp, rng: _as_file(camp),
}


def _as_file(path: Path) -> None:
    shutil.rmtree(path)
    path.write_bytes(b"x")
