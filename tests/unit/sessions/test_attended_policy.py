"""Someone watches an autonomous session that follows a policy: its decisions are recorded as without him."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sessions import schemas
from sessions.conductor import Conductor
from sessions.conductor_settings import ConductorSettings
from sessions.guided.attended import AttendedDecisions
from sessions.guided.operator import Panel, Request
from sessions.progress import NullProgress
from sessions.recorder import Recorder
from tactile_lab.slam import SlamSettings, TactileSlam
from tactile_lab.strict_yaml import validate
from tactile_lab.workflow.attending import Attendance, crew_for
from tests.support.disc_world import Disc, DiscWorld


class Onlooker:
    """Presses nothing."""

    attended = False

    def requests(self) -> Sequence[Request]:
        return []

    def show(self, panel: Panel) -> None:
        """Not looked at."""


class DecisionSink:
    """Keeps the numbers of the grasps that were decided about."""

    def __init__(self) -> None:
        self.numbers: list[int] = []

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        if topic == schemas.DECISION_TOPIC:
            self.numbers.append(json.loads(data)["number"])


def test_decisions_of_an_attended_session_are_recorded(tmp_path: Path) -> None:
    quick = {"landing_force_N": 0.25, "squeeze_s": 0.1, "finger_rad_s": 20.0, "travel_m_s": 1.0, "turn_rad_s": 5.0}
    content = {"grasps": 2, "cycle": quick, "fixed_grasps": 1, "exploration": {"policy": "random"}}
    settings = validate(content, ConductorSettings, where="test")
    world, sink = DiscWorld(Disc(np.array([0.005, -0.004]))), DecisionSink()
    world.recorder = Recorder(sink)  # type: ignore[assignment]
    slam = TactileSlam(SlamSettings(particles=200), seed=1)
    present = Attendance(Onlooker(), pace=0.0)
    crew = crew_for(present, world, slam, settings, tmp_path, seed=3, dimension=2)  # type: ignore[arg-type]
    assert isinstance(crew.decisions, AttendedDecisions)
    outcome = Conductor(world, settings, crew, NullProgress()).run()  # type: ignore[arg-type]
    assert len(outcome.grasps) == 2
    assert sink.numbers[0] == 2
