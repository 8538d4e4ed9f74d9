"""The simulated motors: what a duty cycle does to a joint.

Each motor is the linear model of a direct-current motor behind a gear: torque at the joint is
``stall * duty - damping * speed``, where the damping stands for the back-EMF seen through the gear
(``stall / no-load speed``). The torque that remains is what the strain gauges on the tendons measure.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tactile_lab.geometry.contacts import FINGERS


@dataclass(frozen=True)
class MotorClass:
    """One kind of motor with its gear and pulley.

    Attributes:
        stall_Nm: joint torque at full duty and standstill.
        damping_Nms: lost torque per joint speed, newton metre seconds per radian.
        stall_current_mA: current at full duty and standstill.
    """

    stall_Nm: float
    damping_Nms: float
    stall_current_mA: float


_WRIST = MotorClass(10.0, 2.0, 1400.0)
_KNUCKLE = MotorClass(1.0, 0.10, 900.0)  # 65 N tendon over about 10 mm, and some reserve
_DISTAL = MotorClass(0.8, 0.06, 900.0)  # drives J1 + J2 of a finger
_THUMB_BASE = MotorClass(2.0, 0.12, 1400.0)  # 190 N tendon

MOTOR_CLASSES: Mapping[str, MotorClass] = {
    **{f"{finger}J0": _DISTAL for finger in FINGERS[:4]},
    **{f"{finger}{joint}": _KNUCKLE for finger in FINGERS[:4] for joint in ("J3", "J4")},
    "LFJ5": _KNUCKLE,
    **dict.fromkeys(("THJ1", "THJ2", "THJ3"), _KNUCKLE),
    **dict.fromkeys(("THJ4", "THJ5"), _THUMB_BASE),
    **dict.fromkeys(("WRJ1", "WRJ2"), _WRIST),
}
"""The motor of each of the 20 driven joints; J0 is the coupled pair J1 + J2 of a finger."""

DRIVEN_JOINTS: tuple[str, ...] = tuple(MOTOR_CLASSES)
"""Order of every per-joint motor vector inside the simulation, 20 names."""

DISTAL_COUPLING = 0.6
"""J1 follows J2 at this share while nothing touches the finger (the tendon pair has no sensor for it)."""
