"""A session as files of other programs; as a contact log also for :mod:`tactile_lab.workflow.reconstructing`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from drivers.core.atomic_files import write_whole
from drivers.core.contacts import Contact
from drivers.core.errors import SessionDataError
from drivers.core.installed.extras import require_package
from sessions.exchange.archives import export_archive
from sessions.exchange.contact_log import ContactLog, MotionSigma, ObjectTruth, write_contact_log
from sessions.exchange.sample_tables import SampleTables, read_tables
from sessions.perception.replay import Replay, kept_grasps
from sessions.recording.session import Session
from tactile_lab.evaluation.files.trajectory_file import read_trajectory
from tactile_lab.evaluation.files.tum_file import tum_text
from tactile_lab.evaluation.trajectory import aligned_poses
from tactile_lab.evaluation.truth.session_truth import TRUTH_TRAJECTORY
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import rig_of_session
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.workflow.replaying import recorded_slam, true_poses


@dataclass(frozen=True)
class ExportedContacts:
    """What a contact log holds of a session.

    Attributes:
        dimension: 2 or 3.
        grasps, contacts: in the log.
        vertical: contacts whose normals have no horizontal part, such as a tap's on the top: left out in the plane.
    """

    dimension: int
    grasps: int
    contacts: int
    vertical: int


def export_contacts(session: Session, path: Path, dimension: int | None = None) -> ExportedContacts:
    """Write the grasps of a recorded session, understood from its raw bytes, as a contact log.

    The true mesh, where the session has one, is written next to it as a PLY file of the same name.

    Args:
        session: the recording.
        path: of the log.
        dimension: 2 keeps the horizontal part; None for the session's own.

    Raises:
        SessionError: the recording cannot be read, or holds no grasp.
        ConfigurationError: no grasp of the session has a contact.
        WriteError: the log cannot be written.
    """
    settings = recorded_slam(session)
    replay = Replay(session, build_interpreter(rig_of_session(session)))
    grasps = tuple(kept_grasps(replay.outcomes()))
    contacts = [contact for grasp in grasps for contact in grasp.contacts]
    if not contacts:
        raise SessionDataError("no grasp with a contact was recorded", where=str(session.folder))
    log = ContactLog(
        dimension=_dimension(dimension or settings.dimension),
        point_sigma_m=_common_point_sigma_m(contacts),
        normal_sigma_rad=float(np.median([contact.normal_sigma_rad for contact in contacts])),
        motion_sigma=_motion_sigma(settings.motion),
        grasps=grasps,
        truth=_truth(session, path),
        true_poses=true_poses(session, len(grasps)),
    )
    written = write_contact_log(path, log)
    return ExportedContacts(log.dimension, len(grasps), written, len(contacts) - written)


def _dimension(number: int) -> Literal[2, 3]:
    return 2 if number == 2 else 3


def _common_point_sigma_m(contacts: Sequence[Contact]) -> float:
    """Median over the contacts of the mean deviation per axis."""
    return float(np.median([np.sqrt(np.trace(contact.point_covariance_m2) / 3) for contact in contacts]))


def _motion_sigma(noise: MotionNoise) -> MotionSigma:
    given = noise.model_dump(include={"translation_m", "rotation_rad", "unheld", "palm_m"})
    return MotionSigma.model_validate(given)


def _truth(session: Session, path: Path) -> ObjectTruth:
    """The object's name, and a copy of its mesh next to the log."""
    name = session.manifest.object_name
    if session.truth_mesh is None:
        return ObjectTruth(name=name)
    write_whole(path.with_suffix(".ply"), _bytes(session.truth_mesh))
    return ObjectTruth(name=name, mesh=path.with_suffix(".ply").name)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise SessionDataError(f"cannot be read ({error.strerror})", where=str(path), hint="Check the file") from error


def export_csv(session: Session, folder: Path) -> int:
    """All samples as CSV tables; gives their rows. Raises SessionError."""
    from sessions.exchange.table_files import write_csv

    return write_csv(_tables(session), folder)


def export_hdf5(session: Session, path: Path) -> int:
    """All samples as one HDF5 file; gives their rows. Raises SessionError, or ConfigurationError without h5py."""
    require_package("h5py")
    from sessions.exchange.table_files import write_hdf5

    return write_hdf5(_tables(session), path)


def export_parquet(session: Session, folder: Path) -> int:
    """All samples as Parquet tables; gives their rows. Raises SessionError, or ConfigurationError without PyArrow."""
    require_package("pyarrow")
    from sessions.exchange.parquet_tables import write_parquet

    return write_parquet(_tables(session), folder)


