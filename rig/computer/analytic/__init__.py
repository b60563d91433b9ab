"""Analytic redundancy: what a signal should read, from its physical partners or from the inertial unit.

references.py     the references of a frame, and what they keep of the votes
reference_sources.py  which source a signal has, and what that reads
kinematics.py     equations of motion that tie a signal to its partners
inertial_unit.py, strapdown.py  the inertial unit in place of a signal
designed.py       the designed numbers of an aircraft's references
pitch_filter.py, flight_path.py, unit_bank.py  the pitch angle without its sensor
"""
