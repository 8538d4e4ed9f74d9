"""Raw fingertip readings for viewers: wrenches and BioTac readings before any tare."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.biotac.biotac import BioTac
from drivers.biotac.slot_codec import Channel, electrode_channel
from drivers.core.fingertip import FingertipSensor
from drivers.force.force_fingertip import ForceTip
from sessions.recording.recorder import Recorder


def record_fingertips(recorder: Recorder, now_ns: int, tips: Mapping[str, FingertipSensor]) -> None:
    """Write the newest reading of each fingertip that has one. Raises SessionError."""
    for finger, tip in tips.items():
        if isinstance(tip, ForceTip) and tip.newest is not None:
            recorder.wrench(now_ns, finger, tip.newest)
        elif isinstance(tip, BioTac) and tip.channels.heard:
            recorder.biotac(now_ns, finger, biotac_counts(tip) or {}, tip.channels.vibration)


def biotac_counts(tip: FingertipSensor) -> dict[str, int | None] | None:
    """The newest counts of a BioTac by channel (PDC, TAC, TDC, E1 ...), None if not received; None for another kind of
    fingertip.
    """
    if not isinstance(tip, BioTac):
        return None
    names = {"PDC": Channel.PDC, "TAC": Channel.TAC, "TDC": Channel.TDC}
    electrodes = {f"E{n}": electrode_channel(n) for n in range(1, tip.calibration.electrodes + 1)}
    return {name: _newest(tip, int(channel)) for name, channel in {**names, **electrodes}.items()}


def _newest(tip: BioTac, channel: int) -> int | None:
    recent = tip.channels.recent(channel)
    return int(recent[-1]) if len(recent) else None
