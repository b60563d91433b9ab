"""``rig.score``, ``rig.vote`` and ``rig.diagnose``: score a flight, vote on recorded channels, find a fault in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rig.bench.diagnose.diagnose_run import diagnose_file
from rig.bench.diagnose.diagnosis import Diagnosis
from rig.bench.vote_run import Laps, Options, Votes, vote_file
from rig.bench.write_votes import output, write, write_units_beside
from rig.core.settings import build
from rig.flight.flight_result import Flight
from rig.log.recordings.alignment import AlignOptions
from rig.scenario.scenario import plain_data
from rig.unit.running_unit import running
from rig.verdict.of_log import Scored, score_log
from rig.verdict.score_records import Yardstick


def score(
    flight: Flight | Path | str,
    *,
    baseline: bool = True,
    unit: Path | str | None = None,
    allow_code: bool = False,
    **limits: float,
) -> Scored:
    """Compare the decisions of a flight with the truth in its log.

    flight : flight, or file of its log
    baseline : True also flies the fault-free baseline, for the transients
    unit : unit file of the unit under test that flew the log; not needed for a flight
    allow_code : True permits a manager class that a log names; that of a flight is always permitted
    limits : limits of a failure transient: ``load_factor`` [g], ``pitch_rate_rad_s``, ``window_s`` after an onset
    BadInput, one line: no log of a flight, no flight summary in it, an unknown key of ``limits``.
    """
    yardstick = build(Yardstick, limits, "score")
    if isinstance(flight, Flight):
        unit, allow_code = unit or flight.unit_file or None, True
    with running(unit) as tested:
        return score_log(_log(flight), yardstick, baseline, allow_code, tested)


def vote(
    recorded: Path | str,
    config: Path | str | Mapping[str, Any] | None = None,
    *,
    out: Path | str | None = None,
    preset: str | None = None,
    align: AlignOptions | bool = False,
    faults: Path | str | None = None,
    repair_time: bool = False,
    allow_code: bool = False,
) -> Votes:
    """Vote on recorded channels with the redundancy manager.

    recorded : CSV, Parquet or MCAP file, a log of PX4, ArduPilot, ROS 2 or MDF 4, or a folder of tables
    config : settings of the signals, a file or its tables; not needed for the log of a flight, or with a preset
    out : file to write the votes to: .csv, .parquet or .mcap
    preset : of a log of another system, if not the one of its format
    align : True removes constant delays and offsets, found in the first six seconds; AlignOptions: in another segment
    faults : file or bundled scenario whose faults are injected
    repair_time : True drops rows whose time does not exceed that of all earlier rows
    allow_code : True permits a manager class that ``config`` names
    BadInput, one line: names the file and the key.
    """
    asked = AlignOptions() if align is True else align or None
    options = Options(asked, None if faults is None else str(faults), repair_time, allow_code, preset=preset)
    settings = plain_data(config, "config") if isinstance(config, Mapping) else None if config is None else Path(config)
    path = Path(recorded)
    if out is None:
        return vote_file(path, settings, options, Laps())
    files = [path, settings if isinstance(settings, Path) else None, faults]
    with output(Path(out), files) as part:
        votes = vote_file(path, settings, options, Laps())
        write(part, Path(out), votes.recording, votes.voted)
    write_units_beside(Path(out), votes.voted)
    return votes


def diagnose(
    recorded: Path | str,
    config: Path | str | Mapping[str, Any] | None = None,
    *,
    preset: str | None = None,
    inject: Sequence[str] = (),
) -> Diagnosis:
    """Find out which sensor of a recording was wrong, since when, and whether the manager would have isolated it.

    recorded, config, preset : as of ``vote``
    inject : kinds of faults to try on copies of the recording: "step", "freeze", "drift", "noise", or "all"
    BadInput, one line: names the file and the key; nothing to compare.
    """
    settings = plain_data(config, "config") if isinstance(config, Mapping) else None if config is None else Path(config)
    return diagnose_file(Path(recorded), settings, preset, inject=tuple(inject))


def _log(flight: Flight | Path | str) -> Path:
    return flight.log if isinstance(flight, Flight) else Path(flight)
