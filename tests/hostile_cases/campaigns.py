"""Kind ``campaign``: a leaf of a campaign's file."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from hostile_cases.case import Case, Draw
from hostile_cases.leaves import at, dotted, leaves, removed, renamed, replaced
from hostile_cases.store import CAMPAIGN, Store
from hostile_cases.values import KEYS, hostile, short

_READS: Final[tuple[tuple[str, ...], ...]] = (
    ("campaign", "plan", "c.toml"),
    ("campaign", "plan", "c.toml", "--json"),
    ("campaign", "run", "c.toml", "--out", "o", "--runs", "1", "--workers", "1"),
)


def campaign(draw: Draw, store: Store) -> Case:
    """A leaf replaced or left out, or a key of a hostile name."""
    path, how = draw.turn(leaves(CAMPAIGN)), draw.rng.random()
    value = hostile(draw.rng, at(CAMPAIGN, path))
    if how < 0.1 and isinstance(path[-1], str):
        key = draw.rng.choice(KEYS)
        text, about = renamed(CAMPAIGN, path, key), f"key {short(key)} beside {dotted(path)}"
    elif how < 0.15:
        text, about = removed(CAMPAIGN, path), f"{dotted(path)} left out"
    else:
        text, about = replaced(CAMPAIGN, path, value), f"{dotted(path)} = {short(value)}"
    argv = draw.rng.choices(_READS, (6, 2, 1))[0]
    return draw.case(argv, about, lambda folder: _write(folder / "c.toml", text))


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
