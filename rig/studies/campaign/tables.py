"""The tables of a campaign: every column once, with its type and where its value comes from; parts as one, the hash.

runs      one row a run
faults    one row a fault and channel of a run
alarms    one row a healthy channel that was failed in a run
episodes  one row a stretch of a run in which a signal had one pattern without a majority
signals   one row a signal of a run
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple, get_args

import polars as pl

from rig.core.frame import CHANNELS, COMPUTERS, INDEX, SIGNALS
from rig.flight.summary import Peaks
from rig.flight.time_histogram import binned
from rig.log import unit_of
from rig.scenario.scenario import Scenario
from rig.studies.campaign.plan import Plan
from rig.verdict.requirements.along import plain, violated
from rig.verdict.requirements.requirement_recorder import Verdict
from rig.verdict.requirements.shown import number_of
from rig.verdict.score_records import Outcome, Score
from rig.verdict.words import PUBLIC
from rig.world.faults import Fault
from rig.world.faults.places import site

if TYPE_CHECKING:
    from rig.studies.campaign.flying import CampaignFlight

Row = dict[str, Any]
Coils = Mapping[str, Iterable[int]]  # channels by surface
Rows = dict[str, list[Row]]  # by table
OUTCOMES: Final = {outcome: outcome.replace(" ", "_") for outcome in get_args(Outcome)}  # and their columns in ``runs``
COUNTED: Final = ("failed_with_box", "failed_by_rule")  # healthy channels, for a fault elsewhere
SUSPECTS: Final = "suspect_channels"
INT, REAL, TEXT, FLAG = pl.Int64, pl.Float64, pl.String, pl.Boolean


class Source(NamedTuple):
    """What a row is made of: the run's flight and score, and what of it the row is ``of``."""

    number: int
    scenario: Scenario
    scored: Score
    of: Any = None
    flight: CampaignFlight | None = None
    verdicts: Sequence[Verdict] = ()


class Column(NamedTuple):
    """A column.

    value : of a Source, or the path of its attributes; empty where a part of the path is None
    hashed : None: only where a run has a value
    added : parts of older versions lack it; it is then empty
    """

    type: Any
    value: str | Callable[[Source], Any] = ""
    hashed: bool | None = True
    added: bool = False

    def of(self, source: Source) -> Any:
        """Return its value."""
        if callable(self.value):
            return self.value(source)
        value: Any = source
        for name in self.value.split(".") if self.value else ():
            value = None if value is None else getattr(value, name)
        return value if self.value else None


def _time(path: str) -> Column:
    """Return the column of a time, from the frame at the end of ``path``."""
    frame = Column(INT, path)
    return Column(REAL, lambda s: None if (k := frame.of(s)) is None else k * (1.0 / s.scenario.rate_hz))


def _same(where: str, **types: Any) -> dict[str, Column]:
    """Return columns that are called as in the score."""
    return {name: Column(type_, f"{where}.{name}") for name, type_ in types.items()}


def _levels(name: str, type_: Any) -> dict[str, Column]:
    return {f"{name}_level_{4 - i}": Column(type_, lambda s, i=i: getattr(s.of[1], name)[i]) for i in range(CHANNELS)}