def export_lerobot(session: Session, folder: Path) -> int:
    """The session as a LeRobotDataset of one episode; gives its frames. Raises SessionError, or ConfigurationError
    without PyArrow or OpenCV.
    """
    require_package("pyarrow")
    require_package("cv2")  # for the video
    from tactile_lab.viewers.lerobot.dataset import Label, RATE_Hz, write_lerobot
    from tactile_lab.viewers.lerobot.sampling import SampledSession

    sampled, manifest = SampledSession(session, RATE_Hz), session.manifest
    robot = f"shadow-hand-{sampled.robot.prefix.rstrip('_')}"
    task = f"touch {manifest.object_name or 'the object'}, and estimate its pose and shape"
    return write_lerobot(folder, sampled, Label(robot, task))


def export_rosbag(session: Session, folder: Path) -> int:
    """Frames, markers and all samples as a ROS 2 bag; gives its messages. Raises SessionError, or ConfigurationError
    without rosbags.
    """
    require_package("rosbags")
    from tactile_lab.viewers.recorded_items import RecordedItems
    from tactile_lab.viewers.ros_bag import write_ros_bag

    items = RecordedItems(session)
    return write_ros_bag(folder, items.robot, items, _tables(session))


def export_foxglove(session: Session, path: Path) -> int:
    """What viewers show as an MCAP file of Foxglove's types; gives its messages. Raises SessionError, or
    ConfigurationError without foxglove-sdk.
    """
    require_package("foxglove")
    from tactile_lab.viewers.foxglove_file import write_foxglove
    from tactile_lab.viewers.recorded_items import RecordedItems

    manifest = session.manifest
    facts = {"session": manifest.name, "rig": manifest.rig, "object": manifest.object_name}
    return write_foxglove(path, RecordedItems(session), facts)


def export_rerun(session: Session, path: Path) -> int:
    """What viewers show as a recording of Rerun; gives its items. Raises SessionError, or ConfigurationError without
    rerun-sdk.
    """
    require_package("rerun")
    from tactile_lab.viewers.recorded_items import RecordedItems
    from tactile_lab.viewers.rerun_file import write_rerun

    return write_rerun(path, RecordedItems(session), session.manifest.name)


def show_rerun(session: Session, address: str) -> int:
    """Send what viewers show to Rerun's viewer at an address, or to a new one; gives its items.

    Raises:
        ConfigurationError: rerun-sdk is not installed, or the viewer cannot be reached.
    """
    require_package("rerun")
    from tactile_lab.viewers.recorded_items import RecordedItems
    from tactile_lab.viewers.rerun_file import show_in_rerun

    return show_in_rerun(RecordedItems(session), session.manifest.name, address)


def _tables(session: Session) -> SampleTables:
    return read_tables(session.traffic(), build_interpreter(rig_of_session(session)))


def export_tum(session: Session, folder: Path) -> int:
    """Write the estimated trajectory, and the true one where it is known, as ``estimate.tum`` and ``truth.tum``.

    The estimate is that of the truth's object frame, tied to the estimated one at the first common grasp; without truth
    that of the estimated object frame. Gives the number of poses.

    Raises:
        SessionError: the session has no results.
        WriteError: the folder cannot be written.
    """
    trajectory, truth_file = read_trajectory(session.results / "trajectory.csv"), session.results / TRUTH_TRAJECTORY
    stamps_s, estimate = trajectory.stamps_s, trajectory.world_T_object
    texts = {"estimate.tum": tum_text(stamps_s, estimate)}
    truth = read_trajectory(truth_file).world_T_object if truth_file.is_file() else (None,) * len(stamps_s)
    if len(truth) != len(stamps_s):
        hint = "Evaluate the session again"
        raise SessionDataError(f"has {len(truth)} poses instead of {len(stamps_s)}", where=str(truth_file), hint=hint)
    if any(pose is not None for pose in truth):
        texts = {
            "estimate.tum": tum_text(stamps_s, aligned_poses(estimate, truth)),
            "truth.tum": tum_text(stamps_s, truth),
        }
    for name, text in texts.items():
        write_whole(folder / name, text)
    return sum(text.count("\n") - 1 for text in texts.values())


EXPORTS: Mapping[str, Callable[[Session, Path], int]] = {
    "csv": export_csv,
    "hdf5": export_hdf5,
    "parquet": export_parquet,
    "lerobot": export_lerobot,
    "rosbag": export_rosbag,
    "foxglove": export_foxglove,
    "rerun": export_rerun,
    "tum": export_tum,
    "archive": export_archive,
}
"""Ways to write a whole session, by name."""
UNITS = {
    "csv": "rows",
    "hdf5": "rows",
    "parquet": "rows",
    "lerobot": "frames",
    "rosbag": "messages",
    "foxglove": "messages",
    "rerun": "entries",
    "tum": "poses",
    "archive": "files",
}
"""What each of them counts."""
