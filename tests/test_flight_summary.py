import hashlib
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.core.frame import FLIGHT_INDEX, INDEX, Block, End, RowParts, State, Table, new_block, second_rows
from rig.flight.summary import Verdict

ALPHA, N_Z, PSI, Q = (INDEX[n] for n in ("angle_of_attack", "normal_load_factor", "heading", "pitch_rate"))
ALTITUDE = FLIGHT_INDEX["altitude_m"]


def flown() -> np.ndarray:
    rng = np.random.default_rng(0)
    block = new_block(200)
    block["truth"] = rng.normal(size=block["truth"].shape)
    block["flight"] = rng.normal(size=block["flight"].shape)
    return block


def test_the_digest_is_that_of_all_rows_however_they_come():
    block, parts = flown(), Verdict()
    for first in range(0, 200, 70):
        parts.add(Table(block[first : first + 70]), [])
    assert parts.digest == hashlib.sha256(block.tobytes()).hexdigest()
    assert parts.frames == 200


PARTS: list[RowParts] = [("servo",), ("computer",), ("servo", "computer")]


def beside(parts: RowParts) -> Block:
    rng, second = np.random.default_rng(1), second_rows(200, parts)
    for part in parts:
        for name in second[part].dtype.names or ():
            second[part][name] = rng.integers(0, 100, second[part][name].shape)
    return second


besides = cache(beside)  # never written


@pytest.mark.parametrize("parts", PARTS)
@given(cuts=st.sets(st.integers(1, 199)))
def test_the_digest_of_rows_and_lanes_is_that_of_both_however_they_come(parts: RowParts, cuts: set[int]):
    block, second, verdict = flown(), besides(parts), Verdict()
    for first, last in zip([0, *sorted(cuts)], [*sorted(cuts), 200], strict=True):
        verdict.add(Table(block[first:last], second[first:last]), [])
    both = hashlib.sha256(block.tobytes()).digest() + hashlib.sha256(second.tobytes()).digest()
    assert verdict.digest == hashlib.sha256(both).hexdigest()


@pytest.mark.parametrize(("part", "field"), [("servo", "ram"), ("computer", "leads")])
def test_another_number_of_a_lane_is_another_digest(part: str, field: str):
    second, digests = beside(("servo", "computer")), set[str]()
    for changed in (0, 1):
        second[part][field][-1, -1] += changed
        verdict = Verdict()
        verdict.add(Table(flown(), second), [])
        digests.add(verdict.digest)
    assert len(digests) == 2


def test_the_peaks_are_those_of_numpy():
    block, verdict = flown(), Verdict()
    block["truth"][:, PSI] = np.linspace(6.2, 6.4, 200) % (2 * np.pi)
    verdict.add(Table(block[:90]), [])
    verdict.add(Table(block[90:]), [])
    peaks = verdict.peaks
    assert (peaks.angle_of_attack_min_rad, peaks.angle_of_attack_max_rad) == (
        block["truth"][:, ALPHA].min(),
        block["truth"][:, ALPHA].max(),
    )
    assert (peaks.load_factor_min, peaks.load_factor_max) == (
        block["truth"][:, N_Z].min(),
        block["truth"][:, N_Z].max(),
    )
    assert peaks.pitch_rate_max_rad_s == np.abs(block["truth"][:, Q]).max()
    altitude = block["flight"][:, ALTITUDE]
    assert peaks.altitude_deviation_m == np.abs(altitude - altitude[0]).max()
    assert peaks.heading_deviation_rad == pytest.approx(0.2, abs=1e-9)


def test_a_last_row_that_is_no_number_leaves_the_peaks_before_it():
    block, verdict = flown(), Verdict()
    block["truth"][-1], block["flight"][-1], block["end"][-1] = np.nan, np.nan, End.NOT_FINITE
    verdict.add(Table(block), [])
    assert verdict.peaks.load_factor_max == block["truth"][:-1, N_Z].max()
    assert not verdict.survived and verdict.end == End.NOT_FINITE


def test_failed_channels_are_those_of_the_last_row():
    block, verdict = flown(), Verdict()
    block["state"][50:, Q, 2] = State.FAILED
    block["state"][60:90, ALPHA, 0] = State.FAILED
    block["state"][:, PSI, 3] = State.ABSENT
    block["discrete_state"][100:, 1, 0] = State.FAILED
    verdict.add(Table(block), [])
    assert verdict.failed == {"pitch_rate": [3], "gear_down": [1]}
