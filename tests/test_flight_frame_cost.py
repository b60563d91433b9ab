"""The frame's order: the bench's table of pieces is the order of the stretches, and three calls are one."""

import numpy as np
import pytest

from rig.computer.redundancy.managers import vote_signals
from rig.computer.redundancy.own import OwnManager
from rig.core.frame import Block, nested, new_block
from rig.core.kernels import bind
from rig.flight.cost import pieces
from rig.flight.loop import Rig, after, before, bind_computer, think
from rig.scenario import scenario

FRAMES = 300
ALL_PLACES = [  # each of the three kernels of faults has something to do
    '{kind="offset",signal="pitch_rate",channels=[3],offset=0.2,start_s=0.5}',
    '{kind="offset",signal="reference.roll_rate",offset=0.1,start_s=0.7}',
    '{kind="offset",signal="surface.elevator",offset=0.01,start_s=0.9}',
]


def flown(step, *sets: str) -> Block:
    """A flight whose frames are made by ``step(rig)(rows, k)``; rows is nested."""
    which = scenario.load(None, ["duration_s=3", f"faults=[{','.join(ALL_PLACES)}]", *sets])
    rig, block = Rig(which), new_block(FRAMES)
    block["reference"] = block["second_reference"] = np.nan
    rig.prepare(block)
    rows, fly_row = nested(block), step(rig)
    for k in range(FRAMES):
        assert rig.plant.read(block, k) == 0
        fly_row(rows, k)
        rig.plant.step(block, k)
    return block


def at_once(rig: Rig):
    return lambda rows, k: rig.computer_step(rows, k, rig.data)


def in_pieces(rig: Rig):
    def fly_row(rows, k):
        for _, entry, data in pieces(rig.data):
            entry(rows, k, data)

    return fly_row


def in_stretches(rig: Rig):
    rows = nested(new_block(2))
    bound = [bind(part, rows, 0, rig.data) for part in (before, think, after)]

    def fly_row(rows, k):
        for part in bound:
            part(rows, k, rig.data)

    return fly_row


def around_ours(rig: Rig):
    """Our own manager in the place of a user's."""
    ours = rig.redundancy.manager.data
    own = OwnManager("ours", lambda bus, fcc, k, frame: vote_signals(bus[k], fcc[k], ours), ours.params["fitted"])
    fly_row = bind_computer(rig.data, own)
    return lambda rows, k: fly_row(rows, k, rig.data)


@pytest.mark.parametrize("step", [in_pieces, in_stretches, around_ours])
def test_a_frame_is_the_same_at_once_and_in_parts(step):
    whole = flown(at_once, "turbulence=light")
    assert whole["acting"][-1, 0] == 0b111 and whole["state"][-1, 0, 2] == 2
    assert whole.tobytes() == flown(step, "turbulence=light").tobytes()
