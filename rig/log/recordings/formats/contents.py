"""The topics of a log of another system, and how their columns are read."""

from __future__ import annotations

import gc
import io
import logging
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from traceback import clear_frames
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.files import open_regular, reported
from rig.core.text import choices, quoted
from rig.log.foreign import Source
from rig.log.recordings.stamps import Floats

LARGEST_LOG: Final = 2 << 30  # bytes of a file, which is in memory
_LIBRARY_FAULTS: Final = (  # what a library raises on damaged files
    *(ArithmeticError, AssertionError, AttributeError, BufferError, EOFError, LookupError, MemoryError, NameError),
    *(OSError, RuntimeError, TypeError, ValueError),
)


@dataclass(frozen=True, slots=True)
class Topic:
    """One instance of a message: its rows, and its fields with their units.

    name : as a mapping writes it, sensor_gyro/1; message, instance : its parts; device : identity of the sensor
    """

    name: str
    message: str
    instance: str
    rows: int
    first_s: float
    last_s: float
    rate_hz: float
    units: dict[str, str] = field(default_factory=dict)  # of each field; "" where the format gives none
    device: str = ""
    unusable: str = ""  # why it is no channel; "" : it may be one

    def holds(self, names: Collection[str]) -> bool:
        """Return True if the topic has all fields ``names``."""
        return all(name in self.units for name in names)


@dataclass(frozen=True, slots=True)
class LogContents:
    """All topics of a log, in the order of their names."""

    format: str  # PX4
    preset: str  # that belongs to the format; "" for none
    topics: tuple[Topic, ...]
    remarks: tuple[str, ...] = ()
    damage: tuple[str, ...] = ()  # what was left out

    def named(self, path: Path, name: str) -> Topic:
        """Return the topic ``name``.  BadInput: there is none, with the nearest ones; one that is no channel."""
        found = next((topic for topic in self.topics if topic.name == name), None)
        if found is None:
            raise BadInput(f"{path}: no topic {quoted(name)}; {choices(name, [t.name for t in self.topics])}")
        if found.unusable:
            raise BadInput(f"{path}: topic {quoted(name)}: {found.unusable}")
        return found


class OpenLog(Protocol):
    """A log that has been opened."""

    @property
    def contents(self) -> LogContents:
        """Return what the log holds."""
        ...

    def source(self, topic: Topic, fields: Collection[str]) -> Source:
        """Return time [s] and the ``fields`` of ``topic``, in the units of the topic; each (n,)."""
        ...


def topic_of(message: str, instance: str, time_s: Floats, units: dict[str, str], device: str = "") -> Topic:
    """Return the topic of rows at ``time_s`` (n,), n >= 1."""
    name = f"{message}/{instance}" if instance else message
    known = _those(time_s, np.isfinite(time_s))
    steps = np.diff(known)
    rising = _those(steps, (steps > 0) & np.isfinite(steps))
    rate_hz = 1.0 / float(np.median(rising, overwrite_input=True)) if len(rising) else 0.0
    first_s, last_s = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    return Topic(name, message, instance, len(time_s), first_s, last_s, rate_hz, units, device)


def _those(values: Floats, mask: NDArray[np.bool_]) -> Floats:
    """Return ``values[mask]``, without a copy of all."""
    return values if mask.all() else values[mask]


def read_log(path: Path) -> bytes:
    """Return the bytes of a log.  BadInput as of ``open_regular``."""
    with open_regular(path, LARGEST_LOG) as file, reported(path, BadInput, "cannot be read"):
        return file.read()


def share(left_out: int, size: int) -> str:
    """Return what is told of ``left_out`` bytes of a file of ``size``, behind a sentence; "" for none."""
    return f"; damaged: {left_out} of {size} bytes ({100 * left_out / size:.3g} %) were left out" if left_out else ""


def cut_short(cut: int) -> list[str]:
    """Return a remark on a last message of which only ``cut`` bytes are there, as after power was lost."""
    return [f"the last message is not whole: its {cut} bytes were left out"] if cut else []


@contextmanager
def reading(path: Path, format: str) -> Iterator[None]:
    """Run a library on a file of a user: nothing that it prints is seen, what it raises is one line.  BadInput."""
    refusal: BadInput | None = None
    with _silence():
        try:
            yield
        except BadInput:
            raise
        except OSError as error:
            refusal = BadInput(f"{path}: cannot be read: {error.strerror or error}")
            clear_frames(error.__traceback__)
        except Exception as error:
            home = type(error).__module__.partition(".")[0]
            if home == "rig" or (home == "builtins" and not isinstance(error, _LIBRARY_FAULTS)):
                raise
            what = " ".join(str(error).split())[:200] or type(error).__name__
            refusal = BadInput(f"{path}: damaged, or no {format} log: {what}")
            clear_frames(error.__traceback__)
        if refusal is not None:
            gc.collect()  # a half-made object prints when it goes
    if refusal is not None:
        raise refusal


@contextmanager
def _silence() -> Iterator[None]:
    """Drop what is printed and logged in the block, and what goes wrong when its objects go."""
    disabled, hook = logging.root.manager.disable, sys.unraisablehook
    logging.disable(logging.CRITICAL)
    sys.unraisablehook = lambda _: None
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            yield
    finally:
        sys.unraisablehook = hook
        logging.disable(disabled)


def extra_needed(path: Path, format: str, extra: str) -> BadInput:
    """Return the refusal of a log whose library is not installed."""
    return BadInput(f"{path}: a {format} log needs a package: pip install 'jsbsim-rig[{extra}]'")