RUNS: Final[dict[str, Column]] = {
    "run": Column(INT, "number"),
    **_same("scenario", seed=INT, aircraft=TEXT),
    "flight_point": Column(TEXT, lambda s: s.scenario.airframe.point(s.scenario.flight_point).name),
    "manager": Column(TEXT, "scenario.redundancy.manager"),
    "outcome": Column(TEXT, lambda _: "flown"),  # or crashed, timed out, failed, unit dead, unit refused
    "reason": Column(TEXT),  # of one that was not flown
    **_same("flight.verdict", digest=TEXT, frames=INT),
    "duration_s": Column(REAL, lambda s: s.flight.verdict.frames / s.scenario.rate_hz),
    "survived": Column(FLAG, "flight.verdict.survived"),
    "end_reason": Column(TEXT, "flight.end_reason"),
    **{
        peak.name: Column(REAL, lambda s, name=peak.name: _finite(s.flight.verdict.peaks, name))
        for peak in fields(Peaks)
    },
    **{
        column: Column(INT, lambda s, o=o: sum(fault.outcome == o for fault in s.scored.faults))
        for o, column in OUTCOMES.items()
    },
    "false_alarms": Column(INT, lambda s: len(s.scored.false_alarms)),
    "wrong_isolations": Column(INT, lambda s: len(s.scored.wrong_isolations)),
    "channel_hours": Column(REAL, lambda s: channel_hours(s.scenario, s.flight.verdict.frames, s.scored)),
    "vote_above_threshold_s": Column(REAL, lambda s: sum(e.above_threshold_s for e in s.scored.vote_error.values())),
    "unresolved": Column(INT, "scored.unresolved"),  # episodes
    "out_of_limits_s": Column(REAL, "scored.flight.transients.out_of_limits_s"),  # where the twin was flown
    "coverage": Column(TEXT, lambda s: _coverage(s.scored)),  # JSON
    "wall_s": Column(REAL, hashed=False),
    "replies": Column(  # reply times of a unit under test in each bin of flight/time_histogram.py
        pl.List(INT),
        lambda s: binned(s.flight.table.timing["reply_us"]).tolist() if s.flight.unit else None,
        False,
        True,
    ),
    **{  # in ``alarms``, hashed there
        name: Column(INT, lambda s, name=name: len(getattr(s.scored, name)), False, True) for name in COUNTED
    },
    SUSPECTS: Column(INT, lambda s: sum(each.lasting for each in s.scored.suspects), False, True),  # never failed
    **{  # channels of servos that were shut off; in ``digest`` too
        name: Column(INT, lambda s, i=i: (_shut_off(s) or (None, None))[i], False, True)
        for i, name in enumerate(("coils_failed", "healthy_coils_failed"))
    },
    "violated": Column(INT, lambda s: len(violated(s.verdicts)) if s.verdicts else None, None, True),  # verdicts
    "least_margin": Column(
        REAL, lambda s: min((m for v in s.verdicts if (m := number_of(v.margin)) is not None), default=None), None, True
    ),
    "requirements": Column(  # JSON: requirement, signal, status, margin (of a state +-1000), instant_s of verdicts
        TEXT, lambda s: json.dumps(_verdicts(s), sort_keys=True) if s.verdicts else None, None, True
    ),
}
FAULTS: Final[dict[str, Column]] = {
    "run": Column(INT, "number"),
    "fault": Column(INT, "of.index"),  # its place in the scenario, from 0
    **_same("of", id=TEXT, signal=TEXT, channel=INT, kind=TEXT),
    "magnitude": Column(REAL, lambda s: magnitude(s.scenario.faults[s.of.index], s.scenario)),
    **{f"{name}_s": _time(f"of.{name}_frame") for name in ("onset", "exceeded", "failed")},
    "outcome": Column(TEXT, "of.outcome"),  # detected, missed, undetectable, not executed
    **{f"{name}_s": _time(f"of.{name}_frames") for name in ("delay_from_onset", "delay_from_exceeded")},
    "isolation": Column(TEXT, lambda s: PUBLIC["campaign"][s.of.word]),  # right, wrong, none
    **_same("of", resolver=TEXT, pattern=TEXT),
    **_same("of.window", good_before=INT, latent_before=INT),
    "vote_above_threshold_s": Column(REAL, "of.window.above_threshold_s"),  # these five from its onset to the next one
    "vote_error_max": Column(REAL, "of.window.error_max"),
    "vote_kept": Column(FLAG, "of.window.kept"),
    "lost_s": Column(REAL, "of.window.lost_s"),
    "wrong_vote_first": Column(FLAG, "of.window.wrong_vote_first", added=True),  # before it was declared lost
    "law_s": _time("of.law_frame")._replace(added=True),  # the fault-tolerant law found it
}
ALARMS: Final[dict[str, Column]] = {
    "run": Column(INT, "number"),
    "kind": Column(TEXT, lambda s: s.of[0]),  # false alarm, wrong isolation, failed with its box, failed by rule
    **{n: Column(t, lambda s, n=n: getattr(s.of[1], n)) for n, t in (("signal", TEXT), ("channel", INT))},
    "time_s": Column(REAL, lambda s: s.of[1].frame * (1.0 / s.scenario.rate_hz)),
    "resolver": Column(TEXT, lambda s: s.of[1].resolver),
}
EPISODES: Final[dict[str, Column]] = {
    "run": Column(INT, "number"),
    **_same("of", signal=TEXT, pattern=TEXT),
    "begin_s": Column(REAL, lambda s: s.of.first_frame / s.scenario.rate_hz),
    "frames": Column(INT, "of.frames"),
    "asked": Column(pl.List(TEXT), lambda s: list(s.of.asked)),
    "resolver": Column(TEXT, "of.resolver"),  # whose answer stood at its end; unresolved where none did
    "failed": Column(pl.List(INT), lambda s: list(s.of.failed)),
    "verdict": Column(TEXT, "of.verdict"),  # right, wrong, open
}
OF_SIGNALS: Final[dict[str, Column]] = {
    "run": Column(INT, "number"),
    "signal": Column(TEXT, lambda s: s.of[0]),
    "vote_above_threshold_s": Column(REAL, lambda s: s.scored.vote_error[s.of[0]].above_threshold_s),
    "vote_error_max": Column(REAL, lambda s: s.scored.vote_error[s.of[0]].peak),
    "level_at_end": Column(INT, lambda s: s.of[1].level_at_end),
    "lost_s": Column(REAL, lambda s: s.of[1].lost_s),
    "unresolved_s": Column(REAL, lambda s: s.of[1].unresolved_s),
    **_levels("channel_hours", REAL),
    **_levels("false_isolations", INT),
}


