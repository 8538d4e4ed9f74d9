"""Replays a recorded session from its raw bytes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gtsam import Pose3

from drivers.core.configuration import recorded_keys, validate
from drivers.core.errors import ConfigurationError
from sessions.conductor.progress import NullProgress, Progress
from sessions.perception.replay import Replay, kept_grasps
from sessions.recording.pacing import AS_FAST_AS_POSSIBLE
from sessions.recording.session import Session
from sessions.recording.traffic.loss import Loss
from tactile_lab.evaluation.truth.session_truth import session_truth
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import OTHER_VERSION, rig_of_session
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.finishing import (
    RESULT_FILES,
    FinishedSession,
    estimate_rest,
    finish,
    has_results,
    marker_detector,
)


def replay_session(
    session: Session,
    settings: SlamSettings,
    seed: int,
    out: Path,
    progress: Progress | None = None,
    speed: float = AS_FAST_AS_POSSIBLE,
) -> FinishedSession:
    """Replay a recorded session from its raw bytes, and evaluate it.

    Args:
        session: the recording.
        settings, seed: of the estimation; with the recorded ones the results are the session's own, byte for byte.
        out: folder of the results; those of an earlier replay in it are replaced.
        progress: receives the number of the grasp that is being estimated.
        speed: of the bytes: 1 the original pace, 4 four times as fast, 0 as fast as possible.

    Raises:
        ConfigurationError: ``out`` holds other files.
        SessionError: the recording cannot be used at all. A truncated one is used up to its end.
    """
    if has_results(session) and out.resolve() == session.results.resolve():
        hint = "Choose another folder for the results (--into or --out)"
        raise ConfigurationError("contains the session's own results", where=str(out), hint=hint)
    check_replaceable(out)
    rig = rig_of_session(session)
    interpreter = build_interpreter(rig)
    replay = Replay(session, interpreter, speed)
    progress = progress or NullProgress()
    progress.phase(0, "read")
    grasps = kept_grasps(replay.outcomes())
    known_poses = true_poses(session, len(grasps)) if settings.method == "known-pose" else None
    slam = TactileSlam(settings, seed, known_poses)
    estimate_rest(slam, grasps, progress)
    progress.phase(len(grasps), "model and evaluation")
    finished = finish(session, rig, slam, grasps, out, interpreter.perception.properties)
    unread = _unread(replay.loss, len(grasps), session.manifest.counts.get("grasps"))
    return replace(finished, data_loss=session.manifest.data_loss, unread=unread, read_factor=replay.factor)


def _unread(loss: Loss, grasps: int, recorded: int | None) -> str:
    """What a replay could not read, as text."""
    if not loss:
        return ""
    known = "" if recorded is None else f" of {recorded}"
    return f"{loss.describe()}; {grasps}{known} grasps could be read"


def true_poses(session: Session, grasp_count: int) -> tuple[Pose3 | None, ...]:
    """The object's pose at each grasp by the marker camera; None if it was not seen.

    Raises:
        SessionError, ConfigurationError: the recording, or the calibration in it, cannot be used.
    """
    return session_truth(session, grasp_count, marker_detector(session, rig_of_session(session))).world_T_object


def check_replaceable(out: Path) -> None:
    """Refuse to overwrite files that are not results of an estimation. Raises ConfigurationError."""
    hint = "Choose a new folder for the results (--into or --out)"
    try:
        strange = sorted(entry.name for entry in out.iterdir() if entry.name not in RESULT_FILES)
    except FileNotFoundError:
        return
    except OSError as error:
        raise ConfigurationError(f"cannot be used ({error.strerror})", where=str(out), hint=hint) from error
    if strange:
        raise ConfigurationError(
            f"contains files that are not results, such as {strange[0]}", where=str(out), hint=hint
        )


def recorded_slam(session: Session) -> SlamSettings:
    """The estimation's settings of a session. Raises ConfigurationError."""
    where = f"{session.folder}/session.yaml"
    with recorded_keys():
        return validate(session.manifest.settings.get("slam", {}), SlamSettings, where=where, hint=OTHER_VERSION)


def recorded_seed(session: Session) -> int:
    """The seed a session was run with."""
    return session.manifest.seeds.get("session", 0)
