"""The growth table: what is extrapolated follows the last two measurements, and says so."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "tools"))
from tools.figures import growth  # noqa: E402
