"""The simulated motors: the joint torque of a duty cycle.

Each motor is the linear model of a direct-current motor behind a gear: torque at the joint is
``stall * duty - damping * speed``, where the damping stands for the back-EMF seen through the gear
(``stall / no-load speed``). The torque that remains is what the strain gauges on the tendons measure.
"""

from __future__ import annotations

from dataclasses import dataclass


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


_WRIST = MotorClass(10.0, 4.0, 350.0)
_KNUCKLE = MotorClass(0.5, 0.12, 217.0)  # 65 N on the tendon over about 8 mm
_DISTAL = MotorClass(0.4, 0.06, 217.0)  # pulls J1 and J2 of a finger together
_THUMB = MotorClass(0.6, 0.10, 217.0)
_THUMB_BASE = MotorClass(0.9, 0.15, 350.0)


def motor_class(driven: str) -> MotorClass:
    """The motor of one of the 20 driven joints (:data:`drivers.shadow.model.motors.DRIVEN_JOINTS`)."""
    if driven.startswith("WR"):
        return _WRIST
    if driven.startswith("TH"):
        return _THUMB_BASE if driven in ("THJ4", "THJ5") else _THUMB
    return _DISTAL if driven.endswith("J0") else _KNUCKLE


DISTAL_COUPLING = 0.6
"""J1 follows J2 by this share while nothing touches the finger (no sensor measures it for the tendon pair)."""
