"""Measures a force fingertip's wrenches with a rig: free in many orientations, and pressed."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from calibration.fingertip.data import WrenchPose, wrench_pose
from calibration.fingertip.plan import PlannedFree, PlannedWrench
from calibration.forearm.touch_plan import PlannedTouch, pointing_vector
from calibration.steps.hand_chain import mount_T_link
from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.force.force_fingertip import ForceTip
from sessions.measuring.calibration_measurer import MeasurerSettings, PressingHand

LEAST_READINGS = 10
_HELD = 0.7


class FingertipMeasurerSettings(MeasurerSettings):
    """As :class:`MeasurerSettings`, with a firmer press, to measure the lever of its force.

    Attributes:
        holds: how often the hand follows a finger that yields under the press.
    """

    lift_m: float = Field(default=0.12, gt=0.0)
    press_N: float = Field(default=1.0, gt=0.0)
    again_m_s: float = Field(default=0.006, gt=0.0)
    capture_s: float = Field(default=0.4, gt=0.0)
    holds: int = Field(default=4, ge=0)


class FingertipMeasurer(PressingHand):
    """A rig that takes planned mean wrenches."""

    settings: FingertipMeasurerSettings
    _untouched: WrenchPose

    def measure(self, planned: PlannedWrench) -> tuple[WrenchPose, ...]:
        """Take one mean wrench; for a press also the one just before it, for drift and weight.

        Raises:
            DeviceError: the sensor gives no usable readings, or nothing was touched.
            SafetyError: a limit was exceeded; the rig was stopped.
        """
        if isinstance(planned, PlannedFree):
            taken: tuple[WrenchPose, ...] = (self._free(planned),)
        else:
            taken = self._press_and_observe(planned, lambda touch: (self._untouched, self._feel(touch)))
        self.supervisor.on_approach()
        return taken

    def _free(self, planned: PlannedFree) -> WrenchPose:
        joints = pointing_vector(planned.finger, form=planned.form)
        target = planned.base_q(self._world_T_mount, joints)
        if self._q[2] < target[2]:
            self._move(np.array([*self._q[:2], target[2], *self._q[3:]]), self.settings.travel_m_s)
        self._take_posture(joints)
        self._move(target, self.settings.travel_m_s)
        self._motion.wait(self.settings.settle_s)
        return self._feel(planned)

    def _press(self, planned: PlannedTouch, before: Array, behind: Array) -> None:
        """As for a touch, with a free wrench first; then down again while the finger yields and the force drops."""
        self._untouched = self._feel(planned)
        super()._press(planned, before, behind)
        for _ in range(self.settings.holds):
            if self._motion.loads_N()[planned.finger] >= _HELD * self.settings.press_N:
                return
            self._search(planned, behind, self.settings.again_m_s)
            self._motion.wait(self.settings.settle_s)

    def _feel(self, planned: PlannedFree | PlannedTouch) -> WrenchPose:
        """Mean raw wrench, bias and weight included, and the orientation of the distal frame."""
        sensor = self.runtime.perception.fingertips[planned.finger]
        if not isinstance(sensor, ForceTip):
            raise DeviceError("has no force sensor", where=planned.finger, hint="BioTacs: tactile-lab calibrate biotac")
        readings = _Readings(sensor)
        pose = self._mean_pose(self.settings.capture_s, lambda: readings.take(self._motion.loads_N()[planned.finger]))
        rotation = self._world_T_mount.rotation().matrix() @ mount_T_link(pose, planned.finger)[:3, :3]
        return wrench_pose(rotation, readings.mean(), readings.newest_ns / NANOSECONDS)


class _Readings:
    """Readings of one sensor while a pose is held."""

    def __init__(self, sensor: ForceTip) -> None:
        self._sensor = sensor
        self._found: dict[int, Array] = {}

    @property
    def newest_ns(self) -> int:
        """Stamp of the newest reading, ns; 0 if there is none."""
        return max(self._found, default=0)

    def take(self, load_N: float) -> None:
        """The newest reading, unless it is invalid (an infinite load) or not new."""
        newest = self._sensor.newest
        if newest is not None and math.isfinite(load_N):
            self._found[newest.stamp_ns] = newest.wrench

    def mean(self) -> Array:
        """Their mean, shape (6,). Raises DeviceError if there are too few."""
        if len(self._found) < LEAST_READINGS:
            what = f"{len(self._found)} usable readings, {LEAST_READINGS} needed"
            raise DeviceError(what, where=f"force sensor {self._sensor.finger}", hint="See tactile-lab rig check")
        return np.asarray(np.mean(list(self._found.values()), axis=0))
