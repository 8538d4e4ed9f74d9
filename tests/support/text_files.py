"""Text files as the repository wants them: UTF-8, lines that end plainly, one newline at the end, data that parse.

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
    """The text with plain line ends, no blanks before them, and one newline at the end; an empty one stays empty."""
    lines = [line.rstrip(" \t\r") for line in text.split("\n")]
    return "\n".join(lines).rstrip("\n") + "\n" if text.strip() else ""


def complaint(text: str, suffix: str) -> str:
    """What is wrong with a text that nobody but its author can mend; empty for nothing."""
    if _CONFLICT.search(text):
        return "marks of a conflict"
    try:
        _PARSERS.get(suffix, str)(text)
    except (ValueError, yaml.YAMLError) as error:
        return f"does not parse ({' '.join(str(error).split())})"
    return ""


def check(path: Path) -> str:
    """Mend one file; what was wrong with it, empty for nothing."""
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
    """Check files; 1 where anything was wrong."""
    wrong = {name: words for name in names if (words := check(Path(name)))}
    for name, words in wrong.items():
        print(f"{name}: {words}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
