"""One ``rig diagnose``: read, diagnose each quantity."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rig.bench.diagnose.diagnosis import Diagnosis
from rig.bench.diagnose.one_quantity import diagnose_group
from rig.bench.diagnose.sensor_groups import read_groups
from rig.bench.diagnose.trial_faults import injected, kinds_of
from rig.core.progress import tell


def diagnose_file(
    path: Path,
    config: Path | dict[str, Any] | None = None,
    preset: str | None = None,
    inject: Sequence[str] = (),
) -> Diagnosis:
    """Return the diagnosis of the recording at ``path``.

    config, preset : as of ``rig.vote``; inject : kinds of faults to try on copies of the recording
    BadInput, one line: unreadable, nothing to compare, settings that do not fit.
    """
    kinds = kinds_of(inject)
    read = read_groups(path, config, preset)
    zero_s = min(float(group.time_s[0]) for group in read.groups)
    quantities = {}
    for group in read.groups:
        tell(f"compare {group.name}")
        quantities[group.name] = diagnose_group(group, read.threshold_of, zero_s)
    return Diagnosis(
        str(path),
        read.threshold_of,
        zero_s,
        quantities,
        tuple(read.remarks),
        tuple(read.warnings),
        read.refused,
        tuple(injected(read.groups, quantities, kinds)),
    )
