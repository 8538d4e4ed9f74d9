"""The palm stays in the workspace on its way, and the way is straight in the joints wherever that is so."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.core.contacts import Array
from sessions.motion.base_path import base_path, palm_m

RADIUS_m = 0.45
SHARES = np.linspace(0.0, 1.0, 50)

places = st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(0.2, 0.5), st.floats(-2.0, 2.0))


def joints(place: tuple[float, float, float, float]) -> Array:
    return np.array([*place, 0.0, 0.0])


def is_inside(palm: Array) -> bool:
    return bool(np.hypot(*palm[:2]) < RADIUS_m)


def out_m(path: list[Array]) -> float:
    return max(float(np.hypot(*palm_m(q)[:2])) for q in path)


@given(places, places)
def test_the_palm_stays_where_both_ends_are(
    first: tuple[float, float, float, float], last: tuple[float, float, float, float]
) -> None:
    start, end = joints(first), joints(last)
    assume(is_inside(palm_m(start)) and is_inside(palm_m(end)))
    path = base_path(start, end, is_inside)
    ways = [path(float(share)) for share in SHARES]
    assert np.allclose(ways[0], start)
    assert np.allclose(ways[-1], end)
    assert out_m(ways) < RADIUS_m + 0.005  # between the places that are looked at
    assert np.allclose([q[3] for q in ways], start[3] + SHARES * (end[3] - start[3]))


def test_a_hand_that_turns_at_the_edge_swings_out_otherwise() -> None:
    """A case of the simulated rig: from one side of a bottle to the other."""
    start, end = joints((0.05, 0.25, 0.4, -0.9)), joints((0.05, -0.25, 0.4, 0.9))
    straight = [start + share * (end - start) for share in SHARES]
    edge_m = out_m([start, end]) + 0.01
    assert out_m(straight) > edge_m + 0.05
    path = base_path(start, end, lambda palm: bool(np.hypot(*palm[:2]) < edge_m))
    assert out_m([path(float(share)) for share in SHARES]) < edge_m


def test_the_way_is_straight_in_the_joints_inside() -> None:
    start, end = joints((0.0, 0.05, 0.4, -0.4)), joints((0.0, -0.05, 0.35, 0.4))
    path = base_path(start, end, lambda palm: True)
    assert np.array_equal(path(0.25), start + 0.25 * (end - start))
