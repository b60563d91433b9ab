"""Kind ``config``: a leaf of CONFIG of rig vote, or of the [redundancy] file of a what if."""

from __future__ import annotations

from pathlib import Path

from hostile_cases.case import Case, Draw
from hostile_cases.leaves import alike, at, dotted, leaves, removed, renamed, replaced
from hostile_cases.recordings import OUT
from hostile_cases.store import MAPPING, VOTE, Store
from hostile_cases.values import KEYS, hostile, short


def config(draw: Draw, store: Store) -> Case:
    """A leaf of CONFIG replaced or left out, or a key of a hostile name."""
    mapped = draw.rng.random() < 0.2
    sound = {"default": {"threshold": 0.1}, "mapping": MAPPING} if mapped else VOTE
    path, how = draw.turn(leaves(sound), str(mapped)), draw.rng.random()
    value = hostile(draw.rng, at(sound, path))
    if how < 0.1 and isinstance(path[-1], str):
        key = draw.rng.choice(KEYS)
        text, about = renamed(sound, path, key), f"key {short(key)} beside {dotted(path)}"
    elif how < 0.15:
        text, about = removed(sound, path), f"{dotted(path)} left out"
    else:
        text, about = replaced(sound, path, value), f"{dotted(path)} = {short(value)}"
    source = "foreign.mcap" if mapped else draw.rng.choice(["in.csv", "in.parquet", "log.mcap"])
    argv = ["vote", source, "--config", "c.toml", "--out", draw.rng.choice(OUT), *draw.rng.choice([[], ["--align"]])]
    if not mapped and draw.rng.random() < 0.15:
        argv, text, source = _what_if(draw, store)
        about = f"[redundancy] {short(text)}"

    def make(folder: Path) -> None:
        store.copy(source, folder)
        (folder / "c.toml").write_text(text, encoding="utf-8", errors="surrogatepass")

    return draw.case(argv, about, make)


def _what_if(draw: Draw, store: Store) -> tuple[list[str], str, str]:
    data = {"redundancy": store.scenarios["everything"]["redundancy"]}
    path = draw.rng.choice(draw.turn(alike(leaves(data)), "redundancy"))
    text = replaced(data, path, hostile(draw.rng, at(data, path)))
    return ["replay", "log.mcap", "--redundancy", "c.toml"], text, "log.mcap"
