"""The faults of a frame, in turn: channels and inertial unit, computers, links, references, parts of servos, surfaces.

In each the faults act one after the other in the order of the scenario: what one leaves is what the next finds.
All take the row, a FRAME record, its place k in the block, and the same FaultData.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.core.frame import FLIGHT_INDEX
from rig.core.kernels import kernel
from rig.world.faults.effects import RANDOM, Act, Acting, corrupted, flagged, freeze, keep, measured
from rig.world.faults.servo_parts import ComputerPart, Part
from rig.world.faults.trigger import advance, watch

_HALF: Final = 0.5  # between a discrete's two values
_FIRST_SURFACE: Final = FLIGHT_INDEX["elevator_rad"]  # where the surfaces truly are, in the order of SURFACES


@kernel
def corrupt(row, k, data):
    """Determine which faults act in row k, and corrupt its channels and its inertial unit.

    Writes channels, valid, ilm, the same of the discretes, inertial and acting; before, ``data.clean``, unless it
    has no rows.
    """
    bus, p, schedule, state = row["bus"], data.param[0], data.schedule, data.state
    if len(data.clean) > 0:
        save(bus, data.clean[k])
    if len(schedule) == 0:
        return
    advance(row, k, data)
    targets, kept, memory = data.targets, data.kept, data.memory
    channels, valid, ilm, inertial = bus["channels"], bus["valid"], bus["ilm"], bus["inertial"]
    for t in range(p["samples"]):
        target = targets[t]
        st = state[target["fault"]]
        if st["acts"] == 0 and target["remembers"] == 0:
            continue
        s, c = target["row"], target["column"]
        normal = data.normal[k, target["draw"]] if target["act"] in RANDOM else 0.0
        fault = Acting(target, st, kept[t], memory, p["dt_s"])
        if s < 0:
            corrupt_value(row, inertial, c, normal, fault)
        elif target["act"] == Act.PITOT_STATIC_ICE:
            freeze(channels, c, target, kept[t], st["fresh"], st["elapsed"] * p["dt_s"] if st["acts"] != 0 else -1.0)
        else:
            other, before = channels[target["source"], c], channels[s, c]
            channels[s, c] = step(row["frame"], before, other, normal, fault)
            if target["frames"] != 0:
                ilm[s, c] = measured(ilm[s, c], channels[s, c] - before, target, st, kept[t])
        if st["acts"] != 0:
            mark(row, target["fault"])
        if st["acts"] != 0 and s >= 0:
            flag = schedule[target["fault"]]["flag"]
            ilm[s, c] = flagged(ilm[s, c], flag)
            if target["act"] == Act.PITOT_STATIC_ICE:
                ilm[target["source"], c] = flagged(ilm[target["source"], c], flag)
            if target["invalid"] != 0:
                valid[s, c] = 0
    for t in range(p["samples"], p["discretes"]):
        target = targets[t]
        st = state[target["fault"]]
        if st["acts"] != 0 or target["remembers"] != 0:
            corrupt_discrete(row, Acting(target, st, kept[t], memory, p["dt_s"]), schedule[target["fault"]]["flag"])


@kernel
def corrupt_discrete(row, fault, flag):
    """Apply one fault, an Acting, to one channel of a discrete: its sample, its validity, its in-line monitor."""
    target = fault.target
    d, c = target["row"], target["column"]
    bus = row["bus"]
    samples, valid, ilm = bus["discrete_channels"], bus["discrete_valid"], bus["discrete_ilm"]
    x = float(samples[d, c])
    samples[d, c] = 1 if step(row["frame"], x, x, 0.0, fault) > _HALF else 0
    if fault.state["acts"] != 0:
        mark(row, target["fault"])
        ilm[d, c] = flagged(ilm[d, c], flag)
        if target["invalid"] != 0:
            valid[d, c] = 0


@kernel
def corrupt_reference(row, reference, k, data):
    """Corrupt a computer's references in row k, between their making and their use; where there is none, nothing acts.

    reference : (S,), in place; data : FaultData, whose kept and memory are the computer's own.  Writes acting.
    """
    p = data.param[0]
    targets, state, kept, memory = data.targets, data.state, data.kept, data.memory
    for t in range(p["discretes"], p["references"]):
        target = targets[t]
        st, c = state[target["fault"]], target["column"]
        there = reference[c] == reference[c]
        normal = data.normal[k, target["draw"]] if target["act"] in RANDOM else 0.0
        corrupt_value(row, reference, c, normal, Acting(target, st, kept[t], memory, p["dt_s"]))
        if not there:
            reference[c] = np.nan
        elif st["acts"] != 0:
            mark(row, target["fault"])


@kernel
def actuate(row, data):
    """Corrupt what reaches the actuators; keep the votes of the row for the triggers of the next.

    A fault begins where the surface truly is.  Writes surface_command and acting.
    """
    p, flight, actuator = data.param[0], row["truth"]["flight"], row["actuation"]["surface_command"]
    targets, state, kept, memory = data.targets, data.state, data.kept, data.memory
    for t in range(p["references"], p["surfaces"]):
        target = targets[t]
        st, c = state[target["fault"]], target["column"]
        if st["fresh"] != 0:
            kept[t]["last"], kept[t]["started"] = flight[_FIRST_SURFACE + c], 1
        corrupt_value(row, actuator, c, 0.0, Acting(target, st, kept[t], memory, p["dt_s"]))
        if st["acts"] != 0:
            mark(row, target["fault"])
    if p["watches"] != 0:
        watch(row["fcc"], data.seen)


@kernel
def break_parts(row, parts, whole, data):
    """Break the parts of servo actuators: (actuators, Part, channels), in this frame as in ``whole`` but for faults.

    Writes parts and acting.
    """
    for i in range(parts.shape[0]):
        for j in range(parts.shape[1]):
            for c in range(parts.shape[2]):
                parts[i, j, c] = whole[i, j, c]
    p, targets, state, kept, memory = data.param[0], data.targets, data.state, data.kept, data.memory
    for t in range(p["surfaces"], p["parts"]):
        target = targets[t]
        st, i, part, c = state[target["fault"]], target["row"], target["part"], target["column"]
        if st["acts"] == 0:
            continue
        x = parts[i, part, c]
        parts[i, part, c] = step(row["frame"], x, x, 0.0, Acting(target, st, kept[t], memory, p["dt_s"]))
        if target["uncommanded"] != 0:
            parts[i, Part.COMMANDED, c] = 0.0
        if target["seen_by_wire"] != 0:
            parts[i, Part.OPEN_SEEN, c] = 1.0
        mark(row, target["fault"])


@kernel
def break_links(row, parts, data):
    """Break the links between lanes: (LinkPart, receivers, senders), in this frame; return True if one is broken.

    Writes parts and acting.
    """
    p, targets, state, kept, memory = data.param[0], data.targets, data.state, data.kept, data.memory
    broken = False
    if p["computers"] > p["parts"]:
        parts[:] = 0.0
    for t in range(p["parts"], p["links"]):
        target = targets[t]
        st, part, receiver, sender = state[target["fault"]], target["part"], target["column"], target["row"]
        if st["acts"] == 0:
            continue
        x = parts[part, receiver, sender]
        parts[part, receiver, sender] = step(row["frame"], x, x, 0.0, Acting(target, st, kept[t], memory, p["dt_s"]))
        mark(row, target["fault"])
        broken = True
    return broken


@kernel
def break_computers(row, parts, seen, data):
    """Break the parts of computers in this frame, but what they compute and put out: that is ``corrupt_commands``.

    Writes parts (ComputerPart, lanes), seen (LaneTest, lanes), which tests see a fault, and acting.
    """
    p, targets, state, kept, memory = data.param[0], data.targets, data.state, data.kept, data.memory
    if p["computers"] == p["links"]:
        return
    parts[:], seen[:] = 0.0, 0
    parts[ComputerPart.CODE] = 1.0
    for t in range(p["links"], p["computers"]):
        target = targets[t]
        st, part, lane = state[target["fault"]], target["part"], target["row"]
        if st["acts"] == 0:
            continue
        if part not in (ComputerPart.COMMAND, ComputerPart.OUTPUT):
            x = parts[part, lane]
            parts[part, lane] = step(row["frame"], x, x, 0.0, Acting(target, st, kept[t], memory, p["dt_s"]))
        seen[target["seen_by_test"], lane] = 1
        mark(row, target["fault"])


@kernel
def corrupt_commands(row, commands, part, running, data):
    """Corrupt what the lanes command, (lanes, surfaces), where they compute it or put it out.

    part : ComputerPart;  running : (lanes,), of the others nothing changes
    """
    p, targets, state, kept, memory = data.param[0], data.targets, data.state, data.kept, data.memory
    for t in range(p["links"], p["computers"]):
        target = targets[t]
        if target["part"] != part:
            continue
        i, s = target["row"], target["column"]
        if running[i] == 0:
            continue
        fault = Acting(target, state[target["fault"]], kept[t], memory, p["dt_s"])
        commands[i, s] = step(row["frame"], commands[i, s], commands[i, s], 0.0, fault)


@kernel
def save(bus, clean):
    """Keep the samples of the sensors and of the inertial unit."""
    channels, valid, clean_channels, clean_valid = bus["channels"], bus["valid"], clean["channels"], clean["valid"]
    for s in range(channels.shape[0]):
        for c in range(channels.shape[1]):
            clean_channels[s, c], clean_valid[s, c] = channels[s, c], valid[s, c]
    inertial, clean_inertial = bus["inertial"], clean["inertial"]
    for i in range(inertial.shape[0]):
        clean_inertial[i] = inertial[i]


@kernel
def corrupt_value(row, values, i, normal, fault):
    """Apply one fault, an Acting, to value i of ``values``; normal : standard normal draw."""
    values[i] = step(row["frame"], values[i], values[fault.target["source"]], normal, fault)


@kernel
def step(frame, x, other, normal, fault):
    """Return what a fault leaves of x in this frame, whether it acts or only remembers; fault : Acting."""
    target, st, kept, y = fault.target, fault.state, fault.kept, x
    if target["remembers"] != 0:
        keep(x, frame, fault)
        if st["fresh"] != 0:
            kept["held"] = kept["last"]
    if st["acts"] != 0:
        y = corrupted(x, other, normal, frame, fault)
    if target["remembers"] != 0:
        kept["last"] = x
    return y


@kernel
def mark(row, fault):
    """Note in the row that the fault acts."""
    row["actuation"]["acting"][fault >> 3] |= np.uint8(1 << (fault & 7))
