"""The steps of an estimation so far, and which grasps it could not place."""

from __future__ import annotations

from dataclasses import replace

from drivers.core.contacts import Grasp
from tactile_lab.slam.result import SlamStep
from tactile_lab.slam.tracking.tracker import Tracker


class StepLog:
    """One step for each grasp, in order.

    Args:
        lost_after: successive untracked grasps after which the object counts as lost.
    """

    def __init__(self, lost_after: int) -> None:
        self._lost_after = lost_after
        self._steps: list[SlamStep] = []
        self._empty_touches: list[bool] = []
        """Of each grasp, whether it was a touch alone that met nothing."""

    def __len__(self) -> int:
        return len(self._steps)

    @property
    def steps(self) -> tuple[SlamStep, ...]:
        """All of them."""
        return tuple(self._steps)

    def add(self, step: SlamStep, grasp: Grasp) -> SlamStep:
        """Keep the step of one more grasp. Returns it."""
        self._steps.append(step)
        self._empty_touches.append(not (grasp.contacts or grasp.has_closed))
        return step

    def tell_last(self, reason: str) -> SlamStep:
        """Say otherwise why the last grasp was judged as it was. Returns its step."""
        self._steps[-1] = replace(self._steps[-1], reason=reason)
        return self._steps[-1]

    def refused(self, tracker: Tracker | None) -> list[bool]:
        """Of every grasp, whether it was untracked and still has no place."""
        placed = tracker.map.placed if tracker else ()
        later = [False] * (len(self._steps) - len(placed)) + [grasp.used for grasp in placed]
        return [step.verdict == "untracked" and not used for step, used in zip(self._steps, later, strict=True)]

    def is_lost(self, tracker: Tracker | None) -> bool:
        """Whether the object is; see :mod:`tactile_lab.slam.tactile_slam`. It is without an object frame."""
        pairs = zip(self.refused(tracker), self._empty_touches, strict=True)
        refused = [each for each, empty in pairs if not empty]
        recent = refused[-self._lost_after :]
        all_recent = len(recent) == self._lost_after and all(recent)
        return tracker is None or all_recent or 2 * sum(refused) > len(refused)
