"""The envelope of a stored calibration: its content belongs to the device, the seal is the same for all.

A stored calibration is a YAML document with the key ``format`` and a hash of everything else in it, so that a value
changed by hand is detected. Comments and layout may be changed. A plain file, a device's own table for instance, has no
seal and is read as it is; whether it may be used is decided when a session starts.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from drivers.core.configuration import Model, load, validate
from drivers.core.errors import ConfigurationError

FORMAT = "tactile-calibration/1"
SEAL = "sha256"


def seal_of(document: Mapping[str, Any]) -> str:
    """SHA-256 of everything in a document but its seal, in hexadecimal digits; the order of keys does not count."""
    content = {key: value for key, value in document.items() if key != SEAL}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def is_stored(content: Any) -> bool:
    """Whether a YAML document is a stored calibration, of any version."""
    return isinstance(content, dict) and str(content.get("format", "")).startswith("tactile-calibration/")


def check_seal(content: Mapping[str, Any], where: str) -> None:
    """Refuse a stored calibration of another version, or a changed one.

    Raises:
        ConfigurationError: says which.
    """
    if content.get("format") != FORMAT:
        hint = "Use the version of tactile-lab that wrote it, or calibrate again"
        raise ConfigurationError(f"has the format {content.get('format')}, not {FORMAT}", where=where, hint=hint)
    if content.get(SEAL) != seal_of(content):
        hint = "Restore the file, or calibrate again (for a known pose: calibrate forearm --method manual)"
        raise ConfigurationError("was changed by hand: its content does not match its hash", where=where, hint=hint)


def load_parameters(path: Path, model: type[Model]) -> Model:
    """The parameters of a device from a calibration file, stored or plain.

    Raises:
        ConfigurationError: the file cannot be read, was changed by hand, or does not fit the model.
    """
    content = load(path)
    if is_stored(content):
        check_seal(content, str(path))
        return validate(content.get("parameters"), model, where=f"{path}: parameters")
    return validate(content, model, where=str(path))


def plain(model: BaseModel) -> dict[str, Any]:
    """A model as the plain data that YAML and the seal know: no tuples, no numbers of other libraries."""
    return json.loads(model.model_dump_json())  # type: ignore[no-any-return]
