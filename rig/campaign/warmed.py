"""Import everything and compile the kernels, for the process that workers are forked from: pool.py preloads this file.

The import is all that it does, so nothing else imports it.
"""

from contextlib import suppress

from rig.campaign.worker import warm
from rig.errors import RigError

with suppress(RigError):  # a worker meets it again, and reports it
    warm()
