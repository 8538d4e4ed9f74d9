"""The jobs of the command line, free of printing: run a session, judge it, replay it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
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
from sessions.session import RESULTS, RunningSession, Session, create_session
from sessions.traffic_reader import Loss
from tactile_lab import report
from tactile_lab.clock import VirtualClock
from tactile_lab.errors import ConfigurationError, InterruptionError, SessionError, TactileLabError
from tactile_lab.evaluation.evaluation import Evaluation, evaluate
from tactile_lab.evaluation.result_files import write_results
from tactile_lab.evaluation.results import read_results
from tactile_lab.evaluation.session_truth import TRUTH_TRAJECTORY, Look, session_truth
from tactile_lab.evaluation.sweep import SweepRun
from tactile_lab.evaluation.trajectory import Trajectory, trajectory_text
from tactile_lab.geometry.contacts import Grasp
from tactile_lab.rigs.build import build_bench, build_interpreter, check_calibration, simulated_world
from tactile_lab.rigs.description import OTHER_VERSION, Rig, load_rig, rig_of_session
from tactile_lab.slam import SlamSettings, TactileSlam
from tactile_lab.strict_yaml import validate

EVALUATION = "evaluation.json"
REPLAYABLE = ("trajectory.csv", "contacts.csv", "contour.csv", "mesh.ply", "mesh.glb", "slam.json")
"""Result files that a replay of the same session gives again, byte for byte."""
RESULT_FILES = (*REPLAYABLE, "timing.json", TRUTH_TRAJECTORY, EVALUATION, report.REPORT)
"""All files of a folder of results."""


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
        data_loss: what was dropped or not recorded while the session ran, by kind.
        unread: what of the recording could not be read, in words; "" when all of it was.
        problem: why there is no evaluation, "" when there is one.
    """

    folder: Path
    results: Path
    outcome: SessionOutcome | None = None
    evaluation: Evaluation | None = None
    data_loss: Mapping[str, int] = field(default_factory=dict)
    unread: str = ""
    problem: str = ""


def slam_settings(method: str, dimension: int) -> SlamSettings:
    """Settings of the estimation. Raises ConfigurationError for an unknown method or dimension."""
    return validate({"method": method, "dimension": dimension}, SlamSettings, where="options")


# --- a session -----------------------------------------------------------------------------------------------------


def run_session(request: SessionRequest, progress: Progress) -> FinishedSession:
    """Run an autonomous session on a rig, and judge it.

    Raises:
        ConfigurationError, ShapeError: the request can not be met; nothing was recorded.
        DeviceError: the rig is not ready; the session folder says so.
        SessionError: the session could not be recorded.
        InterruptionError: a person ended it at once; the session folder is kept and readable.
    """
    rig = load_rig(request.rig)
    check_calibration(rig)
    world = simulated_world(rig, request.seed, request.object_name)
    slam = TactileSlam(request.slam, request.seed)
    session = _new_session(rig, world, request)
    try:
        outcome = _record(session, rig, world, slam, request, progress)
        progress.phase(len(outcome.grasps), "model and evaluation")
        _estimate_rest(slam, outcome.grasps)
        finished = _judge(session, rig, slam, outcome.grasps, session.results)
    except KeyboardInterrupt:
        hint = f"What was recorded is kept: tactile-lab session replay {session.folder}"
        raise InterruptionError("interrupted before it was done", where=str(session.folder), hint=hint) from None
    return replace(finished, outcome=outcome, data_loss=session.manifest.data_loss)


def _record(
    session: RunningSession,
    rig: Rig,
    world: SimulatedWorld,
    slam: TactileSlam,
    request: SessionRequest,
    progress: Progress,
) -> SessionOutcome:
    """Connect, grasp until done, disconnect; the session is closed in any case."""
    with session:
        progress.phase(0, "connect")
        bench = build_bench(rig, world, session.recorder)
        bench.connect()
        settings, dimension = _conductor_settings(rig, request), request.slam.dimension
        try:
            conductor = Conductor(bench, slam, settings, seed=request.seed, dimension=dimension, progress=progress)
            outcome = conductor.run()
        finally:
            bench.close()
        _close(session, outcome, bench.counts.overruns, bench.undecodable)
    return outcome


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
    as_asked = outcome.ending in {Ending.COMPLETE, Ending.INTERRUPTED}
    counts = {"grasps": len(outcome.grasps), "overruns": overruns}
    lost = {f"undecodable {link}": number for link, number in undecodable.items()}
    session.close(status, counts=counts, data_loss=lost, problem="" if as_asked else outcome.reason)


