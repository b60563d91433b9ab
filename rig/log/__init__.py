"""The log: one MCAP file a flight, that any viewer reads and that is enough to fly it again."""

from rig.log.arrays import DiscreteArrays, SignalArrays
from rig.log.reader import Log, iter_chunks, read_log
from rig.log.recover import Recovered, recover
from rig.log.scan import LoggedEvent
from rig.log.schema import SCHEMA_VERSION
from rig.log.writer import Event, LogWriter

__all__ = [
    "SCHEMA_VERSION",
    "DiscreteArrays",
    "Event",
    "Log",
    "LogWriter",
    "LoggedEvent",
    "Recovered",
    "SignalArrays",
    "iter_chunks",
    "read_log",
    "recover",
]
