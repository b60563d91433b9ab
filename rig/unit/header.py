"""The records of layout.py as a C header: ``rig unit header``."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rig.frame import CHANNELS, DEMANDS, DISCRETES, INERTIAL, SIGNALS, SURFACES, D, S
from rig.unit.layout import ENUMS, FROM_UNIT, LAYOUT, RECORDS, TO_UNIT, VERSION, place

_C: Final = {
    "<f8": "double",
    "<i8": "int64_t",
    "<u8": "uint64_t",
    "<u4": "uint32_t",
    "<u2": "uint16_t",
    "|u1": "uint8_t",
}
COMMENTS: Final = {
    "hello": "HELLO and END",
    "ready": "READY and REFUSED, with what the unit says of itself or the reason",
    "signal_config": "how one signal is monitored and voted; counts in frames",
    "discrete_config": "the same of a discrete; counts in frames",
    "config": "what a flight is flown with",
    "config_part": "a part of config where one message must fit into an Ethernet frame",
    "input": "one frame to the unit: SI units, angles in rad, load factors in g, sticks -1 to 1",
    "output": "one frame from the unit",
}
_OPENING: Final = """\
/* The records between the rig and a unit under test.
 *
 * Written by `rig unit header`: do not edit, write it again when the rig's records change.
 * Little-endian, IEEE 754, naturally aligned.  docs/unit.md explains them.
 *
 * A library exports three functions; 0 is success:
 *
 *     int rig_unit_open(const struct rig_config *config);
 *     int rig_unit_step(const struct rig_input *input, struct rig_output *output);
 *     void rig_unit_close(void);
 *
 * open after close begins as if it were the first.  step is called once a frame with an output that is zero but
 * for its head; it fills what the unit has to say, and names that in output->said.
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
/* Which records a library was built for: the rig reads it before it calls anything. */
#if defined(__GNUC__)
extern __attribute__((weak, visibility("default"))) const uint64_t rig_unit_layout;
const uint64_t rig_unit_layout = RIG_UNIT_LAYOUT;
#endif

int rig_unit_open(const struct rig_config *config);
int rig_unit_step(const struct rig_input *input, struct rig_output *output);
void rig_unit_close(void);

#ifdef __cplusplus
}
#endif
#endif
"""


def header() -> str:
    """The text of ``rig_unit.h``."""
    parts = [_OPENING, _constants(), *map(_enum, ENUMS), _places()]
    for name in RECORDS:
        parts += [_struct(name), _asserts(name)]
    return "\n".join([*parts, _CLOSING])


def _constants() -> str:
    values = {
        "RIG_UNIT_VERSION": str(VERSION),
        "RIG_UNIT_LAYOUT": f"UINT64_C(0x{LAYOUT:016x})",
        "RIG_MAGIC_INPUT": f"UINT32_C(0x{TO_UNIT:08x})",
        "RIG_MAGIC_OUTPUT": f"UINT32_C(0x{FROM_UNIT:08x})",
        "RIG_CHANNELS": str(CHANNELS),
        "RIG_SIGNALS": str(S),
        "RIG_DISCRETES": str(D),
    }
    return "".join(f"#define {name} {value}\n" for name, value in values.items())


def _enum(enum: Any) -> str:
    members = "".join(f"    RIG_{enum.__name__.upper()}_{one.name} = {one.value},\n" for one in enum)
    return f"enum rig_{enum.__name__.lower()} {{\n{members}}};\n"


def _places() -> str:
    """Where each signal, discrete, demand, surface and number of the inertial unit is in its array."""
    lists = {
        "SIGNAL": [signal.name for signal in SIGNALS],
        "DISCRETE": [discrete.name for discrete in DISCRETES],
        "DEMAND": list(DEMANDS),
        "SURFACE": list(SURFACES),
        "INERTIAL": list(INERTIAL),
    }
    texts = []
    for prefix, names in lists.items():
        members = "".join(f"    RIG_{prefix}_{name.upper()} = {i},\n" for i, name in enumerate(names))
        texts.append(f"enum rig_{prefix.lower()}_index {{\n{members}}};\n")
    return "\n".join(texts)


def _struct(name: str) -> str:
    dtype = RECORDS[name]
    members = "".join(f"    {_member(field, *place(dtype, field))}\n" for field in dtype.names or ())
    return f"/* {COMMENTS[name]} */\nstruct rig_{name} {{\n{members}}};\n"


def _member(name: str, dtype: np.dtype[Any], at: int) -> str:
    base, shape = dtype.base, dtype.shape
    if base.kind == "S":
        return f"char {name}[{base.itemsize}];"
    record = next((f"struct rig_{known}" for known, of in RECORDS.items() if of == base), None)
    extent = "".join(f"[{n}]" for n in shape)
    return f"{record or _C[base.str]} {name}{extent};"


def _asserts(name: str) -> str:
    dtype = RECORDS[name]
    lines = [f"RIG_ASSERT(sizeof(struct rig_{name}) == {dtype.itemsize});"]
    lines += [
        f"RIG_ASSERT(offsetof(struct rig_{name}, {field}) == {place(dtype, field)[1]});" for field in dtype.names or ()
    ]
    return "\n".join(lines) + "\n"
