"""The person of a guided session, as the program sees him: what he asks for, and what he is shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any, Protocol

from sessions.guided.operator_view import OperatorView


class Ask(StrEnum):
    """What a person can ask for."""

    NEXT = "next"
    """This step is done; while the hand holds: capture."""
    GO = "go"
    """Let the rig do this step."""
    CAPTURE = "capture"
    """Measure this grasp now."""
    UNDO = "undo"
    """Take the last grasp back; before a grasp is captured: give it up."""
    GIVE_UP = "give up"
    """Open the hand and lift, without a capture."""
    PAUSE = "pause"
    """Nothing moves until it is asked for again."""
    END = "end"
    """Finish the session."""
    AUTOMATIC = "automatic"
    """Automatic capture on or off."""
    MOVE = "move"
    """Move the hand a step."""
    FINGERS = "fingers"
    """Close or open fingers a step."""
    NOTE = "note"
    """Keep a remark."""
    MARKER = "marker"
    """Number this instant in the recording."""
    PHOTO = "photo"
    """Keep a picture of the camera."""
    ATTACH = "attach"
    """Keep a file with the session."""


@dataclass(frozen=True)
class Request:
    """One thing asked for.

    Attributes:
        ask: what.
        text: of a note; the name of a file.
        fingers: which, for steps of fingers.
        steps: how many steps to close, negative to open.
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
    """Steps of a guided grasp, in their order."""

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
    """What a person is shown.

    Attributes:
        stamp_ns: session clock.
        grasp: number of the grasp in hand, from 1.
        stage: where the grasp is.
        prompt: what to do now.
        sight: what the sensors say.
        capture: what stands between now and a capture, in words.
        suggestion: the suggested next grasp.
        unknown: which part of the object is still unknown.
        message: the last thing that happened.
        paused: why the session pauses; "" when it does not.
        automatic: captures are taken automatically.
        asks: what can be asked for now, beside what can always be asked for.
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
    """The person, or what stands in for one.

    Attributes:
        attended: someone is there who can mend things; without, a failure ends the session.
    """

    attended: bool

    def requests(self) -> Sequence[Request]:
        """What was asked for since the last call; at once."""

    def show(self, panel: Panel) -> None:
        """Show this; at once."""


class Together:
    """Several operators at one session: a terminal and a page. Everyone is shown everything."""

    def __init__(self, *operators: Operator) -> None:
        self._operators = operators
        self.attended = any(operator.attended for operator in operators)

    def requests(self) -> Sequence[Request]:
        return [request for operator in self._operators for request in operator.requests()]

    def show(self, panel: Panel) -> None:
        for operator in self._operators:
            operator.show(panel)


def request_of(content: Mapping[str, Any]) -> Request:
    """A request from plain data. Raises ValueError for anything that is none."""
    text = content.get("text", "")
    if not isinstance(text, str):
        raise ValueError("a request's text is a string")
    return Request(Ask(str(content.get("ask"))), text=text[:2000])
