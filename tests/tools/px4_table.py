"""Instances, rows, rates, spans, units of PX4 logs, beside those of pyulog: python tests/tools/px4_table.py [FILE...].

Without a file: the recorded logs of ../shared/data/px4_logs.  Exit code 1: a row or a value differs.  pyulog knows no
units: they stand beside, for the eye.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from pyulog import ULog

sys.path.insert(0, str(Path(__file__).parents[1]))
import foreign_logs

from rig.log.recordings.formats.contents import Topic
from rig.log.recordings.formats.px4 import Px4Log

SENSORS = ("vehicle_imu", "sensor_", "vehicle_magnetometer", "airspeed", "differential_pressure", "vehicle_gps")


def rate_hz(stamps_us: np.ndarray) -> float:
    """Return rows a second, by the median step."""
    steps = np.diff(stamps_us.astype(np.int64))
    steps = steps[steps > 0]
    return 1e6 / float(np.median(steps)) if len(steps) else 0.0


def differs(topic: Topic, theirs: dict[str, np.ndarray]) -> bool:
    """Return True unless rows, rate and span are those of a time that pyulog has, and the fields are the same."""
    clocks = [theirs[name] for name in ("timestamp_sample", "timestamp") if name in theirs]
    same = any(
        topic.rows == len(of)
        and np.isclose(topic.rate_hz, rate_hz(of))
        and (topic.first_s, topic.last_s) == (of.min() / 1e6, of.max() / 1e6)
        for of in clocks
    )
    return not same or not set(theirs) <= set(topic.units)


def main() -> int:
    """Print a line for each topic of a sensor; return how many of all topics differ."""
    paths = [Path(name) for name in sys.argv[1:]] or sorted(foreign_logs.PX4_LOGS.glob("*.ulg"))
    wrong = total = 0
    for path in paths:
        theirs = {f"{data.name}/{data.multi_id}": data.data for data in ULog(str(path)).data_list}
        topics = {topic.name: topic for topic in Px4Log(path).contents.topics}
        wrong += len(set(theirs) ^ set(topics))
        print(f"{path.name}: {len(topics)} topics, pyulog {len(theirs)}")
        for name, topic in topics.items():
            if name not in theirs:
                continue
            total += 1
            bad = differs(topic, theirs[name])
            wrong += bad
            if bad or topic.message.startswith(SENSORS):
                units = ", ".join(sorted({unit for unit in topic.units.values() if unit}))
                of = theirs[name]["timestamp"]
                first_s, last_s = of.min() / 1e6, of.max() / 1e6
                print(
                    f"  {name:28} {topic.rows:7} rows, pyulog {len(of):7}; "
                    f"{topic.rate_hz:8.2f} Hz, {rate_hz(of):8.2f}; "
                    f"{topic.first_s:.3f} to {topic.last_s:.3f} s, {first_s:.3f} to {last_s:.3f}; "
                    f"{units}{'  DIFFERENT' if bad else ''}"
                )
    print(f"{total} topics of {len(paths)} logs, {wrong} different")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
