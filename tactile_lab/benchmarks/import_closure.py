"""How much code a module depends on: the modules of a package that it imports, directly or indirectly.

``python -m tactile_lab.benchmarks.import_closure [MODULE ...]`` prints the number of files and lines; without
arguments, those of method "joint".
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
"""Modules of the default method, without loops, and without the methods and shape models it is compared with."""

ALL = ("tactile_lab.slam.tactile_slam",)
"""Modules behind the one public class: every method, every shape model, and the loops."""


@dataclass(frozen=True)
class Closure:
    """Modules with all modules that they depend on.

    Attributes:
        files: of modules with content.
        lines: their total number of lines, including blank ones and comments.
    """

    files: tuple[Path, ...]
    lines: int


def closure(modules: Sequence[str], inside: str = INSIDE, root: Path = ROOT) -> Closure:
    """The modules of a package that some modules import, at any place in their text.

    Args:
        modules: dotted names of the modules to start from.
        inside: only modules of this package are followed and counted.
        root: folder that contains the packages.

    Raises:
        ModuleNotFoundError: one of the modules does not exist.
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
    """Files and lines as text."""
    found = closure(modules)
    return f"{len(found.files)} files, {found.lines} lines"


if __name__ == "__main__":
    if sys.argv[1:]:
        print(report(sys.argv[1:]))  # noqa: T201
    else:
        print(f"method joint: {report(JOINT)}\nall of TactileSlam: {report(ALL)}")  # noqa: T201
