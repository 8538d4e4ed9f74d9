"""The jobs of the command line, free of printing: run a session, judge it, replay it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gtsam import Pose3

from drivers.camera.aruco import ObjectTracker
from drivers.camera.calibration import load_camera
from drivers.camera.camera import Camera
from drivers.camera.markers import MarkerSettings
from drivers.links import Datagram, ReplayLink
from drivers.simulation.objects import CATALOGUE
from drivers.simulation.world import SimulatedWorld
from sessions.conductor import Conductor, ConductorSettings, Ending, SessionOutcome
from sessions.interpreter import CAMERA_LINK
from sessions.manifest import Status, write_whole
from sessions.progress import NullProgress, Progress
from sessions.replay import Replay
from sessions.session import RunningSession, Session, create_session
from tactile_lab import report
from tactile_lab.clock import VirtualClock
from tactile_lab.errors import SessionError, TactileLabError
from tactile_lab.evaluation.evaluation import Evaluation, evaluate
from tactile_lab.evaluation.result_files import write_results
from tactile_lab.evaluation.results import read_results
from tactile_lab.evaluation.session_truth import TRUTH_TRAJECTORY, Look, session_truth
from tactile_lab.evaluation.sweep import SweepRun
from tactile_lab.evaluation.trajectory import Trajectory, trajectory_text
from tactile_lab.geometry.contacts import Grasp
from tactile_lab.rigs.build import build_bench, build_interpreter, simulated_world
from tactile_lab.rigs.description import Rig, load_rig, rig_of_session
from tactile_lab.slam import SlamSettings, TactileSlam
from tactile_lab.strict_yaml import validate

EVALUATION = "evaluation.json"
REPLAYABLE = ("trajectory.csv", "contacts.csv", "contour.csv", "mesh.ply", "mesh.glb", "slam.json")
"""Result files that a replay of the same session gives again, byte for byte."""


@dataclass(frozen=True)
class SessionRequest:
    """What a person asks for.

    Attributes:
        rig: name of a shipped rig, or a rig file.
        object_name: of the simulated rig's catalogue, or ``mesh:FILE``.
        root: folder in which the session's folder is made.
        slam: the estimation's settings.
        seed: of everything that is left to chance.
        grasps: how many; the rig's own number when None.
        notes: the operator's.
    """

    rig: str
    object_name: str
    root: Path
    slam: SlamSettings
    seed: int = 0
    grasps: int | None = None
    notes: str = ""


@dataclass(frozen=True)
class FinishedSession:
    """A session with its results.

    Attributes:
        folder: the session's.
        results: the folder of these results.
        outcome: how the autonomous part ended; None for a replay.
        evaluation: None when there was nothing to judge.
        data_loss: what was not recorded or dropped, by kind; empty when nothing was lost.
        problem: why there is no evaluation, "" when there is one.
    """

    folder: Path
    results: Path
    outcome: SessionOutcome | None = None
    evaluation: Evaluation | None = None
    data_loss: Mapping[str, int] | None = None
    problem: str = ""


def slam_settings(method: str, dimension: int) -> SlamSettings:
    """Settings of the estimation. Raises ConfigurationError for an unknown method or dimension."""
    return validate({"method": method, "dimension": dimension}, SlamSettings, where="options")


def catalogue() -> tuple[str, ...]:
    """Names of the simulated rig's objects."""
    return tuple(CATALOGUE)


# --- a session -----------------------------------------------------------------------------------------------------


def run_session(request: SessionRequest, progress: Progress) -> FinishedSession:
    """Run an autonomous session on a rig, and judge it.

    Raises:
        ConfigurationError, ShapeError: the request can not be met; nothing was recorded.
        DeviceError: the rig is not ready; the session folder says so.
        SessionError: the session could not be recorded.
    """
    rig = load_rig(request.rig)
    world = simulated_world(rig, request.seed, request.object_name)
    slam = TactileSlam(request.slam, request.seed)
    with _new_session(rig, world, request) as session:
        bench = build_bench(rig, world, session.recorder)
        bench.connect()
        settings, dimension = _conductor_settings(rig, request), request.slam.dimension
        try:
            conductor = Conductor(bench, slam, settings, seed=request.seed, dimension=dimension, progress=progress)
            outcome = conductor.run()
        finally:
            bench.close()
        _close(session, outcome, bench.counts.overruns, bench.undecodable)
    progress.phase(len(outcome.grasps), "model and evaluation")
    _estimate_rest(slam, outcome.grasps)
    finished = _judge(session, rig, slam, outcome.grasps, session.results)
    return replace(finished, outcome=outcome, data_loss=session.manifest.data_loss)


def _new_session(rig: Rig, world: SimulatedWorld, request: SessionRequest) -> RunningSession:
    return create_session(
        request.root,
        rig=rig.description.name,
        rig_description=rig.plain(),
        object_name=request.object_name,
        calibration_files=rig.files,
        seeds={"session": request.seed},
        settings={
            "slam": request.slam.model_dump(mode="json"),
            "grasps": _conductor_settings(rig, request).grasps,
            "markers": world.marker_settings.model_dump(mode="json"),
        },
        notes=request.notes,
        truth_mesh_ply=_ply(world),
    )


