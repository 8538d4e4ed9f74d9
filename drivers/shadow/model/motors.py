"""The motors, 20 in a full hand: which joint each one pulls."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.core import configuration as strict_yaml
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS, JOINT_LIMITS_rad
from drivers.shadow.protocol.palm_codec import MOTORS
from drivers.shadow.protocol.palm_images import Side

DRIVEN_JOINTS: tuple[str, ...] = (
    *("FFJ0", "FFJ3", "FFJ4", "MFJ0", "MFJ3", "MFJ4", "RFJ0", "RFJ3", "RFJ4", "LFJ0", "LFJ3", "LFJ4", "LFJ5"),
    *("THJ1", "THJ2", "THJ3", "THJ4", "THJ5", "WRJ1", "WRJ2"),
)
"""What can be driven, one name a motor; J0 is the coupled pair J1 + J2 of a finger."""


def angles_of_driven(name: str) -> tuple[str, ...]:
    """The joints whose angles add up to the driven joint's: two for a J0, else the joint itself."""
    return (f"{name[:2]}J1", f"{name[:2]}J2") if name.endswith("J0") else (name,)


class _MotorFile(StrictModel):
    side: Side | None = None
    motors: dict[str, int]
    reversed: tuple[str, ...] = ()


class _ShadowMapFile(StrictModel):
    joint_to_motor_mapping: tuple[int, ...] = Field(min_length=28, max_length=28)


_SHADOW_JOINTS = (
    *(f"{finger}J{number}" for finger in ("FF", "MF", "RF") for number in range(5)),
    *(f"LFJ{number}" for number in range(6)),
    *(f"THJ{number}" for number in range(1, 6)),
    *("WRJ1", "WRJ2"),
)
"""The 28 joints in the order of Shadow's own map files; -1 stands for one that no motor drives by itself."""


_MAP_SIDES: dict[str, Side] = {"lh_": "left", "rh_": "right"}
"""Beginnings of the names of Shadow's motor maps."""

_EITHER_SIDE = "lite"
"""In the name of a map for both sides: Lite hands have none beginning with lh_, and left ones name rh_lite_v1."""


class MotorMap:
    """Which motor pulls which joint.

    Args:
        numbers: motor number 0 to 19 of each driven joint that the hand has, of :data:`DRIVEN_JOINTS`.
        backwards: driven joints that a positive duty cycle turns towards smaller angles.
        where: the file, for error messages.
        stated_side: the side of the hand, if the file states it.

    Attributes:
        names: driven joint of each motor, by motor number; empty for a place without a motor.
        numbers: motor number of each driven joint.
        driven: the driven joints that the hand has, in the order of :data:`DRIVEN_JOINTS`.
        stated_side: as given.
        is_fitted: whether there is a motor, by motor number, shape (20,).
        sign: +1 or -1 by motor number, shape (20,).
        from_joints: matrix, shape (20, 24), that takes joint angles to those of the driven joints by motor number.
        limits_rad: lower and upper limit by motor number, shape (20, 2), radians.

    Raises:
        ConfigurationError: a joint or a motor is missing, unknown or named twice.
    """

    def __init__(
        self,
        numbers: Mapping[str, int],
        backwards: tuple[str, ...] = (),
        where: str = "motor map",
        stated_side: Side | None = None,
    ) -> None:
        _check_one_to_one(numbers, backwards, where)
        self.numbers: Mapping[str, int] = dict(numbers)
        self.driven: tuple[str, ...] = tuple(name for name in DRIVEN_JOINTS if name in numbers)
        self.stated_side = stated_side
        by_motor = {motor: name for name, motor in numbers.items()}
        self.names: tuple[str, ...] = tuple(by_motor.get(motor, "") for motor in range(MOTORS))
        self.is_fitted: NDArray[np.bool_] = np.array([bool(name) for name in self.names])
        self.sign: NDArray[np.int64] = np.array([-1 if name in backwards else 1 for name in self.names])
        self.from_joints = self._matrix()
        self.limits_rad: Array = self.from_joints @ JOINT_LIMITS_rad

    @classmethod
    def load(cls, path: Path | None = None) -> MotorMap:
        """Read a motor map.

        Args:
            path: the hand's file, in our format or in that of Shadow's ``default_mappings``; None for the simulated
                hand's, whose numbers are those of Shadow's rh_E_v3.

        Raises:
            ConfigurationError: the file cannot be used.
        """
        if path is None:
            packaged = resources.files("tactile_lab") / "rigs" / "calibrations" / "simulated-hand" / "motors.yaml"
            with resources.as_file(packaged) as file:
                return cls.load(file)
        content = strict_yaml.load(path)
        if isinstance(content, dict) and "joint_to_motor_mapping" in content:
            listed = strict_yaml.validate(content, _ShadowMapFile, where=str(path)).joint_to_motor_mapping
            named = dict(zip(_SHADOW_JOINTS, listed, strict=True))
            numbers = {joint: motor for joint, motor in named.items() if motor >= 0}
            return cls(numbers, where=str(path), stated_side=_side_by_name(path.name))
        if isinstance(content, dict) and "joint_to_muscle_mapping" in content:
            hint = "This program drives hands with motors only"
            raise ConfigurationError("is the map of a hand with muscles", where=str(path), hint=hint)
        own = strict_yaml.validate(content, _MotorFile, where=str(path))
        return cls(own.motors, own.reversed, str(path), own.side)

    def reverse(self, backwards: tuple[str, ...]) -> MotorMap:
        """The same map with other joints turning backwards, by the signs in a file of gains."""
        own = tuple(name for name in backwards if name in self.numbers)
        return MotorMap(self.numbers, own, "motor map", self.stated_side)

    def _matrix(self) -> Array:
        matrix = np.zeros((MOTORS, len(JOINTS)))
        for name, motor in self.numbers.items():
            matrix[motor, [JOINT_INDEX[joint] for joint in angles_of_driven(name)]] = 1.0
        return matrix


