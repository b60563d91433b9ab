"""Write the generated pages of docs/reference/: gallery, faults-and-signals, icd, api.

    python tests/tools/reference_pages.py

Each page is a template of tests/tools/reference/ in which ``<!-- NAME -->`` stands for a generated part. Edit the
template, or the source that a part is made from, never the page.
"""

from __future__ import annotations

import inspect
import json
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import reference_source as source
from figures import gallery as twelve
from reference_source import Documented

from rig.core.fault_names import place
from rig.core.files import bundled
from rig.core.frame import DISCRETES, SIGNALS
from rig.core.settings import read_toml
from rig.unit import header
from rig.world.faults import KINDS
from rig.world.faults.fault_catalogue import Entry, Parameter, common, entries
from rig.world.faults.fault_settings import Placed
from rig.world.faults.places import CHANNELLED

ROOT: Final = Path(__file__).parents[2]
TEMPLATES: Final = ROOT / "tests" / "tools" / "reference"
FOLDER: Final = ROOT / "docs" / "reference"
_PART: Final = re.compile(r"^<!-- (\w+) -->$", re.MULTILINE)
GROUPS: Final = {
    "One faulty channel": "f16_pitch_rate_hardover f16_angle_of_attack_drift f16_pull_up_load_factor_offset "
    "f16_pitch_rate_offset_in_manoeuvre b747_static_pressure_drift b747_gust_pitch_angle_hardover "
    "b707_pitch_angle_hardover b737_roll_rate_scale f16_lateral_load_factor_sign_reversal b747_angle_of_attack_stuck "
    "f16_normal_load_factor_oscillation b747_heading_intermittent b737_static_pressure_delay "
    "b747_dynamic_pressure_quantisation f16_stick_roll_cross_talk b737_roll_angle_duplicate_frame "
    "b747_pitch_angle_bias_instability",
    "Shorter than the persistence": "f16_roll_rate_transient b737_yaw_rate_noise f16_angle_of_attack_spikes "
    "b737_random_upsets",
    "No fault": "f16_identification_3211 f16_altitude_step_turbulence b737_turn_through_north b737_wind_shear_healthy",
    "Several faulty channels": "f16_two_pitch_rate_failures f16_pitch_rate_frame_skew "
    "f16_second_fault_at_worst_moment f16_fault_in_the_turn f16_fault_in_the_split f16_stuck_together",
    "Splits and common-mode faults": "f16_split_2_2_level f16_split_2_2_pull_up f16_split_2_2_ilm "
    "f16_split_2_2_wrong_ilm f16_split_1_1_1_1 f16_split_1_1_1 f16_split_1_1 f16_common_offset_trend "
    "f16_common_offset_reference b737_pitot_icing b747_vane_icing",
    "Sensors of a data sheet": "f16_data_sheet_gyros b747_civil_air_data",
    "Lost signals": "f16_lost_pitch_rate f16_lost_pitch_rate_no_reference f16_lost_pitch_rate_backup "
    "f16_lost_pitch_rate_turn f16_lost_pitch_rate_and_attitude f16_lost_pitch_axis f16_lost_angle_of_attack "
    "f16_lost_air_data f16_lost_attitude f16_lost_sticks b747_lost_pitch_rate b747_lost_attitude b747_lost_pitch_axis",
    "Surfaces": "b747_elevator_rate_loss b747_elevator_effectiveness_loss b737_rudder_oscillation f16_aileron_stuck "
    "f16_elevator_hardover",
    "Servo actuators": "f16_elevator_coil_hardover f16_elevator_coil_open b737_aileron_lvdt b747_rudder_sov_stuck "
    "b747_elevator_oscillatory_failure f16_elevator_spool_jam b737_rudder_leak f16_hydraulic_loss",
    "Computers": "f16_computer_stop f16_clock_drift f16_wrong_command f16_dac f16_adc f16_checksum f16_power_loss "
    "f16_software f16_four_lanes_lost f16_clocks_of_flight_44",
    "Data link between computers": "f16_link_loss f16_link_frozen f16_link_corrupt f16_link_byzantine",
    "References and inertial unit": "f16_reference_drift f16_inertial_stuck",
    "Discretes": "f16_weight_on_wheels_split f16_weight_on_wheels_wrong b737_gear_down_inverted "
    "b747_engagement_toggling",
    "Incidents": "history_qf72 history_xl888t history_afti_flight_44 history_blocked_pitot",
    "For a stock autopilot": "stock_level stock_bank stock_pitch stock_one_gyro stock_two_gyros stock_stuck "
    "stock_roll_gyro stock_split",
    "Faults of all pitch-angle sensors": "b747_pitch_sensor_half f16_pitch_sensor_ramp f16_pitch_sensor_recovers "
    "b707_pitch_sensor_half",
}
SIGNS: Final = {  # what is positive; rig/world/plant/truth.py, rig/world/plant/pilot.py
    "pitch_rate": "nose up",
    "roll_rate": "right wing down",
    "yaw_rate": "nose right",
    "normal_load_factor": "up; +1 in level flight",
    "lateral_load_factor": "right",
    "longitudinal_load_factor": "forward",
    "angle_of_attack": "flow from below",
    "angle_of_sideslip": "flow from the right",
    "static_pressure": "",
    "dynamic_pressure": "",
    "stick_pitch": "pull",
    "stick_roll": "right",
    "pedal": "right pedal",
    "pitch_angle": "nose up",
    "roll_angle": "right wing down",
    "heading": "clockwise from north",
}
SITES: Final = {
    "channel": "signals",
    "discrete": "discretes",
    "inertial": "inertial unit",
    "reference": "references",
    "surface": "surfaces",
    "actuator": "servo actuators",
    "hydraulics": "hydraulics",
    "ccdl": "data link",
    "computer": "computers",
    "bus": "electrical buses",
}
SHARED: Final = ("signal", "channels", "seen_by_ilm", "ramp_s")  # keys that several kinds have
FUNCTIONS: Final = (
    ("rig.fly", "rig/flight/fly.py", "fly"),
    ("rig.load", "rig/scenario/scenario.py", "load"),
    ("rig.fault", "rig/scenario/make_fault.py", "fault"),
    ("rig.score", "rig/bench/api.py", "score"),
    ("rig.report", "rig/show/pages/flight_page.py", "write_report"),
    ("rig.vote", "rig/bench/api.py", "vote"),
    ("rig.diagnose", "rig/bench/api.py", "diagnose"),
    ("rig.search", "rig/studies/search/plants/plant_api.py", "search"),
    ("rig.read_log", "rig/show/notebook/log.py", "read_log"),
)
_LOG: Final = "rig/log/reader.py"
CLASSES: Final = (
    ("rig.Flight", [("rig/flight/flight_result.py", "Flight"), ("rig/show/notebook/flight.py", "Flight")]),
    ("rig.Log", [(_LOG, "Log"), ("rig/show/notebook/log.py", "Log")]),
    ("rig.Scenario", [("rig/scenario/scenario.py", "Scenario")]),
    ("Scored", [("rig/verdict/of_log.py", "Scored")]),
    ("Votes", [("rig/bench/vote_run.py", "Votes")]),
    ("Diagnosis", [("rig/bench/diagnose/diagnosis.py", "Diagnosis")]),
    ("SignalDiagnosis", [("rig/bench/diagnose/findings.py", "SignalDiagnosis")]),
    ("Convention", [("rig/bench/diagnose/findings.py", "Convention")]),
    ("InFlight", [("rig/bench/diagnose/findings.py", "InFlight")]),
    ("PlantSearched", [("rig/studies/search/plants/run_plant_search.py", "PlantSearched")]),
    ("SignalArrays", [(_LOG, "SignalArrays")]),
    ("DiscreteArrays", [(_LOG, "DiscreteArrays")]),
    ("Event", [("rig/core/event.py", "Event")]),
    ("Peaks", [("rig/flight/summary.py", "Peaks")]),
    ("Suspect", [("rig/flight/suspects.py", "Suspect")]),
    ("Jitter", [("rig/flight/pace.py", "Jitter")]),
    ("StreamReport", [("rig/core/event.py", "StreamReport")]),
    ("AlignOptions", [("rig/log/recordings/alignment.py", "AlignOptions")]),
)
_CHOSEN: Final = ("vanes", "blocked", "channels")  # keys with defaults that name the place of a fault
# Members that the rig's stages use and that may change.
HIDDEN: Final = frozenset(
    {"armed", "trust", "trusted", "streams", "row_parts", "has_servos", "steps_per_frame", "read"}
)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; a ``|`` in a cell is escaped."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)


