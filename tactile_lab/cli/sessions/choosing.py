"""Sessions as they are named on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sessions.recording.session import Session


def resolve_name(root: Path, name: str) -> str:
    """The session that a name means: ``last`` becomes its folder, and the choice is printed.

    Raises:
        ConfigurationError: there is no last one.
    """
    from sessions.recording.session_ids import LAST

    if name != LAST:
        return name
    from sessions.recording.listing import session_folder
    from tactile_lab.cli.console import say

    folder = session_folder(root, name)
    say(f"last  {folder}", "dim")
    return str(folder)


def choose_session(root: Path, name: str) -> Session:
    """The session of a name, see :func:`sessions.recording.listing.find_session`.

    Raises:
        ConfigurationError: there is none.
        SessionError: its manifest cannot be read.
    """
    from sessions.recording.listing import find_session

    return find_session(root, resolve_name(root, name))
