"""Atomic files: even after a power cut either the old or the new file is complete."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

from drivers.core.errors import ConfigurationError, WriteError

_FULL = (errno.ENOSPC, errno.EDQUOT)


def write_whole(
    path: Path, content: str | bytes, hint: str = "Choose another folder, or check its permissions"
) -> None:
    """Write a file atomically, and create its folder if needed.

    Args:
        content: text is written as UTF-8 with its line ends unchanged.
        hint: what to do if the path cannot be written; a full disk has its own hint.

    Raises:
        WriteError: the disk is full, or the path cannot be written; an older file is unchanged.
    """
    partial = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        advice = "Free some space on it, then try again" if disk_full(error) else hint
        in_the_way = isinstance(error, (FileExistsError, NotADirectoryError))
        what = f"cannot be written ({path.parent} is not a folder)" if in_the_way else write_failure(error)
        raise WriteError(what, where=str(path), hint=advice) from error
    finally:  # after an interruption too; nothing is left of it when all went well
        with suppress(OSError):  # where the folder is none, either
            partial.unlink(missing_ok=True)


def refuse_existing(targets: Sequence[Path]) -> None:
    """Before anything is read: nothing that exists is written over. Raises ConfigurationError."""
    for target in targets:
        if target.exists() or target.is_symlink():
            raise ConfigurationError("exists already", where=str(target), hint="Choose another name, or remove it")


def refuse_unwritable(target: Path) -> None:
    """Before hours of work: a file that could not be written at their end. Raises ConfigurationError."""
    if target.is_dir():
        raise ConfigurationError("is a folder", where=str(target), hint="Name a file")
    _refuse_closed(target.absolute().parent, target, "Choose another file")


def refuse_unwritable_folder(target: Path) -> None:
    """The same of a folder, there or not, in which files are to be written. Raises ConfigurationError."""
    _refuse_closed(target.absolute(), target, "Choose another folder")


def _refuse_closed(folder: Path, target: Path, hint: str) -> None:
    """Permissions alone do not suffice: a nameless file is made in the nearest folder there is."""
    try:
        nearest = next(place for place in (folder, *folder.parents) if os.path.lexists(place))
        if not nearest.is_dir():
            raise ConfigurationError(f"cannot be written ({nearest} is not a folder)", where=str(target), hint=hint)
        TemporaryFile(dir=nearest).close()
    except OSError as error:
        raise ConfigurationError(
            write_failure(error), where=str(target), hint=f"{hint}, or check its permissions"
        ) from error


@contextmanager
def writing_into(folder: Path) -> Iterator[None]:
    """Within the block files of a folder are written or copied. Raises WriteError, in words, where one cannot be."""
    try:
        yield
    except OSError as error:
        advice = "Free some space on it, then try again" if disk_full(error) else "Check the folder and the disk"
        raise WriteError(write_failure(error), where=str(error.filename or folder), hint=advice) from error


def disk_full(error: OSError) -> bool:
    """Whether the disk, or one's share of it, is full."""
    return error.errno in _FULL


def write_failure(error: OSError) -> str:
    """Why something could not be written, as text."""
    return "the disk is full" if disk_full(error) else f"cannot be written ({error.strerror or error})"
