"""The code and the rig keys of ``docs/extending.md``, read from the page."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

Written = Callable[..., Path]
"""Writes an extension into a test's folder."""

PAGE = Path(__file__).resolve().parents[2] / "docs" / "extending.md"


def code(file: str, page: Path = PAGE) -> str:
    """A page's block of code that starts with the name of this file."""
    blocks = re.findall(r"^```python\n(# (\S+)\n.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)
    return next(text for text, name in blocks if name == file)


def files() -> list[str]:
    """The names of all blocks of code."""
    return re.findall(r"^```python\n# (\S+)$", PAGE.read_text(), re.MULTILINE)


def rig_keys(file: str) -> dict[str, Any]:
    """The page's block of rig-file keys that names this file among its extensions."""
    blocks = [yaml.safe_load(text) for text in re.findall(r"^```yaml\n(.*?)^```$", PAGE.read_text(), re.M | re.S)]
    return next(block for block in blocks if file in block["extensions"])
