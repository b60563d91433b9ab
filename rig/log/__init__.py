"""The log: one MCAP file a flight, that any viewer reads and that is enough to fly it again."""

from rig.core.event import Event
from rig.log.log_file import LogFile
from rig.log.reader import DiscreteArrays, Log, SignalArrays, iter_chunks, read_log, scenario_of, unit_of
from rig.log.scan import Recovered, recover
from rig.log.schema import SCHEMA_VERSION
