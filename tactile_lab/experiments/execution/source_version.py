"""The version of everything that results depend on."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[3]
_PLOTS = ("plots", "plot_data", "plot_drawings", "plot_sheet", "plot_surfaces")
_PARTS = ("tactile_lab", "calibration", "drivers", "sessions")
_WITHOUT = ("cli", "workflow", "view", "report", "experiments/results", *(f"experiments/{name}.py" for name in _PLOTS))
"""Parts of tactile_lab that only present results or read commands, except for these modules:"""
_WORKFLOW = (
    "attending", "calibrating_forearm", "exporters", "exporting", "finishing", "object_check", "plugging", "replaying",
    "running",
)  # fmt: skip
_WITH = tuple(f"workflow/{name}.py" for name in _WORKFLOW)


@cache
def version() -> str:
    """Hash of the sources that results depend on."""
    digest = hashlib.sha256()
    for path in sources():
        digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def sources() -> list[Path]:
    """Files that results depend on: programs, and the rigs' descriptions and calibrations."""
    files = (path for part in _PARTS for path in (_ROOT / part).rglob("*") if path.suffix in {".py", ".yaml"})
    left_out, taken = ([_ROOT / "tactile_lab" / name for name in names] for names in (_WITHOUT, _WITH))
    return sorted(path for path in files if path in taken or not any(map(path.is_relative_to, left_out)))
