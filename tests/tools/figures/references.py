"""Measured errors of every reference of the bundled aircraft, in units of the signals."""

from __future__ import annotations

from collections.abc import Iterator

from figures import table
from rig.computer.analytic.designed import Designed, Error
from rig.core.settings import build, read_toml
from rig.scenario import aircraft


def settles(error: Error, monitor: float) -> str:
    """Return which splits between two pairs a reference of this error settles rightly."""
    if error.threshold + error.worst < monitor:
        return "always"
    return "never wrong" if error.worst < monitor else "large ones"


def rows() -> Iterator[list[str]]:
    """Yield a row for each signal and source, a cell for each aircraft."""
    errors = {
        name: build(Designed, read_toml(aircraft.folder(name) / "references.toml"), name).errors
        for name in aircraft.names()
    }
    monitors = {name: aircraft.tables(name)["redundancy"]["signals"] for name in errors}
    first = next(iter(errors))
    for signal, sources in errors[first].items():
        thresholds = {name: monitors[name][signal]["threshold"] for name in errors}
        limits = ", ".join(f"{threshold:g}" for threshold in sorted(set(thresholds.values())))
        for source in sources:
            yield [signal, source, limits, *(_cell(errors[name][signal][source], thresholds[name]) for name in errors)]


def _cell(error: Error, monitor: float) -> str:
    numbers = (error.rms, error.quantile_999, error.worst, error.threshold)
    shown = ", ".join(f"{float(f'{number:.3g}'):g}" for number in numbers)
    return f"{shown}: {settles(error, monitor)}"


def heads() -> list[str]:
    """Return the heads of the columns."""
    return ["signal", "source", "monitor", *aircraft.names()]


def references() -> None:
    """Print each reference's errors and which 2:2 splits it settles; a cell: RMS, 99.9 %, worst, threshold."""
    table(heads(), rows())
