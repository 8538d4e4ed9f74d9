"""Dividing a sequence into runs at the least cost: by trying every division."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest

from tactile_lab.slam.shape.planar.runs import cheapest_division


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("price", [0.0, 0.3, 3.0])
def test_no_division_is_cheaper(seed: int, price: float) -> None:
    n = 6
    costs = np.random.default_rng(seed).uniform(0.0, 1.0, (n, n))
    total, first = cheapest_division(costs, price)
    divisions = [(0, *inner, n) for k in range(n) for inner in combinations(range(1, n), k)]
    every = [sum(costs[a, b - 1] + price for a, b in pairwise(way)) for way in divisions]
    assert total == pytest.approx(min(every))
    assert len(first) == n + 1
    ends = [n]
    while ends[-1]:
        ends.append(int(first[ends[-1]]))
    assert tuple(reversed(ends)) == divisions[int(np.argmin(every))]
