"""Checks the force fingertips of a rig: connects each and reads it for a second. Nothing moves."""

from __future__ import annotations

import numpy as np

from drivers.ati.nano17 import Nano17
from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.fingertips.kinds import WIRES
from drivers.fingertips.wiring import place_of
from drivers.force.force_fingertip import WrenchSample
from drivers.force.plausibility import noise_objection
from tactile_lab.rigs.checks.findings import Finding, told
from tactile_lab.rigs.fingertip_rig import FingertipRig

LISTEN_ns = NANOSECONDS
_POLL_ns = 2_000_000


def check_fingertips(rig: FingertipRig, clock: Clock) -> list[Finding]:
    """One finding per finger.

    Raises:
        ConfigurationError: a calibration file that a wire names.
    """
    tips = {finger: rig.device(finger, clock) for finger in rig.description.wires}  # files first
    return [_check(rig, finger, tip, clock) for finger, tip in tips.items()]


def _check(rig: FingertipRig, finger: str, tip: Nano17, clock: Clock) -> Finding:
    device = f"fingertip {finger}"
    try:
        tip.connect()
        samples = _listen(tip, clock)
        problems = [text for text in tip.health() if text != "not tared"]
    except DeviceError as error:
        return Finding(device, False, f"{error}{_other_baud(rig, finger, clock)}")
    finally:
        tip.close()
    place = place_of(rig.description.wires[finger])
    usable = np.array([sample.wrench for sample in samples if np.isfinite(sample.wrench).all()])
    if len(usable) < 2:
        return told(device, problems or ["no usable sample"], (), {}, place)
    problems += filter(None, [noise_objection(usable.std(axis=0), tip.calibration)])
    return told(device, problems, (_words(tip, samples, usable),), _figures(tip, samples, usable), place)


def _listen(tip: Nano17, clock: Clock) -> list[WrenchSample]:
    taken: list[WrenchSample] = []
    end_ns = clock.now_ns() + LISTEN_ns
    while clock.now_ns() < end_ns:
        samples = tip.poll()
        tip.update(samples)
        taken += samples
        clock.sleep_until_ns(clock.now_ns() + _POLL_ns)
    return taken


def _figures(tip: Nano17, samples: list[WrenchSample], usable: Array) -> dict[str, float | str]:
    intervals_s = np.diff([sample.stamp_ns for sample in samples]) / NANOSECONDS
    noise, bias = usable.std(axis=0), np.abs(usable.mean(axis=0))
    return {
        "identity": tip.identity,
        "rate_Hz": float(1.0 / intervals_s.mean()) if intervals_s.sum() > 0 else 0.0,
        "jitter_ms": float(1e3 * intervals_s.std()),
        "lost": float(tip.sequences.lost),
        "noise_mN": float(1e3 * noise[:3].max()),
        "noise_mNm": float(1e3 * noise[3:].max()),
        "expected_mN": float(1e3 * tip.calibration.force_sigma_N),
        "expected_mNm": float(1e3 * tip.calibration.moment_sigma_Nm),
        "bias_N": float(bias[:3].max()),
        "bias_mNm": float(1e3 * bias[3:].max()),
    }


def _words(tip: Nano17, samples: list[WrenchSample], usable: Array) -> str:
    span_s = (samples[-1].stamp_ns - samples[0].stamp_ns) / NANOSECONDS
    rate = f"{(len(samples) - 1) / span_s:.0f} samples/s" if span_s > 0 else f"{len(samples)} samples"
    noise, bias, known = usable.std(axis=0), np.abs(usable.mean(axis=0)), tip.calibration
    return (
        f"{tip.identity + ', ' if tip.identity else ''}{rate}, {tip.sequences.lost} lost, "
        f"noise {1e3 * noise[:3].max():.1f} mN and {1e3 * noise[3:].max():.3f} N mm "
        f"(expected {1e3 * known.force_sigma_N:.1f} and {1e3 * known.moment_sigma_Nm:.3f}), "
        f"untared reading {bias[:3].max():.2f} N and {1e3 * bias[3:].max():.1f} N mm"
    )


def _other_baud(rig: FingertipRig, finger: str, clock: Clock) -> str:
    """Whether a silent device answers with other settings than the rig file's, such as another rate; as text."""
    wiring = rig.description.wires[finger]
    for other in WIRES[wiring.wire].alternatives(wiring):
        if _answers(rig.device(finger, clock, other)):
            found = {key: value for key, value in other.model_dump().items() if value != getattr(wiring, key)}
            words = ", ".join(f"{value} {key}" for key, value in found.items())
            return f". It answers at {words}: correct wires.{finger}.{next(iter(found))} in the rig file"
    return ""


def _answers(tip: Nano17) -> bool:
    try:
        tip.connect()
    except DeviceError:
        return False
    tip.close()
    return True
