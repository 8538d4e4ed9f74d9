"""An arm of Universal Robots as a positioner: its stops end the motion, and a person can lead it by hand."""

from __future__ import annotations

from drivers.core.clock import Clock
from drivers.core.transports import Datagram, Transport, link_identity
from drivers.positioner.codec import PositionerCodec, PositionerCommand
from drivers.positioner.positioner import Positioner
from drivers.positioner.settings import PositionerSample
from drivers.positioner.ur.checks import stop_cause
from drivers.positioner.ur.codec import (
    ArmOrder,
    ArmState,
    decode_arm_command,
    decode_arm_status,
    encode_arm_command,
    encode_arm_status,
)
from drivers.positioner.ur.settings import UrSettings

_RESTART_ns = 3_000_000_000
"""How long the program on the arm may take to start again."""


class UrPositioner(Positioner):
    """The arm, spoken to through :class:`~drivers.positioner.ur.process.UrProcess`.

    Whatever forbids it to move, in its own words, stops it as a lost connection does: every further exchange raises
    until :meth:`resume`.

    Args:
        link: whole commands and statuses of :mod:`drivers.positioner.ur.codec`.
        clock: the session's clock.
        settings: limits of the arm.
    """

    def __init__(self, link: Transport, clock: Clock, settings: UrSettings | None = None) -> None:
        self._arm_settings = settings or UrSettings()
        self._order, self._resumed_ns = ArmOrder.FOLLOW, clock.now_ns()
        self._arm: ArmState | None = None
        codec = PositionerCodec(self._encode, decode_arm_command, encode_arm_status, decode_arm_status)
        super().__init__(link, clock, self._arm_settings, codec)

    @property
    def arm(self) -> ArmState | None:
        """What the arm said of itself last; None before it said anything."""
        return self._arm

    @property
    def identity(self) -> str:
        """Model, version and payload, read when it was connected."""
        return link_identity(self._transport)

    def connect(self) -> None:
        """As :meth:`Positioner.connect`."""
        self._order, self._arm = ArmOrder.FOLLOW, None
        super().connect()

    def lead_by_hand(self) -> None:
        """Let a person lead the arm, until :meth:`stop` or :meth:`resume`. Without effect after a fault."""
        if self._fault is None:
            self._order = ArmOrder.FREEDRIVE

    def stop(self) -> None:
        """Stay here until :meth:`resume`; a person cannot lead it any more. Never raises."""
        self._hold_still()
        super().stop()

    def resume(self) -> None:
        """Take back a stop or a fault; a program that was stopped on the arm is started again."""
        super().resume()
        self._order, self._resumed_ns = ArmOrder.RESUME, self._clock.now_ns()

    def exchange(self) -> PositionerSample:
        """One cycle, as :meth:`Positioner.exchange`.

        Raises:
            DeviceError: also when the arm, its program or a person at its pendant has stopped it.
        """
        if self._order is ArmOrder.FREEDRIVE and self._last is not None:
            self._sent = self._target = self._last.q
        sample = super().exchange()
        cause = None if self._arm is None else stop_cause(self._arm, self._arm_settings)
        if cause is None or self._clock.now_ns() - self._resumed_ns > _RESTART_ns:
            self._order = ArmOrder.FOLLOW if self._order is ArmOrder.RESUME else self._order
        if cause is not None and self._order is not ArmOrder.RESUME and self._fault is None:
            self._hold_still()
            self._hold(cause.what, cause.remedy)
            self._raise_fault()
        return sample

    def receive(self, datagram: Datagram) -> PositionerSample | None:
        """As :meth:`Positioner.receive`; keeps what the arm says of itself."""
        sample = super().receive(datagram)
        if sample is not None:
            self._arm = decode_arm_status(datagram.payload).arm
        return sample

    def _hold_still(self) -> None:
        if self._order is ArmOrder.FREEDRIVE and self._last is not None:
            self._sent = self._target = self._last.q
        self._order = ArmOrder.FOLLOW

    def _encode(self, command: PositionerCommand) -> bytes:
        return encode_arm_command(command, self._order)
