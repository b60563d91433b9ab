"""The records of unit_records.py as text, by one walk over their fields: C, Ada and tables (``rig unit header``)."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Final

from rig.computer.redundancy.manager_params import PARAM_FIELDS
from rig.core.frame import AUTOPILOT_COMMANDS, CHANNELS, DISCRETES, INERTIAL, SIGNALS, SURFACES, D, S
from rig.core.frame.fields import FIELD
from rig.unit.unit_records import ANSWERS, ENUMS, FROM_UNIT, LAYOUT, RECORDS, TO_UNIT, VERSION, Entry, members, walk

_TYPES: Final = {  # in C and in Ada
    "<f8": ("double", "IEEE_Float_64"),
    "<i8": ("int64_t", "Integer_64"),
    "<u8": ("uint64_t", "Unsigned_64"),
    "<u4": ("uint32_t", "Unsigned_32"),
    "<u2": ("uint16_t", "Unsigned_16"),
    "|u1": ("uint8_t", "Unsigned_8"),
}
_COMMENTS: Final = {
    "hello": "HELLO and END",
    "ready": "READY and REFUSED, with the name of the unit or the reason of a refusal",
    "signal_config": "monitoring and voting of one signal; counts in frames",
    "discrete_config": "monitoring and voting of one discrete; counts in frames",
    "slow_faults_config": "slow-fault rules of a signal: limits and durations; 0 switches a rule off",
    "rules_config": "rules of splits and counts, and relations of a signal to others",
    "slow_tests_config": "slow-fault tests of a signal; all 0: none",
    "config": "configuration of a flight",
    "config_part": "a part of config, if one message must fit into an Ethernet frame",
    "input": "one frame to the unit: SI units, angles in rad, load factors in g, sticks -1 to 1",
    "law_input": "one frame to a unit of the role CONTROL_LAW: what the rig has voted",
    "output": "one frame from the unit",
}
_MEANINGS: Final = {
    "magic": "RIGI to the unit, RIGO from the unit",
    "version": "version of the interface",
    "kind": "kind of the message, of Kind",
    "layout": "hash of all names, types, places and enums",
    "session": "number that the rig draws for each flight; the unit echoes it",
    "frame": "number of the frame, from 0; the unit echoes it",
    "time_s": "frame / rate, the only clock of the unit",
    "stepped": "number of frames that the unit has stepped, to detect lost requests; 0: not counted",
    "said": "filled groups, as bits",
    "status": "status of the unit, of Status; the answer is not flown in POWER_UP and SELF_TEST",
    "fault_word": "defined by the unit; 0: no fault",
    "output_discretes": "defined by the unit; logged",
    "age_us": "microseconds between the sample and the frame; 0 here",
    "length": "number of bytes before this field",
    "crc": "CRC-32 of these bytes (IEEE 802.3, as in zlib), or 0",
    "reference": "reference of each signal, from the last votes; NaN: none",
    "second_reference": "second reference, from other physics; NaN: none",
    "law": "control law of the frame; EXTERNAL",
    "text": "UTF-8, ends with NUL: name of the unit, or the reason",
    # CONFIG
    "rate_hz": "frames per second",
    "role": "role of the unit, of Role",
    "box_signals": "signals of a box on which a channel deviates before its isolation on all; -1: over half; 0: never",
    "box_persistence": "consecutive frames of that",
    "trim_surface": "rad, throttle 0 to 1: positions in the first frame; index of a surface",
    "surface_low": "rad, throttle 0 to 1: smallest positions",
    "surface_high": "rad, throttle 0 to 1: largest positions",
    "signal": "index of a signal",
    "slow_faults": "index of a signal",
    "rules": "index of a signal",
    "slow_tests": "index of a signal",
    "discrete": "index of a discrete",
    "aircraft": "name of the aircraft, ends with NUL",
    "flight_point": "name of the flight point, ends with NUL",
    "part": "number of the part, from 0",
    "parts": "number of parts",
    "bytes": "bytes of config from part times 1024 on; zero after its end",
    **{each.name: each.meaning for each in PARAM_FIELDS},
    "fail_safe": "0 or 1: voted value without a majority",
    # INPUT
    "autopilot_command": "the pilot's commands; index of an autopilot command",
    "channels": "samples by signal and channel, in the unit of the signal",
    "inertial": "measurements of the inertial unit; index of a quantity",
    "valid": "1: the sensor does not flag the sample",
    "ilm": "in-line monitor, of Ilm",
    "discrete_channels": "0 or 1, by discrete and channel; any other number is 1",
    "discrete_valid": "as valid, for discretes",
    "discrete_ilm": "as ilm, for discretes",
    "reset": "by signal: channels to readmit, bit 0 is channel 1",
    "discrete_reset": "by discrete: channels to readmit, bit 0 is channel 1",
}
_READ_BY_LAW: Final = {
    "voted": "voted value of each signal; NaN: never voted",
    "level": "channels in use by signal; 0: the signal is lost",
    "reference_usable": "1: the manager vouches for the reference of the signal",
    "discrete_voted": "voted value of each discrete, 0 or 1",
    "discrete_level": "channels in use by discrete; 0: the discrete is lost",
}
_OPENING: Final = """\
/* The records between the rig and a unit under test.
 *
 * Written by `rig unit header`: do not edit; write it again when the records change.
 * Little-endian, IEEE 754, naturally aligned.
 *
 * A library exports three functions; 0 is success:
 *
 *     int rig_unit_open(const struct rig_config *config);
 *     int rig_unit_step(const struct rig_input *input, struct rig_output *output);
 *     void rig_unit_close(void);
 *
 * open after close starts a new session.  The rig calls step once per frame, with an output that is zero except for
 * its head.  step fills groups of the output, and names them in `output->said`.
 *
 * A unit of the role CONTROL_LAW has another function in the place of rig_unit_step:
 *
 *     int rig_unit_law(const struct rig_law_input *input, struct rig_output *output);
 */
