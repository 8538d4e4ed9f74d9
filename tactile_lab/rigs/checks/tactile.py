"""Checks and identifies the fingertips that send through the palm, for ``rig check`` of a hand alone."""

from __future__ import annotations

from drivers.core.contacts import FINGERS
from drivers.fingertips.kind import PalmFingertip
from drivers.fingertips.kinds import as_palm_kind, palm_kind
from drivers.shadow.device.hand_samples import HandSample
from drivers.shadow.device.tactile_requests import TactileKind, TactileProtocol
from drivers.shadow.protocol.tactile_names import TactileNames
from tactile_lab.rigs.checks.findings import Finding, told

_UNREAD = "not read: set hand.tactile to biotac in the rig file"


class TactileLook:
    """Fingertips of a hand alone, without calibration.

    Args:
        tactile: what the palm requests from them, from the rig file.
        fingers: that the hand has.
    """

    def __init__(self, tactile: TactileKind, fingers: tuple[str, ...] = FINGERS) -> None:
        self._fingers = fingers
        self._names, self._tips = TactileNames(), dict[str, PalmFingertip]()
        self._kind = None if (name := palm_kind(tactile)) is None else as_palm_kind(name)
        if self._kind is not None and (usual := self._kind.usual()) is not None:
            settings = self._kind.settings()
            self._tips = {finger: self._kind.sensor(finger, usual, settings) for finger in fingers}

    def take(self, sample: HandSample) -> None:
        """Take one sample of the hand."""
        self._names.take(sample)
        for tip in self._tips.values():
            tip.update(sample)

    def findings(self) -> list[Finding]:
        """One finding for each finger that must send, or that identifies itself."""
        named = [finger for finger in self._fingers if self._names.kind(finger) not in (None, TactileProtocol.NONE)]
        return [self._finding(finger) for finger in (self._tips or named)]

    def _finding(self, finger: str) -> Finding:
        device, words = f"fingertip {finger}", self._names.words(finger)
        if self._kind is None or (tip := self._tips.get(finger)) is None:
            readable = self._names.kind(finger) == TactileProtocol.BIOTAC
            return Finding(device, True, f"{words}; {_UNREAD if readable else 'not read: there is no driver for it'}")
        report = self._kind.report(tip, self._names, "")
        problems = [*report.problems, *(text for text in tip.health() if text != "not tared")]
        return told(device, problems, report.words, report.figures)
