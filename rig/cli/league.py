"""``rig league``: managers at one price."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

from typer import Argument, Option

from rig.cli.common import Json, Seed, Workers, emit
from rig.cli.table import Column, line, table
from rig.cli.working import working
from rig.util.outputs import require_apart

_MANAGERS: Final = "cross-channel,cusum,glr,parity,innovation,selection,median"
_LEVELS: Final = (
    *(Column("signal", "signal"), Column("manager", "entrant")),
    Column("told", lambda row: ", ".join(f"{name} {value:.4g}" for name, value in row["shown"].items())),
    *(Column("events", "clusters", worth=7), Column("extrapolated", "extrapolation", ".3g", "times", worth=8)),
    Column("seen", "seen", worth=6),
)
_SECOND: Final = (
    *(Column("signal", "signal"), Column("manager", "entrant"), Column("false isolations", "counted")),
    *(
        Column("budget", "expected", ".2g"),
        Column("an hour, 95 %", lambda r: f"{r['low_per_h']:.2g} to {r['high_per_h']:.2g}"),
    ),
)
_OUTCOMES: Final = (
    *(Column("kind", "kind"), Column("faults", "faults"), Column("manager", "entrant")),
    *(
        Column(word, lambda row, word=word: 100 * row[word] / row["trials"], ".1f", "%")
        for word in ("isolated", "wrong channel", "missed")
    ),
    Column("before", lambda row: 100 * row["prior"] / row["trials"], ".1f", "%", worth=8),
    *(Column("delay", "delay_median_s", ".2f", "s"), Column("95 %", "delay_95_s", ".2f", "s", worth=7)),
    *(Column("vote off", "peak_median", ".2f", worth=6), Column("most", "peak_largest", ".3g", worth=5)),
)


def league(
    campaign: Annotated[
        str, Argument(metavar="FILE|NAME", help="A campaign of faults, its file or bundled name.", show_default=False)
    ],
    healthy: Annotated[
        Path, Option(metavar="HEALTHY", help="Healthy flights: a flown campaign with its logs.", show_default=False)
    ],
    out: Annotated[
        Path, Option(metavar="DIR", help="Folder of the league; a begun one is continued.", show_default=False)
    ],
    managers: Annotated[str, Option(metavar="NAME,NAME...", help="Who takes part; ours always does.")] = _MANAGERS,
    budget: Annotated[float, Option(metavar="RATE", help="False isolations an hour and signal.")] = 0.01,
    second: Annotated[
        Path | None,
        Option(metavar="HEALTHY", help="Other healthy flights, to test the budget on.", show_default=False),
    ] = None,
    trials: Annotated[int, Option(metavar="N", help="Trials of each combination.", min=1, max=10**6)] = 500,
    seed: Seed = 0,
    workers: Workers = 2,
    as_json: Json = False,
) -> None:
    """Calibrate managers to one budget of false isolations, and give all of them the same faults."""
    from rig.campaign.config import find, read
    from rig.campaign.plan import Plan
    from rig.league.entrants import entrants
    from rig.league.run import Asked, run

    plan = Plan(read(campaign, {}), str(find(campaign)))
    require_apart({"--out": out}, [healthy, second])
    asked = Asked(entrants(managers), budget, healthy, second, trials, seed)
    with working("the league", not as_json, steps=True):
        result = run(plan, asked, out, workers)
    emit(as_json, result, lambda: _show(result))


def _show(result: dict[str, Any]) -> None:
    """Print levels, the second campaign, the table by signal and state of the reference, costs, and the verdict."""
    line(f"calibrated to {result['budget_per_h']:g} false isolations an hour and signal, on {result['hours']:.3g} h")
    table(result["levels"], _LEVELS)
    for note in (note for row in result["levels"] for note in row["notes"]):
        line(f"  {note}")
    if result["second"]:
        line()
        line(f"a second campaign of {result['second'][0]['hours']:.3g} h")
        table(result["second"], _SECOND)
    for signal, state in dict.fromkeys((row["signal"], row["reference"]) for row in result["table"]):
        line()
        line(f"{signal}, reference {state}; vote error in thresholds")
        table([row for row in result["table"] if (row["signal"], row["reference"]) == (signal, state)], _OUTCOMES)
    line()
    costs = ", ".join(f"{name} {microseconds:.2g}" for name, microseconds in result["microseconds"].items())
    line(f"microseconds a signal and frame, here: {costs}")
    line()
    for sentence in result["verdict"]:
        line(sentence)
