"""A wizard's questions: at the terminal, on its page, and with nobody there."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from calibration.store.store import new_record
from drivers.core.errors import InterruptionError
from sessions.recording.recorder import Recorder
from tactile_lab.cli.calibrate import wizard as wizard_module
from tactile_lab.cli.calibrate.steps import store_result
from tactile_lab.cli.calibrate.wizard import Asker
from tactile_lab.cli.console import say, show_table, tell_also
from tactile_lab.cli.terminal_input import LineInput
from tactile_lab.view.scene import Scene
from tactile_lab.view.wizard_feed import WizardFeed
from tactile_lab.view.wizard_panel import head_html, told_html

STEP = {"": "measure", "s": "skip"}


class Shown(WizardFeed):
    """A page that is only looked at from outside; its process is never started."""

    def __init__(self) -> None:
        super().__init__("127.0.0.1", 0, "", "test")
        self.scene = Scene()
        self.person: Callable[[], None] = lambda: None

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        self.scene.take(topic, data, stamp_ns)
        if self.scene.wizard.get("question", {}).get("answers"):
            self.person()

    def press(self, **content: object) -> None:
        self._on_line(json.dumps(content).encode())

    @property
    def question(self) -> int:
        return int(self.scene.wizard["question"]["number"])


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Where to write what a person types."""
    reading, writing = os.pipe()
    monkeypatch.setattr(wizard_module, "LineInput", lambda: LineInput(reading))
    yield writing
    os.close(reading)
    with suppress(OSError):  # a test may have closed it
        os.close(writing)


@pytest.fixture
def page() -> Shown:
    return Shown()


def test_a_question_is_answered_in_the_terminal_or_on_the_page(page: Shown, typed: int) -> None:
    asker = Asker(False, "test", page)
    os.write(typed, b"x\nS\n")
    assert asker.choose("1/3 FF presses", STEP, "") == "s"  # x is none of the answers
    page.person = lambda: page.press(question=page.question, answer="")
    assert asker.choose("2/3 FF presses", STEP, "") == ""
    head = head_html(page.scene)
    assert "2/3 FF presses" in head
    assert "Working" in head  # the buttons went


def test_what_was_pressed_for_another_question_or_is_no_answer_counts_for_nothing(page: Shown) -> None:
    page.ask("1/3", STEP, "")
    page.press(question=page.question, answer="")
    page.ask("2/3", STEP, "")  # pressed twice: the second press is not for the next step
    for content in ({"question": 1, "answer": ""}, {"question": 2, "answer": "d"}, {"question": 2}, {"answer": []}):
        page.press(**content)
    assert page.answer() is None
    page.press(question=2, answer="s")
    assert page.answer() == "s"


def test_quit_on_the_page_ends_a_question_and_interrupts_what_goes_on(page: Shown) -> None:
    asker = Asker(False, "test", page)
    asker.offer("pictures are taken", {"d": "done"})
    page.press(question=0, answer="q")
    with pytest.raises(InterruptionError, match="ended by the operator"):
        asker.take_answer()
    page.on_answered()
    with pytest.raises(KeyboardInterrupt):
        page.press(question=0, answer="q")


def test_without_anybody_the_usual_answer_is_taken_and_the_page_only_shows(page: Shown, typed: int) -> None:
    asker = Asker(True, "test", page)
    os.write(typed, b"s\n")
    assert asker.choose("1/3", STEP, "") == ""
    assert asker.take_answer() is None
    os.close(typed)
    alone = Asker(False, "test")
    assert alone.choose("1/3", STEP, "") == "s"
    with pytest.raises(InterruptionError, match="nobody can answer"):
        alone.choose("2/3", STEP, "")


def test_page_is_told_what_people_are_told_and_sees_the_hand(page: Shown) -> None:
    Recorder(page).loads(1, {"FF": 0.4})
    with tell_also(page):
        for touches in ("2", "3"):
            show_table("Motion", ["", "is"], [["touches <of faces>", touches]], right=(1,))
        say("PASS", "bold green")
        say("stored result.yaml")
    say("not for the page")
    told = told_html(page.scene)
    assert (told.count("touches &lt;of faces&gt;"), ">3</td>" in told) == (1, True)
    assert told.index("PASS") < told.index("stored result.yaml") < told.index("Motion")
    assert "not for" not in told
    assert "FF 0.40 N" in head_html(page.scene)


def test_the_verdict_is_shown_before_anybody_is_asked_to_store(page: Shown, typed: int, tmp_path: Path) -> None:
    record = new_record("forearm", rig="lab", method="touch", parameters={}, verdict="PASS")
    os.write(typed, b"q\n")
    with tell_also(page), pytest.raises(InterruptionError):
        store_result(tmp_path / "f.yaml", record, Asker(False, "test", page), False)
    assert "PASS" in told_html(page.scene)
    assert not list(tmp_path.iterdir())
