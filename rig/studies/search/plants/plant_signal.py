"""A signal as a plant gets it: a function of time, of equal pieces."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_AT_AN_END: Final = 1e-9  # of a piece: a time that is rounded below the end of one is in the next


class Signal:
    """A signal over the duration of a simulation; before its start it has the first value, after its end the last."""

    def __init__(self, values: Any, duration_s: float, shape: str = "constant") -> None:
        """Take ``values`` of the pieces, or with the shape ``linear`` of their ends."""
        self.values: NDArray[np.float64] = np.array(values, float)
        self.duration_s, self.shape = duration_s, shape

    def __call__(self, time_s: Any) -> Any:
        """Return the value at a time, s, or the values (n,) at times (n,)."""
        if self.shape == "linear":
            ends = np.linspace(0.0, self.duration_s, len(self.values))
            found = np.interp(time_s, ends, self.values)
        else:
            place = np.asarray(time_s, float) / self.duration_s * len(self.values) + _AT_AN_END
            found = self.values[np.clip(place, 0, len(self.values) - 1).astype(int)]
        return float(found) if np.ndim(time_s) == 0 else found
