"""What a picture of a board adds to a lens calibration, and what is still to be shown."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from calibration.camera.views import BoardView, Coverage, adds_something, coverage, rough_lens, view_of
from drivers.core.poses import transform_points

SIZE_px, SIDE_m = (640, 480), 0.2
BOARD_m = np.array([[x, y, 0.0] for y in np.linspace(-0.1, 0.1, 5) for x in np.linspace(-0.1, 0.1, 5)])
FACING = Rot3()
ALL = {f"{row} {column}": 8 for row in ("top", "middle", "bottom") for column in ("left", "centre", "right")}
EACH_WAY = {f"away at the {side}": 1 for side in ("right", "left", "bottom", "top")}


def seen(turn: Rot3 = FACING, x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.6) -> BoardView:
    """The board as a camera with the rough lens sees it, its middle at a place in the camera's frame."""
    pose = Pose3(turn, np.array([x_m, y_m, z_m]))
    pixels = rough_lens(SIZE_px).project(transform_points(pose, BOARD_m))
    return BoardView("picture", BOARD_m, pixels, SIZE_px, SIDE_m)


def test_a_view_knows_its_tilt_and_its_distance_in_sides_of_the_board() -> None:
    straight = seen()
    assert straight.tilt == pytest.approx([0.0, 0.0], abs=1e-3)
    assert straight.distance == pytest.approx(3.0, rel=1e-3)
    assert seen(Rot3.Ry(0.4)).tilt == pytest.approx([np.sin(0.4), 0.0], abs=1e-3)
    assert seen(Rot3.Rx(0.4)).tilt == pytest.approx([0.0, -np.sin(0.4)], abs=1e-3)
    assert seen(z_m=1.0).features == pytest.approx([0.5, 0.375, 0.0, 0.0, np.log(5.0)], abs=1e-3)


def test_a_lens_before_any_calibration_looks_straight_ahead() -> None:
    lens = rough_lens(SIZE_px)
    assert (lens.focal_px, lens.centre_px) == ((pytest.approx(704.0),) * 2, (320.0, 240.0))


@pytest.mark.parametrize(
    ("turn", "shown"),
    [
        (Rot3.Ry(-0.3), "away at the right"),
        (Rot3.Ry(0.3), "away at the left"),
        (Rot3.Rx(0.3), "away at the bottom"),
        (Rot3.Rx(-0.3), "away at the top"),
    ],
)
def test_a_tilt_of_fifteen_degrees_counts_in_its_direction(turn: Rot3, shown: str) -> None:
    found = coverage([seen(turn), seen()])
    assert {name: count for name, count in found.tilts.items() if count} == {shown: 1}
    assert found.flat == 1
    assert not any(coverage([seen(Rot3.Ry(0.24))]).tilts.values())
    assert coverage([seen(Rot3.Ry(0.22))]).flat == 0


def test_corners_are_counted_by_the_ninths_of_the_picture() -> None:
    middle = coverage([seen(z_m=1.0)])
    assert {name: count for name, count in middle.regions.items() if count} == {"middle centre": 25}
    corner = coverage([seen(x_m=0.25, y_m=-0.19, z_m=1.0), seen(z_m=2.0)])
    assert corner.regions["top right"] == 16
    assert corner.regions["middle centre"] == 26  # a corner of the near board is in the middle
    assert corner.distances == pytest.approx((np.hypot(1.0, np.hypot(0.25, 0.19)) / SIDE_m, 10.0), rel=1e-3)


@pytest.mark.parametrize(
    ("regions", "tilts", "distances", "missing"),
    [
        ({}, {}, (3.0, 4.2), ()),
        ({"top left": 7}, {}, (3.0, 4.2), ("the board in the top left of the picture",)),
        ({}, {"away at the top": 0}, (3.0, 4.2), ("the board tilted, away at the top",)),
        ({}, {}, (3.0, 4.1), ("the board nearer and farther away",)),
    ],
)
def test_what_is_missing_is_said(
    regions: dict[str, int], tilts: dict[str, int], distances: tuple[float, float], missing: tuple[str, ...]
) -> None:
    assert Coverage(ALL | regions, EACH_WAY | tilts, 1, distances).missing == missing


def test_a_view_adds_something_if_it_differs_from_every_other() -> None:
    one, nearly, other = seen(), seen(Rot3.Ry(0.1)), seen(Rot3.Ry(0.2))
    assert adds_something(one, [])
    assert not adds_something(nearly, [one])
    assert adds_something(other, [one])
    assert not adds_something(other, [one, nearly])
    assert adds_something(seen(x_m=0.12), [one])
    assert adds_something(seen(z_m=0.7), [one])


class InALine:
    """A board of which only corners in one line are seen."""

    pattern, point_count, size_m, scale = "board", 20, (0.2, 0.1), 1.0

    def blurs_px(self, image: np.ndarray) -> list[float]:
        return [0.8, float("inf")]

    def match_corners(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        along = np.arange(9.0)
        return np.column_stack([0.01 * along, 0.0 * along, 0.0 * along]), np.column_stack([20 * along, 5 + 0.0 * along])


def test_corners_that_fit_no_perspective_are_told_of() -> None:
    told = view_of("a", np.zeros((480, 640), np.uint8), InALine())  # type: ignore[arg-type]
    assert told == "its corners lie elsewhere than the description says: count its columns and rows"
