from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.positioner.ur.limiter import MotionLimiter

CYCLE_s, SPEEDS, ACCELERATIONS = 0.008, (0.3, 1.2), (2.0, 6.0)
place = st.tuples(*[st.floats(-1, 1)] * 6).map(np.array)


def walk(targets: list[np.ndarray], cycles: int = 60) -> np.ndarray:
    limiter = MotionLimiter(SPEEDS, ACCELERATIONS, np.zeros(6))
    return np.array([limiter.step(target, CYCLE_s) for target in targets for _ in range(cycles)])


@given(st.lists(place, min_size=1, max_size=4))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_speed_and_acceleration_stay_within_limits_whatever_the_targets(targets: list[np.ndarray]) -> None:
    places = np.vstack([np.zeros((2, 6)), walk(targets)])
    velocities = np.diff(places, axis=0) / CYCLE_s
    changes = np.diff(velocities, axis=0) / CYCLE_s
    for part, speed, acceleration in zip((slice(0, 3), slice(3, 6)), SPEEDS, ACCELERATIONS, strict=True):
        assert np.linalg.norm(velocities[:, part], axis=1).max() <= speed * (1 + 1e-6)
        assert np.linalg.norm(changes[:, part], axis=1).max() <= acceleration * (1 + 1e-6)


def test_it_arrives_without_overshoot_and_stays() -> None:
    target = np.array([0.2, -0.1, 0.05, 0.4, 0.0, -0.2])
    places = walk([target], 400)
    np.testing.assert_allclose(places[-1], target, atol=1e-9)
    assert (np.abs(places) <= np.abs(target) + 1e-3).all()


def test_braking_takes_no_longer_than_the_acceleration_permits() -> None:
    limiter = MotionLimiter(SPEEDS, ACCELERATIONS, np.zeros(6))
    for _ in range(100):
        limiter.step(np.array([1.0, 0, 0, 0, 0, 0]), CYCLE_s)
    before = limiter.place.copy()
    cycles = 0
    while np.abs(limiter.speed).max() >= 1e-9:
        limiter.brake(CYCLE_s)
        cycles += 1
    assert cycles * CYCLE_s <= SPEEDS[0] / ACCELERATIONS[0] + 2 * CYCLE_s
    assert limiter.place[0] - before[0] <= SPEEDS[0] ** 2 / ACCELERATIONS[0]
