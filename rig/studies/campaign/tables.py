"""The tables of a campaign: every column once, with its type and the source of its value; joined parts; the hash.

runs      one row a run
faults    one row a fault and channel of a run
alarms    one row a healthy channel that was isolated in a run
episodes  one row a stretch of a run in which a signal had one split
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

from rig.core.column import Column
from rig.core.frame import CHANNELS, COMPUTERS, INDEX, SIGNALS
from rig.flight.summary import Peaks
from rig.flight.time_histogram import binned
from rig.log import unit_of
from rig.scenario.scenario import Scenario
from rig.studies.campaign.plan import Plan
from rig.verdict.requirements.along import plain, violated
from rig.verdict.requirements.requirement_recorder import Verdict
from rig.verdict.requirements.robustness import number_of
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


class Source(NamedTuple):
    """The source of a row: the run's flight and score, and the item ``of`` the row."""

    number: int
    scenario: Scenario
    scored: Score
    of: Any = None
    flight: CampaignFlight | None = None
    verdicts: Sequence[Verdict] = ()


def _named(*columns: Column) -> dict[str, Column]:
    return {column.key: column for column in columns}


def _time(name: str, path: str, **more: Any) -> Column:
    """Return the column of a time, from the frame at the end of ``path``."""
    frame = Column(name, path)
    time_s = lambda s: None if (k := frame.of(s)) is None else k * (1.0 / s.scenario.rate_hz)  # noqa: E731
    return Column(name, time_s, type=float, **more)


def _same(where: str, **types: Any) -> list[Column]:
    """Return columns with the names of the score."""
    return [Column(name, f"{where}.{name}", type=type_) for name, type_ in types.items()]


def _levels(name: str, type_: Any) -> list[Column]:
    return [
        Column(f"{name}_level_{4 - i}", lambda s, i=i: getattr(s.of[1], name)[i], type=type_) for i in range(CHANNELS)
    ]


