"""Foxglove's own packages read a log and find the numbers that our reader finds (installed by ``make test-all``)."""

import json
import math
import os
import subprocess
from pathlib import Path

import outside
import pytest

from rig.core.frame import SIGNALS, Ilm, State
from rig.flight.fly import fly
from rig.log import read_log
from rig.log.columns import COLUMNS
from rig.log.schema import BOOL, FRAME_TOPICS, MESSAGES, POSE_TOPICS, TOPICS

SCRIPTS = Path(__file__).parent / "foxglove"
FRAMES = (0, 99, 107, 108, 299)
FLAGS = {field.name for field in MESSAGES["rig.Signal"] if field.kind == BOOL}


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> Path:
    return fly(overrides=["duration_s=3", "faults.0.start_s=1"], out=tmp_path_factory.mktemp("logs")).log


def said(script: str, *arguments: object) -> dict:
    """What a script of ours prints that reads a log with Foxglove's packages."""
    command = ["node", str(SCRIPTS / script), *map(str, arguments)]
    environment = {**os.environ, "RIG_NODE_MODULES": str(outside.node_modules())}
    out = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert (out.returncode, out.stderr) == (0, "")
    return json.loads(out.stdout)


@pytest.fixture(scope="module")
def found(flown):
    return said("read.mjs", flown, *FRAMES)


def counts(flown: Path) -> dict[str, int]:
    """Messages that each topic has to have."""
    log = read_log(flown)
    of_frames = {topic.name: len(log.rows) for topic in FRAME_TOPICS} | {"/events": len(log.events)}
    return of_frames | {topic.name: len(log.rows) // 4 for topic in POSE_TOPICS}


@outside.needs("foxglove")
def test_every_message_of_every_topic_is_there_with_its_checksums(flown, found):
    assert found["counts"] == counts(flown) and found["start"] == 0


@outside.needs("foxglove")
def test_the_reader_of_streams_finds_every_message_each_topic_in_the_order_of_time(flown):
    streamed = said("stream.mjs", flown)
    assert streamed["done"] and all(topic["rising"] for topic in streamed["topics"].values())
    assert {name: topic["count"] for name, topic in streamed["topics"].items()} == counts(flown)


@outside.needs("foxglove")
def test_every_number_is_the_one_that_our_reader_finds(flown, found):
    rows = read_log(flown).rows
    topics = {topic.name.rsplit("/", 1)[1]: topic.name for topic in TOPICS}
    for column in COLUMNS:
        for frame in FRAMES:
            (message,) = found["messages"][topics[column.owner]][str(frame)]
            ours, theirs = column.of(rows)[frame].item(), message[column.name]
            assert message["time"] == frame * 10_000_000
            if column.enum is not None:
                assert theirs == column.enum(ours).name, column.path
            elif isinstance(ours, float) and not math.isfinite(ours):
                assert theirs.lower().removesuffix("inity") == str(ours), column.path
            else:
                assert theirs == (bool(ours) if column.name in FLAGS else ours), column.path


@outside.needs("foxglove")
def test_names_events_and_metadata_read_as_we_wrote_them(flown, found):
    log = read_log(flown)
    texts = [event["message"] for at in found["messages"]["/events"].values() for event in at]
    assert sorted(texts) == sorted(event.text for event in log.events)
    assert found["metadata"] == {"rig": log.metadata, "result": log.result}
    last = found["messages"][SIGNALS[0].topic]["299"][0]
    assert (last["st_3"], last["ilm_3"]) == (State.FAILED.name, Ilm.GOOD.name)
