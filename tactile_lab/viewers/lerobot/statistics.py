"""Statistics by which policies normalise inputs, as LeRobot keeps them for an episode and for the whole dataset."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
_LEVELS = 256

Statistics = dict[str, Any]


def statistics_of(values: Array) -> Statistics:
    """Statistics over the frames of one feature.

    Args:
        values: shape (frames, ...).

    Returns:
        ``min``, ``max``, ``mean``, ``std`` and quantiles as nested lists of a frame's shape; ``count`` of frames.
    """
    found = {"min": values.min(axis=0), "max": values.max(axis=0), "mean": values.mean(axis=0)}
    found["std"] = values.std(axis=0)
    found |= dict(zip(QUANTILES, np.quantile(values, list(QUANTILES.values()), axis=0), strict=True))
    return {name: np.asarray(value, dtype=float).tolist() for name, value in found.items()} | {"count": [len(values)]}


class PictureStatistics:
    """Statistics of pictures: each colour by itself, 0 to 1, over all their pixels."""

    def __init__(self) -> None:
        self._seen = np.zeros((3, _LEVELS), dtype=np.int64)
        self._count = 0

    def add(self, levels: NDArray[np.int64], times: int = 1) -> None:
        """Count a picture's levels, shape (3, 256), as many times as it was shown."""
        self._seen += times * levels
        self._count += times

    def result(self) -> Statistics:
        """As :func:`statistics_of`, each value of shape (3, 1, 1): red, green, blue."""
        each = [_of_levels(seen) for seen in self._seen]
        found: Statistics = {name: [[[one[name]]] for one in each] for name in each[0]}
        return found | {"count": [self._count]}


def levels_of(picture: NDArray[np.uint8]) -> NDArray[np.int64]:
    """How often each level occurs in each colour of a picture of shape (height, width, 3): shape (3, 256)."""
    return np.array([np.bincount(picture[..., colour].ravel(), minlength=_LEVELS) for colour in range(3)])


def _of_levels(seen: NDArray[np.int64]) -> dict[str, float]:
    levels = np.arange(_LEVELS) / (_LEVELS - 1)
    present, shares = levels[seen > 0], seen / seen.sum()
    mean = float(shares @ levels)
    found = {"min": float(present[0]), "max": float(present[-1]), "mean": mean}
    found["std"] = float(np.sqrt(shares @ (levels - mean) ** 2))
    places = np.searchsorted(np.cumsum(shares), list(QUANTILES.values()))
    return found | dict(zip(QUANTILES, levels[np.minimum(places, _LEVELS - 1)].tolist(), strict=True))
