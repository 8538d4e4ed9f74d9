"""Questions of a wizard: one key, or one word, each with what it means; answered in the terminal or on its page."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text
from typer import Exit

from drivers.core.errors import ConfigurationError, InterruptionError, TactileLabError
from sessions.recording.recorder import NullTraffic, TrafficSink
from tactile_lab.cli.console import people, say, tell_also, warn
from tactile_lab.cli.terminal_input import LineInput
from tactile_lab.view.wizard_feed import QUIT, WizardFeed

if TYPE_CHECKING:
    from tactile_lab.cli.running.page_address import PageAddress

_LOOK_s, _RENEW = 0.05, 20
"""How often one looks for an answer, and after how many looks the page is shown everything again."""


class Asker:
    """Asks a person, or takes the usual answer where nobody may be asked.

    Args:
        silent: never ask (``--no-input``).
        where: the wizard's name, for messages.
        page: where the person may answer too.
    """

    def __init__(self, silent: bool, where: str, page: WizardFeed | None = None) -> None:
        self._silent, self._where, self._page = silent, where, page
        self._input: LineInput | None = None
        self._typed: deque[str] = deque()
        self._offered: Mapping[str, str] = {}

    @property
    def onlooker(self) -> TrafficSink:
        """Where the hand's state is shown while it moves."""
        return self._page or NullTraffic()

    def choose(self, question: str, answers: Mapping[str, str], usual: str) -> str:
        """One of some keys, or the word for it; Enter takes the usual one.

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
            warn(f"{answer!r} is none of the answers")

    def agree(self, question: str, usual: bool = True) -> bool:
        """Yes or no. Raises InterruptionError when the person quits."""
        return self.choose(question, {"y": "yes", "n": "no"}, "y" if usual else "n") == "y"

    def offer(self, what: str, answers: Mapping[str, str]) -> None:
        """From here on these may be typed or pressed at any time, see :meth:`taken`; nobody waits for them."""
        self._offered = {**answers, QUIT: "quit"}
        if self._page is not None:
            self._page.ask(what, self._offered, "")

    def take_answer(self) -> str | None:
        """What is typed or pressed now of what is offered. Raises InterruptionError when the person quits."""
        answer = None if self._silent else self._next(0.0)
        key = None if answer is None else _key_of(answer, self._offered)
        return None if key is None else self._take(key)

    def show_beside(self, title: str, columns: list[str], rows: list[list[str]], right: tuple[int, ...]) -> None:
        """A table that changes all the time: on the page, where it takes the place of the older one."""
        if self._page is not None:
            self._page.table(title, columns, rows, right)

    def part(self) -> None:
        """Leave the page open until the person has read it."""
        if self._page is not None and not self._silent:
            with suppress(InterruptionError, KeyboardInterrupt):
                self.choose("The page shows how it ended.", {"": "close it"}, "")

    def quit_error(self) -> InterruptionError:
        """What a person who quits is told."""
        return InterruptionError("ended by the operator", where=self._where, hint="Nothing was stored")

    def _take(self, answer: str) -> str:
        if answer == QUIT:
            raise self.quit_error()
        if self._page is not None:
            self._page.on_answered()
        return answer

    def _answer(self, usual: str) -> str:
        """Wait for what is typed, or pressed; what was pressed is shown in the terminal too."""
        looks = 0
        while (answer := self._next(_LOOK_s)) is None:
            looks += 1
            if self._page is not None and looks % _RENEW == 0:
                self._page.renew()
        return answer or usual

    def _next(self, seconds: float) -> str | None:
        """What was typed or pressed next; None when nothing was within a time. Raises InterruptionError."""
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
        hint = "Nothing was stored. Give --no-input where nobody answers"
        return InterruptionError("there is nobody to ask", where=self._where, hint=hint)


@contextmanager
def wizard(where: str, no_input: bool, page: PageAddress | None) -> Iterator[Asker]:
    """Who may be asked while a wizard runs: a person at the terminal, and on its page.

    Args:
        where: the wizard's name.
        no_input: nobody is asked.
        page: where its page is to be; None for none.

    Raises:
        ConfigurationError, DeviceError: the page cannot be opened there.
    """
    if page is None:
        yield Asker(no_input, where)
        return
    with WizardFeed(*page.check(), where) as feed:
        say(f"page: {feed.url}")
        asker = Asker(no_input, where, feed)
        with tell_also(feed), _until_read(asker, feed):
            yield asker


@contextmanager
def _until_read(asker: Asker, feed: WizardFeed) -> Iterator[None]:
    """The page stays until its end was read, be it an error; but not when the person left."""
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
    """The key that was meant: typed as such, or the word that stands for it ("yes" as well as "y")."""
    return next((key for key, meaning in known.items() if answer in (key, meaning)), None)


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
        raise asker.quit_error()
