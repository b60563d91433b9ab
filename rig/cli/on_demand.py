"""The commands of ``rig`` by name: each is imported when it is used, so that ``rig --help`` waits for none of them.

Half of the time of ``rig --help`` went into the options of forty commands that it does not show.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any, ClassVar, NamedTuple

from typer import Typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command


class Entry(NamedTuple):
    """A command or group of commands: its name, its panel in the help, where it is, and what it is for."""

    name: str
    panel: str
    home: str  # module:name below rig.cli, a function with a command's options or a Typer
    purpose: str  # for a command: the first paragraph of its docstring

    def made(self) -> Any:
        """Return the command as click has it; import its module."""
        module, _, attribute = self.home.partition(":")
        part = getattr(import_module(f"rig.cli.{module}"), attribute)
        holder = Typer(add_completion=False, rich_markup_mode="rich")
        if isinstance(part, Typer):
            holder.add_typer(part, name=self.name, help=self.purpose, rich_help_panel=self.panel)
            group: Any = get_command(holder)
            return group.commands[self.name]
        holder.command(rich_help_panel=self.panel)(part)
        return get_command(holder)

    def summary(self) -> Any:
        """Return a command that the help can list, and that does nothing."""
        return TyperCommand(self.name, help=self.purpose, rich_help_panel=self.panel)


class _Made(dict[str, Any]):
    """The commands by name, each made when it is first asked for; all of them where one walks through them."""

    def __init__(self, entries: Iterable[Entry]) -> None:
        super().__init__((entry.name, None) for entry in entries)
        self._entries = {entry.name: entry for entry in entries}

    def __getitem__(self, name: str) -> Any:
        made = super().__getitem__(name)
        if made is None:
            made = self[name] = self._entries[name].made()
        return made

    def get(self, name: str, default: Any = None) -> Any:
        known = name in self
        return self[name] if known else default

    def values(self) -> Any:
        return [self[name] for name in self]

    def items(self) -> Any:
        return [(name, self[name]) for name in self]


class OnDemand(TyperGroup):
    """A group whose commands are imported when one of them is used; a subclass names its ``entries``."""

    entries: ClassVar[tuple[Entry, ...]] = ()

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = _Made(self.entries)
        self._listed: dict[str, Any] | None = None

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands."""
        return list(self.commands)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of that name, or its summary where the names are only listed; None: there is none."""
        return self.commands.get(cmd_name) if self._listed is None else self._listed.get(cmd_name)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help of the group."""
        with self._listing():
            super().format_help(ctx, formatter)

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Return what completes a word: names of commands, options."""
        with self._listing():
            return super().shell_complete(ctx, incomplete)

    @contextmanager
    def _listing(self) -> Iterator[None]:
        self._listed = {entry.name: entry.summary() for entry in self.entries}
        try:
            yield
        finally:
            self._listed = None


def group_of(entries: Iterable[Entry]) -> type[OnDemand]:
    """Return the class of a group with these commands, in this order."""
    return type("Commands", (OnDemand,), {"entries": tuple(entries)})
