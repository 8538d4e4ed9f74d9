"""Joint angles of a hand that a person holds: their mean while it is still, and a refusal if it moves."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from calibration.hand.joints import JointPose
from calibration.hand.pose_steps import PlannedPose
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS
from sessions.measuring.held_hand import HeldHand

JIG = PlannedPose(JointPose(name="jig", known_deg={"FFJ3": 30.0, "FFJ2": 0.0}))


class Held:
    """What a hand's rig is to a reading: cycles, each with the joints as given for its number."""

    def __init__(self, joints_deg: Callable[[int], dict[str, float]], cycle_ns: int = 10_000_000) -> None:
        self.cycle_ns, self.cycles, self.stopped = cycle_ns, 0, False
        self._joints_deg = joints_deg
        self.perception = SimpleNamespace(hand=SimpleNamespace(joints_rad=np.zeros(len(JOINTS))))

    def stop(self) -> None:
        self.stopped = True

    def cycle(self) -> None:
        angles: Array = np.zeros(len(JOINTS))
        for joint, degrees in self._joints_deg(self.cycles).items():
            angles[JOINT_INDEX[joint]] = np.radians(degrees)
        self.cycles += 1
        self.perception.hand.joints_rad = angles


def test_angles_are_the_mean_of_half_a_second_of_a_hand_that_rests() -> None:
    held = Held(lambda cycle: {"FFJ3": 29.0 + cycle % 2, "FFJ2": -1.0, "MFJ3": 5.0 * cycle})
    reader = HeldHand(held)  # type: ignore[arg-type]
    assert held.stopped
    found = reader.measure(JIG)
    assert held.cycles == 50
    assert found.known_deg == JIG.pose.known_deg
    assert found.measured_deg == pytest.approx({"FFJ3": 29.5, "FFJ2": -1.0})


@pytest.mark.parametrize(("slip_deg", "moved"), [(1.4, False), (1.6, True)])
def test_a_joint_that_moves_meanwhile_is_named(slip_deg: float, moved: bool) -> None:
    reader = HeldHand(Held(lambda cycle: {"FFJ2": slip_deg if cycle > 40 else 0.0}))  # type: ignore[arg-type]
    if moved:
        with pytest.raises(DeviceError, match=r"FFJ2 moved by 1\.6 deg while it was read\. Hold the hand still"):
            reader.measure(JIG)
    else:
        assert reader.measure(JIG).measured_deg["FFJ2"] == pytest.approx(slip_deg * 9 / 50)
