"""Files from elsewhere are read up to a limit: none can fill the memory or keep the program for ever."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

from drivers.core.errors import ConfigurationError

MB = 1_000_000
LARGEST_YAML_bytes = 1 * MB
"""Rig files, calibrations, settings and session descriptions are a hundredth of it; more takes minutes to parse."""
LARGEST_TABLE_bytes = 16 * MB
"""A CSV table: 100 000 timed contacts, or an hour of presses."""
LARGEST_JSON_bytes = 16 * MB
"""A contact log of 8000 grasps; a document of nothing but brackets takes twenty times as much in memory."""
LARGEST_MESH_bytes = 64 * MB
"""A binary mesh of more than a million triangles."""
LARGEST_PICTURE_bytes = 64 * MB
"""20 million pixels, not packed."""
_SHOWN = 200


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """The content of a plain file.

    Args:
        path: of the file.
        most_bytes: a larger one is refused.

    Raises:
        OSError: it is missing, or cannot be read.
        ConfigurationError: it is larger, or a pipe or device, which might never end.
    """
    with _opened(path) as file:
        check_plain(path, os.fstat(file.fileno()), most_bytes)
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:  # it has grown
        raise _too_large(path, len(content), most_bytes)
    return content


def read_input(path: Path, most_bytes: int) -> bytes:
    """As :func:`read_bounded`, for a file that a person names.

    Raises:
        ConfigurationError: it is missing, cannot be read, is larger, or a pipe or device.
    """
    try:
        return read_bounded(path, most_bytes)
    except OSError as error:
        what = f"cannot be read ({error.strerror})"
        raise ConfigurationError(what, where=str(path), hint="Check the path") from error


def open_plain(path: Path) -> BinaryIO:
    """A plain file of any size, for who reads it piece by piece. Raises OSError, for a pipe or device too."""
    file = _opened(path)
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise OSError(errno.EINVAL, "a pipe or device", str(path))
    return file


def _opened(path: Path) -> BinaryIO:
    """A pipe is not waited for."""
    return os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb")


def refuse_unreachable(path: Path) -> None:
    """Call it before any other query of a path: raises if its existence cannot be determined.

    Raises:
        ConfigurationError: a folder on the way may not be entered, the name is too long, or a link leads to itself.
    """
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        shown = str(path) if len(str(path)) <= _SHOWN else f"{str(path)[:_SHOWN]}..."
        hint = "Check the path and its permissions"
        raise ConfigurationError(f"cannot be used ({error.strerror})", where=shown, hint=hint) from error


def check_size(path: Path, most_bytes: int) -> None:
    """As :func:`read_bounded` for a file that a library reads. Raises OSError, ConfigurationError."""
    check_plain(path, path.stat(), most_bytes)


def check_plain(path: Path, found: os.stat_result, most_bytes: int) -> None:
    """Whether it is a plain file that is not too large. Raises IsADirectoryError, ConfigurationError."""
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(21, "Is a directory", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise ConfigurationError("is a pipe or device", where=str(path), hint="Name a plain file")
    if found.st_size > most_bytes:
        raise _too_large(path, found.st_size, most_bytes)


def _too_large(path: Path, size: int, most_bytes: int) -> ConfigurationError:
    what = f"is too large: {size:,} bytes, and at most {most_bytes:,} are read of such a file"
    return ConfigurationError(what, where=str(path), hint="Check that it is the right file")
