import json
import shutil

import numpy as np
import pytest

import rig
from rig.core.errors import BadInput, RigError
from rig.core.frame import SIGNALS
from rig.flight.fly import fly
from rig.scenario.scenario import from_resolved

SHORT = ["duration_s=3", "faults.0.start_s=1.0"]


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory):
    return fly(None, overrides=SHORT, seed=5, out=tmp_path_factory.mktemp("logs"))


def test_the_verdict_names_the_failed_channel_and_the_events_in_order(flight):
    assert flight.survived and flight.end_reason == "duration flown"
    assert flight.failed == {"pitch_rate": [3]}
    assert [(event.frame, event.name) for event in flight.events] == [
        (100, "fault on"),
        (107, "channel failed"),
        (107, "level"),
    ]


def test_the_log_holds_every_frame_and_gives_arrays_by_signal(flight):
    assert flight.frames == 300 == len(flight.rows)
    q = flight.signal("pitch_rate")
    assert q.time_s[-1] == 2.99 and q.channels.shape == (300, 4) and q.voted.shape == (300,)
    assert (q.channels[100:, 2] == 1.5).all()
    assert np.abs(q.voted - q.truth).max() < 0.02
    assert (q.level[107:] == 3).all()
    for wrong in (flight.signal, flight.to_polars):
        with pytest.raises(BadInput, match=r"unknown .*'pitchrate', nearest: pitch_rate"):
            wrong("pitchrate")


def test_the_log_alone_can_be_flown_again(flight, tmp_path):
    log = rig.read_log(flight.log)
    again = fly(from_resolved(json.loads(log.metadata["scenario"]), "log"), out=tmp_path)
    assert log.result is not None
    assert again.digest == flight.digest == log.result["digest"]
    assert log.metadata["version jsbsim"] and log.metadata["seed"] == "5"


def test_the_summary_is_plain_json(flight):
    text = json.dumps(flight.summary(), allow_nan=False)
    assert json.loads(text)["failed"] == {"pitch_rate": [3]}


def test_pacing_changes_no_byte_and_reports_its_jitter(tmp_path):
    fast = fly(None, overrides=["duration_s=1"], out=tmp_path)
    paced = fly(None, overrides=["duration_s=1"], out=tmp_path, realtime_factor=2.0)
    assert paced.digest == fast.digest
    assert paced.wall_s > 0.45 and paced.jitter is not None and fast.jitter is None
    assert paced.jitter.median_us <= paced.jitter.p99_us <= paced.jitter.worst_us + 1


def test_a_second_flight_does_not_overwrite_the_first(tmp_path):
    one = fly(None, overrides=["duration_s=0.1"], out=tmp_path)
    two = fly(None, overrides=["duration_s=0.1"], out=tmp_path)
    assert one.log != two.log and one.log.read_bytes()[:8] == two.log.read_bytes()[:8]


@pytest.mark.parametrize("lost", ["folder deleted", "log deleted", "log moved", "another in its place"])
def test_a_log_that_is_lost_in_flight_is_said_and_no_flight_is_returned(tmp_path, lost):
    def lose(frames, of):
        logs = list((tmp_path / "logs").glob("*.mcap"))
        if frames > 400 or not logs:
            return
        if lost == "folder deleted":
            shutil.rmtree(tmp_path / "logs")
        elif lost == "log moved":
            logs[0].rename(tmp_path / "moved.mcap")
        else:
            logs[0].unlink()
        if lost == "another in its place":
            logs[0].write_bytes(b"another")

    with pytest.raises(
        RigError, match=r"_seed1_duration_s-12.mcap: the log is no longer there: deleted or moved"
    ) as error:
        fly(None, overrides=["duration_s=12"], out=tmp_path / "logs", progress=lose)
    assert not isinstance(error.value, BadInput)  # exit code 1


def test_a_name_of_any_length_and_in_any_script_gives_a_log_that_can_be_made(tmp_path):
    from rig.scenario.scenario import load

    for letter in ("n", "\N{GREEK SMALL LETTER ALPHA}", "\N{CJK UNIFIED IDEOGRAPH-4E00}"):
        named = from_resolved({**load(None, ["duration_s=0.1"]).resolved(), "title": letter * 400}, "test")
        assert fly(named, out=tmp_path).log.name.startswith(letter * 50)


def test_a_bad_scenario_writes_nothing(tmp_path):
    with pytest.raises(BadInput):
        fly(None, overrides=["flight_point=moon"], out=tmp_path / "logs")
    with pytest.raises(BadInput):
        rig.fly(None, overrides=SHORT, out=tmp_path / "logs", rerun="sideways")
    assert list(tmp_path.iterdir()) == []


def test_a_log_that_cannot_be_written_on_stops_the_flight_and_stays_readable(tmp_path, monkeypatch):
    """A disk that fills up in mid-flight, through the file-size limit of the process."""
    import resource
    import signal

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (600_000, before[1]))
    try:
        with pytest.raises(RigError, match="flight stopped at"):
            fly(None, overrides=["duration_s=20"], out=tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
    (path,) = tmp_path.iterdir()
    rig.log.recover(path, tmp_path / "mended.mcap")
    mended = tmp_path / "mended.mcap"
    assert len(rig.read_log(mended if mended.exists() else path).rows) >= 100


def test_every_signal_has_arrays(flight):
    for signal in SIGNALS:
        assert flight.signal(signal.name).channels.shape == (300, 4)
