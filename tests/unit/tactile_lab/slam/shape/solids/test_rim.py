"""Rims that are level, and rims that lean: what is below them and within them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.solids.rim import Rim
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m

RADIUS_m, HIGH_m = 0.036, 0.08
MIDDLE_m = np.array([0.0, 0.0, 0.04])


def pipe(lean_rad: float, on_rim: int = 9) -> tuple[Rim, Array]:
    """The rim of a pipe that leans, of which so many contacts of nine were felt, and the pipe's pose."""
    around = np.linspace(0, 2 * np.pi, 9, endpoint=False)
    out = np.column_stack([np.cos(around), np.sin(around), np.zeros(9)])
    turn = Rotation.from_rotvec([0.0, lean_rad, 0.0]).as_matrix()
    points_m = np.vstack([RADIUS_m * out + [0, 0, 0.04], (RADIUS_m * out + [0, 0, HIGH_m])[:on_rim]])
    normals = np.vstack([out, np.tile([0.0, 0.0, 1.0], (on_rim, 1))])
    return Rim.of(Gpis.fit(points_m @ turn.T, normals @ turn.T, POINT_SIGMA_m, NORMAL_SIGMA_rad)), turn


@given(
    lean_rad=st.floats(np.radians(6.0), np.radians(16.0)), depth_m=st.floats(0.005, 0.07), aside=st.floats(-0.9, 0.9)
)
def test_what_is_in_a_pipe_that_leans_is_enclosed_by_its_rim_at_any_depth(
    lean_rad: float, depth_m: float, aside: float
) -> None:
    rim, turn = pipe(lean_rad)
    inside_m = turn @ [aside * (RADIUS_m - 0.003), 0.0, HIGH_m - depth_m]
    outside_m = turn @ [np.copysign(RADIUS_m + 0.003, aside), 0.0, HIGH_m - depth_m]
    places_m = np.array([inside_m, outside_m])
    assert rim.depths_m(places_m) * np.cos(lean_rad) == pytest.approx(depth_m, abs=1e-9)
    assert rim.encloses(places_m, turn @ MIDDLE_m).tolist() == [True, False]
    assert rim.surrounded(places_m, rim.contacts_m).tolist()[1] is False


@pytest.mark.parametrize(("lean_deg", "on_rim"), [(2.0, 9), (15.0, 4), (15.0, 0)])
def test_a_rim_is_level_if_few_contacts_say_otherwise_or_by_little(lean_deg: float, on_rim: int) -> None:
    rim, _ = pipe(np.radians(lean_deg), on_rim)
    assert not rim.slope.any()
    np.testing.assert_array_equal(rim.seen_m(MIDDLE_m[None])[0], MIDDLE_m[:2])
    assert len(rim.contacts_m) == on_rim


def test_contacts_in_no_plane_are_on_no_rim_that_leans() -> None:
    rng = np.random.default_rng(3)
    points_m = np.column_stack([rng.uniform(-0.04, 0.04, (12, 2)), HIGH_m - np.repeat([0.0, 0.015], 6)])
    rim = Rim.of(Gpis.fit(points_m, np.tile([0.0, 0.0, 1.0], (12, 1)), POINT_SIGMA_m, NORMAL_SIGMA_rad))
    assert not rim.slope.any()


def test_without_contacts_on_it_nothing_is_below_a_rim() -> None:
    rim, _ = pipe(0.0, 0)
    assert rim.depths_m(MIDDLE_m[None])[0] == -np.inf
    assert not rim.encloses(MIDDLE_m[None], MIDDLE_m).any()
