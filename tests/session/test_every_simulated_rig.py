"""A first grasp on every rig in virtual time: the object is found, grasped and followed."""

from __future__ import annotations

from pathlib import Path

import pytest

from sessions.conductor.progress import NullProgress
from sessions.conductor.session_outcome import Ending
from tactile_lab.workflow.running import SessionRequest, run_session

RIGS = (("sim-biotac", 5), ("sim-left", 5), ("sim-lite", 4))


@pytest.mark.long
@pytest.mark.parametrize(("rig", "fingers"), RIGS)
def test_the_object_is_found_and_grasped(tmp_path: Path, rig: str, fingers: int) -> None:
    finished = run_session(SessionRequest(rig, "box-10x6x4", tmp_path, method="odometry", grasps=1), NullProgress())
    assert finished.outcome is not None
    assert finished.outcome.ending is Ending.COMPLETE, finished.outcome.reason
    (grasp,) = finished.outcome.grasps
    assert fingers - 1 <= len(grasp.touching) <= fingers
