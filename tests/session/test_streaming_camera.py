"""A session with a camera that streams late: its lateness is found again from the recording."""

from __future__ import annotations

from pathlib import Path

import pytest

from sessions.conductor.progress import NullProgress
from sessions.recording.session import Session
from tactile_lab.workflow import running
from tactile_lab.workflow.comparing import session_clock_offset
from tactile_lab.workflow.finishing import TruthChoice
from tests.support.low_rig import low_rig

LATE_ms = 60.0
STREAMING = {
    "conductor": {"exploration": {"policy": None}},  # the object is carried: what never moves is never late
    "simulation": {"camera": {"stream_hz": 15.0, "late_ms": LATE_ms}},
}


@pytest.mark.long
def test_the_lateness_of_a_streaming_camera_is_found_from_the_recording(tmp_path: Path) -> None:
    rig = str(low_rig(tmp_path, STREAMING))
    request = running.SessionRequest(rig, "box-10x6x4", tmp_path, method="odometry", grasps=2)
    finished = running.run_session(request, NullProgress())
    session = Session.open(finished.folder)
    assert finished.evaluation is not None
    assert finished.evaluation.truth.seen == 2
    assert not finished.data_loss
    found = session_clock_offset(session, TruthChoice())
    assert found.offset_ms is not None, found.reason
    assert found.sigma_ms is not None
    assert found.sigma_ms < 12.0
    assert found.offset_ms == pytest.approx(-LATE_ms, abs=min(3 * found.sigma_ms, 15.0))
