"""Slips of the object in recorded sessions."""

from __future__ import annotations

from sessions.perception.replay import Replay, kept_grasps
from sessions.recording.session import Session
from tactile_lab.evaluation.slips import Slips
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import rig_of_session
from tactile_lab.workflow.replaying import true_poses


def session_slips(session: Session) -> Slips:
    """Slips between the grasps of a session, by its camera.

    Raises:
        SessionError, ConfigurationError: the recording, or the calibration in it, cannot be used.
    """
    grasps = kept_grasps(Replay(session, build_interpreter(rig_of_session(session))).outcomes())
    return Slips.between(grasps, true_poses(session, len(grasps)))
