"""What comes of an action in words, and words as names of stored files."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from drivers.core.errors import TactileLabError


def as_name(words: str) -> str:
    """Words as a part of a file's name."""
    return re.sub(r"\W+", "_", words)


def said(act: Callable[[], Any], *folders: Path) -> Any:
    """What comes of an action; of an error its words, without the folders of this run."""
    try:
        return act()
    except TactileLabError as error:
        words = str(error)
        for folder in folders:
            words = words.replace(str(folder), "")
        return words
