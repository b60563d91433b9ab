"""Options that several commands share."""

from __future__ import annotations

from typing import Annotated

import typer

AllowCode = Annotated[
    bool,
    typer.Option("--allow-code", help="Run a manager class that a file names (module:Class), not only one of --set."),
]
