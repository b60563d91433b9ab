"""CPU and memory that a made-up log of another system takes: python tests/tools/log_cost.py [MB].

Each format is read in a process of its own: `rig info`, then the columns of the preset joined, as `rig vote` does.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
import foreign_logs

KINDS = ("ulg", "BIN", "db3")


def repeated_ulog(path: Path, size: int) -> None:
    """A ULog made by numpy: a quarter of its rows are of three gyros at 1 kHz, the others of another topic."""
    rows_of = {("sensor_gyro", i): (foreign_logs.IMU_FIELDS, [(1e6, 11 * i, 0, 0, 0)]) for i in range(3)}
    head = foreign_logs.ulog({**rows_of, ("other", 0): (foreign_logs.IMU_FIELDS, [(1e6, 0, 0, 0, 0)])})
    row = np.dtype(
        [("size", "<u2"), ("letter", "u1"), ("id", "<u2"), ("t", "<u8"), ("device", "<u4"), ("xyz", "<f4", 3)]
    )
    rows = np.zeros(size // row.itemsize, row)
    k = np.arange(len(rows))
    rows["size"], rows["letter"], rows["id"] = row.itemsize - 3, ord("D"), np.minimum(k % 12, 3)
    rows["t"], rows["device"] = 2_000_000 + 1000 * (k // 12), 11 * rows["id"]
    rows["xyz"] = np.sin(k / 3000)[:, None]
    path.write_bytes(head + rows.tobytes())


def repeated_dataflash(path: Path, size: int) -> None:
    """A dataflash log made by numpy: a quarter of its rows are of three IMUs at 1 kHz, the others are not."""
    row = np.dtype([("mark", "u1", 3), ("t", "<u8"), ("i", "u1"), ("v", "<f4", 6)])
    rows = np.zeros(size // row.itemsize, row)
    k = np.arange(len(rows))
    first = [(1_000_000 + i, i, *range(6)) for i in range(3)]
    other = (foreign_logs.IMU[0], "TimeUS,I,a,b,c,d,e,f", first[:1])
    head = foreign_logs.dataflash({"IMU": (*foreign_logs.IMU, first), "ATT": other}, {"IMU": foreign_logs.IMU_UNITS})
    kinds = np.where(k % 12 < 3, 10, 11)  # as foreign_logs numbers them
    rows["mark"] = np.stack([np.full(len(k), 0xA3), np.full(len(k), 0x95), kinds], axis=1)
    rows["t"], rows["i"], rows["v"] = 2_000_000 + 1000 * (k // 12), k % 12, np.sin(k / 3000)[:, None]
    path.write_bytes(head + rows.tobytes())


def bag(path: Path, size: int) -> None:
    """A bag of two IMUs."""
    with foreign_logs.RosBag(path / "bag") as made:
        for k in range(size // 400):
            made.imu(f"/imu{k % 2}", 10**18 + 10**6 * k, [0.1, 0.2, 0.3, 0.4, 0.5, k / 1e6])
    next((path / "bag").glob("*.db3")).rename(path / "x.db3")


def peak_mib() -> float:
    """Return the most memory that this process had."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def one(path: Path) -> None:
    """Read a log and print what that took."""
    from rig.log.recordings.formats.known import open_log
    from rig.log.recordings.formats.log_info import log_info
    from rig.log.recordings.formats.presets import config
    from rig.log.recordings.read import load
    from rig.log.recordings.vote_config import config_of

    before = peak_mib()
    began = time.process_time()
    log = open_log(path)
    assert log is not None
    log_info(path, log.contents)
    opened = time.process_time()
    peak_open = peak_mib()
    recording, _ = load(path, config_of(config(log.contents, path), path), "preset", log=log)
    ended = time.process_time()
    peak = peak_mib()
    print(
        f"{path.name}: {path.stat().st_size / 1e6:.0f} MB; info {opened - began:.2f} s of CPU, "
        f"{peak_open - before:.0f} MiB; all columns of {len(recording.time_s)} rows "
        f"{ended - opened:.2f} s more, {peak - before:.0f} MiB in all"
    )


def main() -> None:
    """Make each log and read it."""
    size = round(float(sys.argv[1]) * 1e6) if len(sys.argv) > 1 else 100_000_000
    with tempfile.TemporaryDirectory() as folder:
        for kind in KINDS:
            path = Path(folder, f"x.{kind}")
            if kind == "db3":
                bag(Path(folder), size)
            else:
                {"ulg": repeated_ulog, "BIN": repeated_dataflash}[kind](path, size)
            subprocess.run([sys.executable, __file__, "--one", str(path)], check=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one(Path(sys.argv[2]))
    else:
        main()
