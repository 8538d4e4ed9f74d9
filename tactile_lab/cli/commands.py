"""The commands of ``tactile-lab`` by name: built-in ones, and those of extensions, looked up when they are used."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperGroup

from drivers.core.registry import Registry

COMMANDS: Registry[Callable[..., None] | typer.Typer] = Registry("command")
"""By command name: a function that typer makes a command, or a :class:`typer.Typer` with subcommands.

See ``docs/extending.md`` for adding one.
"""


class Commands(TyperGroup):
    """Looks up commands in :data:`COMMANDS` lazily: extensions register theirs while options are parsed."""

    def list_commands(self, ctx: Any) -> list[str]:
        """All names in order of registration."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command with this name; None if there is none."""
        if cmd_name not in COMMANDS:
            return None
        if cmd_name not in self.commands:
            self.commands[cmd_name] = _command(cmd_name)
        return self.commands[cmd_name]


def _command(name: str) -> Any:
    registered = COMMANDS[name]
    if isinstance(registered, typer.Typer):
        command = typer.main.get_command(registered)
        command.name = name
        return command
    holder = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)
    holder.command(name)(registered)
    return typer.main.get_command(holder)
