"""Physical units: angles, the atmosphere, quantities with the units that people read."""
