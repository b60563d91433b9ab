"""A failure mode and effects analysis (FMEA) from flights: one line for each item, mode and phase.

The lines come from the single faults of flown campaigns; a mode that no campaign flew is `not flown`, never a number.
The user gives the causes, and the severity between the measured ends, aircraft lost and within the transient limits.
The result is CSV for a spreadsheet, or one HTML page.
Sources: docs/explanation/reliability.md; IEC 60812:2018, clause 5 and MIL-STD-1629A, task 101, for the columns.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import polars as pl

from rig.core.column import Column
from rig.core.errors import BadInput
from rig.core.files import write_text
from rig.core.frame import INDEX, SIGNALS
from rig.show.pages.page import write_page
from rig.studies.campaign.folder import Folder, open_folder
from rig.studies.campaign.statistics import proportion
from rig.studies.reliability.rates_file import Rates, kind_of_fault
from rig.studies.reliability.tally import of_kinds
from rig.studies.safety.sequences import REFERENCE
from rig.world.faults import KINDS
from rig.world.faults.fault_settings import in_thresholds
from rig.world.faults.places import site

NOT_FLOWN: Final = "not flown"
ASSIGN: Final = "to be assigned"
SIZED: Final = tuple(  # kinds with a size in thresholds
    kind for kind, model in KINDS.items() if any(in_thresholds(key) in model.model_fields for key in model.sizes)
)
HIDDEN: Final = tuple(kind for kind, model in KINDS.items() if model.hidden_at_rest)
SMALL: Final = 4.0  # thresholds: up to there a size is small
PHASES: Final = ("phase", "condition", "manoeuvre")  # columns with values from flights
FUNCTIONS: Final = {
    "channel": "measures the signal for the vote",
    "reference": "settles a split of the signal",
    "discrete": "measures a state of the aircraft",
    "inertial": "measures rates and accelerations for references and standby law",
    "computer": "votes, flies the control law, commands the surfaces",
    "ccdl": "carries samples and votes between computers",
    "bus": "powers computers",
    "actuator": "moves a surface",
    "hydraulics": "powers actuators",
    "surface": "determines the aircraft's response",
}
SYSTEMS: Final = ("inertial", "computer", "ccdl", "bus", "actuator", "hydraulics")
LAYERS: Final = {
    "computer": "computers",
    "ccdl": "links",
    "bus": "power",
    "actuator": "servos",
    "hydraulics": "hydraulics",
}
ENDINGS: Final = (".csv", ".html", ".htm")
Row = dict[str, str]  # a line: its texts as printed


@dataclass(frozen=True)
class Mode:
    """A failure mode of an item in a phase, and the flights that show it; none if no campaign flew it.

    rows : a row a flight, with the columns of ``runs``, of the fault and of its signal at the end
    """

    item: str
    mode: str
    kind: str
    rates: Rates
    phase: str = NOT_FLOWN
    folder: Path = Path()
    rows: pl.DataFrame = field(default_factory=pl.DataFrame)

    @property
    def lost(self) -> int:
        """Return the number of flights that lost the aircraft."""
        return int((~self.rows["survived"]).sum())

    @property
    def beyond_s(self) -> pl.Series:
        """Return the times beyond the transient limits in flights with a fault-free baseline."""
        return self.rows["out_of_limits_s"].drop_nulls()

    @property
    def isolated(self) -> list[str]:
        """Return the isolation of each flight's fault: correct, wrong, none."""
        return self.rows["isolation"].drop_nulls().to_list()

    @property
    def latent(self) -> int:
        """Return the number of flights in which no channel was isolated."""
        return self.isolated.count("none")


