"""When the operator's console lets a grasp be captured."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from sessions.guided.console import OperatorConsole
from sessions.guided.operator import Ask, Request


class Console(OperatorConsole):
    """A console without a session: what is told is kept, and what is asked is given."""

    def __init__(self, *, touching: bool, steady: bool, automatic: bool) -> None:
        self.view: Any = SimpleNamespace(touching=("FF",) if touching else (), is_steady=steady)
        self.automatic = automatic
        self.told: list[str] = []
        self._warned_of_nothing = False
        self._now: list[Request] = []

    def take(self) -> list[Request]:
        return self._now

    def tell(self, text: str, *_: object) -> None:
        self.told.append(text)

    def asked(self, *asks: Ask) -> bool:
        """Whether it captures when the operator asks this."""
        self._now = [Request(ask) for ask in asks]
        return self.wants_capture()


@pytest.mark.parametrize("ask", [Ask.NEXT, Ask.CAPTURE])
def test_a_grasp_without_contact_is_captured_when_asked_again(ask: Ask) -> None:
    console = Console(touching=False, steady=False, automatic=False)
    assert not console.asked(ask)
    assert console.told == ["no finger is in contact. Ask again to capture all the same"]
    assert not console.asked()
    assert console.asked(ask)
    assert len(console.told) == 1


def test_a_grasp_with_contact_is_captured_when_asked() -> None:
    console = Console(touching=True, steady=False, automatic=False)
    assert not console.asked()
    assert not console.asked(Ask.NOTE)
    assert console.asked(Ask.NOTE, Ask.CAPTURE)
    assert console.told == []


@pytest.mark.parametrize(("steady", "automatic"), [(True, True), (True, False), (False, True)])
def test_a_steady_grasp_is_captured_by_itself_if_that_is_on(steady: bool, automatic: bool) -> None:
    assert Console(touching=True, steady=steady, automatic=automatic).asked() is (steady and automatic)