# Gallery ------------------------------------------------------------------------------------------------------


def gallery() -> str:
    """Return a table of scenarios for each group."""
    parts = []
    for title, names in GROUPS.items():
        rows = [_scenario(name) for name in names.split()]
        parts.append(f"### {title}\n\n" + table(("command", "aircraft", "scenario", "faults"), rows))
    return "\n\n".join(parts)


def _scenario(name: str) -> tuple[str, str, str, str]:
    path = bundled("faults") / f"{name}.toml"
    file = read_toml(path)
    comment = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("# "):
            break
        comment.append(line.removeprefix("# "))
    about = f"**{file['title']}.** {' '.join(comment)}"
    faults = "<br>".join(map(_fault, file.get("faults", ()))) or "none"
    return f"`rig fly {name}`", str(file.get("aircraft", "f16")), about, faults


def _fault(fault: dict[str, Any]) -> str:
    """Return a fault in a few words: kind, place, channels, onset."""
    defaults = {name: info.get_default() for name, info in KINDS[fault["kind"]].model_fields.items()}
    given = {name: value for name, value in {**defaults, **fault}.items() if name in fault or name in _CHOSEN}
    channels = ", ".join(map(str, given.get("channels", ())))
    return f"{fault['kind']}, {place(given)}{f' {channels}' if channels else ''}, {_onset(fault)}"


