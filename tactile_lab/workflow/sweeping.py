"""Runs many sessions for one table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from drivers.core.errors import ConfigurationError, SessionError
from drivers.simulation.objects import CATALOGUE, check_object
from sessions.conductor.progress import NullProgress
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.recording.session import Session
from tactile_lab.evaluation.sweep import SweepRun
from tactile_lab.rigs.build import check_calibration
from tactile_lab.rigs.description import load_rig
from tactile_lab.workflow.finishing import differing_files
from tactile_lab.workflow.replaying import recorded_seed, recorded_slam, replay_session
from tactile_lab.workflow.running import SessionRequest, refuse_known_pose, require_packages, run_session


def check_sweep(rig: str, objects: Sequence[str] | None, root: Path, method: str) -> tuple[str, ...]:
    """The objects of a sweep, by default the whole catalogue; errors of every run are found here.

    Raises:
        ConfigurationError: no such rig, object or calibration, a mesh that cannot be used, a method that needs the
            truth, an extra that is not installed, or a folder of the sessions that cannot be made.
    """
    refuse_known_pose(method)
    loaded = load_rig(rig)
    check_calibration(loaded)
    for name in objects or ():
        check_object(name)
    require_packages(loaded, SessionRequest(rig, next(iter(objects or CATALOGUE)), root, method))
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        hint = "Choose another folder with --out"
        raise ConfigurationError(f"cannot be created ({error.strerror})", where=str(root), hint=hint) from error
    return tuple(objects or CATALOGUE)


def run_for_sweep(
    run: SweepRun, *, rig: str, method: str, grasps: int, root: Path, check_replay: bool = False
) -> dict[str, Any]:
    """One session of a sweep: the content of its ``evaluation.json``, and why it ``ended_early``, "" if it did not.

    Args:
        check_replay: replay the session from its bytes, too; a run whose replay is not identical counts as failed.

    Raises:
        TactileLabError: the run failed.
    """
    request = SessionRequest(rig, run.object_name, root, method, run.dimension, run.seed, grasps)
    finished = run_session(request, NullProgress())
    if finished.outcome is not None:
        finished.outcome.raise_if_interrupted()
    if finished.evaluation is None:
        raise SessionError(finished.problem, where=str(finished.folder))
    if check_replay:
        _check_replay(Session.open(finished.folder))
    return {**finished.evaluation.as_json(), "ended_early": _early_end(finished.outcome)}


def _early_end(outcome: SessionOutcome | None) -> str:
    """When and why a session ended early; "" for a complete one."""
    if outcome is None or outcome.ending is Ending.COMPLETE:
        return ""
    return f"after {len(outcome.grasps)} grasps: {outcome.reason}"


def _check_replay(session: Session) -> None:
    """Raises SessionError when a replay does not give the session's own results, byte for byte."""
    out = session.folder / "replay"
    replay_session(session, recorded_slam(session), recorded_seed(session), out)
    if differing := differing_files(session.results, out):
        raise SessionError(f"its replay differs in {', '.join(differing)}", where=str(session.folder))
