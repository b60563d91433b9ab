"""The table of names before 1.0 and present names.

The rig refuses a user's file with an old name, in one line that gives the new name, or says what stands in place of
a setting that is gone.  It reads files that it wrote itself, logs and folders of campaigns, by this table.
"""

from __future__ import annotations

import re
from typing import Any, Final

# Keys of files, each where the new key may stand.
KEYS: Final = {
    "resolvers": "tie_break",
    "singular_persistence": "split_persistence",
    "singular_persistence_s": "split_persistence_s",
    "command_singular_s": "command_split_s",
    "rivals": "baselines",
    "twin": "baseline",
    "carrier": "transport",
    "form": "role",
}
# Keys of settings that are gone, and what stands in their place.
_TESTS: Final = "slow_tests finds what it found, and smaller faults"
GONE: Final = {
    **dict.fromkeys(("outlier_threshold", "outlier_threshold_triplex"), _TESTS),
    **dict.fromkeys(
        ("equalise_bound", "equalise_s", "equalise_gain", "bias_bound", "bias_s", "bias_gain"),
        "slow_tests learns the biases of channels",
    ),
}
_OF_UNITS: Final = ("carrier", "form")  # which other files may have as names of their own
# Values of keys.
VALUES: Final = {"kind": {"link_lie": "link_byzantine"}, "says": {"lying": "wrong"}}
# Bundled files, by folder.
SCENARIOS: Final = {
    "f16_singular_2_2_lying_ilm": "f16_split_2_2_wrong_ilm",
    **{
        f"f16_singular_{name}": f"f16_split_{name}"
        for name in ("1_1", "1_1_1", "1_1_1_1", "2_2_ilm", "2_2_level", "2_2_pull_up")
    },
    "f16_stuck_twins": "f16_stuck_together",
    "f16_link_lie": "f16_link_byzantine",
}
CAMPAIGNS: Final = {"singular": "splits", "resolvers": "tie_break"}
# Quantities of a formula: what they begin with.
QUANTITIES: Final = {"twin.": "baseline."}
# Commands, and options of any.
COMMANDS: Final = {
    "rig league": "rig benchmark",
    "rig bench": "rig cost",
    "rig reliability margin": "rig reliability false-isolations",
}
OPTIONS: Final = {"--lasting": "--slow-faults", "--no-twin": "--no-baseline", "--seam": "--interface"}
# Options that are gone, and what stands in their place.
GONE_OPTIONS: Final = {"--outlier": "--slow-tests designs what finds small faults; --keep-thresholds keeps thresholds"}
# Attributes of ``rig.log.Log``.
ATTRIBUTES: Final = {"lanes": "parts"}
# Of a log: its topics, whose names columns begin with, its messages, enums, and what names of fields begin with.
TOPICS: Final = {"/demand": "/autopilot_command"}
MESSAGES: Final = {"rig.Demand": "rig.AutopilotCommand"}
ENUMS: Final = {"Resolver": "DecidedBy", "Lie": "SensorFault"}
FIELDS: Final = {
    "resolver": "decided_by",
    "command_resolver": "command_decided_by",
    "lie": "sensor_fault",
    "actuator": "surface_command",
}
# Columns of a campaign's tables and of reliability's, and what a verdict in them has.
COLUMNS: Final = {
    "resolver": "decided_by",
    "least_margin": "robustness",
    "kept": "correct",
    "known_loss": "annunciated_loss",
    "bad_vote": "undetected_error",
    "lost_aircraft_known": "lost_aircraft_annunciated",
    "lost_aircraft_bad": "lost_aircraft_undetected",
    "vote_kept": "vote_correct",
}
# Words in such columns.
CELLS: Final = {"isolation": {"right": "correct"}, "verdict": {"right": "correct"}}
VERDICT: Final = {'"margin":': '"robustness":'}
# Of a unit's records, as their layout was hashed: the name now, and the one of then.
IN_LAYOUT: Final = {
    "decided_by": "resolver",
    "DecidedBy": "Resolver",
    "tie_break": "resolvers",
    "split_persistence": "singular_persistence",
    "reserved_0": "outlier_threshold",
    "reserved_1": "outlier_threshold_triplex",
    "reserved_2": "bias_bound",
    "reserved_3": "bias_gain",
    "slow_faults": "lasting",
    "slow_faults_config": "lasting_config",
    "role": "form",
    "Role": "Form",
    "autopilot_command": "demand",
}
# Fields of those records that are 0 now: the last name before.
_RESERVED: Final = {
    "reserved_0": "outlier_threshold",
    "reserved_1": "outlier_threshold_triplex",
    "reserved_2": "equalise_bound",
    "reserved_3": "equalise_gain",
}


_FROM_LAYOUT: Final = {old: new for new, old in IN_LAYOUT.items()}
_WORD: Final = re.compile(r"\w+")


def in_layout(text: str) -> str:
    """Return a text with the present names of a unit's records replaced by the old ones."""
    return _WORD.sub(lambda word: IN_LAYOUT.get(word[0], word[0]), text)


def names_of_variable(name: str) -> tuple[str, ...]:
    """Return the names of a variable of an FMU: the present one, and those with which earlier descriptions named it."""
    return name, _WORD.sub(lambda word: _RESERVED.get(word[0], word[0]), name), in_layout(name)


def of_layout(text: str) -> str:
    """Return a text with the old names of a unit's records replaced by the present ones."""
    return _WORD.sub(lambda word: _FROM_LAYOUT.get(word[0], word[0]), text)


def now_called(old: str, new: str) -> str:
    """Return the line on an old name."""
    return f"{old} is now called {new}"


def is_gone(key: str) -> str:
    """Return the line on a setting or option that is gone, to follow its name; "" for another."""
    instead = GONE.get(key) or GONE_OPTIONS.get(key)
    return f"is gone: {instead}" if instead else ""


def field_now(name: str) -> str:
    """Return the present name of a field of an older log's message."""
    for old, new in FIELDS.items():
        if name == old or name.startswith(f"{old}_"):
            return new + name.removeprefix(old)
    return name


def key_now(key: str) -> str:
    """Return the present name of a dotted key in a file that the rig wrote: of a scenario, of a campaign."""
    return ".".join(part if part in _OF_UNITS else KEYS.get(part, part) for part in key.split("."))


def data_now(data: Any, key: str = "") -> Any:
    """Return plain data that the rig wrote, with the present names, without settings that are gone.

    key : that of the data
    """
    if isinstance(data, dict):
        return {
            key_now(str(name)): data_now(value, str(name).rpartition(".")[2])
            for name, value in data.items()
            if str(name) not in GONE
        }
    if isinstance(data, list):
        return [data_now(value, key) for value in data]
    if not isinstance(data, str):
        return data
    if key == "formula":
        return formula_now(data)
    return VALUES.get(key, {}).get(data, data)


def formula_now(text: str) -> str:
    """Return a formula that the rig stored, with the present names."""
    for old, new in QUANTITIES.items():
        text = text.replace(old, new)
    return text
