"""What every entry of a registry has: a name for command lines and files, and errors that name its file."""

from __future__ import annotations

import re
import traceback

NAME = re.compile("[a-z0-9][a-z0-9_-]*")
"""Names that do on a command line and in a file's name."""


def explain(error: BaseException, file: str) -> str:
    """An unexpected error in one line: its message, and the line of ``file`` that raised it, if any."""
    words = " ".join(str(error).split())
    told = f"{type(error).__name__}: {words}" if words else type(error).__name__
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f"{told} (line {lines[-1]})" if lines else told
