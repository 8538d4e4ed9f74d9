"""A few numbers that tell a long array, or records of one form, from any other, for comparison with stored ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

_MOST_COLUMNS = 12


def digest(values: Any) -> list[Any]:
    """Shape, then of each column its mean, its root of the mean square, and a projection that depends on the order.

    Args:
        values: numbers. A table has a column for each of its columns, if those are few; all else is one column.
    """
    numbers = np.asarray(values, dtype=float)
    table = numbers if numbers.ndim == 2 and numbers.shape[1] <= _MOST_COLUMNS else numbers.reshape(-1, 1)
    if not table.size:
        return [list(numbers.shape)]
    wave = np.cos(0.7 * np.arange(len(table)) + 0.3) / len(table)
    sums = table.mean(axis=0), np.sqrt(np.mean(table**2, axis=0)), wave @ table
    return [list(numbers.shape), *(each.tolist() for each in sums)]


def digest_records(records: Iterable[Any]) -> dict[str, Any]:
    """For each place in records of one form: the digest of its numbers; of other values how often each is there."""
    found: dict[str, list[Any]] = {}
    for record in records:
        for where, value in _leaves(record):
            found.setdefault(where, []).append(value)
    return {where: _summary(values) for where, values in sorted(found.items())}


def _leaves(value: Any, where: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(item, f"{where}.{key}" if where else str(key))
    elif isinstance(value, list | tuple | np.ndarray):
        for item in value:
            yield from _leaves(item, where)
    else:
        yield where, value


def _summary(values: list[Any]) -> Any:
    numbers = [value for value in values if _is_number(value)]
    others = dict(Counter(str(value) for value in values if not _is_number(value)))
    return [*(digest(numbers) if numbers else []), *([others] if others else [])]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
