"""One frame's exchange with a unit: in compiled code where the answer is a usual one, and else in Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rig.core.frame import UnitStatus
from rig.unit.compiled_exchange import FOREVER_NS, PENDING
from rig.unit.running_unit import UnitUnderTest

Exchange = Callable[
    [Any, Any, int, Any, int], int
]  # block, raw, row, data, frame: what it came to, of frame.UnitStatus


def exchange_with(unit: UnitUnderTest, whole: Callable[..., int], last: Callable[..., int]) -> Exchange:
    """Return the exchange of a frame; it counts what the frame came to.

    whole : fills the record, tries the exchange and takes the answer, or returns PENDING before it has one
    last : takes the answer that Python has received
    """
    port, compiled, paced = unit.port, unit.compiled, unit.paced
    by_python, replies, answered = unit.exchange, unit.replies, int(UnitStatus.ANSWERED)

    def exchange(block: Any, raw: Any, k: int, data: Any, frame: int) -> int:
        usual = not (replies.run or unit.dead)
        until_ns = (unit.until_ns(frame) if paced else FOREVER_NS) if usual else 0
        status = whole(block, raw, k, data, port, compiled, until_ns)
        if status == PENDING:
            status = last(block, raw, k, data, port.back, by_python(frame, k))
        if status != answered or replies.run:
            unit.count_status(status)
        return status

    return exchange
