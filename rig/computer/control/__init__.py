"""The control law: designed from the linearised aircraft, flown on voted signals only.

    autopilot     the stage: settings, state, one kernel call a frame
    law           that kernel: signals, outer loops, inner loops, surfaces
    modes         what each axis follows, one row each; the outer loops
    source        each signal from its vote, its reference or its degraded mode
    degraded      what replaces a lost signal
    backup_law    the elevator without a pitch rate
    laws          the single laws
    law_state     parameters and state
    gains_file    the designed numbers of one aircraft, gains.toml

Its numbers come from rig.design.
"""
