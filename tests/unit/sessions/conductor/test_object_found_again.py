"""What falls over, is pushed aside or rolls away in the middle of a session, is looked for, and the session goes on."""

from __future__ import annotations

import numpy as np
import pytest

from sessions.conductor.conductor import Conductor
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.recording.session_events import EventKind
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.joint.settings import JointSettings
from tests.support.disc_sessions import Watcher, settings
from tests.support.disc_world import Disc, DiscWorld

STANDING_m, LYING_m = 0.15, 0.06


class Falling:
    """A tall disc that is another one from its third grasp on, while the hand is high above it."""

    def __init__(self, after: Disc | None) -> None:
        self.after, self.fell = after, False

    def __call__(self, world: DiscWorld) -> None:
        away = world.event_counts[EventKind.CAPTURE_END] == 2 and world.perception.hand.palm_world_m[2] > 0.30
        if away and not self.fell:
            world.disc, self.fell = self.after, True


def run(after: Disc | None, grasps: int, watcher: Watcher) -> tuple[SessionOutcome, DiscWorld, TactileSlam]:
    world = DiscWorld(Disc(np.zeros(2), 0.03, STANDING_m), Falling(after))
    joint = JointSettings(without={"faces"})  # a disc has none
    slam = TactileSlam(SlamSettings(dimension=3, shape_model="gpis", mesh_resolution_m=0.006, joint=joint), seed=1)
    wanted = settings(grasps, probing={"highest_m": 0.2})
    roles = autonomous_roles(world, slam, wanted, seed=3, dimension=3)  # type: ignore[arg-type]
    return Conductor(world, wanted, roles, watcher).run(), world, slam  # type: ignore[arg-type]


def test_an_object_that_falls_over_is_found_and_the_estimate_begins_anew() -> None:
    watcher = Watcher()
    outcome, world, slam = run(Disc(np.array([0.07, 0.0]), 0.05, LYING_m), 5, watcher)
    assert outcome.ending is Ending.COMPLETE
    assert world.event_counts[EventKind.OBJECT_FELL] == 1
    told = next(message for message in watcher.messages if "fell over" in message)
    assert told.startswith("the object fell over after grasp 3: it is 59 mm high at ")
    assert "instead of 149 mm" in told
    fallen = [grasp.index for grasp in outcome.grasps if grasp.begins_anew]
    assert fallen == [3]
    poses = slam.finish().world_T_object
    assert [pose is None for pose in poses] == [True] * 3 + [False] * 2


@pytest.mark.parametrize(
    ("aside_m", "searched"), [((0.04, 0.02), False), pytest.param((0.11, 0.0), True, marks=pytest.mark.long)]
)
def test_an_object_that_is_pushed_aside_is_followed_and_looked_for_where_nothing_is_met(
    aside_m: tuple[float, float], searched: bool
) -> None:
    watcher = Watcher()
    outcome, world, _ = run(Disc(np.array(aside_m), 0.03, STANDING_m), 4, watcher)
    assert outcome.ending is Ending.COMPLETE
    assert (world.event_counts[EventKind.OBJECT_MOVED] > 0) is searched
    assert world.event_counts[EventKind.OBJECT_FELL] == 0
    assert any("was pushed aside after grasp" in message for message in watcher.messages) is searched
    met_m = outcome.grasps[-1].points_world_m[:, :2]
    assert len(met_m) >= 3
    assert np.linalg.norm(met_m - np.array(aside_m), axis=1).max() < 0.04


def test_an_object_that_rolls_away_ends_the_session_with_where_it_was_looked_for() -> None:
    watcher = Watcher()
    outcome, _, _ = run(None, 9, watcher)
    assert outcome.ending is Ending.OBJECT_LOST
    assert len(outcome.grasps) == 3
    assert outcome.reason.startswith("grasp 3 met nothing where ")
    assert "taps up to 1" in outcome.reason
    assert "If it rolled, fell over or was pushed away" in outcome.reason
