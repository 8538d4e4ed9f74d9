"""Slips of the object in recorded sessions."""

from __future__ import annotations

from dataclasses import replace

from drivers.core.contacts import Grasp
from sessions.perception.replay import Replay, kept_grasps
from sessions.recording.session import Session
from tactile_lab.evaluation.felt_slips import FeltSlips
from tactile_lab.evaluation.slips import Slips
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import Rig, rig_of_session
from tactile_lab.workflow.replaying import true_poses


def session_slips(session: Session) -> Slips:
    """Slips between the grasps of a session, by its camera: relative to the palm's motion, and to the odometry.

    Raises:
        SessionError, ConfigurationError: the recording, or the calibration in it, cannot be used.
    """
    rig = rig_of_session(session)
    grasps = _grasps(session, rig)
    poses = true_poses(session, len(grasps))
    felt = FeltSlips.between(grasps, poses)
    if any(grasp.motion_sigma is not None for grasp in grasps):
        grasps = _grasps(session, _by_palm(rig))
    return replace(Slips.between(grasps, poses), felt=felt)


def _grasps(session: Session, rig: Rig) -> list[Grasp]:
    return kept_grasps(Replay(session, build_interpreter(rig)).outcomes())


def _by_palm(rig: Rig) -> Rig:
    """The rig, its held objects assumed to move with the palm."""
    perception = rig.description.perception.model_copy(update={"odometry": "palm"})
    return replace(rig, description=rig.description.model_copy(update={"perception": perception}))
