"""How far apart touches are is told in millimetres, and must be enough about every axis."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.steps.hand_chain import mount_T_link
from calibration.steps.motion_check import Check, MotionNeeds, check_touches
from calibration.steps.observations import HandPose, Plane, Touch

STILL = HandPose(np.zeros(6), np.zeros(24))


def touch(point_m: np.ndarray, normal: np.ndarray) -> Touch:
    """A touch at a place in the mount's frame, on a plane through it."""
    distal = np.linalg.inv(mount_T_link(STILL, "FF")) @ np.append(point_m, 1.0)
    return Touch("FF", STILL, distal[:3], normal, np.eye(3) * 1e-8, Plane("face", point_m, normal))


def touches_around(distance_m: float, middle_m: tuple[float, float, float]) -> list[Touch]:
    """Twelve: on planes of each axis, two along each of the other axes."""
    places = [
        (sign * distance_m * np.eye(3)[beside], np.eye(3)[axis])
        for axis in range(3)
        for beside in range(3)
        if beside != axis
        for sign in (-1, 1)
    ]
    return [touch(np.array(middle_m) + place, normal) for place, normal in places]


def lever(touches: list[Touch], needs: MotionNeeds | None = None) -> Check:
    return next(check for check in check_touches(touches, needs).checks if check.name == "lever of the weakest turn")


@pytest.mark.parametrize("middle_m", [(0.0, 0.0, 0.0), (0.3, -0.2, 0.5)])
def test_the_lever_of_symmetric_touches_is_their_distance_shared_by_three_axes(middle_m) -> None:
    """Of twelve touches, four turn about each axis, at the same lever: its mean square is a third."""
    check = lever(touches_around(0.06, middle_m))
    assert check.value == pytest.approx(60.0 / np.sqrt(3))
    assert check.needed == pytest.approx(30.0)
    assert check.ok
    assert str(check) == "lever of the weakest turn 34.64 mm of 30.00 needed"


def test_touches_close_together_are_not_enough_and_told_so_in_millimetres() -> None:
    missing = check_touches(touches_around(0.05, (0.0, 0.0, 0.0))).missing
    assert any(
        told.startswith("lever of the weakest turn 28.87 mm of 30.00 needed: rotations about") for told in missing
    )


def test_a_turn_that_touches_would_take_for_a_shift_does_not_count() -> None:
    """All touches above the middle on the same side: about the vertical nothing is told."""
    up = np.array([0.0, 0.0, 1.0])
    places = [np.array([x, y, 0.0]) for x in (-0.1, 0.1) for y in (-0.1, 0.1)]
    check = lever([touch(place, up) for place in places])
    assert check.value == pytest.approx(0.0, abs=1e-6)
    assert "(0.00, 0.00, 1.00)" in check.advice.replace("-", "")
