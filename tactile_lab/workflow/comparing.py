"""Compares the results folders of sessions, with the quality of ground truth and clocks."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from drivers.core.atomic_files import write_whole
from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError, SessionDataError
from sessions.recording.session import TRAJECTORY, Session
from sessions.recording.session_events import EventKind, SessionEvent
from sessions.recording.traffic.schemas import SESSION_EVENTS_TOPIC, TRANSFORMS_TOPIC
from tactile_lab.evaluation.comparison import EvaluatedRun, MethodSummary, compare, markdown, rows_csv
from tactile_lab.evaluation.files.plain import json_text, plain
from tactile_lab.evaluation.truth.marker_truth import MarkerTruth, TruthReport, report_json
from tactile_lab.evaluation.truth.session_truth import camera_datagrams
from tactile_lab.evaluation.truth.time_alignment import ClockOffset, Track, clock_offset
from tactile_lab.report.comparison_plot import comparison_svg
from tactile_lab.rigs.description import rig_of_session
from tactile_lab.workflow.finishing import TruthChoice, evaluate_results, marker_detector


@dataclass(frozen=True)
class Comparison:
    """All evaluated results.

    Attributes:
        runs: one per results folder, in order.
        truths: what each session's truth was worth, by session; None without a camera.
        clocks: offset of the camera's clock to the hand's, by session.
        unread: what of a recording could not be read, by session, in words; empty when all was.
        summaries: by method.
    """

    runs: tuple[EvaluatedRun, ...]
    truths: dict[str, TruthReport | None]
    clocks: dict[str, ClockOffset]
    unread: dict[str, str]
    summaries: tuple[MethodSummary, ...]

    def as_json(self) -> dict[str, Any]:
        """All of it as plain data."""
        truths = {name: None if report is None else report_json(report) for name, report in self.truths.items()}
        return {
            "evaluations": [
                {"session": each.session, "results": each.results, **each.evaluation} for each in self.runs
            ],
            "truth": truths,
            "clock_offset": {name: asdict(offset) for name, offset in self.clocks.items()},
            "unread": self.unread,
            "summaries": plain(self.summaries),
        }


def compare_sessions(sessions: Sequence[Session], folders: Sequence[str], choice: TruthChoice) -> Comparison:
    """Evaluate results folders of sessions; by default all that contain results.

    Raises:
        SessionError: a session has no such results, cannot be read, or is named twice.
        ConfigurationError: the chosen calibration cannot be used.
    """
    _check_different(sessions)
    runs: list[EvaluatedRun] = []
    truths, clocks, unread = dict[str, TruthReport | None](), dict[str, ClockOffset](), dict[str, str]()
    for session in sessions:
        for results in result_folders(session, folders):
            evaluation, truth, lost = evaluate_results(session, results, choice)
            runs.append(EvaluatedRun(session.manifest.name, results.name, evaluation.as_json()))
            truths[session.manifest.name] = truth
            if lost:
                unread[session.manifest.name] = lost
        clocks[session.manifest.name] = session_clock_offset(session, choice)
    return Comparison(tuple(runs), truths, clocks, unread, tuple(compare(runs)))


def _check_different(sessions: Sequence[Session]) -> None:
    """A session counted twice would make a confidence interval too narrow. Raises SessionError."""
    for name, count in Counter(session.manifest.name for session in sessions).items():
        if count > 1:
            raise ConfigurationError(
                "is given twice", where=name, hint="Give each session once, and not together with its copy"
            )


def result_folders(session: Session, names: Sequence[str]) -> list[Path]:
    """Folders of results inside a session, or anywhere else by their path. Raises SessionError."""
    if not names:
        found = sorted(path.parent for path in session.folder.glob(f"*/{TRAJECTORY}"))
        if not found:
            raise SessionDataError(
                "contains no results", where=str(session.folder), hint="Replay the session to create them"
            )
        return found
    return list(dict.fromkeys(_folder(session, name) for name in names))


def _folder(session: Session, name: str) -> Path:
    for path in (session.folder / name, Path(name)):
        if (path / TRAJECTORY).is_file():
            return path
    hint = "Give results folders inside the session, or their paths"
    raise SessionDataError(f"has no results called {name!r}", where=str(session.folder), hint=hint)


def write_comparison(comparison: Comparison, out: Path) -> list[Path]:
    """Write table, rows, all data and a plot. Returns the files. Raises WriteError."""
    texts = {
        "comparison.md": markdown(comparison.summaries),
        "comparison.csv": rows_csv(comparison.runs),
        "comparison.json": json_text(comparison.as_json()),
        "comparison.svg": comparison_svg(comparison.summaries),
    }
    for name, text in texts.items():
        write_whole(out / name, text, "Choose another folder with --out")
    return [out / name for name in texts]


def session_clock_offset(session: Session, choice: TruthChoice) -> ClockOffset:
    """Offset of the camera's clock from the hand's in one session, from the motion both saw."""
    detector = marker_detector(session, rig_of_session(session), choice)
    if detector is None:
        return ClockOffset(None, None, 0, "the session has no camera")
    palm, holds_s = _hand_track(session)
    if palm is None or not holds_s:
        return ClockOffset(None, None, 0, "the hand never held the object in this session")
    return clock_offset(palm, *_object_track(session, detector), holds_s)


def _object_track(session: Session, detector: MarkerTruth) -> tuple[Array, Array]:
    rows = []
    for datagram in camera_datagrams(session):
        pose = detector(datagram)
        if pose is not None:
            rows.append((datagram.stamp_ns / NANOSECONDS, pose.x(), pose.y()))
    table = np.array(rows, float).reshape(-1, 3)
    return table[:, 0], table[:, 1:]


def _hand_track(session: Session) -> tuple[Track | None, list[tuple[float, float]]]:
    """The palm's trajectory in the session, and when it held the object; None before two samples."""
    stamps, places, turns = [], [], []
    holds: list[tuple[float, float]] = []
    begun: float | None = None
    for message in session.traffic().messages_on({SESSION_EVENTS_TOPIC, TRANSFORMS_TOPIC}):
        if message.topic == SESSION_EVENTS_TOPIC:
            event = SessionEvent.from_bytes(message.data)
            if event.kind is EventKind.HOLD_BEGIN:
                begun = event.stamp_ns / NANOSECONDS
            elif event.kind is EventKind.HOLD_END and begun is not None:
                holds.append((begun, event.stamp_ns / NANOSECONDS))
                begun = None
        elif message.topic == TRANSFORMS_TOPIC and (found := _palm(json.loads(message.data)["transforms"])):
            stamps.append(message.stamp_ns / NANOSECONDS)
            places.append(found[0])
            turns.append(found[1])
    if len(stamps) < 2:
        return None, holds
    from scipy.spatial.transform import Rotation

    return Track(np.array(stamps), np.array(places), Rotation.from_quat(np.array(turns)).as_matrix()), holds


def _palm(transforms: Iterable[dict[str, Any]]) -> tuple[list[float], list[float]] | None:
    for transform in transforms:
        if transform["child_frame_id"] == "palm":
            place, turn = transform["translation"], transform["rotation"]
            return [place[axis] for axis in "xyz"], [turn[axis] for axis in "xyzw"]
    return None
