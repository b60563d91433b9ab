"""Vectors: required answers of a monitor to known inputs; each case names the requirement that it tests.

An independent implementation of the rules makes them (tests/tools/unit_vectors.py), not the built-in manager.
The file holds numpy arrays; each case is a session:

    layout       LAYOUT of the records
    requirement  (cases,) text
    config       (cases,) CONFIG
    case         (frames,) case of a frame, in order
    input        (frames,) INPUT
    expected     (frames,) OUTPUT; ``said`` names the groups that are compared
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import ManagerFailed, RigError
from rig.core.files import NOT_WHOLE, reported
from rig.core.frame import DISCRETES, SIGNALS, UnitStatus
from rig.unit.port import RECEIVED, complete
from rig.unit.running_unit import UnitUnderTest
from rig.unit.unit_records import ANSWERS, CONFIG, HELLO, INPUT, LAYOUT, OF_LAW, OUTPUT, SINCE, Role, Said

FILE: Final = Path(__file__).with_name("vectors.npz")
BODY: Final = tuple(  # that all versions have
    name
    for name in INPUT.names or ()
    if name not in (HELLO.names or ()) and SINCE.get(name, 1) == 1 and not name.startswith("pad_")
)
VOTES_WITHIN: Final = 1e-6  # of a signal's range


@dataclass(frozen=True, slots=True)
class Case:
    """One session: inputs and required outputs."""

    requirement: str
    config: NDArray[Any]  # (1,) CONFIG
    inputs: NDArray[Any]  # (n,) INPUT
    expected: NDArray[Any]  # (n,) OUTPUT


def load(path: Path = FILE) -> list[Case]:
    """Read the cases of a file.  RigError: of another layout, or it cannot be read."""
    try:
        with reported(path, what=NOT_WHOLE), path.open("rb") as file, np.load(file) as held:
            if int(held["layout"]) != LAYOUT:
                raise RigError(f"{path}: vectors of another layout; write them again with tests/tools/unit_vectors.py")
            requirement, config, case = held["requirement"], held["config"].view(CONFIG), held["case"]
            inputs, expected = held["input"].view(INPUT), held["expected"].view(OUTPUT)  # whatever names they had
    except (BadZipFile, KeyError, EOFError) as error:
        raise RigError(f"{path}: {NOT_WHOLE}: {error}") from None
    return [
        Case(str(requirement[i]), config[i : i + 1].copy(), inputs[case == i], expected[case == i])
        for i in range(len(config))
    ]


def save(cases: list[Case], path: Path = FILE) -> None:
    """Write the cases to a file."""
    np.savez_compressed(
        path,
        layout=np.uint64(LAYOUT),
        requirement=np.array([case.requirement for case in cases]),
        config=np.concatenate([case.config for case in cases]).astype(CONFIG),
        case=np.repeat(np.arange(len(cases)), [len(case.inputs) for case in cases]),
        input=np.concatenate([case.inputs for case in cases]).astype(INPUT),
        expected=np.concatenate([case.expected for case in cases]).astype(OUTPUT),
    )


def answers(tested: UnitUnderTest, config: NDArray[Any], inputs: NDArray[Any]) -> NDArray[Any]:
    """Return the answers of a unit to ``inputs`` (n,), INPUT or LAW_INPUT, in one session: (n,) OUTPUT.  UnitRefused.

    Frames without an answer stay zero, their ``frame`` -1.
    """
    tested.begin(config.copy())
    outputs = np.zeros(len(inputs), OUTPUT)
    outputs["frame"] = -1
    for k, record in enumerate(inputs):
        if ask(tested, record, k):
            outputs[k] = tested.port.back.records[RECEIVED]
    tested.end()
    return outputs


def ask(tested: UnitUnderTest, record: Any, k: int) -> bool:
    """Send the body of a record to a unit as frame k of its session; return True if it was answered.

    Missing groups of its answer are then filled as in a flight.  record : INPUT, or LAW_INPUT for a control law
    """
    port = tested.port.out
    for name in OF_LAW if tested.role is Role.CONTROL_LAW else BODY:
        port.sent[name] = record[name]
    port.sent["frame"], port.sent["time_s"] = k, k / port.rate_hz
    try:
        status = tested.exchange(k, k)
    except ManagerFailed:
        return False
    tested.count_status(status)
    answered = status == UnitStatus.ANSWERED
    if answered:
        complete(tested.port.back)
    return answered


def differences(case: Case, outputs: NDArray[Any]) -> Iterator[str]:
    """Yield the differences of ``outputs`` (n,) from the case, the earliest first; for each field its first frame.

    Votes may differ by VOTES_WITHIN of the range.
    """
    ranges = case.config["signal"][0]
    allowed = VOTES_WITHIN * (ranges["high"] - ranges["low"])
    unanswered = outputs["frame"] < 0
    found = [(int(k), "no answer") for k in np.flatnonzero(unanswered)[:1]]
    for name, group in ANSWERS.items():
        expected, answered = case.expected[name], outputs[name]
        counts = (case.expected["said"] & group != 0) & ~unanswered
        counts = counts.reshape(len(counts), *[1] * (expected.ndim - 1))
        filled_by = group | Said.VOTED if group == Said.STATE else group  # what votes alone stand for: port.complete
        unfilled = (outputs["said"] & filled_by == 0).reshape(counts.shape) & counts
        off = ~(np.abs(expected - answered) <= allowed) if group == Said.VOTED else expected != answered
        for place in np.argwhere((off | unfilled) & counts)[:1]:
            where: tuple[int, ...] = tuple(place.tolist())
            is_said = "not filled" if unfilled[where[0]].any() else answered[where]
            text = f"{name}{_named(where[1:], expected.shape)} is {is_said}, must be {expected[where]}"
            found.append((where[0], text))
    yield from (f"frame {k}: {text}" for k, text in sorted(found, key=lambda one: one[0]))


def _named(index: tuple[int, ...], shape: tuple[int, ...]) -> str:
    """Return the signal or discrete, and the channel, of an element of a field."""
    items = {len(SIGNALS): SIGNALS, len(DISCRETES): DISCRETES}.get(shape[1] if len(shape) > 1 else 0)
    named = f" {items[index[0]].name}" if items else ""
    return named + (f" channel {index[1] + 1}" if len(index) > 1 else "")
