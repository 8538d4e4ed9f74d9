"""Storeys: narrower upward where contacts say so, never so narrow that a contact lies outside."""

from __future__ import annotations

import numpy as np
from gtsam import Pose2
from hypothesis import given
from hypothesis import strategies as st

from sessions.motion.probing.bounding_box import BoundingBox
from tactile_lab.autonomy.standing.felt_object import FeltObject
from tactile_lab.autonomy.standing.storeys import Storeys

AXES = Pose2(0.02, -0.01, 0.4)
TOP_m = 0.12
FACES = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]


def felt(half_m: tuple[float, float], top_m: float = TOP_m) -> FeltObject:
    half = np.array(half_m)
    return FeltObject(BoundingBox(AXES, -half, half, 0.0, top_m, {}))


def touch(known: FeltObject, places_m: list[tuple[float, float, float]], ways: list[tuple[float, float]]) -> Storeys:
    """Contacts at places, with level normals, both in the box's axes."""
    turn = AXES.rotation().matrix()
    points = np.array([[*AXES.transformFrom(np.array(place[:2])), place[2]] for place in places_m])
    normals = np.array([[*turn @ np.array(way), 0.0] for way in ways])
    known.add(points, normals)
    return known.storeys


def around(half_m: tuple[float, float], height_m: float) -> list[tuple[float, float, float]]:
    """A place in the middle of each side of a rectangle at a height."""
    return [(x * half_m[0], y * half_m[1], height_m) for x, y in FACES]


def test_what_was_not_touched_is_the_box() -> None:
    known = felt((0.05, 0.03))
    assert known.storeys.boxes == (known.standing_box,)


def test_a_clock_on_its_base_is_narrow_above_the_base() -> None:
    base, clock = (0.06, 0.04), (0.035, 0.02)
    storeys = touch(felt(base), around(base, 0.018) + around(clock, 0.045), FACES * 2)
    np.testing.assert_allclose(storeys.at(0.018).size_m[:2], [0.12, 0.08], atol=1e-6)
    np.testing.assert_allclose(storeys.at(0.040).size_m[:2], [0.12, 0.08], atol=1e-6, err_msg="it may step back here")
    np.testing.assert_allclose(storeys.at(0.050).size_m, [0.07, 0.04, TOP_m], atol=1e-6)
    beside_m = np.array([[*AXES.transformFrom(np.array([0.05, 0.0])), 0.08]])
    assert storeys.distances_m(beside_m)[0] > 0.01


def test_a_side_that_was_only_touched_below_stays_as_wide_above() -> None:
    base, clock = (0.06, 0.04), (0.035, 0.02)
    storeys = touch(felt(base), [*around(base, 0.018), (0.035, 0.0, 0.045)], [*FACES, (1.0, 0.0)])
    upper = storeys.at(0.10)
    assert clock[0] + base[0] - 1e-6 < upper.size_m[0] < clock[0] + base[0] + 1e-6
    assert abs(upper.size_m[1] - 2 * base[1]) < 1e-6


def test_a_handle_says_nothing_of_the_body_beside_it() -> None:
    """Contacts on the handle's flanks face the same way as the body's sides do, and lie nearer to the middle."""
    body = [*around((0.04, 0.04), 0.02), (-0.04, 0.0, 0.09)]
    handle = [(0.065, 0.0, 0.06), (0.055, 0.006, 0.06), (0.055, -0.006, 0.06)]
    storeys = touch(felt((0.04, 0.04)), body + handle, [*FACES, (-1.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
    assert abs(storeys.at(0.11).size_m[1] - 0.08) < 1e-6


@given(
    st.lists(
        st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(0.005, 0.11), st.integers(0, 3)),
        min_size=1,
        max_size=12,
    )
)
def test_every_contact_lies_in_them_and_none_is_wider_than_the_one_below(
    contacts: list[tuple[float, float, float, int]],
) -> None:
    known = felt((0.05, 0.05))
    storeys = touch(known, [contact[:3] for contact in contacts], [FACES[contact[3]] for contact in contacts])
    points = known._points_m
    assert storeys.distances_m(points).max() < 1e-6
    sizes = np.array([box.size_m for box in storeys.boxes])
    assert (np.diff(sizes[:, 2]) > -1e-9).all()
    assert (np.diff(sizes[:, :2], axis=0) < 1e-9).all()
