"""The vote of the lanes' commands: every lane tells its own, votes all, and puts out what is voted.

Each surface is voted as a signal is, by the same manager: four commands, a threshold as a share of the stroke, and the
lanes' own tests as the only rule.  If no test failed, a tie goes to the largest group of lanes whose votes of
the signals are the same, if that is one of its sides.  Commands go round once: of three equal good ones the median is
right whatever a fourth lane tells whom.  Before they think, the lanes bring their integrators together, which has no
effect while they agree.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.lanes.computers_table import Config
from rig.computer.lanes.health import is_content, is_engaged
from rig.computer.lanes.lane_clock import insert
from rig.computer.redundancy.manager import manage_signal
from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.state import new_state
from rig.core.frame import COMPUTERS, INTEGRATED, SURFACES, DecidedBy, Ilm, LinkState, S
from rig.core.kernels import kernel
from rig.core.settings import in_frames
from rig.world.faults.servo_parts import LinkPart

_LANES: Final = len(COMPUTERS)
_SURFACES: Final = len(SURFACES)
SETTINGS: Final = np.dtype([("own", "u1"), ("equalise", "u1"), ("split_frames", "i8")], align=True)


class CommandData(NamedTuple):
    """The commands of all lanes; (4, 4) is lane by surface."""

    settings: NDArray[Any]  # (1,) SETTINGS
    params: NDArray[Any]  # (4,) PARAMS, of each surface
    state: NDArray[Any]  # (4, 4) STATE of their votes, in place
    told: NDArray[np.float64]  # (4, 4) in this frame
    before: NDArray[np.float64]  # (4, 4) in the frame before
    meant: NDArray[np.float64]  # (4, 4) what each means to put out: voted, or its own
    put: NDArray[np.float64]  # (4, 4) put out, behind the converters
    decided_by: NDArray[np.uint8]  # (4, 4) of the votes
    differs: NDArray[np.uint8]  # (4, 4) the first lane's vote has failed the commands of the second
    integral: NDArray[np.float64]  # (4, 4) integrators of each lane at the end of the last frame
    tells_integrals: NDArray[np.uint8]  # (4,) a unit under test with a control law of its own does not
    samples: NDArray[np.float64]  # (4,) workspace
    valid: NDArray[np.uint8]
    ilm: NDArray[np.uint8]


def commands(config: Config, limits: NDArray[np.float64], rate_hz: float) -> CommandData:
    """Return the vote at the first frame; limits : (4, 2) of each surface."""
    settings, params = np.zeros(1, SETTINGS), np.zeros(_SURFACES, PARAMS)
    settings["own"], settings["equalise"] = config.output == "own", config.equalise
    settings["split_frames"] = in_frames(1, config.command_split_s, rate_hz)
    for row, (low, high) in zip(params, limits, strict=True):
        stroke = high - low
        vote = SignalConfig(
            threshold=config.command_threshold * stroke,
            persistence_s=config.command_persistence_s,
            split_persistence_s=config.command_persistence_s,
            tie_break=["ilm"],
        )
        fill(row, vote, (low - 2 * stroke, high + 2 * stroke), config.count, False, rate_hz)
    square = (_LANES, _SURFACES)
    return CommandData(
        settings=settings,
        params=params,
        state=np.stack([new_state(params)] * _LANES),
        told=np.zeros(square),
        before=np.zeros(square),
        meant=np.zeros(square),
        put=np.zeros(square),
        decided_by=np.zeros(square, np.uint8),
        differs=np.zeros((_LANES, _LANES), np.uint8),
        integral=np.zeros((_LANES, len(INTEGRATED))),
        tells_integrals=np.ones(_LANES, np.uint8),
        samples=np.zeros(_LANES),
        valid=np.zeros(_LANES, np.uint8),
        ilm=np.zeros(_LANES, np.uint8),
    )


@kernel
def hears(i, j, links):
    """Return True if lane i has a message of this frame, or of the last, that lane j sent; links : LinkData."""
    if i == j:
        return True
    state = links.state[i, j]
    return links.silent[i, j] == 0 and (state == LinkState.FRESH or state == LinkState.OLD)


@kernel
def equalise(i, law, links, health, data):
    """Set the integrators of lane i to the mid value of the engaged lanes'; law : its control STATE record."""
    if data.settings[0]["equalise"] == 0:
        return
    integral, ordered = data.integral, data.samples
    for q in range(integral.shape[1]):
        n = 0
        for j in range(links.link[0]["fitted"]):
            if data.tells_integrals[j] != 0 and is_engaged(health.lane[j]) and hears(i, j, links):
                insert(ordered, n, integral[j, q])
                n += 1
        if n > 0:
            set_integral(law, q, 0.5 * (ordered[n // 2] + ordered[(n - 1) // 2]))


@kernel
def set_integral(law, q, x):
    """Set integrator q, in the order of INTEGRATED, of a control STATE record."""
    if q == 0:
        law["elevator_integral"] = x
    elif q == 1:
        law["aileron_integral"] = x
    elif q == 2:
        law["rudder_integral"] = x
    else:
        law["throttle_integral"] = x


@kernel
def keep_integrals(i, law, data):
    """Keep the integrators of lane i for the others."""
    data.integral[i, 0], data.integral[i, 1] = law["elevator_integral"], law["aileron_integral"]
    data.integral[i, 2], data.integral[i, 3] = law["rudder_integral"], law["throttle_integral"]


@kernel
def vote_commands(i, lead, fcc, links, health, data):
    """Vote all lanes' commands in lane i.

    lead : (4,) frames;  fcc : (4,) FCC of the lanes, whose votes settle what no test does
    Writes state, rule, differs and, unless each lane puts out its own, meant of that lane
    """
    fitted, threshold = links.link[0]["fitted"], data.params["threshold"]
    differs = data.differs[i]
    differs[:] = 0
    ask_lanes(fcc, health, fitted, data)
    for s in range(_SURFACES):
        for j in range(fitted):
            late = lead[i] - lead[j] > links.link[0]["window"]
            data.samples[j] = data.before[j, s] if late and i != j else data.told[j, s]
            data.samples[j] += links.parts[LinkPart.OFFSET, i, j] * threshold[s]
            data.valid[j] = is_engaged(health.lane[j]) and hears(i, j, links)
        p, st = data.params[s], data.state[i, s]
        data.decided_by[i, s] = manage_signal(data.samples, data.valid, data.ilm, np.nan, np.nan, p, st)
        for j in range(fitted):
            if data.valid[j] == 0 and is_engaged(health.lane[j]):
                st["count"][j] = 0  # what the link has not brought is no wrong command
            differs[j] |= st["failed"][j]
        if data.settings[0]["own"] == 0:
            data.meant[i, s] = st["output"]


@kernel
def ask_lanes(fcc, health, fitted, data):
    """Write the results of the lanes' own tests; if none failed, the lanes that vote the signals as most do.

    Most is the one largest group whose votes are the same: more than half of four could settle no 2:2.
    """
    ilm, content = data.ilm, True
    for j in range(fitted):
        good = is_content(health.lane[j])
        ilm[j] = Ilm.GOOD.value if good else Ilm.BAD.value
        content &= good
    if not content or all_tell_the_same(health, fitted, data):
        return
    most, like_most, same = 0, 0, data.valid
    for j in range(fitted):
        same[j] = 0
        for other in range(fitted):
            if is_engaged(health.lane[j]) and is_engaged(health.lane[other]):
                same[j] += votes_alike(fcc[j], fcc[other])
        most = max(most, same[j])
    for j in range(fitted):
        like_most += same[j] == most
    for j in range(fitted):
        if like_most == most and same[j] != most:  # else two groups are as large
            ilm[j] = Ilm.BAD.value


@kernel
def all_tell_the_same(health, fitted, data):
    """Return True if all engaged lanes command the same, bit for bit."""
    first = -1
    for j in range(fitted):
        if not is_engaged(health.lane[j]):
            continue
        first = j if first < 0 else first
        for s in range(_SURFACES):
            if data.told[j, s] != data.told[first, s]:
                return False
    return True


@kernel
def votes_alike(one, other):
    """Return True if two FCC records have the same votes of all signals; no number is no number."""
    for s in range(S):
        x, y = one["voted"][s], other["voted"][s]
        if not (x == y or (x != x and y != y)):
            return False
    return True


@kernel
def note_unresolved(health, data):
    """Count the frames in a row in which the leading lane's vote of commands is unresolved; then the back-up flies."""
    system = health.system[0]
    if system["leading"] < 0:
        return
    unresolved = False
    for s in range(_SURFACES):
        unresolved |= data.decided_by[system["leading"], s] == DecidedBy.UNRESOLVED
    system["unresolved_frames"] = system["unresolved_frames"] + 1 if unresolved else 0
    if system["unresolved_frames"] >= data.settings[0]["split_frames"]:
        system["backup"] = 1


@kernel
def agree(j, links, health, data):
    """Count the frames in a row in which lane j, which is not engaged, commands what the leading lane votes."""
    lane, leading = health.lane[j], health.system[0]["leading"]
    if is_engaged(lane):
        return
    near = leading >= 0 and lane["running"] != 0 and is_content(lane) and hears(leading, j, links)
    if near:
        for s in range(_SURFACES):
            near &= abs(data.told[j, s] - data.state[leading, s]["output"]) <= data.params[s]["threshold"]
    lane["agreed_frames"] = lane["agreed_frames"] + 1 if near else 0


@kernel
def rejoin(j, leading, data):
    """Let the votes of all lanes take in the commands of lane j again; its own vote begins as the leading lane's."""
    for s in range(_SURFACES):
        for i in range(_LANES):
            st = data.state[i, s]
            if st["failed"][j] != 0:
                st["failed"][j], st["count"][j], st["agreed"][j] = 0, 0, 0
                st["level"] += 1
        if leading >= 0 and leading != j:
            data.state[j, s] = data.state[leading, s]


@kernel
def middle_of_engaged(s, last, health, data):
    """Return the median of what the engaged lanes put out for surface s; the ``last`` one where none is."""
    n = 0
    for j in range(health.limits[0]["fitted"]):
        if is_engaged(health.lane[j]):
            insert(data.samples, n, data.put[j, s])
            n += 1
    return last if n == 0 else 0.5 * (data.samples[n // 2] + data.samples[(n - 1) // 2])