RUNS: Final = _named(
    Column("run", "number", type=int),
    *_same("scenario", seed=int, aircraft=str),
    Column("flight_point", lambda s: s.scenario.airframe.point(s.scenario.flight_point).name, type=str),
    Column("manager", "scenario.redundancy.manager", type=str),
    Column("outcome", lambda _: "flown", type=str),  # or crashed, timed out, failed, unit dead, unit refused
    Column("reason", lambda _: None, type=str),  # of one that was not flown
    *_same("flight.verdict", digest=str, frames=int),
    Column("duration_s", lambda s: s.flight.verdict.frames / s.scenario.rate_hz, type=float),
    *(Column("survived", "flight.verdict.survived", type=bool), Column("end_reason", "flight.end_reason", type=str)),
    *(
        Column(peak.name, lambda s, name=peak.name: _finite(s.flight.verdict.peaks, name), type=float)
        for peak in fields(Peaks)
    ),
    *(
        Column(name, lambda s, o=o: sum(fault.outcome == o for fault in s.scored.faults), type=int)
        for o, name in OUTCOMES.items()
    ),
    Column("false_alarms", lambda s: len(s.scored.false_alarms), type=int, page="alarms"),
    Column("wrong_isolations", lambda s: len(s.scored.wrong_isolations), type=int, page="wrong"),
    Column("channel_hours", lambda s: channel_hours(s.scenario, s.flight.verdict.frames, s.scored), type=float),
    Column(
        "vote_above_threshold_s",
        lambda s: sum(e.above_threshold_s for e in s.scored.vote_error.values()),
        type=float,
        page="undetected error, s",
    ),
    Column("unresolved", "scored.unresolved", type=int),  # episodes
    Column("out_of_limits_s", "scored.flight.transients.out_of_limits_s", type=float),  # where the baseline was flown
    Column("coverage", lambda s: _coverage(s.scored), type=str),  # JSON
    Column("wall_s", lambda _: None, type=float, hashed=False),
    Column(  # reply times of a unit under test in each bin of flight/time_histogram.py
        "replies",
        lambda s: binned(s.flight.table.timing["reply_us"]).tolist() if s.flight.unit else None,
        type=list[int],
        hashed=False,
        added=True,
    ),
    *(  # in ``alarms``, hashed there
        Column(name, lambda s, name=name: len(getattr(s.scored, name)), type=int, hashed=False, added=True)
        for name in COUNTED
    ),
    Column(  # never failed
        SUSPECTS, lambda s: sum(each.slow_faults for each in s.scored.suspects), type=int, hashed=False, added=True
    ),
    *(  # channels of servos that were shut off; in ``digest`` too
        Column(name, lambda s, i=i: (_shut_off(s) or (None, None))[i], type=int, hashed=False, added=True)
        for i, name in enumerate(("coils_failed", "healthy_coils_failed"))
    ),
    Column(  # verdicts
        "violated", lambda s: len(violated(s.verdicts)) if s.verdicts else None, type=int, hashed=None, added=True
    ),
    Column(
        "robustness",
        lambda s: min((m for v in s.verdicts if (m := number_of(v.robustness)) is not None), default=None),
        type=float,
        hashed=None,
        added=True,
    ),
    Column(  # JSON: requirement, signal, status, robustness (of a state +-1000), instant_s of verdicts
        "requirements",
        lambda s: json.dumps(_verdicts(s), sort_keys=True) if s.verdicts else None,
        type=str,
        hashed=None,
        added=True,
    ),
)
FAULTS: Final = _named(
    Column("run", "number", type=int),
    Column("fault", "of.index", type=int),  # its place in the scenario, from 0
    *_same("of", id=str, signal=str, channel=int, kind=str),
    Column("magnitude", lambda s: magnitude(s.scenario.faults[s.of.index], s.scenario), type=float),
    *(_time(f"{name}_s", f"of.{name}_frame") for name in ("onset", "exceeded", "failed")),
    Column("outcome", "of.outcome", type=str),  # detected, missed, undetectable, not executed
    *(_time(f"{name}_s", f"of.{name}_frames") for name in ("delay_from_onset", "delay_from_exceeded")),
    Column("isolation", lambda s: PUBLIC["campaign"][s.of.word], type=str),  # correct, wrong, none
    *_same("of", decided_by=str, pattern=str),
    *_same("of.window", good_before=int, latent_before=int),
    Column("vote_above_threshold_s", "of.window.above_threshold_s", type=float),  # these five: to the next onset
    Column("vote_error_max", "of.window.error_max", type=float),
    Column("vote_correct", "of.window.correct", type=bool),
    Column("lost_s", "of.window.lost_s", type=float),
    Column("wrong_vote_first", "of.window.wrong_vote_first", type=bool, added=True),  # before it was declared lost
    _time("law_s", "of.law_frame", added=True),  # the fault-tolerant law found it
)
ALARMS: Final = _named(
    Column("run", "number", type=int),
    Column("kind", lambda s: s.of[0], type=str),  # false alarm, wrong isolation, failed with its box, failed by rule
    Column("signal", lambda s: s.of[1].signal, type=str),
    Column("channel", lambda s: s.of[1].channel, type=int),
    Column("time_s", lambda s: s.of[1].frame * (1.0 / s.scenario.rate_hz), type=float),
    Column("decided_by", lambda s: s.of[1].decided_by, type=str),
)
EPISODES: Final = _named(
    Column("run", "number", type=int),
    *_same("of", signal=str, pattern=str),
    Column("begin_s", lambda s: s.of.first_frame / s.scenario.rate_hz, type=float),
    Column("frames", "of.frames", type=int),
    Column("asked", lambda s: list(s.of.asked), type=list[str]),
    Column("decided_by", "of.decided_by", type=str),  # whose answer stood at its end; unresolved where none did
    Column("failed", lambda s: list(s.of.failed), type=list[int]),
    Column("verdict", "of.verdict", type=str),  # correct, wrong, open
)
OF_SIGNALS: Final = _named(
    Column("run", "number", type=int),
    Column("signal", lambda s: s.of[0], type=str),
    Column("vote_above_threshold_s", lambda s: s.scored.vote_error[s.of[0]].above_threshold_s, type=float),
    Column("vote_error_max", lambda s: s.scored.vote_error[s.of[0]].peak, type=float),
    Column("level_at_end", lambda s: s.of[1].level_at_end, type=int),
    Column("lost_s", lambda s: s.of[1].lost_s, type=float),
    Column("unresolved_s", lambda s: s.of[1].unresolved_s, type=float),
    *_levels("channel_hours", float),
    *_levels("false_isolations", int),
)


