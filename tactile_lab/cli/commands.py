"""The commands of ``tactile-lab`` by name: built-in ones, and those of extensions, looked up when they are used."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

from drivers.core.reading.bounded_files import refuse_unreachable
from drivers.core.registry import Registry
from tactile_lab.cli.streams import UNWRITABLE

COMMANDS: Registry[Callable[..., None] | typer.Typer] = Registry("command")
"""By command name: a function that typer makes a command, or a :class:`typer.Typer` with subcommands.

See ``docs/extending.md`` for adding one.
"""

_AT_HOME = re.compile(r"(mesh:)?(~(?:/.*)?)", re.DOTALL)


class Commands(TyperGroup):
    """Looks up commands in :data:`COMMANDS` lazily: extensions register theirs while options are parsed."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As usual, and ``help COMMAND`` is ``COMMAND --help``."""
        if args[:1] == ["help"] and "help" not in COMMANDS:
            args = [*args[1:], "--help"]
        rest: list[str] = _answered(super().parse_args)(ctx, args)
        return rest

    def invoke(self, ctx: Any) -> Any:
        """Run the command; a mistake in an option gets a plain message, whichever library found it."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            from drivers.core.configuration import plain_words

            error.message = plain_words(error.message)
            raise

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is named; for a name that is none, those like it are proposed."""
        if args[0] not in COMMANDS:
            for name in COMMANDS:
                self.get_command(ctx, name)  # proposed are those that were made
        return super().resolve_command(ctx, args)

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


def _answered(parse: Callable[..., Any]) -> Callable[..., Any]:
    """Parses options; typer writes help, version and completion by itself meanwhile. Where it cannot, that is told, or
    not, as of any other answer.
    """

    def parsed(ctx: Any, args: list[str]) -> Any:
        try:
            return parse(ctx, args)
        except OSError as error:
            if error.filename is not None or error.errno not in UNWRITABLE:
                raise
            from tactile_lab.cli.console import give_up_answer

            give_up_answer(error)
            raise typer.Exit from error
        except SystemExit as ended:
            if isinstance(ended.__context__, BrokenPipeError):  # told by the library that draws help, as a failure
                raise typer.Exit from ended
            raise

    return parsed


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
    that are no text, nothing at all, or a path of which nothing can be found out.
    """
    command.parse_args = _answered(command.parse_args)
    for parameter in command.params:
        parameter.callback = _checked(parameter.callback)
        parameter.process_value = _as_meant(parameter, parameter.process_value)
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


def _as_meant(parameter: Any, then: Callable[..., Any]) -> Callable[..., Any]:
    """Makes a value of a word.

    An empty one is that of a variable that is not set, and would be taken for the current folder. ``--out=~/runs`` and
    ``mesh:~/cup.stl`` mean the home folder, which shells put in at the beginning of a word only.

    Raises:
        BadParameter: the word is empty, and that means nothing.
    """

    def process(ctx: Any, word: Any) -> Any:
        if word == "" and parameter.default != "":
            raise typer.BadParameter("must not be empty", ctx=ctx, param=parameter)
        if isinstance(word, str) and (found := _AT_HOME.fullmatch(word)):
            word = f"{found[1] or ''}{Path(found[2]).expanduser()}"
        return then(ctx, word)

    return process


def _is_text(words: str) -> bool:
    """Whether files in UTF-8 can hold it: words of a command line may be any bytes."""
    try:
        words.encode()
    except UnicodeEncodeError:
        return False
    return True
