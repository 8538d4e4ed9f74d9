"""What is taller than the palm passes over: felt gently, grasped from the side, left where it stands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh

from drivers.simulation.settings import ObjectStart
from drivers.simulation.world import SimulatedWorld
from sessions.conductor.conductor import Conductor
from sessions.conductor.progress import NullProgress
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.motion.probing.box_prober import ProbingSettings
from sessions.recording.recorder import Recorder
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.rigs.build import build_runtime
from tactile_lab.rigs.description import load_rig
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam

SIZE_m = (0.050, 0.085, 0.150)
TURN_rad = 0.3

pytestmark = pytest.mark.long


class Forgetful:
    """Where nothing is kept that was written."""

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        pass


class PhaseWatch(NullProgress):
    """Knows what the session is doing."""

    name = ""

    def phase(self, number: int, name: str) -> None:
        self.name = name


@dataclass(frozen=True)
class TallSession:
    """What came of a session, what the fingertips really pressed with before the hand closed, and how far it moved."""

    outcome: SessionOutcome
    pressed_N: float
    moved_m: float


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> TallSession:
    """One grasp of an upright box of 50 x 85 x 150 mm."""
    file: Path = tmp_path_factory.mktemp("mesh") / "carton.ply"
    trimesh.creation.box(SIZE_m).export(file)
    rig = load_rig("sim")
    start = ObjectStart(x_m=0.008, y_m=-0.005, yaw_rad=TURN_rad)
    simulation = rig.description.simulation.model_copy(update={"object": f"mesh:{file}", "start": start})
    world, watch = SimulatedWorld(simulation, 0), PhaseWatch()
    runtime = build_runtime(rig, world, Recorder(Forgetful()))
    near = ProbingSettings(search_m=0.08, highest_m=0.17)
    settings, slam = SessionSettings(grasps=1, probing=near), TactileSlam(SlamSettings(dimension=3), 0)
    pressed_N, cycle, before = 0.0, runtime.cycle, world.truth().world_T_object

    def watched_cycle() -> None:
        nonlocal pressed_N
        cycle()
        if watch.name in ("bounding box", "descend"):
            pressed_N = max([pressed_N, *(contact.force_N for contact in world.truth().contacts)])

    runtime.cycle = watched_cycle  # type: ignore[method-assign]
    runtime.connect()
    try:
        roles = autonomous_roles(runtime, slam, settings, dimension=3)
        outcome = Conductor(runtime, settings, roles, watch).run()
        after = world.truth().world_T_object
    finally:
        runtime.close()
    return TallSession(outcome, pressed_N, float(np.linalg.norm(after.translation() - before.translation())))


def test_session_completes_with_thumb_and_fingers_on_it(session: TallSession) -> None:
    assert session.outcome.ending is Ending.COMPLETE
    (grasp,) = session.outcome.grasps
    assert len(grasp.touching) >= 4
    assert "TH" in grasp.touching


def test_object_is_touched_gently_and_left_standing(session: TallSession) -> None:
    assert 0.2 < session.pressed_N < 1.0
    assert session.moved_m < 0.002


def test_contacts_of_the_survey_and_the_grasp_lie_on_its_faces(session: TallSession) -> None:
    (grasp,) = session.outcome.grasps
    assert sum(contact.probed for contact in grasp.contacts) >= 6
    c, s = np.cos(TURN_rad), np.sin(TURN_rad)
    inside = (grasp.points_world_m - [0.008, -0.005, 0.0]) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    inside[:, 2] -= SIZE_m[2] / 2
    off_m = np.abs(np.abs(inside) - np.array(SIZE_m) / 2).min(axis=1)
    assert np.median(off_m) < 0.0025
    assert off_m.max() < 0.006
