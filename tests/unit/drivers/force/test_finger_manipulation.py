"""Real force data: three Nano17 inside an object that a human hand rolls between thumb, index and ring finger.

What was inferred, and how it was checked. Each sensor carries one sector of the object's wall, a cylinder of 40 mm
radius; a finger presses on the sector, so the sector is "the fingertip" of our model and its surface is an ellipsoid
with one very long axis. From the owners' program come three figures: the sensor's frame is turned by 42 degrees about
its z, the torque's origin lies 27.347 mm from the cylinder's axis, and the sector is 21.993 mm high. The data confirm
them without the surface model: where the force turns quickly while the finger stays, the axes of successive wrenches
cross at 40 mm from the cylinder's axis (median within 3 mm), and the solved contacts of sensors 1 and 2 fill just the
height of the sector. Sensor 3 gives torques that belong to no contact on its sector.

The recording goes through the RDT bytes, the device, the contact solver and the fault check as live data would.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.ati.protocols import rdt_codec
from drivers.core.clock import VirtualClock
from drivers.core.contacts import Array
from drivers.core.fingertip import FingertipCalibration, TipContact
from drivers.core.transports import Datagram, ReplayTransport

RADIUS_m, HEIGHT_m, AXIS_m = 0.040, 0.021993, 0.02734744
TURN_rad = np.radians(42.0)
SETTINGS = {"force_range_N": (25.0, 25.0, 35.0), "torque_range_Nm": (0.25, 0.25, 0.25), "contact_force_N": 0.5}
SECTOR = FingertipCalibration.model_validate(
    {
        "semi_axes_m": (RADIUS_m, 1.0, RADIUS_m),
        "centre_distal_m": (0.0, 0.0, -AXIS_m),
        "distal_T_sensor": {"translation_m": (0.0, 0.0, 0.0), "rpy_rad": (0.0, 0.0, -TURN_rad)},
        "mass_kg": 0.0,
        "com_distal_m": (0.0, 0.0, 0.0),
        "shell_min_distal_m": (-0.035, -HEIGHT_m / 2, -0.01),
        "shell_max_distal_m": (0.035, HEIGHT_m / 2, 0.02),
    }
)
WINDOW = 5


@pytest.fixture(scope="module")
def wrenches(lab_data: Path) -> Array:
    """Shape (samples, sensor, 6), newtons and newton metres."""
    table = np.loadtxt(lab_data / "finger_manipulation" / "roll" / "raw_data.csv", delimiter=",")
    return table.reshape(-1, 3, 6) * np.repeat([1.0, 1e-3], 3)


def replay(wrenches: Array) -> tuple[list[TipContact], tuple[str, ...], int]:
    """Contacts of all captures, health at the end, and how many captures were loaded; from RDT bytes."""
    counts = np.round(wrenches * 1e6).astype(np.int64)
    index = np.arange(1, len(counts) + 1)
    bytes_ = rdt_codec.encode_records(index, 117 * index, 0 * index, counts)
    transport = ReplayTransport("ft", [Datagram(bytes_[i : i + 36], i) for i in range(0, len(bytes_), 36)])
    tip = Nano17("FF", transport, VirtualClock(), SECTOR, Nano17Settings.model_validate(SETTINGS))
    for _ in range(40):
        tip.update(tip.poll())
    tip.tare(np.eye(3), reason="hand not yet on the object")
    contacts, loaded = [], 0
    for _ in range((len(counts) - 40) // WINDOW):
        tip.begin_capture()
        for _ in range(WINDOW):
            tip.update(tip.poll())
        loaded += tip.load_N(np.eye(3)) > 0.5
        if contact := tip.contact(np.eye(3)):
            contacts.append(contact)
    return contacts, tip.health(), loaded


@pytest.mark.parametrize("sensor", [1, 2])
def test_sensors_1_and_2_touch_their_sector_of_the_40_mm_radius(wrenches: Array, sensor: int) -> None:
    contacts, health, loaded = replay(wrenches[:, sensor - 1])
    assert health == ()
    assert loaded > 200
    assert len(contacts) > 0.9 * loaded
    points = np.array([contact.point_distal_m for contact in contacts])
    radius = np.hypot(points[:, 0], points[:, 2] + AXIS_m)
    np.testing.assert_allclose(radius, RADIUS_m, rtol=0, atol=1e-5)
    assert np.ptp(points[:, 1]) > 0.7 * HEIGHT_m
    inward = np.array([contact.normal_distal for contact in contacts])
    np.testing.assert_allclose(inward[:, [0, 2]] * -RADIUS_m, points[:, [0, 2]] + [0, AXIS_m], atol=1e-5)
    assert np.median([contact.torsion_Nm / contact.force_N for contact in contacts]) < 0.002


def test_sensor_3_is_reported_as_faulty(wrenches: Array) -> None:
    contacts, health, loaded = replay(wrenches[:, 2])
    assert loaded > 200
    assert any("torque does not match the force" in problem for problem in health)
    assert len(contacts) < 0.1 * loaded


@pytest.mark.parametrize("sensor", [1, 2])
def test_the_crossing_of_turning_forces_gives_the_radius_without_a_surface_model(wrenches: Array, sensor: int) -> None:
    cosine, sine = np.cos(TURN_rad), np.sin(TURN_rad)
    turn = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    force, moment = wrenches[:, sensor - 1, :3] @ turn.T, wrenches[:, sensor - 1, 3:] @ turn.T
    radii = []
    for start in range(len(force) - 4):
        f, m = force[start : start + 4], moment[start : start + 4]
        turned = np.ptp(np.arctan2(f[:, 0], -f[:, 2]))
        if np.linalg.norm(f, axis=1).min() > 1.0 and turned > np.radians(8.0):
            x, z = np.linalg.lstsq(np.c_[-f[:, 2], f[:, 0]], m[:, 1], rcond=None)[0]
            radii.append(np.hypot(x, z + AXIS_m))
    assert len(radii) > 50
    assert abs(np.median(radii) - RADIUS_m) < 0.003
