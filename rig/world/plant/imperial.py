"""JSBSim's feet, pounds and slugs in SI: every conversion of the rig, needed by modules with and without JSBSim."""

from __future__ import annotations

from typing import Final

METRES_PER_FOOT: Final = 0.3048
FEET_PER_METRE: Final = 1.0 / METRES_PER_FOOT
METRES_PER_INCH: Final = 0.0254
PASCALS_PER_PSF: Final = 47.88025898033584  # a pound-force on a square foot
# The same to 14 digits, for the dynamic pressures in gains.toml: with the value above they would be other bytes,
# and flights would have other digests.  It goes with the next design of the bundled aircraft.
PASCALS_PER_PSF_OF_GAINS: Final = 47.880258980336
KILOGRAMS_PER_SLUG: Final = 14.593903
