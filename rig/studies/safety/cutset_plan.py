"""Campaigns that fly sequences of faults, one for each condition, each in its folder, new or resumed.

DIR/cutsets.json              the options; beside it a campaign's folder for each condition
DIR/<condition>-<gap>/        the campaign (campaign/folder.py)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from rig.core.errors import BadInput, RigError
from rig.core.frame import INDEX
from rig.core.notes import note
from rig.core.outputs import CUTSETS
from rig.core.progress import tell
from rig.core.text import choices, quoted
from rig.core.trust import Trust
from rig.scenario.scenario import Scenario
from rig.studies.campaign.campaign_file import Campaign, from_what
from rig.studies.campaign.plan import Plan, rig_identity
from rig.studies.campaign.run_campaign import Progress, Result, run
from rig.studies.campaign.study_folder import FORMAT, UNSEALED, Study
from rig.studies.campaign.tables import Rows
from rig.studies.campaign.worker import Orders, fly_alone
from rig.studies.safety.sequences import CONDITIONS, Condition, Modes, flights, sequences
from rig.verdict.monitored_places import allowed_frames, settings_of

BATCH: Final = 40
LATERAL: Final = ("roll_rate", "yaw_rate", "lateral_load_factor", "angle_of_sideslip", "stick_roll", "pedal",
                  "roll_angle", "heading")  # fmt: skip
AMPLITUDE: Final = 0.3  # of the stick, of the 3-2-1-1
_TYPES: Final = {
    **dict.fromkeys(("aircraft", "signal"), str),
    **dict.fromkeys(("order", "flights", "seed"), int),
    "conditions": list,
    "set": dict,
}
NO_CODE: Final = Trust("cutsets")


class _Cutsets(Study):
    def differences(self, was: dict[str, Any], now: dict[str, Any]) -> list[str]:
        """Return the options that differ, by the names of ``Asked``."""
        return [f"{key} was {was.get(key)}, is {value}" for key, value in now.items() if was.get(key) != value]


STUDY: Final = _Cutsets(
    mark=CUTSETS,
    folder="a folder of cut sets",
    other="other flights",
    busy="rig reliability command is flying",
    remedy="remove it, and the command that wrote it writes it again",
)


@dataclass(frozen=True, slots=True)
class Asked:
    """The options of an enumeration."""

    aircraft: str
    signal: str
    order: int
    flights: int  # of each sequence and condition
    conditions: tuple[str, ...]  # slugs
    seed: int
    set: Mapping[str, Any]

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, as in cutsets.json."""
        return {"format": FORMAT, **asdict(self), "conditions": list(self.conditions), "set": dict(self.set)}


def require(asked: Asked, source: str = "--signal") -> None:
    """Raise BadInput for an unknown signal or condition."""
    if asked.signal not in INDEX:
        raise BadInput(
            f"{source}: unknown signal {quoted(asked.signal)}, {choices(asked.signal, INDEX, 'rig signals')}"
        )
    for name in asked.conditions:
        if name not in CONDITIONS:
            raise BadInput(f"--conditions: unknown {quoted(name)}, {choices(name, CONDITIONS)}")


def plan(asked: Asked, condition: str, trust: Trust, wanted: Sequence[Modes] | None = None) -> Plan:
    """Return the campaign of a condition; ``wanted``: sequences instead of all up to the order."""
    when, source = CONDITIONS[condition], trust.source
    base, bare = _base(asked, when), _healthy(asked, when, trust)
    channels = range(1, getattr(bare[0].scenario().sensors, asked.signal).channels + 1)
    cases = [
        {
            "name": ", ".join(each),
            "vary": {"faults": flights(asked.signal, each, channels, when, asked.flights, asked.seed)},
        }
        for each in (sequences(asked.order) if wanted is None else wanted)
        if sum("reference" not in mode for mode in each) <= len(channels)
    ]
    return Plan(_campaign(asked, base, cases, when, source), source, trust)


def _healthy(asked: Asked, when: Condition, trust: Trust) -> Plan:
    """Return the flight of a condition without faults."""
    campaign = _campaign(asked, _base(asked, when), [{"name": "healthy"}], when, trust.source)
    return Plan(campaign, trust.source, trust)


