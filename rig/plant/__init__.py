"""The plant: the aircraft that flies, JSBSim with our actuators in front of its aerodynamics.

airframe.py  what an aircraft is: the ``[airframe]`` table of its ``aircraft.toml``
actuated.py  the base model with its own flight control replaced by our actuators
wind.py      steady wind, steps, gusts and turbulence of a flight
truth.py     JSBSim's numbers as the true row of a frame, in SI units
linear.py    its small motions about trim
jsbsim.py    load, trim and fly; the only importer of JSBSim
"""
