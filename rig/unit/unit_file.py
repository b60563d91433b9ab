"""A unit file: the flight software under test, its transport, and the rules for missing answers."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

from pydantic import Field, PrivateAttr, field_validator, model_validator

from rig.core.confined import may_run_code
from rig.core.errors import BadInput
from rig.core.files import is_file, is_folder, open_regular, reported
from rig.core.frame import COMPUTERS
from rig.core.settings import Settings, build, read_toml

LARGEST_FILE: Final = 1 << 30  # bytes of a library, an FMU or a program
LOOPBACK: Final = re.compile(r"127\.\d+\.\d+\.\d+|localhost")
_ADDRESS: Final = re.compile(r"([\w.-]+):(\d{1,5})")
_IS: Final = {"library": "a library", "fmu": "an FMU, one file"}
_BUILD: Final = 12  # characters of a hash that are shown
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
    role: Literal["redundancy", "flight-computer"] = "redundancy"
    transport: Literal["library", "udp", "fmu", "python"] = "library"
    path: str | None = None  # of a library or an FMU, from the folder of the unit file
    manager: str | None = None  # module:name, of the transport python
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
    _folder: Path = PrivateAttr(default=Path())  # of the unit file
    _source: str = PrivateAttr(default="")  # the unit file as it was named

    @field_validator("path", "command")
    @classmethod
    def _without_nul(cls, value: str | list[str] | None) -> str | list[str] | None:
        if "\0" in "".join(value or ()):
            raise ValueError("must not contain the character NUL")
        if value is not None and not value[0]:
            raise ValueError("must not be empty")
        return value

    @field_validator("address")
    @classmethod
    def _host_and_port(cls, address: str | None) -> str | None:
        parts = None if address is None else _ADDRESS.fullmatch(address)
        if address is not None and (parts is None or not 0 < int(parts[2]) < 65536):
            raise ValueError(f"must be host:port, got {address!r}")
        return address

    @model_validator(mode="after")
    def _fits_its_transport(self) -> Unit:
        needed = _NEEDS.get(self.transport)
        if needed is not None and getattr(self, needed) is None:
            raise ValueError(f"{needed}: missing; the transport {self.transport} needs it")
        if self.transport == "udp" and (self.command is None) == (self.address is None):
            raise ValueError("transport udp: needs either command, which the rig starts, or address, of a running unit")
        if self.address is not None and not self.remote and not LOOPBACK.fullmatch(self.host_and_port[0]):
            raise ValueError(f"address: {self.address} is not on this machine; remote = true permits it")
        if self.fmu is not None and self.transport != "fmu":
            raise ValueError(f"fmu: the transport {self.transport} has no variables to map")
        if self.on_dead == "restart" and (self.address is not None or self.transport == "python" or not self.isolate):
            raise ValueError("on_dead: the rig can restart only a unit that it has started")
        return self

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
        """The library, the FMU or the started program; an empty path for a box and a class."""
        if self.path is not None:
            return self._folder / self.path
        if self.command is None:
            return Path()
        program = self._folder / self.command[0]
        return program if is_file(program) else Path(self.command[0])

    def sha256(self) -> str:
        """Return the hash of library, FMU or program, in hexadecimal; empty if there is none.  BadInput."""
        if not self.file.name or not is_file(self.file):
            return ""
        return self._digest(self.file, f"{self.source}: {self.file}").hexdigest()

    def _digest(self, path: Path, where: str) -> Any:
        with open_regular(path, LARGEST_FILE, where=where) as file, reported(where, BadInput, "cannot be read"):
            return hashlib.file_digest(file, "sha256")

    def build(self) -> str:
        """Return the hashes that change with the unit: of its file, and of the files that its command names.  BadInput.

        Other files of the machine, such as an interpreter, are not included.
        """
        beside = [word for word in (self.command or [])[1:] if is_file(self._folder / word)]
        if not beside:
            return self.sha256()
        digest = hashlib.sha256(self.sha256().encode())
        for word in beside:
            digest.update(word.encode() + self._digest(self._folder / word, f"{self.source}: {word}").digest())
        return digest.hexdigest()

    def about(self) -> dict[str, Any]:
        """Return the settings for a log."""
        return {**self.model_dump(exclude_none=True), "sha256": self.sha256()}

    def identity(self) -> dict[str, Any]:
        """Return the settings and the build, which decide the flights of a campaign.  BadInput."""
        return {**self.model_dump(exclude_none=True), "sha256": self.build()}


def voter(manager: str, unit: str | None = None, lane: str | None = None) -> str:
    """Return the voter of a flight, as every command names it: the ``unit`` under test, or without one the manager.

    lane : the lane that the unit replaced, if there are several computers
    """
    if lane is not None:
        return f"manager {manager}, unit {unit} as lane {lane}"
    return f"manager {manager}" if unit is None else f"unit {unit}"


def voted_by(manager: str, unit: Mapping[str, Any] | None) -> str:
    """Return the voter for the column ``manager`` of ``runs``: ``mean``, or ``unit mvs 0a1b2c3d4e5f``.

    unit : its settings, and its build as ``sha256``; a box at an address has none
    """
    if unit is None:
        return manager
    named = f"{unit['name']} {unit.get('sha256', '')[:_BUILD]}".rstrip()
    return voter(manager, named, unit.get("lane"))


def as_lane(unit: Unit | None, lane: str | None) -> Unit | None:
    """Return the settings of a unit as ``lane``, or as the lane of its file if None.  BadInput: it cannot."""
    if unit is None and lane is None:
        return None
    if unit is None:
        raise BadInput(f"--lane {lane}: needs --unit, the unit under test")
    if lane is not None and lane not in COMPUTERS:
        raise BadInput(f"--lane {lane}: must be one of {', '.join(COMPUTERS)}")
    unit = unit if lane is None else unit.model_copy(update={"lane": lane})
    if unit.lane is not None and unit.transport == "python":
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
    return unit
