"""The motor boards' settings: Shadow's file format, and their upload after connecting (protocols: Motor demands).

Ten words a motor in successive cycles, the other motors' words zero, then a checksum that makes the motor take them
over. A cycle that is lost is sent again. When all are sent, the motors' flags show whether each accepted its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.core import configuration as strict_yaml
from drivers.core.configuration import StrictModel
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.shadow.device.motor_polling import MotorReadings
from drivers.shadow.model.motors import DRIVEN_JOINTS, MotorMap
from drivers.shadow.protocol.motor_data import FromMotor, MotorFlag, ToMotor, config_upload, describe_flags
from drivers.shadow.protocol.palm_codec import MOTORS

UPLOAD_TRIES = 3
_LOST_IN_A_ROW = 20
_CYCLES_FOR_FLAGS = 400
RESET_WORD, MOTORS_A_BUS = 0x5200, 10
"""A reset names the motor by its number on its bus."""

_BACKLASH_ON, _BACKLASH_OFF = 0x0001, 0x0002
_REFUSED = int(MotorFlag.CONFIG_CRC_MISMATCH | MotorFlag.CONFIG_OUT_OF_RANGE)

Exchange = Callable[[ToMotor, NDArray[np.int16]], MotorReadings | None]
"""One cycle with words for the motors: what is known of them after it, None when it was lost."""


class TorqueLoop(StrictModel):
    """Words of one motor's torque loop, as the file names them.

    ``sg_left`` and ``sg_right`` are kept by the file's format but not part of the upload.
    """

    torque_limit: int = Field(ge=0, le=0x7FFF)
    torque_limiter_gain: int = Field(ge=-0x200, le=0x200)
    max_pwm: int = Field(ge=0, le=0x3FF)
    sgleftref: int = Field(ge=0, le=0xFF)
    sgrightref: int = Field(ge=0, le=0xFF)
    f: int = Field(ge=0, le=0x7FFF)
    p: int = Field(ge=0, le=0x7FFF)
    i: int = Field(ge=0, le=0x7FFF)
    d: int = Field(ge=0, le=0x7FFF)
    imax: int = Field(ge=0, le=0x3FFF)
    deadband: int = Field(ge=0, le=0xFF)
    sign: int = Field(ge=0, le=1)
    sg_left: int = 0
    sg_right: int = 0

    @property
    def words(self) -> tuple[int, ...]:
        """The ten words of types 5 to 0xE."""
        references, ends = self.sgleftref | self.sgrightref << 8, self.deadband | self.sign << 8
        gains = (self.f, self.p, self.i, self.d, self.imax)
        return self.torque_limit, self.torque_limiter_gain & 0xFFFF, self.max_pwm, references, *gains, ends


class _Filter(StrictModel):
    tau: float


class MotorConfiguration(StrictModel):
    """Settings of one motor board."""

    pid: TorqueLoop
    backlash_compensation: bool
    pos_filter: _Filter | None = None


def load_configurations(path: Path, driven: tuple[str, ...] = DRIVEN_JOINTS) -> dict[str, MotorConfiguration]:
    """Read a hand's ``motor_board_effort_controllers.yaml``; by driven joint, of those that the hand has.

    Raises:
        ConfigurationError: the file cannot be used, or a motor is missing.
    """
    content = strict_yaml.load(path)
    if not isinstance(content, dict):
        raise ConfigurationError("contains no motors", where=str(path), hint="Use motor_board_effort_controllers.yaml")
    named = {str(name).upper(): value for name, value in content.items()}
    if wrong := sorted(set(driven) - set(named) | set(named) - set(DRIVEN_JOINTS)):
        hint = f"It must name {', '.join(driven)}"
        raise ConfigurationError(f"missing or unknown: {', '.join(wrong)}", where=str(path), hint=hint)
    return {
        joint: strict_yaml.validate(named[joint], MotorConfiguration, where=f"{path}, {joint.lower()}")
        for joint in driven
    }


def configure_motors(
    exchange: Exchange, motors: MotorMap, configurations: Mapping[str, MotorConfiguration], where: str
) -> None:
    """Upload the motors' settings, see that all took them, then set their backlash compensation.

    Args:
        exchange: one cycle of the hand.
        motors: which motor pulls which joint.
        configurations: by driven joint.
        where: the hand's name, for messages.

    Raises:
        DeviceError: cycles are lost, or a motor refuses its settings three times; names the motor.
    """
    waiting = dict(configurations)
    for _ in range(UPLOAD_TRIES):
        for joint, configuration in waiting.items():
            for kind, word in config_upload(configuration.pid.words):
                _insist(exchange, kind, _alone(motors.numbers[joint], word), where)
        flags = _fresh_flags(exchange, where, motors.is_fitted)
        waiting = {joint: each for joint, each in waiting.items() if flags[motors.numbers[joint]] & _REFUSED}
        if not waiting:
            _insist(exchange, ToMotor.SYSTEM_CONTROLS, _backlash(motors, configurations), where)
            return
    joint = next(iter(waiting))
    words = ", ".join(describe_flags(int(flags[motors.numbers[joint]]) & _REFUSED))
    hint = "Check the motor's entry in motor_board_effort_controllers.yaml"
    raise DeviceError(words, where=f"{where}, {joint} (motor {motors.numbers[joint]})", hint=hint)


def reset_motors(exchange: Exchange, cycles: int) -> None:
    """Reset every motor board, then wait with empty control words while they start (Shadow's small driver does so)."""
    exchange(ToMotor.RESET, np.array([RESET_WORD | motor % MOTORS_A_BUS for motor in range(MOTORS)], dtype=np.int16))
    for _ in range(cycles):
        exchange(ToMotor.SYSTEM_CONTROLS, np.zeros(MOTORS, dtype=np.int16))


def _alone(motor: int, word: int) -> NDArray[np.int16]:
    words = np.zeros(MOTORS, dtype=np.uint16)
    words[motor] = word
    return words.view(np.int16)


def _backlash(motors: MotorMap, configurations: Mapping[str, MotorConfiguration]) -> NDArray[np.int16]:
    words = np.zeros(MOTORS, dtype=np.int16)
    for joint, configuration in configurations.items():
        words[motors.numbers[joint]] = _BACKLASH_ON if configuration.backlash_compensation else _BACKLASH_OFF
    return words


def _insist(exchange: Exchange, kind: ToMotor, words: NDArray[np.int16], where: str) -> MotorReadings:
    for _ in range(_LOST_IN_A_ROW):
        if (readings := exchange(kind, words)) is not None:
            return readings
    what = f"{_LOST_IN_A_ROW} cycles in a row were lost while configuring the motors"
    raise DeviceError(what, where=where, hint="Check the cable and the hand's power, then connect again")


def _fresh_flags(exchange: Exchange, where: str, fitted: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Flags that all motors sent after now; a motor that stays silent keeps what it said before."""
    idle = np.zeros(MOTORS, dtype=np.int16)
    readings = _insist(exchange, ToMotor.DEMAND_PWM, idle, where)
    before_ns = readings.stamps_ns[FromMotor.FLAGS].copy()
    for _ in range(_CYCLES_FOR_FLAGS):
        readings = _insist(exchange, ToMotor.DEMAND_PWM, idle, where)
        if (readings.stamps_ns[FromMotor.FLAGS] > before_ns)[fitted].all():
            break
    return readings.flags
