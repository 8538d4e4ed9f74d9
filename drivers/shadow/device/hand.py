"""The Shadow Dexterous Hand on its palm's process image: lifecycle, cyclic exchange, limits and health."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram, Transport, link_health
from drivers.shadow.device.hand_guard import HandCounters, HandGuard
from drivers.shadow.device.hand_motion import NO_DEMAND, HandMotion
from drivers.shadow.device.hand_samples import HandDecoder, HandSample
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.motor_polling import MotorReadings
from drivers.shadow.device.motor_watch import Fault
from drivers.shadow.device.palm_dialogue import PalmDialogue
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.motors import MotorMap, drivable_range_rad
from drivers.shadow.protocol.motor_configuration import MotorConfiguration, configure_motors, reset_motors
from drivers.shadow.protocol.motor_data import ToMotor
from drivers.shadow.protocol.palm_images import PALMS


class ShadowHand:
    """The hand.

    Nothing moves until :meth:`set_targets`. A serious motor flag, a hot motor or a link that stays away stops the hand:
    demands become zero and every further :meth:`exchange` raises, until :meth:`resume`. A link that comes back in time
    costs the demands meanwhile, which then rise from zero again.

    Args:
        transport: whole process images of the palm named in the settings.
        clock: the session's clock.
        calibration: of the hand's joints.
        settings: see :class:`HandSettings`.
        motors: which motor pulls which joint; the simulated hand's (rh_E_v3) unless given. A real hand needs its own.
        boards: settings of the motor boards, by driven joint, uploaded after connecting; they keep theirs when None.
    """

    def __init__(
        self,
        transport: Transport,
        clock: Clock,
        calibration: JointCalibration,
        settings: HandSettings | None = None,
        motors: MotorMap | None = None,
        boards: Mapping[str, MotorConfiguration] | None = None,
    ) -> None:
        self._transport, self._clock = transport, clock
        self._settings = settings or HandSettings()
        self._motors, self._boards = motors or MotorMap.load(), boards
        gains, margin = self._settings.gains, self._settings.sensors.margin
        range_rad = drivable_range_rad(self._motors, calibration, margin)
        self._motion = HandMotion(self._motors, gains, self._settings.soft_start_s, transport.name, range_rad)
        link = partial(link_health, transport)
        self._guard = HandGuard(self._settings, self._motors, calibration, transport.name, link)
        self._decoder = HandDecoder(calibration, PALMS[self._settings.palm])
        self._connected = False
        self._reset()

    def _reset(self) -> None:
        """As new: nothing received, nothing sent, no target."""
        self._decoder.restart()
        self._dialogue = PalmDialogue(self._settings, self._clock)
        self._guard.restart()
        self._last: HandSample | None = None
        self._connected_ns = self._clock.now_ns()
        self.resume()

    # --- lifecycle ---------------------------------------------------------------------------------------------

    def connect(self) -> None:
        """Open the transport, send the all-zero image, wait for the palm's first status, set up the motor boards.

        All or nothing, repeatable.

        Raises:
            DeviceError: the transport does not open, the palm does not answer, or a motor refuses its settings.
        """
        if self._connected:
            return
        self._transport.open()
        try:
            self._reset()
            self._wake_palm()
            if self._settings.reset_motors:
                reset_motors(self._setup_cycle, round(self._settings.reset_wait_s / self._settings.cycle_s))
            if self._boards is not None:
                configure_motors(self._setup_cycle, self._motors, self._boards, self._transport.name)
        except BaseException:
            self._transport.close()
            raise
        self._connected = True

    def close(self) -> None:
        """Send zero demands for several cycles and close the transport. Idempotent.

        Raises:
            DeviceError: the device failed meanwhile; the transport is closed all the same.
        """
        if not self._connected:
            return
        self._connected = False
        try:
            for _ in range(self._settings.close_cycles):
                self._cycle(NO_DEMAND)
                self._pause()
        finally:
            self._transport.close()

    def reconnect(self) -> int:
        """Close the transport, open it again and wake the palm; nothing moves until :meth:`set_targets`.

        Returns how long it took, nanoseconds. Raises DeviceError when the hand does not come back, disconnected.
        """
        started_ns = self._clock.now_ns()
        self._connected = False
        self._transport.close()
        self.connect()
        return self._clock.now_ns() - started_ns

    def _wake_palm(self) -> None:
        self._transport.send(self._dialogue.first())
        self._take(self._transport.receive())
        for _ in range(self._settings.connect_tries):
            self._pause()
            if (sample := self._cycle(NO_DEMAND)) is not None:
                self._last = sample
                return
        raise DeviceError(
            f"the palm sent no valid status in {self._settings.connect_tries} cycles",
            where=self._transport.name,
            hint="Check the hand's power and its cable",
        )

    def _pause(self) -> None:
        self._clock.sleep_until_ns(self._clock.now_ns() + round(self._settings.cycle_s * NANOSECONDS))

    # --- motion ------------------------------------------------------------------------------------------------

    def set_targets(self, targets_rad: Mapping[str, float]) -> None:
        """Set targets by driven joint (J0 for J1 + J2), clamped to its limits and to what its calibration covers.

        The others keep theirs.

        Raises:
            DeviceError: a name is not a driven joint, or a target is not a finite number. Nothing is changed then.
        """
        self._motion.set_targets(targets_rad)

    def set_demands(self, counts: Mapping[str, float]) -> None:
        """Drive joints directly, in place of their position control, until they are given a target again.

        Args:
            counts: by driven joint, towards larger angles: duty cycle of 1023, or torque (strain gauge difference)
                where the settings say so. Sent within the joint's largest demand, the heat limit and the soft start.

        Raises:
            DeviceError: a name is not a driven joint, or a demand is not a finite number. Nothing is changed then.
        """
        self._motion.set_demands(counts)

    def nudge(self, joint: str, pwm: float) -> None:
        """Drive one motor alone with a small duty cycle from now on, in place of all position control.

        Args:
            joint: driven joint; the motor its map names.
            pwm: counts of 1023 towards larger angles, at most :data:`~drivers.shadow.device.hand_motion.LARGEST_NUDGE`;
                0 ends it and nothing moves.

        Raises:
            DeviceError: not a driven joint, one that is not to be driven, or too large.
        """
        self._motion.nudge(joint, pwm)

    @property
    def drivable(self) -> tuple[str, ...]:
        """Driven joints whose largest demand is not zero."""
        return self._motion.drivable

    @property
    def targets_rad(self) -> dict[str, float]:
        """The targets that are set, by driven joint, radians."""
        return self._motion.targets_rad

    def stop(self) -> None:
        """Zero demands from now on, until :meth:`resume`. Never raises; without exchanges motors halt after 20 ms."""
        self._stopped = True

    def resume(self) -> None:
        """Take back a stop or a fault. Targets are forgotten, so that nothing moves before new ones are set."""
        self._stopped = False
        self._guard.resume()
        self._motion.clear()

    # --- the cycle ---------------------------------------------------------------------------------------------

    def exchange(self) -> HandSample:
        """One cycle: send the demands, receive the status.

        Returns:
            The new sample, or after a lost cycle the last good one, marked as not fresh.

        Raises:
            DeviceError: not connected; or the hand has stopped itself before this cycle's demands went out, which were
                zero. The message names the motor.
        """
        if not self._connected or self._last is None:
            raise DeviceError("not connected", where=self._transport.name, hint="Connect the hand first")
        self._guard.look_at_time(now_ns := self._clock.now_ns(), driven=self._motion.active)
        words = self._demand(self._last, now_ns)
        fault = self._guard.fault
        sample = self._cycle(words)
        if sample is None:
            self._last = replace(self._last, fresh=False)
            self._dialogue.on_lost_cycle()
            self._guard.on_lost_cycle(now_ns)
        else:
            self._last = sample
            self._guard.on_status()
        if fault is not None:
            raise fault.error()
        return self._last

    def receive(self, datagram: Datagram) -> HandSample | None:
        """Decode one status without any other effect; None when the palm did not write it or it is a repetition.

        Raises:
            CodecError: not a status of this palm.
        """
        return self._decoder.receive(datagram)

    def _setup_cycle(self, kind: ToMotor, words: NDArray[np.int16]) -> MotorReadings | None:
        self._pause()
        sample = self._cycle(words, kind)
        self._last = sample or self._last
        return None if sample is None else sample.motor

    def _cycle(self, words: NDArray[np.int16], to_motor: ToMotor | None = None) -> HandSample | None:
        self._guard.counters.cycles += 1
        return self._take(self._transfer(self._dialogue.next(words, to_motor)))

    def _transfer(self, payload: bytes) -> list[Datagram]:
        """Out and back; a transport that fails stops the hand as a fault of its own would."""
        try:
            self._transport.send(payload)
            return self._transport.receive()
        except DeviceError as error:
            self._guard.blame(Fault(error.what, error.where, error.hint))
            raise

    def _take(self, datagrams: list[Datagram]) -> HandSample | None:
        newest = None
        for datagram in datagrams:
            try:
                sample = self.receive(datagram)
            except CodecError:
                self._guard.counters.malformed += 1  # shown by health(); the cycle counts as lost
                continue
            if sample is not None:
                newest = sample
                self._dialogue.on_answer(sample.stamp_ns)
                self._guard.look(sample, self._clock.now_ns(), settling=self._dialogue.settling)
        return newest

    def _demand(self, last: HandSample, now_ns: int) -> NDArray[np.int16]:
        if not self._stopped:
            self._guard.look_at_driven(self._motion.driven, now_ns)
        if self._stopped or self._guard.forbids_demands(now_ns):
            self._motion.pause()
            return NO_DEMAND
        share = self._guard.pwm_share(last.motor.temperature_C)
        words = self._motion.words(last.joints_rad, share, now_ns)
        self._guard.look_at_demand(words, last, now_ns, is_nudge=self._motion.is_nudge)
        return words if self._guard.fault is None else NO_DEMAND

    # --- state for people --------------------------------------------------------------------------------------

    @property
    def counters(self) -> HandCounters:
        """A copy of the counters."""
        return replace(self._guard.counters)

    def losses(self) -> dict[str, int]:
        """Cycles since connecting without a valid status."""
        return {"lost cycles": self._guard.counters.lost}

    @property
    def newest(self) -> HandSample | None:
        """The newest good sample; None before connecting."""
        return self._last

    def health(self) -> tuple[str, ...]:
        """What is wrong with the hand, in words; empty when all is well."""
        return self._guard.problems(self._last, self._decoder.counts, self._connected_ns)
