"""What counts as a failure of a case, from its exit code, its output and its folder."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hostile_cases.case import Case
from hostile_cases.child import UNEXPECTED, snapshot
from hostile_cases.values import MARK
from rig.cli.working import COMPILING

CATEGORIES: Final = ("traceback", "hang", "answer", "files", "memory", "control", "code", "vote", "other")
LONGEST_LINE: Final = 600
MEMORY: Final = 2 << 30
_TRACEBACK: Final = re.compile(
    r"Traceback \(most recent call last\)|MarkupError|Exception ignored in|Fatal Python error"
)
_CONTROL: Final = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
_BROKEN_RULE: Final = 99  # exit code of a case that calls a property of its own


@dataclass(frozen=True)
class Outcome:
    """How a case's process ended."""

    code: int  # negative: killed by a signal
    wall_s: float
    rss: int
    stopped: str = ""  # "hang" or "memory" when the parent ended it


def failures(case: Case, box: Path, outcome: Outcome) -> dict[str, str]:
    """The categories in which a case failed, with what was seen; empty when it held."""
    out, err = (_text(box / name) for name in ("out", "err"))
    if outcome.code == UNEXPECTED and not outcome.stopped:
        return {"other": f"the case could not be made: {_last(err)}"}
    found: dict[str, str] = {}
    if outcome.stopped == "hang":
        found["hang"] = f"still running after {outcome.wall_s:.0f} s"
    if outcome.stopped == "memory" or outcome.rss > MEMORY:
        found["memory"] = f"{outcome.rss / 1e9:.1f} GB resident"
    if _TRACEBACK.search(out + err):
        found["traceback"] = _last(err if _TRACEBACK.search(err) else out)
    if not outcome.stopped:
        found |= _ended(outcome.code, out, err)
        if case.refused and (outcome.code != 2 or not re.search(case.refused, err)):
            found["answer"] = f"exit code {outcome.code} where 2 is due, naming {case.refused!r}: {_last(err)}"
    control = _CONTROL.search(out + err)
    if control:
        found["control"] = f"{control[0]!r} in {(out + err)[max(0, control.start() - 40) : control.end() + 20]!r}"
    return found | _touched(case, box, outcome.code)


def _ended(code: int, out: str, err: str) -> dict[str, str]:
    """Of the exit code and the answer."""
    found: dict[str, str] = {}
    if code == _BROKEN_RULE:
        return {"vote": _last(err)}
    if code < 0 or code > 2:
        found["other"] = f"exit code {code}: {_last(err)}"
    elif code == 1 and not (out + err).strip():
        found["other"] = "exit code 1 without a word"
    elif code == 0 and "Warning:" in err:
        found["other"] = f"a warning of a library: {_last(err)}"
    if code and not _TRACEBACK.search(err):
        lines = [line for line in err.strip().split("\n") if line != COMPILING] or [""]
        if len(lines) > 1:
            found["answer"] = f"{len(lines)} lines: {' | '.join(lines)[:160]}"
        elif len(lines[0]) > LONGEST_LINE:
            found["answer"] = f"{len(lines[0])} characters: {lines[0][:80]}"
        if code == 2 and not lines[0]:
            found["answer"] = "refused without a word"
    return found


def _touched(case: Case, box: Path, code: int) -> dict[str, str]:
    found: dict[str, str] = {}
    work = box / "work"
    if (work / MARK).exists() and not case.may_run_code:
        found["code"] = "the module that the input names was run"
    if (box / "precious").read_text() != "precious":
        found["files"] = "a file outside of the folder was changed"
    elif code == 2 and (box / "before.json").exists():
        before, after = json.loads((box / "before.json").read_text()), snapshot(work)
        changed = sorted(name for name in {*before, *after} if before.get(name) != after.get(name))
        if changed:
            found["files"] = f"refused, but changed: {', '.join(changed)[:120]}"
    return found


def _text(path: Path) -> str:
    """The output of a case, at most 2 MB from both its ends."""
    if not path.exists():
        return ""
    data = path.read_bytes()
    return (data if len(data) < 4 << 20 else data[: 2 << 20] + data[-2 << 20 :]).decode("utf-8", "backslashreplace")


def _last(text: str) -> str:
    lines = [line for line in text.strip().split("\n") if line.strip()]
    return lines[-1][:160] if lines else ""
