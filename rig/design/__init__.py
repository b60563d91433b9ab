"""What is designed before a flight: gains with their margins, references with their thresholds; not imported in flight.

design_gains.py  the gain schedule of an aircraft (requirements, loops, margins, point_gains, backup)
design_references.py  coefficients and thresholds of the references, from healthy flights
"""
