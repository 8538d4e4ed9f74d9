"""From received palm statuses to samples of the hand: the half of the driver that a replay shares."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.core.contacts import Array
from drivers.core.transports import Datagram
from drivers.shadow.device.motor_polling import MotorMemory, MotorReadings
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.protocol.palm_codec import PalmStatus
from drivers.shadow.protocol.palm_images import PALMS, PalmImage


@dataclass(frozen=True, eq=False)
class HandSample:
    """The hand at one moment.

    Attributes:
        stamp_ns: arrival of the status, session clock.
        joints_rad: joint angles, shape (24,), order of :data:`~drivers.shadow.model.kinematics.JOINTS`, radians.
        fresh: whether it arrived in this cycle; False for the last good sample repeated after a lost cycle.
        motor: latest known motor readings.
        tactile_type: request the fingertips' slots answer.
        tactile_valid: which slots are new: bit 0 FF, 1 MF, 2 RF, 3 LF, 4 TH.
        tactile: the five slots of 16 bytes in that order, 80 raw bytes (32 and 160 of a 0230 palm).
        idle_us: spare time in the palm's cycle, microseconds; healthy above 50.
        status: the decoded status it was made of.
    """

    stamp_ns: int
    joints_rad: Array
    fresh: bool
    motor: MotorReadings
    tactile_type: int
    tactile_valid: int
    tactile: bytes
    idle_us: int
    status: PalmStatus


@dataclass
class StatusCounts:
    """Received statuses by what became of them.

    Attributes:
        good: made a sample.
        unwritten: the palm had not written in time.
        stale: the same bytes as before. Requests alternate, so two true statuses in a row always differ; a bus master
            that lost its slave repeats the last one.
    """

    good: int = 0
    unwritten: int = 0
    stale: int = 0


class HandDecoder:
    """Decodes statuses in the order they arrived; its samples depend on nothing else.

    Args:
        calibration: of the hand's joints.
        image: the palm's process image.
    """

    def __init__(self, calibration: JointCalibration, image: PalmImage = PALMS["0220"]) -> None:
        self._calibration, self._image = calibration, image
        self.restart()

    def restart(self) -> None:
        """Forget everything received so far."""
        self._memory, self._previous = MotorMemory(), b""
        self.counts = StatusCounts()

    def receive(self, datagram: Datagram) -> HandSample | None:
        """The sample in a status; None when the palm did not write it in time or it is a repetition.

        Raises:
            CodecError: not a status of this palm.
        """
        status = self._image.decode_status(datagram.payload)
        repeated, self._previous = datagram.payload == self._previous, datagram.payload
        if not status.written:
            self.counts.unwritten += 1
            return None
        if repeated:
            self.counts.stale += 1
            return None
        self.counts.good += 1
        self._memory.update(status, datagram.stamp_ns)
        return self._sample(status, datagram.stamp_ns)

    def _sample(self, status: PalmStatus, stamp_ns: int) -> HandSample:
        return HandSample(
            stamp_ns=stamp_ns,
            joints_rad=self._calibration.angles_rad(status.sensors),
            fresh=True,
            motor=self._memory.readings(),
            tactile_type=status.tactile_data_type,
            tactile_valid=status.tactile_valid,
            tactile=status.tactile.tobytes(),
            idle_us=status.idle_time_us,
            status=status,
        )
