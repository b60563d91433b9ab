"""Data that a kernel is given once: it computes what it computes when it is given the data with each call."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.held import Held, data_of
from rig.core.kernels import kernel


class Inner(NamedTuple):
    """Data within data."""

    state: NDArray[np.float64]
    nothing: None
    scale: float


class Given(NamedTuple):
    """Data of a kernel."""

    inner: Inner
    table: NDArray[np.int64]
    offset: int


@kernel
def add(block, k, held):
    """Add up, in the block and in the data."""
    data = data_of(held)
    data.inner.state[0] += block[k] * data.inner.scale
    block[k] += data.table[0, 1] + data.offset
    return data.inner.state[0]


def given(state: float = 0.0, scale: float = 2.0, wide: int = 2, offset: int = 3) -> Given:
    return Given(Inner(np.array([state]), None, scale), np.arange(2 * wide).reshape(2, wide), offset)


def test_a_kernel_reads_and_writes_the_data_that_is_held():
    block, data = np.array([10.0, 20.0]), given()
    call = Held(add, block, 0, data)
    held = call.hold(data)
    assert call.entry(block, 0, held) == 20.0
    assert call.entry(block, 1, held) == 60.0
    assert data.inner.state.tolist() == [60.0]
    assert block.tolist() == [14.0, 24.0]


def test_the_data_of_the_last_call_counts():
    block, one, other = np.array([10.0]), given(), given(5.0, 1.0, 7, 1)
    call = Held(add, block, 0, one)
    assert [call(block, 0, data) for data in (one, other, one)] == [20.0, 19.0, 52.0]
    assert other.inner.state.tolist() == [19.0]


def test_two_that_hold_do_not_disturb_each_other():
    block = np.array([1.0, 1.0])
    calls, data = [Held(add, block, 0, given()) for _ in range(2)], [given(0.0), given(100.0)]
    held = [call.hold(each) for call, each in zip(calls, data, strict=True)]
    assert [call.entry(block, i, which) for i, (call, which) in enumerate(zip(calls, held, strict=True))] == [
        2.0,
        102.0,
    ]
