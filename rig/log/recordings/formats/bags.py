"""The files of ROS 2 bags: raw messages of an SQLite file, of an MCAP file, or of a folder of them.

Nothing in a file is executed: an SQLite file with views or triggers is no bag.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Container, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from rig.core.errors import BadInput
from rig.core.files import open_regular
from rig.log import foreign
from rig.log.mcap_contents import messages, summary
from rig.log.mcap_messages import MESSAGE_LIMIT, Budget

SQLITE: Final = b"SQLite format 3"
MCAP: Final = b"\x89MCAP0\r\n"
ZSTD: Final = b"\x28\xb5\x2f\xfd"
_SCHEMA: Final = "SELECT name FROM sqlite_master WHERE type NOT IN ('table', 'index') OR sql LIKE 'CREATE VIRTUAL%'"
_TOPICS: Final = "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
_MESSAGES: Final = "SELECT timestamp, CASE WHEN length(data) <= ?2 THEN data END FROM messages WHERE topic_id = ?1"


@dataclass
class Raw:
    """One message as it is stored."""

    topic: str
    kind: str  # sensor_msgs/msg/Imu
    log_ns: int
    data: bytes


@dataclass
class Bag:
    """The files of a bag, and what is told of them while they are read."""

    path: Path
    files: list[Path]
    kinds: dict[str, str] = field(default_factory=dict)  # of all topics
    damage: list[str] = field(default_factory=list)

    def raw(self, wanted: Container[str]) -> Iterator[Raw]:
        """Yield the messages of the types ``wanted``.  BadInput, sqlite3.Error: damaged."""
        for file in self.files:
            with open_regular(file) as opened:
                start = opened.read(16)
            if start.startswith(MCAP):
                yield from self._of_mcap(file, wanted)
            elif start.startswith(SQLITE):
                yield from self._of_sqlite(file, wanted)
            else:
                raise BadInput(f"{file}: neither an SQLite nor an MCAP file")

    def _of_mcap(self, file: Path, wanted: Container[str]) -> Iterator[Raw]:
        with foreign.opened(file) as opened:
            contents = summary(opened, lenient=True)
            of = {c.id: (c, contents.schemas.get(c.schema_id)) for c in contents.channels.values()}
            cdr = {id: (c, s.name) for id, (c, s) in of.items() if s is not None and c.message_encoding == "cdr"}
            self.kinds.update({channel.topic: name for channel, name in cdr.values()})
            mine = {id: (channel.topic, name) for id, (channel, name) in cdr.items() if name in wanted}
            damage: list[str] = []
            for message in messages(opened, contents, mine, Budget(opened), damage):
                yield Raw(*mine[message.channel], message.time_ns, message.data)
            self.damage += [f"{file.name}: {line}" for line in damage]

    def _of_sqlite(self, file: Path, wanted: Container[str]) -> Iterator[Raw]:
        log = file.with_name(f"{file.name}-wal")
        if log.is_file() and log.stat().st_size:
            self.damage.append(f"{log.name} holds rows that were not written back: left out")
        with closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as database:
            if (strange := database.execute(_SCHEMA).fetchone()) is not None:
                raise BadInput(f"{file}: no ROS 2 bag: it has {str(strange[0])[:60]!r}, which is no table")
            topics = database.execute(_TOPICS).fetchall()
            self.kinds.update({str(name): str(kind) for _, name, kind, _ in topics})
            for number, name, kind, encoding in topics:
                if kind in wanted:
                    if encoding != "cdr":
                        raise BadInput(f"{file}: topic {str(name)[:60]!r} is in the encoding {str(encoding)[:20]!r}")
                    yield from self._of_topic(database, file, (number, str(name), str(kind)))

    def _of_topic(self, database: sqlite3.Connection, file: Path, topic: tuple[int, str, str]) -> Iterator[Raw]:
        number, name, kind = topic
        rows = long = 0
        try:
            for log_ns, data in database.execute(_MESSAGES, (number, MESSAGE_LIMIT)):
                if data is None:
                    long += 1
                    continue
                if bytes(data[:4]) == ZSTD:
                    raise BadInput(f"{file}: a bag of compressed messages; ros2 bag convert writes one without")
                yield Raw(name, kind, int(log_ns), bytes(data))
                rows += 1
        except sqlite3.DatabaseError as error:
            self.damage.append(f"{file.name}: {name}: left out what is behind {rows} messages: {error}")
        if long:
            self.damage.append(f"{file.name}: {name}: {long} messages are too long: left out")


def bag(path: Path) -> Bag:
    """Return the bag at ``path``, a file or a folder.  BadInput: a folder without files that can be read."""
    if not path.is_dir():
        return Bag(path, [path])
    files = sorted((f for f in path.iterdir() if f.suffix in (".db3", ".mcap")), key=_by_number)
    if not files and any(path.glob("*.zstd")):
        raise BadInput(f"{path}: a bag of compressed files: unpack them (unzstd {path.name}/*.zstd)")
    if not files:
        raise BadInput(f"{path}: a bag without a .db3 or .mcap file")
    return Bag(path, files)


def is_bag_folder(path: Path) -> bool:
    """Return True if ``path`` is the folder of a ROS 2 bag."""
    return path.is_dir() and ((path / "metadata.yaml").is_file() or any(path.glob("*.db3")))


def _by_number(path: Path) -> list[str]:
    """Return a key that sorts bag_2 before bag_10."""
    return [part.zfill(9) if part.isdecimal() else part for part in re.split(r"([0-9]+)", path.name)]
