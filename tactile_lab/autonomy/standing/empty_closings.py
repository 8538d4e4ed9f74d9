"""What comes after a hand from above has closed and met nothing, though the object's top was felt.

Below something wide, a waist is not felt: links, which have no sensors, stop the fingers at what is above before the
tips are there. So the same grasp follows at another height; then a tap on the top, which tells whether the object is
still there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from drivers.core.contacts import Grasp
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.touch_patterns import TAP, TAP_HEIGHT_m

_OTHER_m = 0.008
"""Heights nearer than a fingertip's radius meet the same."""


@dataclass
class EmptyClosings:
    """Grasps from above in a row whose fingers met nothing."""

    _last: GraspPlan | None = None
    _count: int = 0

    def on_grasp(self, grasp: Grasp, plan: GraspPlan) -> None:
        """Note what a grasp or a touch from above has met."""
        if plan.only_touch and self._last is None:
            return  # what a touch elsewhere misses is no reason to close there, or to tap
        met = grasp.contacts if plan.only_touch else grasp.touching
        self._last, self._count = (None, 0) if met else (plan, self._count + 1)

    def on_blocked(self) -> None:
        """Note that the hand met something on its way down: the same height is not tried again."""
        self._count += self._last is not None

    def next(self, heights_m: Sequence[float]) -> GraspPlan | None:
        """The grasp or tap that follows; None where none has to.

        Args:
            heights_m: at which the hand has room above the object.
        """
        if (last := self._last) is None:
            return None
        others_m = [height_m for height_m in heights_m if abs(height_m - last.height_m) > _OTHER_m]
        if self._count == 1 and others_m:
            farthest_m = max(others_m, key=lambda height_m: abs(height_m - last.height_m))
            reason = "nothing was met: the same grasp at another height"
            return replace(last, height_m=farthest_m, reason=reason, tap=False)
        reason = "nothing was met: a tap where the top was felt"
        return GraspPlan(last.frame, TAP.closing, TAP_HEIGHT_m, reason, only_touch=True)
