"""Sessions as tables for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

from sessions.recording.listing import SessionSummary, left_open
from sessions.recording.manifest import Manifest
from sessions.recording.recovery import Recovery
from sessions.recording.session import TRAFFIC, Session
from sessions.recording.traffic.reader import segment_paths
from tactile_lab.cli.console import answer, say, show_facts, show_table, warn

NEVER_CLOSED = "open: still running, or killed before it was closed"
_FLAGS = {"truncated": "the file ends too early", "traffic_cut_short": "the recording was cut short"}
"""Losses without a count."""


def show_sessions(root: Path, summaries: Sequence[SessionSummary]) -> None:
    """One line per session; problems are listed below the table."""
    rows = [
        (
            summary.folder.name,
            _status_cell(summary),
            "" if summary.grasps is None else str(summary.grasps),
            f"{summary.traffic_bytes / 1e6:.1f}",
            summary.object_name,
        )
        for summary in summaries
    ]
    show_table(f"Sessions in {root}", ["session", "status", "grasps", "MB", "object"], rows, right=(2, 3))
    if any(summary.data_loss for summary in summaries):
        say("! with data loss: see tactile-lab session show", "yellow")
    for summary in summaries:
        if summary.problem:
            say(f"{summary.folder.name}: {summary.problem}", "yellow")


def _status_cell(summary: SessionSummary) -> str:
    """Status, data loss, and how the session was derived from another one if the status does not say it."""
    made = [how for how in summary.derived if how != summary.status]
    return ", ".join([summary.status + (" !" if summary.data_loss else ""), *made])


def tell_left_open(root: Path) -> None:
    """List the sessions that a crash left open."""
    for summary in left_open(root):
        warn(f"{summary.folder.name}: {summary.problem}")


def show_recovery(recovery: Recovery) -> None:
    """Recovered and lost messages of each topic."""
    if recovery.folder is None:
        answer(f"{recovery.source} is closed and complete: nothing to recover")
        return
    rows = [
        (
            topic,
            str(item.read),
            str(item.lost),
            f"{item.at_most_more}" if item.at_most_more else "",
            f"{item.last_s:.3f}",
        )
        for topic, item in recovery.topics.items()
    ]
    titles = ["topic", "recovered", "lost", "at most lost at the end", "last stamp, s"]
    show_table(f"Recovered from {recovery.source}", titles, rows, right=(1, 2, 3, 4))
    answer(f"session  {recovery.folder}")
    if recovery.left_out:
        kept = f"results of the damaged session stay there ({', '.join(recovery.left_out)})"
        say(f"{kept}; make new ones with: tactile-lab session replay {recovery.folder}", "yellow")
    if recovery.lossy:
        warn(f"lost: {recovery.describe()}")
    else:
        answer("nothing was lost", "green")


def recovery_document(recovery: Recovery) -> dict[str, Any]:
    """A recovery as plain data."""
    return {
        "source": str(recovery.source),
        "session": None if recovery.folder is None else str(recovery.folder),
        "lossy": recovery.lossy,
        "loss": recovery.describe(),
        "left_out": list(recovery.left_out),
        "topics": {topic: asdict(item) for topic, item in recovery.topics.items()},
    }


def show_session(session: Session) -> None:
    """A session's devices and settings, how it ended and what it recorded."""
    manifest = session.manifest
    slam = manifest.settings.get("slam")
    estimation = slam if isinstance(slam, dict) else {}
    files = [path.stat().st_size for path in segment_paths(session.folder / TRAFFIC) if path.is_file()]
    several = f" in {len(files)} files" if len(files) > 1 else ""
    size = f", {sum(files) / 1e6:.1f} MB{several}" if files else f", {TRAFFIC} is missing"
    facts = [
        ("folder", str(session.folder)),
        ("status", _status(manifest)),
        ("lost", losses_in_words(manifest.data_loss)),
        ("object", manifest.object_name),
        ("rig", manifest.rig),
        ("notes", manifest.notes),
        ("origin", "\n".join(step.words for step in manifest.derived)),
        ("started", _moment(manifest.started_utc)),
        ("ended", _moment(manifest.ended_utc)),
        ("seeds", ", ".join(f"{name} {seed}" for name, seed in manifest.seeds.items())),
        (
            "estimation",
            ", ".join(f"{name} {estimation[name]}" for name in ("method", "dimension") if name in estimation),
        ),
        ("grasps", _grasps(manifest)),
        ("recorded", f"{_messages(manifest)}{size}"),
        ("results", ", ".join(sorted(path.name for path in session.results.iterdir())) or "none yet"),
        ("versions", ", ".join(f"{name} {number}" for name, number in manifest.versions.items())),
        ("calibration", _calibration(manifest)),
    ]
    show_facts(manifest.name, facts)


def losses_in_words(data_loss: Mapping[str, int]) -> str:
    """Data losses of a session by kind."""
    return ", ".join(_FLAGS.get(kind, f"{number} {kind.replace('_', ' ')}") for kind, number in data_loss.items())


def _calibration(manifest: Manifest) -> str:
    """Each file with the first characters of its hash."""
    copies = list(manifest.calibration.values())
    width = max((len(copy.file) for copy in copies), default=0)
    return "\n".join(f"{copy.file:<{width}}  {copy.sha256[:12]}" for copy in copies)


def _status(manifest: Manifest) -> str:
    if manifest.status == "open":
        return NEVER_CLOSED
    if manifest.problem.startswith(manifest.status):
        return manifest.problem
    return manifest.status + (f": {manifest.problem}" if manifest.problem else "")


def _moment(iso: str | None) -> str:
    """A time in readable form; other text unchanged."""
    try:
        return "" if iso is None else f"{datetime.fromisoformat(iso):%Y-%m-%d %H:%M:%S %Z}"
    except ValueError:
        return str(iso)


def _grasps(manifest: Manifest) -> str:
    planned, done = manifest.settings.get("grasps"), manifest.counts.get("grasps")
    if done is None:
        return f"{planned} planned" if planned is not None else ""
    return f"{done} of {planned}" if planned is not None else str(done)


def _messages(manifest: Manifest) -> str:
    topics = [number for name, number in manifest.counts.items() if name.startswith("/")]
    return f"{sum(topics)} messages on {len(topics)} topics" if topics else "not counted"
