"""``rig mcp``: the rig as a server of tools for an agent, over standard input and output."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Annotated

from rig.cli.common import opt
from rig.core.errors import BadInput
from rig.core.files import is_folder, new_folder, reported

CALL_S = 600.0


def mcp(
    out: Annotated[Path, opt("DIR", "The only folder that is written to.")] = Path("agent"),
    read: Annotated[
        list[Path] | None, opt("DIR", "Folder that is read as well. Repeatable.", show_default="none")
    ] = None,
    call_limit: Annotated[float, opt("S", "Longest duration of a call, s.", min=1.0, max=86_400.0)] = CALL_S,
) -> None:
    """Serve tools to an agent over standard input and output (Model Context Protocol): fly, explain, score and others.

    The tools run no code of a user: no manager class, and no unit under test. Nothing listens on the network.
    """
    try:
        from rig.cli.mcp_server import serve
    except ImportError:
        raise BadInput("rig mcp: needs the package mcp: pip install 'jsbsim-rig[mcp]'") from None
    from rig.cli.mcp_tools import Places

    folders = [Path(os.path.realpath(folder)) for folder in read or ()]
    for folder in folders:
        if not is_folder(folder):
            raise BadInput(f"--read {folder}: no such folder")
    with reported(f"--out {out}", BadInput), new_folder(out):
        place = Path(os.path.realpath(out))
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)  # it has nothing to save; its calls end when it is gone
    serve(Places(place, tuple(folders)), call_limit)
