"""Contacts at any moment, as a capture finds them at rest."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.fingertip import ContinuousFingertip, load_fingertips
from drivers.force.force_fingertip import ForceTip, ForceTipSettings, WrenchSample
from tactile_lab.rigs.description import load_rig

STILL = np.array([0.01, -0.02, 0.3, 0.0, 0.0, 0.0])
PRESSED = STILL + np.array([-0.106, 0.894, 0.0, -0.0134, -0.0016, 0.0])
"""On the palm's side of the tip, 1 mm beside its middle."""


@pytest.fixture
def tip() -> ForceTip:
    """A fingertip that was tared without a contact."""
    sensor = ForceTip("FF", load_fingertips(load_rig("sim").files["fingertips"])["FF"], ForceTipSettings())
    feel(sensor, STILL)
    sensor.tare(np.eye(3))
    return sensor


def feel(sensor: ForceTip, wrench: Array, count: int = 200) -> None:
    first = sensor.sequences.seen + 1
    sensor.update([WrenchSample(n, wrench + 1e-6 * (n % 3), n, n, 0, (), ()) for n in range(first, first + count)])


def test_a_force_fingertip_tells_its_contact_at_any_moment(tip: ForceTip) -> None:
    assert isinstance(tip, ContinuousFingertip)
    tip.begin_capture()
    feel(tip, PRESSED)
    captured = tip.contact(np.eye(3))
    touches = tip.touches(np.array([tip.reading(), STILL - STILL]), np.tile(np.eye(3), (2, 1, 1)))
    assert captured is not None
    np.testing.assert_allclose(touches.points_distal_m[0], captured.point_distal_m, atol=1e-5)
    np.testing.assert_allclose(touches.normals_distal[0], captured.normal_distal, atol=1e-4)
    assert touches.normal_forces_N[0] == pytest.approx(0.9, abs=0.01)
    assert touches.is_certain.tolist() == [True, False]
    assert not touches.is_void.any()


def test_a_light_touch_is_none(tip: ForceTip) -> None:
    feel(tip, STILL)
    touches = tip.touches(tip.reading()[None], np.eye(3)[None])
    assert not touches.is_certain[0]
    assert touches.normal_forces_N[0] == 0.0


def test_a_saturated_reading_is_void(tip: ForceTip) -> None:
    feel(tip, 1e3 * np.ones(6))
    assert np.isnan(tip.reading()).all()
    touches = tip.touches(tip.reading()[None], np.eye(3)[None])
    assert touches.is_void[0]
    assert not touches.is_certain[0]
    assert np.isfinite(touches.points_distal_m).all()


def test_nothing_is_told_before_the_first_reading() -> None:
    sensor = ForceTip("FF", load_fingertips(load_rig("sim").files["fingertips"])["FF"], ForceTipSettings())
    assert np.isnan(sensor.reading()).all()


def test_a_skin_that_yields_is_touched_inside_its_ellipsoid_by_captures_and_at_any_moment_alike(tip: ForceTip) -> None:
    stiff = tip.calibration.model_copy(update={"yield_m": 0.0})
    soft = tip.calibration.model_copy(update={"yield_m": 0.001, "yield_exponent": 0.5})
    force_N = float(np.linalg.norm((PRESSED - STILL)[:3]))
    points = {}
    for name, calibration in (("stiff", stiff), ("soft", soft)):
        sensor = ForceTip("FF", calibration, ForceTipSettings())
        feel(sensor, STILL)
        sensor.tare(np.eye(3))
        sensor.begin_capture()
        feel(sensor, PRESSED)
        captured = sensor.contact(np.eye(3))
        assert captured is not None
        at_any = sensor.touches(sensor.reading()[None], np.eye(3)[None]).points_distal_m[0]
        np.testing.assert_allclose(at_any, captured.point_distal_m, atol=1e-5)
        points[name], into_tip = captured.point_distal_m, captured.normal_distal
    indented_m = (points["soft"] - points["stiff"]) @ into_tip
    assert indented_m == pytest.approx(0.001 * force_N**0.5, rel=0.01)


def test_a_force_that_pulls_presses_nothing_in(tip: ForceTip) -> None:
    assert tip.calibration.indentation_m(np.array([-0.5, 0.0])).tolist() == [0.0, 0.0]
