"""Trajectories in the text format of the TUM benchmark, which programs for comparing trajectories read."""

from __future__ import annotations

from collections.abc import Sequence

from gtsam import Pose3

from sessions.recording.traffic.foxglove import quaternion
from tactile_lab.evaluation.trajectory import Poses

HEAD = "# timestamp tx ty tz qx qy qz qw"


def tum_text(stamps_s: Sequence[float], world_T_object: Poses) -> str:
    """One line for each known pose: stamp (s), position (m), quaternion with w last."""
    known = [(stamp, pose) for stamp, pose in zip(stamps_s, world_T_object, strict=True) if pose is not None]
    return "\n".join([HEAD, *(_line(stamp, pose) for stamp, pose in known)]) + "\n"


def _line(stamp_s: float, pose: Pose3) -> str:
    turn = quaternion(pose)
    numbers = [*pose.translation(), *(turn[name] for name in ("x", "y", "z", "w"))]
    return " ".join([f"{stamp_s:.9f}", *(f"{number:.9f}" for number in numbers)])
