"""A BioTac fingertip, fed by the tactile slots of the hand's samples.

The sensor does not measure force in newtons. The reported force is a calibrated estimate from the fluid pressure and
the squeezed electrodes: good enough to stop a finger and to weight contacts, but no more.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Protocol

import numpy as np

from drivers.biotac.channels import Channels
from drivers.biotac.electrodes import electrode_layout
from drivers.biotac.estimator import contact_from_electrodes, squeeze_counts
from drivers.biotac.learned_normal import LearnedNormals
from drivers.biotac.settings import BioTacCalibration, BioTacSettings, EllipsoidSkinSettings, load_biotacs
from drivers.biotac.slot_codec import PALM_SLOT_BYTES, SLOT_BYTES, SLOTS, Channel, Slot, decode_slot, electrode_channel
from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import CodecError, ConfigurationError, DeviceError
from drivers.core.fingertip import TipContact
from drivers.shadow.protocol.tactile_names import TactileAnswers

_NOT_FITTED = "no sensor fitted: readings outside the converter's range"

__all__ = ["BioTac", "BioTacCalibration", "BioTacSettings", "EllipsoidSkinSettings", "TactileReading", "load_biotacs"]


class TactileReading(TactileAnswers, Protocol):
    """The tactile part of one hand sample, with its stamp."""

    @property
    def stamp_ns(self) -> int: ...


class BioTac:
    """One BioTac (a :class:`~drivers.core.fingertip.FingertipSensor`).

    Args:
        finger: the finger that carries it.
        calibration: of this sensor.
        settings: tolerances and times by which its readings are checked.
        normals: learned contact normals; if None, the skin's normals at the point of equation 2.24 are used.

    Raises:
        ConfigurationError: the normals were learned with a different number of electrodes.
    """

    def __init__(
        self,
        finger: str,
        calibration: BioTacCalibration,
        settings: BioTacSettings | None = None,
        normals: LearnedNormals | None = None,
    ) -> None:
        if normals is not None and normals.electrodes != calibration.electrodes:
            what = (
                f"the normals were learned with {normals.electrodes} electrodes, but the sensor has "
                f"{calibration.electrodes}"
            )
            hint = "Train with a recording of this sensor"
            raise ConfigurationError(what, where=f"BioTac {finger}", hint=hint)
        self.finger = finger
        self.calibration = calibration
        self.normals = normals
        self._settings = settings = settings or BioTacSettings()
        self._slot = FINGERS.index(finger)
        skin = calibration.skin.surface() if calibration.skin else None
        self._layout = electrode_layout(calibration.electrodes, skin)
        self._electrodes = tuple(electrode_channel(number) for number in range(1, calibration.electrodes + 1))
        self.channels = Channels((*Channel, *self._electrodes), settings.tare_samples)
        self._tare_pdc: float | None = None
        self._tare_electrodes = np.zeros(len(self._electrodes))
        self._touches: deque[bool] = deque(maxlen=settings.touch_samples)
        self._followed_ns = 0

    def update(self, sample: TactileReading) -> None:
        """Take the finger's slot of one hand sample. Values that are not marked valid leave the previous ones
        unchanged.

        Raises:
            CodecError: the tactile section has the wrong length.
        """
        if not sample.tactile_valid >> self._slot & 1:
            return
        stride, odd = divmod(len(sample.tactile), SLOTS)
        if odd or stride not in PALM_SLOT_BYTES:
            raise CodecError(f"{len(sample.tactile)} bytes of tactile data instead of {SLOTS * SLOT_BYTES}")
        start = self._slot * stride
        self.take(decode_slot(sample.tactile[start : start + SLOT_BYTES], sample.tactile_type), sample.stamp_ns)

    def take(self, slot: Slot, stamp_ns: int) -> None:
        """Take one decoded slot, or one reading of a stand-alone sensor's log (:mod:`drivers.biotac.cheetah_log`)."""
        self.channels.take(slot, stamp_ns)
        if Channel.PDC not in slot.values or self._tare_pdc is None or not self.channels.fitted:
            return
        self._touches.append(self._pdc_rise() > self.calibration.touch_pdc_counts)
        if self._settings.follow_s:
            self._follow(stamp_ns)

    def vibration_at(self, stamp_ns: int) -> tuple[int, ...]:
        """Readings of the vibration channel (PAC) that came with the sample of this stamp, counts; empty for none."""
        return self.channels.vibration if self.channels.newest_ns == stamp_ns and self.channels.fitted else ()

    def tare(self, world_R_distal: Array, *, reason: str = "") -> None:
        """Take the newest readings as those without contact. A BioTac does not feel its own weight: any orientation
        will do.

        Raises:
            DeviceError: some channel has not been received, no sensor is fitted, or the readings vary too much.
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
        self._followed_ns = self.channels.newest_ns

    def _follow(self, stamp_ns: int) -> None:
        """Let the tare follow slow changes (temperature, inflation) while there is certainly no contact.

        That means: no recent reading near the touch threshold, and no electrode squeezed beyond its noise.
        """
        elapsed_s, self._followed_ns = (stamp_ns - self._followed_ns) / NANOSECONDS, stamp_ns
        change = self.channels.newest(self._electrodes) - self._tare_electrodes
        rises = self.channels.recent(Channel.PDC) - (self._tare_pdc or 0.0)
        near_touch = np.abs(rises).max() > 0.5 * self.calibration.touch_pdc_counts
        if near_touch or any(self._touches) or squeeze_counts(change, self.calibration.electrode_noise_counts).any():
            return
        share = 1.0 - math.exp(-max(elapsed_s, 0.0) / self._settings.follow_s)
        self._tare_pdc = (self._tare_pdc or 0.0) + share * float(rises[-1])
        self._tare_electrodes = self._tare_electrodes + share * change

    def load_N(self, world_R_distal: Array) -> float:
        """Approximate contact force, N: from the pressure or, once the skin rests on the core, from the electrodes.

        Zero before the first tare; infinite while no usable sensor answers, so that the motion stops.
        """
        if self._tare_pdc is None:
            return 0.0
        if not self.channels.fitted:
            return math.inf
        return self._force_N(self._pdc_rise(), self.channels.newest(self._electrodes) - self._tare_electrodes)

    def void(self) -> str:
        """Why the newest readings give no force, in plain English; "" while they do."""
        return _NOT_FITTED if self.channels.heard and not self.channels.fitted else ""

    def begin_capture(self) -> None:
        """Start to average readings for :meth:`contact`."""
        self.channels.begin_capture()

    def contact(self, world_R_distal: Array) -> TipContact | None:
        """The contact from the channels' means since :meth:`begin_capture`.

        None before a tare, if no usable sensor answers, if some channel was not received during the capture, if the
        pressure does not show contact, or if no electrode is squeezed.
        """
        return None if (changes := self._captured_changes()) is None else self._contact(*changes)

    def pressed_N(self) -> float | None:
        """Force of the touch since :meth:`begin_capture`, by the pressure, which tells also what meets the skin lightly
        or away from all electrodes; None where :meth:`contact` has none for another reason.
        """
        return None if (changes := self._captured_changes()) is None else self._force_N(*changes)

    def _captured_changes(self) -> tuple[float, Array] | None:
        """Means of pressure and electrodes since :meth:`begin_capture`, against the tare; None without a touch."""
        if self._tare_pdc is None or not self.channels.fitted or not self.channels.captured:
            return None
        pdc_rise = float(self.channels.captured_means((Channel.PDC,))[0]) - self._tare_pdc
        if pdc_rise <= self.calibration.touch_pdc_counts or sum(self._touches) < self._settings.touch_samples:
            return None
        return pdc_rise, self.channels.captured_means(self._electrodes) - self._tare_electrodes

    def newest_contact(self) -> TipContact | None:
        """The contact from the newest readings alone; None before a tare and if no electrode is squeezed."""
        if self._tare_pdc is None or not self.channels.fitted:
            return None
        return self._contact(self._pdc_rise(), self.channels.newest(self._electrodes) - self._tare_electrodes)

    def _contact(self, pdc_rise: float, change: Array) -> TipContact | None:
        """The contact from changes against the tare; None if no electrode is squeezed."""
        found = contact_from_electrodes(
            change[None],
            self._layout,
            noise_counts=self.calibration.electrode_noise_counts,
            power=self.calibration.weight_power,
        )
        if found.squeeze[0] == 0.0:
            return None
        normal, sigma_rad = found.normals[0], self.calibration.normal_sigma_rad
        if self.normals is not None:
            normals, sigmas = self.normals.normals(change[None])
            normal, sigma_rad = normals[0], float(sigmas[0])
        return self._in_distal_frame(found.points_m[0], normal, sigma_rad, self._force_N(pdc_rise, change))

    def health(self) -> tuple[str, ...]:
        """What is wrong with the sensor, in plain English; empty if nothing is."""
        if not self.channels.heard:
            return ("no reading received yet",)
        if not self.channels.fitted:
            return (_NOT_FITTED,)
        problems = [] if self._tare_pdc is not None else ["not tared"]
        if silent := self.channels.older_than(self._settings.stale_ms):
            problems.append(f"{silent} channels not received for more than {self._settings.stale_ms:.0f} ms")
        return tuple(problems)

    def _pdc_rise(self) -> float:
        return float(self.channels.newest((Channel.PDC,))[0]) - (self._tare_pdc or 0.0)

    def _force_N(self, pdc_rise: float, change: Array) -> float:
        squeeze = squeeze_counts(change, self.calibration.electrode_noise_counts).sum()
        return float(
            max(0.0, self.calibration.N_per_pdc_count * pdc_rise, self.calibration.N_per_electrode_count * squeeze)
        )

    def _tare_complaint(self) -> str:
        needed = (Channel.PDC, *self._electrodes)
        if any(len(self.channels.recent(channel)) < self._settings.tare_samples for channel in needed):
            return "not every channel has been received often enough"
        if not self.channels.fitted:
            return "no sensor is fitted"
        spread = {channel: float(np.ptp(self.channels.recent(channel))) for channel in needed}
        if (pdc := spread.pop(Channel.PDC)) > self._settings.tare_pdc_spread:
            return f"the pressure varies by {pdc:.0f} counts"
        if (worst := max(spread.values())) > self._settings.tare_electrode_spread:
            return f"an electrode varies by {worst:.0f} counts"
        return ""

    def _in_distal_frame(self, point_m: Array, normal: Array, sigma_rad: float, force_N: float) -> TipContact:
        mounting = self.calibration.distal_T_sensor.pose()
        outward = mounting.rotation().matrix() @ normal
        along, across = self.calibration.point_sigma_m**2, (self.calibration.point_sigma_m / 3.0) ** 2
        return TipContact(
            point_distal_m=np.asarray(mounting.transformFrom(point_m)),
            normal_distal=-outward,
            point_covariance_m2=along * np.eye(3) + (across - along) * np.outer(outward, outward),
            normal_sigma_rad=sigma_rad,
            force_N=force_N,
            torsion_Nm=0.0,
        )
