"""Shapes are judged more coarsely in tests than results are."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tactile_lab.slam.shape.metrics import alignment, metrics, overlap


@contextmanager
def judged_coarsely() -> Iterator[None]:
    """Fewer samples of the surfaces, and the best fit sought from the estimated pose: no run here is upside down."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(alignment, "_PLANAR_STARTS", 1)
        patch.setattr(alignment, "_MESH_SAMPLES", 1500)
        patch.setattr(metrics, "MESH_SAMPLES", 5000)
        patch.setattr(overlap, "_OVERLAP_SAMPLES", 5000)
        yield
