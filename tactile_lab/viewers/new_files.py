"""Files that are there completely or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from drivers.core.errors import ConfigurationError, WriteError


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Where to write a new file; it gets its name at the end of the block, and is removed after an error.

    Raises:
        ConfigurationError: the file exists.
        WriteError: it cannot be written.
    """
    if path.exists():
        raise ConfigurationError("exists already", where=str(path), hint="Choose another name")
    partial = path.with_name(f".{path.name}.part")
    try:
        yield partial
        partial.replace(path)
    except OSError as error:
        what = f"cannot be written ({error.strerror or error})"
        raise WriteError(what, where=str(path), hint="Choose another name") from error
    finally:
        if partial.parent.is_dir():
            partial.unlink(missing_ok=True)
