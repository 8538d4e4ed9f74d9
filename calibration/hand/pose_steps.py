"""Known poses of the hand, read from it step by step while a person holds it in a jig or on a plate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from calibration.hand.joints import JointLimits, JointPose, JointPoses
from calibration.steps.guided_steps import GuidedSteps
from calibration.steps.motion_check import Check, MotionReport
from drivers.core.atomic_files import write_whole


@dataclass(frozen=True)
class PlannedPose:
    """A pose with known angles, to be read."""

    pose: JointPose

    @property
    def instruction(self) -> str:
        """What to do, in words."""
        angles = ", ".join(f"{joint} {angle:g}" for joint, angle in self.pose.known_deg.items())
        return " ".join(filter(None, ["hold the hand", self.pose.name, f"({angles} deg)"]))


@dataclass
class PoseSteps(GuidedSteps[PlannedPose, JointPose]):
    """One run through the poses.

    Attributes:
        plan: what to read.
        limits: how many poses a joint needs.
    """

    plan: Sequence[PlannedPose]
    limits: JointLimits = field(default_factory=JointLimits)
    _taken: list[tuple[int, JointPose]] = field(default_factory=list)

    @property
    def poses(self) -> tuple[JointPose, ...]:
        """All that have been read so far."""
        return tuple(found for _, found in self.observations())

    def motion(self) -> MotionReport:
        """Whether every joint has enough poses."""
        counts = Counter(joint for pose in self.poses for joint in pose.known_deg)
        joints = {joint for planned in self.plan for joint in planned.pose.known_deg}
        least = min((counts[joint] for joint in joints), default=0)
        return MotionReport((Check("poses of each joint", least, self.limits.poses, "", "read more"),))


def save_poses(path: Path, poses: Sequence[JointPose], rig: str) -> None:
    """Write poses as :func:`calibration.hand.joints.load_poses` reads them. Raises WriteError."""
    write_whole(path, yaml.safe_dump(JointPoses(rig=rig, poses=tuple(poses)).model_dump(mode="json"), sort_keys=False))
