"""A BioTac fingertip, fed by the tactile slots of the hand's samples.

It measures no force in newtons. What it gives as force is a calibrated guess from fluid pressure and squeezed
electrodes: good enough to stop a finger and to weigh contacts, no more.
"""

from __future__ import annotations

import math
from collections import deque
from pathlib import Path
from typing import Annotated, Literal, Protocol

import numpy as np
from pydantic import Field

from drivers.biotac.channels import Channels
from drivers.biotac.electrodes import BallAndCylinder, ElectrodeCount, EllipsoidSkin, Skin, electrode_layout
from drivers.biotac.estimator import contact_from_electrodes, squeezed
from drivers.biotac.slot_codec import SLOT_BYTES, SLOTS, Channel, decode_slot, electrode_channel
from drivers.fingertip import RigidTransform, TipContact, Vector3
from tactile_lab.calibration_file import load_parameters
from tactile_lab.errors import CodecError, DeviceError
from tactile_lab.geometry.contacts import FINGERS, Array
from tactile_lab.strict_yaml import StrictModel


class TactileReading(Protocol):
    """The part of the hand's sample that belongs to the fingertips."""

    @property
    def stamp_ns(self) -> int: ...
    @property
    def tactile_type(self) -> int: ...
    @property
    def tactile_valid(self) -> int: ...
    @property
    def tactile(self) -> bytes: ...


class BallAndCylinderSkin(StrictModel):
    """Skin of the 19-electrode model."""

    kind: Literal["ball-and-cylinder"]
    radius_m: float = Field(default=0.007, gt=0.0)

    def surface(self) -> Skin:
        """The skin described."""
        return BallAndCylinder(self.radius_m)


class EllipsoidSkinSettings(StrictModel):
    """Skin as an ellipsoid in the BioTac frame."""

    kind: Literal["ellipsoid"]
    semi_axes_m: Vector3
    centre_m: Vector3 = (0.0, 0.0, 0.0)

    def surface(self) -> Skin:
        """The skin described."""
        return EllipsoidSkin(self.semi_axes_m, self.centre_m)


class BioTacCalibration(StrictModel):
    """One BioTac: model, mounting and what its signals mean.

    Attributes:
        electrodes: 19, or 24 for the BioTac SP.
        distal_T_sensor: BioTac frame (x to the tip, z to the back of the finger) in the distal frame.
        skin: the touched surface; the model's own when left out.
        N_per_pdc_count: force per count of fluid pressure while the skin does not rest on the core.
        N_per_electrode_count: force per count of squeezed electrodes, for harder contacts.
        touch_pdc_counts: pressure above the tare that means contact (10 counts, protocols D.4).
        electrode_noise_counts: smaller changes of an electrode are noise.
        weight_power: exponent of equation 2.24's weights.
        point_sigma_m: of the contact point along the skin, per axis; across it a third of that.
        normal_sigma_rad: of the normal, per axis.
    """

    electrodes: ElectrodeCount
    distal_T_sensor: RigidTransform
    skin: Annotated[BallAndCylinderSkin | EllipsoidSkinSettings, Field(discriminator="kind")] | None = None
    N_per_pdc_count: float = Field(default=0.005, gt=0.0)
    N_per_electrode_count: float = Field(default=0.001, gt=0.0)
    touch_pdc_counts: float = Field(default=10.0, gt=0.0)
    electrode_noise_counts: float = Field(default=15.0, ge=0.0)
    weight_power: float = Field(default=1.0, gt=0.0)
    point_sigma_m: float = Field(default=0.00085, gt=0.0)
    normal_sigma_rad: float = Field(default=0.12, gt=0.0)


class BioTacSettings(StrictModel):
    """How readings are judged.

    Attributes:
        tare_samples: newest readings of each channel that a tare averages.
        tare_pdc_spread, tare_electrode_spread: how far they may lie apart, counts, largest minus smallest.
        touch_samples: pressure readings in a row that must mean contact before a capture counts as touched.
        stale_ms: age after which a channel counts as silent.
    """

    tare_samples: int = Field(default=5, ge=2)
    tare_pdc_spread: float = Field(default=8.0, gt=0.0)
    tare_electrode_spread: float = Field(default=60.0, gt=0.0)
    touch_samples: int = Field(default=3, ge=1)
    stale_ms: float = Field(default=200.0, gt=0.0)


class _CalibrationFile(StrictModel):
    biotacs: Annotated[dict[str, BioTacCalibration], Field(min_length=1)]


def load_biotacs(path: Path) -> dict[str, BioTacCalibration]:
    """Read a BioTac calibration file: finger name to calibration. Raises ConfigurationError."""
    return load_parameters(path, _CalibrationFile).biotacs


