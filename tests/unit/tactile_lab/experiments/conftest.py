"""Runs of experiments are judged more coarsely here than results are."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.coarse_judging import judged_coarsely


@pytest.fixture(scope="module", autouse=True)
def coarse_judging() -> Iterator[None]:
    with judged_coarsely():
        yield
