"""Kinds ``file`` (a file damaged as a whole, or no file at all) and ``aircraft`` (an aircraft's folder)."""

from __future__ import annotations

import os
from pathlib import Path
from random import Random
from typing import Any, Final

from hostile_cases.case import Case, Draw
from hostile_cases.leaves import alike, at, dotted, leaves, removed, replaced
from hostile_cases.store import Store
from hostile_cases.values import hostile, short

_TAKERS: Final[tuple[tuple[str, ...], ...]] = (
    ("fly", "x", "--out", "logs"),
    ("scenario", "check", "x"),
    ("scenario", "show", "x"),
    ("cost", "x", "--repeats", "1"),
    ("campaign", "plan", "x"),
    ("campaign", "run", "x", "--out", "o"),
    ("campaign", "plan", "base.toml"),
    ("fly", "everything.toml", "--out", "x"),
    ("fly", "everything.toml", "--set", "sensors.pitch_rate.noise_file=x"),
    ("fly", "everything.toml", "--set", "aircraft=x"),
    ("aircraft", "show", "x"),
    ("aircraft", "design", "x"),
    ("vote", "in.csv", "--config", "x", "--out", "o.csv"),
    ("vote", "x", "--config", "vote.toml", "--out", "o.csv"),
    ("vote", "x", "--config", "foreign.toml", "--out", "o.csv"),
    ("vote", "in.csv", "--config", "vote.toml", "--out", "x"),
    ("replay", "log.mcap", "--redundancy", "x"),
    ("replay", "log.mcap", "--set", "redundancy.manager=mean", "--out", "x"),
    ("info", "x"),
    ("score", "x"),
    ("replay", "x"),
    ("diff", "x", "log.mcap"),
    ("export", "x", "--to", "csv"),
    ("export", "log.mcap", "--to", "csv", "--out", "x"),
    ("recover", "x"),
    ("view", "x", "--save", "v.rrd"),
    ("view", "log.mcap", "--save", "x"),
    ("watch", "x"),
    ("campaign", "status", "x"),
    ("campaign", "report", "x"),
    ("campaign", "compare", "camp", "x"),
    ("campaign", "fly", "x", "--run", "0"),
    ("campaign", "report", "camp", "--out", "x"),
    ("campaign", "fly", "camp", "--run", "0", "--out", "x"),
)
_ENDINGS: Final = ("", "", ".toml", ".csv", ".parquet", ".mcap")


def file(draw: Draw, store: Store) -> Case:
    """One thing that is no sound file, one command that takes a file."""
    ending, how = draw.rng.choice(_ENDINGS), draw.rng.choice(sorted(_THINGS))
    argv = [f"x{ending}" if word == "x" else word for word in draw.turn(_TAKERS)]
    seed = draw.rng.random()

    def make(folder: Path) -> None:
        for name in ("everything.toml", "in.csv", "vote.toml", "foreign.toml", "log.mcap", "camp"):
            if name in argv:
                store.copy(name, folder)
        (folder / "base.toml").write_text(f'base = "x{ending}"\n[vary]\nseed = [1]\n')
        _THINGS[how](folder / f"x{ending}", store, Random(seed))

    return draw.case(argv, f"{how}, x{ending}", make)


def _sound(store: Store, rng: Random) -> bytes:
    names = ("everything.toml", "campaign.toml", "vote.toml", "in.csv", "in.parquet", "log.mcap", "foreign.mcap")
    return (store.folder / rng.choice(names)).read_bytes()


def _flipped(path: Path, store: Store, rng: Random) -> None:
    data = bytearray(_sound(store, rng))
    for _ in range(rng.choice([1, 5, 100])):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(bytes(data))


def _cut(path: Path, store: Store, rng: Random) -> None:
    data = _sound(store, rng)
    path.write_bytes(data[: rng.randrange(len(data))])


def _locked(path: Path, store: Store, rng: Random) -> None:
    path.write_bytes(_sound(store, rng))
    path.chmod(0)


