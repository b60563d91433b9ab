"""The exchange between lanes: its rules on words, and its table by an enumeration of its own."""

import json
from collections import Counter
from collections.abc import Iterator
from itertools import combinations, product

import numpy as np
import pytest

from rig.computer.lanes.exchange import NO_LANE, Arrival, Said, arrival, exchange
from rig.studies.papers.lane_exchange import CASES, Row, as_dict, study

LANES = "ABCD"
DIRECT = ("right", "wrong", "other", None)  # None: missing
Told = dict[str, str | None]


@pytest.fixture(scope="module")
def rows() -> dict[tuple[int, str], Row]:
    return {(row.rounds, row.faults): row for row in study()}


@pytest.mark.parametrize(
    ("ahead", "intact", "silent", "expected"),
    [
        (0.2, 1, 0, Arrival.FRESH),
        (-0.9, 1, 0, Arrival.FRESH),  # the sender is first
        (0.21, 1, 0, Arrival.OLD),
        (0.0, 1, 1, Arrival.OLD),
        (0.21, 1, 1, Arrival.MISSING),
        (0.0, 1, 2, Arrival.MISSING),
        (0.0, 0, 0, Arrival.MISSING),
    ],
)
def test_a_message_is_fresh_old_or_missing(ahead: float, intact: int, silent: int, expected: Arrival):
    assert arrival(ahead, 0.2, intact, silent, 1) == expected


W, M, N = Said.WORD, Said.MISSING, Said.NOTHING


@pytest.mark.parametrize(
    ("words", "said", "two_rounds"),
    [  # told to D of the word of A, by A, B and C
        ((1, 1, 1), (W, W, W), 0),
        ((2, 1, 1), (W, W, W), 1),  # the relays outvote the direct word
        ((1, 2, 3), (W, W, W), NO_LANE),
        ((1, 1, 0), (W, W, M), 0),
        ((1, 0, 0), (W, M, M), NO_LANE),  # most say that it is missing
        ((0, 1, 1), (M, W, W), 1),
        ((1, 2, 0), (W, W, N), NO_LANE),  # one of two is no strict majority
        ((1, 1, 0), (W, W, N), 0),
        ((1, 0, 0), (W, N, N), 0),  # no lane relays: the direct word alone
        ((0, 1, 0), (M, W, N), NO_LANE),
    ],
)
def test_the_strict_majority_of_direct_and_relayed_words_is_held(
    words: tuple[int, ...], said: tuple[Said, ...], two_rounds: int
):
    told, kinds, held = np.zeros((4, 4), np.int64), np.full((4, 4), N, np.uint8), np.zeros(4, np.int64)
    told[3, :3], kinds[3, :3] = words, said
    exchange(0, told, kinds, 2, held)
    assert held[3] == two_rounds and held[0] == 0
    exchange(0, told, kinds, 1, held)
    assert held[3] == (0 if said[0] == W else NO_LANE)


def liberties(fault: str, right: str | None, to: str, relay: bool) -> Iterator[Told]:
    """What a lane may tell each of ``to``; who gets nothing of a relay is left out."""
    silence: Told = {} if relay else dict.fromkeys(to)
    if fault == "":
        yield dict.fromkeys(to, right)
    elif fault == "b":
        yield from (dict.fromkeys(to, right), silence)
    elif fault == "s":
        yield from (dict.fromkeys(to, word) for word in DIRECT)
        if relay:
            yield silence
    else:
        words = (right, "silent") if fault == "o" else (*DIRECT, "silent") if relay else DIRECT
        for chosen in product(words, repeat=len(to)):
            heard = {lane: word for lane, word in zip(to, chosen, strict=True) if word != "silent"}
            yield heard if relay else {lane: heard.get(lane) for lane in to}


def majority(words: list[str | None]) -> str | None:
    word, count = Counter(words).most_common(1)[0]
    return word if 2 * count > len(words) else None


def by_hand(rounds: int, faults: str) -> tuple[int, int, int, int, int]:
    """Placings, behaviours, placings that hold, agreement and validity broken, from the rules alone."""
    placed = {
        tuple(zip(lanes, order, strict=True))
        for lanes in combinations(LANES, len(faults))
        for order in (faults, faults[::-1])
    }
    total, hold, parted, invalid = 0, 0, 0, 0
    for placing in placed:
        fault = dict.fromkeys(LANES, "") | dict(placing)
        good = [lane for lane in LANES if not fault[lane]]
        before = parted + invalid
        for sender in LANES:
            others = LANES.replace(sender, "")
            for direct in liberties(fault[sender], "right", others, relay=False):
                readers = {k: "".join(i for i in others if i != k and i in good) for k in others}
                ways = [liberties(fault[k], direct[k], readers[k], relay=True) for k in others]
                for relays in product(*map(list, ways)):
                    total += 1
                    held: Told = {sender: "right"} if sender in good else {}
                    for i in (lane for lane in good if lane != sender):
                        relayed = [told[i] for told in relays if i in told] if rounds == 2 else []
                        held[i] = majority([direct[i], *relayed])
                    parted += len(set(held.values())) > 1
                    invalid += sender in good and set(held.values()) != {"right"}
        hold += parted + invalid == before
    return len(placed), total, hold, parted, invalid


@pytest.mark.parametrize(("rounds", "faults"), CASES)
def test_the_table_is_that_of_another_enumeration(rounds: int, faults: str, rows: dict[tuple[int, str], Row]):
    row = rows[rounds, faults]
    counted = row.placings, row.behaviours, row.hold, row.agreement_broken, row.validity_broken
    assert counted == by_hand(rounds, faults)


def test_two_rounds_hold_within_the_bound_of_lincoln_and_rushby_and_not_beyond(rows: dict[tuple[int, str], Row]):
    for (rounds, faults), row in rows.items():
        if rounds == 2 and "o" not in faults:
            asymmetric, symmetric, benign = (faults.count(letter) for letter in "asb")
            within = len(LANES) > 2 * asymmetric + 2 * symmetric + benign + 1
            assert (row.hold == row.placings) == within == (row.counterexample == ""), faults


def test_one_round_does_not_hold_against_a_lane_that_says_different_words(rows: dict[tuple[int, str], Row]):
    one, two = rows[1, "a"], rows[2, "a"]
    assert (one.placings, one.behaviours, one.agreement_broken) == (4, 556, 240)
    assert (two.hold, two.behaviours, two.agreement_broken) == (4, 556, 0) and rows[2, "bb"].hold == 6


def test_the_command_prints_rows_and_counterexamples(rows: dict[tuple[int, str], Row], rig_command):
    code, said, _ = rig_command("study", "exchange", "--json")
    assert code == 0 and json.loads(said) == as_dict(list(rows.values()))
    code, said, _ = rig_command("study", "exchange")
    assert code == 0 and "2 rounds, bs: A is b, B is s;" in " ".join(said.split()) and "a asymmetric" in said