def lines(folders: Sequence[Path], rates: Rates, source: str) -> list[Row]:
    """Return the lines of all items: flown modes first, then modes that were not flown.

    BadInput: a folder is damaged or not a campaign's, has no single fault, or a signal has several rates.
    """
    for name, given in rates.signals.items():
        if len(given.per_hour) > 1:
            raise BadInput(
                f"{source}: {name}.per_hour: an FMEA line needs one rate, got {len(given.per_hour)}: {given.per_hour}"
            )
    flown = [mode for path in folders for mode in _modes(open_folder(path), rates)]
    modes = sorted(flown, key=lambda mode: (INDEX.get(mode.item, len(INDEX)), mode.item, mode.mode, mode.phase))
    modes += _absent({(mode.item, mode.mode.partition(",")[0]) for mode in modes}, rates)
    made = [{column.key: column.of(mode) for column in COLUMNS} for mode in modes]
    return [{**line, "id": f"F{i:04d}"} for i, line in enumerate(made, 1)]


def _modes(folder: Folder, rates: Rates) -> Iterator[Mode]:
    """Yield the failure modes of a campaign's flights with a single fault."""
    tables = folder.tables
    faults = of_kinds(tables["faults"], tables["runs"]).filter(pl.col("outcome") != "not executed")
    single = faults.group_by("run").agg(count=pl.col("fault").n_unique()).filter(pl.col("count") == 1)
    one = faults.join(single, on="run").sort("run", "channel").group_by("run", maintain_order=True).first()
    runs = tables["runs"].filter(pl.col("outcome") == "flown")
    phase = next((name for name in PHASES if name in runs.columns), None)
    kept = ["run", "aircraft", "survived", "out_of_limits_s", *([phase] if phase else [])]
    ends = tables["signals"].select("run", "signal", "level_at_end", "lost_s")
    rows = one.drop("lost_s").join(runs.select(kept), on="run").join(ends, on=["run", "signal"], how="left")
    if rows.is_empty():
        raise BadInput(f"{folder.path}: no flight has a single fault")
    rows = rows.with_columns(phase=pl.col(phase).cast(pl.String) if phase else pl.lit("as flown"))
    rows = rows.with_columns(pl.Series("band", _bands(folder, rows), dtype=pl.String))
    for (item, kind, band, name), part in rows.group_by("signal", "kind", "band", "phase"):
        mode = f"{kind}, {band}" if band else str(kind)
        yield Mode(str(item), mode, str(kind), rates, str(name), folder.path, part.sort("run"))


def _bands(folder: Folder, rows: pl.DataFrame) -> list[str]:
    """Return the size band of every fault on a signal's channel, in thresholds of its aircraft; "" for others."""
    firsts = rows.group_by("aircraft").agg(pl.col("run").min()).iter_rows()
    of_aircraft = {name: folder.plan[run].scenario().redundancy.signals for name, run in firsts}
    columns = rows.select("aircraft", "signal", "kind", "magnitude").iter_rows()
    return [_band(magnitude, kind, of_aircraft[name], signal) for name, signal, kind, magnitude in columns]


def _band(magnitude: float | None, kind: str, settings: Any, signal: str) -> str:
    if magnitude is None or signal not in INDEX or kind not in SIZED:
        return ""
    return "small" if magnitude <= SMALL * float(getattr(settings, signal).threshold) else "large"


def _absent(flown: set[tuple[str, str]], rates: Rates) -> Iterator[Mode]:
    """Yield every item and mode that no campaign flew.

    The modes of signals are the kinds of the rates file, those of references come from the cut sets, and all others
    from the catalogue.
    """
    of_signals = sorted({kind for given in rates.signals.values() for kind in given.kinds})
    items = {signal.name: of_signals for signal in SIGNALS}
    items |= {f"reference.{signal.name}": [mode.split()[-1] for mode in REFERENCE] for signal in SIGNALS}
    items |= {where: [k for k, model in KINDS.items() if where in getattr(model, "sites", ())] for where in SYSTEMS}
    seen = flown | {(site(item), kind) for item, kind in flown}
    return (Mode(i, kind, kind, rates) for i, kinds in items.items() for kind in kinds if (i, kind) not in seen)


def _function(item: str) -> str:
    if item in INDEX:
        return f"measures {item.replace('_', ' ')} for the voter"
    return FUNCTIONS.get(item.partition(".")[0], FUNCTIONS["discrete"])


