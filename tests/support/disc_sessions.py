"""Sessions in a world of discs."""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers.core.configuration import validate
from sessions.conductor.conductor import Conductor
from sessions.conductor.progress import GraspReport, NullProgress
from sessions.conductor.session_outcome import SessionOutcome
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.disc_world import Disc, DiscWorld


class Watcher(NullProgress):
    """Keeps everything it is told."""

    def __init__(self) -> None:
        self.phases: list[str] = []
        self.reports: list[GraspReport] = []
        self.messages: list[str] = []

    def phase(self, number: int, name: str) -> None:
        self.phases.append(name)

    def grasp_done(self, report: GraspReport) -> None:
        self.reports.append(report)

    def on_message(self, message: str) -> None:
        self.messages.append(message)

    def on_interrupt(self) -> None:
        self.messages.append(f"interrupted in {self.phases[-1]}")


def settings(grasps: int = 2, **overrides: Any) -> SessionSettings:
    quick = {"landing_force_N": 0.25, "squeeze_s": 0.1, "finger_rad_s": 20.0, "travel_m_s": 1.0, "turn_rad_s": 5.0}
    quick |= {"landing_m_s": 0.05, "links_landing_m_s": 0.05}
    plain = {"exploration": {"policy": None}, "fixed_grasps": grasps, "probing": {"top": False}}
    content = {"grasps": grasps, "cycle": quick, **plain, **overrides}
    return validate(content, SessionSettings, where="test")


def run(world: DiscWorld, grasps: int = 2, watcher: Watcher | None = None, **overrides: Any) -> SessionOutcome:
    slam = TactileSlam(SlamSettings(particles=200), seed=1)
    wanted = settings(grasps, **overrides)
    roles = autonomous_roles(world, slam, wanted, seed=3)  # type: ignore[arg-type]
    return Conductor(world, wanted, roles, watcher or Watcher()).run()  # type: ignore[arg-type]


def disc(x: float = 0.005, y: float = -0.004, **shape: float) -> Disc:
    return Disc(np.array([x, y]), **shape)
