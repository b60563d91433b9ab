"""The conformance test of a unit under test: against the interface records and the voting requirements.

Two grades: *decisions* (states, levels, patterns ... equal, votes within a millionth of the range) against vectors of
an independent implementation, and *bits* (every byte of every answer) against the built-in manager on the same inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from time import sleep
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.bench import unit_circle, unit_law_check, unit_second_rig
from rig.bench.drive import Stages, run
from rig.bench.unit_long import FRAMES, MOST_FRAMES, TITLES, inputs_of
from rig.bench.vote_rows import by_class
from rig.computer.redundancy.discrete import DiscreteVoter
from rig.computer.redundancy.managers import DEFAULT, Manager
from rig.computer.redundancy.own import load_manager
from rig.core.errors import ManagerFailed
from rig.core.frame import nested, new_block
from rig.core.frame.fields import FIELDS
from rig.core.trust import Trust
from rig.unit.older_versions import asked_since
from rig.unit.port import RECEIVED, is_allowed
from rig.unit.running_unit import UnitUnderTest, running
from rig.unit.session import box_rule, settings_of
from rig.unit.unit_file import Unit, read_unit
from rig.unit.unit_records import (
    ANSWERS,
    FROM_UNIT,
    INPUT,
    OLD_INTERFACES,
    OUTPUT,
    REFERENCES,
    Kind,
    Role,
    Said,
    blank,
    role_of,
)
from rig.unit.vectors import Case, answers, ask, differences, load

PAUSE_S: Final = 1.0
HOSTILE_FRAMES: Final = 200
_HOSTILE_NUMBERS: Final = np.array([np.nan, np.inf, -np.inf, 5e-324, -5e-324, 1.7e308, -1.7e308, 0.0, -0.0, 1.0])
_HOSTILE: Final = "answers NaN, infinities, denormals, all invalid, every monitor value"
_HOSTILE_VOTES: Final = "commands finite surfaces when votes are NaN, signals are lost, references are infinite"
_CIRCLE: Final = "votes healthy channels of an angle across the end of its circle"
VOTES: Final = ("voted", "state", "level")  # of a manager class, written or assumed


@dataclass(frozen=True, slots=True)
class Requirement:
    """One line of the test."""

    name: str
    part: str  # interface, decisions or bits
    passed: bool
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Checked:
    """Result of the test of a unit."""

    unit: str
    requirements: list[Requirement]

    @property
    def passed(self) -> bool:
        """Return True if the unit meets the interface and all decisions; bits are a grade, not a requirement."""
        return all(requirement.passed for requirement in self.requirements if requirement.part != "bits")

    @property
    def grade(self) -> str:
        """Return the grade."""
        if not self.passed:
            return "failed"
        parts = {requirement.part for requirement in self.requirements if requirement.passed}
        return next(part for part in ("bits", "decisions", "interface") if part in parts)

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {"unit": self.unit, "passed": self.passed, "grade": self.grade} | {
            "requirements": [asdict(requirement) for requirement in self.requirements]
        }


def check(file: Path | str, *, interface_only: bool = False, longest: bool = False) -> Checked:
    """Test the unit of a file.  BadInput: the file, or a unit that cannot be started.

    interface_only : do not test decisions; so for a flight computer, which defines its votes, and for a control law
    longest : long sessions of unit_long.MOST_FRAMES frames, not of unit_long.FRAMES
    """
    unit = read_unit(file)
    cases = [] if unit.replaces_law else load()
    if unit.is_manager:
        return Checked(unit.name, list(_of_class(unit, cases, interface_only)))
    requirements = list(_interface(unit, cases))
    if not interface_only and unit.role == "redundancy":
        with running(unit) as tested:
            answered = _told(tested, cases)
            asked = answered + _told(tested, long_cases(MOST_FRAMES if longest else FRAMES))
            requirements += _counted((case, answers(tested, case.config, case.inputs)) for case in asked)
            requirements += _bits(tested, answered)
    return Checked(unit.name, requirements)


def _of_class(unit: Unit, cases: list[Case], interface_only: bool) -> Iterator[Requirement]:
    """Yield the tests of a manager class, which has no interface records: its votes in the rig's rows."""
    trust = Trust(unit.source, named=unit.manager)
    longest = max(cases, key=lambda case: len(case.inputs))
    try:
        first, again = (our_answers(longest.config, longest.inputs, unit.manager, trust) for _ in range(2))
        yield _line("answers every frame, with a vote", "interface", "")
        same = all(first[name].tobytes() == again[name].tobytes() for name in VOTES)
        yield _line("two new sessions give the same votes", "interface", "" if same else "another vote, state or level")
        angles, turning = unit_circle.session(longest.config)
        voted = _output(our_answers(angles, turning, unit.manager, trust))
        yield _line(_CIRCLE, "interface", unit_circle.wrong(angles, turning, voted))
        answer_of = lambda case: _output(our_answers(case.config, case.inputs, unit.manager, trust))  # noqa: E731
        requirements = [] if interface_only else _counted((case, answer_of(case)) for case in cases)
        yield from requirements
    except ManagerFailed as error:
        yield _line("answers every frame, with a vote", "interface", str(error))