def _rate(mode: Mode) -> tuple[str, str]:
    """Return rate and source: of a signal, its share of the kind; of a computer or servo, the rate of its layer."""
    item, kind, rates = mode.item, mode.kind, mode.rates
    if item in rates.signals:
        given = rates.signals[item]
        if kind not in given.kinds:
            return "not given", "kind not in the rates file"
        text = f"{given.per_hour[0]:g} x {given.kinds[kind]:g} = {given.per_hour[0] * given.kinds[kind]:g}/h"
        return text, f"{given.source}; kinds: {given.kinds_source}"
    layer = next((layer for layer in rates.layers if layer.name == LAYERS.get(item.partition(".")[0])), None)
    return (
        ("not given", "not in the rates file") if layer is None else (f"{layer.per_hour:g}/h, all kinds", layer.source)
    )


def _exposure(mode: Mode) -> str:
    if not mode.latent:
        return "flight"
    hidden = kind_of_fault(mode.kind) in HIDDEN and mode.phase != "manoeuvre"
    return "to the next manoeuvre" if hidden else "to the check"


def _beyond(beyond_s: pl.Series) -> str:
    if beyond_s.is_empty():
        return "transients not flown"
    return f"beyond transient limits in {int((beyond_s > 0.0).sum())} of {len(beyond_s)}"


def _end(lost: int, flights: int) -> str:
    return f"aircraft lost in {lost} of {flights}" if lost else f"flight continues in {flights} of {flights}"


def _severity(mode: Mode) -> str:
    """Return a measured end, or the user's severity for the time beyond the transient limits."""
    if mode.lost:
        return "aircraft lost"
    if mode.beyond_s.is_empty():
        return ASSIGN
    longest = float(mode.beyond_s.max())  # type: ignore[arg-type]
    if longest == 0.0:
        return "within transient limits"
    exceeded = [each for each in mode.rates.severity if longest > each.beyond_limits_s]
    return sorted(exceeded, key=lambda each: each.beyond_limits_s)[-1].name if exceeded else ASSIGN


def _detection(isolated: Sequence[str]) -> str:
    wrongly = f", {isolated.count('wrong')} wrongly" if "wrong" in isolated else ""
    return f"{_share(isolated.count('correct'), len(isolated))} isolated{wrongly}"


def _not_correct(correct: pl.Series) -> str:
    return "no voted signal" if correct.is_empty() else _share(int((~correct).sum()), len(correct))


def _share(count: int, of: int) -> str:
    """Return a share with its exact interval."""
    if of == 0:
        return "not measured"
    share = proportion(count, of)
    return f"{count} of {of} ({100 * (share.low or 0.0):.3g} to {100 * (share.high or 0.0):.3g} %)"


def _times(delays: pl.Series) -> str:
    if delays.is_empty():
        return "not detected"
    return f"{delays.median():.3g} s, 95 % {delays.quantile(0.95, 'higher'):.3g} s"


def _provision(mode: Mode) -> str:
    if mode.item not in INDEX:
        return "see the documentation of rig"
    least = min(mode.rows["level_at_end"].drop_nulls().to_list(), default=0)
    return f"{least} other channels in the vote" if least else "signal lost: substitute and standby law"


def _remarks(item: str) -> str:
    if item not in INDEX or SIGNALS[INDEX[item]].group not in ("rates", "load factors"):
        return ""
    return "in-line monitor passes the channel unless seen_by_ilm; the user gives the probability of a miss"


def _most(column: pl.Series) -> str:
    values = Counter(str(value) for value in column.drop_nulls().to_list())
    return min(values, key=lambda value: (-values[value], value)) if values else "none"


def _worst(mode: Mode) -> str:
    """Return the command that flies the worst flight again: aircraft lost, or the longest time beyond the limits."""
    order = mode.rows.select(
        "run",
        "survived",
        beyond=pl.col("out_of_limits_s").fill_null(0.0),
        error=pl.col("vote_error_max").fill_null(0.0),
    ).sort("survived", "beyond", "error", "run", descending=[False, True, True, False])
    return f"rig campaign fly {mode.folder} --run {order['run'][0]}"


