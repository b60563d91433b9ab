"""Write docs/examples/channels.csv: four recorders on one manoeuvre, 20 s at 50 Hz, healthy, always the same bytes.

    python tests/tools/example_channels.py

Pitch rate (rad/s) and normal load factor (g) of a 3-2-1-1; each channel has its bias, gain and noise.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

ROOT: Final = Path(__file__).parents[2]
FILE: Final = ROOT / "docs" / "examples" / "channels.csv"
SEED: Final = 1
ROWS: Final = 1000
RATE_HZ: Final = 50.0
SPEED_M_S: Final = 160.0
G_M_S2: Final = 9.80665
LAG_S: Final = 0.5


def truth() -> dict[str, NDArray[np.float64]]:
    """Pitch rate: a first-order response to a 3-2-1-1 of 0.1 rad/s from 2 s, and the load factor of the path."""
    time_s = np.arange(ROWS) / RATE_HZ
    wanted = np.select(
        [(a <= time_s) & (time_s < b) for a, b in ((2, 5), (5, 7), (7, 8), (8, 9))], [0.1, -0.1, 0.1, -0.1]
    )
    rate = np.zeros(ROWS)
    for k in range(1, ROWS):
        rate[k] = rate[k - 1] + (wanted[k - 1] - rate[k - 1]) / (LAG_S * RATE_HZ)
    return {"pitch_rate": rate, "normal_load_factor": 1.0 + SPEED_M_S / G_M_S2 * rate}


def recorded() -> pl.DataFrame:
    """The table of four channels for each signal."""
    draw = np.random.Generator(np.random.PCG64(SEED))
    columns = {"time_s": np.round(np.arange(ROWS) / RATE_HZ, 3)}
    for (name, values), (bias, noise) in zip(truth().items(), ((0.002, 0.002), (0.01, 0.01)), strict=True):
        for channel in range(1, 5):
            off = draw.uniform(-bias, bias) + noise * draw.standard_normal(ROWS)
            columns[f"{name}.{channel}"] = np.round(values * (1.0 + draw.uniform(-0.01, 0.01)) + off, 4)
    return pl.DataFrame(columns)


if __name__ == "__main__":
    recorded().write_csv(FILE)
    print(f"{FILE.relative_to(ROOT)}: {FILE.stat().st_size} bytes")
