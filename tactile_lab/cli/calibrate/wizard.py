"""Questions of a wizard, answered by a key or a word in the terminal or on its page."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text
from typer import Exit

from drivers.core.atomic_files import refuse_unwritable
from drivers.core.errors import ConfigurationError, InterruptionError, TactileLabError
from sessions.recording.recorder import NullTraffic, TrafficSink
from tactile_lab.cli.console import people, say, tell_also, warn
from tactile_lab.cli.terminal_input import LineInput
from tactile_lab.view.wizard_feed import QUIT, WizardFeed

if TYPE_CHECKING:
    from tactile_lab.cli.running.page_address import PageAddress

_LOOK_s, _RENEW = 0.05, 20
"""Interval between looks for an answer, and number of looks after which the page is refreshed."""


class Asker:
    """Asks a person, or takes the default answer if nobody may be asked.

    Args:
        silent: never ask (``--no-input``).
        where: the wizard's name, for messages.
        page: also takes answers.
    """

    def __init__(self, silent: bool, where: str, page: WizardFeed | None = None) -> None:
        self._silent, self._where, self._page = silent, where, page
        self._input: LineInput | None = None
        self._typed: deque[str] = deque()
        self._offered: Mapping[str, str] = {}

    @property
    def onlooker(self) -> TrafficSink:
        """Shows the hand's state while it moves."""
        return self._page or NullTraffic()

    def choose(self, question: str, answers: Mapping[str, str], usual: str) -> str:
        """Ask for one of some keys, or the word for it; Enter takes the default.

        Raises:
            InterruptionError: the person quits, or there is nobody to ask.
        """
        if self._silent:
            return usual
        known = {**answers, QUIT: "quit"}
        words = ", ".join(f"{'Enter' if key == usual else key} {meaning}" for key, meaning in known.items())
        if self._page is not None:
            self._page.ask(question, known, usual)
        while True:
            people.print(Text.assemble((question, "bold"), f"  [{words}] "), end="")
            answer = self._answer(usual)
            if (key := _key_of(answer, known)) is not None:
                return self._take(key)
            warn(f"{answer!r} is not one of the answers")

    def agree(self, question: str, usual: bool = True) -> bool:
        """Yes or no. Raises InterruptionError when the person quits."""
        return self.choose(question, {"y": "yes", "n": "no"}, "y" if usual else "n") == "y"

    def offer(self, what: str, answers: Mapping[str, str]) -> None:
        """From now on these may be typed or pressed at any time, see :meth:`taken`, without waiting for them."""
        self._offered = {**answers, QUIT: "quit"}
        if self._page is not None:
            self._page.ask(what, self._offered, "")

    def take_answer(self) -> str | None:
        """The offered key that was typed or pressed, if any. Raises InterruptionError when the person quits."""
        answer = None if self._silent else self._next(0.0)
        key = None if answer is None else _key_of(answer, self._offered)
        return None if key is None else self._take(key)

    def show_beside(self, title: str, columns: list[str], rows: list[list[str]], right: tuple[int, ...]) -> None:
        """A table that is updated all the time: on the page, it replaces the older one."""
        if self._page is not None:
            self._page.table(title, columns, rows, right)

    def part(self) -> None:
        """Keep the page open until the person has read it."""
        if self._page is not None and not self._silent:
            with suppress(InterruptionError, KeyboardInterrupt):
                self.choose("The page shows the result.", {"": "close it"}, "")

    def quit_error(self) -> InterruptionError:
        """The error for a person who quits."""
        return InterruptionError("ended by the operator", where=self._where, hint="Nothing was stored")

    def _take(self, answer: str) -> str:
        if answer == QUIT:
            raise self.quit_error()
        if self._page is not None:
            self._page.on_answered()
        return answer

    def _answer(self, usual: str) -> str:
        """Wait for a typed or pressed answer; pressed ones are shown in the terminal too."""
        looks = 0
        while (answer := self._next(_LOOK_s)) is None:
            looks += 1
            if self._page is not None and looks % _RENEW == 0:
                self._page.renew()
        return answer or usual

    def _next(self, seconds: float) -> str | None:
        """The next typed or pressed answer; None after a timeout. Raises InterruptionError."""
        if self._page is not None and (pressed := self._page.answer()) is not None:
            people.print("(on the page)")
            return pressed
        if not self._typed:
            self._typed.extend(self._lines(seconds))
        return self._typed.popleft().strip().lower() if self._typed else None

    def _lines(self, seconds: float) -> list[str]:
        self._input = self._input or LineInput()
        self._input.wait(seconds)
        lines = self._input.lines()
        if not lines and self._input.closed and self._page is None:
            raise self._nobody()
        return lines

    def _nobody(self) -> InterruptionError:
        hint = "Nothing was stored. Use --no-input to run without a person"
        return InterruptionError("standard input has ended, so nobody can answer", where=self._where, hint=hint)


@contextmanager
def wizard(where: str, no_input: bool, page: PageAddress | None) -> Iterator[Asker]:
    """Ask a person at the terminal, and on the wizard's page, while the wizard runs.

    Args:
        where: the wizard's name.
        no_input: ask nobody.
        page: address of its page; None for no page.

    Raises:
        ConfigurationError, DeviceError: the page cannot be opened there.
    """
    if page is None:
        yield Asker(no_input, where)
        return
    address, port, token, certificate = page.check()
    with WizardFeed(address, port, token, where, certificate=certificate) as feed:
        say(f"page: {feed.url}")
        asker = Asker(no_input, where, feed)
        with tell_also(feed), _until_read(asker, feed):
            yield asker


@contextmanager
def _until_read(asker: Asker, feed: WizardFeed) -> Iterator[None]:
    """Keeps the page open until the result or error was read, but not after the person quit."""
    try:
        yield
    except InterruptionError:
        raise
    except TactileLabError as error:
        feed.line(f"error: {error}", "bold red")
        asker.part()
        raise
    except Exit:
        asker.part()
        raise
    asker.part()


def _key_of(answer: str, known: Mapping[str, str]) -> str | None:
    """The key meant by an answer: the key itself or its word ("yes" as well as "y")."""
    return next((key for key, meaning in known.items() if answer in (key, meaning)), None)


def may_write(out: Path, replace: bool, asker: Asker, silent: bool) -> None:
    """Whether a file may be written: a new one always, an existing one if the person agrees.

    Raises:
        ConfigurationError: it cannot be written, or exists, and nobody agreed to replace it.
        InterruptionError: the person does not want that.
    """
    refuse_unwritable(out)
    if replace or not out.exists():
        return
    if silent:
        raise ConfigurationError(
            "exists already", where=str(out), hint="Choose another file with --out, or use --replace"
        )
    if not asker.agree(f"{out} exists. Replace it?", usual=False):
        raise asker.quit_error()
