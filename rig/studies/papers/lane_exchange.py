"""The sample exchange of four lanes, checked exhaustively: all placements and all behaviours of faulty lanes.

The words of different lanes do not affect each other, so each word is checked alone:

    asymmetric  sends each lane any of: the correct word, two wrong words, a note that it is missing, no relay
    symmetric   sends any of these, but the same to all lanes
    benign      sends all lanes the correct word, or none
    omissive    sends each lane the correct word or none; beyond the model of Lincoln and Rushby

Agreement: all good lanes hold the same word.  Validity: they hold the word that a good lane sent.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import permutations, product
from typing import Any, Final, NamedTuple

import numpy as np

from rig.computer.lanes.exchange import NO_LANE, Said, exchange
from rig.core.frame import COMPUTERS
from rig.core.kernels import bind

# Combinations of faults with the number of rounds: those within the bound, then those beyond it.
CASES: Final = (
    *((2, faults) for faults in ("", "a", "s", "b", "bb", "o")),
    *((1, faults) for faults in ("", "a", "s", "b")),
    *((2, faults) for faults in ("bs", "ss", "ab", "as", "aa", "oo")),
)
_RIGHT, _MISSING, _NOTHING = "x", "missing", "nothing"
_DIRECT: Final = (_RIGHT, "y", "z", _MISSING)  # a direct word that does not come is missing
_RELAYED: Final = (*_DIRECT, _NOTHING)
_ALL: Final = range(len(COMPUTERS))

Words = tuple[str, ...]  # sent to some lanes, one after the other


class _Behaviour(NamedTuple):
    """The messages on one word in one frame: from its sender, and from each relay."""

    direct: dict[int, str]  # by receiver
    relayed: dict[tuple[int, int], str]  # by receiver and relay


@dataclass(frozen=True, slots=True)
class Row:
    """One combination of faults, summed over its placements and all behaviours of the faulty lanes."""

    rounds: int
    faults: str  # a letter for each faulty lane, "" for none
    placings: int
    behaviours: int
    hold: int  # placements without a violation
    agreement_broken: int  # behaviours
    validity_broken: int
    counterexample: str  # the first violation; "" if there is none


def study(cases: Sequence[tuple[int, str]] = CASES) -> list[Row]:
    """Return a row for each number of rounds and combination of faults."""
    return [_row(rounds, faults) for rounds, faults in cases]


def as_dict(rows: Sequence[Row]) -> dict[str, Any]:
    """Return plain data, as ``rig study exchange --json`` prints it."""
    return {"rows": [asdict(row) for row in rows]}


def placings(faults: str) -> list[dict[int, str]]:
    """Return the faults by lane in every placement; lanes with the same fault are interchangeable."""
    found = [dict(zip(lanes, faults, strict=True)) for lanes in permutations(_ALL, len(faults))]
    return [one for i, one in enumerate(found) if one not in found[:i]]


def _row(rounds: int, faults: str) -> Row:
    count, hold, agreement, validity, first = 0, 0, 0, 0, ""
    everywhere, held = placings(faults), _Held(rounds)
    for faulty in everywhere:
        broken = 0
        for sender in _ALL:
            for behaviour in behaviours(sender, faulty):
                count += 1
                agreed, valid = verdict(sender, faulty, held.of(sender, behaviour))
                agreement, validity = agreement + (not agreed), validity + (not valid)
                if not (agreed and valid):
                    broken += 1
                    first = first or _in_words(sender, faulty, behaviour, held)
        hold += broken == 0
    return Row(rounds, faults, len(everywhere), count, hold, agreement, validity, first)


def behaviours(sender: int, faulty: dict[int, str]) -> Iterator[_Behaviour]:
    """Yield all behaviours on the word of ``sender``; only one if no fault can affect it."""
    to = [lane for lane in _ALL if lane != sender]
    good = [lane for lane in to if lane not in faulty]
    for direct in _told(faulty.get(sender, ""), _DIRECT, _RIGHT, len(to)):
        received = dict(zip(to, direct, strict=True))
        ways = [_told(faulty.get(k, ""), _RELAYED, received[k], sum(i != k for i in good)) for k in to]
        for relays in product(*ways):
            relayed = {
                (i, k): word
                for k, words in zip(to, relays, strict=True)
                for i, word in zip((i for i in good if i != k), words, strict=True)
            }
            yield _Behaviour(received, relayed)


def _told(fault: str, alphabet: Words, right: str, lanes: int) -> list[Words]:
    """Return all messages on the word ``right`` that a lane with a fault may send to a number of lanes."""
    nothing = alphabet[-1]
    if fault == "a":
        return list(product(alphabet, repeat=lanes))
    if fault == "s":
        return [(word,) * lanes for word in alphabet]
    if fault == "b":
        return [(right,) * lanes, (nothing,) * lanes]
    return list(product((right, nothing), repeat=lanes)) if fault == "o" else [(right,) * lanes]


class _Held:
    """Run the kernel of the exchange on behaviours."""

    def __init__(self, rounds: int) -> None:
        lanes = len(COMPUTERS)
        self.rounds, self._held = rounds, np.zeros(lanes, np.int64)
        self._words, self._said = np.zeros((lanes, lanes), np.int64), np.zeros((lanes, lanes), np.uint8)
        self._exchange = bind(exchange, 0, self._words, self._said, rounds, self._held)

    def of(self, sender: int, behaviour: _Behaviour) -> list[str]:
        """Return the word of ``sender`` that each lane holds."""
        told = {(i, sender): word for i, word in behaviour.direct.items()} | behaviour.relayed
        self._said[:] = Said.NOTHING
        for at, word in told.items():
            self._said[at] = {_MISSING: Said.MISSING, _NOTHING: Said.NOTHING}.get(word, Said.WORD)
            self._words[at] = _RELAYED.index(word)
        self._exchange(sender, self._words, self._said, self.rounds, self._held)
        whose = self._held.tolist()
        return [
            _RIGHT if i == sender else _MISSING if k == NO_LANE else told[i, k]
            for i, k in zip(_ALL, whose, strict=True)
        ]


def verdict(sender: int, faulty: dict[int, str], held: Sequence[str]) -> tuple[bool, bool]:
    """Return whether the good lanes agree on a word, and whether they hold the word of a good sender."""
    of_good = {held[lane] for lane in _ALL if lane not in faulty}
    return len(of_good) <= 1, sender in faulty or of_good == {_RIGHT}


def _in_words(sender: int, faulty: dict[int, str], behaviour: _Behaviour, held: _Held) -> str:
    who = ", ".join(f"{COMPUTERS[lane]} is {fault}" for lane, fault in faulty.items())
    told = [f"{COMPUTERS[sender]} sends {word} to {COMPUTERS[i]}" for i, word in behaviour.direct.items()]
    if held.rounds > 1:
        told += [f"{COMPUTERS[k]} relays {word} to {COMPUTERS[i]}" for (i, k), word in behaviour.relayed.items()]
    words = held.of(sender, behaviour)
    found = ", ".join(f"{COMPUTERS[lane]} holds {words[lane]}" for lane in _ALL if lane not in faulty)
    return f"{who}; {', '.join(told)}: {found}"
