"""A session of an experiment that a person interrupts is no run of it: it would be kept, and never be made again."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from sessions.conductor.conductor import Conductor
from sessions.conductor.session_outcome import Ending, SessionOutcome
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runs.carried_objects import watch_carries
from tactile_lab.experiments.studies.everyday_sessions import explore_everyday
from tactile_lab.experiments.thesis.rig_sessions import record

SETTING = (("object", "cube-6"), ("pose", "standing"), ("dimension", 2), ("grasps", 1))


@pytest.mark.parametrize(
    "session",
    [
        lambda: explore_everyday(Cell(SETTING, 51)),
        lambda: record("cube-6", 51, 2, 1),
        lambda: watch_carries("cube-6", 51, 1),
    ],
    ids=["everyday object", "recorded", "carried"],
)
def test_an_interrupted_session_is_no_run(monkeypatch: pytest.MonkeyPatch, session: Callable[[], object]) -> None:
    interrupted = SessionOutcome(Ending.INTERRUPTED, "interrupted by the operator", (), {})
    monkeypatch.setattr(Conductor, "run", lambda self: interrupted)
    with pytest.raises(KeyboardInterrupt):
        session()
