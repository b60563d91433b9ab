"""A failure mode and effects analysis whose lines are measured: one an item, mode and phase, with its flights.

Lines are of the single faults of flown campaigns; what no campaign flew is `not flown`, never a number.  Cause and
severity between the two measured ends, aircraft lost and within the transient limits, are the user's.
Sources: docs/safety.md; IEC 60812:2018, clause 5 and MIL-STD-1629A, task 101, for the columns.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import polars as pl

from rig.core.errors import BadInput
from rig.core.frame import INDEX, SIGNALS
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
PHASES: Final = ("phase", "condition", "manoeuvre")  # columns that may say what was flown
FUNCTIONS: Final = {
    "channel": "measures the signal for the vote",
    "reference": "second opinion on the signal without a majority",
    "discrete": "tells a state of the aircraft",
    "inertial": "measures rates and accelerations for references and back-up",
    "computer": "votes, flies the control law, commands the surfaces",
    "ccdl": "carries samples and votes between computers",
    "bus": "powers computers",
    "actuator": "moves a surface",
    "hydraulics": "powers actuators",
    "surface": "makes the aircraft answer",
}
SYSTEMS: Final = ("inertial", "computer", "ccdl", "bus", "actuator", "hydraulics")
LAYERS: Final = {
    "computer": "computers",
    "ccdl": "links",
    "bus": "power",
    "actuator": "servos",
    "hydraulics": "hydraulics",
}


@dataclass(frozen=True, slots=True)
class Line:
    """One line; texts as they are printed, in the order of the columns."""

    id: str
    item: str
    function: str
    mode: str
    cause: str
    rate: str
    source: str
    phase: str
    exposure: str
    local_effect: str
    next_effect: str
    end_effect: str
    severity: str
    detection: str
    time_to_detection: str
    latent_share: str
    compensating_provision: str
    remarks: str
    flights: str
    not_kept: str
    worst_flight: str

    def as_dict(self) -> dict[str, str]:
        """Return the columns by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def lines(folders: Sequence[Path], rates: Rates, source: str) -> list[Line]:
    """Return the lines of all items: what was flown first, then what was not.

    BadInput: a folder is damaged or foreign, no single fault was flown in it, several rates for one signal.
    """
    for name, given in rates.signals.items():
        if len(given.per_hour) > 1:
            raise BadInput(
                f"{source}: {name}.per_hour: a line has one rate, got {len(given.per_hour)}: {given.per_hour}"
            )
    groups = [group for path in folders for group in _groups(open_folder(path))]
    made = [
        _flown(group, rates)
        for group in sorted(groups, key=lambda group: (_place(group.item), group.mode, group.phase))
    ]
    made += list(_absent({(line.item, line.mode.partition(",")[0]) for line in made}, rates))
    return [_numbered(i, line) for i, line in enumerate(made, 1)]


def _numbered(number: int, line: Line) -> Line:
    values = {**line.as_dict(), "id": f"F{number:04d}"}
    return Line(**values)


def _place(item: str) -> tuple[int, str]:
    return INDEX.get(item, len(INDEX)), item


@dataclass(frozen=True)
class _Group:
    """Flights of one line: a row each, with the columns of ``runs``, of the fault and of its signal at the end."""

    folder: Path
    item: str
    mode: str
    kind: str
    phase: str
    rows: pl.DataFrame


def _groups(folder: Folder) -> Iterator[_Group]:
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
        raise BadInput(f"{folder.path}: no flight of it has a single fault")
    rows = rows.with_columns(phase=pl.col(phase).cast(pl.String) if phase else pl.lit("as flown"))
    rows = rows.with_columns(pl.Series("band", _bands(folder, rows), dtype=pl.String))
    for (item, kind, band, name), part in rows.group_by("signal", "kind", "band", "phase"):
        mode = f"{kind}, {band}" if band else str(kind)
        yield _Group(folder.path, str(item), mode, str(kind), str(name), part.sort("run"))


def _bands(folder: Folder, rows: pl.DataFrame) -> list[str]:
    """Return the size band of every fault on a channel of a signal, in thresholds of its aircraft; "" for others."""
    firsts = rows.group_by("aircraft").agg(pl.col("run").min()).iter_rows()
    of_aircraft = {name: folder.plan[run].scenario().redundancy.signals for name, run in firsts}
    columns = rows.select("aircraft", "signal", "kind", "magnitude").iter_rows()
    return [_band(magnitude, kind, of_aircraft[name], signal) for name, signal, kind, magnitude in columns]


def _band(magnitude: float | None, kind: str, settings: Any, signal: str) -> str:
    if magnitude is None or signal not in INDEX or kind not in SIZED:
        return ""
    return "small" if magnitude <= SMALL * float(getattr(settings, signal).threshold) else "large"


