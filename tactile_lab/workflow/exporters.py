"""Exporters of whole sessions, by name: ours, and those of extensions and plug-ins."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

from drivers.core.errors import SessionError, TactileLabError
from drivers.core.registry import Registry
from sessions.recording.session import Session
from tactile_lab.workflow.exporting import EXPORTS, UNITS

Export: TypeAlias = Callable[[Session, Path], int]
"""Writes a session to a file or folder that is not there yet; gives how many entries it wrote."""

EXPORTERS: Registry[Export] = Registry("exporter", group="exporters")
"""All of them. See ``docs/plugins.md`` for adding one."""

for _name, _export in EXPORTS.items():
    EXPORTERS.register(_name, _export)


def export_as(name: str, session: Session, place: Path) -> str:
    """Write a session by an exporter, completely or not at all. Returns how much it wrote, in words.

    Raises:
        ConfigurationError: there is no such exporter, or it cannot be loaded.
        SessionError: it failed, or wrote nothing; names its file. Nothing is left at the place.
    """
    export, unfinished = EXPORTERS[name], place.with_name(f".{place.name}.part")
    shutil.rmtree(unfinished, ignore_errors=True)
    try:
        unfinished.mkdir(parents=True)
        count = export(session, unfinished / place.name)
        if not (unfinished / place.name).exists():
            raise SessionError(f"the exporter {name!r} wrote nothing", where=EXPORTERS.file(name), hint="Correct it")
        (unfinished / place.name).rename(place)
    except TactileLabError:
        raise
    except Exception as error:
        told = f"the exporter {name!r} raises {EXPORTERS.explain(name, error)}"
        hint = f"Nothing was written to {place}; the session is as it was"
        raise SessionError(told, where=EXPORTERS.file(name), hint=hint) from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return f"{count} {UNITS.get(name, 'entries')}"
