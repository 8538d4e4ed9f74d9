"""The 20 motors: which joint each one pulls."""

from __future__ import annotations

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

DRIVEN_JOINTS: tuple[str, ...] = (
    *("FFJ0", "FFJ3", "FFJ4", "MFJ0", "MFJ3", "MFJ4", "RFJ0", "RFJ3", "RFJ4", "LFJ0", "LFJ3", "LFJ4", "LFJ5"),
    *("THJ1", "THJ2", "THJ3", "THJ4", "THJ5", "WRJ1", "WRJ2"),
)
"""What can be driven, one name a motor; J0 is the coupled pair J1 + J2 of a finger."""


def angles_of_driven(name: str) -> tuple[str, ...]:
    """The joints whose angles add up to the driven joint's: two for a J0, else the joint itself."""
    return (f"{name[:2]}J1", f"{name[:2]}J2") if name.endswith("J0") else (name,)


class _MotorFile(StrictModel):
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


class MotorMap:
    """Which motor pulls which joint.

    Args:
        numbers: motor number 0 to 19 of each of :data:`DRIVEN_JOINTS`.
        backwards: driven joints that a positive duty cycle turns towards smaller angles.
        where: the file, for error messages.

    Attributes:
        names: driven joint of each motor, by motor number.
        numbers: motor number of each driven joint.
        sign: +1 or -1 by motor number, shape (20,).
        from_joints: matrix, shape (20, 24), that takes joint angles to those of the driven joints by motor number.
        limits_rad: lower and upper limit by motor number, shape (20, 2), radians.

    Raises:
        ConfigurationError: a joint or a motor is missing, unknown or named twice.
    """

    def __init__(self, numbers: Mapping[str, int], backwards: tuple[str, ...] = (), where: str = "motor map") -> None:
        _check_one_to_one(numbers, backwards, where)
        self.numbers: Mapping[str, int] = dict(numbers)
        self.names: tuple[str, ...] = tuple(sorted(numbers, key=lambda name: numbers[name]))
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
            return cls({joint: motor for joint, motor in named.items() if motor >= 0}, where=str(path))
        own = strict_yaml.validate(content, _MotorFile, where=str(path))
        return cls(own.motors, own.reversed, str(path))

    def reverse(self, backwards: tuple[str, ...]) -> MotorMap:
        """The same map with other joints turning backwards, as a file of gains tells by their signs."""
        return MotorMap(self.numbers, backwards, "motor map")

    def _matrix(self) -> Array:
        matrix = np.zeros((MOTORS, len(JOINTS)))
        for motor, name in enumerate(self.names):
            matrix[motor, [JOINT_INDEX[joint] for joint in angles_of_driven(name)]] = 1.0
        return matrix


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
    hint = f"Name each of the {MOTORS} motors once: {', '.join(DRIVEN_JOINTS)}"
    if missing := sorted(set(DRIVEN_JOINTS) - set(numbers)):
        raise ConfigurationError(f"no motor for {', '.join(missing)}", where=where, hint=hint)
    if unknown := sorted((set(numbers) | set(backwards)) - set(DRIVEN_JOINTS)):
        raise ConfigurationError(f"unknown driven joints {', '.join(unknown)}", where=where, hint=hint)
    if sorted(numbers.values()) != list(range(MOTORS)):
        raise ConfigurationError(f"the motor numbers must be 0 to {MOTORS - 1}, each once", where=where, hint=hint)
