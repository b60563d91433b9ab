"""The same program compiled and interpreted: kernels must leave the same bits either way.

Compiled it runs in this process; interpreted in a fork of one that has imported what a flight needs, once for all.
"""

from __future__ import annotations

import atexit
import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path
from unittest.mock import patch

SERVER = """
import json, os, sys, traceback
import rig.flight.loop
for line in sys.stdin:
    program, given = json.loads(line)
    back, out = os.pipe()
    if not (child := os.fork()):
        try:
            sys.stdin = os.fdopen(os.open(os.devnull, os.O_RDONLY)) if not given else __import__("io").StringIO(given)
            sys.stdout = os.fdopen(out, "w")
            exec(program, {"__name__": "__main__"})
            sys.stdout.flush()
            os._exit(0)
        except BaseException:
            traceback.print_exc(file=sys.stdout)
            sys.stdout.flush()
            os._exit(1)
    os.close(out)
    with os.fdopen(back) as said:
        text = said.read()
    print(json.dumps([os.waitpid(child, 0)[1], text]), flush=True)
"""


@cache
def server() -> subprocess.Popen[str]:
    """The process with interpreted kernels; it ends with this one."""
    command, env = [sys.executable, "-W", "error", "-c", SERVER], {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    here, pipe = Path(__file__).parent, subprocess.PIPE
    process = subprocess.Popen(command, cwd=here, env=env, stdin=pipe, stdout=pipe, text=True)
    atexit.register(process.communicate)
    return process


def printed(program: str, *, interpreted: bool, given: str = "") -> str:
    """What a Python program prints, from the folder of the tests; warnings are errors.

    interpreted : kernels as plain Python; given : its standard input
    """
    if not interpreted:
        out = io.StringIO()
        with redirect_stdout(out), patch("sys.stdin", io.StringIO(given)):
            exec(program, {"__name__": "__main__"})
        return out.getvalue().strip()
    process = server()
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(f"{json.dumps([program, given])}\n")
    process.stdin.flush()
    code, said = json.loads(process.stdout.readline())
    assert code == 0, said
    return said.strip()
