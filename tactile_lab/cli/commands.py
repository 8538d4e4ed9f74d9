"""The commands of ``tactile-lab`` by name: built-in ones, and those of extensions, looked up when they are used."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

from drivers.core.reading.bounded_files import refuse_unreachable
from drivers.core.registry import Registry

COMMANDS: Registry[Callable[..., None] | typer.Typer] = Registry("command")
"""By command name: a function that typer makes a command, or a :class:`typer.Typer` with subcommands.

See ``docs/extending.md`` for adding one.
"""


class Commands(TyperGroup):
    """Looks up commands in :data:`COMMANDS` lazily: extensions register theirs while options are parsed."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; a mistake in an option gets a plain message, whichever library found it."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            from drivers.core.configuration import plain_words

            error.message = plain_words(error.message)
            raise

    def list_commands(self, ctx: Any) -> list[str]:
        """All names in order of registration."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command with this name; None if there is none."""
        if cmd_name not in COMMANDS:
            return None
        if cmd_name not in self.commands:
            self.commands[cmd_name] = command = _command(cmd_name)
            _check_values(command)
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


def _check_values(command: Any) -> None:
    """No option of a command, or of its commands, takes nan or inf for a number, which bounds alone let through, bytes
    that are no text, or a path of which nothing can be found out.
    """
    for parameter in command.params:
        parameter.callback = _checked(parameter.callback)
    for inner in getattr(command, "commands", {}).values():
        _check_values(inner)


def _checked(then: Callable[..., Any] | None) -> Callable[..., Any]:
    """A parameter's callback that checks values before its own callback. Raises BadParameter, ConfigurationError."""

    def check(ctx: Any, parameter: Any, value: Any) -> Any:
        for item in value if isinstance(value, tuple | list) else [value]:
            if isinstance(item, float) and not math.isfinite(item):
                raise typer.BadParameter(f"must be a finite number, not {item}", ctx=ctx, param=parameter)
            if isinstance(item, str | Path) and not _is_text(str(item)):
                raise typer.BadParameter(f"must be text in UTF-8, not {str(item)!a}", ctx=ctx, param=parameter)
            if isinstance(item, Path):
                refuse_unreachable(item)
        return value if then is None else then(ctx, parameter, value)

    return check


def _is_text(words: str) -> bool:
    """Whether files in UTF-8 can hold it: words of a command line may be any bytes."""
    try:
        words.encode()
    except UnicodeEncodeError:
        return False
    return True