def _side_by_name(name: str) -> Side | None:
    return None if _EITHER_SIDE in name else _MAP_SIDES.get(name[:3])


def drivable_range_rad(motors: MotorMap, calibration: JointCalibration, margin: float) -> Array:
    """Angles that driven joints may be sent to: within published limits and what the hand's own calibration covers.

    Args:
        motors: which motor pulls which joint.
        calibration: of the hand's joints.
        margin: how far beyond its calibrated angles a joint may go, as a share of their span.

    Returns:
        Lower and upper limit by motor number, shape (20, 2), radians. A joint whose calibration lies beside the
        published limits altogether has those.
    """
    own = motors.from_joints @ calibration.range_rad
    own = own + margin * np.diff(own, axis=1) * np.array([-1.0, 1.0])
    low, high = np.maximum(own[:, 0], motors.limits_rad[:, 0]), np.minimum(own[:, 1], motors.limits_rad[:, 1])
    common = np.column_stack([low, high])
    return np.asarray(np.where((low <= high)[:, None], common, motors.limits_rad))


def _check_one_to_one(numbers: Mapping[str, int], backwards: tuple[str, ...], where: str) -> None:
    hint = f"Name each of the hand's motors once: {', '.join(DRIVEN_JOINTS)}"
    if unknown := sorted((set(numbers) | set(backwards)) - set(DRIVEN_JOINTS)):
        raise ConfigurationError(f"unknown driven joints {', '.join(unknown)}", where=where, hint=hint)
    if missing := _missing_motors(set(numbers)):
        raise ConfigurationError(f"no motor for {', '.join(missing)}", where=where, hint=hint)
    if backwards_only := sorted(set(backwards) - set(numbers)):
        raise ConfigurationError(f"reverses {', '.join(backwards_only)} without a motor", where=where, hint=hint)
    times = Counter(numbers.values())
    if wrong := [
        f"{name} {motor}" for name, motor in numbers.items() if motor not in range(MOTORS) or times[motor] > 1
    ]:
        what = f"the motor numbers must be among 0 to {MOTORS - 1}, each once, not {', '.join(wrong)}"
        raise ConfigurationError(what, where=where, hint=hint)


def _missing_motors(named: set[str]) -> list[str]:
    """Motors that a hand with those named must have too.

    A finger is there as a whole or not at all. Lite hands have neither wrist nor THJ3, and never a little finger.
    """
    of_finger = {
        finger: {name for name in DRIVEN_JOINTS if name.startswith(finger)} for finger in ("FF", "MF", "RF", "LF")
    }
    groups = [*of_finger.values(), {"WRJ1", "WRJ2"}]
    if named & of_finger["LF"]:
        return sorted(set(DRIVEN_JOINTS) - named)
    needed = {"THJ1", "THJ2", "THJ4", "THJ5"}.union(*(group for group in groups if group & named))
    if not any(group & named for group in of_finger.values()):
        needed |= of_finger["FF"]
    return sorted(needed - named)
