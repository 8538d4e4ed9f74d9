"""Following an object whose shape is known."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runs.limits.known_shape import follow_known_shape


@cache
def followed(shape: str, seed: int, *, noise: int = 100, particles: int = 8_000) -> float:
    setting = (("noise", noise), ("shape", shape), ("grasps", 6), ("particles", particles))
    return float(follow_known_shape(Cell(setting, seed))["registration_mm"])


def test_a_solid_is_followed_through_slips_of_a_centimetre_to_the_noise_of_its_contacts() -> None:
    found = [followed("l-block", seed) for seed in (0, 1)]
    assert np.mean(found) < 4.0
    assert min(found) > 0.2  # the true poses are not told


def test_the_same_seed_gives_the_same() -> None:
    first = followed("l-block", 0)
    followed.cache_clear()
    assert followed("l-block", 0) == first


@pytest.mark.long  # quicker: slips of a centimetre
def test_less_motion_is_followed_better() -> None:
    assert followed("l-block", 0, noise=5) < 0.6 * followed("l-block", 0)


@pytest.mark.parametrize("particles", [2_000, pytest.param(40_000, marks=pytest.mark.long)])
def test_turns_that_no_contact_tells_do_not_count(particles: int) -> None:
    assert followed("sphere", 0, particles=particles) < 3.0
