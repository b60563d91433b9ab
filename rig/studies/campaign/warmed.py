"""Import everything and compile the kernels, for the process that workers are forked from: pool.py preloads this file.

The import is all that it does, so nothing else imports it.
"""

import os
from contextlib import suppress

from rig.core.errors import RigError
from rig.core.kernel_cache import before_compiling
from rig.studies.campaign.compile_ahead import Ahead
from rig.studies.campaign.worker import warm

_parent = os.getppid()


def _end_with_parent(done: int, total: int) -> None:
    """End this process when its workers are no longer needed."""
    if os.getppid() != _parent:
        os._exit(1)


with suppress(RigError), before_compiling(Ahead(_end_with_parent).compile_missing):
    warm()  # a worker meets an error again, and reports it
