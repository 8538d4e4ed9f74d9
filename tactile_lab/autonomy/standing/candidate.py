"""What can be done next to an object that stays where it stands, and where the hand may be for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.posture import HandShape
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.standing.felt_object import FeltObject

_ROOM_m = 0.015
"""The hand keeps so far inside of the workspace, whose edge stops it: it sways when it sets off and stops."""


@dataclass(frozen=True)
class SideReach:
    """Where the palm may go.

    Attributes:
        radius_m: how far from ``centre_m``, world x, y.
        centre_m: of the workspace.
        standoff_m: how far before a grasp the hand comes down.
        row_m: x of the fingertips in the grasp frame of a closing that only touches a side: the hand goes so far aside.
    """

    radius_m: float = 0.45
    centre_m: tuple[float, float] = (0.0, 0.0)
    standoff_m: float = 0.13
    row_m: float = 0.0

    def holds(self, plan: GraspPlan, hand: HandShape) -> bool:
        """Whether the palm stays in the workspace, where the hand comes down beside the object too."""
        table = closing(plan.closing, plan.height_m, hand)
        frames = [place.frame.shifted_inside(np.array([-self.row_m, 0.0])) for place in plan.places] or [plan.frame]
        palms = np.array([(frame.pose * table.grasp_T_palm).translation() for frame in frames])[:, :2]
        back_m = self.standoff_m * approach_of(plan, hand) if table.is_sideways else np.zeros(2)
        places = np.vstack([palms, palms - back_m])
        out_m = float(np.linalg.norm(places - np.array(self.centre_m), axis=1).max())
        return out_m < self.radius_m - _ROOM_m


def approach_of(plan: GraspPlan, hand: HandShape) -> Array:
    """Direction in which a hand with its palm upright comes, world x, y, shape (2,)."""
    approach = np.array(closing(plan.closing, plan.height_m, hand).approach)
    return np.asarray(plan.frame.pose.rotation().rotate(approach))[:2]


@dataclass(frozen=True)
class StandingCandidate:
    """A grasp or a touch.

    Attributes:
        plan: what to do.
        touches: where each finger is expected to touch, shape (3,), world.
        score_m: what it would tell, less what it costs.
        depth_m: of a grasp from the side, behind the object's front.
        further_m: where else contacts are expected as the hand touches on, shape (n, 3), world.
        on_top: whether they are on the top, not on sides.
        normals: outward ones there, shape (m, 3), of what is inside; None on top and sides.
    """

    plan: GraspPlan
    touches: Mapping[str, Array]
    score_m: float
    depth_m: float = 0.0
    further_m: Array = field(default_factory=lambda: np.empty((0, 3)))
    on_top: bool = False
    normals: Array | None = None

    @property
    def touches_m(self) -> Array:
        """All expected places, shape (n, 3)."""
        return np.vstack([*self.touches.values(), self.further_m])


@dataclass
class ActionPlanner:
    """What every planner of one kind of action around one object knows.

    Attributes:
        felt: what is known of the object; who uses the planner keeps it up to date.
        hand: its form, and the shape of its fingertips.
        yaw_window_rad: of the arm.
        reach: of the palm.
        blocked: actions on whose way the hand met something.
    """

    felt: FeltObject
    hand: HandShape
    yaw_window_rad: tuple[float, float]
    reach: SideReach
    blocked: list[StandingCandidate] = field(default_factory=list, kw_only=True)
