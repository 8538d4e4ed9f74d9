"""Attachments that a person adds to a session: notes, pictures and files, in its folder ``attachments/``."""

from __future__ import annotations

import os
import shutil
import stat
from pathlib import Path

from drivers.camera.frames import PNG_HEAD
from drivers.core.errors import SessionError

FOLDER, NOTES = "attachments", "notes.txt"
LARGEST_BYTES = 50_000_000
"""Largest file that can be attached."""


class Attachments:
    """A session's attachments.

    Args:
        session_folder: the session's folder; the subfolder is created with the first attachment.
    """

    def __init__(self, session_folder: Path) -> None:
        self.folder = session_folder / FOLDER

    def note(self, text: str) -> None:
        """Append a line to the notes and flush it to disk. Raises SessionError."""
        line = " ".join(text.split())
        try:
            self.folder.mkdir(exist_ok=True)
            with (self.folder / NOTES).open("a", encoding="utf-8") as notes:
                notes.write(f"{line}\n")
                notes.flush()
                os.fsync(notes.fileno())
        except OSError as error:
            raise SessionError(f"the note cannot be stored ({error.strerror})", where=str(self.folder)) from error

    def picture(self, stem: str, encoded: bytes) -> str:
        """Store a picture as the camera encoded it, JPEG or PNG. Returns its file's name. Raises SessionError."""
        name = stem + (".png" if encoded.startswith(PNG_HEAD) else ".jpg")
        self._write(name, encoded)
        return name

    def file(self, source: str) -> str:
        """Copy a file, under its own name or with a number added. Returns the name. Raises SessionError."""
        path = Path(source).expanduser()
        try:
            status = path.stat()
            if not stat.S_ISREG(status.st_mode):
                raise SessionError("not a file", where=source, hint="Give one file")
            if status.st_size > LARGEST_BYTES:
                text = f"{status.st_size / 1e6:.0f} MB, more than {LARGEST_BYTES / 1e6:.0f}"
                raise SessionError(text, where=source, hint="Store it elsewhere and leave a note")
            self.folder.mkdir(exist_ok=True)
            name = self._free_name(path.name)
            shutil.copyfile(path, self.folder / name)
        except OSError as error:
            raise SessionError(f"cannot be attached ({error.strerror})", where=source) from error
        return name

    def _free_name(self, name: str) -> str:
        stem, suffix, number = Path(name).stem, Path(name).suffix, 1
        while (self.folder / name).exists():
            number += 1
            name = f"{stem}-{number}{suffix}"
        return name

    def _write(self, name: str, data: bytes) -> None:
        try:
            self.folder.mkdir(exist_ok=True)
            (self.folder / name).write_bytes(data)
        except OSError as error:
            raise SessionError(f"cannot be stored ({error.strerror})", where=str(self.folder / name)) from error
