"""Are the fingertips that send through the palm the ones the rig file means, and do they send? For ``rig check``."""

from __future__ import annotations

import numpy as np

from drivers.biotac import units
from drivers.biotac.biotac import BioTac, BioTacCalibration
from drivers.biotac.electrodes import ElectrodeCount, electrodes_of
from drivers.biotac.slot_codec import Channel
from drivers.fingertip import RigidTransform
from drivers.shadow.hand_samples import HandSample
from drivers.shadow.tactile_names import TactileNames
from drivers.shadow.tactile_requests import TactileKind, TactileProtocol
from tactile_lab.geometry.contacts import FINGERS
from tactile_lab.rigs.findings import Finding

_UNREAD = "not read: set hand.tactile to biotac in the rig file"
_SOMEWHERE = RigidTransform(translation_m=(0.0, 0.0, 0.0))


class TactileLook:
    """Fingertips of a hand alone, whose calibration nobody has named.

    Args:
        kind: of the fingertips, as the rig file says.
    """

    def __init__(self, kind: TactileKind) -> None:
        self._names, self._tips = TactileNames(), dict[str, BioTac]()
        if kind == "biotac":
            usual = BioTacCalibration(electrodes=19, distal_T_sensor=_SOMEWHERE)
            self._tips = {finger: BioTac(finger, usual) for finger in FINGERS}

    def take(self, sample: HandSample) -> None:
        """Listen to one sample of the hand."""
        self._names.take(sample)
        for tip in self._tips.values():
            tip.update(sample)

    def findings(self) -> list[Finding]:
        """One for each finger that has to send, or that says who it is."""
        named = [finger for finger in FINGERS if self._names.kind(finger) not in (None, TactileProtocol.NONE)]
        return [self._finding(finger) for finger in (self._tips or named)]

    def _finding(self, finger: str) -> Finding:
        device, words = f"fingertip {finger}", self._names.words(finger)
        if (tip := self._tips.get(finger)) is None:
            readable = self._names.kind(finger) == TactileProtocol.BIOTAC
            return Finding(device, True, f"{words}; {_UNREAD if readable else 'not read: there is no driver for it'}")
        problems = [*contradictions(self._names, finger), *(text for text in tip.health() if text != "not tared")]
        figures = biotac_figures(tip)
        told = filter(None, [*problems, words, biotac_words(figures)])
        return Finding(device, not problems, "; ".join(told), {"identity": words, **figures})


def contradictions(
    names: TactileNames, finger: str, electrodes: ElectrodeCount | None = None, serial: str = ""
) -> list[str]:
    """How what a finger says of itself contradicts a rig that has a BioTac there, in words.

    Args:
        names: what the fingertips say.
        finger: which.
        electrodes: of its calibration, where there is one.
        serial: of the sensor that must be there; any when empty.
    """
    kind, told = names.kind(finger), names.serial(finger)
    if kind not in (None, TactileProtocol.BIOTAC):
        return ["is no BioTac: correct the fingertips in the rig file, or plug the sensor in"]
    problems = []
    if told and electrodes not in (None, electrodes_of(told)):
        problems.append(f"has {electrodes_of(told)} electrodes by its serial number, {electrodes} by its calibration")
    if told and serial not in ("", told):
        problems.append(f"its serial number is {told}, not {serial}: are fingertips exchanged?")
    return problems


def biotac_figures(tip: BioTac) -> dict[str, float | str]:
    """What a BioTac measures at rest; empty while it has not been heard."""
    rest, heat = tip.channels.recent(Channel.PDC), tip.channels.recent(Channel.TDC)
    if not (rest.size and heat.size):
        return {}
    core = units.core_temperature_degC(heat[-1:])[0]
    return {
        "core_C": float(core),
        "pdc_counts": float(rest.mean()),
        "pdc_spread_counts": float(np.ptp(rest)),
        "electrodes": float(tip.calibration.electrodes),
    }


def biotac_words(figures: dict[str, float | str]) -> str:
    """The same for people."""
    if not figures:
        return ""
    return f"core {figures['core_C']:.0f} C, pressure at rest {figures['pdc_counts']:.0f} counts"
