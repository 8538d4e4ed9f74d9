"""A fingertip on a six-axis force sensor: from wrench samples to load and contact.

Driven by decoded samples only, so that a replay gives the same as the live session.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.core.fingertip import GRAVITY, FingertipCalibration, TipContact, TipTouches
from drivers.force.force_samples import ForceTipSettings, Tare, WrenchSample
from drivers.force.intrinsic_contact import (
    EllipsoidContact,
    contact_covariance,
    contact_on_ellipsoid,
    cross_matrix,
    wrench_transform,
)
from drivers.force.plausibility import WrenchMonitor, objection
from drivers.force.sequences import SequenceMonitor
from drivers.force.touches import TipSensing, pressed_points

__all__ = ["AXES", "CAPTURE_LIMIT", "ForceTip", "ForceTipSettings", "Tare", "WrenchSample"]

AXES = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")
CAPTURE_LIMIT = 1000
"""Largest number of samples of a capture, so that an open capture cannot grow without bound."""

_STUCK = "the sensor has stopped measuring: its readings do not change"


class ForceTip:
    """Bias, weight, load, contact and health of one force fingertip (a :class:`FingertipSensor`)."""

    def __init__(
        self,
        finger: str,
        calibration: FingertipCalibration,
        settings: ForceTipSettings,
        sequences: SequenceMonitor | None = None,
    ) -> None:
        self.finger = finger
        self.calibration = calibration
        self.sequences = sequences or SequenceMonitor()
        self.tare_record: Tare | None = None
        self.newest: WrenchSample | None = None
        self._newest_usable = False
        self._settings = settings
        self._bias = np.zeros(6)
        self._recent: deque[Array] = deque(maxlen=settings.tare_samples)
        self._capture: deque[Array] = deque(maxlen=CAPTURE_LIMIT)
        self._void = 0
        self._judge = WrenchMonitor(settings.plausibility)
        self._limits = [*settings.force_range_N, *settings.torque_range_Nm]
        self._range = np.array(self._limits)
        mounting = calibration.distal_T_sensor.pose()
        centre = np.array(calibration.centre_distal_m)
        self._to_centre = wrench_transform(mounting.rotation().matrix(), mounting.translation() - centre)
        self._weight_from_down = self._weight_matrix()
        self.sensing = TipSensing.of(calibration, settings.plausibility, self._to_centre, self._weight_from_down)
        """How it senses contacts while it moves, alone or together with others."""

    def update(self, samples: Sequence[WrenchSample]) -> None:
        """Take decoded samples, oldest first; those older than one already seen are counted and ignored."""
        for sample in samples:
            if not self.sequences.is_new(sample.sent, sample.measured):
                continue
            self.newest, self._newest_usable = sample, self._sound(sample) and self._is_in_range(sample.wrench)
            if self._newest_usable:
                self._recent.append(sample.wrench)
                self._capture.append(sample.wrench)
            else:
                self._void += 1
                self._recent.clear()  # a tare must not reach back across a failure

    def tare(self, world_R_distal: Array, *, reason: str = "") -> None:
        """Tare with the newest samples; the hand must be still and touch nothing.

        Raises:
            DeviceError: too few usable samples, or they vary too much; the bias is unchanged.
        """
        if self.newest is None or len(self._recent) < self._settings.tare_samples:
            raise self._refusal(
                f"{len(self._recent)} usable samples, but {self._settings.tare_samples} are needed",
                "Wait for samples; check the sensor: tactile-lab rig check",
            )
        window = np.array(self._recent)
        spread = np.ptp(window, axis=0)
        if spread[:3].max() > self._settings.tare_spread_N or spread[3:].max() > self._settings.tare_spread_Nm:
            raise self._refusal(
                f"samples differ by {spread[:3].max():.3f} N and {1e3 * spread[3:].max():.2f} N mm",
                "Hold the hand still and free of contact",
            )
        before, self._bias = self.tare_record, window.mean(axis=0) - self._weight(world_R_distal)
        moved = None if before is None else self._bias - before.bias
        since_s = 0.0 if before is None else (self.newest.stamp_ns - before.stamp_ns) / NANOSECONDS
        self.tare_record = Tare(self.newest.stamp_ns, reason, len(window), self._bias, moved, since_s)

    def load(self, wrench: Array, world_R_distal: Array) -> Array:
        """The wrench of the object on the tip: measured, without bias and weight, shape (6,), sensor frame."""
        return np.asarray(wrench - self._bias - self._weight(world_R_distal))

    def load_N(self, world_R_distal: Array) -> float:
        """Contact force of the newest sample; 0 before the first.

        Infinite, so that motion stops, if the sample is invalid or the sensor near the end of its range.
        """
        if self.newest is None:
            return 0.0
        if not self._newest_usable or self.overload:
            return math.inf
        force_N = self.load(self.newest.wrench, world_R_distal)[:3]
        return math.sqrt(force_N @ force_N)

    def void(self) -> str:
        """Why the newest sample is invalid: its fault, or the share of the sensor's range."""
        if self.newest is None:
            return ""
        if self._newest_usable:
            return self.overload
        told = [*self._reports(self.newest), *([_STUCK] if self.sequences.stuck else []), self.overload]
        return "; ".join(filter(None, told)) or "its readings are not numbers"

    @property
    def overload(self) -> str:
        """Which axis of the newest sample exceeds its limit, as text; empty if none."""
        if self.newest is None:
            return ""
        shares = [abs(value) / limit for value, limit in zip(self.newest.wrench.tolist(), self._limits, strict=True)]
        largest = max(shares)
        if not largest > self._settings.limit_share:
            return ""
        return f"{AXES[shares.index(largest)]} at {100 * largest:.0f} % of the calibration range"

    @property
    def noise(self) -> Array:
        """Standard deviation of the newest usable samples, shape (6,), N and N m; zero for fewer than two."""
        return np.std(self._recent, axis=0) if len(self._recent) > 1 else np.zeros(6)

    def begin_capture(self) -> None:
        """From now on samples are collected for :meth:`contact`."""
        self._capture.clear()

    def contact(self, world_R_distal: Array) -> TipContact | None:
        """The contact of the mean wrench since :meth:`begin_capture`.

        None if there are too few samples, too little force, no contact with this wrench, or a torque that has not
        matched the force for several captures (see :meth:`health`).
        """
        if len(self._capture) < self._settings.minimum_samples:
            return None
        window = np.array(self._capture)
        wrench = self._to_centre @ self.load(window.mean(axis=0), world_R_distal)
        force = wrench[:3]
        if np.linalg.norm(force) < self._settings.contact_force_N:
            return None
        contact = contact_on_ellipsoid(force, wrench[3:], np.array(self.calibration.semi_axes_m))
        verdict = objection(contact, force, self.calibration, self._settings.plausibility)
        self._judge.note(verdict, force)
        if verdict or self._judge.fault:
            return None
        return self._tip_contact(contact, force, self._mean_covariance(window))

    def reading(self) -> Array:
        """See :meth:`~drivers.core.fingertip.ContinuousFingertip.reading`."""
        if self.newest is None or not self._newest_usable or self.overload:
            return np.full(6, np.nan)
        return np.asarray(self.newest.wrench - self._bias)

    def touches(self, readings: Array, world_R_distal: Array) -> TipTouches:
        """See :meth:`~drivers.core.fingertip.ContinuousFingertip.touches`; the same checks as for a capture."""
        felt = self.sensing.touches(readings[:, None], world_R_distal[:, None])
        return TipTouches(*(getattr(felt, each.name)[:, 0] for each in fields(felt)))

    def wrenches(self, readings: Array, world_R_distal: Array) -> Array:
        """See :meth:`~drivers.core.fingertip.ContinuousFingertip.wrenches`."""
        weights = -world_R_distal[:, 2] @ self._weight_from_down.T
        about_centre = (readings - weights) @ self._to_centre.T
        arms = np.cross(np.array(self.calibration.centre_distal_m), about_centre[:, :3])
        return np.hstack([about_centre[:, :3], about_centre[:, 3:] + arms])

    @property
    def drift(self) -> Array:
        """See :meth:`~drivers.core.fingertip.ContinuousFingertip.drift`."""
        known = self.calibration
        return np.repeat([known.force_drift_N, known.moment_drift_Nm], 3)

    def health(self) -> tuple[str, ...]:
        """What is wrong with the sensor, in words; empty when all is well."""
        problems = self._reports(self.newest) if self.newest else ["no sample received yet"]
        if self.newest and np.any(np.abs(self.newest.wrench) > self._range):
            problems.append("reading beyond the calibration range")
        elif overload := self.overload:
            problems.append(overload)
        if self._void:
            problems.append(f"{self._void} invalid samples ignored")
        if self.tare_record is None:
            problems.append("not tared")
        return (*problems, *self._sequence_problems(), *filter(None, [self._drift(), self._judge.fault]))

    def _drift(self) -> str:
        """Change of the bias between the last two tares, if it is too large."""
        tare, limits = self.tare_record, self._settings
        if tare is None or tare.moved is None:
            return ""
        force_N, moment_Nm = np.abs(tare.moved[:3]).max(), np.abs(tare.moved[3:]).max()
        if force_N <= limits.drift_limit_N and moment_Nm <= limits.drift_limit_Nm:
            return ""
        return f"the bias moved by {force_N:.2f} N and {1e3 * moment_Nm:.2f} N mm in {tare.since_s:.0f} s"

    def _sequence_problems(self) -> list[str]:
        monitor, problems = self.sequences, []
        if monitor.stuck:
            problems.append(_STUCK)
        if monitor.lost > self._settings.lost_share * (monitor.seen + monitor.lost):
            problems.append(f"{monitor.lost} of {monitor.seen + monitor.lost} records lost")
        if monitor.skipped > self._settings.lost_share * (monitor.seen + monitor.skipped):
            problems.append(f"the sensor skipped {monitor.skipped} records")
        if monitor.restarts:
            problems.append(f"the stream restarted {monitor.restarts} times")
        if monitor.disordered:
            problems.append(f"{monitor.disordered} records out of order or repeated")
        return problems

    @staticmethod
    def _reports(sample: WrenchSample) -> list[str]:
        """Faults and remarks of the sensor's electronics and its wire."""
        return [*sample.faults, *sample.remarks]

    def _sound(self, sample: WrenchSample) -> bool:
        return not sample.faults and not self.sequences.stuck

    def _is_in_range(self, wrench: Array) -> bool:
        """Whether it is six numbers within the calibrated range; of so few, plain ones are quicker than arrays."""
        return all(abs(value) <= limit for value, limit in zip(wrench.tolist(), self._limits, strict=True))

    def _weight(self, world_R_distal: Array) -> Array:
        """The tip's own weight as measured by the sensor, shape (6,), sensor frame."""
        return np.asarray(self._weight_from_down @ -world_R_distal[2])

    def _weight_matrix(self) -> Array:
        """Matrix (6, 3) from the direction down, in the distal frame, to the weight's wrench in the sensor frame."""
        mounting = self.calibration.distal_T_sensor.pose()
        sensor_R_distal = mounting.rotation().matrix().T
        lever = sensor_R_distal @ (np.array(self.calibration.com_distal_m) - mounting.translation())
        force = self.calibration.mass_kg * GRAVITY * sensor_R_distal
        return np.vstack([force, cross_matrix(lever) @ force])

    def _mean_covariance(self, window: Array) -> Array:
        """Covariance (6, 6) of a capture's mean in the sensor frame: noise of the mean, and drift since the tare."""
        model = self.calibration
        noise = np.repeat([model.force_sigma_N, model.moment_sigma_Nm], 3)
        drift = np.repeat([model.force_drift_N, model.moment_drift_Nm], 3)
        spread = np.maximum(window.var(axis=0), noise**2)
        return np.diag(spread / len(window) + drift**2)

    def _tip_contact(self, contact: EllipsoidContact, force: Array, sensor_covariance: Array) -> TipContact:
        model = self.calibration
        covariance = self._to_centre @ sensor_covariance @ self._to_centre.T
        point, normal = contact_covariance(contact, force, np.array(model.semi_axes_m), covariance)
        return TipContact(
            point_distal_m=pressed_points(contact, force, model),
            normal_distal=-contact.normal,
            point_covariance_m2=point + model.point_floor_m**2 * np.eye(3),
            normal_sigma_rad=math.sqrt(float(np.trace(normal)) / 2.0 + model.normal_floor_rad**2),
            force_N=float(np.linalg.norm(force)),
            torsion_Nm=-float(contact.torsion_Nm),
        )

    def _refusal(self, what: str, hint: str) -> DeviceError:
        return DeviceError(f"tare refused, {what}", where=f"force sensor {self.finger}", hint=hint)
