"""How much code a module rests on: the modules of a package that it imports, directly or by way of others.

``python -m tactile_lab.benchmarks.import_closure [MODULE ...]`` says how many files and lines, without names those of
method "joint".
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
INSIDE = "tactile_lab.slam"
JOINT = (
    "tactile_lab.slam.tracking.joint.joint_tracker",
    "tactile_lab.slam.tracking.joint.pose_uncertainty",
    "tactile_lab.slam.tracking.contacts.first_pose",
    "drivers.core.observability",
    "tactile_lab.slam.graph.relocation",
    "tactile_lab.slam.shape.selection.planar_choice",
    "tactile_lab.slam.result",
)
"""What the default method is made of, without the methods and shape models it is compared with, and the loops."""

ALL = ("tactile_lab.slam.tactile_slam",)
"""What one class offers: every method, every shape model, and the loops."""


@dataclass(frozen=True)
class Closure:
    """Modules that others rest on, with these.

    Attributes:
        files: of modules with content.
        lines: of all of them, blank ones and comments included.
    """

    files: tuple[Path, ...]
    lines: int


def closure(modules: Sequence[str], inside: str = INSIDE, root: Path = ROOT) -> Closure:
    """The modules of a package that some of them import, wherever in their text.

    Args:
        modules: to begin with, dotted names.
        inside: only modules of this package are followed and counted.
        root: folder that the names begin in.

    Raises:
        ModuleNotFoundError: one of the modules is not there.
    """
    if missing := [name for name in modules if _file(name, root) is None]:
        raise ModuleNotFoundError(f"no module {missing[0]} in {root}")
    found: dict[str, Path] = {}
    ahead = list(modules)
    while ahead:
        name = ahead.pop()
        file = _file(name, root)
        if file is None or name in found or not name.startswith(inside):
            continue
        found[name] = file
        ahead += _imports(file, root)
    files = sorted(file for file in found.values() if file.stat().st_size)
    return Closure(tuple(files), sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files))


def _imports(file: Path, root: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if _file(whole, root) else node.module


def _file(name: str, root: Path) -> Path | None:
    path = root / name.replace(".", "/")
    choices = (path.with_suffix(".py"), path / "__init__.py")
    return next((choice for choice in choices if choice.is_file()), None)


def report(modules: Sequence[str]) -> str:
    """Files and lines in words."""
    found = closure(modules)
    return f"{len(found.files)} files, {found.lines} lines"


if __name__ == "__main__":
    if sys.argv[1:]:
        print(report(sys.argv[1:]))  # noqa: T201
    else:
        print(f"method joint: {report(JOINT)}\nall of TactileSlam: {report(ALL)}")  # noqa: T201
