"""One HTML file that shows a session: opens from disk, fetches nothing, prints."""

from __future__ import annotations

from pathlib import Path

from sessions.manifest import write_whole
from sessions.session import RESULTS, Session
from tactile_lab.report.gather import gather
from tactile_lab.report.page import page

REPORT = "report.html"

__all__ = ["REPORT", "write"]


def write(folder: Path) -> Path:
    """Write ``results/report.html`` of a session folder; the file's path.

    Raises:
        SessionError: no session folder, no results yet, or the file cannot be written.
        ShapeError: a mesh that cannot be read.
    """
    path = folder / RESULTS / REPORT
    write_whole(path, page(gather(Session.open(folder))).encode())
    return path
