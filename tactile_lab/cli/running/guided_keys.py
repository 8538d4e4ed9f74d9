"""The keys of a guided session, and equivalent words for terminals that cannot read single keys."""

from __future__ import annotations

from dataclasses import dataclass, replace

from drivers.core.contacts import FINGERS
from drivers.core.errors import ConfigurationError
from sessions.guided.operator import Ask, Request

UP, DOWN, LEFT, RIGHT, PAGE_DOWN, ENTER, ESCAPE = "up", "down", "left", "right", "page down", "enter", "escape"
SPACE = " "


@dataclass(frozen=True)
class Binding:
    """A key, the equivalent word, and the request it makes.

    Attributes:
        key: the character, or the name of a key without a character.
        word: typed in place of the key.
        request: the request it makes.
        wants_text: a line of text follows.
        help: description for people.
    """

    key: str
    word: str
    request: Request
    help: str
    wants_text: bool = False


def _fingers() -> list[Binding]:
    bindings = []
    for number, finger in enumerate(FINGERS):
        closing, opening = (
            Request(Ask.FINGERS, fingers=(finger,), steps=1),
            Request(Ask.FINGERS, fingers=(finger,), steps=-1),
        )
        bindings.append(Binding(str(number + 1), f"close-{finger.lower()}", closing, f"close {finger} a step"))
        bindings.append(Binding("67890"[number], f"open-{finger.lower()}", opening, f"open {finger} a step"))
    return bindings


BINDINGS: tuple[Binding, ...] = (
    Binding(SPACE, "next", Request(Ask.NEXT), "finish this step; while holding: capture"),
    Binding(ENTER, "capture", Request(Ask.NEXT), "the same"),
    Binding(PAGE_DOWN, "pedal", Request(Ask.NEXT), "the same; sent by most foot pedals and presenters"),
    Binding("g", "go", Request(Ask.GO), "let the rig do this step automatically"),
    Binding("u", "undo", Request(Ask.UNDO), "undo the last grasp; before the capture: give up this one"),
    Binding("x", "give-up", Request(Ask.GIVE_UP), "give up: open the hand and lift without a capture"),
    Binding("p", "pause", Request(Ask.PAUSE), "pause or resume"),
    Binding("e", "end", Request(Ask.END), "end the session (press twice)"),
    Binding("a", "automatic", Request(Ask.AUTOMATIC), "automatic capture when the contacts are steady: on or off"),
    Binding("n", "note", Request(Ask.NOTE), "note: a line of text stored with the session", wants_text=True),
    Binding("m", "marker", Request(Ask.MARKER), "marker: number this instant in the recording"),
    Binding("i", "image", Request(Ask.PHOTO), "store a picture from the rig's camera"),
    Binding("t", "attach", Request(Ask.ATTACH), "attach a file, such as a photograph, by its name", wants_text=True),
    Binding(UP, "far", Request(Ask.MOVE, x=1), "move the hand a step away from the arm"),
    Binding(DOWN, "near", Request(Ask.MOVE, x=-1), "move the hand a step towards the arm"),
    Binding(LEFT, "left", Request(Ask.MOVE, y=1), "move the hand a step to the left, seen from the arm"),
    Binding(RIGHT, "right", Request(Ask.MOVE, y=-1), "move the hand a step to the right"),
    Binding("r", "raise", Request(Ask.MOVE, z=1), "move the hand a step up"),
    Binding("f", "lower", Request(Ask.MOVE, z=-1), "move the hand a step down"),
    Binding(",", "turn-left", Request(Ask.MOVE, turn=1), "turn the hand a step to the left"),
    Binding(".", "turn-right", Request(Ask.MOVE, turn=-1), "turn the hand a step to the right"),
    Binding("c", "close", Request(Ask.FINGERS, fingers=FINGERS, steps=1), "close all fingers a step"),
    Binding("o", "open", Request(Ask.FINGERS, fingers=FINGERS, steps=-1), "open all fingers a step"),
    *_fingers(),
)
BY_KEY = {binding.key: binding for binding in BINDINGS}
BY_WORD = {binding.word: binding for binding in BINDINGS}

_SPARE = {
    **{f"\x1b[{number}~": f"f{key}" for key, number in enumerate((15, 17, 18, 19, 20, 21, 23, 24), 5)},
    **{f"\x1bO{letter}": f"f{key}" for key, letter in enumerate("PQRS", 1)},
    **dict.fromkeys(("\x1b[H", "\x1b[1~", "\x1bOH"), "home"),
    **dict.fromkeys(("\x1b[F", "\x1b[4~", "\x1bOF"), "end"),
    "\x1b[2~": "insert",
    "\x1b[3~": "delete",
    "\x1b[5~": "page up",
}
"""Unassigned keys that a pedal can use."""

_SEQUENCES = {
    **_SPARE,
    "\x1b[A": UP,
    "\x1b[B": DOWN,
    "\x1b[C": RIGHT,
    "\x1b[D": LEFT,
    "\x1bOA": UP,
    "\x1bOB": DOWN,
    "\x1bOC": RIGHT,
    "\x1bOD": LEFT,
    "\x1b[6~": PAGE_DOWN,
}
_LONGEST = max(map(len, _SEQUENCES))
_NAMED = {"\r": ENTER, "\n": ENTER, "\x1b": ESCAPE, "\t": "tab"}


def split_keys(text: str) -> list[str]:
    """The keys in a terminal's input; unknown sequences are ignored."""
    keys: list[str] = []
    while text:
        length = next((n for n in range(_LONGEST, 1, -1) if text[:n] in _SEQUENCES), 0)
        if length:
            keys.append(_SEQUENCES[text[:length]])
        elif text.startswith(("\x1b[", "\x1bO")):
            length = _unknown_length(text)
        else:
            length = 1
            keys.append(_NAMED.get(text[0], text[0]))
        text = text[length:]
    return keys


def _unknown_length(text: str) -> int:
    """Length of a control sequence: up to its final byte (ECMA-48, 5.4)."""
    for length, character in enumerate(text[2:], 3):
        if "@" <= character <= "~":
            return length
    return len(text)


def pedal_key(name: str) -> str:
    """The key of a pedal: a character, or the name of a key without a character. Raises ConfigurationError."""
    named = sorted({"tab", *_SEQUENCES.values()})
    key = name if len(name) == 1 else name.lower().replace("-", " ")
    if key and len(key) != 1 and key not in named:
        hint = f"Use a character or one of: {', '.join(named)}"
        raise ConfigurationError(f"unknown key {name!r}", where="--pedal", hint=hint)
    return key


def request_of_line(line: str) -> Request | None:
    """The request of a typed line: a word or a key, then text or a number of steps; None if it is unknown."""
    first, _, rest = line.strip().partition(" ")
    binding = BY_WORD.get(first.lower()) or BY_KEY.get(first.lower() or ENTER)
    if binding is None:
        return None
    request, rest = binding.request, rest.strip()
    if request.ask in (Ask.MOVE, Ask.FINGERS):
        return _times(request, rest)
    return replace(request, text=rest)


def _times(request: Request, count: str) -> Request | None:
    """A step repeated up to 20 times."""
    if not count:
        return request
    if not count.isdecimal() or not 1 <= int(count) <= 20:
        return None
    n = int(count)
    return replace(
        request, steps=n * request.steps, x=n * request.x, y=n * request.y, z=n * request.z, turn=n * request.turn
    )
