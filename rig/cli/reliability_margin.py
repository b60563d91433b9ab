"""``rig reliability margin``: parse, call, print."""

from __future__ import annotations

from dataclasses import asdict
from math import isfinite
from typing import Annotated

import typer

from rig.cli.common import Json, emit
from rig.errors import BadInput

SCENARIO = "f16_pitch_rate_offset_in_manoeuvre"


def margin(
    signal: Annotated[str, typer.Argument(help="As in rig signals.", show_default=False)],
    threshold: Annotated[
        str | None, typer.Option(help="Thresholds, with commas, unit of the signal.", show_default="the scenario's")
    ] = None,
    target: Annotated[
        float | None, typer.Option(help="Find the threshold with so few an hour of a channel.", show_default=False)
    ] = None,
    scenario: Annotated[
        str, typer.Option(help="Aircraft, sensors, manager, flight; its faults are left out.")
    ] = SCENARIO,
    persistence: Annotated[
        int | None,
        typer.Option(help="Frames until a channel is failed.", min=1, max=100, show_default="the scenario's"),
    ] = None,
    sets: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a key; repeatable.")
    ] = None,
    flights: Annotated[int, typer.Option(help="Sets of sensor errors of a repetition.", min=50, max=10**6)] = 4000,
    seed: Annotated[int, typer.Option(help="Of all draws.", min=0, max=2**63 - 1)] = 0,
    as_json: Json = False,
) -> None:
    """Count how often healthy channels are failed, down to 1e-12 an hour, by splitting."""
    from rig.cli import show_reliability as show
    from rig.reliability.margin import FLOOR, Effort
    from rig.reliability.margin_target import run

    if target is not None and not FLOOR <= target <= 1.0:
        raise BadInput(f"--target: false isolations an hour of a channel, from {FLOOR:g} to 1, got {target:g}")
    given = None if threshold is None else _numbers(threshold)
    found, chosen = run(signal, scenario, sets or [], given, persistence, target, seed, Effort(flights=flights))
    data = {
        "signal": signal,
        "margins": [asdict(one) for one in found],
        **({} if chosen is None else {"target": target, "chosen": asdict(chosen)}),
    }
    emit(as_json, data, lambda: show.margins(signal, found, target, chosen))


def _numbers(text: str) -> list[float]:
    """Thresholds from a list with commas."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if not found or not all(isfinite(one) and one > 0.0 for one in found):
        raise BadInput(f"--threshold: numbers above 0 with commas between, got {text}")
    return found
