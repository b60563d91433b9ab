"""A unit file: the flight software under test, its transport, and the rules for missing answers."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

from pydantic import Field, PrivateAttr, field_validator, model_validator

from rig.core.confined import may_run_code
from rig.core.errors import BadInput
from rig.core.files import is_file, is_folder, open_regular, reported
from rig.core.frame import COMPUTERS
from rig.core.settings import Settings, build, read_toml
from rig.unit.environment import NUL, preloaded, wrong_in, wrong_preload

LARGEST_FILE: Final = 1 << 30  # bytes of a library, an FMU or a program
LOOPBACK: Final = re.compile(r"127\.\d+\.\d+\.\d+|localhost")
_ADDRESS: Final = re.compile(r"([\w.-]+):(\d{1,5})")
_IS: Final = {"library": "a library", "fmu": "an FMU, one file"}
_NEEDS: Final = {"library": "path", "fmu": "path", "python": "manager"}


class FmuMapping(Settings):
    """The variable of an FMU for each element of the records, by addresses like ``channels.pitch_rate.1``."""

    keys_are_in: ClassVar[str] = "rig unit schema"

    parameters: dict[str, str] = Field(default_factory=dict)  # elements of CONFIG
    constants: dict[str, float] = Field(default_factory=dict)  # by variable, in its own unit
    inputs: dict[str, str] = Field(default_factory=dict)
    outputs: dict[str, str] = Field(min_length=1)


class Unit(Settings):
    """The settings of one unit under test; times in s, counts in frames."""

    keys_are_in: ClassVar[str] = "rig unit schema"

    name: str = Field(min_length=1, max_length=60)
    role: Literal["redundancy", "flight-computer", "control-law"] = "redundancy"
    transport: Literal["library", "udp", "fmu", "python"] = "library"
    path: str | None = None  # of a library or an FMU, from the folder of the unit file
    manager: str | None = None  # module:name, of the transport python
    law: str | None = None  # the same for the role control-law
    voter: str | None = None  # of a control law: the unit file that votes for it, from the folder of this one
    command: list[str] | None = Field(default=None, min_length=1)  # udp: started by the rig; {address} is the rig's own
    address: str | None = None  # udp: of a unit that runs already
    remote: bool = False  # an address that is not of this machine may be used
    isolate: bool = True  # a library runs in a child process
    latency_frames: int = Field(default=0, ge=0, le=16)  # the answer to frame k is flown in k + latency_frames
    start_s: float = Field(default=5.0, gt=0, le=600)  # until it has sent READY
    timeout_s: float = Field(default=2.0, ge=0, le=3600)  # lockstep: then it is dead; 0 waits for ever
    deadline: float = Field(default=0.8, gt=0, le=1)  # paced: share of the frame by which the answer must be here
    on_miss: Literal["hold", "fault", "end"] = "hold"
    max_missed: int = Field(default=10, ge=1)  # frames in a row; then it is dead
    on_dead: Literal["end", "hold", "backup", "restart"] = "end"
    lane: Literal["A", "B", "C", "D"] | None = None  # of several computers, the one that it is; None: the only one
    fmu: FmuMapping | None = None  # of an FMU that has not our variables
    reuse: bool = True  # a campaign flies one session after the other with the same process
    files: list[str] = Field(default_factory=list)  # that it reads, from the folder of the unit file
    environment: dict[str, str] = Field(default_factory=dict)  # of its process; ${folder}, ${scratch} are places
    _folder: Path = PrivateAttr(default=Path())  # of the unit file
    _source: str = PrivateAttr(default="")  # the unit file as it was named
    _hashes: dict[str, str] | None = PrivateAttr(default=None)  # of all its files, when they were first read
    _voter: Unit | None = PrivateAttr(default=None)  # of ``voter``

    @field_validator("path", "command")
    @classmethod
    def _without_nul(cls, value: str | list[str] | None) -> str | list[str] | None:
        if NUL in "".join(value or ()):
            raise ValueError("must not contain the character NUL")
        if value is not None and not value[0]:
            raise ValueError("must not be empty")
        return value

    @field_validator("files")
    @classmethod
    def _inside(cls, files: list[str]) -> list[str]:
        for name in files:
            if not name or NUL in name:
                raise ValueError(f"{name!r} is not the name of a file")
            if Path(name).is_absolute():
                raise ValueError(f"{name}: must be relative to the folder of the unit file")
        return files

    @field_validator("environment")
    @classmethod
    def _of_variables(cls, environment: dict[str, str]) -> dict[str, str]:
        if wrong := wrong_in(environment):
            raise ValueError(wrong)
        return environment

    @field_validator("address")
    @classmethod
    def _host_and_port(cls, address: str | None) -> str | None:
        parts = None if address is None else _ADDRESS.fullmatch(address)
        if address is not None and (parts is None or not 0 < int(parts[2]) < 65536):
            raise ValueError(f"must be host:port, got {address!r}")
        return address

    @model_validator(mode="after")
    def _fits_its_transport(self) -> Unit:
        needed = "law" if self.transport == "python" and self.replaces_law else _NEEDS.get(self.transport)
        if needed is not None and getattr(self, needed) is None:
            raise ValueError(f"{needed}: missing; the transport {self.transport} needs it")
        for key in ("manager", "law"):
            if getattr(self, key) is not None and key != needed:
                raise ValueError(f"{key}: not with the transport {self.transport} and the role {self.role}")
        if self.voter is not None and (self.role != "control-law" or self.lane is not None):
            raise ValueError("voter: only of a control law that is no lane")
        if self.transport == "udp" and (self.command is None) == (self.address is None):
            raise ValueError("transport udp: needs either command, which the rig starts, or address, of a running unit")
        if self.address is not None and not self.remote and not LOOPBACK.fullmatch(self.host_and_port[0]):
            raise ValueError(f"address: {self.address} is not on this machine; remote = true permits it")
        if self.fmu is not None and self.transport != "fmu":
            raise ValueError(f"fmu: the transport {self.transport} has no variables to map")
        if self.on_dead == "restart" and (self.address is not None or self.transport == "python" or not self.isolate):
            raise ValueError("on_dead: the rig can restart only a unit that it has started")
        return self

    @model_validator(mode="after")
    def _has_what_it_reads(self) -> Unit:
        if self.transport == "python" and self.files:
            raise ValueError("files: not with the transport python; the rig finds the files of a class itself")
        if self.environment and (self.address is not None or self.transport == "python" or not self.isolate):
            own = "runs already" if self.address is not None else "runs in the process of the rig"
            raise ValueError(f"environment: the unit {own}; variables need a process that the rig starts for it")
        return self

    @property
    def replaces_law(self) -> bool:
        """True if the rig votes, and the unit commands the surfaces."""
        return self.role == "control-law"

    @property
    def beside(self) -> Unit | None:
        """The unit that votes for a control law."""
        return self._voter

    @property
    def votes(self) -> bool:
        """True if the unit, or the one beside it, replaces the manager."""
        return not self.replaces_law or self.voter is not None

    @property
    def is_manager(self) -> bool:
        """True for a manager class in Python, which flies as ``redundancy.manager``."""
        return self.manager is not None

    @property
    def host_and_port(self) -> tuple[str, int]:
        """The parts of ``address``."""
        host, _, port = (self.address or "127.0.0.1:0").rpartition(":")
        return host, int(port)

    @property
    def source(self) -> str:
        """The unit file and the unit, as messages name them."""
        return f"{self._source or 'the unit'}: {self.name}"

    @property
    def folder(self) -> Path:
        """The folder of the unit file."""
        return self._folder

    @property
    def unit_file(self) -> str:
        """The unit file as it was named; empty for settings that were read from none."""
        return self._source

    @property
    def file(self) -> Path:
        """The library, the FMU, the started program or the module of a law; an empty path for a box and a manager."""
        if self.law is not None:
            module = self.law.partition(":")[0].replace(".", "/")
            return next(filter(is_file, (self._folder / f"{module}.py", Path(f"{module}.py"))), Path())
        if self.path is not None:
            return self._folder / self.path
        if self.command is None:
            return Path()
        program = self._folder / self.command[0]
        return program if is_file(program) else Path(self.command[0])

    def sha256(self) -> str:
        """Return the hash of library, FMU or program, in hexadecimal; empty if there is none.  BadInput."""
        return self.hashes().get(self._named, "")

    @property
    def _named(self) -> str:
        """Return library, FMU or program as the unit file names it; the file of a law in Python."""
        return self.path or (self.file.name if self.law is not None else (self.command or [""])[0])

    def hashes(self) -> dict[str, str]:
        """Return the SHA-256 of each file of the unit by its name, as the file was when it was first read.  BadInput.

        These are library, FMU or program; files that the command names; ``files``; libraries of LD_PRELOAD.  Other
        files of the machine, such as an interpreter, are not included.
        """
        if self._hashes is None:
            self._hashes = self._hashed()
        return self._hashes

    def _hashed(self) -> dict[str, str]:
        found = {self._named: self.file} if self.file.name and is_file(self.file) else {}
        words = [word for word in (self.command or [])[1:] if is_file(self._folder / word)]
        found |= {word: self._folder / word for word in [*words, *self.files]}
        found |= dict(preloaded(self.environment, self._folder))
        return {name: self._digest(name, path) for name, path in found.items()}

    def _digest(self, name: str, path: Path) -> str:
        where = f"{self._source}: files: {name}" if name in self.files else f"{self.source}: {name}"
        with open_regular(path, LARGEST_FILE, where=where) as file, reported(where, BadInput, "cannot be read"):
            return hashlib.file_digest(file, "sha256").hexdigest()

    def require_unchanged(self) -> None:
        """Raise BadInput if a file is no longer the one that was first read."""
        was, now = self.hashes(), self._hashed()
        for name in (name for name in {**was, **now} if was.get(name) != now.get(name)):
            raise BadInput(f"{self.source}: {name}: is not the file that it was when the unit file was read")

    def build(self) -> str:
        """Return the hash that changes with the unit: with one of its files, and with its environment.  BadInput."""
        if self._voter is not None:
            both = self.model_copy(update={"voter": None}), self._voter
            both[0]._voter = None
            return hashlib.sha256("".join(unit.build() for unit in both).encode()).hexdigest()
        if not self.environment and self.hashes().keys() <= {self._named}:
            return self.sha256()
        what = [self.sha256(), self.hashes(), self.environment]
        return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()

    def about(self) -> dict[str, Any]:
        """Return the settings for a log, with the hash of each file."""
        return {**self.settings(), "read_sha256": self.hashes(), "sha256": self.sha256()}

    def settings(self, of_voter: str = "about") -> dict[str, Any]:
        """Return the settings, with what a method of the voter returns."""
        voter = {} if self._voter is None else {"voter": getattr(self._voter, of_voter)()}
        return {**self.model_dump(exclude_none=True), **voter}

    def identity(self) -> dict[str, Any]:
        """Return the settings and the build, which decide the flights of a campaign.  BadInput."""
        read = {"read_sha256": self.hashes(), "sha256": self.build()}
        return {**self.settings("identity"), **read}


def as_lane(unit: Unit | None, lane: str | None) -> Unit | None:
    """Return the settings of a unit as ``lane``, or as the lane of its file if None.  BadInput: it cannot."""
    if unit is None and lane is None:
        return None
    if unit is None:
        raise BadInput(f"--lane {lane}: needs --unit, the unit under test")
    if lane is not None and lane not in COMPUTERS:
        raise BadInput(f"--lane {lane}: must be one of {', '.join(COMPUTERS)}")
    unit = unit if lane is None else unit.model_copy(update={"lane": lane})
    if unit.lane is not None and unit.voter is not None:
        raise BadInput(f"{unit.source}: voter: only of a control law that is no lane")
    if unit.lane is not None and unit.is_manager:
        raise BadInput(f"{unit.source}: lane: a Python class replaces the manager, and cannot be one of several lanes")
    return unit


def read_unit(path: Path | str) -> Unit:
    """Read the settings of a unit file.  BadInput: a wrong setting."""
    path = Path(path)
    if not may_run_code():
        raise BadInput(f"{path}: a unit under test is code, and rig mcp runs no code")
    unit = build(Unit, read_toml(path), str(path))
    unit._folder, unit._source = path.resolve().parent, str(path)
    if unit.path is not None and not is_file(unit.file):
        what = f"is a folder, must be {_IS[unit.transport]}" if is_folder(unit.file) else "no such file"
        raise BadInput(f"{path}: path: {unit.path}: {what}")
    if wrong := wrong_preload(unit.environment, unit.folder):
        raise BadInput(f"{path}: environment: {wrong}")
    unit.hashes()
    if unit.voter is not None:
        unit._voter = _read_voter(unit, path)
    return unit


def _read_voter(unit: Unit, path: Path) -> Unit:
    """Read the unit that votes for a control law.  BadInput."""
    where = f"{path}: voter: {unit.voter}"
    if not is_file(unit.folder / str(unit.voter)):
        raise BadInput(f"{where}: no such file")
    voter = read_unit(unit.folder / str(unit.voter))
    if voter.role != "redundancy" or voter.lane is not None:
        raise BadInput(f"{where}: must have the role redundancy, and no lane")
    if voter.is_manager:
        raise BadInput(f"{where}: a manager in Python votes as redundancy.manager, without a unit file")
    return voter
