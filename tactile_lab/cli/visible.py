"""Text of others on a terminal: names, notes and keys of files may hold characters that command it."""

from __future__ import annotations

import re

_COMMANDS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""Control characters but line ends and tabs, and those that turn the direction of writing."""


def visible(text: str) -> str:
    """The text with such characters as escapes, which move no cursor, set no title and hide no words."""
    return _COMMANDS.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)
