import time

import numpy as np
import pytest

from rig.flight.pace import JitterCounter, Pace


def test_an_unpaced_flight_never_waits():
    pace = Pace(100.0, None)
    began = time.perf_counter()
    assert [pace.wait(frame) for frame in range(1000)] == [0.0] * 1000
    assert time.perf_counter() - began < 0.5


def test_frames_begin_at_absolute_deadlines_and_never_early(monkeypatch):
    """A clock of our own: sleeping overshoots by a millisecond, and a late frame does not delay the next."""
    now = [100.0]
    monkeypatch.setattr("rig.flight.pace.time.perf_counter", lambda: now.__setitem__(0, now[0] + 1e-5) or now[0])
    monkeypatch.setattr("rig.flight.pace.time.sleep", lambda s: now.__setitem__(0, now[0] + s + 0.001))
    pace = Pace(100.0, 2.0)
    late = [pace.wait(0)]
    start = now[0]
    for frame in range(1, 5):
        now[0] += 0.012 if frame == 2 else 0.001
        late.append(pace.wait(frame))
        assert now[0] >= start + frame * 0.005 - 5e-5
    assert late[2] == pytest.approx(0.008, abs=0.001)
    assert late[4] < 0.002


def test_jitter_is_counted_as_numpy_would():
    rng = np.random.default_rng(0)
    late, work = rng.exponential(200.0, 5000), np.full(5000, 9000.0)
    counter = JitterCounter(0.01)
    counter.add(work[:2000], late[:2000])
    counter.add(work[2000:], late[2000:])
    out = counter.result()
    assert out.median_us == pytest.approx(np.median(late), abs=2)
    assert out.p99_us == pytest.approx(np.quantile(late, 0.99), abs=2)
    assert out.worst_us == late.max()
    assert out.overruns == np.count_nonzero(late > 1000.0)
