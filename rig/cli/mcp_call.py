"""One call of a tool of ``rig mcp``, in a separate process: ``python -P -m rig.cli.mcp_call``.

Standard input has one line, the command line of ``rig`` as JSON; when it closes, the call ends as by SIGTERM: a flight
after its frame, all other work at once and cleanly.  Standard output has lines of JSON: ``progress``, then the
``answer``, which is what the command prints with --json, or the line of the ``error``.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from typing import Any, Final

from rig.cli.main import files_in_one_line, run
from rig.cli.mcp_tools import EXPLAIN, MOST_FLIGHTS
from rig.core.errors import BadInput, RigError
from rig.core.interrupt import CODE, end_cleanly
from rig.core.progress import listening

EVERY_S: Final = 0.25  # between two reports of the progress of one step
PATIENCE_S: Final = 20.0  # after which a call that does not end cleanly is ended
INTERNAL: Final = "an error of the rig itself; the standard error of rig mcp has its text"


def main() -> None:
    """Answer one call."""
    wire = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what a library prints is no answer
    end_cleanly()
    arguments = json.loads(_line())
    lock, answered = threading.Lock(), threading.Event()
    threading.Thread(target=_end_with_server, args=(answered,), daemon=True).start()

    def send(**message: Any) -> None:
        with lock, suppress(BrokenPipeError):
            wire.write(f"{json.dumps(message)}\n")
            wire.flush()

    with listening(_reporter(send)):
        answer = _answer(arguments)
        answered.set()
        send(**answer)


def _line() -> bytes:
    """Return the line of standard input; Python's own buffer stays unused, which a thread must not hold at the end."""
    with os.fdopen(os.dup(0), "rb", buffering=0) as file:
        return file.readline()


def _end_with_server(answered: threading.Event) -> None:
    while os.read(0, 1):  # nothing more comes: it closes when the server is gone
        pass
    if not answered.is_set():
        os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(PATIENCE_S)
    os._exit(CODE + signal.SIGTERM)


def _reporter(send: Callable[..., None]) -> Callable[[str, int, int], None]:
    """Return what sends the progress: the begin and the end of a step, and between them one every EVERY_S."""
    last, due = "", 0.0

    def report(what: str, done: int, total: int) -> None:
        nonlocal last, due
        now = time.monotonic()
        if what != last or now >= due or 0 < total <= done:
            last, due = what, now + EVERY_S
            send(progress=[what, done, total])

    return report


def _answer(arguments: list[str]) -> dict[str, Any]:
    """Return the last message of a call."""
    with redirect_stdout(StringIO()) as printed, redirect_stderr(StringIO()) as told:
        try:
            with files_in_one_line():
                if arguments[0] == EXPLAIN:
                    return {"answer": explained(Path(arguments[1]), baseline="baseline" in arguments[2:])}
                if arguments[0] == "check":
                    refuse_many(arguments[-1])
                run(with_json(arguments))
        except RigError as error:
            return {"error": str(error)}
        except Exception:  # noqa: BLE001 # the agent gets one line, the operator all of it
            traceback.print_exc(file=sys.__stderr__)
            return {"error": INTERNAL}
    remark = " ".join(told.getvalue().split())
    if not printed.getvalue():
        return {"error": remark or INTERNAL}
    return {"answer": json.loads(printed.getvalue()), "remark": remark}


def with_json(arguments: list[str]) -> list[str]:
    """Return a command line with --json, before its arguments."""
    end = arguments.index("--") if "--" in arguments else len(arguments)
    return [*arguments[:end], "--json", *arguments[end:]]


def explained(log: Path, *, baseline: bool) -> dict[str, Any]:
    """Return the conclusion of a log as data.  BadInput: it is no log, or cannot be scored."""
    from rig.verdict.of_log import score_log
    from rig.verdict.score_records import Yardstick

    scored = score_log(log, Yardstick(), baseline)
    identity = {"log": str(log), "title": scored.scenario.title, "seed": scored.scenario.seed, "voter": scored.voter}
    return {**identity, "digest": scored.digest, **scored.conclusion.as_dict()}


def refuse_many(name: str) -> None:
    """Raise BadInput for a suite of more than MOST_FLIGHTS flights."""
    from rig.studies.campaign import campaign_file
    from rig.studies.campaign.plan import Plan
    from rig.studies.campaign.suite import read_suite

    flights = 0
    for case in read_suite(name).cases:
        if case.kind == "campaign":
            flights += Plan(campaign_file.read(case.path, case.set), str(case.path)).count(case.runs)
        else:
            flights += 1
    if flights > MOST_FLIGHTS:
        raise BadInput(f"{name}: {flights} flights; rig mcp flies at most {MOST_FLIGHTS} in one call")


if __name__ == "__main__":
    main()
