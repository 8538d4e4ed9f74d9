"""What to do after a rig was checked, in order: first devices, then motors, then calibrations, then a session."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tactile_lab.rigs.checks.findings import Finding
from tactile_lab.rigs.description import load_rig
from tactile_lab.rigs.fingertip_rig import is_fingertip_rig
from tactile_lab.rigs.hand_rig import is_hand_rig

_CALIBRATION = "calibration "
_ORDER = ("camera", "markers", "geometry", "forearm", "joints", "fingertips")
"""Each needs those before it."""

_TOGETHER = (
    "The other devices alone, then all of them in one rig file of kind wired: docs/real-laboratory.md, the first day"
)


def next_steps(rig: str, findings: Sequence[Finding], *, moved: bool) -> list[str]:
    """What to do next, one step a line.

    Args:
        rig: name or file, as it was checked.
        findings: of :func:`~tactile_lab.rigs.checks.check.check_rig`.
        moved: its motors were nudged.

    Raises:
        ConfigurationError: the rig file cannot be read.
    """
    again, wrong = f"tactile-lab rig check {rig}", [finding for finding in findings if not finding.ok]
    devices = [finding for finding in wrong if not finding.device.startswith(_CALIBRATION)]
    if devices:
        return [*map(_repair, devices), f"Check again: {again}"]
    has_motors, has_sessions = _kind(rig)
    steps = (
        [f"Clear the space around the hand, then nudge every motor: {again} --move"] if has_motors and not moved else []
    )
    steps += [f"{finding.device}: {finding.detail}" for finding in sorted(wrong, key=_place)]
    if has_sessions:
        first = "First session, over an empty table" if has_motors else "First session"
        steps.append(f"{first}: tactile-lab run --rig {rig} --grasps 1")
    else:
        steps.append(_TOGETHER)
    return steps


def _kind(rig: str) -> tuple[bool, bool]:
    """Whether a rig has real or emulated motors on a cable, and whether sessions can be run on it."""
    path = Path(rig)
    if path.suffix in {".yaml", ".yml"} and (is_hand_rig(path) or is_fingertip_rig(path)):
        return is_hand_rig(path), False
    return load_rig(rig).description.kind == "wired", True


def _repair(finding: Finding) -> str:
    told = finding.first or finding.detail
    return told if told.startswith(f"{finding.device}: ") else f"{finding.device}: {told}"


def _place(finding: Finding) -> tuple[int, str]:
    role = finding.device.removeprefix(_CALIBRATION)
    return (_ORDER.index(role) if role in _ORDER else len(_ORDER)), role
