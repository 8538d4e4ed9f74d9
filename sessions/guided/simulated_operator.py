"""A simulated operator: follows the prompts, and a script."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from sessions.guided.operator import Ask, Panel, Request, Stage

_ANSWERS = {
    Stage.FEEL: Ask.GO,
    Stage.PLACE: Ask.NEXT,
    Stage.GUIDE: Ask.GO,
    Stage.CLOSE: Ask.GO,
    Stage.HOLD: Ask.CAPTURE,
    Stage.ROTATE: Ask.GO,
    Stage.RELEASE: Ask.NEXT,
}


@dataclass(frozen=True)
class Cue:
    """One scripted action, executed once when its condition holds.

    Attributes:
        fits: condition on the panel.
        requests: requests to send.
        act: called before the requests.
    """

    fits: Callable[[Panel], bool]
    requests: tuple[Request, ...] = ()
    act: Callable[[], None] = lambda: None


class SimulatedOperator:
    """Answers every prompt by letting the rig do the step, and captures when the grasp is steady.

    Args:
        script: cues in order; when the next one fits, it is played instead of an answer.
        attended: play a person who fixes problems and resumes.
    """

    def __init__(self, script: Iterable[Cue] = (), *, attended: bool = False) -> None:
        self.attended = attended
        self.panels: list[Panel] = []
        self._script = deque(script)
        self._waiting: deque[Request] = deque()
        self._answered: tuple[Stage, int, str] | None = None

    def requests(self) -> Sequence[Request]:
        requests = list(self._waiting)
        self._waiting.clear()
        return requests

    def show(self, panel: Panel) -> None:
        self.panels.append(panel)
        if self._script and self._script[0].fits(panel):
            cue = self._script.popleft()
            cue.act()
            self._waiting.extend(cue.requests)
        elif panel.paused:
            self._go_on(panel)
        elif (panel.stage, panel.grasp, panel.prompt) != self._answered or panel.stage is Stage.PLACE:
            self._answer(panel)

    def _go_on(self, panel: Panel) -> None:
        if not panel.view.silent:
            self._answered = None
            self._waiting.append(Request(Ask.PAUSE))

    def _answer(self, panel: Panel) -> None:
        """One answer per prompt; while holding only once the grasp is steady, or cannot become steady."""
        answer = _ANSWERS.get(panel.stage)
        if answer is None or not panel.prompt:
            return
        if panel.stage is Stage.HOLD and not (panel.view.is_steady or panel.view.steady_s > 1.0):
            return
        self._answered = (panel.stage, panel.grasp, panel.prompt)
        self._waiting.append(Request(answer))
