"""Runs a session on a rig, autonomous or guided, records and evaluates it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from calibration.store.admission import UNCALIBRATED, admit
from drivers.core.configuration import validate
from drivers.core.errors import ConfigurationError, EstimationError, InterruptionError
from drivers.core.installed.extras import require_package
from drivers.simulation.object_names import MESH_PREFIX
from drivers.simulation.objects import ObjectModel, check_object
from sessions.conductor.conductor import Conductor
from sessions.conductor.progress import Progress
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.recording.manifest import Status
from sessions.recording.recorder import Level
from sessions.recording.running_session import RunningSession, create_session
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.rigs.build import check_calibration
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.rigs.laboratory import Laboratory, open_laboratory
from tactile_lab.rigs.recording import record_camera, stampers, traffic_settings
from tactile_lab.slam.exploration.policies import make_policy
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.workflow.attending import Attendance, roles_for, settings_for
from tactile_lab.workflow.finishing import FinishedSession, estimate_rest, finish
from tactile_lab.workflow.object_check import check_fits, marker_problem
from tactile_lab.workflow.plugging import RECORD, refused_plugins, used_plugins

ALONE = Attendance()


@dataclass(frozen=True)
class SessionRequest:
    """Options of a session.

    Attributes:
        rig: name of a built-in rig, or a rig file.
        object_name: of the simulated rig's catalogue, or ``mesh:FILE``; any name in a real laboratory.
        root: folder in which the session's folder is created.
        method, dimension: of the estimation; slips are set in the rig file.
        seed: of all random numbers.
        grasps: how many; the rig's own number when None.
        notes: the operator's.
        policy: name of the exploration policy; the rig's own way of choosing when None.
        bounding_box: feel the object's bounding box before the first grasp.
        weighings: in how many of the first grasps the held object is dragged and lifted a little, to weigh it.
        allow_uncalibrated: start even if a calibration is missing, expired, failed or of another rig; the session
            records it.
    """

    rig: str
    object_name: str
    root: Path
    method: str = "joint"
    dimension: int = 2
    seed: int = 0
    grasps: int | None = None
    notes: str = ""
    allow_uncalibrated: bool = False
    policy: str | None = None
    bounding_box: bool = False
    weighings: int = 0


def slam_settings(method: str, dimension: int, motion: MotionNoise) -> SlamSettings:
    """Settings of the estimation. Raises ConfigurationError for an unknown method or dimension."""
    wanted = {"method": method, "dimension": dimension, "motion": motion.model_dump()}
    return validate(wanted, SlamSettings, where="options")


def refuse_known_pose(method: str) -> None:
    """Refuse methods that need the truth, which a running session does not know. Raises ConfigurationError."""
    if method == "known-pose":
        hint = "Record with another method, then: tactile-lab reconstruct SESSION --method known-pose"
        raise ConfigurationError("a running session does not know the true poses", where="known-pose", hint=hint)


def check_request(request: SessionRequest) -> Rig:
    """The rig, once all that was asked for exists: method, policy, rig and object; nothing was started yet.

    Raises:
        ConfigurationError: what does not.
    """
    refuse_known_pose(request.method)
    if request.policy is not None:
        make_policy(request.policy)
    rig = load_rig(request.rig)
    if rig.description.kind == "simulated" or rig.description.emulated:
        check_fits(rig, request.object_name)
    elif request.object_name.startswith(MESH_PREFIX):
        check_object(request.object_name)
    return rig


def require_packages(rig: Rig, request: SessionRequest, attendance: Attendance = ALONE) -> None:
    """Raises ConfigurationError where an extra is missing that this session needs."""
    if rig.description.kind == "simulated" or rig.description.emulated:
        require_package("mujoco")
    if "camera" in rig.files:
        require_package("cv2")  # for the markers in its pictures
    if _conductor_settings(rig, request).exploration.policy and not attendance.guides:
        require_package("numba")  # for the rays that policies cast


def run_session(request: SessionRequest, progress: Progress, attendance: Attendance = ALONE) -> FinishedSession:
    """Run a session on a rig, and evaluate it.

    Args:
        request: its options.
        progress: receives what happens.
        attendance: who guides or watches it.

    Raises:
        ConfigurationError: the request cannot be met; nothing was recorded.
        DeviceError: the rig is not ready; the session folder says so, where there is one yet.
        SessionError: the session could not be recorded.
        InterruptionError: a person stopped it immediately; the session folder is kept and readable.
    """
    rig = check_request(request)
    check_calibration(rig)
    require_packages(rig, request, attendance)
    overlooked = admit(rig.own_calibrations, rig.installation, allow_uncalibrated=request.allow_uncalibrated)
    slam = TactileSlam(slam_settings(request.method, request.dimension, rig.description.motion), request.seed)
    progress.phase(0, "connect")
    with open_laboratory(rig, request.seed, request.object_name) as laboratory:
        rig = laboratory.rig
        session = _new_session(rig, laboratory, slam, request, overlooked)
        with _kept_when_interrupted(session):
            outcome = _record(session, rig, laboratory, slam, request, progress, attendance)
    with _kept_when_interrupted(session):
        progress.phase(len(outcome.grasps), "model and evaluation")
        finished = _evaluate(session, rig, slam, outcome)
    return replace(finished, outcome=outcome, data_loss=session.manifest.data_loss, overlooked=overlooked)


def _evaluate(session: RunningSession, rig: Rig, slam: TactileSlam, outcome: SessionOutcome) -> FinishedSession:
    """The results of all grasps; none if the estimation has failed, as it would fail again."""
    if isinstance(outcome.error, EstimationError):
        return FinishedSession(session.folder, session.results, problem=str(outcome.error))
    estimate_rest(slam, outcome.grasps)
    return finish(session, rig, slam, outcome.grasps, session.results, outcome.properties)


@contextmanager
def _kept_when_interrupted(session: RunningSession) -> Iterator[None]:
    """Raises InterruptionError with the place of the recording."""
    try:
        yield
    except KeyboardInterrupt:
        hint = f"The recording is kept: tactile-lab session replay {session.folder}"
        raise InterruptionError("interrupted before it was finished", where=str(session.folder), hint=hint) from None


def _record(
    session: RunningSession,
    rig: Rig,
    laboratory: Laboratory,
    slam: TactileSlam,
    request: SessionRequest,
    progress: Progress,
    attendance: Attendance,
) -> SessionOutcome:
    """Connect, grasp until done, disconnect; the session is closed in any case."""
    with session:
        for onlooker in attendance.onlookers:
            session.recorder.add_onlooker(onlooker)
        runtime = laboratory.runtime(session.recorder)
        runtime.report_problems_to(progress.on_message)
        settings = settings_for(_conductor_settings(rig, request), attendance)
        seed, dimension = request.seed, request.dimension
        roles = roles_for(attendance, runtime, slam, settings, session.folder, seed=seed, dimension=dimension)
        with roles.estimator:
            runtime.connect()
            record_camera(rig, session.recorder, runtime.clock.now_ns())
            try:
                for source, remark in _remarks(runtime, rig, laboratory):
                    runtime.log(Level.WARNING, source, remark)
                    progress.on_message(remark)
                outcome = Conductor(runtime, settings, roles, progress).run()
            finally:
                runtime.close()
        for remark in laboratory.remarks():
            runtime.log(Level.WARNING, "laboratory", remark)
            progress.on_message(remark)
        _close(session, outcome, runtime.counts.overruns, runtime.losses)
    return outcome


def _remarks(runtime: RigRuntime, rig: Rig, laboratory: Laboratory) -> Iterator[tuple[str, str]]:
    """What a person should know before the first grasp, and about what."""
    yield from (("plug-ins", refused) for refused in refused_plugins())
    if laboratory.target is not None:
        yield from (("object", f"the mesh of the object: {change}") for change in laboratory.target.changes)
    if problem := marker_problem(runtime, rig, laboratory.markers):
        yield "camera", problem


def _new_session(
    rig: Rig, laboratory: Laboratory, slam: TactileSlam, request: SessionRequest, overlooked: tuple[str, ...]
) -> RunningSession:
    return create_session(
        request.root,
        rig=rig.description.name,
        rig_description=rig.plain(),
        object_name=request.object_name,
        calibration_files=rig.files,
        seeds={"session": request.seed},
        settings={
            "slam": slam.settings.model_dump(mode="json"),
            "grasps": _conductor_settings(rig, request).grasps,
            **_policy(rig, request),
            "markers": laboratory.markers.model_dump(mode="json"),
            **({UNCALIBRATED: list(overlooked)} if overlooked else {}),
            **_plugins(rig, slam, request),
        },
        notes=request.notes,
        truth_mesh_ply=None if laboratory.target is None else _ply(laboratory.target),
        stampers=stampers(rig),
        traffic_settings=traffic_settings(rig),
    )


def _policy(rig: Rig, request: SessionRequest) -> dict[str, str]:
    """The policy by name, for the session's record."""
    policy = _conductor_settings(rig, request).exploration.policy
    return {} if policy is None else {"policy": policy}


