"""What the fault-tolerant law finds, and what it declares without a fault: counted.

    python tests/tools/tolerant.py [--workers 2] [--rows found,slow,early,free] [--json FILE]

Every flight point of three aircraft, straight and in a turn, calm to moderate.  found: faults of all four pitch
angles, with the inertial unit and with it lost; slow: ramps that are hardly found; early: faults at 3 and at 12 s;
free: ten hours without a fault.  The same code prints the same counts.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from tolerant_flights import ROWS, Try
from tolerant_table import counts, fault_free, same_frame

from rig import scenario
from rig.campaign.pool import each
from rig.computer.analytic.unit_bank import bank_by
from rig.computer.fdi.state import BOTH
from rig.frame import ESTIMATES, INDEX, Block, Lie, Trust
from rig.loop import Rig, frames
from rig.units.angles import wrap

THETA, PHI = INDEX["pitch_angle"], INDEX["roll_angle"]
ANGLE, INNOVATION, SIGMA = (ESTIMATES.index(f"{x}_rad") for x in ("pitch_angle", "innovation", "innovation_sigma"))
Table = dict[str, Any]


def outcome_of(one: Try) -> Table:
    """Fly it: what was declared and when, how far the estimate was off, what the unit's mean was off each second."""
    chosen = scenario.load(None, one.sets(), one.case.seed)
    rig, blocks, seconds = Rig(chosen), [], []
    for rows, _ in frames(rig, chosen):
        blocks.append(rows.copy())
        seconds.append(second(rig.control.fdi[0], rows[-1]))
    flight, rate_hz = np.concatenate(blocks), chosen.rate_hz
    onset = round(one.case.onset_s * rate_hz) if one.fault else 0
    where = "turn" if "heading" in one.case.manoeuvres else "straight"
    about = {"row": one.row, "fault": one.fault.kind if one.fault else "none", "where": where, "case": asdict(one.case)}
    told = {**declared(flight, onset, rate_hz), **errors(flight, onset), "hours": len(flight) / rate_hz / 3600.0}
    return {**about, **told, "seconds": seconds if one.fault is None else []}


def second(w: Any, row: Any) -> list[float]:
    """Voted bank angle less that by the unit, `tilt`, `apart` less its usual value; whether both rates are in order."""
    bank = wrap(row["voted"][PHI] - bank_by(w["unit"]))
    return [abs(float(x)) for x in (bank, w["tilt"], w["apart"] - w["usual"], w["rates"] == BOTH)]


def declared(flight: Block, onset: int, rate_hz: float) -> Table:
    """Sensor faults and biased rates."""
    corrected, biased = flight["trust"] == Trust.CORRECTED, flight["lie"] == Lie.RATE_BIAS
    at = np.flatnonzero(corrected[onset:])
    return {
        "after_s": float(at[0]) / rate_hz if len(at) else None,
        "before": bool(corrected[:onset].any()),
        "trips": int(np.count_nonzero(np.diff(corrected.astype(int), prepend=0) == 1)),
        "biased": bool(biased.any()),
    }


def errors(flight: Block, onset: int) -> Table:
    """Of the estimate and of the vote from the onset on, rad; innovations of one and of two frames, in sigmas."""
    estimate, truth, late = flight["estimate"], flight["truth"][:, THETA], slice(onset, None)
    size = np.abs(estimate[:, INNOVATION]) / estimate[:, SIGMA]
    return {
        "estimate_rad": float(np.abs(estimate[:, ANGLE] - truth)[late].max()),
        "sensor_rad": float(np.abs(flight["voted"][:, THETA] - truth)[late].max()),
        "sigmas": [float(size.max()), float(np.minimum(size[1:], size[:-1]).max())],
    }


def main() -> int:
    """Fly the rows that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rows", default=",".join(ROWS))
    parser.add_argument("--json", default="")
    asked, began = parser.parse_args(), perf_counter()
    tries = [one for row in asked.rows.split(",") for one in ROWS[row]()]
    flown = list(each(outcome_of, tries, asked.workers))
    faulty, without = [x for x in flown if x["fault"] != "none"], [x for x in flown if x["fault"] == "none"]
    if faulty:
        print(counts(faulty))
    if any(x["row"] == "unit lost" for x in faulty):
        print(same_frame(faulty))
    if without:
        print(fault_free(without))
    print(f"{len(flown)} flights in {perf_counter() - began:.0f} s")
    if asked.json:
        Path(asked.json).write_text(json.dumps([{**x, "seconds": []} for x in flown], indent=0), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
