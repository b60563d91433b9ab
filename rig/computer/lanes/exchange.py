"""The exchange of samples between lanes, without clocks and wires: what each lane sent, and what each holds of it.

Round 1: each lane tells the others its own word.  One that comes late is the word of the frame before; one that is
damaged or too old is missing.
Round 2: each lane relays to the others what it holds of round 1, 'missing' too.  From the direct word and the relayed
ones a lane holds that of the strict majority, bit for bit.  'Missing' counts as a word; a relay
that did not arrive is left out; without a strict majority the word is missing.

With one round a lane uses the word that arrived, and a lane that sends different words splits the others.
Source: Lincoln and Rushby 1993, A formally verified algorithm for interactive consistency under a hybrid fault model.
With 4 lanes and one relay: right while 4 > 2 a + 2 s + b + 1 (asymmetric, symmetric, benign lanes).
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final

from rig.core.kernels import kernel

NO_LANE: Final = -1  # in place of the lane whose word is held: the word is missing


class Arrival(IntEnum):
    """A message of round 1, as its receiver has it."""

    FRESH = 0  # of this frame
    OLD = 1  # of a frame before
    MISSING = 2


class Said(IntEnum):
    """State of the word that one lane received from another."""

    WORD = 0
    MISSING = 1  # a direct word that is missing, or a relay that says so
    NOTHING = 2  # a relay that did not arrive


@kernel
def arrival(ahead, window, intact, silent, most):
    """Return the Arrival of a message.

    ahead, window : by how much its receiver is ahead of its sender, and how long it reads the link, frames
    intact : its checksum is right;  silent, most : frames for which nothing came, and may come
    """
    age = silent + (1 if ahead > window else 0)
    if intact == 0 or age > most:
        return Arrival.MISSING.value
    return Arrival.FRESH.value if age == 0 else Arrival.OLD.value


@kernel
def exchange(sender, words, said, rounds, held):
    """Find whose telling of the word of ``sender`` each lane holds.

    words : (lanes, lanes) bits, receiver by teller: direct where the teller is the sender, relayed otherwise
    ``said`` : (lanes, lanes) ``Said`` of them;  rounds : 1 or 2
    Writes held : (lanes,) the teller whose word it is, or ``NO_LANE``; the sender holds its own.
    """
    for i in range(len(held)):
        if i == sender:
            held[i] = sender
        elif rounds == 1:
            held[i] = sender if said[i, sender] == Said.WORD else NO_LANE
        else:
            held[i] = strict_majority(i, words[i], said[i])


@kernel
def strict_majority(receiver, words, said):
    """Return a sender of the majority's word to ``receiver``, ``NO_LANE`` if that is 'missing' or there is none.

    words : (lanes,) bits;  ``said`` : (lanes,) ``Said``
    """
    telling = 0
    for k in range(len(said)):
        telling += k != receiver and said[k] != Said.NOTHING
    for k in range(len(said)):
        if k == receiver or said[k] != Said.WORD:
            continue
        same = 0
        for other in range(len(said)):
            same += other != receiver and said[other] == Said.WORD and words[other] == words[k]
        if 2 * same > telling:
            return k
    return NO_LANE
