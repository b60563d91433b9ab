"""The log: one MCAP file a flight, that any viewer reads and that is enough to fly it again."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rig.core.event import Event
from rig.log.log_file import LogFile
from rig.log.reader import DiscreteArrays, Log, SignalArrays, iter_chunks, read_log, scenario_of, unit_of
from rig.log.scan import Recovered, recover
from rig.log.schema import SCHEMA_VERSION

if TYPE_CHECKING:
    from rig.log.writer import LogWriter


def __getattr__(name: str) -> Any:
    """Import the writer on first use: it has kernels, and a reader of logs need not wait for them."""
    if name != "LogWriter":
        raise AttributeError(f"module 'rig.log' has no attribute {name!r}")
    from rig.log.writer import LogWriter

    return LogWriter
