"""Write a small log as ArduPilot does: three IMUs at 25 Hz for 60 s, a fault in one of them.

python docs/examples/ardupilot_log.py FILE.bin [STEP [SEED]]

Made up, no flight: all IMUs measure one motion, each with its own offsets and noise.  From 30 s on the pitch gyro of
IMU 1, the second, measures STEP rad/s too much (0.5 if not given; 0: no fault).  SEED: of motion and noise.
"""

import struct
import sys
from pathlib import Path

import numpy as np

IMUS, RATE_HZ, SECONDS, FAULTY, FROM_S = 3, 25.0, 60.0, 1, 30.0
SIZES = {"B": "B", "b": "b", "d": "d", "f": "f", "n": "4s", "N": "16s", "Q": "Q", "Z": "64s"}  # letters of the format
MESSAGES = {  # number, format, columns
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "UNIT": (1, "QbZ", "TimeUS,Id,Label"),
    "MULT": (2, "Qbd", "TimeUS,Id,Mult"),
    "FMTU": (3, "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
    "IMU": (4, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
}


def layout(letters: str) -> str:
    """Return the struct of a format."""
    return "<" + "".join(SIZES[letter] for letter in letters)


def message(name: str, *cells: object) -> bytes:
    """Return a message as bytes."""
    number, letters, _ = MESSAGES[name]
    values = [cell.encode() if isinstance(cell, str) else cell for cell in cells]
    return b"\xa3\x95" + bytes([number]) + struct.pack(layout(letters), *values)


def head() -> bytes:
    """Return the messages that describe the others: formats, units, factors."""
    made = b"".join(
        message("FMT", number, 3 + struct.calcsize(layout(letters)), name, letters, columns)
        for name, (number, letters, columns) in MESSAGES.items()
    )
    for letter, label in {"s": "s", "#": "instance", "E": "rad/s", "o": "m/s/s"}.items():
        made += message("UNIT", 0, ord(letter), label)
    for letter, factor in {"-": 0.0, "F": 1e-6, "0": 1.0}.items():
        made += message("MULT", 0, ord(letter), factor)
    return made + message("FMTU", 0, 4, "s#EEEooo", "F-000000")


def measured(step: float, seed: int) -> np.ndarray:
    """Return (rows, IMUs, 6) rates, rad/s, and accelerations, m/s^2."""
    random = np.random.default_rng(seed)
    rows = round(SECONDS * RATE_HZ)
    noise = random.normal(0.0, 1.0, (rows + 24, 6))
    motion = np.array([np.convolve(axis, np.ones(25) / 25.0, "valid") for axis in noise.T]).T  # slower than 1 s
    true = motion * [1.0, 1.0, 0.4, 1.5, 1.5, 2.0] + [0.0, 0.0, 0.0, 0.0, 0.0, -9.81]
    offsets = random.normal(0.0, 1.0, (IMUS, 6)) * [0.004, 0.004, 0.004, 0.05, 0.05, 0.05]
    values = true[:, None] + offsets + random.normal(0.0, 1.0, (rows, IMUS, 6)) * [*[0.01] * 3, *[0.15] * 3]
    values[round(FROM_S * RATE_HZ) :, FAULTY, 1] += step
    return values


def main() -> None:
    """Write the log."""
    _, out, step, seed, *_ = [*sys.argv, *("", "0.5", "1")[len(sys.argv) - 1 :]]
    made = [head()]
    for k, row in enumerate(measured(float(step), int(seed))):
        made += [message("IMU", round(1e6 * k / RATE_HZ), imu, *values) for imu, values in enumerate(row)]
    Path(out).write_bytes(b"".join(made))


if __name__ == "__main__":
    main()
