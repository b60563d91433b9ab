"""Physical units: angles, the atmosphere, quantities in the units of a reader."""
