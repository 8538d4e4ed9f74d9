"""Hand odometry: how the palm has carried the object from grasp to grasp."""

from __future__ import annotations

from gtsam import Pose3

from drivers.core.errors import SessionError


class HandOdometry:
    """Accumulates the palm's motion while it holds the object; each grasp takes the motion since the last one."""

    def __init__(self) -> None:
        self._hold_start: Pose3 | None = None
        self._motion_world = Pose3()
        self._taken: list[Pose3] = []

    @property
    def is_holding(self) -> bool:
        """Whether a hold has begun and not ended."""
        return self._hold_start is not None

    @property
    def motion_world(self) -> Pose3:
        """Motion of the completed holds since the last grasp."""
        return self._motion_world

    @property
    def grasp_count(self) -> int:
        """Number of grasps without undone ones."""
        return len(self._taken)

    def begin(self, world_T_palm: Pose3) -> None:
        """From now on the object moves with the palm."""
        self._hold_start = world_T_palm

    def end(self, world_T_palm: Pose3) -> None:
        """From now on the object stays in place. Raises SessionError without a beginning."""
        self._add(world_T_palm)
        self._hold_start = None

    def take(self, world_T_palm: Pose3) -> Pose3:
        """The motion that led to a grasp; an open hold continues from here."""
        if self._hold_start is not None:
            self._add(world_T_palm)
            self._hold_start = world_T_palm
        motion, self._motion_world = self._motion_world, Pose3()
        self._taken.append(motion)
        return motion

    def undo(self) -> None:
        """Return the last grasp's motion to the next one. Raises SessionError if there is no grasp."""
        if not self._taken:
            raise SessionError("undo without a grasp", where="/marks", hint="The session events are out of order")
        self._motion_world = self._motion_world * self._taken.pop()

    def _add(self, world_T_palm: Pose3) -> None:
        if self._hold_start is None:
            raise SessionError(
                "hold_end without hold_begin", where="/marks", hint="The session events are out of order"
            )
        self._motion_world = world_T_palm * self._hold_start.inverse() * self._motion_world
