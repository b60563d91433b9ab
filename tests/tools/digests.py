"""One digest a flight, however it is flown: bundled scenarios, and runs of the bundled campaigns.

    python tests/tools/digests.py [--seconds 5] [--only NAME ...]
    python tests/tools/digests.py --campaigns [--runs 3] [--only NAME ...]

Each scenario, to its end or for so many seconds: in memory and logged, in blocks of 0.1 to 5 s, unpaced and paced; then
from its log: of the rows that are read, of a what if that changes nothing, of the flight that it describes.  Of each
campaign the first runs as `rig campaign run` flies them, and each once more as `rig campaign fly` does.  One line each;
1 when anything has another digest.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final
from unittest.mock import patch

from rig.bench.replay.what_if import what_if
from rig.core.files import bundled
from rig.flight.block_length import SECONDS
from rig.flight.fly import fly
from rig.flight.summary import Verdict
from rig.log import read_log
from rig.log.recordings.flown_log import recorded
from rig.scenario import scenario
from rig.scenario.scenario import Scenario, from_resolved
from rig.studies.campaign import campaign_file as config
from rig.studies.campaign.flying import fly as fly_in_memory
from rig.studies.campaign.folder import open_folder
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.run_campaign import again, run

BLOCKS_S: Final = (0.1, 0.37, 0.5, 1.0, 5.0)
AT_ONCE: Final = 1e6  # times as fast as the clock: paced, and never waiting


@contextmanager
def blocks_of(seconds: float) -> Iterator[None]:
    """Have every flight in blocks of so many seconds."""
    with patch.dict(SECONDS, dict.fromkeys(SECONDS, seconds)):
        yield


def ways(given: Scenario, folder: Path) -> Iterator[tuple[str, str]]:
    """Yield how a scenario is flown and its digest, the first as a campaign and the second as ``rig fly`` flies it."""
    yield "in memory", fly_in_memory(given).verdict.digest
    flight = fly(given, out=folder)
    yield "logged", flight.digest
    yield "paced", fly(given, out=folder, realtime_factor=AT_ONCE).digest
    for seconds in BLOCKS_S:
        with blocks_of(seconds):
            yield f"in memory, {seconds:g} s", fly_in_memory(given).verdict.digest
    for factor, word in ((None, "logged"), (AT_ONCE, "paced")):
        with blocks_of(BLOCKS_S[0]):
            yield f"{word}, {BLOCKS_S[0]:g} s", fly(given, out=folder, realtime_factor=factor).digest
    yield from of_log(flight.log, folder)


def of_log(path: Path, folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the digest that a log states, and those that are made again from it."""
    log, verdict, recording = read_log(path), Verdict(), recorded(path)
    yield "stated", (log.result or {})["digest"]
    verdict.add(log.table, [])
    yield "rows read", verdict.digest
    nothing = what_if(recording, recording.scenario, folder / "nothing.mcap")
    yield "what if nothing", (read_log(nothing.path).result or {})["digest"]
    yield "flown again", fly(from_resolved(json.loads(log.metadata["scenario"]), path.name), out=folder).digest


def of_scenarios(seconds: float | None, only: list[str]) -> int:
    """Print a line a scenario; return how many have several digests."""
    paths, wrong = [path for path in sorted(bundled("faults").glob("*.toml")) if not only or path.stem in only], 0
    for path in paths:
        given = scenario.load(path)
        if seconds is not None and seconds < given.duration_s:
            given = scenario.load(path, [f"duration_s={seconds:g}"])
        with TemporaryDirectory() as folder:
            found = dict(ways(given, Path(folder)))
        usual = next(iter(found.values()))
        others = [how for how, digest in found.items() if digest != usual]
        wrong += bool(others)
        beside = ", ".join(given.row_parts) or "rows alone"
        said = f"{len(others)} of {len(found)} OTHERS: {', '.join(others)}" if others else f"{len(found)} ways alike"
        print(f"{path.stem:42} {usual[:16]} {said} ({given.frames} frames, {beside})", flush=True)
    print(f"{len(paths) - wrong} of {len(paths)} scenarios have one digest")
    return wrong


def of_campaigns(runs: int, only: list[str]) -> int:
    """Print a line a campaign; return in how many a run does not have the table's digest."""
    paths, wrong = sorted(bundled("faults/campaigns").glob("*.toml")), 0
    paths = [path for path in paths if not only or path.stem in only]
    for path in paths:
        with TemporaryDirectory() as name:
            folder = Path(name)
            flown = run(Plan(config.read(path), str(path)), folder / "table", runs=runs, workers=1, logs="none")
            campaign = open_folder(folder / "table")
            pairs = [again(campaign, k, folder / "logs") for k in range(flown.done)]
        same = sum(flight.digest == digest for flight, digest in pairs)
        wrong += same != runs
        beside = {part for flight, _ in pairs for part in flight.scenario.row_parts}
        said = "the table's digest" if same == runs else "OTHER DIGESTS"
        print(f"{path.stem:20} {same} of {runs}: {said} ({', '.join(sorted(beside)) or 'rows alone'})", flush=True)
    print(f"{len(paths) - wrong} of {len(paths)} campaigns are flown again to the digests of their tables")
    return wrong


def main() -> int:
    """Read the options."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--campaigns", action="store_true")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--only", nargs="+", default=[])
    given = parser.parse_args()
    wrong = of_campaigns(given.runs, given.only) if given.campaigns else of_scenarios(given.seconds, given.only)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