def _onset(fault: dict[str, Any]) -> str:
    for key, text in (("when", "on a condition"), ("on", "on a transition"), ("after", "after another fault")):
        if key in fault:
            return text
    return "at random" if "rate_per_hour" in fault else f"{fault['start_s']:g} s"


# Faults and signals -------------------------------------------------------------------------------------------


def signals() -> str:
    """Return the table of signals and discretes."""
    rows = []
    for one in SIGNALS:
        span = f"{one.low:.6g} to {one.high:.6g}{', wraps' if one.wraps else ''}"
        rows.append((f"`{one.name}`", one.symbol, one.unit, SIGNS[one.name], span, one.group, f"`{one.topic}`"))
    discretes = [(f"`{one.name}`", f"{one.fail_safe}", f"`{one.topic}`") for one in DISCRETES]
    head = ("signal", "symbol", "unit", "positive", "range", "group", "topic of the log")
    return f"{table(head, rows)}\n\n{table(('discrete', 'fail-safe value', 'topic of the log'), discretes)}"


def kinds() -> str:
    """Return the table of all kinds."""
    rows = [(f"[`{entry.kind}`](#{entry.kind})", _sites(entry), _effect(entry)) for entry in entries()]
    return table(("kind", "places", "effect"), rows)


def _sites(entry: Entry) -> str:
    return ", ".join(SITES[site] for site in entry.sites)


def _effect(entry: Entry) -> str:
    return re.split(r" Causes?: ", entry.what.splitlines()[0])[0]


def shared_keys() -> str:
    """Return the table of the keys of every kind."""
    return _keys(common())


def each_kind() -> str:
    """Return a section for each kind: effect, cause, keys, scenario."""
    return "\n\n".join(_section(entry) for entry in entries())


def _section(entry: Entry) -> str:
    docs = inspect.cleandoc(entry.what).split("\n\n")
    text = "\n\n".join(" ".join(part.split()) for part in docs)
    own = [one for one in entry.parameters if one.name not in SHARED]
    shared = [
        one.name for one in entry.parameters if one.name in SHARED and (one.name != "channels" or channelled(entry))
    ]
    parts = [f"### {entry.kind}", text, f"Places: {_sites(entry)}. Example: `rig fly {entry.scenario}`."]
    if own:
        parts.append(_keys(own))
    if shared:
        parts.append(f"Also: {', '.join(f'`{name}`' for name in shared)}.")
    return "\n\n".join(parts)


def channelled(entry: Entry) -> bool:
    """Return True if a fault of this kind may have channels."""
    model = KINDS[entry.kind]
    if not issubclass(model, Placed):
        return True
    return any(site in CHANNELLED for site in model.sites) if model.on_channels is None else model.on_channels


