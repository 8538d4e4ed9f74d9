"""Files elsewhere, by addresses such as ``s3://bucket/folder``: whatever ``fsspec`` reaches.

What goes wrong is one sentence for people, whichever library under it says so.
"""

from __future__ import annotations

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Any

from drivers.core.atomic_files import refuse_unwritable, write_whole
from drivers.core.errors import ConfigurationError, TactileLabError, WriteError
from drivers.core.installed.extras import require_package

_PROTOCOL = re.compile(r"^([a-z][a-z0-9+.-]+):/+(?=.)", re.ASCII)
_LOCAL = ("file", "local")
"""Whose addresses have a path of this computer behind their two slashes."""
_PACKAGES = {"s3": "s3fs", "s3a": "s3fs"}
"""Packages that addresses need besides ``fsspec``, and that an extra installs."""

_WITHOUT_FOLDERS = frozenset({"s3", "s3a", "gs", "gcs", "az", "abfs", "memory"})
"""Stores whose folders are but names; to make one could make a bucket."""

_PROBE = ".tactile-lab-may-write"
"""An empty file that shows whether one may write somewhere; one name for all, should it not be removable."""


def address_of(path: Path | str) -> str | None:
    """The address that was typed; None for a path of this computer, which may have lost a slash as a path."""
    text = str(path)
    found = _PROTOCOL.match(text)
    if found is None:
        return None
    root = "/" if found[1] in _LOCAL else ""
    return f"{found[1]}://{root}{text[found.end() :]}"


def write_anywhere(path: Path, content: str | bytes, hint: str = "Choose another file") -> None:
    """Write a file as a whole, at a path or at an address; an earlier one is replaced.

    Raises:
        ConfigurationError: there is no such bucket, or a package is missing.
        WriteError: one may not write there, or the disk is full, or the connection fails.
    """
    if (address := address_of(path)) is None:
        write_whole(path, content, hint)
        return
    folder, _, name = address.rpartition("/")
    Place(folder).write(name, content.encode() if isinstance(content, str) else content)


def refuse_unwritable_anywhere(path: Path) -> None:
    """Raise as :func:`write_anywhere` would, before the work whose result is to be written there."""
    if (address := address_of(path)) is None:
        refuse_unwritable(path)
        return
    folder, _, name = address.rpartition("/")
    Place(folder).try_writing(name)


class Place:
    """A folder elsewhere. Every method raises ConfigurationError where it is not there, WriteError where it fails.

    Args:
        address: such as ``s3://bucket/laboratory``.
    """

    def __init__(self, address: str) -> None:
        require_package("fsspec")
        protocol = address.partition("://")[0]
        if protocol in _PACKAGES:
            require_package(_PACKAGES[protocol])
        from fsspec.core import url_to_fs

        self.address = address.rstrip("/")
        with told(self.address):
            self._files, root = url_to_fs(self.address, use_listings_cache=False)
        self._root, self._has_folders = str(root).rstrip("/"), protocol not in _WITHOUT_FOLDERS

    def names(self) -> dict[str, int]:
        """All files below, by their names relative to it, with their sizes; none if there is nothing."""
        with told(self.address):
            try:
                found = self._files.find(self._root, detail=True)
            except FileNotFoundError:
                self._files.ls(self._root.partition("/")[0])  # a bucket that is not there is another matter
                return {}
        return {path[len(self._root) :].lstrip("/"): int(info["size"]) for path, info in found.items()}

    def holds(self, name: str) -> bool:
        """Whether there is such a file."""
        with told(f"{self.address}/{name}"):
            return bool(self._files.isfile(self._path(name)))

    def read(self, name: str, start: int | None = None) -> bytes:
        """A file's bytes; from ``start`` on, where given: negative from the end."""
        with told(f"{self.address}/{name}"):
            return bytes(self._files.cat_file(self._path(name), start=start))

    def write(self, name: str, content: bytes) -> None:
        """Write a file as a whole."""
        with told(f"{self.address}/{name}"):
            self._make_folder(name)
            self._files.pipe_file(self._path(name), content)

    def try_writing(self, name: str) -> None:
        """Whether one may write a file, by an empty one beside it that is removed again."""
        with told(f"{self.address}/{name}"):
            self._make_folder(_PROBE)
            self._files.pipe_file(self._path(_PROBE), b"")
        self.remove([_PROBE])

    def put(self, name: str, file: Path) -> None:
        """Copy a file of this computer there."""
        with told(f"{self.address}/{name}"):
            self._make_folder(name)
            self._files.put_file(str(file), self._path(name))

    def get(self, name: str, file: Path) -> None:
        """Copy a file from there."""
        with told(f"{self.address}/{name}"):
            file.parent.mkdir(parents=True, exist_ok=True)
            self._files.get_file(self._path(name), str(file))

    def remove(self, names: list[str]) -> None:
        """Remove files, as far as that is possible."""
        for name in names:
            with suppress(Exception):
                self._files.rm_file(self._path(name))

    def _make_folder(self, name: str) -> None:
        """Where folders are more than names, the one of a file must be there before it."""
        if self._has_folders:
            self._files.makedirs(self._path(name).rpartition("/")[0], exist_ok=True)

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}"


def checked_name(name: str) -> str:
    """A relative name of a file. Raises ConfigurationError for one that leads out of its folder."""
    parts = PurePosixPath(name).parts
    if not parts or name.startswith("/") or ".." in parts or "\\" in name or ":" in name:
        raise ConfigurationError("is no name of a file of a session", where=name, hint="Check who writes there")
    return name


@contextmanager
def told(where: str) -> Iterator[None]:
    """Errors of ``fsspec`` and what it uses, as one sentence. Raises ConfigurationError or WriteError."""
    try:
        yield
    except TactileLabError:
        raise
    except Exception as error:
        raise _explained(error, where) from error


def _explained(error: Exception, where: str) -> TactileLabError:
    code = _code(error)
    if isinstance(error, FileNotFoundError) or code in ("NoSuchBucket", "NoSuchKey", "404"):
        return ConfigurationError("there is no such bucket, folder or file", where=where, hint="Check the address")
    if isinstance(error, PermissionError) or code in ("AccessDenied", "403"):
        hint = "Check whose credentials are set, and what they may do there"
        return WriteError("one may not read or write there with these credentials", where=where, hint=hint)
    if type(error).__name__ in ("NoCredentialsError", "PartialCredentialsError"):
        return ConfigurationError("no credentials are set", where=where, hint="Set them, as for other programs of it")
    if isinstance(error, ValueError) and "not known" in str(error).lower():
        return ConfigurationError("no such kind of address is known", where=where, hint="Check what is before ://")
    words = " ".join(str(error).split())[:200] or type(error).__name__
    return WriteError(f"cannot be reached ({words})", where=where, hint="Check the connection, then try again")


def _code(error: Any) -> str:
    """What an object store calls the error; "" for other errors."""
    cause: Any = error
    while cause is not None:
        response = getattr(cause, "response", None)
        if isinstance(response, dict):
            return str(response.get("Error", {}).get("Code", ""))
        cause = cause.__cause__
    return "AccessDenied" if getattr(error, "errno", None) in (errno.EACCES, errno.EROFS, errno.EPERM) else ""