class Table(NamedTuple):
    """A table: its columns, what of a score its rows are of, and their order."""

    columns: dict[str, Column]
    of: Callable[[Score], Iterable[Any]]
    order: tuple[str, ...]


OF: Final = {
    "runs": Table(RUNS, lambda scored: [scored], ("run",)),
    "faults": Table(FAULTS, lambda scored: scored.faults, ("run", "fault", "channel")),
    "alarms": Table(ALARMS, lambda scored: scored.isolations, ("run", "time_s", "signal", "channel")),
    "episodes": Table(EPISODES, lambda scored: scored.episodes, ("run", "begin_s", "signal")),
    "signals": Table(OF_SIGNALS, lambda scored: scored.signals.items(), ("run",)),
}
TABLES: Final = tuple(OF)


def rows(
    table: str, number: int, scenario: Scenario, scored: Score, flight: CampaignFlight | None = None,
    verdicts: Sequence[Verdict] = (),
) -> list[Row]:  # fmt: skip
    """Return the rows of one table of a run; ``flight``: needed for ``runs`` alone."""
    sources = [Source(number, scenario, scored, of, flight, verdicts) for of in OF[table].of(scored)]
    return [{name: column.of(source) for name, column in OF[table].columns.items()} for source in sources]


def _finite(peaks: Peaks, name: str) -> float | None:
    value = getattr(peaks, name)
    return value if math.isfinite(value) else None


def measured(verdicts: Sequence[Verdict]) -> Row:
    """Return the columns of ``runs`` that requirements have, where there are any."""
    source: Any = Source(0, *(None, None), verdicts=verdicts)  # pyright: ignore[reportArgumentType]  # not read
    return {name: column.of(source) for name, column in RUNS.items() if column.hashed is None} if verdicts else {}


def _verdicts(source: Source) -> list[Row]:
    """Return verdicts as JSON has them, each with its margin, that of a state too: to be compared with others."""
    of = lambda each: {**plain(each), "margin": each.margin if math.isfinite(each.margin) else None}  # noqa: E731
    return [{name: value for name, value in of(each).items() if name != "values"} for each in source.verdicts]


def _coverage(scored: Score) -> str:
    """Return as JSON, without the signals of which nothing but normal was seen."""
    seen = {name: asdict(c) for name, c in scored.coverage.items() if len(c.patterns) > 1 or len(c.levels) > 1}
    return json.dumps({**seen, "overall": asdict(scored.coverage["overall"])}, sort_keys=True)


def channel_hours(scenario: Scenario, frames: int, scored: Score) -> float:
    """Return the hours of fitted channels of signals without a fault: each counts until the first fault acts on it."""
    onsets: dict[tuple[str, int], int] = {}
    for fault in scored.faults:
        if fault.signal in INDEX and fault.channel is not None and fault.onset_frame is not None:
            place = fault.signal, fault.channel
            onsets[place] = min(onsets.get(place, frames), fault.onset_frame)
    channels = sum(getattr(scenario.sensors, signal.name).channels for signal in SIGNALS)
    return (channels * frames - sum(frames - onset for onset in onsets.values())) / scenario.rate_hz / 3600.0


