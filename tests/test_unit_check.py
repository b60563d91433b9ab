"""The conformance test: which grade a unit gets, and what is found in one that breaks the interface."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from unit_files import compiled, needs_a_compiler, udp, unit, written

from rig.bench.unit_check import Checked, check
from rig.bench.unit_long import FRAMES
from rig.unit.unit_file import Unit
from rig.unit.vectors import load

pytestmark = needs_a_compiler
# A unit that looks right and is not: a line of its step is another.
STRANGE = """
#include <stdlib.h>
#include "rig_unit.h"
static double kept;
int rig_unit_open(const struct rig_config *config) {{ {opening} return config->layout != RIG_UNIT_LAYOUT; }}
int rig_unit_step(const struct rig_input *in, struct rig_output *out)
{{
    static int called;
    called++;
    for (int s = 0; s < RIG_SIGNALS; s++) {{
        out->voted[s] = in->channels[s][0];
    }}
    kept += 1.0;
    out->said = RIG_SAID_VOTED | RIG_SAID_STATE;
    {step}
    return 0;
}}
void rig_unit_close(void) {{ }}
"""
OPENING = "kept = 0.0;"
WRONG = {
    "a second session starts like the first": ("", "out->voted[0] = kept;"),
    "two new sessions give the same bytes": (OPENING, "out->voted[0] = (double)(size_t)malloc(1) + called;"),
    "fills the groups of its role, with values of the enums": (OPENING, "out->state[3][1] = 9;"),
    "ends without an error": (OPENING + " atexit(abort);", ""),
    "answers every frame": (OPENING, "if (in->frame == 5) return 1;"),
    "votes healthy channels of an angle across the end of its circle": (
        OPENING,
        "out->voted[15] = 0.5 * (in->channels[15][0] + in->channels[15][1]);",
    ),
    "answers NaN, infinities, denormals, all invalid, every monitor value": (
        OPENING,
        "if (in->channels[0][0] > 1e300) abort();",
    ),
}


QUICK = (
    "two new sessions give the same bytes",
    "votes healthy channels of an angle across the end of its circle",
    "answers NaN, infinities, denormals, all invalid, every monitor value",
)


def strange(folder: Path, opening: str, step: str) -> Unit:
    source = folder / "strange.c"
    source.write_text(STRANGE.format(opening=opening, step=step))
    compiled([source], folder / "libstrange.so", "-Wno-unused-result", "-Wno-unused-but-set-variable")
    return written(folder, {"name": "strange", "path": "libstrange.so"})


def failed(found: Checked) -> list[str]:
    return [one.name for one in found.requirements if not one.passed]


@pytest.mark.parametrize("frames", [300, pytest.param(FRAMES, marks=pytest.mark.long)])
def test_the_monitor_in_c_meets_every_requirement_to_the_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, frames: int
):
    monkeypatch.setattr("rig.bench.unit_check.FRAMES", frames)  # of a long session
    unit(tmp_path, "monitor", isolate=False)
    found = check(tmp_path / "unit.toml")
    assert found.passed and found.grade == "bits" and failed(found) == []
    assert len(found.requirements) > 40


@pytest.mark.long
def test_a_unit_with_rules_of_its_own_keeps_to_the_interface_alone(
    tmp_path: Path, rig_command, monkeypatch: pytest.MonkeyPatch
):
    few = [case for case in load() if case.requirement in ("2:2 settled by the trend", "2:2 settled by the reference")]
    monkeypatch.setattr("rig.bench.unit_check.load", lambda: few)
    monkeypatch.setattr("rig.bench.unit_check.FRAMES", 300)  # of a long session
    unit(tmp_path, "first_valid")
    found = check(tmp_path / "unit.toml", interface_only=True)
    assert found.passed and found.grade == "interface"
    code, out, _ = rig_command("unit", "check", str(tmp_path / "unit.toml"), "--json")
    said = json.loads(out)
    assert code == 1 and not said["passed"] and said["grade"] == "failed"
    wrong = [one for one in said["requirements"] if not one["passed"]]
    assert {one["part"] for one in wrong} == {"decisions", "bits"}
    assert "1 of 1 cases; frame" in next(one for one in wrong if one["name"] == "2:2 settled by the trend")["detail"]


@pytest.mark.parametrize(
    "name", [*QUICK, *(pytest.param(one, marks=pytest.mark.long) for one in WRONG if one not in QUICK)]
)
def test_a_unit_that_does_not_keep_to_the_interface_is_found(tmp_path: Path, name: str):
    strange(tmp_path, *WRONG[name])
    found = check(tmp_path / "unit.toml", interface_only=True)
    assert name in failed(found) and not found.passed


def test_a_process_that_steps_frames_of_other_sessions_is_found(tmp_path: Path):
    """The planned unit never looks at a session; its votes, which hold the last valid sample, tell."""
    udp(tmp_path, [], "monitor")
    found = check(tmp_path / "unit.toml", interface_only=True)
    assert failed(found) == ["a frame of another session is not stepped"]


def test_a_flight_computer_is_asked_for_its_surfaces(tmp_path: Path):
    unit(tmp_path, "autopilot", role="flight-computer")
    found = check(tmp_path / "unit.toml")
    assert found.passed and found.grade == "interface"


CLASSES = """
import numpy as np

class First:
    def __init__(self, params):
        pass

    def step(self, bus, fcc, k):
        fcc[k]["voted"][:] = np.nan_to_num(bus[k]["channels"][:, 0])
        fcc[k]["level"][:] = 4

class Votes(First):
    def step(self, bus, fcc, k):
        fcc[k]["voted"][:] = np.nan_to_num(bus[k]["channels"][:, 0])

class Silent(First):
    def step(self, bus, fcc, k):
        fcc[k]["level"][:] = 4
"""


def of_class(folder: Path, name: str, *, interface_only: bool) -> Checked:
    file = folder / "unit.toml"
    file.write_text(f'name = "mine"\ntransport = "python"\nmanager = "checked_classes:{name}"\n')
    return check(file, interface_only=interface_only)


def test_of_a_class_is_tested_what_it_writes_and_what_it_decides(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "checked_classes.py").write_text(CLASSES)
    monkeypatch.syspath_prepend(tmp_path)
    interface = of_class(tmp_path, "First", interface_only=True)
    assert interface.grade == "interface" and [one.part for one in interface.requirements] == ["interface"] * 3
    assert of_class(tmp_path, "Votes", interface_only=True).passed
    decided = of_class(tmp_path, "First", interface_only=False)
    wrong = [one for one in decided.requirements if not one.passed]
    assert not decided.passed and wrong and all(one.part == "decisions" for one in wrong)
    (silent,) = of_class(tmp_path, "Silent", interface_only=False).requirements
    assert not silent.passed and "wrote no vote in frame 0" in silent.detail
