"""Printing of ``rig vote``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rig.cli.printing import line, table
from rig.core.column import Column
from rig.log.recordings.stamps import LONG_AGO_S, digits, of_rows, utc
from rig.log.recordings.time_order import UNIX_S

_SIGNALS = (
    *(Column("signal", "name"), Column("level")),
    Column("split frames", lambda row: f"{100 * row['split_share']:.3g} %", worth=6),
    Column("unresolved", lambda row: f"{100 * row['unresolved_share']:.3g} %", worth=5),
    *(Column("spread median", "spread.median", ".4g", worth=5), Column("95 %", "spread.p95", ".4g", worth=3)),
    *(Column("worst", "spread.max", ".4g", worth=4), Column("voted from", "voted.min", ".4g", worth=7)),
    *(Column("to", "voted.max", ".4g", worth=7), Column("unit", worth=8)),
)
_DISCRETES = (
    *(Column("discrete", "name"), Column("level"), Column("fail-safe", "fail_safe", worth=4)),
    Column("voted 1", lambda row: f"{100 * row['ones_share']:.3g} %"),
    Column("changes", worth=5),
)
_CHANNELS = (
    *(Column("channel", "name"), Column("at the end", "state"), Column("suspect rows", "suspect", worth=7)),
    Column("isolated in frame", "frame", worth=5),
    *(Column("at"), Column("by", "why"), Column("invalid samples", "invalid", worth=6)),
)
_OTHERS = (
    Column("not voted", lambda row: f"{row['name']}, recorded {row['recorded']}"),
    *(Column("off the vote, median", "median_difference", ".4g"), Column("largest", "largest_difference", ".4g")),
    Column("beyond the threshold", lambda row: _percent(row["beyond_threshold_share"])),
    Column("invalid samples", "invalid_samples", worth=6),
)
_INJECTED = (
    Column("injected", "fault"),
    Column("channel", lambda fault: f"{fault['signal']}.{fault['channel']}"),
    Column("onset", worth=5),
    Column("outcome"),
    Column("failed", lambda fault: fault["failed_channel"] and f"{fault['signal']}.{fault['failed_channel']}"),
    Column("delay", lambda fault: None if fault["delay_s"] is None else f"{fault['delay_s']:.3f} s", worth=7),
    Column("by", worth=6),
)
_ALIGNED = (
    *(Column("channel", "name"), Column("delay in frames", "delay_frames", ".2f", worth=5)),
    *(Column("in ms", lambda row: f"{1e3 * row['delay_s']:.2f}"), Column("offset", format=".4g")),
    Column("correlation", format=".2f", worth=6),
    Column("", lambda row: "" if row["aligned"] else "not aligned: resembles no other channel"),
)
_MATRICES = (
    Column("triad", lambda channel: f"{channel['triad']}, channel {channel['channel']}"),
    Column("rotated by", lambda channel: None if channel["mirrored"] else channel["rotation_deg"], ".2f", "deg"),
    Column("gains", lambda channel: f"{channel['gains'][-1]:.3f} to {channel['gains'][0]:.3f}", worth=5),
    *(Column("off before, rms", "rms_before", ".4g", worth=6), Column("after", "rms_after", ".4g", worth=6)),
    Column("", lambda channel: _not_corrected(channel)),
)
_REQUIREMENTS = (
    *(Column("requirement"), Column("on", "signal"), Column("verdict", "status")),
    *(Column("robustness", format=".3g"), Column("at s", "instant_s", ".6g")),
)


def vote(summary: dict[str, Any]) -> None:
    """Print the summary as tables, the time of each step, and the file of the votes."""
    first, last = summary["time_s"]
    since = ", +: since the first row" if abs(first) >= LONG_AGO_S else ""
    line(f"{summary['rows']} rows from {_from_to(first, last)}{since}, {summary['rate_hz']:g} per second")
    for remark in summary["remarks"]:
        line(remark)
    for repair in summary["repaired"]:
        line(_repaired(repair))
    if "alignment" in summary:
        _alignments(summary)
    table(_named(summary["signals"]), _SIGNALS)
    table(_named(summary["discretes"]), _DISCRETES)
    table(_channels(summary), _CHANNELS)
    _latched(summary)
    _not_voted(summary)
    for doubt in (*summary["from_first_row"], *summary["suspects"], *summary["undecided"]):
        line(doubt, style="yellow")
    faults = summary.get("injected", {}).get("faults", ())
    table(({**fault, "onset": _at(fault["onset_s"], first)} for fault in faults), _INJECTED)
    table(summary.get("requirements", ()), _REQUIREMENTS)
    if summary["not_voted"]:
        line(f"not voted, because CONFIG does not name them: {', '.join(summary['not_voted'])}")
    for warning in summary["warnings"]:
        line(f"warning: {warning}")
    line(", ".join(f"{stage} {taken:.2f} s" for stage, taken in summary["seconds"].items()))
    line(f"written  {summary['out']}")


def _from_to(first_s: float, last_s: float) -> str:
    if first_s < UNIX_S:
        return f"{digits(first_s)} to {of_rows(last_s, first_s)}"
    return f"{utc(first_s)} to {of_rows(last_s, first_s)} ({digits(first_s)} to {digits(last_s)} s)"


def _percent(share: float | None) -> str | None:
    return None if share is None else f"{100 * share:.3g} %"


def _at(time_s: float | None, first_s: float) -> str | None:
    return None if time_s is None else of_rows(time_s, first_s)


def _not_corrected(channel: dict[str, Any]) -> str:
    if channel["mirrored"]:
        return "not corrected: mirrored, which no mounting explains"
    return "" if channel["applied"] else "not corrected: gains outside 0.9 to 1.1 are no misalignment"


def _named(groups: dict[str, Any]) -> Iterator[dict[str, Any]]:
    return ({"name": name, **group} for name, group in groups.items())


def _repaired(repair: dict[str, Any]) -> str:
    rows = ", ".join(map(str, repair["first"])) + (", ..." if repair["dropped"] > len(repair["first"]) else "")
    of = f"{repair['rows']} rows of {repair['source']}"
    return f"dropped {repair['dropped']} of {of}, whose time repeats or is out of order: {rows}"


def _channels(summary: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield a row for each channel, and one more for each further isolation."""
    for name, signal in {**summary["signals"], **summary["discretes"]}.items():
        for channel in signal["channels"]:
            times = [
                {"frame": f["frame"], "at": _at(f["time_s"], summary["time_s"][0]), "why": f["why"]}
                for f in channel["failed"]
            ]
            first, *again = times or [{"frame": "never", "at": "", "why": ""}]
            rows = channel["suspect_rows"]
            suspect = f"{rows} ({100 * channel['suspect_share']:.3g} %)" if rows else "never"
            head = {
                "name": _channel_name(name, channel["channel"], signal),
                "state": channel["state"],
                "suspect": suspect,
            }
            yield {**head, **first, "invalid": channel["invalid_samples"]}
            yield from ({**dict.fromkeys(head, ""), **later, "invalid": ""} for later in again)


