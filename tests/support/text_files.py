"""Checks text files of the repository: UTF-8, plain line ends, one newline at the end, valid data formats.

python -m tests.support.text_files FILE...    # mends line ends; ends with 1 where anything was wrong
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import yaml

_CONFLICT = re.compile(r"^(<{7} |={7}$|>{7} )", re.M)
_PARSERS: dict[str, Callable[[str], object]] = {
    ".json": json.loads,
    ".toml": tomllib.loads,
    ".yaml": yaml.safe_load,
    ".yml": yaml.safe_load,
    ".cff": yaml.safe_load,
}


def mended(text: str) -> str:
    """The text with plain line ends, no trailing blanks, and one newline at the end; an empty text stays empty."""
    lines = [line.rstrip(" \t\r") for line in text.split("\n")]
    return "\n".join(lines).rstrip("\n") + "\n" if text.strip() else ""


def complaint(text: str, suffix: str) -> str:
    """A problem of a text that only its author can fix; empty if there is none."""
    if _CONFLICT.search(text):
        return "marks of a conflict"
    try:
        _PARSERS.get(suffix, str)(text)
    except (ValueError, yaml.YAMLError) as error:
        return f"does not parse ({' '.join(str(error).split())})"
    return ""


def check(path: Path) -> str:
    """Fix one file; returns what was wrong with it, empty if nothing."""
    try:
        text = path.read_bytes().decode("utf-8")
    except UnicodeDecodeError:
        return "is not UTF-8"
    if words := complaint(text, path.suffix):
        return words
    if (whole := mended(text)) != text:
        path.write_bytes(whole.encode("utf-8"))
        return "mended: blanks at the end of a line or of the file"
    return ""


def main(names: list[str]) -> int:
    """Check files; returns 1 if anything was wrong."""
    wrong = {name: words for name in names if (words := check(Path(name)))}
    for name, words in wrong.items():
        print(f"{name}: {words}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
