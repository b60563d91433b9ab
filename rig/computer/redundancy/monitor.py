"""The monitor of the reference, and of failed channels: its standing, their agreement, readmission by command.

Source: Zhang 2023, sections 2 and 7; docs/redundancy.md.
"""

from __future__ import annotations

import numpy as np

from rig.computer.redundancy.compare import is_singular
from rig.kernels import kernel
from rig.units.angles import difference


@kernel
def monitor_reference(raw, reference, n, p, st):
    """A reference that left a healthy vote for ``persistence`` frames is unusable until it has agreed as long."""
    if n < 2 or is_singular(st["pattern"]) or np.isnan(reference):
        return
    off = abs(difference(raw, reference, p["wraps"]))
    agrees = 1 if off <= st["reference_threshold"] else 0
    st["reference_run"] = st["reference_run"] + 1 if agrees != st["reference_usable"] else 0
    if st["reference_run"] >= p["persistence"]:
        st["reference_usable"], st["reference_run"] = agrees, 0


@kernel
def watch_failed(samples, valid, raw, p, st):
    """Count how long each failed channel has agreed with the vote again (for a readmission by command)."""
    if st["level"] == p["fitted"]:
        return
    for c in range(p["fitted"]):
        near = valid[c] and abs(difference(samples[c], raw, p["wraps"])) <= p["threshold"]
        st["agreed"][c] = st["agreed"][c] + 1 if st["failed"][c] and near else 0


@kernel
def readmit(commanded, p, st):
    """Clear the failures of the ``commanded`` channels, bits, that have agreed with the vote for ``readmit_frames``."""
    if commanded == 0:
        return
    for c in range(p["fitted"]):
        if (commanded >> c) & 1 == 1 and st["failed"][c] and st["agreed"][c] >= p["readmit_frames"]:
            st["failed"][c] = st["count"][c] = st["agreed"][c] = 0