#ifndef RIG_UNIT_H
#define RIG_UNIT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#define RIG_ASSERT(condition) static_assert(condition, #condition)
#else
#define RIG_ASSERT(condition) _Static_assert(condition, #condition)
#endif
"""
_CLOSING: Final = """\
/* The records for which a library was built: the rig reads this before it calls a function. */
#if defined(__GNUC__)
extern __attribute__((weak, visibility("default"))) const uint64_t rig_unit_layout;
const uint64_t rig_unit_layout = RIG_UNIT_LAYOUT;
#endif

int rig_unit_open(const struct rig_config *config);
int rig_unit_step(const struct rig_input *input, struct rig_output *output);
int rig_unit_law(const struct rig_law_input *input, struct rig_output *output);
void rig_unit_close(void);

#ifdef __cplusplus
}
#endif
#endif
"""


# C -----------------------------------------------------------------------------------------------------------


def header() -> str:
    """Return the text of ``rig_unit.h``."""
    lists = {"SIGNAL": _names(SIGNALS), "DISCRETE": _names(DISCRETES)}
    lists |= {"AUTOPILOT_COMMAND": list(AUTOPILOT_COMMANDS), "SURFACE": list(SURFACES), "INERTIAL": list(INERTIAL)}
    enums = [_enum(_snake(enum), "", ((member.name, member.value) for member in members(enum))) for enum in ENUMS]
    enums += [_enum(name, "_index", ((text, i) for i, text in enumerate(names))) for name, names in lists.items()]
    return "\n".join([_OPENING, _constants(), *enums, *map(_struct, RECORDS), _CLOSING])


def _names(declared: Iterable[Any]) -> list[str]:
    return [item.name for item in declared]


def _constants() -> str:
    values = {
        "RIG_UNIT_VERSION": VERSION,
        "RIG_UNIT_LAYOUT": f"UINT64_C(0x{LAYOUT:016x})",
        "RIG_MAGIC_INPUT": f"UINT32_C(0x{TO_UNIT:08x})",
        "RIG_MAGIC_OUTPUT": f"UINT32_C(0x{FROM_UNIT:08x})",
        "RIG_CHANNELS": CHANNELS,
        "RIG_SIGNALS": S,
        "RIG_DISCRETES": D,
    }
    return "".join(f"#define {name} {value}\n" for name, value in values.items())


def _snake(enum: type[Any]) -> str:
    """Return the name of an enum in C and Ada: ``decided_by`` for DecidedBy."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", enum.__name__).lower()


def _enum(name: str, suffix: str, members: Iterable[tuple[str | None, int]]) -> str:
    lines = "".join(f"    RIG_{name.upper()}_{str(text).upper()} = {value},\n" for text, value in members)
    return f"enum rig_{name.lower()}{suffix} {{\n{lines}}};\n"


def _struct(name: str) -> str:
    """Return the declaration of a record, and assertions on its layout."""
    fields = list(walk(RECORDS[name]))
    members = "".join(f"    {_member(field)}\n" for field in fields)
    offsets = "".join(f"RIG_ASSERT(offsetof(struct rig_{name}, {field.name}) == {field.offset});\n" for field in fields)
    size = f"RIG_ASSERT(sizeof(struct rig_{name}) == {RECORDS[name].itemsize});\n"
    return f"/* {_COMMENTS[name]} */\nstruct rig_{name} {{\n{members}}};\n\n{size}{offsets}"


def _member(field: Entry) -> str:
    if field.base.kind == "S":
        return f"char {field.name}[{field.base.itemsize}];"
    kind = f"struct rig_{field.record}" if field.record else _TYPES[field.base.str][0]
    return f"{kind} {field.name}{_extent(field)};"


def _extent(field: Entry) -> str:
    return "".join(f"[{count}]" for count in field.shape)


# Ada ---------------------------------------------------------------------------------------------------------