def _ply(world: SimulatedWorld) -> bytes:
    text = world.object_model.mesh.export(file_type="ply")
    assert isinstance(text, bytes)
    return text


def _conductor_settings(rig: Rig, request: SessionRequest) -> ConductorSettings:
    changes = {} if request.grasps is None else {"grasps": request.grasps}
    return rig.description.conductor.model_copy(update=changes)


def _close(session: RunningSession, outcome: SessionOutcome, overruns: int, undecodable: Mapping[str, int]) -> None:
    status: Status = "closed"
    if outcome.ending is Ending.INTERRUPTED:
        status = "interrupted"
    elif outcome.error is not None:
        status = "failed"
    counts = {"grasps": len(outcome.grasps), "overruns": overruns}
    lost = {f"undecodable {link}": number for link, number in undecodable.items()}
    session.close(status, counts=counts, data_loss=lost, problem=str(outcome.error or ""))


# --- judging -------------------------------------------------------------------------------------------------------


def evaluate_session(session: Session) -> Evaluation:
    """Judge a session's results again, against the markers in its recorded pictures and its true mesh.

    Raises:
        SessionError: there are no results, or the recording can not be read.
    """
    return _write_evaluation(session, rig_of_session(session), session.results)


def replay_session(session: Session, settings: SlamSettings, seed: int, out: Path) -> FinishedSession:
    """Understand a recorded session again from its raw bytes, and judge it.

    Args:
        session: the recording.
        settings, seed: of the estimation; with the recorded ones the results are the session's own, byte for byte.
        out: folder of the results.

    Raises:
        SessionError: the recording can not be used at all. One that was cut off is used up to the cut.
    """
    rig = rig_of_session(session)
    slam, replay = TactileSlam(settings, seed), Replay(session, build_interpreter(rig))
    grasps = [outcome for outcome in replay.outcomes() if isinstance(outcome, Grasp)]
    _estimate_rest(slam, grasps)
    finished = _judge(session, rig, slam, grasps, out)
    return replace(finished, data_loss={**session.manifest.data_loss, **replay.loss.counts()})


def recorded_slam(session: Session) -> SlamSettings:
    """The estimation's settings of a session. Raises ConfigurationError."""
    where = f"{session.folder}/session.yaml"
    return validate(session.manifest.settings.get("slam", {}), SlamSettings, where=where)


def recorded_seed(session: Session) -> int:
    """The seed a session was run with."""
    return session.manifest.seeds.get("session", 0)


def differing_files(one: Path, other: Path) -> list[str]:
    """Names of replayable result files that are not the same, byte for byte, in two folders."""

    def content(folder: Path, name: str) -> bytes | None:
        return (folder / name).read_bytes() if (folder / name).is_file() else None

    return [name for name in REPLAYABLE if content(one, name) != content(other, name)]


def _estimate_rest(slam: TactileSlam, grasps: Sequence[Grasp]) -> None:
    """Take the grasps that the estimation has not seen: all of a replay, the last one of a session cut short."""
    for grasp in grasps[slam.step_count :]:
        slam.step(grasp)


def _judge(session: Session, rig: Rig, slam: TactileSlam, grasps: Sequence[Grasp], out: Path) -> FinishedSession:
    if not grasps:
        return FinishedSession(session.folder, out, problem="no grasp was recorded")
    try:
        write_results(out, slam.finish(), grasps, slam.settings.model_dump(mode="json"))
        evaluation = _write_evaluation(session, rig, out)
        report.write(session.folder, out)
    except TactileLabError as error:
        return FinishedSession(session.folder, out, problem=str(error))
    return FinishedSession(session.folder, out, evaluation=evaluation)


def _write_evaluation(session: Session, rig: Rig, out: Path) -> Evaluation:
    stamps_s = read_results(out).trajectory.stamps_s
    truth = session_truth(session, len(stamps_s), _marker_detector(session, rig))
    write_whole(out / TRUTH_TRAJECTORY, trajectory_text(Trajectory(stamps_s, truth.world_T_object)).encode())
    evaluation = evaluate(out, truth, session.manifest.object_name)
    write_whole(out / EVALUATION, evaluation.as_text().encode())
    return evaluation


def _marker_detector(session: Session, rig: Rig) -> Look | None:
    if "camera" not in rig.files:
        return None
    camera = Camera(ReplayLink(CAMERA_LINK, ()), VirtualClock())
    where = f"{session.folder}/session.yaml"
    markers = validate(session.manifest.settings.get("markers", {}), MarkerSettings, where=where)
    tracker = ObjectTracker(load_camera(rig.files["camera"]), markers)

    def look(datagram: Datagram) -> Pose3 | None:
        sighting = tracker.object_pose(camera.receive(datagram))
        return None if sighting is None else sighting.world_T_object

    return look


# --- sweeps --------------------------------------------------------------------------------------------------------


def run_for_sweep(run: SweepRun, *, rig: str, method: str, grasps: int, root: Path) -> dict[str, Any]:
    """One session of a sweep: the content of its ``evaluation.json``. Raises TactileLabError."""
    settings = slam_settings(method, run.dimension)
    request = SessionRequest(rig, run.object_name, root, settings, run.seed, grasps)
    finished = run_session(request, NullProgress())
    if finished.evaluation is None:
        raise SessionError(finished.problem, where=str(finished.folder))
    return finished.evaluation.as_json()
