"""The frame: every signal's name, unit and range, and the block of frames that all stages share.

signals.py  which signals, discretes and other numbers there are
enums.py    states, patterns, resolvers and what else has one byte
row.py      FRAME, one row; a block of them
"""

from rig.frame.enums import End, Ilm, Law, Lie, Pattern, Resolver, Source, State, Trust
from rig.frame.row import FRAME, MOST_FAULTS, TIMING, Block, new_block, to_frame
from rig.frame.signals import (
    CHANNELS,
    COMMANDS,
    DEMANDS,
    DISCRETE_INDEX,
    DISCRETES,
    ESTIMATES,
    FLIGHT,
    FLIGHT_INDEX,
    INDEX,
    INERTIAL,
    SIGNALS,
    SURFACES,
    TWO_PI,
    D,
    Discrete,
    S,
    Signal,
)

__all__ = [
    "CHANNELS",
    "COMMANDS",
    "DEMANDS",
    "DISCRETES",
    "DISCRETE_INDEX",
    "ESTIMATES",
    "FLIGHT",
    "FLIGHT_INDEX",
    "FRAME",
    "INDEX",
    "INERTIAL",
    "MOST_FAULTS",
    "SIGNALS",
    "SURFACES",
    "TIMING",
    "TWO_PI",
    "Block",
    "D",
    "Discrete",
    "End",
    "Ilm",
    "Law",
    "Lie",
    "Pattern",
    "Resolver",
    "S",
    "Signal",
    "Source",
    "State",
    "Trust",
    "new_block",
    "to_frame",
]