def _channel_name(name: str, channel: int, signal: dict[str, Any]) -> str:
    """Return the name of a channel of the vote, with its number in the recording if that is another."""
    number = signal.get("recorded", {channel - 1: channel})[channel - 1]
    return f"{name}.{channel}" if number == channel else f"{name}.{channel} (recorded {number})"


def _not_voted(summary: dict[str, Any]) -> None:
    """Print the recorded channels that do not vote, beside the vote."""
    rows = ({"name": name, **other} for name, signal in summary["signals"].items() for other in _others(signal))
    table(rows, _OTHERS)


def _others(signal: dict[str, Any]) -> list[dict[str, Any]]:
    return signal.get("not_voted", [])


def _latched(summary: dict[str, Any]) -> None:
    """Print how an isolated channel is readmitted, and a remark on missing samples."""
    groups = {**summary["signals"], **summary["discretes"]}.values()
    out = [channel for group in groups for channel in group["channels"] if channel["state"] == "failed"]
    if not out:
        return
    line("an isolated channel stays out until a reset command readmits it: [[resets]] in CONFIG")
    if any(channel["failed"] and channel["failed"][-1]["why"] == "invalid" for channel in out):
        line("by invalid: no valid sample for the persistence; a longer persistence tolerates longer gaps")


def _alignments(summary: dict[str, Any]) -> None:
    alignment, first = summary["alignment"], summary["time_s"][0]
    chosen = " (--align-to is not given)" if alignment["by_default"] else ""
    begin, end = (_at(alignment[key], first) for key in ("from_s", "to_s"))
    line(f"aligned on {alignment['rows']} rows from {begin} to {end}{chosen}")
    aligned = [
        {"name": f"{name}.{channel['channel']}", **channel["alignment"]}
        for name, signal in summary["signals"].items()
        for channel in signal["channels"]
    ]
    table(aligned, _ALIGNED)
    table(alignment["matrices"] or (), _MATRICES)
    for warning in alignment["warnings"]:
        line(f"warning: {warning}")
