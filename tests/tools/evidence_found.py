"""What became of a flight of tests/tools/evidence.py: by the rig's own score, or by its frames beside the truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from evidence_rows import BY_FRAMES, UNIT_OF, Table, Try
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, INDEX, SIGNALS, S, Source, State
from rig.core.units.angles import Floats, differences
from rig.core.units.constants import DENSITY_PRINTED
from rig.scenario import scenario
from rig.studies.campaign.flying import CampaignFlight, fly
from rig.verdict.monitored_places import monitor
from rig.verdict.scoring import score
from rig.world.faults import Fault

Flags = NDArray[np.bool_]
WRAPS = np.array([signal.wraps for signal in SIGNALS])


def outcome_of(one: Try) -> Table:
    """Fly it: whether it survived, which healthy channels were failed, which faulty ones were not."""
    flown = fly(scenario.load(None, one.sets))
    hours = flown.verdict.frames / flown.scenario.rate_hz / 3600.0
    found = by_frames(flown) if one.row in BY_FRAMES else by_score(flown)
    about = {"row": one.row, "about": one.about, "survived": flown.verdict.survived, "hours": hours}
    return {**about, **found, "left": left(flown)}


def by_score(flown: CampaignFlight) -> Table:
    """Return what the score says."""
    found = score(flown.scenario, flown.table)
    wrong = [f"{i.signal}.{i.channel}" for i in (*found.wrong_isolations, *found.false_alarms)]
    missed = [f"{f.signal}.{f.channel}" for f in found.faults if f.outcome == "missed"]
    return {"right": not wrong and not missed, "wrong": wrong, "missed": missed}


def left(flown: CampaignFlight) -> int:
    """Channels in use at the end, of all signals."""
    states = flown.rows["state"][-1]
    return int(np.count_nonzero((states != State.FAILED) & (states != State.ABSENT)))


def by_frames(flown: CampaignFlight) -> Table:
    """Return what the frames say.

    undeclared : signals whose vote was flown a second at a stretch more than a threshold off what healthy sensors give
    substitute : signals given up whose reference was flown so; given_up : signals without a channel at some time
    wrong, along : healthy channels that were failed; along with their whole signal, whose substitute is not off
    unit : those of a box of which most signals are faulty on that channel; missed : faulty channels that never were
    right : the aircraft survives, nothing is wrong, missed or undeclared
    """
    rows, named = flown.rows, flown.scenario.redundancy.signals
    thresholds = np.array([getattr(named, signal.name).threshold for signal in SIGNALS])
    faulty, middle = slow_faults(flown.scenario.faults), middle_of(flown.table.clean["channels"], rows["truth"])
    voted, referred = (~(np.abs(differences(rows[by], middle, WRAPS)) <= thresholds) for by in ("voted", "reference"))
    second = round(flown.scenario.rate_hz)
    undeclared = lasts(voted & (rows["source"] == Source.VOTED) & (rows["level"] > 0), second)
    substitute = lasts(referred & (rows["source"] == Source.REFERENCE), second)
    failed = rows["state"] == State.FAILED
    alone, along = healthy_failed(failed, rows["state"][0] != State.ABSENT, faulty)
    wrong, units = alone | along & substitute[:, None], of_faulty_units(faulty)
    found = {"wrong": channels(wrong & ~units), "along": channels(along & ~wrong & ~units)}
    found |= {"unit": channels((alone | along) & units), "missed": channels(faulty & ~failed.any(axis=0))}
    found |= {"undeclared": signals(undeclared), "substitute": signals(substitute)}
    found |= {"given_up": signals((rows["level"] == 0).any(axis=0))}
    right = flown.verdict.survived and not (found["wrong"] or found["missed"] or found["undeclared"])
    errors = {} if flown.scenario.faults else {"references": reference_errors(flown, middle)}
    return {"right": right, **found, "faulty": int(faulty.sum()), **errors}


def signals(flags: Flags) -> list[str]:
    """Return the names of the signals with a flag."""
    return [signal.name for signal, flag in zip(SIGNALS, flags, strict=True) if flag]


def channels(flags: Flags) -> list[str]:
    """Return signal and channel, from 1, of each flag (S, 4)."""
    return [f"{SIGNALS[s].name}.{c + 1}" for s, c in np.argwhere(flags)]


def slow_faults(faults: Sequence[Fault]) -> Flags:
    """Return (S, 4) the channels whose fault lasts, as bursts do not."""
    flags = np.zeros((S, CHANNELS), bool)
    for fault in faults:
        if fault.kind != "spikes":
            flags[INDEX[fault.signal], [c - 1 for c in fault.channels]] = True
    return flags


def of_faulty_units(faulty: Flags) -> Flags:
    """Return (S, 4) the channels in a box of which more than half of the signals are faulty."""
    flags = np.zeros_like(faulty)
    for unit in set(UNIT_OF.values()):
        mine = [INDEX[name] for name, of in UNIT_OF.items() if of == unit]
        flags[mine] = faulty[mine].mean(axis=0) > 0.5
    return flags


def healthy_failed(failed: Flags, fitted: Flags, faulty: Flags) -> tuple[Flags, Flags]:
    """Return (S, 4) the healthy channels that were failed alone, and those with their whole signal, given up.

    A signal is given up when its last channels, two or more and a faulty one among them, fail in the same frame.
    failed : (n, S, 4); fitted : (S, 4)
    """
    ever = failed.any(axis=0)
    first = np.where(ever, failed.argmax(axis=0), len(failed))
    end = np.where(fitted, first, -1).max(axis=1)
    last = fitted & (first == end[:, None])
    given_up = (end < len(failed)) & (last.sum(axis=1) > 1) & (last & faulty).any(axis=1)
    along = ever & ~faulty & last & given_up[:, None]
    return ever & ~faulty & ~along, along


def middle_of(clean: Floats, truth: Floats) -> Floats:
    """Return (n, S) the middle of the samples before any fault: sensors lag, round and err without one, too.

    clean : (n, S, 4), NaN where there is no channel; truth : (n, S)
    """
    apart = differences(clean.transpose(0, 2, 1), truth[:, None], WRAPS)
    return truth + np.nanmedian(apart, axis=1)


def lasts(flags: Flags, frames: int) -> Flags:
    """Return (S,) whether a flag (n, S) is up for so many frames in a row."""
    total = np.vstack([np.zeros((1, S), int), np.cumsum(flags, axis=0)])
    return (total[frames:] - total[:-frames] == frames).any(axis=0)


def reference_errors(flown: CampaignFlight, middle: Floats) -> dict[str, list[float]]:
    """Return for each reference its largest error, in its thresholds, and the share of frames without a usable one."""
    reference, params = flown.rows["reference"], monitor(flown.scenario)
    constant = np.broadcast_to(params["reference_threshold"], reference.shape)
    with np.errstate(invalid="ignore"):  # where there is none
        of_wind = np.sqrt(2.0 * DENSITY_PRINTED * np.maximum(reference, 0.0)) * params["reference_airspeed_m_s"]
        limit = np.where(of_wind > 0.0, np.minimum(of_wind, constant), constant)
        errors = np.abs(differences(reference, middle, WRAPS)) / limit
    unusable = (flown.rows["reference_usable"] == 0) | np.isnan(reference)
    return {
        SIGNALS[s].name: [float(np.nanmax(errors[:, s])), float(unusable[:, s].mean())]
        for s in np.flatnonzero(np.isfinite(errors).any(axis=0))
    }
