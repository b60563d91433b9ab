"""The control law: designed from the linearised aircraft, flown on voted signals only.

In flight:
    autopilot  the stage: settings, state, one kernel call a frame
    flying     that kernel: signals, outer loops, inner loops, surfaces
    laws       the single laws and the gain schedule
    airdata    altitude, Mach number and airspeeds from two pressures
    record     parameters and state
    gains      the designed numbers of one aircraft, gains.toml
On the ground:
    design     airframe -> gains
    loops      the whole loop as a linear system, the law as it is coded
    margins    gain and phase margins from closed-loop eigenvalues
"""
