"""Kinds ``scenario`` (a leaf of a resolved scenario's file), ``set`` (the same by --set), ``trust`` (code named)."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from hostile_cases.case import Case, Draw
from hostile_cases.leaves import Path as Leaf
from hostile_cases.leaves import alike, at, dotted, leaves, removed, renamed, replaced
from hostile_cases.store import Store
from hostile_cases.values import KEYS, hostile, short

_LONG: Final = {
    "duration_s",
    "rate_hz",
    "simulation_rate_hz",
}  # legal, and minutes: the scenario's own values stay short
_COMMANDS: Final = (
    ("fly", "s.toml", "--out", "logs"),
    ("fly", "s.toml", "--out", "logs", "--json"),
    ("scenario", "check", "s.toml"),
    ("scenario", "show", "s.toml"),
    ("scenario", "show", "s.toml", "--json"),
    ("campaign", "plan", "c.toml"),
)
_ON: Final = 'base = "s.toml"\nseed = 1\nsampling = "grid"\n[vary]\n"wind.speed_m_s" = [0.0, 1.0]\n'


def _chosen(draw: Draw, store: Store) -> tuple[str, Leaf, str]:
    """A scenario, a path in it and a value: every kind of key in its turn, in any of its places."""
    first: dict[Leaf, str] = {}
    for name, data in store.scenarios.items():
        for path in leaves(data):
            first.setdefault(path, name)
    path = draw.rng.choice(draw.turn(alike(first)))
    value = hostile(draw.rng, at(store.scenarios[first[path]], path))
    return first[path], path, "0" if path[0] in _LONG and value in ("2147483648", "255") else value


def scenario(draw: Draw, store: Store) -> Case:
    """A leaf replaced, taken away, or a key of a hostile name beside it."""
    name, path, value = _chosen(draw, store)
    data, how = store.scenarios[name], draw.rng.random()
    if how < 0.08 and isinstance(path[-1], str):
        key = draw.rng.choice(KEYS)
        text, about = renamed(data, path, key), f"key {short(key)} beside {dotted(path)}"
    elif how < 0.15:
        text, about = removed(data, path), f"{dotted(path)} left out"
    else:
        text, about = replaced(data, path, value), f"{dotted(path)} = {short(value)}"
    argv = _COMMANDS[draw.rng.choices(range(len(_COMMANDS)), (6, 2, 3, 2, 1, 1))[0]]
    return draw.case(argv, f"{name}: {about}", _writes({"s.toml": text, "c.toml": _ON}))


def overridden(draw: Draw, store: Store) -> Case:
    """A leaf by ``--set``, as text of TOML or as a bare word; or a hostile key."""
    name, path, value = _chosen(draw, store)
    text = f"{dotted(path)}={value}"
    if draw.rng.random() < 0.1:
        key = draw.rng.choice([k[1:-1] for k in KEYS if "\\u0000" not in k])
        text = draw.rng.choice([f"{key}={value}", f"{dotted(path)}.{key}=1", f"faults.{key}=1", key])
    text = text.encode().decode("utf-8", "surrogateescape").replace("\0", "")[:130_000]
    heads = (["fly", "s.toml", "--out", "logs"], ["scenario", "check", "s.toml"], ["scenario", "show", "s.toml"])
    tails = (["cost", "s.toml", "--repeats", "1"], ["replay", "log.mcap"], ["campaign", "plan", "campaign.toml"])
    argv = draw.rng.choices([*heads, *tails], (6, 3, 2, 1, 2, 1))[0]
    files = _writes({"s.toml": replaced(store.scenarios[name], ("title",), '"t"')})

    def make(folder: Path) -> None:
        files(folder)
        for needed in ("log.mcap", "campaign.toml"):
            store.copy(needed, folder)

    return draw.case([*argv, "--set", text], f"{name}: --set {short(text)}", make, leave="evilmod" in text)


def trust(draw: Draw, store: Store) -> Case:
    """A file that names a class which leaves a mark when it is imported; no leave is given."""
    data: dict[str, Any] = store.scenarios["everything"]
    name = draw.rng.choice(['"evilmod:M"', '"evilmod:__name__"', '"evilmod:M.x"', '".evilmod:M"', '"evilmod:"'])
    text = replaced(data, ("redundancy", "manager"), name)
    commands: tuple[tuple[str, ...], ...] = (
        ("fly", "s.toml", "--out", "logs"),
        ("scenario", "check", "s.toml"),
        ("scenario", "show", "s.toml"),
        ("cost", "s.toml", "--repeats", "1"),
        ("campaign", "plan", "c.toml"),
        ("campaign", "run", "c.toml", "--out", "o"),
        ("replay", "l.mcap"),
        ("replay", "l.mcap", "--fly"),
        ("replay", "l.mcap", "--set", "redundancy.signals.pitch_rate.threshold=0.1"),
        ("replay", "log.mcap", "--redundancy", "r.toml"),
        ("score", "l.mcap"),
        ("score", "l.mcap", "--no-baseline"),
        ("report", "l.mcap"),
        ("info", "l.mcap"),
        ("export", "l.mcap", "--to", "csv"),
        ("view", "l.mcap", "--save", "v.rrd"),
        ("vote", "in.csv", "--config", "v.toml", "--out", "o.csv"),
        ("campaign", "status", "camp"),
        ("campaign", "report", "camp"),
        ("campaign", "fly", "camp", "--run", "0"),
        ("campaign", "compare", "camp", "camp"),
    )
    argv = draw.turn(commands)

    def make(folder: Path) -> None:
        from hostile_cases.remade import exchanged

        (folder / "s.toml").write_text(text)
        (folder / "c.toml").write_text(_ON)
        (folder / "r.toml").write_text(f"[redundancy]\nmanager = {name}\n")
        (folder / "v.toml").write_text(f"[default]\nthreshold = 1.0\nmanager = {name}\n")
        for needed in ("log.mcap", "in.csv"):
            store.copy(needed, folder)
        about = store.copy("camp", folder) / "campaign.json"
        about.write_text(about.read_text().replace('"set": {', f'"set": {{"redundancy.manager": {name}, ', 1))
        exchanged(store.folder / "log.mcap", folder / "l.mcap", "cross-channel", name.strip('"'))

    return draw.case(argv, f"manager {name} named in a file", make)


def _writes(files: dict[str, str]) -> Any:
    def make(folder: Path) -> None:
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8", errors="surrogatepass")

    return make
