"""One HTML file that shows a session: opens from disk, loads nothing from the network, can be printed."""

from __future__ import annotations

from pathlib import Path

from drivers.core.atomic_files import write_whole
from sessions.recording.session import RESULTS, Session
from tactile_lab.report.gather import gather
from tactile_lab.report.page import page

REPORT = "report.html"

__all__ = ["REPORT", "write"]


def write(folder: Path, results: Path | None = None) -> Path:
    """Write ``report.html`` next to its results. Returns the file's path.

    Args:
        folder: the session's folder.
        results: the folder of the results to show; the session's own if None.

    Raises:
        SessionError: not a session folder, or no results yet.
        ShapeError: a mesh cannot be read.
        WriteError: the file cannot be written.
    """
    results = results or folder / RESULTS
    path = results / REPORT
    write_whole(path, page(gather(Session.open(folder), results)))
    return path
