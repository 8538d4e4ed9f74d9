"""The object is felt before the first grasp of a guided session, if the operator wants it."""

from __future__ import annotations

from collections.abc import Callable

from sessions.guided.console import OperatorConsole
from sessions.guided.motion import GuidedMotion
from sessions.guided.operator import Ask, Stage
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.motion.probing.box_prober import BoxProber

_PROMPT = (
    "Place the object on the table. g: the hand feels how tall it is, and the sides of what is tall; "
    "SPACE: leave that out, it is low"
)


class SurveyOnRequest:
    """Asks the operator, then measures the bounding box.

    Args:
        prober: measures it.
        motion: supervised motion that reads the operator's requests.
        console: the operator's console.
    """

    def __init__(self, prober: BoxProber, motion: GuidedMotion, console: OperatorConsole) -> None:
        self._prober, self._motion, self._console = prober, motion, console

    def feel(self, stop: Callable[[], bool]) -> BoundingBox | None:
        """The bounding box; None if the operator does without, or leaves. Asks again where nothing is on the table.

        Args:
            stop: whether to skip the rest.
        """
        console = self._console
        while self._is_wanted():
            console.enter(Stage.FEEL, "The hand feels where the object is, and how tall. p: pause; e: end")
            box = self._prober.feel(lambda: stop() or console.end_wanted)
            if box.is_found or not console.is_attended:
                return box
            if not console.moves_on:
                console.tell("the hand has felt nothing on the table")
        return None

    def _is_wanted(self) -> bool:
        self._console.enter(Stage.FEEL, _PROMPT, Ask.GO, Ask.NEXT, Ask.END)
        for request in self._motion.requests():  # none once the operator wants to leave
            if request.ask in (Ask.GO, Ask.NEXT):
                return request.ask is Ask.GO
        return False
