"""An FMU of an aircraft in FMPy, flown by the surfaces of a flight; and what it puts out beside the rows of a log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, DISCRETES, SIGNALS, SURFACES, Block
from rig.core.frame.fields import FIELD

needs_fmpy = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("fmpy", "pythonfmu", "pythonfmu3")),
    reason="no FMPy or pythonfmu: pip install 'jsbsim-rig[fmi,fmu]'",
)
INPUTS: Final = [f"surface.{name}" for name in SURFACES]
# Written out apart from the product: base name of each output, its field of the row, and where it stands there.
OUTPUTS: Final[dict[str, tuple[str, tuple[int, ...]]]] = {
    **{
        f"{signal.name}.{name}": (field, (i,))
        for i, signal in enumerate(SIGNALS)
        for name, field in (
            *(("channel", "channels"), ("valid", "valid"), ("monitor", "ilm")),
            *(("truth", "truth"), ("reset", "reset")),
        )
    },
    **{
        f"{discrete.name}.{name}": (f"discrete_{field}", (i,))
        for i, discrete in enumerate(DISCRETES)
        for name, field in (
            *(("channel", "channels"), ("valid", "valid"), ("monitor", "ilm")),
            *(("truth", "truth"), ("reset", "reset")),
        )
    },
    **{
        f"{field}.{name}": (field, (i,))
        for field in ("flight", "inertial", "autopilot_command")
        for i, name in enumerate(FIELD[field].elements)
    },
    "end": ("end", ()),
}


class Master:
    """One instance of an FMU; a step is one frame if no length is given."""

    def __init__(self, file: Path, folder: Path, begin_s: float = 0.0, **parameters: float) -> None:
        from fmpy import extract, instantiate_fmu, read_model_description

        self.step_s, self.begin_s, self.time_s = 0.01, begin_s, begin_s
        self.described = read_model_description(file)
        self.is_3 = str(self.described.fmiVersion).startswith("3")
        place = folder / f"{file.stem}_unpacked"
        if not place.exists():
            extract(str(file), unzipdir=str(place))
        self.fmu: Any = instantiate_fmu(str(place), self.described, "CoSimulation", debug_logging=True)
        self._of = {variable.name: variable for variable in self.described.modelVariables}
        self.begin(parameters)

    def begin(self, parameters: dict[str, float]) -> None:
        """Initialize with parameters by name."""
        self.time_s = self.begin_s
        if self.is_3:
            self.fmu.enterInitializationMode(startTime=self.begin_s)
        else:
            self.fmu.setupExperiment(startTime=self.begin_s)
            self.fmu.enterInitializationMode()
        for name, value in parameters.items():
            self.put([name], [value])
        self.fmu.exitInitializationMode()

    def put(self, names: Sequence[str], values: Sequence[float]) -> None:
        """Set variables of one type."""
        self._call("set", names)([self._of[name].valueReference for name in names], list(values))

    def get(self, names: Sequence[str]) -> NDArray[Any]:
        """Get variables of one type; arrays flat."""
        return np.array(self.reader(names)())

    def reader(self, names: Sequence[str]) -> Callable[[], object]:
        """What gets variables of one type, and prepares nothing in its call."""
        of = [self._of[name] for name in names]
        references, call = [variable.valueReference for variable in of], self._call("get", names)
        if not self.is_3:
            return lambda: call(references)
        count = sum(int(np.prod(variable.shape or (1,))) for variable in of)
        return lambda: call(references, nValues=count)

    def _call(self, verb: str, names: Sequence[str]) -> Any:
        return getattr(self.fmu, f"{verb}{self._of[names[0]].type}")

    def step(self, step_s: float | None = None) -> Any:
        """Fly one step; FMICallException: it is discarded."""
        length = self.step_s if step_s is None else step_s
        answer = self.fmu.doStep(self.time_s, length)
        self.time_s += length
        return answer

    def row(self) -> dict[str, NDArray[Any]]:
        """Every output by its base name, read with one call for each type."""
        names: dict[str, list[str]] = {}
        for base in OUTPUTS:
            many = base.endswith((".channel", ".valid", ".monitor")) and not self.is_3
            for name in [f"{base}[{c + 1}]" for c in range(CHANNELS)] if many else [base]:
                names.setdefault(self._of[name].type, []).append(name)
        found: dict[str, list[Any]] = {}
        for kind in names.values():
            values = iter(self.get(kind))
            for name in kind:
                base = name.partition("[")[0]
                for _ in range(int(np.prod(self._of[name].shape or (1,))) if self.is_3 else 1):
                    found.setdefault(base, []).append(next(values))
        return {base: np.array(values) for base, values in found.items()}

    def close(self) -> None:
        """Terminate and free the instance."""
        self.fmu.terminate()
        self.fmu.freeInstance()


def differing(row: dict[str, NDArray[Any]], rows: Block, k: int) -> list[str]:
    """The outputs whose bits are not those of row k; truth, flight and channels are 8-byte numbers."""
    wrong = []
    for base, (field, at) in OUTPUTS.items():
        wanted = np.atleast_1d(rows[field][k][at] if at else rows[field][k])
        if row[base].astype(wanted.dtype).tobytes() != wanted.tobytes():
            wrong.append(base)
    return wrong


def flown(master: Master, rows: Block, every: int = 1) -> list[tuple[int, list[str]]]:
    """Fly with the surfaces of ``rows``; return those of each ``every``-th row that differ, with their outputs."""
    wrong = []
    for k in range(len(rows)):
        if k % every == 0 and (names := differing(master.row(), rows, k)):
            wrong.append((k, names))
        master.put(INPUTS, rows["surface"][k].tolist())
        if k < len(rows) - 1:
            master.step()
    return wrong
