"""What a worker is forked from: everything imported, kernels compiled. For pool.py to import, there alone."""

from contextlib import suppress

from rig.campaign.flying import warm
from rig.errors import RigError

with suppress(RigError):  # a worker comes upon it again, and says it
    warm()
