"""The effective settings of a rig: those of its file, and defaults for the others."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from drivers.core.configuration import StrictModel, flatten_keys
from tactile_lab.rigs.description import RigDescription


@dataclass(frozen=True)
class SettingInForce:
    """One setting.

    Attributes:
        name: its keys in the rig file, joined by dots.
        value: as in a rig file.
        usual: the default; empty if there is none.
    """

    name: str
    value: str
    usual: str


def effective_settings(description: RigDescription) -> tuple[SettingInForce, ...]:
    """All settings of a rig's parts, in the order of the rig file."""
    fields = type(description).model_fields
    usual = {name: field.default.model_dump(mode="json") for name, field in fields.items() if _is_part(field.default)}
    given = flat(description.model_dump(mode="json", include=set(usual)))
    known = flat(usual)
    return tuple(SettingInForce(name, value, known.get(name, "")) for name, value in given.items())


def flat(content: dict[str, Any]) -> dict[str, str]:
    """Nested keys with values as one level of dotted names, with values as a file would say them."""
    return {name: json.dumps(value, ensure_ascii=False) for name, value in flatten_keys(content)}


def _is_part(default: object) -> bool:
    return isinstance(default, StrictModel)
