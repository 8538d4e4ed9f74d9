"""JSON text, bounded: what a few characters stand for can take twenty times as much memory."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

MOST_CONTAINERS = 1_000_000
"""Lists and objects: a contact log of 16 MB has half as many."""


def parse_json(content: bytes, object_pairs_hook: Callable[[list[tuple[str, Any]]], Any] | None = None) -> Any:
    """The one document in a text.

    Args:
        content: UTF-8, as :func:`drivers.core.reading.bounded_files.read_bounded` gives it.
        object_pairs_hook: as of :func:`json.loads`.

    Raises:
        ValueError: it is not JSON, is nested too deeply, or has too many lists and objects; in words for people.
    """
    if content.count(b"[") + content.count(b"{") > MOST_CONTAINERS:
        raise ValueError(f"more than {MOST_CONTAINERS:,} lists and objects")
    try:
        return json.loads(content, object_pairs_hook=object_pairs_hook)
    except UnicodeDecodeError as error:
        raise ValueError("not text in UTF-8") from error
    except json.JSONDecodeError as error:
        raise ValueError(f"a mistake in line {error.lineno}, column {error.colno}") from error
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    except ValueError as error:
        if "int_max_str_digits" not in str(error):
            raise
        raise ValueError(f"a number of more than {sys.get_int_max_str_digits()} digits") from error
