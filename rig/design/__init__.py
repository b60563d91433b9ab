"""Designs made before a flight: gains with their stability margins, references with their thresholds.

design_gains.py  the gain schedule of an aircraft (requirements, loops, margins, point_gains, backup)
design_references.py  coefficients and thresholds of the references, from healthy flights

A flight does not import this package.
"""
