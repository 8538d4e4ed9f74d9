"""How the palm has carried the object from grasp to grasp."""

from __future__ import annotations

from gtsam import Pose3

from drivers.core.errors import SessionError


class HandOdometry:
    """Adds up the palm's motion while it holds the object; each grasp takes what has come together before it."""

    def __init__(self) -> None:
        self._hold_start: Pose3 | None = None
        self._motion_world = Pose3()
        self._taken: list[Pose3] = []

    @property
    def is_holding(self) -> bool:
        """A hold has begun and not ended."""
        return self._hold_start is not None

    @property
    def motion_world(self) -> Pose3:
        """Since the last grasp, as far as that is complete."""
        return self._motion_world

    @property
    def grasp_count(self) -> int:
        """Grasps that count."""
        return len(self._taken)

    def begin(self, world_T_palm: Pose3) -> None:
        """From here on the object moves with the palm."""
        self._hold_start = world_T_palm

    def end(self, world_T_palm: Pose3) -> None:
        """From here on the object stays where it is. Raises SessionError without a beginning."""
        self._add(world_T_palm)
        self._hold_start = None

    def take(self, world_T_palm: Pose3) -> Pose3:
        """The motion that led to a grasp; a hold that has not ended goes on from here."""
        if self._hold_start is not None:
            self._add(world_T_palm)
            self._hold_start = world_T_palm
        motion, self._motion_world = self._motion_world, Pose3()
        self._taken.append(motion)
        return motion

    def undo(self) -> None:
        """Give the last grasp's motion back to the next one. Raises SessionError when there is none."""
        if not self._taken:
            raise SessionError("undo without a grasp", where="/marks", hint="The marks are out of order")
        self._motion_world = self._motion_world * self._taken.pop()

    def _add(self, world_T_palm: Pose3) -> None:
        if self._hold_start is None:
            raise SessionError("hold_end without hold_begin", where="/marks", hint="The marks are out of order")
        self._motion_world = world_T_palm * self._hold_start.inverse() * self._motion_world
