"""The files of a recording: their names, format identifiers, and the error for a failing disk."""

from __future__ import annotations

from pathlib import Path

from drivers.core.atomic_files import disk_full, write_failure
from drivers.core.errors import SessionError

PROFILE = "tactile-lab"
FORMAT = "tactile-traffic/2"
END_RECORD = "tactile-lab/end"


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
