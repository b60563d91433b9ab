"""The plant: the aircraft that flies, JSBSim with our actuators in front of its aerodynamics, or a linear model.

airframe.py  the airframe: the ``[airframe]`` table of its ``aircraft.toml``
actuated.py  the base model with its own flight control replaced by our actuators
wind.py      steady wind, steps, gusts and turbulence of a flight
ground.py    its ground reactions, off while the aircraft flies high
truth.py     JSBSim's numbers as the true row of a frame, in SI units
loading.py   load an aircraft in JSBSim and trim it
shared_models.py  loaded models that the flights of one process share
jsbsim.py    fly it, or the linear plant: as the aircraft's settings ask
linearise.py the small motions about trim
imperial.py  feet, pounds and slugs in SI, here and nowhere else
Without JSBSim:
linear_plant.py   fly the matrices of the small motions
small_motion.py   its kernels
dryden.py         turbulence
"""
