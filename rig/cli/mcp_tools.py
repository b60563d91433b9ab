"""The tools of ``rig mcp``: the arguments of each, and the command line of ``rig`` that answers it."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, NamedTuple

from pydantic import Field

from rig.core.confined import is_below
from rig.core.errors import BadInput
from rig.core.settings import Settings, build
from rig.core.text import nearest, quoted
from rig.core.threads import cores

MOST_FRAMES: Final = 60_000  # of one flight: ten minutes at 100 a second
MOST_FLIGHTS: Final = 2_000  # of one call
MOST_WORKERS: Final = cores()
EXPLAIN: Final = "explain"  # the only tool that is no command


@dataclass(frozen=True, slots=True)
class Places:
    """The folders of a server, without links in their paths."""

    write: Path
    read: tuple[Path, ...] = ()

    def readable(self, key: str, name: str) -> str:
        """Return the path of an existing file or folder below the folders; ``name`` where there is none: a bundled one.

        BadInput: it is outside the folders, or an absolute path without a file.
        """
        homes = (self.write, *self.read)
        places = [home / name for home in homes]  # an absolute name is its own place
        there = [place for place in places if _exists(place)]
        inside = [place for place in there or places if is_below(place, homes)]
        if not inside:
            raise BadInput(f"{key}: {quoted(name)} is not in a folder that this server reads: {_listed(homes)}")
        if there:
            return os.path.realpath(inside[0])
        if Path(name).is_absolute():
            raise BadInput(f"{key}: {quoted(name)}: no such file")
        return name

    def existing(self, key: str, name: str) -> str:
        """Return the path of what has no bundled names: a log, a recording, a folder.  BadInput: there is none."""
        path = self.readable(key, name)
        if not Path(path).is_absolute():
            raise BadInput(f"{key}: {quoted(name)}: no such file in {_listed((self.write, *self.read))}")
        return path

    def writable(self, key: str, name: str) -> str:
        """Return the path below the folder that is written to.  BadInput: it is elsewhere."""
        if not is_below(self.write / name, (self.write,)):
            raise BadInput(f"{key}: {quoted(name)} is not in the folder that this server writes: {self.write}")
        return os.path.realpath(self.write / name)


def _exists(path: Path) -> bool:
    try:
        return os.path.lexists(path)
    except ValueError:  # no name of a file
        return False


def _listed(folders: Sequence[Path]) -> str:
    return ", ".join(dict.fromkeys(map(str, folders)))


class _Arguments(Settings):
    keys_are_in: ClassVar[str] = "docs/how-to/let-an-agent-fly.md"

    @abstractmethod
    def _words(self, places: Places) -> Iterator[str]:
        """Yield the command line after ``rig``; BadInput: a path outside the folders."""


def _text(about: str, default: Any = ...) -> Any:
    return Field(default=default, description=about, max_length=4096)


_SCENARIO: Final = "Name of a bundled scenario (tool scenarios), or a scenario file (TOML) below the folders."
_OVERRIDES: Final = (
    'Settings over the scenario by dotted key, for example {"seed": 3, "duration_s": 20, '
    '"redundancy.manager": "median", "faults.0.start_s": 5}. Managers that are Python code are refused.'
)
_REQUIREMENTS: Final = "Requirements to measure: bundled sets (redundancy, handling) or files."
_LOG: Final = "Log of a flight (.mcap), as the tool fly returned it."
Texts = list[str]


class Fly(_Arguments):
    """Fly one scenario, log every frame, and report which faults were detected and whether the aircraft survived."""

    scenario: str = _text(_SCENARIO)
    overrides: dict[str, Any] = Field(default={}, description=_OVERRIDES)
    seed: int | None = Field(default=None, ge=0, lt=2**63, description="Seed of all random draws.")
    requirements: Texts = Field(default=[], description=_REQUIREMENTS)

    def _words(self, places: Places) -> Iterator[str]:
        yield from ("fly", f"--out={places.write}")
        yield from _sets(self.overrides)
        yield from () if self.seed is None else (f"--seed={self.seed}",)
        yield from _requirements(self.requirements, places)
        yield from ("--", places.readable("scenario", self.scenario))


class Score(_Arguments):
    """Score a flight against the true values: detected and missed faults, false isolations, votes and transients."""

    log: str = _text(_LOG)
    baseline: bool = Field(default=True, description="Fly the fault-free baseline to compare with, for the transients.")
    requirements: Texts = Field(default=[], description=_REQUIREMENTS)

    def _words(self, places: Places) -> Iterator[str]:
        yield "score"
        yield from () if self.baseline else ("--no-baseline",)
        yield from _requirements(self.requirements, places)
        yield from ("--", places.existing("log", self.log))


class Explain(_Arguments):
    """Explain a log: what happened, the most important first, as rows of a place, what happened there, and why."""

    log: str = _text(_LOG)
    baseline: bool = Field(
        default=True, description="Fly the fault-free baseline, to report how far the aircraft moved."
    )

    def _words(self, places: Places) -> Iterator[str]:
        yield from (EXPLAIN, places.existing("log", self.log), *(("baseline",) if self.baseline else ()))


class Vote(_Arguments):
    """Vote recorded channels with the redundancy manager, and report which channels it isolates, and when."""

    recording: str = _text("Recording below the folders: CSV, Parquet or MCAP, a folder of tables, or a log.")
    config: str | None = _text("Settings of the signals (TOML). Not needed for the log of a flight.", None)
    out: str = _text(
        "File to write the votes to, below the folder of this server: .csv, .parquet or .mcap.", "votes.csv"
    )
    align: bool = Field(default=False, description="Remove the constant delays and offsets of the channels.")
    inject: str | None = _text("Scenario, or TOML file with [[faults]], whose faults are injected.", None)
    repair_time: bool = Field(default=False, description="Drop rows whose time repeats or is out of order.")
    requirements: Texts = Field(default=[], description=_REQUIREMENTS)

    def _words(self, places: Places) -> Iterator[str]:
        yield from ("vote", f"--out={places.writable('out', self.out)}")
        yield from () if self.config is None else (f"--config={places.existing('config', self.config)}",)
        yield from () if self.inject is None else (f"--inject={places.readable('inject', self.inject)}",)
        yield from ("--align",) if self.align else ()
        yield from ("--repair-time",) if self.repair_time else ()
        yield from _requirements(self.requirements, places)
        yield from ("--", places.existing("recording", self.recording))


class Diagnose(_Arguments):
    """Find which sensor of a recording was wrong, since when, and whether the manager would have isolated it."""

    recording: str = _text("Log of PX4, ArduPilot, ROS 2 or MDF 4, or a recording, below the folders.")
    config: str | None = _text("Settings of the signals (TOML). Not needed with a preset, or for a flight's log.", None)
    preset: Literal["px4", "ardupilot", "ros2-imu"] | None = Field(
        default=None, description="Preset for a log of another system. Default: by its format."
    )
    inject: list[Literal["step", "freeze", "drift", "noise", "all"]] = Field(
        default=[], description="Faults to try on copies of the log."
    )

    def _words(self, places: Places) -> Iterator[str]:
        yield "diagnose"
        yield from () if self.config is None else (f"--config={places.existing('config', self.config)}",)
        yield from () if self.preset is None else (f"--preset={self.preset}",)
        yield from (f"--inject={','.join(self.inject)}",) if self.inject else ()
        yield from ("--", places.existing("recording", self.recording))


class Check(_Arguments):
    """Check the scenarios, logs and campaigns of a suite against requirements and reference decisions."""

    suite: str = _text("Name of a bundled suite, or a suite file below the folders.")

    def _words(self, places: Places) -> Iterator[str]:
        yield from ("check", "--", places.readable("suite", self.suite))


class Search(_Arguments):
    """Find clusters of flights that violate a requirement, confirm them on new seeds, and minimise their scenarios.

    The same call with the same folder resumes a search that was stopped.
    """

    campaign: str = _text("Campaign whose ranges are searched: a bundled name, or a file below the folders.")
    requirement: Texts = Field(min_length=1, description="Requirements to violate; any of several counts.")
    flights: int = Field(ge=1, le=MOST_FLIGHTS, description="Number of flights of the search.")
    out: str = _text("Folder of the search, below the folder of this server.")
    method: Literal["regions", "cma", "random"] = Field(default="regions", description="How the flights are chosen.")
    against: str | None = _text("KEY=VALUE: keep only flights that do not violate with this override.", None)
    requirements: Texts = Field(default=[], description="Files that define the requirements. Default: bundled sets.")
    bench: bool = Field(default=False, description="Search in open loop, on the true values of a healthy flight.")
    seed: int = Field(default=0, ge=0, lt=2**63, description="Seed of the search.")
    workers: int = Field(default=min(2, MOST_WORKERS), ge=1, le=MOST_WORKERS, description="Number of processes.")
    overrides: dict[str, Any] = Field(default={}, description=_OVERRIDES)

    def _words(self, places: Places) -> Iterator[str]:
        yield from ("search", f"--out={places.writable('out', self.out)}", *_sets(self.overrides))
        yield from (f"--requirement={each}" for each in self.requirement)
        yield from (f"--{key}={getattr(self, key)}" for key in ("flights", "method", "seed", "workers"))
        yield from () if self.against is None else (f"--against={self.against}",)
        yield from ("--bench",) if self.bench else ()
        yield from _requirements(self.requirements, places)
        yield from ("--", places.readable("campaign", self.campaign))


class CampaignStatus(_Arguments):
    """Report how many runs of a campaign or a search are done, which manager votes, and the outcomes."""

    folder: str = _text("Output folder of a campaign or a search, below the folders.")

    def _words(self, places: Places) -> Iterator[str]:
        yield from ("campaign", "status", "--", places.existing("folder", self.folder))


class Scenarios(_Arguments):
    """List the names of the bundled scenarios, each with its title."""

    def _words(self, places: Places) -> Iterator[str]:
        yield from ("scenario", "list")


class Tool(NamedTuple):
    """One tool: its name, its arguments, and what it writes."""

    name: str
    arguments: type[_Arguments]
    writes: bool = False

    @property
    def about(self) -> str:
        """Return the description, in one line."""
        return " ".join((self.arguments.__doc__ or "").split())

    @property
    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the arguments."""
        return {**self.arguments.model_json_schema(), "title": self.name, "description": self.about}

    def command(self, arguments: Mapping[str, Any], places: Places) -> list[str]:
        """Return the command line.  BadInput, one line: an argument that cannot be used."""
        return list(build(self.arguments, dict(arguments), self.name)._words(places))


TOOLS: Final = (
    Tool("scenarios", Scenarios),
    Tool("fly", Fly, writes=True),
    Tool("explain", Explain),
    Tool("score", Score),
    Tool("vote", Vote, writes=True),
    Tool("diagnose", Diagnose),
    Tool("check", Check),
    Tool("search", Search, writes=True),
    Tool("campaign_status", CampaignStatus),
)


def tool(name: str) -> Tool:
    """Return the tool of that name.  BadInput: there is none."""
    for each in TOOLS:
        if each.name == name:
            return each
    near = nearest(name, [each.name for each in TOOLS])[0]
    raise BadInput(f"{quoted(name)}: no such tool; nearest: {near}; all: {', '.join(each.name for each in TOOLS)}")


def _sets(overrides: Mapping[str, Any]) -> Iterator[str]:
    from rig.scenario.overrides import override_texts

    yield from (f"--set={text}" for text in override_texts(overrides))


def _requirements(names: Sequence[str], places: Places) -> Iterator[str]:
    yield from (f"--requirements={places.readable('requirements', name)}" for name in names)