# --- judging -------------------------------------------------------------------------------------------------------


def evaluate_session(session: Session) -> FinishedSession:
    """Judge a session's results again, against the markers in its recorded pictures and its true mesh.

    Raises:
        SessionError: there are no results, or the recording can not be read.
    """
    evaluation, loss = _write_evaluation(session, rig_of_session(session), session.results)
    return FinishedSession(session.folder, session.results, evaluation=evaluation, unread=loss.describe())


def replay_session(
    session: Session, settings: SlamSettings, seed: int, out: Path, progress: Progress | None = None
) -> FinishedSession:
    """Understand a recorded session again from its raw bytes, and judge it.

    Args:
        session: the recording.
        settings, seed: of the estimation; with the recorded ones the results are the session's own, byte for byte.
        out: folder of the results; those of an earlier replay in it are replaced.
        progress: is told which grasp is being estimated.

    Raises:
        ConfigurationError: ``out`` holds other files.
        SessionError: the recording can not be used at all. One that was cut off is used up to the cut.
    """
    _check_replaceable(session, out)
    rig = rig_of_session(session)
    slam, replay = TactileSlam(settings, seed), Replay(session, build_interpreter(rig))
    progress = progress or NullProgress()
    progress.phase(0, "read")
    grasps = [outcome for outcome in replay.outcomes() if isinstance(outcome, Grasp)]
    _estimate_rest(slam, grasps, progress)
    progress.phase(len(grasps), "model and evaluation")
    finished = _judge(session, rig, slam, grasps, out)
    unread = _unread(replay.loss, len(grasps), session.manifest.counts.get("grasps"))
    return replace(finished, data_loss=session.manifest.data_loss, unread=unread)


def _unread(loss: Loss, grasps: int, recorded: int | None) -> str:
    """What a replay could not read, in words."""
    if not loss:
        return ""
    known = "" if recorded is None else f" of {recorded}"
    return f"{loss.describe()}; {grasps}{known} grasps could be read"


def has_results(session: Session) -> bool:
    """Whether the session's own results are complete; those of a killed session are not."""
    return (session.folder / RESULTS / EVALUATION).is_file()


def _check_replaceable(session: Session, out: Path) -> None:
    """Never write over what a replay has not made."""
    if has_results(session) and out.resolve() == session.results.resolve():
        hint = "Choose another folder with --into"
        raise ConfigurationError("holds the session's own results", where=str(out), hint=hint)
    try:
        strange = sorted(entry.name for entry in out.iterdir() if entry.name not in RESULT_FILES)
    except FileNotFoundError:
        return
    except OSError as error:
        hint = "Choose another folder with --into"
        raise ConfigurationError(f"can not be used ({error.strerror})", where=str(out), hint=hint) from error
    if strange:
        hint = "Choose a new folder with --into"
        raise ConfigurationError(f"holds files that are no results, such as {strange[0]}", where=str(out), hint=hint)


def recorded_slam(session: Session) -> SlamSettings:
    """The estimation's settings of a session. Raises ConfigurationError."""
    where = f"{session.folder}/session.yaml"
    return validate(session.manifest.settings.get("slam", {}), SlamSettings, where=where, hint=OTHER_VERSION)


def recorded_seed(session: Session) -> int:
    """The seed a session was run with."""
    return session.manifest.seeds.get("session", 0)


def differing_files(one: Path, other: Path) -> list[str]:
    """Names of replayable result files that are not the same, byte for byte, in two folders."""

    def content(folder: Path, name: str) -> bytes | None:
        return (folder / name).read_bytes() if (folder / name).is_file() else None

    return [name for name in REPLAYABLE if content(one, name) != content(other, name)]


