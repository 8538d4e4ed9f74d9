"""Draws docs/pictures/packages.svg from the code's imports: ``python -m tests.support.package_picture``."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import grimp

PACKAGES = ("tactile_lab", "sessions", "calibration", "drivers")
"""From top to bottom: each imports only those below it."""
REPOSITORY = Path(__file__).resolve().parents[2]
PICTURE = REPOSITORY / "docs" / "pictures" / "packages.svg"

_WIDTH, _MARGIN, _BOX, _CHIP, _ARROWS = 920, 20, 150, (122, 34), 250


def import_counts() -> Counter[tuple[str, str]]:
    """Number of imports from one package to another, by (importer, imported)."""
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    found = ((module, other) for module in graph.modules for other in graph.find_modules_directly_imported_by(module))
    packages = ((module.partition(".")[0], other.partition(".")[0]) for module, other in found)
    return Counter(pair for pair in packages if pair[0] != pair[1])


def folders(package: str) -> list[tuple[str, int]]:
    """Folders of a package, with the number of files in and below each."""
    inside = sorted(path for path in (REPOSITORY / package).iterdir() if (path / "__init__.py").is_file())
    return [(path.name, sum(1 for _ in path.rglob("*.py"))) for path in inside]


def svg() -> str:
    """The picture: a box per package, a chip per folder, and arrows with the number of imports between packages."""
    counts = import_counts()
    boxes = "".join(_box(index, package) for index, package in enumerate(PACKAGES))
    arrows = "".join(_arrow(number, pair, counts[pair]) for number, pair in enumerate(sorted(counts, key=_order)))
    height = len(PACKAGES) * _BOX + _MARGIN
    style = "text{font:13px sans-serif;fill:#1b2330}.t{font-weight:bold}.s{font-size:11px;fill:#5a6678}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" height="{height}">'
        f'<style>{style}</style><rect width="100%" height="100%" fill="#ffffff"/>'
        f'<defs><marker id="a" markerWidth="8" markerHeight="8" refX="7" refY="4" orient="auto">'
        f'<path d="M0,0 L8,4 L0,8 z" fill="#1d5fa8"/></marker></defs>{boxes}{arrows}</svg>\n'
    )


def _order(pair: tuple[str, str]) -> tuple[int, int]:
    return PACKAGES.index(pair[0]), PACKAGES.index(pair[1])


def _box(index: int, package: str) -> str:
    top, width = _MARGIN + index * _BOX, _WIDTH - _ARROWS - 2 * _MARGIN
    chips = "".join(_chip(number, name, files, top) for number, (name, files) in enumerate(folders(package)))
    return (
        f'<rect x="{_MARGIN}" y="{top}" width="{width}" height="{_BOX - 20}" rx="8" fill="#f3f5f8" stroke="#9aa4b2"/>'
        f'<text class="t" x="{_MARGIN + 12}" y="{top + 20}">{package}</text>{chips}'
    )


def _chip(number: int, name: str, files: int, top: int) -> str:
    width, height = _CHIP
    x, y = _MARGIN + 12 + (number % 5) * width, top + 30 + (number // 5) * height
    return (
        f'<rect x="{x}" y="{y}" width="{width - 8}" height="{height - 6}" rx="5" fill="#ffffff" stroke="#c5ccd6"/>'
        f'<text x="{x + 6}" y="{y + 13}">{name}</text><text class="s" x="{x + 6}" y="{y + 25}">{files} files</text>'
    )


def _arrow(number: int, pair: tuple[str, str], count: int) -> str:
    x = _WIDTH - _ARROWS + 10 + number * 38
    start, end = (_MARGIN + PACKAGES.index(one) * _BOX + _BOX / 2 - 10 for one in pair)
    middle = start + 22
    return (
        f'<line x1="{x}" y1="{start}" x2="{x}" y2="{end}" stroke="#1d5fa8" stroke-width="2" marker-end="url(#a)"/>'
        f'<circle cx="{x}" cy="{start}" r="3" fill="#1d5fa8"/><text class="s" x="{x + 5}" y="{middle}">{count}</text>'
    )


if __name__ == "__main__":
    PICTURE.write_text(svg(), encoding="utf-8")
