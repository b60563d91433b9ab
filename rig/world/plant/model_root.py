"""The folder of the installed JSBSim with its aircraft, engines and systems."""

from __future__ import annotations

from pathlib import Path

import jsbsim


def model_root() -> Path:
    """Return the folder as JSBSim finds it, or that of its package.

    JSBSim looks in Python's environment, which a host that starts Python itself may not have set.
    """
    try:
        return Path(jsbsim.get_default_root_dir())
    except OSError:
        return Path(jsbsim.__file__).parent
