"""The same program compiled and interpreted: kernels must leave the same bits either way."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def printed(program: str, *, interpreted: bool, given: str = "") -> str:
    """What a Python program prints in a process of its own, from the folder of the tests; warnings are errors.

    interpreted : kernels as plain Python; given : its standard input
    """
    how = {"NUMBA_DISABLE_JIT": "1"} if interpreted else {}
    command = [sys.executable, "-W", "error", "-c", program]
    here, env = Path(__file__).parent, {**os.environ, **how}
    done = subprocess.run(command, input=given, cwd=here, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()
