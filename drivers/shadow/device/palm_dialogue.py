"""The hand's side of the talk with its palm: which command is next, and for how long the motors have had demands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.clock import NANOSECONDS, Clock
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.motor_polling import MotorPolling
from drivers.shadow.device.tactile_requests import TactileRotation
from drivers.shadow.protocol.motor_data import MOTOR_PATIENCE_s, ToMotor
from drivers.shadow.protocol.palm_codec import EdcCommand, PalmCommand
from drivers.shadow.protocol.palm_images import PALMS

_MOTOR_PATIENCE_ns = round(MOTOR_PATIENCE_s * NANOSECONDS)
_DEMANDS = (ToMotor.DEMAND_PWM, ToMotor.DEMAND_TORQUE)


class PalmDialogue:
    """Commands of one connection, in the order in which the palm gets them.

    Args:
        settings: of the hand.
        clock: the session's.
    """

    def __init__(self, settings: HandSettings, clock: Clock) -> None:
        self._clock = clock
        self._image = PALMS[settings.palm]
        self._usual = ToMotor.DEMAND_TORQUE if settings.demand == "torque" else ToMotor.DEMAND_PWM
        self._grace_ns = settings.demand_grace_s * NANOSECONDS
        self._polling = MotorPolling(settings.polling)
        self._tactile = TactileRotation(settings.tactile, names=settings.tactile_names)
        self._before_ns: int | None = None
        self._sent_ns: int | None = None
        self._demands_since_ns = clock.now_ns()

    def first(self) -> bytes:
        """The all-zero image, which moves nothing."""
        return self._image.encode_command(PalmCommand())

    def next(self, words: NDArray[np.int16], to_motor: ToMotor | None = None) -> bytes:
        """The next command, with these words for the motors: demands unless another type is named."""
        to_motor = self._usual if to_motor is None else to_motor
        now_ns = self._clock.now_ns()
        if self._sent_ns is None or to_motor not in _DEMANDS:
            self._demands_since_ns = now_ns
        which_motors, kind = self._polling.next(now_ns)
        self._before_ns, self._sent_ns = self._sent_ns, now_ns
        command = PalmCommand(
            edc_command=EdcCommand.SENSOR_DATA,
            from_motor_data_type=kind,
            which_motors=which_motors,
            to_motor_data_type=to_motor,
            motor_data=words,
            tactile_data_type=self._tactile.next(),
        )
        return self._image.encode_command(command)

    def on_answer(self, stamp_ns: int) -> None:
        """The command was answered. It reached the palm between then and now: so long the motors may have waited."""
        if self._before_ns is not None and stamp_ns - self._before_ns > _MOTOR_PATIENCE_ns:
            self._demands_since_ns = stamp_ns

    def on_lost_cycle(self) -> None:
        """A cycle was lost: the motors may have missed their demand."""
        self._demands_since_ns = self._clock.now_ns()

    @property
    def settling(self) -> bool:
        """Whether demands have only just begun to flow, so that motors may report that they had halted."""
        return self._clock.now_ns() - self._demands_since_ns < self._grace_ns
