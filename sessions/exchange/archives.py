"""A session as one ZIP file, and back.

An archive's names, links and sizes are not trusted. Only regular files are extracted, only into a new folder, and never
beyond the limits, whatever sizes the archive declares. Nothing in it is executed or unpickled. Packed by any program a
session is found: at the top or in folders, with the files that desktops add, with folders separated as Windows does.
"""

from __future__ import annotations

import shutil
import stat
import zipfile
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from drivers.core.atomic_files import writing_into
from drivers.core.errors import ConfigurationError, SessionDataError, WriteError, given_by_a_person
from drivers.core.reading.bounded_files import open_plain
from sessions.recording.manifest import MANIFEST, read_manifest, write_manifest
from sessions.recording.session import TRAFFIC, Session
from sessions.recording.session_ids import LONGEST_ID, check_id, slug

_BLOCK_BYTES = 1 << 20
_ADVICE = "Nothing was imported"
_OF_DESKTOPS = {"__MACOSX", ".DS_Store", "Thumbs.db", "desktop.ini"}
_DEEPEST = 6

_Entries = dict[PurePosixPath, zipfile.ZipInfo]
"""Files by their places."""


@dataclass(frozen=True)
class ArchiveLimits:
    """Limits of an archive.

    Attributes:
        files: number of files.
        total_bytes: total unpacked size.
        ratio: largest ratio of unpacked to packed size, of a file above a megabyte and of all together.
    """

    files: int = 10_000
    total_bytes: int = 50 << 30
    ratio: float = 500.0


def export_archive(session: Session, path: Path) -> int:
    """Write a session's files into a new ZIP file and return their number. Links are skipped.

    Raises:
        ConfigurationError: the file exists.
        WriteError: it cannot be written.
    """
    files = [item for item in sorted(session.folder.rglob("*")) if item.is_file() and not item.is_symlink()]
    try:
        with zipfile.ZipFile(path, "x", zipfile.ZIP_DEFLATED) as archive:
            for item in files:
                name = (PurePosixPath(session.folder.name) / item.relative_to(session.folder).as_posix()).as_posix()
                archive.write(item, name)
    except FileExistsError as error:
        raise ConfigurationError("exists already", where=str(path), hint="Choose another name") from error
    except OSError as error:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        raise WriteError(f"cannot be written ({error.strerror})", where=str(path), hint="Check the disk") from error
    return len(files)


def import_archive(path: Path, root: Path, name: str | None = None, limits: ArchiveLimits | None = None) -> Session:
    """Unpack a session from a ZIP file into a new folder under ``root``.

    Args:
        name: name of the new session; by default that of its folder in the archive, or of the archive if it has none.

    Raises:
        ConfigurationError: not a ZIP file, unsafe names, links or sizes, no session in it, or a session of that name
            exists already; then nothing is left behind.
        WriteError: the new folder cannot be written; nothing is left behind either.
    """
    limits = limits or ArchiveLimits()
    try:
        with open_plain(path) as file, zipfile.ZipFile(file) as archive:
            entries = _checked_entries(archive, path, limits)
            top = _folder_of_session(entries, path)
            folder = root / check_id(name or slug(top.name or path.stem)[:LONGEST_ID], str(path))
            return _unpack(archive, {place.relative_to(top): entries[place] for place in entries}, folder, path, limits)
    except zipfile.BadZipFile as error:
        raise ConfigurationError(f"not a ZIP archive ({error})", where=str(path), hint=_ADVICE) from error
    except OSError as error:
        raise ConfigurationError(
            f"cannot be read ({error.strerror or error})", where=str(path), hint=_ADVICE
        ) from error


def _checked_entries(archive: zipfile.ZipFile, path: Path, limits: ArchiveLimits) -> _Entries:
    """The files by their places in the archive, without those that desktops add."""
    entries = [entry for entry in archive.infolist() if not entry.is_dir()]
    if len(entries) > limits.files:
        raise _refusal(path, f"contains {len(entries)} files, more than {limits.files}")
    for entry in entries:
        _check_entry(entry, path, limits)
    if (total := sum(entry.file_size for entry in entries)) > limits.total_bytes:
        raise _refusal(path, f"contains {total} bytes, more than {limits.total_bytes}")
    packed = sum(entry.compress_size for entry in entries)
    if total > _BLOCK_BYTES and total > limits.ratio * max(1, packed):
        raise _refusal(path, f"would unpack {packed} bytes to {total}, out of all proportion")
    places = {_place(entry): entry for entry in entries}
    if len(places) < len(entries):
        raise _refusal(path, "contains two files of the same name")
    return {place: entry for place, entry in places.items() if _OF_DESKTOPS.isdisjoint(place.parts)}


