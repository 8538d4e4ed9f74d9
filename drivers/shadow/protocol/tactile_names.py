"""Who the fingertips are that send through the palm, by their own answers (protocols: Fingertip questions)."""

from __future__ import annotations

from typing import Protocol

from drivers.core.contacts import FINGERS
from drivers.shadow.device.tactile_requests import TactileProtocol, TactileQuestion

_KINDS = {
    TactileProtocol.NONE: "no fingertip",
    TactileProtocol.PST3: "PST",
    TactileProtocol.BIOTAC: "BioTac",
    TactileProtocol.UBI0: "UBI0",
    TactileProtocol.MST: "MST",
    TactileProtocol.CONFLICTING: "fingertips of several kinds",
}
_TEXT_BYTES = 16
_TEXTS = {
    TactileQuestion.MANUFACTURER: "",
    TactileQuestion.SERIAL: "serial ",
    TactileQuestion.SOFTWARE: "software ",
    TactileQuestion.BOARD: "board ",
}


class TactileAnswers(Protocol):
    """The part of the hand's sample that belongs to the fingertips."""

    @property
    def tactile_type(self) -> int: ...
    @property
    def tactile_valid(self) -> int: ...
    @property
    def tactile(self) -> bytes: ...


class TactileNames:
    """Gathers what fingertips say of themselves, by finger; unasked ones say nothing."""

    def __init__(self) -> None:
        self._told: dict[str, dict[int, bytes]] = {finger: {} for finger in FINGERS}
        self._sending: set[str] = set()

    def take(self, sample: TactileAnswers) -> None:
        """Note what one sample says."""
        stride = len(sample.tactile) // len(FINGERS)
        for slot, finger in enumerate(FINGERS):
            if not sample.tactile_valid >> slot & 1:
                continue
            if sample.tactile_type in set(TactileQuestion):
                self._told[finger][sample.tactile_type] = sample.tactile[slot * stride :][:_TEXT_BYTES]
            else:
                self._sending.add(finger)

    def sends(self, finger: str) -> bool:
        """Whether a finger has sent measurements."""
        return finger in self._sending

    def kind(self, finger: str) -> TactileProtocol | None:
        """Which kind of fingertip it says to be; None when it does not say, or one that is not known here."""
        told = self._told[finger].get(TactileQuestion.PROTOCOL)
        code = None if told is None else int.from_bytes(told[:2], "little")
        return TactileProtocol(code) if code in set(TactileProtocol) else None

    def serial(self, finger: str) -> str:
        """Its serial number; empty when it does not say."""
        return self._text(finger, TactileQuestion.SERIAL)

    def words(self, finger: str) -> str:
        """All it says of itself, for people; empty when that is nothing."""
        kind, told = self.kind(finger), self._told[finger].get(TactileQuestion.FREQUENCY)
        parts = [] if kind is None else [_KINDS[kind]]
        parts += [before + text for question, before in _TEXTS.items() if (text := self._text(finger, question))]
        parts += [] if told is None else [f"{int.from_bytes(told[:2], 'little')} Hz"]
        return ", ".join(parts)

    def _text(self, finger: str, question: TactileQuestion) -> str:
        """What stands before the first zero, without what cannot be printed: a socket may answer with noise."""
        told = self._told[finger].get(question, b"").split(b"\0")[0].decode("ascii", "ignore")
        return "".join(filter(str.isprintable, told)).strip()
