"""The command ``rig``: its groups and commands, errors as one line.

Exit code 0: the work is done (a lost aircraft is a result).  Exit code 2: bad input.  Exit code 1: a failure of the rig
or the machine, or a check that did not pass.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from typing import Annotated, Any, Final

import typer
from typer.core import TyperArgument, TyperOption

from rig.cli.commands import COMMANDS
from rig.cli.common import GROUP
from rig.cli.on_demand import group_of
from rig.cli.usage import refusal
from rig.core.errors import BadInput, RigError
from rig.core.interrupt import end_cleanly

EXAMPLE: Final = (
    "Example: rig fly f16_split_2_2_level, then rig score LOG and rig view LOG. All scenarios: rig scenario list."
)
VERBOSE: Final = ("--verbose", "-v")
_UsageError: Any = typer.BadParameter.__mro__[1]  # click's own; where click is, differs between versions of typer

for _parameter in (TyperArgument, TyperOption):  # help shows the names that we give to values, no types of Python
    setattr(_parameter, "display_type_rich", lambda self, ctx: self.metavar if isinstance(self, TyperOption) else None)  # noqa: B010

app = typer.Typer(
    cls=group_of(COMMANDS),
    help="Test redundant flight control: fly it in simulation, against injected faults.",
    epilog=EXAMPLE,
    **GROUP,
)


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"jsbsim-rig {version('jsbsim-rig')}")
        raise typer.Exit


@app.callback()
def _common(
    verbose: Annotated[bool, typer.Option(*VERBOSE, help="Show the log messages of JSBSim and of the rig.")] = False,
    _: Annotated[bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)] = False,
) -> None:
    logging.basicConfig(level=logging.DEBUG if verbose else logging.ERROR, format="%(name)s: %(message)s")
    if not verbose:  # the rig prints the one line that matters of JSBSim's messages
        logging.getLogger("rig.jsbsim").setLevel(logging.CRITICAL + 1)
    for noisy in ("numba", "asyncio", "matplotlib"):
        logging.getLogger(noisy).setLevel(logging.WARNING)


def main() -> None:
    """Run the command ``rig``; errors are one line on stderr and an exit code."""
    end_cleanly()
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names of files need not be UTF-8
    try:
        with _standard_output(), files_in_one_line():
            code = run(sys.argv[1:])
        sys.exit(code)
    except BadInput as error:
        typer.echo(f"error: {error}", err=True)
        sys.exit(2)
    except RigError as error:
        typer.echo(f"failed: {error}", err=True)
        sys.exit(1)


@contextmanager
def files_in_one_line() -> Iterator[None]:
    """Raise RigError where the system refuses a file in the block."""
    try:
        yield
    except OSError as error:
        if error.filename is None:  # not of a file: an error of the rig
            raise
        raise RigError(f"{error.filename}: {error.strerror}") from None


@contextmanager
def _standard_output() -> Iterator[None]:
    """Raise RigError where what the block prints cannot be written: a full disk, a closed pipe."""
    out = sys.stdout  # None where there is none
    try:
        yield
        if out is not None:
            out.flush()
    except OSError as error:
        if out is None or error.filename is not None or error.errno is None:  # not of the output
            raise
        with suppress(OSError):
            out.close()  # or Python would write the rest when it ends, and fail again
        sys.stdout = None
        raise RigError(f"standard output: cannot be written: {error.strerror}") from None


def run(arguments: list[str]) -> int:
    """Run the command that a command line names; return its exit code.  BadInput: the command line is wrong."""
    try:
        return app(_verbose_first(arguments), prog_name="rig", standalone_mode=False) or 0
    except typer.Abort:
        return 1
    except _UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # a group without a command: its help
            error.show()
            return error.exit_code
        raise BadInput(refusal(error)) from None


def _verbose_first(arguments: list[str]) -> list[str]:
    """Return the arguments with --verbose before the command, where click expects it."""
    end = arguments.index("--") if "--" in arguments else len(arguments)
    given = [word for word in arguments[:end] if word in VERBOSE]
    return [*given, *(word for word in arguments[:end] if word not in VERBOSE), *arguments[end:]]


if __name__ == "__main__":
    main()