def placed_keys() -> str:
    """Return the table of the keys that several kinds share."""
    seen: dict[str, Parameter] = {}
    for kind in ("offset", "coil_open"):
        entry = next(one for one in entries() if one.kind == kind)
        for one in entry.parameters:
            if one.name in SHARED:
                seen.setdefault(one.name, one)
    return _keys(seen.values())


def _keys(parameters: Iterable[Parameter]) -> str:
    rows = [
        (f"`{one.name}`", one.unit, _default(one), one.allowed.replace(">=", "≥").replace("<=", "≤"), _code(one))
        for one in parameters
    ]
    return table(("key", "unit", "default", "allowed", "meaning"), rows)


def _code(parameter: Parameter) -> str:
    return re.sub(r"((?:\w+\.)?<\w+>)", r"`\1`", parameter.meaning)


def _default(parameter: Parameter) -> str:
    if parameter.required:
        return "required"
    return "" if parameter.default in (None, []) else json.dumps(parameter.default)


# API ----------------------------------------------------------------------------------------------------------


def functions() -> str:
    """Return a section for each public function."""
    return "\n\n".join(_function(source.function(path, name, shown)) for shown, path, name in FUNCTIONS)


def _function(one: Documented) -> str:
    parts = [f"### {one.name}", _prose(one.first), f"```\n{_wrapped(one.signature)}\n```"]
    head = ("parameter", "type", "default", "meaning")
    parts.append(table(head, [(f"`{r.name}`", _typed(r.type), _typed(r.default), _prose(r.meaning)) for r in one.rows]))
    parts += [_prose(" ".join(one.more))] if one.more else []
    parts += [f"**Errors.** {_prose(one.errors)}"] if one.errors else []
    return "\n\n".join(parts)


def results() -> str:
    """Return a section for each class of results."""
    return "\n\n".join(_class(source.class_of(found, shown, HIDDEN)) for shown, found in CLASSES)


def _class(one: Documented) -> str:
    parts = [f"### {one.name}", _prose(" ".join([one.first, *one.more]))]
    rows = [(f"`{r.name}`", _typed(r.type), _phrase(r.meaning)) for r in one.rows]
    parts.append(table(("field", "type", "meaning"), rows))
    if one.methods:
        parts.append(table(("method", "meaning"), [(f"`{r.name}`", _prose(r.meaning)) for r in one.methods]))
    return "\n\n".join(parts)


def _typed(text: str) -> str:
    return text if text in ("", "required") or text.startswith("array of") else f"`{text}`"


def _prose(text: str) -> str:
    return text.replace("``", "`")


def _phrase(text: str) -> str:
    """Return a meaning that begins with a small letter, unless its first word is a name."""
    named = text.partition(" ")[0].rstrip(":") in ("True", "False", "None") or not text[1:2].islower()
    return _prose(text if named else text[:1].lower() + text[1:])


def _wrapped(signature: str) -> str:
    """Return a signature, one parameter a line where it is long."""
    if len(signature) <= 100:
        return signature
    call, _, result = signature.partition(") -> ")
    name, _, arguments = call.partition("(")
    lines = ",\n    ".join(re.split(r", (?=[\w*]+(?:=|,|$))", arguments))
    return f"{name}(\n    {lines},\n) -> {result}"


# Pages --------------------------------------------------------------------------------------------------------

PARTS: Final[dict[str, Callable[[], str]]] = {
    "gallery": gallery,
    "twelve": twelve.table,
    "signals": signals,
    "kinds": kinds,
    "shared_keys": shared_keys,
    "placed_keys": placed_keys,
    "each_kind": each_kind,
    "records": header.markdown,
    "functions": functions,
    "results": results,
}
PAGES: Final = ("gallery", "faults-and-signals", "icd", "api")


def written(page: str) -> str:
    """Return a page: its template with the generated parts."""
    text = (TEMPLATES / f"{page}.md").read_text(encoding="utf-8")
    made = _PART.sub(lambda found: PARTS[found[1]]().strip("\n"), text)
    return f"<!-- Written by make reference from tests/tools/reference/{page}.md: do not edit. -->\n\n{made}"


def main() -> int:
    """Write all pages."""
    for page in PAGES:
        (FOLDER / f"{page}.md").write_text(written(page), encoding="utf-8")
    assert set(KINDS) == {entry.kind for entry in entries()}
    return 0


if __name__ == "__main__":
    sys.exit(main())
