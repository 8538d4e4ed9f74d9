"""Health of a BioTac's electrodes, from counts without contact."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import LARGEST_TABLE_bytes, read_input

LEAST_SAMPLES = 20
LARGEST_DRIFT = 30.0
"""Counts between the means of both halves, median of the electrodes: above it the sensor was touched."""

_RANGE = (50.0, 4045.0)
_NOISY = 10.0


def load_untouched(path: Path) -> Array:
    """Counts from a text table, a line a sample and a column an electrode, separated by commas or blanks.

    Raises:
        ConfigurationError: it cannot be read, or is no such table.
    """
    try:
        text = read_input(path, LARGEST_TABLE_bytes).decode("utf-8").replace(",", " ")
        counts = np.array([[float(word) for word in line.split()] for line in text.splitlines() if line.strip()])
    except ValueError as error:
        hint = "Give one line per sample and one column per electrode, numbers only"
        raise ConfigurationError("is not a table of counts", where=str(path), hint=hint) from error
    if counts.ndim != 2 or not np.isfinite(counts).all():
        raise ConfigurationError(
            "is not a table of counts", where=str(path), hint="Give the same number of values in each line"
        )
    return counts


def faulty_electrodes(untouched: Array) -> dict[int, str]:
    """Faults of a BioTac's electrodes, by index, from untouched counts of shape (samples, electrodes).

    Raises:
        ConfigurationError: too few samples, or the sensor was touched meanwhile.
    """
    if len(untouched) < LEAST_SAMPLES:
        raise ConfigurationError(
            f"{len(untouched)} samples, {LEAST_SAMPLES} needed", where="BioTac", hint="Record two seconds"
        )
    drift = np.abs(untouched[: len(untouched) // 2].mean(axis=0) - untouched[len(untouched) // 2 :].mean(axis=0))
    if np.median(drift) > LARGEST_DRIFT:
        raise ConfigurationError(
            "the sensor was touched, or is still warming up", where="BioTac", hint="Do not touch it, and record again"
        )
    found, spread, mean = {}, untouched.std(axis=0), untouched.mean(axis=0)
    for index in range(untouched.shape[1]):
        if not _RANGE[0] < mean[index] < _RANGE[1]:
            found[index] = f"reads {mean[index]:.0f} counts, at the end of its range: open or short"
        elif spread[index] == 0.0:
            found[index] = "never changes: dead"
        elif spread[index] > _NOISY * max(float(np.median(spread)), 1.0):
            found[index] = f"is noisy: {spread[index]:.0f} counts, the others {np.median(spread):.0f}"
    return found
