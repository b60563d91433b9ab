"""Thousands of hostile inputs through every command (docs/project/fuzzing-and-cost.md).

Exit code 1 when one of them ends in a traceback, hangs, leaves a file, answers with more than a line, ...
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads do not survive a fork
sys.path.insert(0, str(Path(__file__).parents[1]))

from hostile_cases import cases, supervise
from hostile_cases.checks import CATEGORIES
from hostile_cases.store import Store
from hostile_cases.supervise import Result


def main() -> int:
    """Run, print the failures as they come and the table at the end."""
    asked = _arguments()
    with tempfile.TemporaryDirectory(prefix="rig") as folder:
        supervise.warm()
        store = Store(Path(folder) / "store")
        store.make()
        some = [cases.named(store, name) for name in asked.only]
        chosen = some or cases.chosen(store, asked.cases, asked.seed, asked.kind)
        began, results = time.monotonic(), list[Result]()
        for result in supervise.run(chosen, Path(folder), asked.workers, asked.limit_s):
            results.append(result)
            _tell(result, bool(some))
        print(_table(results))
        print(f"{len(results)} cases in {time.monotonic() - began:.0f} s, seed {asked.seed}")
    if asked.json:
        asked.json.write_text(json.dumps([_plain(result) for result in results], indent=1))
    return int(any(result.failed for result in results))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=4000)
    parser.add_argument(
        "--kind", action="append", default=[], choices=list(cases.KINDS), help="of these only; repeatable"
    )
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="one case by its name; repeatable")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit-s", type=float, default=supervise.LIMIT_S, help="wall-clock time of a case")
    parser.add_argument("--json", type=Path, metavar="FILE", help="every case and what was seen")
    return parser.parse_args()


def _tell(result: Result, always: bool) -> None:
    case = result.case
    about = f"{case.about}; rig {_shown(case.argv)}"
    for category, seen in result.failed.items():
        print(f"{case.name}  {category}: {seen}\n    {about}", flush=True)
    if always and not result.failed:
        print(f"{case.name}  held, exit code {result.outcome.code}: {about}")


def _shown(argv: tuple[str, ...]) -> str:
    return " ".join(word if len(word) < 60 and word.isprintable() else repr(word)[:60] for word in argv)


def _table(results: list[Result]) -> str:
    heads = ["kind", "cases", "failed", *CATEGORIES]
    rows = [heads]
    for kind in [*cases.KINDS, "all"]:
        mine = [result for result in results if kind in (result.case.kind, "all")]
        count = Counter(category for result in mine for category in result.failed)
        if mine:
            failed = sum(bool(result.failed) for result in mine)
            rows.append([kind, str(len(mine)), str(failed), *(str(count[c]) for c in CATEGORIES)])
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(heads), *lines[1:]])


def _plain(result: Result) -> dict[str, object]:
    case, outcome = result.case, result.outcome
    said = {"name": case.name, "about": case.about, "argv": [word[:200] for word in case.argv], "failed": result.failed}
    return {**said, "exit_code": outcome.code, "wall_s": round(outcome.wall_s, 3), "rss": outcome.rss}


if __name__ == "__main__":
    sys.exit(main())
