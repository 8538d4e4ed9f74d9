"""Names of sessions: the folder's name is the session's id."""

from __future__ import annotations

import re

from drivers.core.errors import ConfigurationError

LONGEST_ID = 64
LAST = "last"
"""Means the newest session wherever one is named; no session is called so."""
_ID = re.compile(r"[a-z0-9_-]{1,64}")


def check_id(name: str, where: str = "") -> str:
    """Check that a name is a session id: 1 to 64 of a-z, 0-9, underscore and hyphen, and not ``last``.

    Raises:
        ConfigurationError: it is not.
    """
    if not _ID.fullmatch(name):
        raise ConfigurationError(
            f"{name!r} cannot be the name of a session",
            where=where,
            hint=f"Names have 1 to {LONGEST_ID} of the characters a-z, 0-9, _ and -",
        )
    if name == LAST:
        hint = "Choose another name"
        raise ConfigurationError(f"{LAST!r} means the newest session, and can be no name", where=where, hint=hint)
    return name


def slug(text: str) -> str:
    """Convert a name to part of an id; of a path (``mesh:some/part.stl``) the file name without suffix."""
    last = re.split(r"[/\\:]", text.strip())[-1]
    return re.sub(r"[^a-z0-9]+", "-", re.sub(r"\.[a-z0-9]+$", "", last.lower())).strip("-") or "unnamed"


def recovered_id(name: str) -> str:
    """The id of a session's recovery."""
    end = "-recovered"
    return name[: LONGEST_ID - len(end)] + end