def _flown(group: _Group, rates: Rates) -> Line:
    rows, n = group.rows, len(group.rows)
    lost = int((~rows["survived"]).sum())
    not_kept = rows["vote_kept"].drop_nulls()
    beyond = rows["out_of_limits_s"].drop_nulls()
    detected = rows["isolation"].drop_nulls().to_list()
    latent = sum(word == "none" for word in detected)
    levels = rows["level_at_end"].drop_nulls().to_list()
    rate, source = _rate(group.item, group.kind, rates)
    return Line(
        id="",
        item=group.item,
        function=_function(group.item),
        mode=group.mode,
        cause=_cause(group, rates),
        rate=rate,
        source=source,
        phase=group.phase,
        exposure=_exposure(group, latent),
        local_effect=f"pattern {_most(rows['pattern'])}, resolver {_most(rows['resolver'])}",
        next_effect=f"level {_most(rows['level_at_end'])} at the end; {_beyond(beyond)}",
        end_effect=f"aircraft lost in {lost} of {n}" if lost else f"flight goes on in {n} of {n}",
        severity=_severity(lost, beyond, rates),
        detection=f"{_share(sum(word == 'right' for word in detected), len(detected))} isolated"
        + (f", {sum(word == 'wrong' for word in detected)} wrongly" if "wrong" in detected else ""),
        time_to_detection=_times(rows["delay_from_onset_s"].drop_nulls()),
        latent_share=_share(latent, len(detected)),
        compensating_provision=_provision(group.item, levels),
        remarks=_remarks(group.item),
        flights=str(n),
        not_kept=_share(int((~not_kept).sum()), len(not_kept)) if len(not_kept) else "no vote of a signal",
        worst_flight=_worst(group),
    )


def _function(item: str) -> str:
    if item in INDEX:
        return f"measures {item.replace('_', ' ')} for the vote"
    return FUNCTIONS.get(item.partition(".")[0], FUNCTIONS["discrete"])


def _cause(group: _Group, rates: Rates) -> str:
    return rates.causes.get(group.kind, ASSIGN)


def _rate(item: str, kind: str, rates: Rates) -> tuple[str, str]:
    """Return rate and source; of a signal its share of the kind, of a computer or servo its layer's, undivided."""
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


def _exposure(group: _Group, latent: int) -> str:
    if not latent:
        return "flight"
    hidden = kind_of_fault(group.kind) in HIDDEN and group.phase != "manoeuvre"
    return "to the next manoeuvre" if hidden else "to the check"


def _beyond(beyond: pl.Series) -> str:
    if beyond.is_empty():
        return "transients not flown"
    over = int((beyond > 0.0).sum())
    return f"beyond transient limits in {over} of {len(beyond)}"


def _severity(lost: int, beyond: pl.Series, rates: Rates) -> str:
    """Return a measured end, or the user's word for the time beyond the transient limits."""
    if lost:
        return "aircraft lost"
    if beyond.is_empty():
        return ASSIGN
    longest = float(beyond.max())  # type: ignore[arg-type]
    if longest == 0.0:
        return "within transient limits"
    words = [
        each.name
        for each in sorted(rates.severity, key=lambda each: each.beyond_limits_s)
        if longest > each.beyond_limits_s
    ]
    return words[-1] if words else ASSIGN


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


def _provision(item: str, levels: Sequence[int]) -> str:
    if item not in INDEX:
        return "see its page of the rig"
    least = min(levels, default=0)
    return f"{least} other channels voted" if least else "signal lost: substitute and back-up law"


def _remarks(item: str) -> str:
    if item not in INDEX or SIGNALS[INDEX[item]].group not in ("rates", "load factors"):
        return ""
    return "in-line monitor says good unless seen_by_ilm: its miss is the user's probability"


def _most(column: pl.Series) -> str:
    values = Counter(str(value) for value in column.drop_nulls().to_list())
    return min(values, key=lambda value: (-values[value], value)) if values else "none"


def _worst(group: _Group) -> str:
    """Return the command that flies the worst flight again: lost first, then the longest beyond the limits."""
    order = group.rows.select(
        "run",
        "survived",
        beyond=pl.col("out_of_limits_s").fill_null(0.0),
        error=pl.col("vote_error_max").fill_null(0.0),
    ).sort("survived", "beyond", "error", "run", descending=[False, True, True, False])
    return f"rig campaign fly {group.folder} --run {order['run'][0]}"


def _absent(flown: set[tuple[str, str]], rates: Rates) -> Iterator[Line]:
    """Yield a line for every item and mode that no campaign flew.

    Modes: of signals the kinds of the rates file, of references those of cut sets, of all else the catalogue's.
    """
    of_signals = sorted({kind for given in rates.signals.values() for kind in given.kinds})
    items = {signal.name: of_signals for signal in SIGNALS}
    items |= {f"reference.{signal.name}": [mode.split()[-1] for mode in REFERENCE] for signal in SIGNALS}
    items |= {where: [k for k, model in KINDS.items() if where in getattr(model, "sites", ())] for where in SYSTEMS}
    seen = flown | {(site(item), kind) for item, kind in flown}
    return (_unflown(item, kind, rates) for item, kinds in items.items() for kind in kinds if (item, kind) not in seen)


def _unflown(item: str, kind: str, rates: Rates) -> Line:
    nothing = dict.fromkeys((field.name for field in fields(Line)), NOT_FLOWN)
    rate, source = _rate(item, kind, rates)
    said = {"item": item, "function": _function(item), "mode": kind, "rate": rate, "source": source, "flights": "0"}
    return Line(**{**nothing, **said, "cause": rates.causes.get(kind, ASSIGN), "severity": ASSIGN, "remarks": ""})
