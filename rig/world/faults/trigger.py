"""Activity of faults: triggers, durations, repetition, pulses.

A trigger reads the truth of this frame and the votes of the last one: this frame's votes are not there yet.
A transition is seen in the frame after the one that voted it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final, Literal, NamedTuple

from pydantic import Field, model_validator

from rig.core.frame import CHANNELS, DISCRETE_INDEX, INDEX, D, DecidedBy, Pattern, S, Source, State
from rig.core.kernels import kernel
from rig.core.settings import Settings
from rig.core.text import choices, quoted
from rig.world.faults.expression import holds
from rig.world.faults.fault_records import FOREVER, Trigger, code


class DutyCycle(IntEnum):
    """Activity of a fault within its time: steady, or in pulses."""

    STEADY = 0
    TIMES = 1  # at given times
    RANDOM = 2  # at random times
    CYCLE = 3  # on and off, regularly
    TELEGRAPH = 4  # on and off, at random


@dataclass(frozen=True, slots=True)
class Pulses:
    """Pulses of a fault within its time; times in seconds, means of random ones."""

    duty_cycle: DutyCycle = DutyCycle.STEADY
    on_s: float = 0.0  # 0: one frame
    off_s: float = 0.0
    times_s: Sequence[float] = ()


_OF_SIGNAL: Final = ("level", "pattern", "decided_by", "source", "state")  # keys, and fields of FRAME
_OF_DISCRETE: Final = ("level", "state")
_LABELS: Final = {pattern.label: pattern for pattern in Pattern}


_Rule = Literal[
    "none", "ilm", "trend", "reference", "extremes", "middle", "unresolved", "box", "common", "slow", "lane", "given_up"
]
_DecidedBy = Literal[_Rule, "slow_means", "slow_squares", "slow_halves"]


class Watched(NamedTuple):
    """A number of the frame, by its place among those that are watched, and the value that it must change to."""

    place: int
    value: int


class Transition(Settings):
    """A change that triggers a fault: ``{ autopilot = ... }``, or ``{ signal = ... }`` with one of the other keys.

    ``state`` is that of ``channel``; a discrete has levels and states only.
    """

    autopilot: Literal["engaged", "disengaged"] | None = None
    signal: str | None = None
    level: int | None = Field(default=None, ge=0, le=CHANNELS)
    pattern: Literal["normal", "isolated", "2:2", "1:1:1:1", "1:1:1", "1:1", "lost"] | None = None
    decided_by: _DecidedBy | None = None
    source: Literal["voted", "reference", "degraded"] | None = None
    channel: int | None = Field(default=None, ge=1, le=CHANNELS)
    state: Literal["ok", "suspect", "failed"] | None = None

    @model_validator(mode="after")
    def _one(self) -> Transition:
        given = [key for key in _OF_SIGNAL if getattr(self, key) is not None]
        if self.signal is None:
            if self.autopilot is None or given or self.channel is not None:
                raise ValueError(f"must be {{ autopilot = 'engaged' or 'disengaged' }} or {{ signal = ..., {_KEYS} }}")
            return self
        if self.autopilot is not None:
            raise ValueError("autopilot: not allowed with signal")
        if self.signal not in INDEX and self.signal not in DISCRETE_INDEX:
            accepted = choices(self.signal, (*INDEX, *DISCRETE_INDEX), "rig signals")
            raise ValueError(f"signal: unknown signal {quoted(self.signal)}, {accepted}")
        if len(given) != 1:
            raise ValueError(f"must be {{ signal = ..., {_KEYS} }}")
        if self.signal in DISCRETE_INDEX and given[0] not in _OF_DISCRETE:
            raise ValueError(f"{given[0]}: {self.signal} is a discrete, allowed: {', '.join(_OF_DISCRETE)}")
        if (self.channel is None) != (self.state is None):
            raise ValueError("channel and state: give both or none")
        return self

    @property
    def watched(self) -> Watched:
        """The number that must change, and the value to which it must."""
        if self.signal is None:
            return Watched(
                code("discrete_voted", DISCRETE_INDEX["autopilot_engaged"]), int(self.autopilot == "engaged")
            )
        key, value = next((key, getattr(self, key)) for key in _OF_SIGNAL if getattr(self, key) is not None)
        discrete = self.signal in DISCRETE_INDEX
        row = DISCRETE_INDEX[self.signal] if discrete else INDEX[self.signal]
        channel = () if self.channel is None else (self.channel - 1,)
        return Watched(code(f"discrete_{key}" if discrete else key, row, *channel), _number(key, value))


_KEYS: Final = "level or pattern or decided_by or source = ..., or channel = ..., state = ..."


def _number(key: str, value: Any) -> int:
    """Return a value as it stands in the frame."""
    if key == "pattern":
        return int(_LABELS[value])
    enums = {"decided_by": DecidedBy, "source": Source, "state": State}
    return int(enums[key][value.upper()]) if key in enums else int(value)


@kernel
def advance(row, k, data):
    """Determine which faults act in this frame: ``acts``, ``fresh`` and ``elapsed`` of every STATE record.

    row : frame k of its block; data : FaultData
    """
    frame, schedule, state = row["frame"], data.schedule, data.state
    for f in range(len(schedule)):
        i = schedule[f]["turn"]
        p, st = schedule[i], state[i]
        if st["onset"] == FOREVER and p["first"] <= frame < p["last"]:
            fired = onset(row, k, i, data)
            st["onset"] = fired if fired == FOREVER else fired + p["delay"]
        acts = lasts(frame, p, st)
        if acts != 0 and p["duty_cycle"] != DutyCycle.STEADY:
            acts = beats(k, p, st, data.times, data.uniform)
        st["fresh"] = 1 if acts != 0 and st["acts"] == 0 else 0
        st["acts"] = acts


@kernel
def onset(row, k, i, data):
    """Return the frame in which the trigger of fault i fires, FOREVER while it does not."""
    p, state, seen = data.schedule[i], data.state, data.seen
    fires = False
    trigger, frame = p["trigger"], row["frame"]
    if trigger == Trigger.CONDITION:
        true = p["needs_votes"] == 0 or seen[0]["frames"] > 0
        true = true and holds(data.program, p["begin"], p["end"], row["truth"], seen[0], data.stack) != 0
        state[i]["held"] = state[i]["held"] + 1 if true else 0
        fires = state[i]["held"] > p["hold"]
    elif trigger == Trigger.TRANSITION:
        now, before = seen[0]["code"][p["place"]], seen[0]["code_before"][p["place"]]
        fires = seen[0]["frames"] > 1 and now == p["value"] and before != now
    elif trigger == Trigger.AFTER:
        return state[p["place"]]["onset"]
    elif trigger == Trigger.RANDOM:
        fires = data.uniform[k, p["draw"]] < p["chance"]
    return frame if fires else FOREVER


@kernel
def lasts(frame, p, st):
    """Return 1 if the fault is within its time, else 0; set ``elapsed``, and re-arm a random trigger."""
    if st["onset"] > frame or frame >= p["last"]:
        return 0
    elapsed = frame - st["onset"]
    if p["period"] > 0:
        episode = min(elapsed // p["period"], p["repeats"])
        elapsed -= episode * p["period"]
    st["elapsed"] = elapsed
    if elapsed < p["duration"]:
        return 1
    if p["again"] != 0:
        st["onset"] = FOREVER
    return 0


@kernel
def beats(k, p, st, times, uniform):
    """Return 1 if a fault that acts in pulses acts now, else 0."""
    elapsed, duty_cycle = st["elapsed"], p["duty_cycle"]
    if duty_cycle == DutyCycle.CYCLE:
        return 1 if elapsed % p["cycle"] < p["on"] else 0
    if duty_cycle == DutyCycle.TIMES:
        for i in range(p["times"], p["times_end"]):
            if times[i] <= elapsed < times[i] + p["on"]:
                return 1
        return 0
    if elapsed == 0:
        st["left"] = 1 if duty_cycle == DutyCycle.TELEGRAPH else 0
        if duty_cycle == DutyCycle.TELEGRAPH:
            return 1
    drawn = uniform[k, p["pulse_draw"]]
    if duty_cycle == DutyCycle.TELEGRAPH:
        changes = drawn < (p["leave"] if st["left"] != 0 else p["enter"])
        st["left"] = 1 - st["left"] if changes else st["left"]
        return st["left"]
    if st["left"] > 0:
        st["left"] -= 1
        return 1
    st["left"] = p["on"] - 1 if drawn < p["enter"] else 0
    return 1 if drawn < p["enter"] else 0


@kernel
def watch(fcc, seen):
    """Keep this frame's votes and decisions, an FCC record, for the triggers of the next."""
    s = seen[0]
    now, before = s["code"], s["code_before"]
    for i in range(len(now)):
        before[i] = now[i]
    for i in range(S):
        s["voted"][i] = fcc["voted"][i]
    for i in range(D):
        s["discrete"][i] = fcc["discrete_voted"][i]
    end = keep(fcc["level"], now, 0)  # in the order of record.WATCHED
    end = keep(fcc["pattern"], now, end)
    end = keep(fcc["decided_by"], now, end)
    end = keep(fcc["source"], now, end)
    for i in range(S):
        end = keep(fcc["state"][i], now, end)
    end = keep(fcc["discrete_voted"], now, end)
    end = keep(fcc["discrete_level"], now, end)
    for i in range(D):
        end = keep(fcc["discrete_state"][i], now, end)
    s["frames"] += 1


@kernel
def keep(values, codes, first):
    """Copy ``values`` (n,) to ``codes`` from ``first`` on; return the place after them."""
    for i in range(len(values)):
        codes[first + i] = values[i]
    return first + len(values)
