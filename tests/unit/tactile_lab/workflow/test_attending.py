"""Someone watches an autonomous session that follows a policy: its decisions are recorded as without him."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from drivers.core.configuration import validate
from sessions.conductor.conductor import Conductor
from sessions.conductor.progress import NullProgress
from sessions.guided.attended import AttendedDecisions
from sessions.guided.operator import Panel, Request
from sessions.recording.recorder import Recorder
from sessions.recording.traffic import schemas
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.attending import Attendance, roles_for
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
    settings = validate(content, SessionSettings, where="test")
    world, sink = DiscWorld(Disc(np.array([0.005, -0.004]))), DecisionSink()
    world.recorder = Recorder(sink)  # type: ignore[assignment]
    slam = TactileSlam(SlamSettings(particles=200), seed=1)
    present = Attendance(Onlooker(), pace=0.0)
    roles = roles_for(present, world, slam, settings, tmp_path, seed=3, dimension=2)  # type: ignore[arg-type]
    assert isinstance(roles.decisions, AttendedDecisions)
    outcome = Conductor(world, settings, roles, NullProgress()).run()  # type: ignore[arg-type]
    assert len(outcome.grasps) == 2
    assert sink.numbers[0] == 2
