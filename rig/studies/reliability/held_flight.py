"""What open-loop trials run on: truth and references of a healthy flight of a scenario, held."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import Block
from rig.flight.loop import fly_rows
from rig.scenario.scenario import Scenario


class Recording(NamedTuple):
    """Of every signal, (N, S), frame by frame."""

    truth: NDArray[np.float64]
    reference: NDArray[np.float64]
    second_reference: NDArray[np.float64]


def recording(scenario: Scenario, seed: int) -> Recording:
    """Fly ``scenario`` without its faults, with ``seed``.  BadInput when the aircraft does not last to the end."""
    rows = fly_rows(scenario.model_copy(update={"faults": [], "seed": seed}).trusted(scenario.trust))
    if len(rows) < scenario.frames:
        raise BadInput(
            f"the healthy flight ends after {len(rows)} of {scenario.frames} frames: nothing to try faults on"
        )
    return of_rows(rows)


def of_rows(rows: Block) -> Recording:
    """Return the recording of a flight's rows."""
    return Recording(*(np.ascontiguousarray(rows[name]) for name in Recording._fields))
