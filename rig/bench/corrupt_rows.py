"""The kernel of ``inject``, in a file of its own: it takes long to compile."""

from __future__ import annotations

from rig.faults import corrupt
from rig.kernels import kernel


@kernel
def corrupt_rows(rows, data):
    """All rows, FRAME records, through the faults of channels; data : FaultData; see faults.corrupt."""
    for k in range(len(rows)):
        corrupt(rows[k], k, data)
