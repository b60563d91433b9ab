"""``rig.score``, ``rig.vote``: results of a flight or a recording."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

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
    """Score a flight, or its log, against the true values: detections, false isolations, votes and transients.

    baseline   : fly the fault-free baseline too, for the transients
    unit       : unit file of the flight software under test that flew a log; not needed for a flight
    allow_code : allow the manager class that a log names; the class of a flight is always allowed
    limits     : limits of a transient: ``load_factor`` [g], ``pitch_rate_rad_s``, ``window_s`` after an onset
    BadInput, one line: not the log of a flight, no verdict in it, an unknown key of ``limits``.
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
    align: AlignOptions | bool = False,
    faults: Path | str | None = None,
    repair_time: bool = False,
    allow_code: bool = False,
) -> Votes:
    """Vote recorded channels with the redundancy manager of the flight.

    recorded : CSV, Parquet or MCAP, or a folder of tables; config : settings of the signals, a file or its tables,
    not needed for the log of a flight; out : file for the votes, .csv, .parquet or .mcap
    align : remove constant delays and offsets of the channels; True: found in the first six seconds
    faults : a file or bundled scenario whose faults are injected; repair_time : drop rows whose time steps back
    BadInput, one line, names the file and the key.
    """
    asked = AlignOptions() if align is True else align or None
    options = Options(asked, None if faults is None else str(faults), repair_time, allow_code)
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


def _log(flight: Flight | Path | str) -> Path:
    return flight.log if isinstance(flight, Flight) else Path(flight)