class BioTac:
    """One BioTac (a :class:`~drivers.fingertip.FingertipSensor`)."""

    def __init__(self, finger: str, calibration: BioTacCalibration, settings: BioTacSettings | None = None) -> None:
        self.finger = finger
        self.calibration = calibration
        self._settings = settings = settings or BioTacSettings()
        self._slot = FINGERS.index(finger)
        skin = calibration.skin.surface() if calibration.skin else None
        self._layout = electrode_layout(calibration.electrodes, skin)
        self._electrodes = tuple(electrode_channel(number) for number in range(1, calibration.electrodes + 1))
        self.channels = Channels((*Channel, *self._electrodes), settings.tare_samples)
        self._tare_pdc: float | None = None
        self._tare_electrodes = np.zeros(len(self._electrodes))
        self._touches: deque[bool] = deque(maxlen=settings.touch_samples)

    def update(self, sample: TactileReading) -> None:
        """Take the finger's slot of one hand sample; slots and values not marked valid leave the last ones in place.

        Raises:
            CodecError: the tactile section has the wrong length.
        """
        if not sample.tactile_valid >> self._slot & 1:
            return
        if len(sample.tactile) != SLOTS * SLOT_BYTES:
            raise CodecError(f"{len(sample.tactile)} bytes of tactile data where {SLOTS * SLOT_BYTES} belong")
        start = self._slot * SLOT_BYTES
        slot = decode_slot(sample.tactile[start : start + SLOT_BYTES], sample.tactile_type)
        self.channels.take(slot, sample.stamp_ns)
        if Channel.PDC in slot.values and self._tare_pdc is not None:
            self._touches.append(self._pdc_rise() > self.calibration.touch_pdc_counts)

    def tare(self, world_R_distal: Array, *, reason: str = "") -> None:
        """Take the newest readings as untouched. A BioTac has no weight to take off: the orientation does not matter.

        Raises:
            DeviceError: not every channel has been heard, no sensor is fitted, or the readings move too much.
        """
        if complaint := self._tare_complaint():
            raise DeviceError(
                f"tare refused, {complaint}",
                where=f"BioTac {self.finger}",
                hint="Leave the finger untouched and still for a moment",
            )
        self._tare_pdc = float(self.channels.recent(Channel.PDC).mean())
        self._tare_electrodes = np.array([self.channels.recent(channel).mean() for channel in self._electrodes])
        self._touches.clear()

    def load_N(self, world_R_distal: Array) -> float:
        """Approximate contact force: from the pressure, or from the electrodes once the skin rests on the core.

        Zero before the first tare; infinite while no usable sensor answers, so that motion stops.
        """
        if self._tare_pdc is None:
            return 0.0
        if not self.channels.fitted:
            return math.inf
        return self._force_N(self._pdc_rise(), self.channels.newest(self._electrodes) - self._tare_electrodes)

    def begin_capture(self) -> None:
        """From here on readings are averaged for :meth:`contact`."""
        self.channels.begin_capture()

    def contact(self, world_R_distal: Array) -> TipContact | None:
        """The contact from the channels' means since :meth:`begin_capture`.

        None before a tare, when no usable sensor answers, when some channel was not heard during the capture, or
        when the pressure does not say contact.
        """
        if self._tare_pdc is None or not self.channels.fitted or not self.channels.captured:
            return None
        pdc_rise = float(self.channels.captured_means((Channel.PDC,))[0]) - self._tare_pdc
        change = self.channels.captured_means(self._electrodes) - self._tare_electrodes
        if pdc_rise <= self.calibration.touch_pdc_counts or sum(self._touches) < self._settings.touch_samples:
            return None
        found = contact_from_electrodes(
            change[None],
            self._layout,
            noise_counts=self.calibration.electrode_noise_counts,
            power=self.calibration.weight_power,
        )
        if found.squeeze[0] == 0.0:
            return None
        return self._in_distal_frame(found.points_m[0], found.normals[0], self._force_N(pdc_rise, change))

    def health(self) -> tuple[str, ...]:
        """What is wrong with the sensor, in words; empty when all is well."""
        if not self.channels.heard:
            return ("no reading received yet",)
        if not self.channels.fitted:
            return ("no sensor fitted: readings outside the converter's range",)
        problems = [] if self._tare_pdc is not None else ["not tared"]
        if silent := self.channels.older_than(self._settings.stale_ms):
            problems.append(f"{silent} channels not heard for more than {self._settings.stale_ms:.0f} ms")
        return tuple(problems)

    def _pdc_rise(self) -> float:
        return float(self.channels.newest((Channel.PDC,))[0]) - (self._tare_pdc or 0.0)

    def _force_N(self, pdc_rise: float, change: Array) -> float:
        squeeze = squeezed(change, self.calibration.electrode_noise_counts).sum()
        return float(
            max(0.0, self.calibration.N_per_pdc_count * pdc_rise, self.calibration.N_per_electrode_count * squeeze)
        )

    def _tare_complaint(self) -> str:
        needed = (Channel.PDC, *self._electrodes)
        if any(len(self.channels.recent(channel)) < self._settings.tare_samples for channel in needed):
            return "not every channel has been heard often enough"
        if not self.channels.fitted:
            return "no sensor is fitted"
        spread = {channel: float(np.ptp(self.channels.recent(channel))) for channel in needed}
        if (pdc := spread.pop(Channel.PDC)) > self._settings.tare_pdc_spread:
            return f"the pressure moves by {pdc:.0f} counts"
        if (worst := max(spread.values())) > self._settings.tare_electrode_spread:
            return f"an electrode moves by {worst:.0f} counts"
        return ""

    def _in_distal_frame(self, point_m: Array, normal: Array, force_N: float) -> TipContact:
        mounting = self.calibration.distal_T_sensor.pose()
        outward = mounting.rotation().matrix() @ normal
        along, across = self.calibration.point_sigma_m**2, (self.calibration.point_sigma_m / 3.0) ** 2
        return TipContact(
            point_distal_m=np.asarray(mounting.transformFrom(point_m)),
            normal_distal=-outward,
            point_covariance_m2=along * np.eye(3) + (across - along) * np.outer(outward, outward),
            normal_sigma_rad=self.calibration.normal_sigma_rad,
            force_N=force_N,
            torsion_Nm=0.0,
        )
