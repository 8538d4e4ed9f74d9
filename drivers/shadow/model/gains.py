"""Gains of the host's position control: our own table, and the file that Shadow delivers with each hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from drivers.core import configuration as strict_yaml
from drivers.core.configuration import StrictModel
from drivers.core.errors import ConfigurationError
from drivers.shadow.model.motors import DRIVEN_JOINTS
from drivers.shadow.protocol.motor_data import MAX_TORQUE
from drivers.shadow.protocol.palm_images import Side

_MOST_DEADBAND_RAD = 0.1
"""Published hands state 0.003 and 0.004; with a typing error in it a joint would not be held at all."""

_SIDES: Mapping[str, Side] = {"lh_": "left", "rh_": "right"}


class JointGains(StrictModel):
    """Host position control of one joint, in counts of the demand in use: duty cycle (of 1023) or torque.

    Attributes:
        pwm_per_rad: counts per radian of error.
        deadband_rad: errors within it give no demand; larger ones count from its edge.
        max_pwm: largest demand, counts; 0 for a joint that is not to be driven.
        damping: counts per radian per second of the joint's speed, against it.
        integral: counts per radian and second of error.
        integral_max: largest demand that the integral makes up, counts.
    """

    pwm_per_rad: float = Field(ge=0.0)
    deadband_rad: float = Field(ge=0.0, default=0.003)
    max_pwm: float = Field(ge=0.0, le=MAX_TORQUE, default=600.0)
    damping: float = Field(default=0.0, ge=0.0)
    integral: float = Field(default=0.0, ge=0.0)
    integral_max: float = Field(default=0.0, ge=0.0)

    @property
    def is_driven(self) -> bool:
        """Whether the joint is to be driven."""
        return self.max_pwm > 0.0


class GainTable(StrictModel):
    """Gains by class of joint, with exceptions by name.

    The defaults are the magnitudes that Shadow delivers with hand 378 for control of the duty cycle, without damping.

    Attributes:
        coupled: J0 of the fingers.
        flexion: J3 of the fingers.
        spread: J4 of the fingers and LFJ5.
        thumb: THJ1 to THJ5.
        wrist: WRJ1 and WRJ2.
        exceptions: gains of single driven joints.
    """

    coupled: JointGains = JointGains(pwm_per_rad=4500.0)
    flexion: JointGains = JointGains(pwm_per_rad=6000.0)
    spread: JointGains = JointGains(pwm_per_rad=7100.0, deadband_rad=0.004, max_pwm=500.0)
    thumb: JointGains = JointGains(pwm_per_rad=5500.0, max_pwm=500.0)
    wrist: JointGains = JointGains(pwm_per_rad=9000.0, deadband_rad=0.004)
    exceptions: dict[str, JointGains] = Field(default_factory=dict)

    def of(self, name: str) -> JointGains:
        """Gains of one driven joint."""
        if name in self.exceptions:
            return self.exceptions[name]
        if name.startswith("TH"):
            return self.thumb
        if name.startswith("WR"):
            return self.wrist
        return {"J0": self.coupled, "J3": self.flexion}.get(name[2:], self.spread)


@dataclass(frozen=True)
class PublishedGains:
    """What Shadow's file says.

    Attributes:
        table: gains of every driven joint, as magnitudes.
        backwards: joints whose gains are negative: a positive demand turns them towards smaller angles.
        told_side: side of the hand by the names of its joints, such as ``lh_FFJ0``; None where they tell none.
    """

    table: GainTable
    backwards: tuple[str, ...]
    told_side: Side | None = None


class _Pid(StrictModel):
    """Terms of one controller; ``deadband`` and ``friction_deadband`` belong to friction tables, which are empty."""

    p: float
    i: float
    d: float
    i_clamp: float = Field(ge=0.0)
    max_force: float = Field(ge=0.0, le=MAX_TORQUE)
    position_deadband: float = Field(ge=0.0, le=_MOST_DEADBAND_RAD)
    deadband: float = 0.0
    friction_deadband: float = 0.0


class _Controller(StrictModel):
    joint: str
    pid: _Pid
    type: str = "sr_mechanism_controllers/SrhJointPositionController"


def load_gains(path: Path, driven: tuple[str, ...] = DRIVEN_JOINTS) -> PublishedGains:
    """Read a hand's ``sr_edc_joint_position_controllers_PWM.yaml``, or its like for torque demands.

    Args:
        path: the file.
        driven: the joints that the hand has; gains of others are left out.

    Raises:
        ConfigurationError: the file cannot be used, a joint is missing or named twice, the joints are of both sides,
            or the gains of one joint have different signs.
    """
    content = strict_yaml.load(path)
    if not isinstance(content, dict):
        hint = "Use sr_edc_joint_position_controllers_PWM.yaml"
        raise ConfigurationError("contains no position controllers", where=str(path), hint=hint)
    controllers = [strict_yaml.validate(entry, _Controller, where=f"{path}, {name}") for name, entry in content.items()]
    named = {controller.joint.rpartition("_")[2].upper(): controller.pid for controller in controllers}
    wrong = sorted(set(driven) - set(named) | set(named) - set(DRIVEN_JOINTS))
    if wrong or len(named) != len(controllers):
        hint = f"It must name each of {', '.join(driven)} once"
        what = f"missing or unknown: {', '.join(wrong)}" if wrong else "a joint is named twice"
        raise ConfigurationError(what, where=str(path), hint=hint)
    gains = {joint: _gains(pid, joint, path) for joint, pid in named.items() if joint in driven}
    backwards = tuple(joint for joint in driven if named[joint].p < 0.0)
    return PublishedGains(
        GainTable(exceptions=gains), backwards, _told_side([each.joint for each in controllers], path)
    )


def _told_side(joints: Sequence[str], path: Path) -> Side | None:
    sides = {_SIDES[joint[:3].lower()] for joint in joints if joint[:3].lower() in _SIDES}
    if len(sides) > 1:
        raise ConfigurationError(
            "has joints of a left and of a right hand", where=str(path), hint="Use one hand's table"
        )
    return next(iter(sides), None)


def _gains(pid: _Pid, joint: str, path: Path) -> JointGains:
    sign = -1.0 if pid.p < 0.0 else 1.0
    if (pid.p == 0.0 and pid.max_force) or sign * pid.i < 0.0 or sign * pid.d < 0.0:
        what = f"gains p {pid.p:g}, i {pid.i:g}, d {pid.d:g} of {joint} have different signs"
        raise ConfigurationError(what, where=str(path), hint="All three need the same sign, and p must not be zero")
    content = {
        "pwm_per_rad": abs(pid.p),
        "deadband_rad": pid.position_deadband,
        "max_pwm": pid.max_force,
        "damping": abs(pid.d),
        "integral": abs(pid.i),
        "integral_max": pid.i_clamp,
    }
    return strict_yaml.validate(content, JointGains, where=f"{path}, {joint}")
