"""The conformance test of a control law: sound ones pass, and each planted defect is found by its requirement."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from unit_files import HERE, SOURCES, build, listening, needs_a_compiler, of_sources, udp, unit, written

import rig
from rig.bench.unit_check import Checked, check
from rig.bench.unit_law_check import _FLIGHT, session
from rig.unit.unit_file import Unit
from rig.unit.unit_records import LAW_INPUT

ROLE = {"role": "control-law"}
FINITE = "commands finite surfaces"
HOSTILE = "commands finite surfaces when votes are NaN, signals are lost, references are infinite"
STEP = "moves no surface by a step when a signal loses channels or has its reference"
TRIM = "begins at the trim surfaces"
# A law that holds trim, and a line that is wrong; ``kept`` counts the frames of all sessions.
DEFECTIVE = """
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "rig_unit.h"
static double trim[4], kept, last;
int rig_unit_open(const struct rig_config *config)
{
    memcpy(trim, config->trim_surface, sizeof trim);
    last = 0.0;
    %s
    return 0;
}
int rig_unit_law(const struct rig_law_input *in, struct rig_output *out)
{
    memcpy(out->surface, trim, sizeof trim);
    out->said = RIG_SAID_SURFACE;
    kept += 1e-9;
    %s
    return in == 0;
}
void rig_unit_close(void) { }
"""
DEFECTS = {
    "answers every frame": ("", "if (in->frame == 5) return 1;"),
    "a second session starts like the first": ("", "out->surface[0] += kept;"),
    "two new sessions give the same bytes": ("kept = 0.0;", "out->surface[0] += 1e-20 * (double)(size_t)malloc(1);"),
    "fills the groups of its role, with values of the enums": ("", "out->said = RIG_SAID_VOTED;"),
    FINITE: ("", "if (in->frame == 300) out->surface[2] = NAN;"),
    TRIM: ("", "out->surface[0] += 0.1;"),
    # It takes the vote although no channel is left of it, here the average of two frames.
    STEP: ("", "out->surface[1] += in->level[RIG_SIGNAL_ROLL_RATE] < 3 ? 0.05 : 0.0;"),
    HOSTILE: ("", "if (isnan(in->voted[RIG_SIGNAL_HEADING])) out->surface[1] = in->voted[RIG_SIGNAL_HEADING];"),
    "ends without an error": ("atexit(abort);", ""),
}


QUICK = ("two new sessions give the same bytes", STEP, HOSTILE)  # one of each kind: the others are long


def defective(folder: Path, opening: str, step: str) -> Unit:
    source = folder / "defective.c"
    source.write_text(DEFECTIVE % (opening, step))
    made = of_sources("libdefective.so", [source], "-Wno-unused-result", "-Wno-unused-but-set-variable")
    return written(folder, {"name": "defective", "path": str(made), **ROLE})


def failed(found: Checked) -> list[str]:
    return [one.name for one in found.requirements if not one.passed]


@pytest.mark.long
@needs_a_compiler
def test_the_example_in_c_and_that_in_python_meet_every_requirement(tmp_path: Path, rig_command):
    unit(tmp_path, "pid", **ROLE)
    found = check(tmp_path / "unit.toml")
    assert found.passed and found.grade == "interface" and len(found.requirements) == 12
    assert {FINITE, HOSTILE, STEP, TRIM} < {one.name for one in found.requirements}
    code, out, _ = rig_command("unit", "check", str(SOURCES / "pid_python.toml"))
    assert code == 0 and "pid-python: interface, 12 requirements, 0 not met" in out


def test_our_own_law_meets_them_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(HERE)
    import built_in_law  # pyright: ignore[reportMissingImports] # from that folder

    built_in_law.flown[:] = [rig.load(None, _FLIGHT)]
    written(tmp_path, {"name": "law", "transport": "python", "law": "built_in_law:BuiltIn", **ROLE})
    found = check(tmp_path / "unit.toml")
    assert failed(found) == []
    sys.modules.pop("built_in_law")


@needs_a_compiler
@pytest.mark.parametrize(
    "name", [*QUICK, *(pytest.param(one, marks=pytest.mark.long) for one in DEFECTS if one not in QUICK)]
)
def test_a_defect_is_found(tmp_path: Path, name: str):
    defective(tmp_path, *DEFECTS[name])
    found = check(tmp_path / "unit.toml")
    assert name in failed(found) and not found.passed and found.grade == "failed"


@needs_a_compiler
def test_the_law_without_a_defect_passes(tmp_path: Path):
    defective(tmp_path, "", "")
    assert failed(check(tmp_path / "unit.toml")) == []


@needs_a_compiler
def test_a_step_is_named_with_its_signal_and_level(tmp_path: Path):
    defective(tmp_path, *DEFECTS[STEP])
    (found,) = (one for one in check(tmp_path / "unit.toml").requirements if one.name == STEP)
    assert found.detail.startswith("aileron_rad moves by ") and "when roll_rate comes to level 2" in found.detail


@needs_a_compiler
def test_a_process_that_steps_frames_of_other_sessions_is_found(tmp_path: Path):
    udp(tmp_path, [], "pid", **ROLE)  # it never looks at a session
    assert failed(check(tmp_path / "unit.toml")) == ["a frame of another session is not stepped"]


@pytest.mark.long
@needs_a_compiler
def test_a_box_at_an_address_is_asked_for_one_rig_at_a_time(tmp_path: Path):
    with listening(build("pid_udp")) as address:
        written(tmp_path, {"name": "u", "transport": "udp", "address": address, **ROLE})
        found = check(tmp_path / "unit.toml")
    assert failed(found) == [] and "the end of a session frees it for another rig" in {
        o.name for o in found.requirements
    }


def test_the_session_is_a_flight_in_which_a_law_has_something_to_do():
    config, asked = session()
    assert asked.dtype == LAW_INPUT and len(asked) == 400 and (asked["level"] == 4).any()
    assert abs(asked["autopilot_command"]).max() > 0.0 and config["role"][0] == 2
    assert len({record["voted"].tobytes() for record in asked}) == 400
