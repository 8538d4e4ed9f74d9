"""What a baseline stores: digests of many values of one form, and what is said against an action."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from drivers.core.errors import TactileLabError


def digest(records: Iterable[Any]) -> dict[str, Any]:
    """For each place in records of the same form: numbers as count, mean and root mean square; else how often each is.

    The mean is weighted by the place in the sequence, so that an exchange of two records shows.
    """
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
    numbers = [value for value in values if isinstance(value, int | float) and not isinstance(value, bool)]
    counts = Counter(str(value) for value in values if isinstance(value, bool) or not isinstance(value, int | float))
    if not numbers:
        return dict(counts)
    table = np.array(numbers, dtype=float)
    weights = np.arange(1, len(table) + 1) / len(table)
    found = [len(table), float(np.mean(weights * table)), float(np.sqrt(np.mean(table**2)))]
    return [*found, dict(counts)] if counts else found


def as_name(words: str) -> str:
    """Words as a part of a file's name."""
    return re.sub(r"\W+", "_", words)


def said(act: Callable[[], Any], *folders: Path) -> Any:
    """What comes of an action; of an error its words, without the folders of this run."""
    try:
        return act()
    except TactileLabError as error:
        words = str(error)
        for folder in folders:
            words = words.replace(str(folder), "")
        return words