# The interface ----------------------------------------------------------------------------------------------------


def _interface(unit: Unit, cases: list[Case]) -> Iterator[Requirement]:
    """Return the tests of the interface, which do not check decisions."""
    law = unit.replaces_law
    config, inputs = unit_law_check.session() if law else _longest(cases, role_of(unit.role))
    with running(unit) as tested:
        first = answers(tested, config, inputs)
        missing = np.flatnonzero(first["frame"] < 0)
        yield _line("answers every frame", "interface", f"no answer to frame {missing[0]}" if len(missing) else "")
        again = answers(tested, config, inputs)
        yield _line("a second session starts like the first", "interface", _same(first, again))
        yield _line(
            "fills the groups of its role, with values of the enums", "interface", _allowed(tested, config, inputs)
        )
        for name, wrong in unit_law_check.check(tested, config, first) if law else _circle(tested, config):
            yield _line(name, "interface", wrong)
        paused = _after(tested, config, inputs, len(inputs) // 2, lambda: sleep(PAUSE_S))
        yield _line("a pause between two frames changes nothing", "interface", _same(first, paused))
        few, at = (inputs[len(inputs) // 2 :][:5], 3) if law else (inputs[:3], 1)  # where a law has something to do
        foreign = _after(tested, config, few, at, tested.send_foreign)  # a FRAME of a session that never began
        wrong = _same(answers(tested, config, few), foreign)
        yield _line("a frame of another session is not stepped", "interface", wrong)
        yield _times(tested, config, inputs)
        if tested.interface.version > 1:  # which left it open
            for name, wrong in unit_second_rig.check(tested, config, inputs):
                yield _line(name, "interface", wrong)
    yield _line("ends without an error", "interface", tested.end_wrong)
    with running(unit) as tested:
        yield _line("two new sessions give the same bytes", "interface", _same(first, answers(tested, config, inputs)))
    with running(unit) as tested:
        made = partial(unit_law_check.hostile, config=config) if law else _hostile_input
        yield _line(_HOSTILE_VOTES if law else _HOSTILE, "interface", _hostile(tested, config, made))


def _longest(cases: list[Case], role: Role) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return CONFIG (1,) and INPUT (n,) of the longest case that units of all versions can be given."""
    oldest = OLD_INTERFACES[-1]
    longest = max((case for case in cases if not asked_since(oldest, case.config)), key=lambda case: len(case.inputs))
    config = longest.config.copy()
    config["role"] = role
    return config, longest.inputs


def _circle(tested: UnitUnderTest, config: NDArray[Any]) -> Iterator[tuple[str, str]]:
    angles, turning = unit_circle.session(config)
    yield _CIRCLE, unit_circle.wrong(angles, turning, answers(tested, angles, turning))


def _line(name: str, part: str, wrong: str) -> Requirement:
    return Requirement(name, part, not wrong, wrong)


def _same(one: NDArray[Any], other: NDArray[Any]) -> str:
    """Return the first difference between the bodies of two runs, in bytes."""
    names = ("frame", "said", *ANSWERS)
    for name in names:
        a, b = (run[name].tobytes() for run in (one, other))
        if a != b:
            size = len(a) // len(one)
            k = next(i for i in range(len(one)) if a[i * size : (i + 1) * size] != b[i * size : (i + 1) * size])
            return f"frame {k}: {name} differs"
    return ""


def _allowed(tested: UnitUnderTest, config: NDArray[Any], inputs: NDArray[Any]) -> str:
    tested.begin(config.copy())
    for k, asked in enumerate(inputs[:50]):
        if not ask(tested, asked, k):
            return f"frame {k}: no answer"
        if not is_allowed(tested.port.back):
            return f"frame {k}: a group is missing, or a state, level or pattern is invalid"
    tested.end()
    return ""


def _after(
    tested: UnitUnderTest, config: NDArray[Any], inputs: NDArray[Any], frame: int, act: Callable[[], object]
) -> NDArray[Any]:
    """Return the answers of a session with a disturbance before a frame; they must equal those without it."""
    tested.begin(config.copy())
    answered = np.zeros(len(inputs), OUTPUT)
    for k, asked in enumerate(inputs):
        if k == frame:
            act()
        if ask(tested, asked, k):
            answered[k] = tested.port.back.records[RECEIVED]
    tested.end()
    return answered


def _times(tested: UnitUnderTest, config: NDArray[Any], inputs: NDArray[Any]) -> Requirement:
    """Return the time of an exchange on this machine, which is reported and not required."""
    tested.begin(config.copy())
    took = []
    for k in range(1000):
        ask(tested, inputs[k % len(inputs)], k)
        took.append(tested.reply_us)
    tested.end()
    median, most = np.percentile(took, [50, 99])
    return Requirement("time of an exchange", "interface", True, f"median {median:.1f} us, 99 % {most:.1f} us")


def _hostile(tested: UnitUnderTest, config: NDArray[Any], made: Callable[..., Any]) -> str:
    """Return the test with numbers that no sensor transmits: the unit must continue, and stay within its enums.

    A control law must also command finite surfaces.  made : INPUT or LAW_INPUT of a frame, from a generator
    """
    draw = np.random.default_rng(0)
    tested.begin(config.copy())
    for k in range(HOSTILE_FRAMES):
        if not ask(tested, made(draw, k=k), k):
            return f"frame {k}: no answer"
        if not is_allowed(tested.port.back):
            return f"frame {k}: a state, level or pattern is invalid"
        surface = tested.port.back.records[RECEIVED]["surface"]
        if tested.role is Role.CONTROL_LAW and (wrong := unit_law_check.not_finite(surface, k)):
            return wrong
    tested.end()
    return ""


def _hostile_input(draw: np.random.Generator, k: int) -> Any:
    asked = np.zeros((), INPUT)
    for name in (*REFERENCES, "channels", "inertial", "autopilot_command"):
        asked[name] = draw.choice(_HOSTILE_NUMBERS, asked[name].shape)
    for name in ("valid", "ilm", "discrete_valid", "discrete_ilm", "discrete_channels", "reset", "discrete_reset"):
        asked[name] = draw.integers(0, 3 if "ilm" in name else 2, asked[name].shape)
    if k % 10 == 0:
        asked["valid"] = 0
    return asked


# What it decides ---------------------------------------------------------------------------------------------


def _told(tested: UnitUnderTest, cases: list[Case]) -> list[Case]:
    """Return the cases whose settings have fields in the unit's version of the records."""
    tested.begin(cases[0].config.copy())  # from here on it is known
    tested.end()
    return [case for case in cases if not asked_since(tested.interface, case.config)]


def _counted(answered: Iterable[tuple[Case, NDArray[Any]]]) -> list[Requirement]:
    """Return one line per requirement of cases with their answers, (n,) OUTPUT."""
    counts: dict[str, tuple[int, int, str]] = {}
    for case, answer in answered:
        wrong = next(differences(case, answer), "")
        right, of, first = counts.get(case.requirement, (0, 0, ""))
        counts[case.requirement] = (right + (not wrong), of + 1, first or wrong)
    return [
        Requirement(name, "decisions", right == of, first and f"{of - right} of {of} cases; {first}")
        for name, (right, of, first) in counts.items()
    ]


def _bits(tested: UnitUnderTest, cases: list[Case]) -> list[Requirement]:
    """Compare every byte with the built-in manager."""
    frames = 0
    for case in cases:
        ours, answer = our_answers(case.config, case.inputs), answers(tested, case.config, case.inputs)
        frames += len(ours)
        for name, group in ANSWERS.items():
            if group == Said.SURFACE:
                continue
            differ = [k for k in range(len(ours)) if ours[name][k].tobytes() != answer[name][k].tobytes()]
            if differ:
                detail = f"{case.requirement}, frame {differ[0]}: {name}"
                return [Requirement("every byte equals the built-in manager", "bits", False, detail)]
    return [Requirement("every byte equals the built-in manager", "bits", True, f"{frames} frames")]


def _output(rows: NDArray[Any], outputs: NDArray[Any] | None = None) -> NDArray[Any]:
    """Return rows of the frame as the answers of a unit that fills all that a manager does; ``outputs`` : to fill."""
    if outputs is None:
        outputs = np.zeros(len(rows), OUTPUT)
        outputs["frame"] = np.arange(len(rows))
    for name, group in ANSWERS.items():
        if group != Said.SURFACE:
            outputs[name] = rows[name]
            outputs["said"] |= np.uint8(group)
    return outputs


def long_cases(frames: int) -> list[Case]:
    """Return the long sessions with the built-in manager's answers."""
    cases = []
    for number, title in enumerate(TITLES):
        config, inputs = inputs_of(number, frames)
        expected = _output(our_answers(config, inputs), blank(OUTPUT, FROM_UNIT, Kind.REPLY).repeat(frames))
        cases.append(Case(title, config, inputs, expected))
    return cases


def our_answers(
    config_record: NDArray[Any], inputs: NDArray[Any], manager: str | None = None, trust: Trust | None = None
) -> NDArray[Any]:
    """Return the answers to INPUT (n,) with CONFIG (1,): (n,) rows of the frame, of the built-in manager or a class."""
    rows = new_block(len(inputs))
    for name in (*REFERENCES, *(field.name for field in FIELDS if field.part == "bus")):
        rows[name] = inputs[name]
    params, discretes = settings_of(config_record)
    voter = DiscreteVoter(discretes)
    if manager is not None and trust is not None:
        own = load_manager(manager, params, trust)
        run(nested(rows), Stages(discretes=voter.data), decide=by_class(own, rows, nested(rows)))
        return rows
    ours = Manager(DEFAULT, params, **box_rule(config_record))
    run(nested(rows), Stages(manager=ours.data, discretes=voter.data))
    return rows
