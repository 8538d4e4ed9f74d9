"""The operator interface of a guided session: requests and the panel shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any, Protocol

from sessions.guided.operator_view import OperatorView


class Ask(StrEnum):
    """Requests of an operator."""

    NEXT = "next"
    """Finish this step; while the hand holds: capture."""
    GO = "go"
    """Let the rig do this step automatically."""
    CAPTURE = "capture"
    """Measure this grasp now."""
    UNDO = "undo"
    """Undo the last grasp; before a grasp is captured: give it up."""
    GIVE_UP = "give up"
    """Give up: open the hand and lift without a capture."""
    PAUSE = "pause"
    """Pause, or resume."""
    END = "end"
    """Finish the session."""
    AUTOMATIC = "automatic"
    """Automatic capture on or off."""
    MOVE = "move"
    """Move the hand a step."""
    FINGERS = "fingers"
    """Close or open fingers a step."""
    NOTE = "note"
    """Store a note."""
    MARKER = "marker"
    """Number this instant in the recording."""
    PHOTO = "photo"
    """Store a picture from the camera."""
    ATTACH = "attach"
    """Attach a file to the session."""


@dataclass(frozen=True)
class Request:
    """One request.

    Attributes:
        ask: its kind.
        text: text of a note; name of a file.
        fingers: fingers that move by steps.
        steps: number of steps to close, negative to open.
        x, y, z, turn: steps of the hand along the world's axes and about its z axis.
    """

    ask: Ask
    text: str = ""
    fingers: tuple[str, ...] = ()
    steps: int = 0
    x: int = 0
    y: int = 0
    z: int = 0
    turn: int = 0


class Stage(StrEnum):
    """Stages of a guided session: before the first grasp, and of each, in order."""

    FEEL = "feel"
    PLACE = "place"
    GUIDE = "guide"
    CLOSE = "close"
    HOLD = "hold"
    CAPTURE = "capture"
    ROTATE = "rotate"
    RELEASE = "release"
    ESTIMATE = "estimate"


@dataclass(frozen=True)
class Panel:
    """The state shown to the operator.

    Attributes:
        stamp_ns: session clock.
        grasp: number of the current grasp, from 1.
        stage: stage of the grasp.
        prompt: what to do now.
        view: current sensor readings.
        capture: what is missing for a capture.
        suggestion: the suggested next grasp.
        unknown: which part of the object is still unknown.
        message: the last message.
        paused: why the session is paused; "" if it is not.
        automatic: captures are automatic.
        asks: requests possible now, besides those that always are.
    """

    stamp_ns: int
    grasp: int
    stage: Stage
    prompt: str
    view: OperatorView
    capture: str = ""
    suggestion: str = ""
    unknown: str = ""
    message: str = ""
    paused: str = ""
    automatic: bool = False
    asks: tuple[Ask, ...] = field(default_factory=tuple)

    def content(self) -> dict[str, Any]:
        """The panel as plain data."""
        plain = asdict(self)
        view = plain.pop("view")
        return {**plain, "stage": self.stage.value, "asks": [ask.value for ask in self.asks], "view": view}


class Operator(Protocol):
    """The operator, or a substitute.

    Attributes:
        attended: a person is present who can fix problems; otherwise a failure ends the session.
    """

    attended: bool

    def requests(self) -> Sequence[Request]:
        """Requests since the last call, without waiting."""

    def show(self, panel: Panel) -> None:
        """Show the panel, without waiting."""


class Together:
    """Several operators of one session: a terminal and a page. Each sees everything."""

    def __init__(self, *operators: Operator) -> None:
        self._operators = operators
        self.attended = any(operator.attended for operator in operators)

    def requests(self) -> Sequence[Request]:
        return [request for operator in self._operators for request in operator.requests()]

    def show(self, panel: Panel) -> None:
        for operator in self._operators:
            operator.show(panel)


def request_of(content: Mapping[str, Any]) -> Request:
    """A request from plain data. Raises ValueError if it is not a valid request."""
    text = content.get("text", "")
    if not isinstance(text, str):
        raise ValueError("a request's text must be a string")
    return Request(Ask(str(content.get("ask"))), text=text[:2000])