class Table(NamedTuple):
    """A table: its columns, the items of a score that are its rows, and their order."""

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
    """Return the columns of ``runs`` for requirements, if there are any."""
    source: Any = Source(0, *(None, None), verdicts=verdicts)  # pyright: ignore[reportArgumentType]  # not read
    return {name: column.of(source) for name, column in RUNS.items() if column.hashed is None} if verdicts else {}


def _verdicts(source: Source) -> list[Row]:
    """Return verdicts for JSON, each with its robustness, also of a state, for comparisons."""
    of = lambda each: {**plain(each), "robustness": each.robustness if math.isfinite(each.robustness) else None}  # noqa: E731
    return [{name: value for name, value in of(each).items() if name != "values"} for each in source.verdicts]


def _coverage(scored: Score) -> str:
    """Return the coverage as JSON, without the signals that were always normal."""
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
    """Return the size of a fault without its sign: its setting, or for a scale its distance from 1.

    A size in thresholds is in the unit of the signal, as any other; not for a link, which carries all signals.
    """
    size = fault.magnitude
    if size is None or not size.thresholds or site(fault.signal) == "ccdl":
        return None if size is None else size.value
    return size.value * getattr(scenario.redundancy.signals, fault.signal.removeprefix("reference.")).threshold


def shut_off(scenario: Scenario, coils: Coils, unit_lane: str | None = None) -> tuple[int, int] | None:
    """Return the number of servo channels that were shut off, and of healthy ones among them.

    A channel is healthy without a fault on it or on a shared part.
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
    """Return the varied columns: one for each key of the scenario or group of cases, typed by all its values."""
    return {key: _type(types) for key, types in plan.value_types().items() if key not in RUNS}


def _type(types: set[type]) -> Any:
    if types <= {int, float}:
        return pl.Int64 if types == {int} else pl.Float64
    return pl.Boolean if types == {bool} else pl.String


@lru_cache(maxsize=16)
def schema(plan: Plan, table: str) -> dict[str, Any]:
    """Return column names and types of one table; ``runs`` has the varied columns after number and seed."""
    types = _types(table)
    return types if table != "runs" else {"run": pl.Int64, "seed": pl.Int64, **varied_columns(plan), **types}


def _types(table: str) -> dict[str, Any]:
    return dict(pl.Schema({name: column.type for name, column in OF[table].columns.items()}))


def frame(plan: Plan, table: str, rows: Sequence[Row]) -> pl.DataFrame:
    """Build a typed table of rows, with the varied columns beside them."""
    columns = schema(plan, table)
    if table == "runs":
        rows = [{**plan.choices[row["run"]], **row} for row in rows]
    return pl.DataFrame([{n: cell(row.get(n), kind) for n, kind in columns.items()} for row in rows], schema=columns)


def cell(value: Any, kind: Any) -> Any:
    """Convert a value of a column; a varied one may have several types, and is then JSON."""
    as_it_is = value is None or isinstance(value, str) or kind != pl.String
    return value if as_it_is else json.dumps(value, sort_keys=True)


def joined(table: str, frames: Sequence[pl.DataFrame]) -> pl.DataFrame:
    """Join the parts of one table, in the order of the runs."""
    return (
        pl.concat(frames).sort(OF[table].order, maintain_order=True) if frames else pl.DataFrame(schema=_types(table))
    )


def sha256(tables: dict[str, pl.DataFrame]) -> str:
    """Return one hash of the ``hashed`` columns of all tables: sorted rows, exact numbers."""
    digest, of_row = hashlib.sha256(), json.JSONEncoder(allow_nan=False).encode
    for name in TABLES:
        columns, given = OF[name].columns, tables[name]
        unhashed = [n for n in given.columns if n in columns and not columns[n].hashed]
        hashed = given.drop(n for n in unhashed if columns[n].hashed is False or given[n].is_null().all())
        digest.update(json.dumps([name, hashed.columns, [str(t) for t in hashed.dtypes]]).encode())
        for row in hashed.iter_rows():
            digest.update(of_row(row).encode())
    return digest.hexdigest()