def ada() -> str:
    """Return the text of ``rig_unit.ads``.

    Enums are numbers instead of Ada enumerations, so that an invalid byte raises no exception.
    """
    arrays = sorted({_ada_element(field) for dtype in RECORDS.values() for field in walk(dtype)})
    arrays = [(element, shape) for element, shape in arrays if shape]
    value = "   {}_{} : constant Unsigned_8 := {};".format
    enums = [[*(value(_ada_name(_snake(e)), str(m.name).capitalize(), m.value) for m in members(e)), ""] for e in ENUMS]
    lines = [
        "--  The records between the rig and a unit under test, written by 'rig unit header --ada': do not edit.",
        "--  Little-endian, IEEE 754, naturally aligned.",
        "with Interfaces; use Interfaces;",
        "with System;",
        "",
        "package Rig_Unit is",
        f"   Version      : constant := {VERSION};",
        f"   Layout       : constant Unsigned_64 := 16#{LAYOUT:016X}#;",
        f"   Magic_Input  : constant Unsigned_32 := 16#{TO_UNIT:08X}#;",
        f"   Magic_Output : constant Unsigned_32 := 16#{FROM_UNIT:08X}#;",
        "",
        *(line for enum in enums for line in enum),
        *(_ada_array(*array) for array in arrays if not array[0].startswith("Rig_")),  # others follow their element
        "",
        *(line for name in RECORDS for line in _ada_record(name, arrays)),
        "end Rig_Unit;",
    ]
    return "\n".join(lines) + "\n"


def _ada_record(name: str, arrays: list[tuple[str, tuple[int, ...]]]) -> list[str]:
    fields, title = list(walk(RECORDS[name])), _ada_name(f"rig_{name}")
    return [
        f"   --  {_COMMENTS[name]}",
        f"   type {title} is record",
        *(f"      {_ada_name(field.name)} : {_ada_type(*_ada_element(field))};" for field in fields),
        "   end record;",
        f"   for {title}'Bit_Order use System.Low_Order_First;",
        f"   for {title} use record",
        *(f"      {_ada_name(field.name)} at {field.offset} range 0 .. {field.size * 8 - 1};" for field in fields),
        "   end record;",
        f"   for {title}'Size use {RECORDS[name].itemsize * 8};",
        *(_ada_array(*array) for array in arrays if array[0] == title),
        "",
    ]


def _ada_array(element: str, shape: tuple[int, ...]) -> str:
    spans = ", ".join(f"0 .. {count - 1}" for count in shape)
    return f"   type {_ada_type(element, shape)} is array ({spans}) of {element} with Pack;"


def _ada_element(field: Entry) -> tuple[str, tuple[int, ...]]:
    """Return the type of an element and the extents of the array."""
    if field.base.kind == "S":
        return "Character", (field.base.itemsize,)
    return _ada_name(f"rig_{field.record}") if field.record else _TYPES[field.base.str][1], field.shape


def _ada_type(element: str, shape: tuple[int, ...]) -> str:
    return "_".join([element, *map(str, shape)])


def _ada_name(name: str) -> str:
    return "_".join(part.capitalize() for part in name.split("_"))


# Tables of the records -----------------------------------------------------------------------------


def markdown() -> str:
    """Return tables of all records and enums."""
    lines = [f"Version {VERSION}, layout `{LAYOUT:016x}`.", ""]
    for name, dtype in RECORDS.items():
        lines += [f"### rig_{name}", "", f"`struct rig_{name}`, {dtype.itemsize} bytes: {_COMMENTS[name]}.", ""]
        rows = [_table_row(field, name) for field in walk(dtype)]
        lines += ["| offset | field | type | meaning |", "|---|---|---|---|", *rows, ""]
    # The names behind the indices of the records, with the unit where the name has none.
    indices = {"signal": [f"`{one.name}` | {i}, {one.unit}" for i, one in enumerate(SIGNALS)]}
    named = {
        "discrete": _names(DISCRETES),
        "autopilot_command": AUTOPILOT_COMMANDS,
        "surface": SURFACES,
        "inertial": INERTIAL,
    }
    indices |= {key: [f"`{text}` | {i}" for i, text in enumerate(names)] for key, names in named.items()}
    lines += ["### Indices", ""]
    for name, texts in indices.items():
        lines += [f"| {name} | index, unit |", "|---|---|", *(f"| {text} |" for text in texts), ""]
    lines += ["### Enums", "", "| enum | values |", "|---|---|"]
    lines += [f"| `{enum.__name__}` | {', '.join(f'{m.name} {m.value}' for m in members(enum))} |" for enum in ENUMS]
    return "\n".join(lines) + "\n"


def _table_row(field: Entry, record: str) -> str:
    kind = f"rig_{field.record}" if field.record else field.base.str[1:]
    return f"| {field.offset} | `{field.name}` | {kind}{_extent(field)} | {_meaning(field.name, record)} |"


def _meaning(name: str, record: str) -> str:
    if name.startswith("pad_"):
        return "zero"
    if record == "law_input" and name in _READ_BY_LAW:
        return _READ_BY_LAW[name]
    if name in _MEANINGS:
        return _MEANINGS[name]
    field = FIELD.get(name)
    group = f"group {ANSWERS[name].name}" if name in ANSWERS else ""
    enum = f"of {field.enum.__name__}" if field is not None and field.enum is not None else ""
    return ", ".join(filter(None, (group, enum)))