def _of_flights(name: str, value: Callable[[Mode], str], page: str) -> Column:
    """Return a column of values from flights."""
    return Column(name, lambda mode: NOT_FLOWN if mode.rows.is_empty() else value(mode), page=page)


_MODE, _CAUSE, _EFFECTS, _DETECTION, _FLIGHTS = "item and mode", "cause and rate", "effects", "detection", "flights"
COLUMNS: Final = (  # ``page``: the column of the page that shows some of a line's texts below each other
    *(Column("id", lambda _: "", page=_MODE), Column("item", page=_MODE)),
    *(Column("function", lambda mode: _function(mode.item), page=_MODE), Column("mode", page=_MODE)),
    Column("cause", lambda mode: mode.rates.causes.get(mode.kind, ASSIGN), page=_CAUSE),
    Column("rate", lambda mode: _rate(mode)[0], page=_CAUSE),
    *(Column("source", lambda mode: _rate(mode)[1], page=_CAUSE), Column("phase", page=_CAUSE)),
    _of_flights("exposure", _exposure, _CAUSE),
    _of_flights(
        "local effect", lambda m: f"pattern {_most(m.rows['pattern'])}, rule {_most(m.rows['decided_by'])}", _EFFECTS
    ),
    _of_flights(
        "next effect", lambda m: f"level {_most(m.rows['level_at_end'])} at the end; {_beyond(m.beyond_s)}", _EFFECTS
    ),
    _of_flights("end effect", lambda mode: _end(mode.lost, len(mode.rows)), _EFFECTS),
    Column("severity", lambda mode: ASSIGN if mode.rows.is_empty() else _severity(mode), page=_EFFECTS),
    _of_flights("detection", lambda mode: _detection(mode.isolated), _DETECTION),
    _of_flights("time to detection", lambda mode: _times(mode.rows["delay_from_onset_s"].drop_nulls()), _DETECTION),
    _of_flights("latent share", lambda mode: _share(mode.latent, len(mode.isolated)), _DETECTION),
    _of_flights("compensating provision", _provision, _DETECTION),
    Column("remarks", lambda mode: "" if mode.rows.is_empty() else _remarks(mode.item), page=_FLIGHTS),
    Column("flights", lambda mode: str(len(mode.rows)), page=_FLIGHTS),
    _of_flights("not correct", lambda mode: _not_correct(mode.rows["vote_correct"].drop_nulls()), _FLIGHTS),
    _of_flights("worst flight", _worst, _FLIGHTS),
)


def require_ending(out: Path) -> None:
    """Raise BadInput unless the name ends with .csv or .html."""
    if out.suffix.lower() not in ENDINGS:
        raise BadInput(f"--out {out}: the name must end with .csv or .html")


def write(lines: Sequence[Row], out: Path) -> None:
    """Write the lines to ``out``.  BadInput or RigError: the file cannot be written."""
    if out.suffix.lower() != ".csv":
        write_page(out, "fmea.html", {}, {}, lines=lines, shown=shown(lines), groups=groups())
        return
    text = io.StringIO()
    writer = csv.DictWriter(text, [column.key for column in COLUMNS], lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    write_text(out, text.getvalue())


def groups() -> dict[str, dict[str, str]]:
    """Return the titles of a line's texts by their names, in the columns of the page, remarks last."""
    found: dict[str, dict[str, str]] = {}
    for column in sorted(COLUMNS, key=lambda column: column.name == "remarks"):
        found.setdefault(column.page or "", {})[column.key] = column.name
    return found


def shown(lines: Sequence[Row]) -> str:
    """Return the number and share of lines that rest on flights, as a sentence."""
    flown = sum(line["flights"] != "0" for line in lines)
    share = 100 * flown / max(len(lines), 1)
    return f"{flown} of {len(lines)} lines are flown ({share:.0f} %); the others read {NOT_FLOWN!r}"
