"""The conductor on a world without physics: order of the verbs, endings, failures, and what is told."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.contacts import Grasp
from sessions.conductor.conductor import Conductor
from sessions.conductor.decisions import AutonomousDecisions, Veto
from sessions.conductor.estimator import Reorientation
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.motion.grasp_plan import GraspPlan
from sessions.recording.session_events import EventKind
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.disc_sessions import Watcher, disc, run, settings
from tests.support.disc_world import DiscWorld


@dataclass(frozen=True)
class Watched:
    """A session of two grasps that has ended."""

    outcome: SessionOutcome
    world: DiscWorld
    watcher: Watcher


@pytest.fixture(scope="module")
def two_grasps() -> Watched:
    """One session that several tests look at."""
    world, watcher = DiscWorld(disc()), Watcher()
    return Watched(run(world, grasps=2, watcher=watcher), world, watcher)


def test_session_runs_to_its_end_and_touches_with_most_fingers() -> None:
    world = DiscWorld(disc())
    outcome = run(world, grasps=3)
    assert outcome.ending is Ending.COMPLETE
    assert outcome.reason == "3 grasps done"
    assert [grasp.index for grasp in outcome.grasps] == [0, 1, 2]
    assert all(len(grasp.contacts) >= 4 for grasp in outcome.grasps)


def test_contacts_lie_on_the_disc() -> None:
    target = disc()
    outcome = run(DiscWorld(target), grasps=1)
    for contact in outcome.grasps[0].contacts:
        assert np.linalg.norm(contact.point_world_m[:2] - target.centre_m) == pytest.approx(0.033, abs=0.003)


def test_marks_come_in_the_order_of_the_cycle(two_grasps: Watched) -> None:
    carried = [EventKind.HOLD_BEGIN, EventKind.HOLD_END]
    closed = [EventKind.TARE, EventKind.CLOSE_BEGIN]
    measured = [*closed, EventKind.CAPTURE_BEGIN, EventKind.CAPTURE_END, EventKind.TRUTH_FRAME]
    assert two_grasps.world.session_events == [
        *measured,
        *carried,
        *measured,
    ]  # nothing is carried after the last grasp


def test_verbs_come_in_the_order_of_the_cycle(two_grasps: Watched) -> None:
    first = ["descend", "close", "capture", "squeeze", "re-orient", "release", "lift", "estimate"]
    assert two_grasps.watcher.phases[:8] == first
    assert two_grasps.watcher.phases[8:] == ["descend", "close", "capture", "release", "lift", "estimate"]


def test_an_object_that_is_to_stay_is_let_go_where_it_is() -> None:
    world, watcher, wanted = DiscWorld(disc()), Watcher(), settings(2)
    roles = autonomous_roles(world, TactileSlam(SlamSettings(particles=200), seed=1), wanted, seed=3)  # type: ignore[arg-type]
    outcome = Conductor(world, wanted, replace(roles, decisions=Leaving(roles.estimator)), watcher).run()  # type: ignore[arg-type]
    grasp = ["descend", "close", "capture", "release", "lift", "estimate"]
    assert watcher.phases == [*grasp, *grasp]
    assert EventKind.HOLD_BEGIN not in world.session_events
    assert outcome.grasps[1].hand_motion_world.equals(Pose3(), 1e-12)


def test_hand_motion_carries_the_object_and_goes_into_the_next_grasp(two_grasps: Watched) -> None:
    motion = two_grasps.outcome.grasps[1].hand_motion_world
    moved_m = np.asarray(motion.transformFrom(np.array([*disc().centre_m, 0.0])))[:2]
    assert two_grasps.world.disc is not None
    np.testing.assert_allclose(moved_m, two_grasps.world.disc.centre_m, atol=2e-3)
    assert 0.2 < abs(motion.rotation().yaw()) < 0.8


def test_thumb_holds_against_the_fingers() -> None:
    """Fingers at the squeeze force, the thumb at the sum of what they push along the hand's axis."""
    loads: list[dict[str, float]] = []

    def listen(world: DiscWorld) -> None:
        if world.session_events and world.session_events[-1] is EventKind.HOLD_BEGIN:
            loads.append(world.perception.loads_N())

    run(DiscWorld(disc(), before_cycle=listen), grasps=2, cycle={"squeeze_force_N": 0.5, "squeeze_s": 1.0})
    held = loads[0]
    for finger in ("FF", "MF", "RF", "LF"):
        assert held[finger] == pytest.approx(0.5, abs=0.1) or held[finger] == 0.0
    pushing = sum(held[finger] > 0 for finger in ("FF", "MF", "RF", "LF"))
    assert held["TH"] == pytest.approx(0.5 * pushing, rel=0.25)


def test_object_is_brought_back_toward_the_middle() -> None:
    target = disc(0.03, 0.02)
    run(DiscWorld(target), grasps=3)
    assert np.linalg.norm(target.centre_m) < 0.02


def test_report_tells_contacts_forces_and_uncertainty(two_grasps: Watched) -> None:
    watcher = two_grasps.watcher
    assert [report.number for report in watcher.reports] == [1, 2]
    report = watcher.reports[0]
    assert report.planned == 2
    assert report.contacts >= 4
    assert all(force_N > 0.1 for force_N in report.forces_N.values())
    assert set(report.forces_N) | set(report.missing) == {"FF", "MF", "RF", "LF", "TH"}
    assert report.position_sigma_m is not None
    assert report.verdict.startswith("first")
    assert report.explored is not None
    assert 0.0 <= report.explored <= 1.0


def test_same_seed_same_session(two_grasps: Watched) -> None:
    first, second = two_grasps.outcome.grasps, run(DiscWorld(disc()), grasps=2).grasps
    np.testing.assert_array_equal(first[1].points_world_m, second[1].points_world_m)


def test_estimate_chooses_after_the_fixed_grasps() -> None:
    watcher = Watcher()
    outcome = run(DiscWorld(disc()), grasps=3, watcher=watcher, fixed_grasps=2)
    assert outcome.ending is Ending.COMPLETE
    assert [report.reason.split()[0] for report in watcher.reports[:2]] == ["alternating", "alternating"]
    assert "contacts expected" in watcher.reports[2].reason
    assert len(outcome.grasps[2].contacts) >= 3


class Leaving(AutonomousDecisions):
    """Never carries the object."""

    def on_capture(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        super().on_capture(grasp, plan)
        return Reorientation(0.0, np.zeros(2))
