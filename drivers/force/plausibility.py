"""Checks whether a wrench can come from a single contact on the fingertip; persistent failures mean a wrong torque.

A gauge that drifts, a loose cable or a wrong calibration file gives wrenches that look like forces and torques but
belong to no contact: their axis misses the tip, or they need a pull, an impossible friction or an impossible twist.
"""

from __future__ import annotations

from collections import Counter, deque

import numpy as np
from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.fingertip import FingertipCalibration
from drivers.force.intrinsic_contact import EllipsoidContact


class PlausibilitySettings(StrictModel):
    """Limits of a single frictional contact.

    Attributes:
        axis_distance: largest distance of the wrench's axis outside the surface (1: it just touches).
        force_angle_rad: largest angle between force and inward normal; the atan of a generous friction coefficient.
        torsion_m: largest twist per newton of force; about the radius of the contact patch.
        judged_force_N: below this load drift and noise dominate, and nothing is checked.
        window: number of captures considered; the sensor is faulty when at least ``faulty_count`` and more than half of
            the loaded ones are impossible.
    """

    axis_distance: float = Field(default=1.1, gt=0.0)
    force_angle_rad: float = Field(default=1.2, gt=0.0, lt=np.pi / 2)
    torsion_m: float = Field(default=0.008, gt=0.0)
    judged_force_N: float = Field(default=0.3, gt=0.0)
    window: int = Field(default=20, ge=1)
    faulty_count: int = Field(default=4, ge=1)


def objection(
    contact: EllipsoidContact, force_N: Array, calibration: FingertipCalibration, settings: PlausibilitySettings
) -> str:
    """Why this contact is impossible; empty if it is possible.

    Args:
        contact: one contact (no leading shape), axes parallel to the distal frame, origin in the ellipsoid's centre.
        force_N: its force, shape (3,).
    """
    point_distal_m = contact.point_m + np.array(calibration.centre_distal_m)
    below = point_distal_m < np.array(calibration.shell_min_distal_m)
    above = point_distal_m > np.array(calibration.shell_max_distal_m)
    if contact.axis_distance > settings.axis_distance:
        return "the axis of the wrench misses the fingertip"
    if np.any(below | above):
        return "the contact would lie where the fingertip has no surface"
    if contact.force_angle_rad > settings.force_angle_rad:
        return "the force would slide along the surface"
    if abs(float(contact.torsion_Nm)) > settings.torsion_m * float(np.linalg.norm(force_N)):
        return "the twist about the contact is too strong for its force"
    return ""


_NOISY, _CONSTANT = 6.0, 0.02
"""How many times its calibrated noise a still sensor may show, and how little it cannot."""


def noise_objection(noise: Array, calibration: FingertipCalibration) -> str:
    """What speaks against the noise of a sensor that nothing touches, in words; empty when nothing does.

    Args:
        noise: standard deviations of its readings, shape (6,), N and N m.
        calibration: says what it has been.
    """
    expected = np.repeat([calibration.force_sigma_N, calibration.moment_sigma_Nm], 3)
    if np.any(noise > _NOISY * expected):
        return "noisier than its calibration says: is it being touched, or is a cable loose?"
    if np.all(noise < _CONSTANT * expected):
        usual = f"a still sensor has a noise of {1e3 * calibration.force_sigma_N:.1f} mN"
        return f"its readings do not change, {usual}: is it connected to its box, and does the box measure?"
    return ""


class WrenchMonitor:
    """Collects the verdicts on loaded captures, and reports if the torque persistently does not match the force."""

    def __init__(self, settings: PlausibilitySettings) -> None:
        self._settings = settings
        self._verdicts: deque[str] = deque(maxlen=settings.window)

    def note(self, verdict: str, force_N: Array) -> None:
        """Add the verdict on one capture; weak ones are ignored."""
        if np.linalg.norm(force_N) >= self._settings.judged_force_N:
            self._verdicts.append(verdict)

    @property
    def fault(self) -> str:
        """The problem as text; empty while the sensor is plausible."""
        objections = [verdict for verdict in self._verdicts if verdict]
        if len(objections) < self._settings.faulty_count or 2 * len(objections) <= len(self._verdicts):
            return ""
        usual = Counter(objections).most_common(1)[0][0]
        share = f"{len(objections)} of {len(self._verdicts)} loaded captures"
        return f"the torque does not match the force in {share}: {usual}; check cable, mounting and calibration file"
