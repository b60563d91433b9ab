"""When faults act: triggers, durations, repetition, pulses.

A trigger reads the truth of this frame and the votes of the last one: this frame's votes are not there yet.
A transition is seen in the frame after the one that voted it.
"""

from __future__ import annotations

from rig.faults.expression import holds
from rig.faults.record import FOREVER, Trigger
from rig.faults.settings import DutyCycle
from rig.frame import CHANNELS, D, S
from rig.kernels import kernel


@kernel
def advance(row, k, data):
    """Find out which faults act in this frame: ``acts``, ``fresh`` and ``elapsed`` of every STATE record.

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
    """The frame in which the trigger of fault i fires, FOREVER while it does not."""
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
    """Whether the fault is within its time: 1 or 0; sets ``elapsed``, and re-arms a random trigger."""
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
    """Whether a fault that acts in pulses acts now: 1 or 0."""
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
    at = keep(fcc["level"], now, 0)
    at = keep(fcc["pattern"], now, at)
    at = keep(fcc["resolver"], now, at)
    at = keep(fcc["source"], now, at)
    at = keep_states(fcc["state"], now, at)
    at = keep(fcc["discrete_voted"], now, at)
    at = keep(fcc["discrete_level"], now, at)
    keep_states(fcc["discrete_state"], now, at)
    s["frames"] += 1


@kernel
def keep(values, codes, at):
    """Copy ``values`` (n,) to ``codes`` from ``at`` on; where the next ones go."""
    for i in range(len(values)):
        codes[at + i] = values[i]
    return at + len(values)


@kernel
def keep_states(states, codes, at):
    """The same of ``states`` (n, 4)."""
    for i in range(len(states)):
        for c in range(CHANNELS):
            codes[at + i * CHANNELS + c] = states[i, c]
    return at + len(states) * CHANNELS
