"""The control law: designed from the linearised aircraft, flown on voted signals only.

In flight:
    autopilot     the stage: settings, state, one kernel call a frame
    flying        that kernel: signals, outer loops, inner loops, surfaces
    select        each signal from its vote, its reference or its degraded mode
    degraded      what stands in for a lost signal
    rates         a body rate that is not measured
    backup        the elevator without a pitch rate
    laws          the single laws
    airdata       altitude, Mach number and airspeeds from two pressures
    record        parameters and state
    gains         the designed numbers of one aircraft, gains.toml
On the ground:
    design        airframe -> gains: how fast each loop can be
    point_gains   the gains of one flight point, from the bandwidths wanted there
    requirements  what every loop must keep, and whether it does
    reserve       the numbers for flight without some signals
    loops         the whole loop as a linear system, the law as it is coded
    margins       gain and phase margins from closed-loop eigenvalues
"""