def _plugins(rig: Rig, slam: TactileSlam, request: SessionRequest) -> dict[str, Any]:
    """The plug-ins that the session uses, for its record; nothing where it uses none."""
    policy = _conductor_settings(rig, request).exploration.policy
    used = used_plugins(rig.description, slam.settings, policy)
    return {RECORD: used} if used else {}


def _ply(target: ObjectModel) -> bytes:
    text = target.mesh.export(file_type="ply")
    assert isinstance(text, bytes)
    return text


def _conductor_settings(rig: Rig, request: SessionRequest) -> SessionSettings:
    settings = rig.description.conductor
    changes: dict[str, Any] = {} if request.grasps is None else {"grasps": request.grasps}
    if request.policy is not None:
        changes["exploration"] = settings.exploration.model_copy(update={"policy": request.policy})
    if request.weighings:
        changes["weighings"] = request.weighings
    if request.bounding_box:
        changes["probing"] = settings.probing.model_copy(update={"enabled": True})
    return settings.model_copy(update=changes)


def _close(session: RunningSession, outcome: SessionOutcome, overruns: int, losses: Mapping[str, int]) -> None:
    status: Status = "closed"
    if outcome.ending is Ending.INTERRUPTED:
        status = "interrupted"
    elif outcome.error is not None:
        status = "failed"
    as_asked = outcome.ending in {Ending.COMPLETE, Ending.INTERRUPTED}
    counts = {"grasps": len(outcome.grasps), "overruns": overruns}
    session.close(status, counts=counts, data_loss=losses, problem="" if as_asked else outcome.reason)
