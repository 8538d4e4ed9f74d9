"""A session with a camera that streams late: its lateness is found again from the recording."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from sessions.conductor.progress import NullProgress
from sessions.recording.session import Session
from tactile_lab import rigs
from tactile_lab.workflow import running
from tactile_lab.workflow.comparing import session_clock_offset
from tactile_lab.workflow.finishing import TruthChoice

LATE_ms = 60.0


def streaming_rig(folder: Path) -> Path:
    shipped = Path(rigs.__file__).parent
    content = yaml.safe_load((shipped / "sim.yaml").read_text())
    content["calibration"] = {role: str(shipped / file) for role, file in content["calibration"].items()}
    content["conductor"] = {
        "probing": {"top": False},
        "exploration": {"policy": None},
    }  # the object is carried: what never moves is never late
    content.setdefault("simulation", {})["camera"] = {"stream_hz": 15.0, "late_ms": LATE_ms}
    path = folder / "streaming.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.long
def test_the_lateness_of_a_streaming_camera_is_found_from_the_recording(tmp_path: Path) -> None:
    rig = str(streaming_rig(tmp_path))
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
