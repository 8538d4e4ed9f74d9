"""The plan of the packages: they point one way, files make no circles, and no folder is too long to look through."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import grimp
import networkx as nx
import pytest

from tests.support.repository import REPOSITORY

PACKAGES = ("tactile_lab", "sessions", "calibration", "drivers")
"""Each imports only those to the right of it."""

MOST_FILES = 20


@pytest.fixture(scope="module")
def imports() -> nx.DiGraph:
    """An edge from every module to each module of ours that it imports, wherever in its file, for types or for work."""
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    edges = (
        (importer, imported)
        for importer in graph.modules
        for imported in graph.find_modules_directly_imported_by(importer)
    )
    return nx.DiGraph(edges)


def package_files() -> list[Path]:
    return [file for package in PACKAGES for file in sorted((REPOSITORY / package).rglob("*.py"))]


def test_no_package_imports_one_above_it(imports: nx.DiGraph) -> None:
    height = {package: -place for place, package in enumerate(PACKAGES)}
    upward = [
        f"{importer} -> {imported}"
        for importer, imported in sorted(imports.edges)
        if height[imported.partition(".")[0]] > height[importer.partition(".")[0]]
    ]
    assert not upward, "\n".join(upward)


def test_the_science_knows_no_device_no_session_and_no_file(imports: nx.DiGraph) -> None:
    foreign = [
        f"{importer} -> {imported}"
        for importer, imported in sorted(imports.edges)
        if importer.startswith("tactile_lab.slam") and not imported.startswith(("tactile_lab.slam", "drivers.core"))
    ]
    assert not foreign, "\n".join(foreign)


def test_no_files_import_each_other_in_a_circle(imports: nx.DiGraph) -> None:
    circles = [sorted(circle) for circle in nx.strongly_connected_components(imports) if len(circle) > 1]
    assert not circles


def test_a_folder_has_at_most_twenty_files() -> None:
    files = Counter(file.parent.relative_to(REPOSITORY).as_posix() for file in package_files())
    assert {folder: count for folder, count in files.items() if count > MOST_FILES} == {}


def test_every_folder_of_code_is_a_package() -> None:
    folders = {file.parent for file in package_files()}
    assert [folder for folder in sorted(folders) if not (folder / "__init__.py").is_file()] == []


def test_unit_tests_lie_where_the_packages_lie() -> None:
    """``tests/unit/drivers/camera/test_boards.py`` tests ``drivers/camera``."""
    unit = REPOSITORY / "tests" / "unit"
    folders = {file.parent.relative_to(unit) for package in PACKAGES for file in (unit / package).rglob("test_*.py")}
    assert folders
    assert [str(folder) for folder in sorted(folders) if not (REPOSITORY / folder / "__init__.py").is_file()] == []
