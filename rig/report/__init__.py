"""Reports: HTML files that open without a network; of one flight here, ``page`` for those of other rooms.

``rig.report(flight)`` writes one: the package can be called, since a function of its name is asked for.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any


class _Called(ModuleType):
    """This package, which writes the report of a flight when it is called (flight.write_report)."""

    def __call__(self, *flight: Any, **options: Any) -> Path:
        from rig.report.flight import write_report

        return write_report(*flight, **options)


sys.modules[__name__].__class__ = _Called
