"""Imports sessions and contacts from other sources."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from drivers.core.atomic_files import write_whole
from drivers.core.errors import ConfigurationError, TactileLabError, given_by_a_person
from sessions.exchange.archives import import_archive
from sessions.exchange.contact_log import ContactLog, read_contact_log, write_contact_log
from sessions.exchange.timed_contacts import ImportSettings, read_timed_contacts
from sessions.recording.session import Session
from tactile_lab.evaluation.files.mesh_io import read_mesh

_OTHER_ARCHIVES = {".tar", ".tgz", ".gz", ".bz2", ".xz", ".zst", ".7z", ".rar"}


def import_session(archive: Path, root: Path, name: str | None = None) -> Session:
    """Import a session from a ZIP archive. Raises as :func:`sessions.exchange.archives.import_archive`."""
    return import_archive(archive, root, name)


def import_contacts(file: Path, log: Path, settings: ImportSettings, mesh: Path | None = None) -> ContactLog:
    """Timed contacts as a contact log, with the true mesh, where there is one, copied next to it.

    Raises:
        ConfigurationError: a file cannot be read, the contacts do not fit the form or do not make sense, the mesh
            cannot be used, or the log exists already; nothing is left then.
        WriteError: a file cannot be written.
    """
    if file.suffix.lower() in _OTHER_ARCHIVES:
        hint = "Unpack it: the folder of a session is used as it is"
        raise ConfigurationError("is an archive, but no ZIP", where=str(file), hint=hint)
    if file.suffix.lower() == ".mcap":
        hint = (
            f"A session is used as it is: give its folder, such as {file.resolve().parent.name}, to replay or recover"
        )
        raise ConfigurationError("is a recording, not a table of contacts", where=str(file), hint=hint)
    if log.exists():
        raise ConfigurationError("exists already", where=str(log), hint="Choose another name with --out")
    if mesh is not None:
        with given_by_a_person():
            read_mesh(mesh)
        settings = replace(settings, object_name=mesh.stem, mesh=log.with_suffix(mesh.suffix).name)
    contacts, made = read_timed_contacts(file, settings), [log]
    try:
        if mesh is not None:
            made += _copy(mesh, log.with_suffix(mesh.suffix))
        write_contact_log(log, contacts)
        read_contact_log(log)  # refuses normals that point inward
    except TactileLabError as error:
        for path in made:
            with suppress(OSError):
                path.unlink(missing_ok=True)
        if isinstance(error, ConfigurationError):
            raise ConfigurationError(error.what, where=str(file), hint=error.hint) from error
        raise
    return contacts


def _copy(mesh: Path, copy: Path) -> list[Path]:
    """The file that was made: none where the mesh is in its place already. Raises ConfigurationError, WriteError."""
    if copy.exists() and copy.resolve() != mesh.resolve():
        raise ConfigurationError("exists already", where=str(copy), hint="Choose another name with --out")
    if copy.exists():
        return []
    try:
        write_whole(copy, mesh.read_bytes())
    except OSError as error:
        raise ConfigurationError(
            f"cannot be read ({error.strerror})", where=str(mesh), hint="Check the path"
        ) from error
    return [copy]