_THINGS: Final[dict[str, Any]] = {
    "bits flipped": _flipped,
    "cut": _cut,
    "another kind of file": lambda path, store, rng: path.write_bytes(_sound(store, rng)),
    "no permission": _locked,
    "empty": lambda path, store, rng: path.touch(),
    "zeros": lambda path, store, rng: path.write_bytes(bytes(4096)),
    "not UTF-8": lambda path, store, rng: path.write_bytes(b'title = "\xff\xfe"\n'),
    "UTF-16": lambda path, store, rng: path.write_bytes('title = "x"\n'.encode("utf-16")),
    "byte order mark": lambda path, store, rng: path.write_bytes(b"\xef\xbb\xbf" + b'title = "x"\n'),
    "carriage returns": lambda path, store, rng: path.write_bytes(b'title = "x"\rseed = 1\r'),
    "nested deep": lambda path, store, rng: path.write_text("x = " + "[" * 2000 + "]" * 2000),
    "tables nested deep": lambda path, store, rng: path.write_text("[" + ".".join("a" * 3000) + "]\n"),
    "inline tables nested deep": lambda path, store, rng: path.write_text("x = " + "{a=" * 2000 + "1" + "}" * 2000),
    "a huge integer": lambda path, store, rng: path.write_text(f"seed = {'9' * 5000}\n"),
    "a key twice": lambda path, store, rng: path.write_text("seed = 1\nseed = 2\n"),
    "one line of 2 MB": lambda path, store, rng: path.write_text("x" * (2 << 20)),
    "escapes": lambda path, store, rng: path.write_text("\x1b[2J = [/red]\n"),
    "a folder": lambda path, store, rng: path.mkdir(),
    "a FIFO": lambda path, store, rng: os.mkfifo(path),
    "/dev/null": lambda path, store, rng: path.symlink_to("/dev/null"),
    "/dev/zero": lambda path, store, rng: path.symlink_to("/dev/zero"),
    "/dev/full": lambda path, store, rng: path.symlink_to("/dev/full"),
    "a link to itself": lambda path, store, rng: path.symlink_to(path.name),
    "nothing": lambda path, store, rng: None,
    "a link to nothing": lambda path, store, rng: path.symlink_to("nowhere"),
}


def aircraft(draw: Draw, store: Store) -> Case:
    """A leaf of one of the files of an aircraft of the user's own, or that file damaged as a whole."""
    from rig.core.files import bundled
    from rig.core.settings import read_toml

    home, name = bundled("aircraft") / draw.rng.choice(("f16", "b707")), draw.rng.choice(_FILES)
    data = read_toml(home / name)
    path = draw.rng.choice(draw.turn(alike(leaves(data)), name))
    value = hostile(draw.rng, at(data, path))
    how, seed = draw.rng.random(), draw.rng.random()
    thing = draw.rng.choice(sorted(_THINGS)) if how < 0.2 else ""
    text = removed(data, path) if how < 0.3 else replaced(data, path, value)
    about = thing or (f"{dotted(path)} {'left out' if how < 0.3 else f'= {short(value)}'}")

    def make(folder: Path) -> None:
        (folder / "own").mkdir()
        for each in _FILES:
            (folder / "own" / each).write_bytes((home / each).read_bytes())
        (folder / "s.toml").write_text('aircraft = "own"\nduration_s = 0.3\n')
        if thing:
            (folder / "own" / name).unlink()
            _THINGS[thing](folder / "own" / name, store, Random(seed))
        else:
            (folder / "own" / name).write_text(text)

    argv = draw.rng.choices(_FLYING, (5, 3, 2, 2))[0]
    return draw.case(argv, f"{home.name}/{name}: {about}", make)


_FILES: Final = ("aircraft.toml", "gains.toml", "references.toml")
_FLYING: Final = (
    ("fly", "s.toml", "--out", "logs"),
    ("scenario", "check", "s.toml"),
    ("aircraft", "show", "own"),
    ("aircraft", "show", "own", "--json"),
)
