"""``rig reliability tree``, ``cutsets``, ``fmea``, ``confirm`` and ``report``: the safety case."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from rig.cli.common import Json, comma_list, emit
from rig.cli.reliability import RatesFile, SignalName, reliability_app
from rig.cli.table import Column, line, table
from rig.cli.working import working
from rig.util.outputs import require_apart

if TYPE_CHECKING:
    from rig.safety.tree_result import TreeResult

MOST_HOURS = 1e5
_AT = (
    Column("hours", "hours", "g"),
    Column("tree", "tree", ".6g"),
    Column("chain", "chain", ".6g"),
    Column("tree differs", lambda at: f"{100 * at.differs:+.4f} %"),
    Column("direct sum of the sets", lambda at: f"{at.direct_sum:.6g} ({100 * at.sum_differs:+.2f} %)", worth=7),
)


@reliability_app.command()
def tree(
    folders: Annotated[
        list[Path],
        Argument(metavar="DIR...", help="Flown campaigns or trials of one manager.", show_default=False),
    ],
    rates: RatesFile,
    out: Annotated[Path, Option(metavar="FILE", help="The tree, Open-PSA XML.", show_default=False)],
    channels: Annotated[int, Option(metavar="N", help="Channels of the signal.", min=1, max=4)] = 4,
    hours: Annotated[str, Option(metavar="H,H...", help="Durations of a flight, h.")] = "1,10,100,1000",
    signal: SignalName = None,
    chain: Annotated[
        Path | None, Option(metavar="FILE", help="The same model as a chain, TOML.", show_default=False)
    ] = None,
    svg: Annotated[Path | None, Option(metavar="FILE", help="A picture of the tree.", show_default=False)] = None,
    as_json: Json = False,
) -> None:
    """Write the loss of a signal as a fault tree, and the same model as a chain beside it."""
    from rig.reliability.rates import read_rates
    from rig.safety.signal_chain import transitions
    from rig.safety.signal_tree import signal_tree
    from rig.safety.tree_input import read_model
    from rig.safety.tree_result import solve, write

    require_apart({"--out": out, "--chain": chain, "--svg": svg}, [*folders, rates])
    flights = comma_list(
        "--hours",
        hours,
        f"hours above 0 and at most {MOST_HOURS:g}",
        float,
        lambda h: isfinite(h) and 0 < h <= MOST_HOURS,
    )
    read = read_rates(rates)
    name, _ = read.of(signal, str(rates))
    with working("building the tree", not as_json):
        model = read_model(folders, read, name, channels, min(flights), str(rates))
        not_kept = {f"{good} good": model.next_fault(good) for good in range(channels, 0, -1)}
        result = solve(signal_tree(model), transitions(model), flights, not_kept)
    write(result, out, chain, svg)
    emit(as_json, {"out": str(out), "signal": name, "channels": channels, **result.as_dict()}, lambda: _show(result))


def _show(result: TreeResult) -> None:
    """Print both probabilities, what the tree is beside the chain, and the chances it is made of."""
    table(result.at, _AT)
    most = max((abs(each.differs) for each in result.at), default=0.0)
    line(f"static tree: {result.static}, differs from the chain by at most {100 * most:.2g} %")
    line("not kept: " + ", ".join(f"{good} {chance:.3g}" for good, chance in result.not_kept.items()))
