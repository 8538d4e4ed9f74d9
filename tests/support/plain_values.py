"""Values as numbers, texts, lists and mappings, for baselines: of a whole result every public field and property."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Callable, Mapping
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import gtsam
import numpy as np
from pydantic import BaseModel

_PLAIN = frozenset({float, int, str, bool, type(None)})


def plain(value: Any) -> Any:
    """A value as numbers, texts, lists and mappings.

    Poses become their matrices, enumerations their names. Of an object come its public fields, what its properties
    say, and its words if it has any for people. Unknowns of a solver, functions and paths are left out: None.
    """
    if type(value) in _PLAIN:
        return value
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, set | frozenset):
        return sorted(map(plain, value))
    if isinstance(value, BaseModel) or (dataclasses.is_dataclass(value) and not isinstance(value, type)):
        return _contents(value)
    return _single(value)


def _single(value: Any) -> Any:
    """What is not made of other values, as a number, a text or a list of numbers."""
    for kind, told in _FORMS.items():
        if isinstance(value, kind):
            return told(value)
    return None if callable(value) or isinstance(value, gtsam.Values | Path) else value


_FORMS: dict[Any, Callable[[Any], Any]] = {
    gtsam.Pose3: lambda pose: pose.matrix()[:3].tolist(),
    gtsam.Rot3: lambda rotation: rotation.matrix().tolist(),
    gtsam.Pose2: lambda pose: [pose.x(), pose.y(), pose.theta()],
    np.ndarray: lambda array: plain(array.tolist()),
    np.generic: lambda number: plain(number.item()),
    enum.Enum: lambda member: member.name,
    bytes: lambda sent: sent.hex(" "),
    datetime: lambda time: time.isoformat(),
}


def _contents(value: Any) -> dict[str, Any]:
    fields = type(value).model_fields if isinstance(value, BaseModel) else vars(value)
    said = [name for name, told in vars(type(value)).items() if isinstance(told, property | cached_property)]
    names = [name for name in dict.fromkeys([*fields, *said]) if not name.startswith("_")]
    found = {name: plain(getattr(value, name)) for name in names if not _is_default(value, name)}
    return found | ({"words": str(value)} if "__str__" in vars(type(value)) else {})


def _is_default(value: Any, name: str) -> bool:
    """Whether a field holds the very object that it holds unless told otherwise, such as the right hand's form."""
    if isinstance(value, BaseModel):
        return False
    defaults = {field.name: field.default for field in dataclasses.fields(value)}
    return dataclasses.is_dataclass(defaults.get(name)) and getattr(value, name) is defaults[name]
