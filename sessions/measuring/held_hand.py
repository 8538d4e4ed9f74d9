"""Reads a hand that a person holds in a known pose; nothing moves by itself."""

from __future__ import annotations

import numpy as np

from calibration.hand.joints import JointPose
from calibration.hand.pose_steps import PlannedPose
from drivers.core.clock import NANOSECONDS
from drivers.core.errors import DeviceError
from drivers.shadow.model.kinematics import JOINT_INDEX
from sessions.rig_runtime.rig_runtime import RigRuntime

_READ_s = 0.5
_STILL_deg = 1.5
"""Above the noise of a joint sensor: the hand slips, or is not held."""


class HeldHand:
    """Reads known poses.

    Args:
        runtime: connected; nothing on it moves from now on.
    """

    def __init__(self, runtime: RigRuntime) -> None:
        self._runtime = runtime
        runtime.stop()

    def measure(self, planned: PlannedPose) -> JointPose:
        """The pose with the measured joint angles, averaged over half a second.

        Raises:
            DeviceError: a joint moved meanwhile, or a device failed.
        """
        joints = list(planned.pose.known_deg)
        columns, seen = [JOINT_INDEX[joint] for joint in joints], []
        for _ in range(max(2, round(_READ_s * NANOSECONDS / self._runtime.cycle_ns))):
            self._runtime.cycle()
            seen.append(self._runtime.perception.hand.joints_rad[columns])
        angles = np.degrees(seen)
        spread = np.ptp(angles, axis=0)
        if spread.max() > _STILL_deg:
            what = f"{joints[int(spread.argmax())]} moved by {spread.max():.1f} deg while it was read"
            raise DeviceError(what, where="joints", hint="Hold the hand still against the jig or the plate")
        measured = dict(zip(joints, angles.mean(axis=0).tolist(), strict=True))
        return planned.pose.model_copy(update={"measured_deg": measured})
