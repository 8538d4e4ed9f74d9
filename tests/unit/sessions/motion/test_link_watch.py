"""Links that feel nothing: what the motors' strain gauges tell of a push on them."""

from __future__ import annotations

import numpy as np

from sessions.motion.link_watch import LinkWatch


def counts(rng: np.random.Generator, pushed: float = 0.0) -> np.ndarray:
    torques = 300.0 + 10.0 * rng.standard_normal(20)
    torques[18] += pushed
    return torques


def cycles_until_touched(pushed: float, begins: int, cycles: int = 400) -> int | None:
    rng, watch = np.random.default_rng(0), LinkWatch()
    for cycle in range(cycles):
        if watch.is_touched(counts(rng, pushed if cycle >= begins else 0.0)):
            return cycle
    return None


def test_noise_alone_is_no_touch() -> None:
    assert cycles_until_touched(0.0, 0) is None


def test_a_push_is_told_in_its_second_cycle() -> None:
    assert cycles_until_touched(400.0, 200) == 201


def test_a_lone_jerk_and_the_jerk_of_starting_are_no_touch() -> None:
    rng, watch = np.random.default_rng(0), LinkWatch()
    pushes = [900.0 if cycle < 20 or cycle == 100 else 0.0 for cycle in range(200)]
    assert not any(watch.is_touched(counts(rng, push)) for push in pushes)


def test_a_new_motion_is_compared_with_itself() -> None:
    rng, watch = np.random.default_rng(0), LinkWatch()
    assert not any(watch.is_touched(counts(rng)) for _ in range(100))
    watch.restart()
    assert not any(watch.is_touched(counts(rng, 900.0)) for _ in range(100))


def test_a_hand_without_strain_gauges_tells_nothing() -> None:
    watch = LinkWatch()
    assert not any(watch.is_touched(None) for _ in range(50))