def refuse_lost(asked: Asked, out: Path, trust: Trust) -> None:
    """Raise BadInput if a flight without faults loses the signal or the aircraft: every sequence would be a cut set.

    An existing folder has passed.  RigError: such a flight cannot be flown.
    """
    if STUDY.is_begun(out):
        return
    for name in asked.conditions:
        healthy = _healthy(asked, CONDITIONS[name], trust)
        orders = Orders("none", 1, "", healthy.campaign.run.timeout_s, baseline=False, rig=rig_identity())
        rows = fly_alone([healthy[0]], orders)
        run = rows["runs"][0]
        if run["outcome"] != "flown":
            raise RigError(f"{name} without faults: {run['outcome']}: {run['reason']}")
        if what := _lost_in(rows, asked.signal, healthy[0].scenario()):
            raise BadInput(f"--conditions {name}: {what} already without a fault, so no sequence can be a cut set")


def _lost_in(rows: Rows, signal: str, scenario: Scenario) -> str:
    """Return the loss in a flight without faults, "" if none; as with faults, a vote that is wrong for long is lost."""
    if not rows["runs"][0]["survived"]:
        return "the aircraft is lost"
    (row,) = (row for row in rows["signals"] if row["signal"] == signal)
    if row["lost_s"] > 0.0:
        return f"{signal} is lost for {row['lost_s']:g} s"
    off_s, allowed = row["vote_above_threshold_s"], allowed_frames(settings_of(scenario)[0][INDEX[signal]])
    return f"the voted {signal} is wrong for {off_s:g} s" if off_s * scenario.rate_hz > allowed else ""


def _base(asked: Asked, when: Condition) -> dict[str, Any]:
    pilot: dict[str, Any] = {"autopilot_engaged": False}
    if when.manoeuvre_s is not None:
        axis = "stick_roll" if asked.signal in LATERAL else "stick_pitch"
        begin, lasts = when.manoeuvre_s
        whole = {"kind": "3-2-1-1", "axis": axis, "start_s": begin, "duration_s": lasts, "amplitude": AMPLITUDE}
        pilot["manoeuvres"] = [whole]
    return {"aircraft": asked.aircraft, "duration_s": when.duration_s, "turbulence": "light", "pilot": pilot}


def _campaign(
    asked: Asked, base: dict[str, Any], cases: list[dict[str, Any]], when: Condition, source: str
) -> Campaign:
    title = f"Sequences of faults of {asked.signal}, {asked.aircraft}, {when.name}, {when.gap}"
    what = {"title": title, "base": {"title": title, **base}, "set": dict(asked.set), "sampling": "grid"}
    return from_what({**what, "seed": asked.seed, "cases": {"sequence": cases}, "run": {"batch": BATCH}}, source)


def fly(asked: Asked, out: Path, workers: int, trust: Trust = NO_CODE) -> list[Result]:
    """Fly the missing flights of every condition; an interrupted call ends the list.

    trust : which manager classes may be run
    BadInput, before anything is written: ``out`` is not of cut sets, or was made with other options.
    """
    plans = {condition: plan(asked, condition, trust) for condition in asked.conditions}
    STUDY.require(out, asked.as_dict())  # before the flights without faults
    refuse_lost(asked, out, trust)
    with STUDY.held(out, asked.as_dict()):
        return fly_all(plans, out, workers)


def fly_all(plans: Mapping[str, Plan], out: Path, workers: int) -> list[Result]:
    """Fly several campaigns in folders below ``out``, one after the other."""
    count, before, results = sum(map(len, plans.values())), 0, []
    for name, each in plans.items():

        def told(progress: Progress, before: int = before) -> None:
            tell("flights", before + progress.done, count)

        results.append(run(each, out / name, workers=workers, report=told))
        before += len(each)
        if results[-1].interrupted:
            break
    return results


def read_asked(out: Path) -> Asked:
    """Return the options of a folder of cut sets.  BadInput: it is not one, or its file is damaged."""
    if not STUDY.is_begun(out):
        raise BadInput(f"{out}: not a folder of cut sets: {CUTSETS} is missing; rig reliability cutsets makes one")
    path, about = out / CUTSETS, STUDY.read(out)
    for key, kind in _TYPES.items():
        if not isinstance(about.get(key), kind) or isinstance(about.get(key), bool):
            raise BadInput(f"{path}: is damaged: {key} is missing, or not a {kind.__name__}")
    asked = Asked(**{**{key: about[key] for key in _TYPES}, "conditions": tuple(map(str, about["conditions"]))})
    require(asked, str(path))
    if about["format"] == UNSEALED:
        note(f"{out}: written by an earlier version of rig; its files have no checksum")
    return asked
