"""The files of a recording: their names, format identifiers, and the error for a failing disk."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from pathlib import Path

from drivers.core.atomic_files import disk_full, write_failure
from drivers.core.errors import SessionError

PROFILE = "tactile-lab"
FORMAT = "tactile-traffic/2"
END_RECORD = "tactile-lab/end"
SEAL = "crc32"


def sealed(info: Mapping[str, str]) -> dict[str, str]:
    """What a writer notes, with a checksum of it: it is in the file twice, and one copy may be damaged."""
    return {**info, SEAL: _checksum(info)}


def is_sealed(info: Mapping[str, str]) -> bool:
    """Whether notes are as they were written."""
    return info.get(SEAL) == _checksum({key: value for key, value in info.items() if key != SEAL})


def _checksum(info: Mapping[str, str]) -> str:
    return f"{zlib.crc32(json.dumps(info, sort_keys=True).encode()):08x}"


def segment_path(path: Path, number: int) -> Path:
    """The file of a segment: the path itself, then ``traffic-2.mcap`` and so on."""
    return path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")


def disk_failure(path: Path, error: OSError | SessionError, kept: int) -> SessionError:
    """The error that ends a recording, from the system's error; ``kept`` bytes of the file remain."""
    if isinstance(error, SessionError):
        return error
    advice = "free some space and start a new session" if disk_full(error) else "check the disk"
    hint = f"The {kept} bytes recorded so far are kept; {advice}"
    return SessionError(write_failure(error), where=str(path), hint=hint)
