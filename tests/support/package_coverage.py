"""Coverage by package, from the report that pytest-cov writes.

python -m pytest --cov --cov-report=json && python -m tests.support.package_coverage coverage.json --store
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests.support.stored_table import GrowingTable, Outline, parser

OUTLINE = Outline(
    "coverage",
    "How much of each package the tests run through.",
    ("make coverage",),
    "Lines and branches that were run, of those there are. What runs in child processes does not count.",
    ("Package", "Files", "Lines", "Lines run, %", "Branches", "Branches run, %"),
)
PARTED = "tactile_lab"
"""This package is shown by its parts."""


def package_of(path: str) -> str:
    """The package to which a file belongs."""
    first, *rest = Path(path).parts
    return f"{first}.{rest[0]}" if first == PARTED and len(rest) > 1 else first


def rows(report: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Cells of the table by package, from the JSON of coverage."""
    summaries: dict[str, list[Mapping[str, int]]] = {}
    for path, file in sorted(report["files"].items()):
        summaries.setdefault(package_of(path), []).append(file["summary"])
    return {package: _cells(files) for package, files in summaries.items()}


def _cells(files: list[Mapping[str, int]]) -> tuple[str, ...]:
    lines, run, branches, taken = (
        sum(file[name] for file in files)
        for name in ("num_statements", "covered_lines", "num_branches", "covered_branches")
    )
    return str(len(files)), str(lines), _share(run, lines), str(branches), _share(taken, branches)


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f}" if whole else "–"


def main() -> None:
    """Print the table, and store it if requested."""
    options = parser(__doc__)
    options.add_argument("report", type=Path)
    chosen = options.parse_args()
    found = rows(json.loads(chosen.report.read_text(encoding="utf-8")))
    table = GrowingTable(chosen.docs, OUTLINE, [(package,) for package in found])
    for package, cells in found.items():
        table.put((package,), cells)
    table.publish()


if __name__ == "__main__":
    main()
