"""Printing of the contents of a log of another system."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from rig.cli.common import emit
from rig.cli.printing import field, line, table
from rig.core.column import Column
from rig.core.errors import BadLog
from rig.log.recordings.formats.contents import LogContents
from rig.log.recordings.formats.log_info import log_info
from rig.log.recordings.stamps import digits, span

_TOPICS: Final = (
    *(Column("topic"), Column("measures", lambda row: ", ".join(row["measures"])), Column("rows")),
    *(Column("rate", "rate_hz", ".4g", "Hz"), Column("from", lambda row: digits(row["first_s"]), "", "s")),
    Column("to", lambda row: digits(row["last_s"]), "", "s"),
    Column("unit", lambda row: _units(row), worth=7),
    Column("device", empty="", worth=6),
)
_ALL: Final = (*_TOPICS[:1], *_TOPICS[2:6], Column("fields", lambda row: len(row["units"]), worth=5), _TOPICS[-1])


def info(path: Path, contents: LogContents, all_topics: bool, as_json: bool) -> None:
    """Print what the log at ``path`` holds.  BadLog, after that: it is damaged."""
    facts = log_info(path, contents)
    emit(as_json, facts, lambda: _info(facts, all_topics))
    if facts["damage"] is not None:
        raise BadLog(f"{path}: {facts['damage']}")


def _info(facts: dict[str, Any], all_topics: bool) -> None:
    """Print the format, the topics with sensors or all topics, what can be compared, remarks and damage."""
    first, last = facts["time_s"]
    line((facts["log"], "bold"), f"  {facts['format']} log")
    field("span", f"{span(first, last)}, {facts['bytes']} bytes, {len(facts['topics'])} topics")
    if all_topics:
        table(facts["topics"], _ALL)
    else:
        table((topic for topic in facts["topics"] if topic["sensor"]), _TOPICS)
    for found in facts["compared"]:
        others = f"; more than four: not {', '.join(found['others'])}" if found["others"] else ""
        rate = f"{found['rate_hz']:.3g} Hz"
        field("compared", f"{found['quantity']} of {', '.join(found['topics'])}, {found['unit']}, {rate}{others}")
    if not facts["compared"]:
        field("compared", _nothing(facts))
    for remark in facts["remarks"]:
        field("remark", remark)
    field("health", facts["damage"] or "nothing was left out", style="yellow" if facts["damage"] else "")


def _nothing(facts: dict[str, Any]) -> str:
    if facts["preset"] is None:
        return "nothing by itself: the names are the user's; --config of rig vote names the channels"
    return "nothing: one channel of each sensor"


def _units(row: dict[str, Any]) -> str:
    return ", ".join(dict.fromkeys(unit for unit in (row["measures"] or row["units"]).values() if unit))


def compared(tables: dict[str, Any]) -> None:
    """Print the signals of a CONFIG that a preset wrote, and where their channels are."""
    mapping = tables["mapping"]
    rows = [
        {
            "signal": name,
            "channels": ", ".join(place for column, place in mapping.items() if column.rpartition(".")[0] == name),
            **settings,
        }
        for name, settings in tables["signal"].items()
    ]
    table(rows, (Column("signal"), Column("threshold", format=".4g"), Column("unit"), Column("channels", worth=5)))
