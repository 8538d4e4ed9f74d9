"""The public names of the library as a page: ``python -m tests.support.public_api`` writes it.

The page is the snapshot that a test compares: a name or signature changes there, in sight, or not at all.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

from pydantic import BaseModel

import tactile_lab
from drivers.core.registry import Registry
from tests.support.repository import REPOSITORY

PAGE = REPOSITORY / "docs" / "library-reference.md"
_HEAD = """# Reference of the library

Everything that `from tactile_lab import ...` gives, made by `python -m tests.support.public_api` from the code.
These names keep their signatures as [the contributing guide](../CONTRIBUTING.md#versions) says;
[the library](library.md) shows how they are used.
"""


def page() -> str:
    """The page's text."""
    return _HEAD + "".join(
        _section(name, getattr(tactile_lab, name)) for name in sorted(tactile_lab.__all__, key=str.lower)
    )


def _section(name: str, item: Any) -> str:
    if name == "__version__":
        return f"\n## `{name}`\n\nThe version, as text.\n"
    if isinstance(item, Registry):
        entries = ", ".join(f"`{one}`" for one in item.registered())
        return f"\n## `{name}`\n\nThe registry of every {item.kind}: {entries}.\n"
    lines = [f"\n## `{name}`\n", f"`{_signature(name, item)}`\n", f"{_summary(item)}\n"]
    members = [_member(one, member) for one, member in _members(item)]
    return "\n".join([*lines, *(["\n".join(members) + "\n"] if members else [])])


def _signature(name: str, item: Any) -> str:
    if isinstance(item, type) and issubclass(item, Exception):
        return f"class {name}({item.__mro__[1].__name__})"
    if isinstance(item, type) and issubclass(item, BaseModel):
        return f"class {name}({', '.join(item.model_fields)})"
    text = re.sub(r"(: |-> )'([^']*)'", r"\1\2", str(inspect.signature(item)))
    text = re.sub(r"<[^<>]*>", "...", text)  # defaults whose text is an address
    return f"class {name}{text.removesuffix(' -> None')}" if isinstance(item, type) else f"{name}{text}"


def _summary(item: Any) -> str:
    text = (inspect.getdoc(item) or "").split("\n\n")[0]
    return re.sub(r":\w+:`~?([^`]+)`", r"`\1`", " ".join(text.split())).replace("``", "`")


def _members(item: Any) -> list[tuple[str, Any]]:
    """Public methods and properties that the class itself defines."""
    if not isinstance(item, type) or issubclass(item, Exception):
        return []
    shown = (property, classmethod, staticmethod)
    return [
        (name, member)
        for name, member in vars(item).items()
        if not name.startswith("_") and (inspect.isfunction(member) or isinstance(member, shown))
    ]


def _member(name: str, member: Any) -> str:
    bare = member.__func__ if isinstance(member, classmethod | staticmethod) else member
    head = name if isinstance(bare, property) else f"{name}{inspect.signature(bare)}"
    return f"- `{head}`: {_summary(bare)}"


def main() -> None:
    """Write the page."""
    Path(PAGE).write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
