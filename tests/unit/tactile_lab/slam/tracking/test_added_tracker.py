"""A tracker that is not ours: asked as our own are, and named with its file when it fails."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drivers.core.contacts import StepSigma
from drivers.core.errors import EstimationError, TrackingError
from tactile_lab.slam.tracking.added_tracker import AddedTracker
from tactile_lab.slam.tracking.baselines.odometry_tracker import OdometryTracker
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.filter.particle_filter import PoseEstimate
from tests.support.simulated_contacts import true_map

GRASPS = true_map("rectangle", count=3)
FIRST = ContactMap(GRASPS.placed[:1], GRASPS.settings)


class Noting(OdometryTracker):
    """Odometry that notes what it is asked."""

    def __init__(self) -> None:
        super().__init__(FIRST, MotionNoise())
        self.asked: list[Any] = []

    def predict(self, motion: Any, measured: StepSigma | None = None) -> None:
        self.asked.append(("predict", measured))
        super().predict(motion, measured)

    def resample(self) -> None:
        self.asked.append("resample")

    def finish(self) -> None:
        self.asked.append("finish")


class Older(Noting):
    """As trackers were before fingertips felt motions."""

    def predict(self, motion: Any) -> None:  # type: ignore[override]
        super().predict(motion)


def added(tracker: Any) -> AddedTracker:
    return AddedTracker("mine", "mine.py", lambda: tracker)


@pytest.mark.parametrize(("make", "told"), [(Noting, StepSigma(0.001, 0.01)), (Older, None)])
def test_everything_that_is_asked_reaches_it(make: type[Noting], told: StepSigma | None) -> None:
    inner = make()
    tracker, grasp = added(inner), GRASPS.placed[1]
    tracker.predict(grasp.motion, StepSigma(0.001, 0.01))
    assert inner.asked == [("predict", told)]
    assert tracker.weigh(grasp.contacts_world) is True
    assert tracker.weigh(grasp.contacts_world.select(np.zeros(0, int))) is False
    tracker.weigh(grasp.contacts_world)
    np.testing.assert_array_equal(tracker.estimate().pose, inner.estimate().pose)
    tracker.update_shape(grasp.contacts_world, certain=True)
    assert len(tracker.map.placed) == len(tracker.refined.placed) == 2
    assert tracker.effective_count == inner.effective_count
    tracker.adopt(FIRST)
    assert inner.map is FIRST
    tracker.resample()
    tracker.finish()
    assert inner.asked[1:] == ["resample", "finish"]


class Failing(Noting):
    """Fails in each of its methods."""

    fails = False

    def __getattribute__(self, name: str) -> Any:
        if name in ("weigh", "estimate", "update_shape", "adopt", "effective_count") and type(self).fails:
            raise ZeroDivisionError("by design")
        return super().__getattribute__(name)


@pytest.mark.parametrize(
    "ask",
    [
        lambda tracker: tracker.weigh(GRASPS.placed[1].contacts_world),
        lambda tracker: tracker.estimate(),
        lambda tracker: tracker.update_shape(GRASPS.placed[1].contacts_world, certain=True),
        lambda tracker: tracker.adopt(FIRST),
        lambda tracker: tracker.effective_count,
    ],
)
def test_what_it_raises_is_named_with_its_file(monkeypatch: pytest.MonkeyPatch, ask: Any) -> None:
    tracker = added(Failing())
    monkeypatch.setattr(Failing, "fails", True)
    with pytest.raises(EstimationError, match=r"the method 'mine' raises .*ZeroDivisionError") as caught:
        ask(tracker)
    assert caught.value.where == "mine.py"
    assert "reconstruct it with another method" in caught.value.hint


def test_what_cannot_be_made_or_has_no_map_is_refused_at_the_start() -> None:
    with pytest.raises(EstimationError, match="the method 'mine' raises"):
        AddedTracker("mine", "mine.py", lambda: 1 // 0)  # type: ignore[arg-type, return-value]
    with pytest.raises(EstimationError, match=r"the method 'mine' raises .*map"):
        added(object())


def test_poses_that_are_not_finite_are_refused() -> None:
    bad = FIRST.with_rows(np.array([[np.nan, 0.0, 0.0]]))
    for spoil in ("map", "refined", "estimate"):
        inner = Noting()
        tracker = added(inner)
        if spoil == "estimate":
            inner._now = PoseEstimate(np.zeros(3), np.full((3, 3), np.inf))
            ask: Any = tracker.estimate
        else:
            inner._map = bad
            ask = lambda name=spoil, asked=tracker: getattr(asked, name)  # noqa: E731
        with pytest.raises(EstimationError, match="gives a pose that is not finite"):
            ask()


def test_our_own_errors_pass_as_they_are() -> None:
    class Refusing(Noting):
        def weigh(self, contacts: Any) -> bool:
            raise TrackingError("a contact has NaN", where="grasp 3")

    with pytest.raises(TrackingError, match="a contact has NaN"):
        added(Refusing()).weigh(GRASPS.placed[1].contacts_world)
