"""Results as JSON: plain data with fixed key order, null for what is unknown, never NaN."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from gtsam import Pose2, Pose3
from pydantic import BaseModel

from drivers.core.errors import ConfigurationError, SessionDataError
from drivers.core.reading.bounded_files import LARGEST_JSON_bytes, read_bounded
from drivers.core.reading.json_text import parse_json


def plain(value: Any) -> Any:
    """``value`` as JSON data.

    Frozen dataclasses and pydantic models become objects, arrays and tuples lists, poses their
    4 x 4 (3 x 3) matrices row by row; NaN and infinity become null.

    Raises:
        TypeError: a type that cannot be converted.
    """
    if value is None or isinstance(value, bool | int | str):
        return value.value if isinstance(value, Enum) else value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in (sorted(value) if isinstance(value, set | frozenset) else value)]
    return _plain_object(value)


def _plain_object(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Pose2 | Pose3):
        return plain(value.matrix())
    if isinstance(value, BaseModel):
        return plain(value.model_dump(mode="json"))
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Enum):
        return plain(value.value)
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    raise TypeError(f"cannot convert {type(value).__name__} to plain data")


def json_text(value: Any) -> str:
    """``value`` as indented JSON with a final line feed; equal values give equal text."""
    return json.dumps(plain(value), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def read_json_object(path: Path, *, hint: str) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        SessionError: the file is missing, unreadable or not a JSON object; ``hint`` says what to do.
    """
    try:
        content = parse_json(read_bounded(path, LARGEST_JSON_bytes))
    except FileNotFoundError as error:
        raise SessionDataError("file not found", where=str(path), hint=hint) from error
    except OSError as error:
        raise SessionDataError(f"cannot be read ({error.strerror})", where=str(path), hint=hint) from error
    except ConfigurationError as error:
        raise SessionDataError(error.what, where=str(path), hint=hint) from error
    except ValueError as error:
        raise SessionDataError(f"is not readable JSON ({error})", where=str(path), hint=hint) from error
    if not isinstance(content, dict):
        raise SessionDataError("does not contain a JSON object", where=str(path), hint=hint)
    return content
