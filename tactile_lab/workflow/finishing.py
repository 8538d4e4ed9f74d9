"""Finishes a session's estimation: writes model, evaluation and report to a results folder."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from calibration.store.admission import refuse_foreign
from drivers.camera.calibration import is_opencv, load_camera
from drivers.camera.markers import MarkerSettings
from drivers.core.atomic_files import write_whole
from drivers.core.calibration_file import load_parameters
from drivers.core.configuration import validate
from drivers.core.contacts import Grasp
from drivers.core.errors import SessionError, TactileLabError
from sessions.conductor.progress import NullProgress, Progress
from sessions.conductor.session_outcome import SessionOutcome
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.recording.session import RESULTS, Session
from sessions.recording.traffic.reader import TrafficReader
from tactile_lab import report
from tactile_lab.evaluation.estimate_with_truth import Truth
from tactile_lab.evaluation.evaluation import Evaluation, evaluate
from tactile_lab.evaluation.files.plain import read_json_object
from tactile_lab.evaluation.files.properties_file import PROPERTIES, write_properties
from tactile_lab.evaluation.files.result_files import write_results
from tactile_lab.evaluation.files.results import read_results
from tactile_lab.evaluation.files.trajectory_file import Trajectory, trajectory_text
from tactile_lab.evaluation.truth.marker_truth import Basis, MarkerTruth, TruthReport
from tactile_lab.evaluation.truth.session_truth import TRUTH_TRAJECTORY, camera_datagrams, session_truth
from tactile_lab.rigs.description import OTHER_VERSION, Rig, rig_of_session
from tactile_lab.slam.tactile_slam import TactileSlam

EVALUATION = "evaluation.json"
_KNOWN = ("known.csv", "known.ply")
_MODEL = ("contour.csv", "mesh.ply", "mesh.glb", *_KNOWN, PROPERTIES)
REPLAYABLE = ("trajectory.csv", "contacts.csv", *_MODEL, "slam.json")
"""Result files that a replay of the same session reproduces, byte for byte."""
RESULT_FILES = (*REPLAYABLE, "timing.json", TRUTH_TRAJECTORY, EVALUATION, report.REPORT)
"""All files of a results folder."""


@dataclass(frozen=True)
class FinishedSession:
    """A session, or a log of contacts, with its results.

    Attributes:
        folder: the session's; the log's file.
        results: the folder of these results.
        outcome: how the autonomous part ended; None for a replay.
        evaluation: None if there was nothing to evaluate.
        data_loss: what was dropped or not recorded while the session ran, by kind.
        unread: what of the recording could not be read, in words; "" when all of it was.
        problem: why there is no evaluation, "" when there is one.
        overlooked: calibrations that were used though they should not be, in words.
        read_factor: how many times faster than at the original pace a replay read the bytes; None for no replay.
    """

    folder: Path
    results: Path
    outcome: SessionOutcome | None = None
    evaluation: Evaluation | None = None
    data_loss: Mapping[str, int] = field(default_factory=dict)
    unread: str = ""
    problem: str = ""
    overlooked: tuple[str, ...] = ()
    read_factor: float | None = None


@dataclass(frozen=True)
class TruthChoice:
    """With what the truth is computed; the session's own calibrations where none is named.

    Attributes:
        lens, markers: files of the camera's lens and of the markers.
        basis: from the corners recorded with each frame, or from the pictures again.
    """

    lens: Path | None = None
    markers: Path | None = None
    basis: Basis = "corners"

    @property
    def is_recorded(self) -> bool:
        """Whether all choices are the session's own."""
        return self.lens is None and self.markers is None and self.basis == "corners"


def evaluate_results(
    session: Session, results: Path, choice: TruthChoice
) -> tuple[Evaluation, TruthReport | None, str]:
    """Evaluate one results folder with a chosen ground truth; nothing is written.

    Returns:
        The evaluation, what the truth was worth (None without a camera), and what of the recording could not be read.

    Raises:
        ConfigurationError: a calibration cannot be used.
        SessionError: there are no results, or the recording cannot be read.
    """
    traffic, count = session.traffic(), len(read_results(results).trajectory.stamps_s)
    detector = marker_detector(session, rig_of_session(session), choice)
    truth = session_truth(session, count, detector, traffic)
    evaluation = evaluate(results, truth, session.manifest.object_name)
    return evaluation, None if detector is None else detector.report, traffic.loss.describe()


def evaluate_session(session: Session) -> FinishedSession:
    """Evaluate a session's results again, with the markers in its recorded pictures and its true mesh.

    Raises:
        SessionError: there are no results, or the recording cannot be read.
    """
    traffic, rig = session.traffic(), rig_of_session(session)
    evaluation = _write_evaluation(session, rig, session.results, traffic)
    return FinishedSession(session.folder, session.results, evaluation=evaluation, unread=traffic.loss.describe())


