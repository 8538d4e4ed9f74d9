"""Five BioTacs in the palm's tactile section: a synthetic response of skin and fluid to the true contacts.

Pressing lowers the counts of the electrodes under the contact. It raises those around it a little, because displaced
fluid collects there. A tangential force drags the skin along. A contact that slides makes the skin vibrate, the
more the faster it slides and the harder it presses; nothing else does, neither motors nor touches. These laws are
assumed, not measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.biotac.biotac import BioTacCalibration
from drivers.biotac.electrodes import electrode_layout
from drivers.biotac.slot_codec import LARGEST_COUNT, SLOT_BYTES, Channel, Slot, electrode_channel, encode_slot
from drivers.core.contacts import FINGERS, Array
from drivers.simulation.hand_plant import TouchedPlant, TrueContact
from drivers.simulation.settings import BiotacSettings

_ALL_VALID = 0b11111
_PRESSURE_counts_N = 200.0
_SOFT_UNTIL_N = 2.0  # above this, the skin rests on the core and the pressure stays constant
_SQUEEZE_counts, _SQUEEZE_POWER, _SQUEEZE_LIMIT_counts = 330.0, 0.8, 900.0
_BULGE_SHARE, _BULGE_WIDTH = 0.10, 2.5
_SKIN_DRAG_m = 0.0012
_REST_PDC, _REST_ELECTRODE = (1700.0, 2800.0), (2600.0, 3400.0)  # ranges over sensors
_REST_PAC, _PAC_NOISE = 2042.0, 10.0
_VIBRATION_counts_s_m_N = 3000.0  # 15 counts, 1.5 times the noise, at 10 mm/s under 0.5 N: a skin on a smooth thing
_REST_TAC, _REST_TDC = 1998.0, 2283.0
_PDC_NOISE, _HEAT_NOISE = 0.5, 1.0

_PROTOCOL, _FREQUENCY, _SERIAL = 0xFFF9, 0xFFFA, 0xFFFC
_WORDS = {_PROTOCOL: 2, _FREQUENCY: 100}  # BioTac; samples per second
_TEXTS = {0xFFFB: b"SynTouch", 0xFFFD: b"2.3", 0xFFFE: b"1.0"}
_SERIALS = {19: b"BTSIM-", 24: b"BTSP-SIM-"}


class BiotacSkin:
    """One BioTac: converts the true contacts on its finger to counts.

    Args:
        calibration: its electrodes, mounting and skin.
        settings: noise and width of the response.
        rng: resting values of this sensor, and noise.
    """

    def __init__(self, calibration: BioTacCalibration, settings: BiotacSettings, rng: np.random.Generator) -> None:
        skin = calibration.skin.surface() if calibration.skin else None
        layout = electrode_layout(calibration.electrodes, skin)
        self.distal_T_sensor = calibration.distal_T_sensor.pose()
        self._electrodes_m = layout.skin.project(layout.positions_m)[0]
        self._rng, self._length_m = rng, settings.response_length_m
        count = len(self._electrodes_m)
        heat = (_REST_TAC, _REST_TDC)
        self._rest = np.array([rng.uniform(*_REST_PDC), *heat, *rng.uniform(*_REST_ELECTRODE, count)])
        self.electrodes = count
        self._noise = np.array([_PDC_NOISE, _HEAT_NOISE, _HEAT_NOISE, *[settings.noise_counts] * count])

    def channels(self, world_T_distal: Pose3, contacts: Sequence[TrueContact]) -> Array:
        """Counts of every channel with these contacts, without noise: pressure, heat flow, heat, electrodes."""
        squeeze, pressing_N = np.zeros(len(self._electrodes_m)), 0.0
        sensor_T_world = (world_T_distal * self.distal_T_sensor).inverse()
        for contact in contacts:
            normal_N, counts = self._press(sensor_T_world, contact)
            pressing_N += normal_N
            squeeze += counts
        limited = _SQUEEZE_LIMIT_counts * np.tanh(squeeze / _SQUEEZE_LIMIT_counts)
        pressure = _PRESSURE_counts_N * min(pressing_N, _SOFT_UNTIL_N)
        return np.asarray(self._rest + np.concatenate([[pressure, 0.0, 0.0], -limited]))

    def slot(self, data_type: int, channels: Array | None = None, vibration_counts: float = 0.0) -> bytes:
        """The answer to a request, with noise.

        Channels that this sensor lacks are marked invalid.

        Args:
            data_type: the request.
            channels: as from :meth:`channels`; by default without contact.
            vibration_counts: as from :func:`vibration_counts`.
        """
        counts = self._rest if channels is None else channels
        known = [channel for channel in (data_type, data_type + 1) if channel <= len(counts)]
        noise = self._rng.standard_normal(4)
        vibration = [_pac(float(value) * math.hypot(_PAC_NOISE, vibration_counts)) for value in noise[2:]]
        values = {
            channel: min(max(round(float(counts[channel - 1] + self._noise[channel - 1] * fresh)), 0), LARGEST_COUNT)
            for channel, fresh in zip(known, noise, strict=False)
        }
        return encode_slot(Slot((vibration[0], vibration[1]), values), data_type)

    def _press(self, sensor_T_world: Pose3, contact: TrueContact) -> tuple[float, Array]:
        """Normal force and squeeze of each electrode, counts, shape (n,)."""
        rotation = sensor_T_world.rotation().matrix()
        normal, force = rotation @ contact.normal_world, rotation @ contact.force_on_tip_world_N
        pressing = max(float(normal @ force), 0.0)
        sideways = force - pressing * normal
        drag = _SKIN_DRAG_m * sideways / max(pressing, 1e-6) * min(1.0, pressing)
        point = np.asarray(sensor_T_world.transformFrom(contact.point_world_m)) + drag
        squared = ((self._electrodes_m - point) ** 2).sum(axis=1) / self._length_m**2
        shape = np.exp(-squared / 2) - _BULGE_SHARE * np.exp(-squared / (2 * _BULGE_WIDTH**2))
        return pressing, _SQUEEZE_counts * pressing**_SQUEEZE_POWER * shape


class BiotacSection:
    """The palm's tactile section with a BioTac on every finger.

    Args:
        plant: source of the contacts.
        skins: the sensors, by finger.
    """

    def __init__(self, plant: TouchedPlant, skins: Mapping[str, BiotacSkin]) -> None:
        self._plant, self._skins = plant, skins

    @classmethod
    def as_calibrated(
        cls,
        plant: TouchedPlant,
        calibrations: Mapping[str, BioTacCalibration],
        settings: BiotacSettings,
        rng: np.random.Generator,
    ) -> BiotacSection:
        """A section with one sensor per finger, each as calibrated."""
        return cls(plant, {finger: BiotacSkin(calibrations[finger], settings, rng) for finger in FINGERS})

    def answer(self, data_type: int) -> tuple[int, NDArray[np.uint8]]:
        """Answer a request: all five sensors know the same ones; the answers to others are invalid."""
        if data_type == _SERIAL or data_type in _WORDS or data_type in _TEXTS:
            return _ALL_VALID, _slots([self._name(finger, data_type) for finger in FINGERS])
        if not Channel.PDC <= data_type <= electrode_channel(24):
            return 0, np.zeros((len(FINGERS), SLOT_BYTES), np.uint8)
        contacts = self._plant.contacts()
        return _ALL_VALID, _slots([self._slot(finger, data_type, contacts) for finger in FINGERS])

    def _name(self, finger: str, question: int) -> bytes:
        """The answer to a request for the sensor's own name."""
        if question == _SERIAL:
            return _SERIALS[self._skins[finger].electrodes] + finger.encode()
        return _WORDS[question].to_bytes(2, "little") if question in _WORDS else _TEXTS[question]

    def _slot(self, finger: str, data_type: int, contacts: tuple[TrueContact, ...]) -> bytes:
        skin = self._skins[finger]
        if touches := [contact for contact in contacts if contact.finger == finger]:
            channels = skin.channels(self._plant.world_T_distal(finger), touches)
            return skin.slot(data_type, channels, vibration_counts(touches))
        return skin.slot(data_type)


def vibration_counts(contacts: Sequence[TrueContact]) -> float:
    """How strongly sliding contacts make one fingertip's skin vibrate: root mean square, counts of PAC."""
    pressing_N = [max(float(each.normal_world @ each.force_on_tip_world_N), 0.0) for each in contacts]
    powers = [force_N * each.slides_m_s for force_N, each in zip(pressing_N, contacts, strict=True)]
    return _VIBRATION_counts_s_m_N * sum(powers)


def _pac(swing: float) -> int:
    return min(max(round(_REST_PAC + swing), 0), LARGEST_COUNT)


def _slots(answers: Sequence[bytes]) -> NDArray[np.uint8]:
    """The answers in the palm's status, shape (5, 16)."""
    together = b"".join(answer.ljust(SLOT_BYTES, b"\0") for answer in answers)
    return np.frombuffer(together, np.uint8).reshape(len(answers), SLOT_BYTES)
