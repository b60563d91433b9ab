"""A log of ours opened for viewing: the same entities as the live stream's, in a .rrd with our layout.

Rerun opens our .mcap by itself too, but without a layout, and dates the flight 1970.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import rerun as rr
from rerun.chunk import Chunk, McapReader

from rig.errors import BadInput, BadLog
from rig.frame import SIGNALS
from rig.view import deviation, viewer
from rig.view.blueprint import OVERVIEW, blueprint
from rig.view.columns import TIMELINE, send_aircraft, send_structs, time_column
from rig.view.sink import APPLICATION

_INDEX: Final = {signal.topic: i for i, signal in enumerate(SIGNALS)}
_MESSAGE: Final = "rig.Signal:message"


def show(source: Path) -> Path:
    """Open ``source`` (.mcap or .rrd) in a viewer's window, which outlives us; returns the .rrd that it shows.

    An .mcap is converted to an .rrd beside it.  BadInput: no such file, no display; BadLog; RigError.
    """
    if not source.is_file():
        raise BadInput(f"{source}: no such file")
    viewer.require_display(str(source))
    shown = source.with_suffix(".rrd")
    if source.suffix == ".mcap":
        log_to_rrd(source, shown)
    port = viewer.free_port()
    viewer.start([str(shown), "--port", str(port)], port, stay=True)
    return shown


def log_to_rrd(log: Path, rrd: Path, tab: str = OVERVIEW) -> None:
    """Write the log at ``log`` as ``rrd``, with the layout in it, open at ``tab``; BadLog when it cannot be read.

    A log that was cut off is shown as far as it goes.
    """
    if not log.is_file():
        raise BadLog(f"{log}: no such file")
    try:
        _write(log, rrd, tab)
    except (ValueError, RuntimeError, OSError) as error:
        rrd.unlink(missing_ok=True)
        raise BadLog(f"{log}: cannot be shown: {str(error).splitlines()[0]}") from None


def _write(log: Path, rrd: Path, tab: str) -> None:
    recording = rr.RecordingStream(APPLICATION)
    recording.save(rrd, default_blueprint=blueprint(tab=tab))
    try:
        recording.send_recording_name(log.stem)
        send_aircraft(recording)
        for chunk in McapReader(log, timeline_type="duration", recover=True).stream():
            rr.send_chunks(chunk, recording=recording)
            _send_deviation(recording, chunk)
        recording.flush(timeout_sec=60.0)
    finally:
        recording.disconnect()


def _send_deviation(recording: rr.RecordingStream, chunk: Chunk) -> None:
    """The deviation of a signal, if ``chunk`` holds some of its messages."""
    index = _INDEX.get(chunk.entity_path)
    batch = chunk.to_record_batch()
    if index is None or _MESSAGE not in batch.schema.names:
        return
    messages = batch[_MESSAGE].flatten()  # a list of one struct each
    nanoseconds = batch[TIMELINE].cast("int64").to_numpy()
    shown = deviation.from_structs(messages, index)
    send_structs(recording, deviation.path(SIGNALS[index]), deviation.ARCHETYPE, [time_column(nanoseconds)], shown)
