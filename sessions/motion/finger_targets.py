"""The targets of the fingers' motors, and how far the joints are from them."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.core.contacts import FINGERS
from drivers.shadow.closing.closing import Closing
from drivers.shadow.model.kinematics import JOINTS
from sessions.rig_runtime.rig_runtime import RigRuntime


class FingerTargets:
    """Targets of the motors of fingers and wrist, by their names, radians; the wrist stays straight.

    Args:
        runtime: of the hand.
    """

    def __init__(self, runtime: RigRuntime) -> None:
        self._runtime = runtime
        self.targets_rad: dict[str, float] = {}
        """The last targets; empty before the first."""

    def on(
        self, closing: Closing, progress: Mapping[str, float], aside_rad: Mapping[str, float]
    ) -> Mapping[str, float]:
        """The targets at a progress of each finger on a closing's paths, which are the last ones from now on.

        Args:
            closing: its paths.
            progress: of each finger.
            aside_rad: additional angles of single motors.
        """
        targets = self._straight_wrist | _angles(closing, progress)
        for motor, angle in aside_rad.items():
            targets[motor] += angle
        self.targets_rad = targets
        return targets

    def forget(self) -> None:
        """The fingers were moved otherwise: the next motion starts where they are."""
        self.targets_rad = {}

    def present(self, closing: Closing, progress: Mapping[str, float]) -> dict[str, float]:
        """The last targets; before the first, the angles of the motors that ``progress`` will command."""
        if self.targets_rad:
            return self.targets_rad
        measured = self._measured_rad()
        return {name: measured[name] for name in (*self._straight_wrist, *_angles(closing, progress))}

    def travel_rad(self, closing: Closing, progress: Mapping[str, float]) -> float:
        """The longest way of a finger's joint to the targets at ``progress``."""
        start = self.present(closing, progress)
        return max(abs(angle - start[name]) for name, angle in _angles(closing, progress).items())

    def bent(self, least_rad: float) -> tuple[str, ...]:
        """Fingers with a joint farther off its target than this."""
        measured = self._measured_rad()
        off = [name for name, angle in self.targets_rad.items() if abs(measured[name] - angle) > least_rad]
        fingers = self._runtime.perception.form.fingers
        return tuple(finger for finger in fingers if any(name.startswith(finger) for name in off))

    @property
    def _straight_wrist(self) -> dict[str, float]:
        """Targets of the wrist's motors, where the hand has them."""
        return {name: 0.0 for name in self._runtime.perception.form.driven if name.startswith("WR")}

    def _measured_rad(self) -> dict[str, float]:
        """Present joint angles, and the sums of the coupled ones."""
        joints = dict(zip(JOINTS, self._runtime.perception.hand.joints_rad.tolist(), strict=True))
        return joints | {f"{finger}J0": joints[f"{finger}J1"] + joints[f"{finger}J2"] for finger in FINGERS[:4]}


def _angles(closing: Closing, progress: Mapping[str, float]) -> dict[str, float]:
    """Angles of the fingers' motors at a progress on a closing's paths."""
    return {
        name: angle for finger in closing.fingers for name, angle in closing.joints(finger, progress[finger]).items()
    }
