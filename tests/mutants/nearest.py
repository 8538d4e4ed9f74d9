"""Which tests are nearest to a module: those on the shortest way along imports."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path
from typing import TypeGuard

SOURCES = ("tactile_lab", "sessions", "calibration", "drivers", "tests")


class Nearest:
    """The import graph of a tree, and the tests of each module by their distance in it.

    Attributes:
        walkers: tests that import all modules of a package, and look at what these define.
    """

    def __init__(self, root: Path) -> None:
        self.files = {
            file.relative_to(root).as_posix(): file
            for folder in SOURCES
            for file in sorted((root / folder).rglob("*.py"))
        }
        self.modules = {_module(path): path for path in self.files}
        self.imports = {path: self._imports(path) for path in self.files}
        self.walkers = [path for path in self.files if Path(path).name.startswith("test_") and self._walks(path)]
        self.importers: defaultdict[str, set[str]] = defaultdict(set)
        for path, imported in self.imports.items():
            for other in imported:
                self.importers[other].add(path)

    def tests(self, path: str) -> list[str]:
        """Test files that reach a module: unit tests first, then nearer ones, namesakes, those with few imports."""
        distances = self._distances(path)
        tests = [other for other in distances if other.startswith("tests/") and Path(other).name.startswith("test_")]
        return sorted(
            tests, key=lambda test: (_slow(test), distances[test], not _mirrors(test, path), len(self.imports[test]))
        )

    def at_import(self, path: str, line: int) -> bool:
        """Whether a line runs while its module is imported: it is in no body of a function."""
        functions = [node for node in ast.walk(ast.parse(self.files[path].read_text(encoding="utf-8"))) if _acts(node)]
        return not any(node.body[0].lineno <= line <= (node.end_lineno or line) for node in functions)

    def _walks(self, path: str) -> bool:
        """Whether a test imports modules by the places of their files: no import in it tells which."""
        return 'import_module(".".join(' in self.files[path].read_text(encoding="utf-8")

    def _distances(self, path: str) -> dict[str, int]:
        distances, waiting = {path: 0}, [path]
        for here in waiting:
            for importer in sorted(self.importers[here] - distances.keys()):
                distances[importer] = distances[here] + 1
                waiting.append(importer)
        return distances

    def _imports(self, path: str) -> set[str]:
        names: set[str] = set()
        for node in ast.walk(ast.parse(self.files[path].read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                names.add(node.value)  # a registry that imports by name
            elif isinstance(node, ast.JoinedStr):
                names |= self._built(node)
        beside = _module(str(Path(path).parent / "x.py"))[:-1]
        found = {self.modules.get(name) or self.modules.get(beside + name) for name in names}
        return {other for other in found if other is not None and other != path}

    def _built(self, node: ast.JoinedStr) -> set[str]:
        """Modules whose name an f-string may build, of those that begin with a whole package."""
        parts = [re.escape(part.value) if isinstance(part, ast.Constant) else r"\w+" for part in node.values]
        if not parts[0].startswith(tuple(rf"{source}\." for source in SOURCES)):
            return set()
        return {name for name in self.modules if re.fullmatch("".join(parts), name)}


def _acts(node: ast.AST) -> TypeGuard[ast.FunctionDef | ast.AsyncFunctionDef]:
    return isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)


def _module(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _slow(test: str) -> bool:
    return not test.startswith("tests/unit/")


def _mirrors(test: str, path: str) -> bool:
    words = set(re.split(r"[/_]", Path(test).stem.removeprefix("test_")))
    return words <= set(re.split(r"[/_]", path.removesuffix(".py")))
