"""Factors of the slow-fault tests and errors of the references, from healthy flights: what a settings file needs.

    python tests/tools/slow_tests_design.py CAMPAIGN FIRST LAST MARGIN [TABLES]

Flies the runs from FIRST to LAST - 1, and prints the largest shares of the limits of means, squares and halves, the
largest error of the reference at rest [thresholds], and the keys; TABLES gets them as a file.
The tests run with factors of 1, and no channel is isolated: each share is that of the bare limit.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from rig.computer.redundancy.manager import manage_signal
from rig.computer.redundancy.slow_tests import isolate_slow
from rig.computer.redundancy.slow_tests_config import OFF, SlowTests, tests_params
from rig.computer.redundancy.state import new_state
from rig.core.frame import SIGNALS, S
from rig.core.kernels import kernel
from rig.flight import loop
from rig.scenario import aircraft
from rig.studies.campaign.campaign_file import read
from rig.studies.campaign.plan import Plan
from rig.verdict.monitored_places import monitor
from rig.world import sensors

LEAST = 1.1  # factor, where the data ask for less
MOST_ERROR = 0.4  # thresholds: a reference in error by more decides nothing
BINS, FIELDS = 40, ("channels", "valid", "ilm", "reference", "second_reference")
NAMES = [signal.name for signal in SIGNALS]


@kernel
def shares(channels, valid, ilm, reference, second, bare, on, state, out, error, frames):
    """Run the tests over the rows of a flight; out (S, 3) : largest shares; error (S, BINS) : references'."""
    for k in range(len(channels)):
        for s in range(channels.shape[1]):
            p, q, st = bare[s], on[s], state[s]
            manage_signal(channels[k, s], valid[k, s], ilm[k, s], reference[k, s], second[k, s], p, st)
            if st["last_n"] == st["level"]:
                isolate_slow(reference[k, s], st["last_n"], q, st)
            t = st["tests"]
            if st["last_n"] < 2 or t["learned"] < 200:
                continue
            sigma2 = max(t["noise"], t["shaken"], q["slow_noise"] ** 2)
            for c in range(4):
                means = max(abs(t["fast"][c]) / t["fast_limit"], abs(t["slow"][c]) / t["slow_limit"])
                out[s, 0] = max(out[s, 0], means)
                if t["learned"] >= 500:
                    out[s, 1] = max(out[s, 1], (t["square"][c] / sigma2 - 1.0) / t["square_limit"])
            out[s, 2] = max(out[s, 2], t["halves_share"])
            if t["reference_learned"] > 500 and np.isfinite(t["reference_off"]):
                frames[s] += 0.04 * (t["reference_off"] - frames[s])
                b = min(int(t["motion"] / (0.01 * p["threshold"])), error.shape[1] - 1)
                error[s, b] = max(error[s, b], abs(frames[s]))


def measured(plan: Plan, number: int) -> tuple[Any, Any, Any]:
    """Shares (S, 3), errors of the references (S, BINS) in thresholds, thresholds (S,) of a flight."""
    run = plan[number]
    scenario = run.scenario(aircraft.tables(run.aircraft))
    rows, bare = loop.fly_rows(scenario), monitor(scenario)
    for name in OFF:
        bare[name] = 0.0
    on = bare.copy()
    for i, sheet in enumerate(sensors.data_sheets(scenario.sensors, scenario.rate_hz)):
        for key, value in tests_params(SlowTests(), sheet).items():
            on[i][key] = value
    channels, valid, ilm, reference, second = (np.ascontiguousarray(rows[name]) for name in FIELDS)
    out, error = np.zeros((S, 3)), np.zeros((S, BINS))
    shares(channels, valid, ilm, reference, second, bare, on, new_state(bare), out, error, np.zeros(S))
    return out, error / bare["threshold"][:, None], bare["threshold"]


def settings(largest: Any, errors: Any, threshold: float, margin: float) -> dict[str, float]:
    """The keys of slow_tests: ``margin`` times the largest shares (3,), 1.2 times the largest errors (BINS,)."""
    means, squares, halves = (margin * float(x) for x in largest)
    told = {"factor": max(LEAST, means), "squares_factor": max(LEAST, squares), "halves_factor": max(1.0, halves)}
    level = max(1.2 * errors[0], 0.02)
    if errors.any() and level < MOST_ERROR:
        rises = [(1.2 * e - level) / (0.01 * b) for b, e in enumerate(errors) if b > 0 and e > 0.0]
        told |= {"reference_error": level * threshold, "reference_frames": max(0.0, *rises)}
    return {key: float(f"{value:.3g}") for key, value in told.items()}


def main() -> None:
    """See above."""
    campaign, first, last, margin = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4])
    plan = Plan(read(Path(campaign), {}), campaign)
    found = [measured(plan, number) for number in range(first, last)]
    largest, errors = np.max([of[0] for of in found], axis=0), np.max([of[1] for of in found], axis=0)
    lines = list[str]()
    for i, name in enumerate(NAMES):
        told = settings(largest[i], errors[i], float(found[0][2][i]), margin)
        print(f"{name:26}", *(f"{x:8.2f}" for x in largest[i]), f"{errors[i, 0]:8.3f}", told)
        lines += [f"[{name}]", *(f"{key} = {value}" for key, value in told.items())]
    if len(sys.argv) > 5:
        Path(sys.argv[5]).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
