"""What a session is told after each grasp."""

from __future__ import annotations

from tactile_lab.autonomy.slam_service import SlamService
from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.slam.tactile_slam import TactileSlam


class Nothing:
    """Stands in for a planner that plans nothing."""

    def on_estimate(self, index: int, is_placed: bool) -> None:
        """Nothing is noted."""

    def known_shape(self) -> None:
        """Nothing is known."""


def test_the_object_is_told_where_its_surface_is() -> None:
    slam = TactileSlam(seed=0)
    service = SlamService(slam, Nothing())  # type: ignore[arg-type]
    moved = []
    for known, grasp in enumerate(simulate("rectangle", 50, count=6).grasps):
        told = service.estimate(grasp, known)[-1].step.world_T_object
        assert told is not None
        assert slam.world_T_object is not None
        assert told.equals(slam.world_T_object, 1e-12)
        followed = slam._tracker.map.placed[-1].row if slam._tracker else None
        moved.append(followed is not None and abs(told.x() - followed[0]) > 1e-6)
    assert any(moved)  # the surface's contacts are smoothed with faces, beside the trajectory that is followed
