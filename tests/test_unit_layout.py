"""The records of the interface: what C makes of the header, what the committed files say, what the rig lays out."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from unit_files import COMPILER, ROOT, needs_a_compiler
from unit_files import SOURCES as EXAMPLES

from rig.core.frame import AUTOPILOT_COMMANDS, DISCRETES, INERTIAL, SIGNALS, SURFACES
from rig.core.frame.fields import BASES, FIELD, FIELDS
from rig.unit import header
from rig.unit.host import HEAD
from rig.unit.unit_records import (
    ANSWERS,
    DISCRETE_CONFIG,
    ENUMS,
    HELLO,
    INPUT,
    OUTPUT,
    RECORDS,
    SIGNAL_CONFIG,
    described,
    place,
)


@needs_a_compiler
def test_a_c_compiler_lays_the_records_out_as_numpy_does(tmp_path: Path):
    fields = [(record, name) for record, dtype in RECORDS.items() for name in dtype.names or ()]
    prints = "".join(
        f'printf("%zu %zu\\n", offsetof(struct rig_{record}, {name}), sizeof(((struct rig_{record} *)0)->{name}));\n'
        for record, name in fields
    )
    source = tmp_path / "print.c"
    source.write_text(f'#include <stdio.h>\n#include "rig_unit.h"\nint main(void) {{ {prints} return 0; }}\n')
    (tmp_path / "rig_unit.h").write_text(header.header())
    command = [COMPILER or "cc", "-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wpadded", "-Werror"]
    subprocess.run([*command, "-o", str(tmp_path / "print"), str(source)], check=True)
    said = subprocess.run([str(tmp_path / "print")], check=True, capture_output=True, text=True).stdout.split()
    found = [tuple(pair) for pair in np.array(said, int).reshape(-1, 2).tolist()]
    expected = [(place(RECORDS[record], name)[1], place(RECORDS[record], name)[0].itemsize) for record, name in fields]
    assert found == expected


def test_the_committed_header_and_tables_are_those_of_the_frame():
    """To renew them: ``rig unit header > docs/examples/unit/rig_unit.h``, and ``make reference`` for the tables."""
    assert (EXAMPLES / "rig_unit.h").read_text() == header.header()
    page = (ROOT / "docs/reference/icd.md").read_text()
    assert header.markdown() in page


def test_every_field_is_explained_and_every_index_named():
    page = (ROOT / "docs/reference/icd.md").read_text()
    rows = [
        [cell.strip(" `") for cell in line.strip("| \n").split(" | ")] for line in page.splitlines() if line[:1] == "|"
    ]
    fields = [row for row in rows if row[0].isdecimal()]
    assert len(fields) == sum(len(dtype.names or ()) for dtype in RECORDS.values())
    assert [row for row in fields if len(row) < 4 or not row[3]] == []
    units = {
        row[1]: row[3] for row in fields if row[1] in (*(SIGNAL_CONFIG.names or ()), *(DISCRETE_CONFIG.names or ()))
    }
    known = ("unit of the signal", "frames", "1:", "m/s", "channels", "bits", "0 or 1", "in their order", "zero")
    assert [name for name, text in units.items() if not any(word in text for word in known)] == []
    for items in (SIGNALS, DISCRETES):
        for i, item in enumerate(items):
            assert any(row[0] == item.name and row[1].split(",")[0] == str(i) for row in rows), item.name
    for i, name in [*enumerate(AUTOPILOT_COMMANDS), *enumerate(SURFACES), *enumerate(INERTIAL)]:
        assert [name, str(i)] in rows


def test_records_follow_the_table_of_fields():
    for field in FIELDS:
        if field.part == "bus":
            dtype, _ = place(INPUT, field.name)
            assert (dtype.base, dtype.shape) == (np.dtype(BASES[field.kind]), field.shape)
    assert {name for name in ANSWERS if FIELD[name].part != "fcc"} == set()


def test_records_are_aligned_without_unnamed_gaps():
    for dtype in RECORDS.values():
        ends = 0
        for name in dtype.names or ():
            of, at = place(dtype, name)
            base = of.base
            assert at == ends
            assert base.names is not None or base.kind == "S" or at % base.itemsize == 0
            ends = at + of.itemsize
        assert ends == dtype.itemsize and ends % 8 == 0


def test_input_and_output_fit_an_ethernet_frame():
    assert max(INPUT.itemsize, OUTPUT.itemsize, RECORDS["config_part"].itemsize) <= 1472


def test_the_host_reads_the_head_where_it_is():
    sizes = [place(HELLO, name)[1] for name in ("magic", "version", "kind", "layout", "session", "frame", "time_s")]
    assert sizes == [0, 4, 6, 8, 16, 24, 32] and HEAD.size == 40
    assert place(OUTPUT, "stepped")[1] == 40


@pytest.mark.parametrize("change", ["enum", "field", "shape"])
def test_the_layout_tells_any_change_of_a_record(monkeypatch, change: str):
    before = described()
    if change == "enum":
        monkeypatch.setattr("rig.unit.unit_records.ENUMS", ENUMS[:-1])
    else:
        entry = ("level", "u1", (16,)) if change == "field" else ("voted", "<f8", (15,))
        monkeypatch.setitem(RECORDS, "output", np.dtype([("magic", "<u4"), entry]))
    assert described() != before


def test_ada_has_every_field_at_its_bit():
    text = header.ada()
    for dtype in RECORDS.values():
        for name in dtype.names or ():
            of, at = place(dtype, name)
            named = "_".join(part.capitalize() for part in name.split("_"))
            assert re.search(rf"\n      {named} at {at} range 0 \.\. {of.itemsize * 8 - 1};", text), name


def test_rig_unit_header_prints_them(rig_command):
    code, out, _ = rig_command("unit", "header")
    assert code == 0 and out == header.header()
    assert rig_command("unit", "header", "--ada")[1] == header.ada()
    code, _, err = rig_command("unit", "header", "--ada", "--markdown")
    assert code == 2 and err == "error: --ada, --markdown, --fmu: only one of them at a time\n"
