"""What a session says at its end: "complete" only where the estimate is."""

from __future__ import annotations

import pytest

from sessions.conductor.session_outcome import Ending, SessionOutcome
from tactile_lab.cli.running.results import tell_outcome


@pytest.mark.parametrize(
    ("status", "told"),
    [
        ("complete", "session complete: 16 grasps done"),
        ("", "session complete: 16 grasps done"),
        ("partial", "session ended as asked: 16 grasps done; the estimate is partial, see the warnings"),
        ("ambiguous", "session ended as asked: 16 grasps done; the estimate is ambiguous, see the warnings"),
    ],
)
def test_all_grasps_done_is_complete_only_where_the_estimate_is(
    status: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    tell_outcome(SessionOutcome(Ending.COMPLETE, "16 grasps done", (), {}), status)
    assert " ".join(capsys.readouterr().err.split()) == told
