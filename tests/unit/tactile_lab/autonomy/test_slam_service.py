"""What a session is told after each grasp."""

from __future__ import annotations

import copy

import numpy as np
from gtsam import Pose3

from tactile_lab.autonomy.slam_service import KEPT_STATES, SlamMemory, SlamService
from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.slam.doubt.assessment import Assessment
from tactile_lab.slam.doubt.status import Alternative, Doubt
from tactile_lab.slam.tactile_slam import TactileSlam


class Nothing:
    """Stands in for a planner that plans nothing."""

    def on_estimate(self, index: int, is_placed: bool) -> None:
        """Nothing is noted."""

    def known_shape(self) -> None:
        """Nothing is known."""

    def assessment(self) -> Assessment:
        """A part is believed."""
        doubt = Doubt("few-grasps", "only 1 grasp could be placed", grave=False)
        return Assessment("partial", None, 0.4, (doubt,), (Alternative((0,), (Pose3(),), 0.12, 1.0, 0.03, 0.01),))

    def on_undo(self, hand_motion_world: Pose3) -> None:
        """Nothing is noted."""


def test_the_object_is_told_where_its_surface_is() -> None:
    slam = TactileSlam(seed=0)
    service = SlamService(slam, Nothing())  # type: ignore[arg-type]
    moved = []
    for known, grasp in enumerate(simulate("rectangle", 50, count=6).grasps):
        told = service.estimate(grasp, known)[-1].step.world_T_object
        assert told is not None
        assert slam.world_T_object is not None
        assert told.equals(slam.world_T_object, 1e-12)
        followed = slam._tracker.map.placed[-1].pose if slam._tracker else None
        moved.append(followed is not None and abs(told.x() - followed[0]) > 1e-6)
    assert any(moved)  # the surface's contacts are smoothed with faces, beside the trajectory that is followed


def test_what_may_be_believed_comes_with_every_estimate() -> None:
    service = SlamService(TactileSlam(seed=0), Nothing())  # type: ignore[arg-type]
    (told,) = service.estimate(simulate("rectangle", 50, count=1).grasps[0], 0)
    assert (told.trust["status"], told.trust["known_share"]) == ("partial", 0.4)
    assert told.trust["doubts"] == ["only 1 grasp could be placed"]
    assert told.trust["alternatives"] == ["grasp 1 turned by 57° and moved by 30 mm (12%)"]


def test_grasps_are_taken_back_farther_than_states_are_kept() -> None:
    grasps = simulate("rectangle", 50, count=KEPT_STATES + 3).grasps
    slam, fresh = TactileSlam(seed=4), TactileSlam(seed=4)
    memory = SlamMemory(slam)
    for grasp in grasps:
        memory.remember(grasp)
        slam.add_grasp(grasp)
    assert len(memory._states) == KEPT_STATES
    for _ in grasps[1:]:
        memory.undo()
    fresh.add_grasp(grasps[0])
    for grasp in grasps[1:3]:  # it goes on as if the others had never been
        memory.remember(grasp)
        slam.add_grasp(grasp)
        fresh.add_grasp(grasp)
    for one, other in zip(slam.trajectory, fresh.trajectory, strict=True):
        assert one is not None
        assert other is not None
        np.testing.assert_array_equal(one.matrix(), other.matrix())


def test_what_is_remembered_for_undo_is_without_the_fields() -> None:
    slam = TactileSlam(seed=0)
    memory = SlamMemory(slam)
    for grasp in simulate("rectangle", 50, count=4).grasps:
        memory.remember(grasp)
        slam.add_grasp(grasp)
        assert slam.surface is not None
    trackers = [state["_tracker"] for state in memory._states]
    maps = [one.map for tracker in trackers for one in tracker.hypotheses]
    assert maps
    assert not any("_field" in vars(contact_map) for contact_map in maps)
    copied = copy.deepcopy(slam)
    assert copied.surface is not slam.surface
    assert copied.surface is not None
    np.testing.assert_array_equal(copied.surface.contacts_m, slam.surface.contacts_m)  # type: ignore[union-attr]


def test_the_service_keeps_no_surface_that_the_session_has() -> None:
    service = SlamService(TactileSlam(seed=0), Nothing())  # type: ignore[arg-type]
    grasps = simulate("rectangle", 50, count=4).grasps
    assert len(service.estimate(grasps[0], 0)) == 1
    assert len(service.estimate(grasps[1], 0)) == 2  # the first has not reached it
    assert [told.step.index for told in service.estimate(grasps[2], 1)] == [1, 2]
    service.undo(Pose3())
    assert [told.step.index for told in service.estimate(grasps[3], 2)] == [3]
    assert len(service._estimates) == 1
