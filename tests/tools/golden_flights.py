"""Golden flights: short scenarios whose decisions are kept in tests/golden/; ``make golden`` renews all of them.

Each file names its scenario and what is set in it.  A flight is kept only when other seeds decide the same, frame
by frame: no decision may hang on the noise.  ``together`` is the same in all files, a hash over all decisions, so
that a part cannot be renewed alone.
"""

import difflib
import hashlib
import tomllib
from pathlib import Path

import numpy as np
import tomli_w

from rig.bench.replay.decisions import history
from rig.flight.loop import Rig, frames
from rig.scenario import scenario

FOLDER = Path(__file__).parents[1] / "golden"
SEEDS = 3


def kept() -> dict[str, dict]:
    """The golden flights by name."""
    return {path.stem: tomllib.loads(path.read_text()) for path in sorted(FOLDER.glob("*.toml"))}


def decide(golden: dict, seed: int | None = None) -> list[str]:
    """What is decided in a golden flight."""
    which = scenario.load(golden["scenario"], golden["set"], seed)
    return history(np.concatenate([rows.copy() for rows, _ in frames(Rig(which), which)]))


def difference(old: list[str], new: list[str]) -> str:
    """The decisions that moved, a line each: - as it was, + as it is."""
    lines = difflib.unified_diff(old, new, "kept", "decided now", lineterm="", n=0)
    return "\n".join(line for line in lines if not line.startswith("@@"))


def together(decisions: dict[str, list[str]]) -> str:
    """The hash over all flights."""
    return hashlib.sha256(repr(sorted(decisions.items())).encode()).hexdigest()[:16]


def renew() -> None:
    """Fly all, then write all."""
    golden, decisions = kept(), {}
    for name, flight in golden.items():
        own = scenario.load(flight["scenario"], flight["set"]).seed
        decisions[name] = decide(flight)
        for seed in range(own + 1, own + SEEDS):
            moved = difference(decisions[name], decide(flight, seed))
            if moved:
                raise SystemExit(
                    f"{name}: hangs on the noise, seed {seed} decides otherwise; nothing is renewed\n{moved}"
                )
    for name, flight in golden.items():
        moved = difference(flight.get("decisions", []), decisions[name])
        print(f"{name}: {'decisions moved' if moved else 'as before'}", moved, sep="\n" if moved else "")
        new = {**flight, "decisions": decisions[name], "together": together(decisions)}
        (FOLDER / f"{name}.toml").write_text(tomli_w.dumps(new, multiline_strings=True))


if __name__ == "__main__":
    renew()