def _place(entry: zipfile.ZipInfo) -> PurePosixPath:
    return PurePosixPath(entry.filename.replace("\\", "/"))


def _check_entry(entry: zipfile.ZipInfo, path: Path, limits: ArchiveLimits) -> None:
    name, place = entry.filename, _place(entry)
    parts = place.parts
    if place.is_absolute() or ":" in name or "\0" in name or ".." in parts or not 1 <= len(parts) <= _DEEPEST:
        raise _refusal(path, f"contains the unsafe name {name!r}")
    mode = entry.external_attr >> 16
    if mode and not stat.S_ISREG(mode) and stat.S_IFMT(mode):
        raise _refusal(path, f"{name!r} is a link or a device, not a regular file")
    if entry.flag_bits & 1:
        raise _refusal(path, f"{name!r} is encrypted")
    if entry.file_size > _BLOCK_BYTES and entry.file_size > limits.ratio * max(1, entry.compress_size):
        raise _refusal(path, f"{name!r} would unpack to {entry.file_size} bytes, which is implausible")


def _folder_of_session(entries: Iterable[PurePosixPath], path: Path) -> PurePosixPath:
    """The folder in the archive that is the session; the top of an archive is a folder, too."""
    found = sorted(
        {place.parent for place in entries if place.name == MANIFEST}, key=lambda folder: (len(folder.parts), folder)
    )
    found = [folder for folder in found if folder == found[0] or found[0] not in folder.parents]
    if not found:
        raise _refusal(path, f"contains no session (a folder with {MANIFEST} and {TRAFFIC})")
    if len(found) > 1:
        raise _refusal(path, f"contains {len(found)} sessions ({', '.join(map(str, found[:3]))}), not one")
    beside = [place for place in entries if found[0] not in place.parents]
    if beside:
        raise _refusal(path, f"contains {len(beside)} files beside the session {found[0]}, such as {beside[0]}")
    return found[0]


def _unpack(archive: zipfile.ZipFile, entries: _Entries, folder: Path, path: Path, limits: ArchiveLimits) -> Session:
    try:
        folder.mkdir(parents=True)
    except FileExistsError as error:
        hint = f"{_ADVICE}; choose another name with --name"
        raise ConfigurationError("a session of that name exists already", where=str(folder), hint=hint) from error
    try:
        left = limits.total_bytes
        for place, entry in entries.items():
            target = folder / place
            with writing_into(folder):
                target.parent.mkdir(parents=True, exist_ok=True)
            with archive.open(entry) as source, writing_into(folder), target.open("xb") as out:
                left -= _copy(source, out, left, path)  # type: ignore[arg-type]
        with given_by_a_person():
            return _as_session(folder, path)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)  # only what came out of the archive
        raise


def _copy(source: BinaryIO, out: BinaryIO, most: int, path: Path) -> int:
    """Copy up to a limit, whatever size the archive declares. Returns the number of bytes."""
    copied = 0
    while block := source.read(_BLOCK_BYTES):
        copied += len(block)
        if copied > most:
            raise _refusal(path, "unpacks to more bytes than it declares")
        out.write(block)
    return copied


def _as_session(folder: Path, path: Path) -> Session:
    """Check that the unpacked folder is a session with a readable recording and unchanged calibration."""
    if not (folder / MANIFEST).is_file() or not (folder / TRAFFIC).is_file():
        raise _refusal(path, f"contains no session (a folder with {MANIFEST} and {TRAFFIC})")
    manifest = read_manifest(folder)
    session = Session(folder, manifest)
    _check_calibration(session, path)
    session.traffic()
    changes = {"name": folder.name, "derived": manifest.derivation("import", path.name)}
    write_manifest(folder, manifest.model_copy(update=changes))
    return Session.open(folder)


def _check_calibration(session: Session, path: Path) -> None:
    try:
        for role in session.manifest.calibration:
            session.calibration_file(role)
    except SessionDataError as error:
        raise _refusal(path, f"{Path(error.where).name} in it {error.what}") from error


def _refusal(path: Path, what: str) -> ConfigurationError:
    return ConfigurationError(what, where=str(path), hint=_ADVICE)
