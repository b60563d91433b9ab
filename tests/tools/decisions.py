"""What every bundled scenario decides, kept by one commit of the rig and compared with another.

    python tests/tools/decisions.py fly OUT [--rows] [--only NAME ...] [--workers 2]
    python tests/tools/decisions.py diff OLD NEW [--rows]

`fly` uses only public functions of the rig that is installed: run this file with the Python of either commit. It keeps
each flight in the new folder OUT: the decisions of every frame, with --rows all fields of every frame. `diff` prints
the decisions that differ, with --rows the fields that are not equal to the bit. Exit code 1 when any differ.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from numpy.lib.recfunctions import repack_fields
from numpy.typing import NDArray

import rig
from rig.core.frame import CHANNELS, DISCRETES, SIGNALS, Block, DecidedBy, Pattern, Source, State
from rig.core.frame.fields import FIELD
from rig.scenario.aircraft import bundled

DECIDED: Final = (
    *("frame", "state", "level", "pattern", "decided_by", "reference_usable", "common_mode", "source"),
    *("discrete_state", "discrete_level", "discrete_voted", "law", "trust", "sensor_fault", "end"),
)
OF_FLIGHT: Final = {name: FIELD[name].enum for name in ("law", "trust", "sensor_fault", "end")}
SHOWN: Final = 4  # entries of one decision
Track = tuple[str, str, NDArray[Any], Callable[[int], str]]  # whose, what, a value each row, a row's value in words
Entries = dict[tuple[str, str], list[tuple[int, str]]]  # (whose, what): the frames in which it changes, and to what
Lines = list[tuple[str, str]]  # (what differs, a line that says how)


def fly_one(path: Path, out: Path, every: bool) -> str:
    """Fly a scenario; keep its decisions, or every field, in ``out``."""
    with TemporaryDirectory(prefix="rig") as folder:
        flight = rig.fly(path, out=folder)
        rows = flight.rows
    names = [name for name in rows.dtype.names or () if every or name in DECIDED]
    about = {"end": f"{flight.end_reason}, {flight.frames} frames", "rate_hz": flight.scenario.rate_hz}
    kept = {"rows": repack_fields(rows[names]), "about": np.array(json.dumps(about))}
    np.savez_compressed(out / f"{path.stem}.npz", allow_pickle=False, **kept)
    return f"{path.stem}: {about['end']}"


def read(path: Path) -> tuple[Block, dict[str, Any]]:
    """The rows of a flight that was kept, and what else is known of it."""
    with np.load(path) as kept:
        return kept["rows"], json.loads(str(kept["about"]))


def decisions(rows: Block) -> Entries:
    """Every decision of a flight; of the first frame only what is not zero."""
    found: Entries = {}
    for whose, what, values, words in tracks(rows):
        changed = np.flatnonzero(np.diff(values.astype(np.int64), prepend=0))
        if len(changed):
            found[whose, what] = [(int(rows["frame"][k]), words(int(k))) for k in changed]
    return found


def tracks(rows: Block) -> Iterator[Track]:
    """The decisions on all signals, on all discretes, and of the flight."""
    for s, signal in enumerate(SIGNALS):
        yield from of_signal(rows, s, signal.name)
    for d, discrete in enumerate(DISCRETES):
        for c in range(CHANNELS):
            yield of_channel(f"{discrete.name}.{c + 1}", rows["discrete_state"][:, d, c], np.zeros(len(rows), int))
        for what in ("level", "voted"):
            yield of_values(discrete.name, what, rows[f"discrete_{what}"][:, d])
    for name, enum in OF_FLIGHT.items():
        yield of_values("flight", name, rows[name], enum)


def of_signal(rows: Block, s: int, name: str) -> Iterator[Track]:
    """Failed channels, split and who answers it, level, reference, source, common mode."""
    pattern, decided_by = (rows[field][:, s].astype(int) for field in ("pattern", "decided_by"))
    for c in range(CHANNELS):
        yield of_channel(f"{name}.{c + 1}", rows["state"][:, s, c], decided_by)
    answered = np.where((pattern >= Pattern.P2_2) & (pattern <= Pattern.P1_1), 16 * pattern + decided_by, 0)

    def words(k: int) -> str:
        return f"{Pattern(pattern[k]).label} {DecidedBy(decided_by[k]).name.lower()}" if answered[k] else "over"

    yield name, "pattern", answered, words
    yield of_values(name, "level", rows["level"][:, s])
    yield of_values(name, "reference usable", rows["reference_usable"][:, s])
    yield of_values(name, "source", rows["source"][:, s], Source)
    if "common_mode" in (rows.dtype.names or ()):
        yield of_values(name, "common mode", rows["common_mode"][:, s])


def of_channel(whose: str, state: NDArray[Any], decided_by: NDArray[Any]) -> Track:
    """When a channel is failed, and by whom."""
    failed = state == State.FAILED

    def words(k: int) -> str:
        resolved = decided_by[k] not in (DecidedBy.NONE, DecidedBy.UNRESOLVED)
        by = DecidedBy(decided_by[k]).name.lower() if resolved else "comparison"
        return f"by {by}" if failed[k] else "readmitted"

    return whose, "failed", failed, words


def of_values(whose: str, what: str, values: NDArray[Any], enum: Any = None) -> Track:
    """A decision that is a number, or one of an enumeration."""
    return whose, what, values, lambda k: str(values[k]) if enum is None else enum(values[k]).name.lower()


def moved(old: Block, new: Block, rate_hz: float) -> Lines:
    """The decisions that differ."""
    found: Lines = []
    before, after = decisions(old), decisions(new)
    for whose, what in sorted({*before, *after}):
        a, b = (side.get((whose, what), []) for side in (before, after))
        if a != b:
            sides = [said([one for one in mine if one not in other], rate_hz) for mine, other in ((a, b), (b, a))]
            found.append((what, f"  {whose} {what}: {sides[0]} -> {sides[1]}"))
    return found


def said(entries: Sequence[tuple[int, str]], rate_hz: float) -> str:
    """Frames, times and values of the first entries, and how many more there are."""
    told = [f"{frame} ({frame / rate_hz:.2f} s) {text}" for frame, text in entries[:SHOWN]]
    return ", ".join([*told, *[f"{len(entries) - SHOWN} more"] * (len(entries) > SHOWN)]) or "-"


def unequal(old: Block, new: Block) -> Lines:
    """The fields of both that are not equal to the bit; of a field that has grown, the columns that both have."""
    found: Lines = []
    for name in (name for name in old.dtype.names or () if name in (new.dtype.names or ())):
        n = min(len(old), len(new))
        a, b = (narrowed(rows[name][:n], old[name].shape, new[name].shape) for rows in (old, new))
        differ = np.flatnonzero((a != b).any(axis=1)) if a.shape == b.shape else np.arange(n)
        if len(differ):
            found.append((name, f"  {name}: {len(differ)} of {n} frames, from frame {old['frame'][differ[0]]} on"))
    return found


def narrowed(values: NDArray[Any], *shapes: tuple[int, ...]) -> NDArray[np.uint8]:
    """The bytes of each row, (n, bytes), of the columns that all ``shapes`` have."""
    common = tuple(slice(min(sizes)) for sizes in zip(*(shape[1:] for shape in shapes), strict=True))
    cut = np.ascontiguousarray(values[(slice(None), *common)])
    return cut.view(np.uint8).reshape(len(cut), -1)


def diff(old: Path, new: Path, every: bool) -> bool:
    """Print what differs between two folders; whether anything does, or a scenario or field is gone."""
    names = [{path.stem for path in folder.glob("*.npz")} for folder in (old, new)]
    fields: list[set[str]] = [set(), set()]
    differ, whats, frames = 0, Counter[str](), 0
    for name in sorted(names[0] & names[1]):
        (a, before), (b, after) = (read(folder / f"{name}.npz") for folder in (old, new))
        lines = unequal(a, b) if every else moved(a, b, after["rate_hz"])
        if before != after:
            lines.append(("end", f"  flight: {before['end']} -> {after['end']}"))
        fields = [known | set(rows.dtype.names or ()) for known, rows in zip(fields, (a, b), strict=True)]
        differ, frames = differ + bool(lines), frames + len(a)
        kinds = sorted({what for what, _ in lines})
        whats.update(kinds if every else [", ".join(kinds)] * bool(kinds))
        if lines:
            print("\n".join([name, *(line for _, line in lines)]))
    for i, side in enumerate(("OLD", "NEW")):
        only = [", ".join(sorted(both[i] - both[1 - i])) or "none" for both in (names, fields)]
        print(f"only in {side}: scenarios {only[0]}; fields {only[1]}")
    both = len(names[0] & names[1])
    what = f"{len(fields[0] & fields[1])} fields of {frames} frames" if every else "decisions"
    print(f"{what} equal in {both - differ} of {both} scenarios")
    print("\n".join(f"  {count} differ in {kinds}" for kinds, count in whats.most_common()))
    return differ > 0 or not names[0] <= names[1] or not fields[0] <= fields[1]


def fly(out: Path, every: bool, only: Sequence[str], workers: int) -> None:
    """Fly the bundled scenarios into ``out``, side by side."""
    paths = [path for path in sorted(bundled("faults").glob("*.toml")) if path.stem in only or not only]
    out.mkdir(parents=True)
    with ProcessPoolExecutor(workers, mp_context=get_context("forkserver")) as pool:
        for line in pool.map(fly_one, paths, [out] * len(paths), [every] * len(paths)):
            print(line, flush=True)


def main() -> int:
    """Fly, or tell what differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(dest="verb", required=True)
    flying, telling = verbs.add_parser("fly"), verbs.add_parser("diff")
    flying.add_argument("out", type=Path)
    flying.add_argument("--only", nargs="+", default=[], metavar="NAME")
    flying.add_argument("--workers", type=int, default=2)
    telling.add_argument("old", type=Path)
    telling.add_argument("new", type=Path)
    for verb in (flying, telling):
        verb.add_argument("--rows", action="store_true")
    asked = parser.parse_args()
    if asked.verb == "diff":
        return int(diff(asked.old, asked.new, asked.rows))
    if asked.out.exists():
        parser.error(f"{asked.out}: exists already, a new folder is needed")
    fly(asked.out, asked.rows, asked.only, asked.workers)
    return 0


if __name__ == "__main__":
    sys.exit(main())
