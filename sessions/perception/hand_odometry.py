"""Hand odometry: how the hand has moved the object from grasp to grasp."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import StepSigma
from drivers.core.errors import SessionDataError
from drivers.core.poses import planar, spatial
from sessions.perception.carrying.carry import Carry


@dataclass(frozen=True)
class HandMotion:
    """A motion of the object by the hand.

    Attributes:
        world: new ``world_T_object`` = world * old one.
        sigma: its standard deviations; None where the object is only assumed to have moved with the palm.
    """

    world: Pose3 = field(default_factory=Pose3)
    sigma: StepSigma | None = None

    def then(self, later: HandMotion) -> HandMotion:
        """Both motions, this one first."""
        return HandMotion(later.world * self.world, _joined(self, later))

    @property
    def is_rest(self) -> bool:
        """Whether the hand has not moved the object."""
        return self.sigma is None and self.world.equals(Pose3(), 0.0)


def _joined(first: HandMotion, later: HandMotion) -> StepSigma | None:
    if first.is_rest or later.is_rest:
        return later.sigma if first.is_rest else first.sigma
    if first.sigma is None or later.sigma is None:
        return None
    translation_m = float(np.hypot(first.sigma.translation_m, later.sigma.translation_m))
    return StepSigma(translation_m, float(np.hypot(first.sigma.rotation_rad, later.sigma.rotation_rad)))


class HandOdometry:
    """Accumulates the object's motion while it is held; each grasp takes the motion since the last one."""

    def __init__(self) -> None:
        self._hold_start: Pose3 | None = None
        self._motion = HandMotion()
        self._taken: list[HandMotion] = []

    @property
    def is_holding(self) -> bool:
        """Whether a hold has begun and not ended."""
        return self._hold_start is not None

    @property
    def motion(self) -> HandMotion:
        """In the completed holds since the last grasp."""
        return self._motion

    @property
    def grasp_count(self) -> int:
        """Number of grasps without undone ones."""
        return len(self._taken)

    def begin(self, world_T_palm: Pose3) -> None:
        """From now on the object moves with the palm."""
        self._hold_start = world_T_palm

    def end(self, world_T_palm: Pose3, carry: Carry | None = None) -> None:
        """From now on the object stays in place.

        Args:
            world_T_palm: now.
            carry: what the fingertips felt meanwhile; None: the object is assumed to have moved with the palm.

        Raises:
            SessionError: there was no beginning.
        """
        self._add(world_T_palm, carry)
        self._hold_start = None

    def take(self, world_T_palm: Pose3, carry: Carry | None = None) -> HandMotion:
        """The motion that led to a grasp; an open hold, in which that carry was felt, continues from here."""
        if self._hold_start is not None:
            self._add(world_T_palm, carry)
            self._hold_start = world_T_palm
        motion, self._motion = self._motion, HandMotion()
        self._taken.append(motion)
        return motion

    def undo(self) -> None:
        """Return the last grasp's motion to the next one. Raises SessionError if there is no grasp."""
        if not self._taken:
            raise SessionDataError("undo without a grasp", where="/marks", hint="The session events are out of order")
        self._motion = self._taken.pop().then(self._motion)

    def _add(self, world_T_palm: Pose3, carry: Carry | None) -> None:
        if self._hold_start is None:
            raise SessionDataError(
                "hold_end without hold_begin", where="/marks", hint="The session events are out of order"
            )
        palm_motion = world_T_palm * self._hold_start.inverse()
        self._motion = self._motion.then(_hand_motion(palm_motion, carry))


def _hand_motion(palm_motion: Pose3, carry: Carry | None) -> HandMotion:
    """The object's motion: on the table as it was felt, otherwise as the palm's."""
    if carry is None:
        return HandMotion(palm_motion)
    slip = spatial(carry.motion * planar(palm_motion).inverse())
    return HandMotion(slip * palm_motion, carry.sigma)