def has_results(session: Session) -> bool:
    """Whether the session's own results are complete; those of a killed session are not."""
    return (session.folder / RESULTS / EVALUATION).is_file()


def differing_files(one: Path, other: Path) -> list[str]:
    """Names of replayable result files that are not the same, byte for byte, in two folders.

    Settings in ``slam.json`` do not count: each version writes them by its own names.
    """
    return [name for name in REPLAYABLE if _replayed_content(one / name) != _replayed_content(other / name)]


def _replayed_content(file: Path) -> object:
    if not file.is_file():
        return None
    if file.name == "slam.json":
        with suppress(SessionError):  # damaged: compared as it is
            content = read_json_object(file, hint="")
            return {key: value for key, value in content.items() if key != "settings"}
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").digest()


def estimate_rest(slam: TactileSlam, grasps: Sequence[Grasp], progress: Progress | None = None) -> None:
    """Add the grasps that the estimation has not seen: all of a replay, or the last one of an interrupted session."""
    progress = progress or NullProgress()
    for number, grasp in enumerate(grasps[slam.step_count :], slam.step_count + 1):
        progress.phase(number, "estimate")
        slam.add_grasp(grasp)


def finish(
    session: Session,
    rig: Rig,
    slam: TactileSlam,
    grasps: Sequence[Grasp],
    out: Path,
    properties: ObjectProperties | None = None,
) -> FinishedSession:
    """Finish the estimation and write model, evaluation and report; an error is stored in the returned record.

    Args:
        session, rig, slam, grasps: what was recorded, and what estimates from it.
        out: folder of the results.
        properties: what was measured of the object's mass and friction.
    """
    remove_results(out)
    if not grasps:
        return FinishedSession(session.folder, out, problem="no grasp was recorded")
    try:
        wanted = slam.settings
        result = slam.finish()
        write_results(out, result, grasps, wanted.model_dump(mode="json"), wanted.largest_sigma_m)
        write_properties(out, properties or ObjectProperties(), result.world_T_object, result.mesh)
        evaluation = _write_evaluation(session, rig, out)
        report.write(session.folder, out)
    except TactileLabError as error:
        return FinishedSession(session.folder, out, problem=str(error))
    return FinishedSession(session.folder, out, evaluation=evaluation)


def remove_results(out: Path) -> None:
    """Remove the files of an earlier replay, so that they cannot be mistaken for those of this one."""
    try:
        for name in RESULT_FILES:
            (out / name).unlink(missing_ok=True)
    except OSError as error:
        hint = "Choose another folder for the results (--into or --out)"
        raise SessionError(f"cannot be replaced ({error.strerror})", where=str(out / name), hint=hint) from error


def _write_evaluation(session: Session, rig: Rig, out: Path, traffic: TrafficReader | None = None) -> Evaluation:
    count = len(read_results(out).trajectory.stamps_s)
    truth = session_truth(session, count, marker_detector(session, rig), traffic)
    return write_evaluation(out, truth, session.manifest.object_name)


def write_evaluation(out: Path, truth: Truth, object_name: str) -> Evaluation:
    """Evaluate the results in a folder, and write the evaluation and the truth next to them.

    Raises:
        SessionError, ShapeError: as :func:`tactile_lab.evaluation.evaluation.evaluate`.
        WriteError: the folder cannot be written.
    """
    stamps_s = read_results(out).trajectory.stamps_s
    write_whole(out / TRUTH_TRAJECTORY, trajectory_text(Trajectory(stamps_s, truth.world_T_object)))
    evaluation = evaluate(out, truth, object_name)
    write_whole(out / EVALUATION, evaluation.as_text())
    return evaluation


def marker_detector(session: Session, rig: Rig, choice: TruthChoice | None = None) -> MarkerTruth | None:
    """Finds the object in the session's camera data; None for a rig without a camera.

    Raises:
        ConfigurationError: the chosen or recorded calibration cannot be used, or is of another rig.
        SessionError: the recording cannot be read.
    """
    choice = choice or TruthChoice()
    for chosen in (choice.lens, choice.markers):
        if chosen is not None and not is_opencv(chosen):
            refuse_foreign(chosen, rig.installation)
    if "camera" not in rig.files and choice.lens is None:
        return None
    where = f"{session.folder}/session.yaml"
    recorded = session.manifest.settings.get("markers", {})
    markers = validate(recorded, MarkerSettings, where=where, hint=OTHER_VERSION)
    if choice.markers is not None:
        markers = load_parameters(choice.markers, MarkerSettings)
    lens = load_camera(choice.lens or rig.files["camera"])
    return MarkerTruth(lens, markers, camera_datagrams(session), choice.basis)
