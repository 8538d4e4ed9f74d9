"""Estimates from recorded contacts, a contact log or a session, with any method."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from drivers.core.configuration import load, validate
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError, TactileLabError, given_by_a_person
from drivers.core.reading.bounded_files import refuse_unreachable
from sessions.conductor.progress import NullProgress, Progress
from sessions.exchange.contact_log import ContactLog, read_contact_log
from sessions.recording.listing import find_session
from tactile_lab.evaluation.estimate_with_truth import Truth
from tactile_lab.evaluation.files.mesh_io import read_mesh
from tactile_lab.evaluation.files.result_files import write_results
from tactile_lab.evaluation.prism import open_ring
from tactile_lab.slam.shape.planar.outlines import is_simple
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.finishing import FinishedSession, estimate_rest, remove_results, write_evaluation
from tactile_lab.workflow.replaying import check_replaceable, recorded_seed, recorded_slam, replay_session

_LEAST_MOTION = {"translation_m": 1e-5, "rotation_rad": 1e-4}
"""Exact motions in a log are treated as almost exact: smoothing needs some tolerance."""


@dataclass(frozen=True)
class Wishes:
    """Options of an estimation; None for those of the data or the defaults.

    Attributes:
        method: by name, see :class:`tactile_lab.slam.tracking.trackers.TrackingSettings`.
        dimension: 2 or 3.
        seed: of all that is left to chance.
        settings: a YAML file with any part of :class:`tactile_lab.slam.slam_settings.SlamSettings`.
        shape: model of the final shape by name, see :data:`tactile_lab.slam.shape.selection.models.SHAPE_MODELS`.
        largest_sigma_m: write the parts of the shape that are known so well once more, apart.
    """

    method: str | None = None
    dimension: int | None = None
    seed: int | None = None
    settings: Path | None = None
    shape: str | None = None
    largest_sigma_m: float | None = None

    def apply(self, given: dict[str, Any]) -> SlamSettings:
        """The settings: the data's, changed by the file's, changed by the options'.

        Raises:
            ConfigurationError: no such method, dimension or parameter.
        """
        from_file = {} if self.settings is None else load(self.settings)
        if not isinstance(from_file, dict):
            raise ConfigurationError("must be keys with values", where=str(self.settings), hint="Correct the file")
        options = {
            "method": self.method,
            "dimension": self.dimension,
            "shape_model": self.shape,
            "largest_sigma_m": self.largest_sigma_m,
        }
        wanted = {**given, **from_file, **{key: value for key, value in options.items() if value is not None}}
        if self.settings is None:
            return validate(wanted, SlamSettings, where="options", hint="Change the options")
        return validate(wanted, SlamSettings, where=str(self.settings))


def reconstruct(
    source: str, root: Path, wishes: Wishes, out: Path | None = None, progress: Progress | None = None
) -> FinishedSession:
    """Estimate from a log of contacts, or from a session's raw bytes, and judge the result where the truth is known.

    Args:
        source: a log's file, a session's folder, or a session's name.
        root: where sessions are looked for by name.
        wishes: how to estimate.
        out: folder of the results, those of an earlier estimation in it are replaced; None for one next to the data
            that is named after the method, and the shape model if one was chosen.
        progress: receives the number of the grasp that is being estimated.

    Raises:
        ConfigurationError: options, log, true mesh, settings or folder do not fit, or the method needs a truth that is
            not there.
        SessionError: the recording cannot be read.
    """
    path = Path(source)
    wishes.apply({})  # a mistake in the options is told before anything is read
    if path.suffix.lower() == ".csv":
        hint = f"To convert timed contacts: tactile-lab session import {source}"
        raise ConfigurationError("is a table, not a contact log", where=source, hint=hint)
    refuse_unreachable(path)
    if path.is_file() or path.suffix == ".json":
        return reconstruct_log(path, wishes, out, progress)
    session = find_session(root, source)
    own = recorded_slam(session)
    settings = wishes.apply({"method": own.method, "dimension": own.dimension, "motion": own.motion.model_dump()})
    seed = recorded_seed(session) if wishes.seed is None else wishes.seed
    return replay_session(session, settings, seed, out or session.folder / f"reconstruct-{_label(settings)}", progress)


def reconstruct_log(
    path: Path, wishes: Wishes, out: Path | None = None, progress: Progress | None = None
) -> FinishedSession:
    """As :func:`reconstruct`, for a log's file."""
    log = read_contact_log(path)
    settings, progress = wishes.apply(log_settings(log)), progress or NullProgress()
    if settings.dimension > log.dimension:
        raise ConfigurationError("a log of dimension 2 has no heights", where=str(path), hint="Use dimension 2")
    out = out or path.with_name(f"{path.stem}-{_label(settings)}")
    check_replaceable(out)
    truth = log_truth(log, path.parent)
    known_poses = log.true_poses if settings.method == "known-pose" else None
    slam = TactileSlam(settings, wishes.seed or 0, known_poses)
    estimate_rest(slam, log.grasps, progress)
    progress.phase(len(log.grasps), "model and evaluation")
    remove_results(out)
    try:
        write_results(out, slam.finish(), log.grasps, settings.model_dump(mode="json"), settings.largest_sigma_m)
        evaluation = write_evaluation(out, truth, log.truth.name if log.truth else path.stem)
    except TactileLabError as error:
        return FinishedSession(path, out, problem=str(error))
    return FinishedSession(path, out, evaluation=evaluation)


def _label(settings: SlamSettings) -> str:
    """The name that distinguishes the results of different estimations."""
    return settings.method if settings.shape_model == "auto" else f"{settings.method}-{settings.shape_model}"


def log_settings(log: ContactLog) -> dict[str, Any]:
    """What a log says about the estimation: its dimension, and how far the object strays from the hand's motion."""
    found: dict[str, Any] = {"dimension": log.dimension}
    if log.motion_sigma is not None:
        stated = log.motion_sigma.model_dump()
        found["motion"] = {key: max(value, _LEAST_MOTION.get(key, 0.0)) for key, value in stated.items()}
    return found


def log_truth(log: ContactLog, folder: Path) -> Truth:
    """The truth in a log, for evaluation. A mesh is a file beside the log.

    Raises:
        ConfigurationError: the mesh cannot be used or is elsewhere, or the polygon has no area or crosses itself.
    """
    mesh: trimesh.Trimesh | None = None
    outline_m: Array | None = None
    if log.truth is not None and log.truth.mesh is not None:
        mesh = _mesh_beside(folder, log.truth.mesh)
    if log.truth is not None and log.truth.polygon_m is not None:
        with given_by_a_person():
            outline_m = open_ring(np.array(log.truth.polygon_m))
        if not is_simple(outline_m):
            what, hint = "crosses itself", "List its corners one after the other, around the object"
            raise ConfigurationError(what, where="object.polygon_m", hint=hint)
    return Truth(log.true_poses, mesh, outline_m)


def _mesh_beside(folder: Path, name: str) -> trimesh.Trimesh:
    """The mesh of this name in a folder. Raises ConfigurationError, also for a link that leads out of it."""
    path = folder / name
    if path.resolve().parent != folder.resolve():
        what = "leads out of the log's own folder"
        raise ConfigurationError(what, where=str(path), hint="Put a copy of the mesh beside the log")
    with given_by_a_person():
        return read_mesh(path)
