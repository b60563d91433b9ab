"""The control law: designed from the linearised aircraft, flown on voted signals only.

gains      the designed numbers of one aircraft, as read from and written to gains.toml
margins    gain and phase margins of the sampled loop, from its eigenvalues
design     airframe -> gains
airdata    altitude, Mach number and airspeeds from two pressures
laws       the inner and outer loops as kernels
autopilot  the stage: settings, state, one kernel call a frame
"""