def magnitude(fault: Fault, scenario: Scenario) -> float | None:
    """Return how large a fault is, without its sign: by its setting, of a scale its distance from 1.

    A size in thresholds is told in the unit of the signal, as any other; not that of a link, which is of all signals.
    """
    size = fault.magnitude
    if size is None or not size.thresholds or site(fault.signal) == "ccdl":
        return None if size is None else size.value
    return size.value * getattr(scenario.redundancy.signals, fault.signal.removeprefix("reference.")).threshold


def shut_off(scenario: Scenario, coils: Coils, unit_lane: str | None = None) -> tuple[int, int] | None:
    """Return how many channels of servos were shut off, and of these without a fault on them or on what they share.

    coils : as Flight.coils_failed; unit_lane : the lane that is a unit under test, whose channels are not healthy
    None: a flight without servos
    """
    if not scenario.has_servos:
        return None
    failed = [(surface, channel) for surface, channels in coils.items() for channel in channels]
    of_unit = 0 if unit_lane is None else COMPUTERS.index(unit_lane) + 1
    on = lambda fault, surface, channel: (  # noqa: E731
        fault.drives == (surface, channel)
        or (fault.signal == f"actuator.{surface}" and (not fault.channels or channel in fault.channels))
    )
    healthy = [coil for coil in failed if coil[1] != of_unit and not any(on(f, *coil) for f in scenario.faults)]
    return len(failed), len(healthy)


def _shut_off(source: Source) -> tuple[int, int] | None:
    flight = source.flight
    assert flight is not None  # of ``runs``
    return shut_off(source.scenario, flight.coils_failed, unit_of(flight.unit).get("lane"))


def varied_columns(plan: Plan) -> dict[str, Any]:
    """Return the columns of what varies: a key of the scenario or a group of cases each, typed by all their values."""
    return {key: _type(types) for key, types in plan.value_types().items() if key not in RUNS}


def _type(types: set[type]) -> Any:
    if types <= {int, float}:
        return INT if types == {int} else REAL
    return FLAG if types == {bool} else TEXT


@lru_cache(maxsize=16)
def schema(plan: Plan, table: str) -> dict[str, Any]:
    """Return column names and types of one table; ``runs`` has what varies behind its number and seed."""
    types = _types(table)
    return types if table != "runs" else {"run": INT, "seed": INT, **varied_columns(plan), **types}


def _types(table: str) -> dict[str, Any]:
    return {name: column.type for name, column in OF[table].columns.items()}


def frame(plan: Plan, table: str, rows: Sequence[Row]) -> pl.DataFrame:
    """Build a typed table of rows, what varies written beside them."""
    columns = schema(plan, table)
    if table == "runs":
        rows = [{**plan.choices[row["run"]], **row} for row in rows]
    return pl.DataFrame([{n: cell(row.get(n), kind) for n, kind in columns.items()} for row in rows], schema=columns)


def cell(value: Any, kind: Any) -> Any:
    """Convert a value of a column; one that varies may be of several kinds, and is then written as JSON."""
    as_it_is = value is None or isinstance(value, str) or kind != TEXT
    return value if as_it_is else json.dumps(value, sort_keys=True)


def joined(table: str, frames: Sequence[pl.DataFrame]) -> pl.DataFrame:
    """Join the parts of one table, in the order of the runs."""
    return (
        pl.concat(frames).sort(OF[table].order, maintain_order=True) if frames else pl.DataFrame(schema=_types(table))
    )


def sha256(tables: dict[str, pl.DataFrame]) -> str:
    """Compute one hash of all tables: sorted rows, every number exactly; what is ``hashed``."""
    digest = hashlib.sha256()
    for name in TABLES:
        columns, given = OF[name].columns, tables[name]
        gone = [n for n in given.columns if n in columns and not _is_hashed(columns[n], given[n])]
        hashed = given.drop(gone)
        digest.update(json.dumps([name, hashed.columns, [str(t) for t in hashed.dtypes]]).encode())
        for row in hashed.iter_rows():
            digest.update(json.dumps(row, allow_nan=False).encode())
    return digest.hexdigest()


def _is_hashed(column: Column, values: pl.Series) -> bool:
    return not values.is_null().all() if column.hashed is None else column.hashed
