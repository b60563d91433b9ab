"""The F-16 with ground collision avoidance of the ARCH-COMP falsification benchmarks, as a plant of `rig search`.

    PYTHONPATH=AeroBenchVVPython/code rig search f16_gcas.toml --plant f16_gcas.py:gcas --flights 300 --out F16

Model: Heidlauf, Collins, Bolender and Bak, 'Verification challenges in F-16 ground collision avoidance and other
automated maneuvers', ARCH 2018.  Its Python code is the package `aerobench` of github.com/stanleybak/AeroBenchVVPython
(GPL 3, needs scipy).  The code is not part of the rig; this file only calls it.
"""

import numpy as np

SPEED, ALPHA = 540.0, np.radians(2.1215)  # ft/s, rad; the trim of the authors' example
POWER = 9.0
STEP_S = 1.0 / 30.0  # of the authors' example; the autopilot changes its mode at these times only
PLACE = {"speed": 0, "roll_angle": 3, "pitch_angle": 4, "yaw_angle": 5, "altitude": 11}  # in the state


def gcas(roll, pitch, yaw, duration_s, initial_altitude=2330.0):
    """Recover from a dive; initial angles in rad, altitudes in ft, speed in ft/s.

    The autopilot levels the wings from time 0 and then pulls; `pulls` is true meanwhile.
    """
    try:
        from aerobench.examples.gcas.gcas_autopilot import GcasAutopilot  # pyright: ignore[reportMissingImports]
        from aerobench.run_f16_sim import run_f16_sim  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        where = "the folder 'code' of github.com/stanleybak/AeroBenchVVPython on PYTHONPATH"
        raise ImportError(f"{error}; this plant needs {where}, and scipy") from error

    state = np.zeros(13)
    state[[0, 1, 3, 4, 5, 11, 12]] = SPEED, ALPHA, roll, pitch, yaw, initial_altitude, POWER
    flown = run_f16_sim(state, duration_s, GcasAutopilot(init_mode="roll", gain_str="old"), step=STEP_S)
    columns = {name: flown["states"][:, place] for name, place in PLACE.items()}
    return flown["times"], {**columns, "pulls": np.array(flown["modes"]) == "pull"}
