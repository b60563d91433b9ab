"""The frame: every signal's name, unit and range, and the block of frames that all stages share.

signals.py  the signals, discretes and other numbers
enums.py    states, patterns, tie-break rules and other values of one byte
fields.py   the one table of fields: part, shape, meaning, place in the log
sig.py      the places of the signals by their symbols, for kernels
second_row.py  the second row, of flights with servo actuators or several computers
table.py    the frames of a flight with all their parts
row.py      the row type of some signals; FRAME, that of a flight, nested by part; FLAT, the same by field; blocks
"""

from rig.core.frame.enums import (
    ActuatorMonitor,
    DecidedBy,
    End,
    Health,
    Ilm,
    LaneTest,
    Law,
    LinkState,
    Pattern,
    SensorFault,
    Source,
    State,
    Trust,
    UnitStatus,
)
from rig.core.frame.fields import MOST_FAULTS
from rig.core.frame.row import (
    ACTUATION,
    BUS,
    FCC,
    FLAT,
    FRAME,
    TIMING,
    TRUTH,
    Block,
    Nested,
    Rows,
    copied,
    nested,
    new_block,
    offset,
    rows,
    to_frame,
    to_frames,
)
from rig.core.frame.second_row import (
    COMPUTER,
    COMPUTER_FIELDS,
    COMPUTERS,
    INTEGRATED,
    LINK,
    LINKS,
    MOVED,
    ROW_PARTS,
    SERVO,
    SERVO_FIELDS,
    SYSTEMS,
    RowPart,
    RowParts,
    links,
    parts_of,
    second_rows,
)
from rig.core.frame.signals import (
    AUTOPILOT_COMMANDS,
    CHANNELS,
    COMMANDS,
    DISCRETE_INDEX,
    DISCRETES,
    ESTIMATES,
    FLIGHT,
    FLIGHT_INDEX,
    INDEX,
    INERTIAL,
    SIGNALS,
    SURFACES,
    D,
    Discrete,
    S,
    Signal,
)
from rig.core.frame.table import Table, stacked
