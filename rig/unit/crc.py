"""CRC-32 of a record in compiled code, as zlib's: eight bytes a look, by tables."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.kernels import kernel

_POLYNOMIAL: Final = 0xEDB88320
_ALL: Final = 0xFFFFFFFF


def _tables() -> NDArray[np.int64]:
    """Return (8, 256): what a byte does to the sum, with so many bytes behind it."""
    tables = np.zeros((8, 256), np.int64)
    tables[0] = np.arange(256)
    for _ in range(8):
        tables[0] = (tables[0] >> 1) ^ np.where(tables[0] & 1, _POLYNOMIAL, 0)
    for n in range(1, 8):
        tables[n] = (tables[n - 1] >> 8) ^ tables[0][tables[n - 1] & 0xFF]
    return tables


_TABLES: Final = _tables()


@kernel
def crc32(data, count):
    """Return the sum of the first ``count`` of ``data`` (n,) bytes; count : a multiple of eight"""
    crc = np.int64(_ALL)
    for i in range(0, count, 8):
        crc ^= np.int64(data[i]) | np.int64(data[i + 1]) << 8
        crc ^= np.int64(data[i + 2]) << 16 | np.int64(data[i + 3]) << 24
        after = _TABLES[7, crc & 0xFF] ^ _TABLES[6, crc >> 8 & 0xFF]
        after ^= _TABLES[5, crc >> 16 & 0xFF] ^ _TABLES[4, crc >> 24]
        for n in range(4):
            after ^= _TABLES[3 - n, data[i + 4 + n]]
        crc = after
    return crc ^ _ALL
