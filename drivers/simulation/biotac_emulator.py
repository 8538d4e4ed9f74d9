"""Five BioTacs in the palm's tactile section: a synthetic answer of skin and fluid to the true contacts.

Pressing lowers the counts of the electrodes under the contact and raises those around it a little, as the fluid that is
squeezed out gathers there; a sideways force drags the skin along. The laws are assumed, not measured.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.biotac.biotac import BioTacCalibration
from drivers.biotac.electrodes import electrode_layout
from drivers.biotac.slot_codec import SLOT_BYTES, Channel, Slot, electrode_channel, encode_slot
from drivers.simulation.plant import Plant, TrueContact
from drivers.simulation.settings import BiotacSettings
from tactile_lab.geometry.contacts import FINGERS, Array

_ALL_VALID = 0b11111
_PRESSURE_counts_N = 200.0
_SOFT_UNTIL_N = 2.0  # above, the skin rests on the core and the pressure stands still
_SQUEEZE_counts, _SQUEEZE_POWER, _SQUEEZE_LIMIT_counts = 330.0, 0.8, 900.0
_BULGE_SHARE, _BULGE_WIDTH = 0.10, 2.5
_SKIN_DRAG_m = 0.0012
_REST_PDC, _REST_ELECTRODE = (1700.0, 2800.0), (2600.0, 3400.0)  # ranges over sensors
_REST_PAC, _PAC_NOISE = 2042.0, 10.0
_REST_TAC, _REST_TDC = 1998.0, 2283.0
_PDC_NOISE, _HEAT_NOISE = 0.5, 1.0

_PROTOCOL, _FREQUENCY = 0xFFF9, 0xFFFA
_TEXTS = {0xFFFB: b"SynTouch", 0xFFFC: b"BTSIMULATED", 0xFFFD: b"2.3", 0xFFFE: b"1.0"}
_BIOTAC_PROTOCOL, _SAMPLE_Hz = 2, 100


class BiotacSkin:
    """One BioTac: the true contacts on its finger to counts.

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
        self._settings, self._rng = settings, rng
        self._rest = rng.uniform(*_REST_ELECTRODE, len(self._electrodes_m))
        self._rest_pdc = rng.uniform(*_REST_PDC)

    def read(self, world_T_distal: Pose3, contacts: list[TrueContact]) -> Callable[[int], int | None]:
        """The counts of any channel with these contacts; None for a channel this sensor lacks."""
        squeeze = np.zeros(len(self._rest))
        pressing_N = 0.0
        sensor_T_world = (world_T_distal * self.distal_T_sensor).inverse() if contacts else Pose3()
        for contact in contacts:
            normal_N, counts = self._press(sensor_T_world, contact)
            pressing_N += normal_N
            squeeze += counts
        limited = _SQUEEZE_LIMIT_counts * np.tanh(squeeze / _SQUEEZE_LIMIT_counts)
        pdc = self._rest_pdc + _PRESSURE_counts_N * min(pressing_N, _SOFT_UNTIL_N)
        return lambda channel: self._counts(channel, pdc, self._rest - limited)

    def vibration(self) -> tuple[int, int]:
        """Two readings of the vibration channel."""
        first, second = np.rint(_REST_PAC + _PAC_NOISE * self._rng.standard_normal(2)).astype(int)
        return int(first), int(second)

    def _press(self, sensor_T_world: Pose3, contact: TrueContact) -> tuple[float, Array]:
        """Normal force and squeeze of each electrode, counts, shape (n,)."""
        rotation = sensor_T_world.rotation().matrix()
        normal, force = rotation @ contact.normal_world, rotation @ contact.force_on_tip_world_N
        pressing = max(float(normal @ force), 0.0)
        sideways = force - pressing * normal
        drag = _SKIN_DRAG_m * sideways / max(pressing, 1e-6) * min(1.0, pressing)
        point = np.asarray(sensor_T_world.transformFrom(contact.point_world_m)) + drag
        squared = ((self._electrodes_m - point) ** 2).sum(axis=1) / self._settings.response_length_m**2
        shape = np.exp(-squared / 2) - _BULGE_SHARE * np.exp(-squared / (2 * _BULGE_WIDTH**2))
        return pressing, _SQUEEZE_counts * pressing**_SQUEEZE_POWER * shape

    def _counts(self, channel: int, pdc: float, electrodes: Array) -> int | None:
        first = electrode_channel(1)
        if channel >= first + len(electrodes):
            return None
        if channel >= first:
            value, noise = electrodes[channel - first], self._settings.noise_counts
        else:
            value, noise = {
                Channel.PDC: (pdc, _PDC_NOISE),
                Channel.TAC: (_REST_TAC, _HEAT_NOISE),
                Channel.TDC: (_REST_TDC, _HEAT_NOISE),
            }[Channel(channel)]
        return int(np.clip(np.rint(value + noise * self._rng.standard_normal()), 0, 4095))


class BiotacSection:
    """The palm's tactile section with a BioTac on every finger.

    Args:
        plant: where the contacts come from.
        skins: the sensors, by finger.
    """

    def __init__(self, plant: Plant, skins: Mapping[str, BiotacSkin]) -> None:
        self._plant, self._skins = plant, skins

    def answer(self, data_type: int) -> tuple[int, NDArray[np.uint8]]:
        """All five sensors answer every request they know; to others none is valid."""
        if data_type in _TEXTS or data_type in (_PROTOCOL, _FREQUENCY):
            return _ALL_VALID, np.tile(np.frombuffer(_identity(data_type), np.uint8), (len(FINGERS), 1))
        if not Channel.PDC <= data_type <= electrode_channel(24):
            return 0, np.zeros((len(FINGERS), SLOT_BYTES), np.uint8)
        contacts = self._plant.contacts()
        slots = b"".join(self._slot(finger, data_type, contacts) for finger in FINGERS)
        return _ALL_VALID, np.frombuffer(slots, np.uint8).reshape(len(FINGERS), SLOT_BYTES)

    def _slot(self, finger: str, data_type: int, contacts: tuple[TrueContact, ...]) -> bytes:
        skin = self._skins[finger]
        counts = skin.read(
            self._plant.world_T_distal(finger), [contact for contact in contacts if contact.finger == finger]
        )
        readings = {channel: counts(channel) for channel in (data_type, data_type + 1)}
        values = {channel: value for channel, value in readings.items() if value is not None}
        return encode_slot(Slot(skin.vibration(), values), data_type)


def _identity(data_type: int) -> bytes:
    """The 16 bytes of a question about the sensor itself."""
    words = {_PROTOCOL: _BIOTAC_PROTOCOL, _FREQUENCY: _SAMPLE_Hz}
    content = words[data_type].to_bytes(2, "little") if data_type in words else _TEXTS[data_type]
    return content.ljust(SLOT_BYTES, b"\0")
