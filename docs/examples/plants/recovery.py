"""The F-16 with an automatic recovery and faults of its sensors, as a plant of `rig search`.

    rig search recovery.toml --plant recovery.py:recovery --flights 100 --out RECOVERY

The stick rolls and pushes the aircraft into an upset.  Then the autopilot is engaged: it levels the wings to hold the
heading, and climbs back to hold the altitude.  Three of the four pitch-rate gyros drift meanwhile, from one time on.
Many benchmarks have a recovery; here its sensors fail too, and a redundancy manager chooses among them.
"""

from tempfile import TemporaryDirectory

import numpy as np

import rig
from rig.core.frame import FLIGHT_INDEX, INDEX, End

UPSET_S, ENGAGE_S = 1.0, 4.0
Q = INDEX["pitch_rate"]


def recovery(roll, push, drift_1, drift_2, drift_3, drifts_from, seed, duration_s):
    """Fly; stick from -1 to 1, drifts in rad/s per s from a time in s."""
    upset = {"kind": "hold", "start_s": UPSET_S, "duration_s": ENGAGE_S - UPSET_S}
    drifts = [
        {"kind": "drift", "signal": "pitch_rate", "channels": [channel], "start_s": drifts_from, "rate_per_s": rate}
        for channel, rate in ((1, drift_1), (2, drift_2), (3, drift_3))
    ]
    sticks = [{**upset, "axis": "stick_roll", "amplitude": roll}, {**upset, "axis": "stick_pitch", "amplitude": -push}]
    pilot = {"autopilot_engaged": False, "engage_s": ENGAGE_S, "manoeuvres": sticks}
    scenario = {"aircraft": "f16", "duration_s": duration_s, "turbulence": "light", "pilot": pilot, "faults": drifts}
    with TemporaryDirectory() as folder:
        rows = rig.fly(scenario, seed=seed, out=folder).rows
    altitude = rows["flight"][:, FLIGHT_INDEX["altitude_m"]]
    return np.arange(len(rows)) / 100.0, {
        "altitude_lost": altitude[0] - altitude,
        "bank": rows["truth"][:, INDEX["roll_angle"]],
        "pitch_rate": rows["truth"][:, Q],
        "vote_error": rows["voted"][:, Q] - rows["truth"][:, Q],
        "lost": rows["end"] != End.FLYING,
    }
