"""Questions of a wizard in a terminal: one key, or one word, each with what it means."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rich.text import Text

from tactile_lab.cli.console import people, warn
from tactile_lab.errors import ConfigurationError, InterruptionError

QUIT = "q"


class Asker:
    """Asks a person, or takes the usual answer where nobody may be asked.

    Args:
        silent: never ask (``--no-input``).
        where: the wizard's name, for messages.
    """

    def __init__(self, silent: bool, where: str) -> None:
        self._silent, self._where = silent, where

    def choose(self, question: str, answers: Mapping[str, str], usual: str) -> str:
        """One of some keys; Enter takes the usual one.

        Raises:
            InterruptionError: the person quits, or there is nobody to ask.
        """
        if self._silent:
            return usual
        known = {**answers, QUIT: "quit"}
        words = ", ".join(f"{'Enter' if key == usual else key} {meaning}" for key, meaning in known.items())
        while True:
            people.print(Text.assemble((question, "bold"), f"  [{words}] "), end="")
            answer = self._line().strip().lower() or usual
            if answer == QUIT:
                raise self.ended()
            if answer in known:
                return answer
            warn(f"{answer!r} is none of the answers")

    def agree(self, question: str, usual: bool = True) -> bool:
        """Yes or no. Raises InterruptionError when the person quits."""
        return self.choose(question, {"y": "yes", "n": "no"}, "y" if usual else "n") == "y"

    def ended(self) -> InterruptionError:
        """What a person who quits is told."""
        return InterruptionError("ended by the operator", where=self._where, hint="Nothing was stored")

    def _line(self) -> str:
        try:
            return input()
        except (EOFError, RuntimeError) as error:  # ended, or closed before the program began
            hint = "Nothing was stored. Give --no-input where nobody answers"
            raise InterruptionError("there is nobody to ask", where=self._where, hint=hint) from error


def may_write(out: Path, replace: bool, asker: Asker, silent: bool) -> None:
    """Whether a file may be written: a new one always, an old one when it is agreed to.

    Raises:
        ConfigurationError: it exists, and nobody agreed to replace it.
        InterruptionError: the person does not want that.
    """
    if replace or not out.exists():
        return
    if silent:
        raise ConfigurationError("exists already", where=str(out), hint="Name another with --out, or give --replace")
    if not asker.agree(f"{out} exists. Replace it?", usual=False):
        raise asker.ended()