def _estimate_rest(slam: TactileSlam, grasps: Sequence[Grasp], progress: Progress | None = None) -> None:
    """Take the grasps that the estimation has not seen: all of a replay, the last one of a session cut short."""
    progress = progress or NullProgress()
    for number, grasp in enumerate(grasps[slam.step_count :], slam.step_count + 1):
        progress.phase(number, "estimate")
        slam.take(grasp)


def _judge(session: Session, rig: Rig, slam: TactileSlam, grasps: Sequence[Grasp], out: Path) -> FinishedSession:
    _remove_results(out)
    if not grasps:
        return FinishedSession(session.folder, out, problem="no grasp was recorded")
    try:
        write_results(out, slam.finish(), grasps, slam.settings.model_dump(mode="json"))
        evaluation, _ = _write_evaluation(session, rig, out)
        report.write(session.folder, out)
    except TactileLabError as error:
        return FinishedSession(session.folder, out, problem=str(error))
    return FinishedSession(session.folder, out, evaluation=evaluation)


def _remove_results(out: Path) -> None:
    """Files of an earlier replay: what this one does not write should not look like its own."""
    try:
        for name in RESULT_FILES:
            (out / name).unlink(missing_ok=True)
    except OSError as error:
        hint = "Choose another folder with --into"
        raise SessionError(f"can not be replaced ({error.strerror})", where=str(out / name), hint=hint) from error


def _write_evaluation(session: Session, rig: Rig, out: Path) -> tuple[Evaluation, Loss]:
    stamps_s, traffic = read_results(out).trajectory.stamps_s, session.traffic()
    truth = session_truth(session, len(stamps_s), _marker_detector(session, rig), traffic)
    write_whole(out / TRUTH_TRAJECTORY, trajectory_text(Trajectory(stamps_s, truth.world_T_object)).encode())
    evaluation = evaluate(out, truth, session.manifest.object_name)
    write_whole(out / EVALUATION, evaluation.as_text().encode())
    return evaluation, traffic.loss


def _marker_detector(session: Session, rig: Rig) -> Look | None:
    if "camera" not in rig.files:
        return None
    camera = Camera(ReplayLink(CAMERA_LINK, ()), VirtualClock())
    where = f"{session.folder}/session.yaml"
    recorded = session.manifest.settings.get("markers", {})
    markers = validate(recorded, MarkerSettings, where=where, hint=OTHER_VERSION)
    tracker = ObjectTracker(load_camera(rig.files["camera"]), markers)

    def look(datagram: Datagram) -> Pose3 | None:
        sighting = tracker.object_pose(camera.receive(datagram))
        return None if sighting is None else sighting.world_T_object

    return look


# --- sweeps --------------------------------------------------------------------------------------------------------


def check_sweep(rig: str, objects: Sequence[str] | None, root: Path) -> tuple[str, ...]:
    """The objects of a sweep, the whole catalogue when None; what would fail in every run fails here.

    Raises:
        ConfigurationError: no such rig, object or calibration.
        ShapeError: an object's mesh can not be used.
        SessionError: the folder of the sessions can not be made.
    """
    loaded = load_rig(rig)
    check_calibration(loaded)
    for name in objects or ():
        simulated_world(loaded, 0, name)
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        hint = "Choose another folder with --out"
        raise SessionError(f"can not be made ({error.strerror})", where=str(root), hint=hint) from error
    return tuple(objects or CATALOGUE)


def run_for_sweep(run: SweepRun, *, rig: str, method: str, grasps: int, root: Path) -> dict[str, Any]:
    """One session of a sweep: the content of its ``evaluation.json``. Raises TactileLabError."""
    settings = slam_settings(method, run.dimension)
    request = SessionRequest(rig, run.object_name, root, settings, run.seed, grasps)
    finished = run_session(request, NullProgress())
    if finished.evaluation is None:
        raise SessionError(finished.problem, where=str(finished.folder))
    return finished.evaluation.as_json()
