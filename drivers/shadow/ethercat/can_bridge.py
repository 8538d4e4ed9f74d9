"""The hand's two motor CAN buses as a python-can interface: ``can.Bus(interface="shadow_bridge", channel="eth1")``.

The palm puts one frame a cycle on a bus and returns at most one that came in (protocols: Motor CAN buses). Messages
carry the bus, 1 or 2, as their ``channel``. While the bridge is open the palm serves nothing else, so the motors get
no demands and halt: the hand driver has to be disconnected.
"""

from __future__ import annotations

import contextlib
import socket
import time
from collections import deque
from collections.abc import Sequence
from typing import Any

import can
from can.typechecking import AutoDetectedConfig, CanFilters

from drivers.core.clock import NANOSECONDS, Clock, MonotonicClock
from drivers.core.errors import CodecError, TactileLabError
from drivers.core.transports import Transport, link_health
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport
from drivers.shadow.protocol.motor_can import BITRATE
from drivers.shadow.protocol.palm_codec import CanFrame, EdcCommand, PalmCommand, PalmStatus
from drivers.shadow.protocol.palm_images import PALMS, USUAL_PALM, PalmName

CYCLE_ns = 1_000_000
_BUSES = (1, 2)
_SEND_TRIES = 20
_LARGEST_IDENTIFIER = 0x7FF


class ShadowBridgeBus(can.BusABC):
    """Both motor buses through the palm.

    Args:
        channel: network interface the hand is plugged into.
        can_filters: as for any python-can bus.
        motor_bus: bus of sent messages that name no channel, 1 or 2.
        first_channel: channel by which messages name the first bus: 1, or 0 to play back a file in which another
            program numbered the buses 1 and 2, since python-can's readers count from 0.
        palm: which palm the hand has; by its product code unless given, and the usual one behind a ``transport``
        that
            does not know.
        transport: a transport to the palm in place of one over EtherCAT on ``channel``; it need not be open.
        clock: paces the cycles.

    Attributes:
        cycles, lost: cycles, and those without a status.
        damaged, surplus: messages that were no status, and statuses beyond one a cycle.

    Raises:
        can.CanInitializationError: no hand, or an option that does not fit; in the driver's own words.
    """

    def __init__(
        self,
        channel: Any = None,
        can_filters: CanFilters | None = None,
        *,
        motor_bus: int | str = 1,
        first_channel: int | str = 1,
        palm: PalmName | int | str | None = None,
        transport: Transport | None = None,
        clock: Clock | None = None,
        **options: Any,
    ) -> None:
        self._default_bus = _checked_bus(motor_bus)
        self._first_channel = _checked_channel(first_channel)
        named = None if palm is None else _checked_palm(palm)
        self._image = PALMS[named or USUAL_PALM]
        self._clock = clock or MonotonicClock()
        self._transport = transport or _ethercat(channel, named, self._clock)
        self._next_ns = self._clock.now_ns()
        self._epoch_ns = time.time_ns() - self._next_ns
        self._received: deque[can.Message] = deque()
        self.cycles = self.lost = self.damaged = self.surplus = 0
        self.channel_info = f"Shadow hand's motor buses at {channel or self._transport.name}, {BITRATE // 1000} kbit/s"
        self._open_link(named)
        super().__init__(channel=channel, can_filters=can_filters, **options)
        self._can_protocol = can.CanProtocol.CAN_20

    def _open_link(self, palm: PalmName | None) -> None:
        try:
            self._transport.open()
            if palm is None and isinstance(self._transport, EthercatTransport):
                self._image = self._transport.hand.image
            self._cycle(CanFrame())
            self.cycles = self.lost = 0  # the first cycle has nothing to answer yet
        except TactileLabError as error:
            self._transport.close()
            self._is_shutdown = True  # so that python-can does not remind of closing what never opened
            raise can.CanInitializationError(str(error)) from error

    # --- python-can's side -------------------------------------------------------------------------------------

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send one message with the next cycle.

        Raises:
            can.CanOperationError: a kind of message these buses do not have, or one that did not reach the palm.
        """
        frame = self._frame(msg)
        deadline_ns = None if timeout is None else self._clock.now_ns() + round(timeout * NANOSECONDS)
        for _ in range(_SEND_TRIES):
            if self._guarded_cycle(frame):
                return
            if deadline_ns is not None and self._clock.now_ns() >= deadline_ns:
                break
        what = ": ".join(["the palm did not accept the frame", *link_health(self._transport)[:1]])
        raise can.CanOperationError(f"{what}. Check the hand's power and cable")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        deadline_ns = None if timeout is None else self._clock.now_ns() + round(timeout * NANOSECONDS)
        while not self._received:
            self._guarded_cycle(CanFrame())
            if deadline_ns is not None and self._clock.now_ns() >= deadline_ns:
                break
        return (self._received.popleft() if self._received else None), False

    def shutdown(self) -> None:
        """Let the palm take the last frame, and close the transport; idempotent."""
        if not self._is_shutdown:
            with contextlib.suppress(TactileLabError):  # whoever closes a bus that failed has been told so
                self._cycle(CanFrame())
                self._cycle(CanFrame())
        super().shutdown()
        self._transport.close()

    @staticmethod
    def _detect_available_configs() -> Sequence[AutoDetectedConfig]:
        """Network interfaces a hand may be plugged into."""
        names = [name for _, name in socket.if_nameindex() if name != "lo"]
        return [{"interface": "shadow_bridge", "channel": name} for name in names]

    # --- the palm's side ---------------------------------------------------------------------------------------

    def _guarded_cycle(self, frame: CanFrame) -> bool:
        try:
            return self._cycle(frame)
        except TactileLabError as error:
            raise can.CanOperationError(str(error)) from error

    def _cycle(self, frame: CanFrame) -> bool:
        """One cycle; whether its command reached the palm."""
        self._clock.sleep_until_ns(self._next_ns)
        self._next_ns = max(self._next_ns, self._clock.now_ns() - CYCLE_ns) + CYCLE_ns
        refused = self._refused
        self._transport.send(self._image.encode_command(PalmCommand(edc_command=EdcCommand.CAN_DIRECT, can=frame)))
        datagrams = self._transport.receive()
        self.cycles, self.lost = self.cycles + 1, self.lost + (not datagrams)
        self.surplus += max(len(datagrams) - 1, 0)
        for datagram in {each.payload: each for each in datagrams}.values():  # a doubled one is no second message
            status = self._decode(datagram.payload)
            if status is None:
                continue
            if status.written and status.can.bus:
                self._received.append(self._message(status.can, datagram.stamp_ns))
        return bool(datagrams) and self._refused == refused

    def _decode(self, payload: bytes) -> PalmStatus | None:
        try:
            return self._image.decode_status(payload)
        except CodecError:
            self.damaged += 1
            return None

    def health(self) -> tuple[str, ...]:
        """What the motors may have said without anyone hearing it, in words; empty when nothing was lost."""
        problems = [f"{self.lost} of {self.cycles} cycles without a status"] if self.lost else []
        if self.damaged:
            problems.append(f"{self.damaged} messages were not a status of a {self._image.name} palm")
        if self.surplus:
            problems.append(f"{self.surplus} statuses more than cycles")
        return tuple(problems) + link_health(self._transport)

    @property
    def _refused(self) -> int:
        """Commands the palm has not taken, if the transport counts them."""
        return self._transport.counts.refused if isinstance(self._transport, EthercatTransport) else 0

    def _message(self, frame: CanFrame, stamp_ns: int) -> can.Message:
        return can.Message(
            timestamp=(self._epoch_ns + stamp_ns) / NANOSECONDS,
            arbitration_id=frame.identifier & _LARGEST_IDENTIFIER,
            is_extended_id=False,
            channel=frame.bus - 1 + self._first_channel,
            data=frame.data[: min(frame.length, 8)],
        )

    def _frame(self, msg: can.Message) -> CanFrame:
        if msg.is_extended_id or msg.is_remote_frame or msg.is_error_frame or msg.is_fd:
            raise can.CanOperationError("the motor buses have 11-bit data frames only")
        bus = self._default_bus if msg.channel is None else self._bus_of(msg.channel)
        return CanFrame(bus, len(msg.data), msg.arbitration_id, bytes(msg.data).ljust(8, b"\0"))

    def _bus_of(self, channel: object) -> int:
        """The bus that a message names; candump logs that python-can writes put ``can`` before the number."""
        number = str(channel).removeprefix("can")
        bus = int(number) - self._first_channel + 1 if number.isdigit() else 0
        if bus in _BUSES:
            return bus
        names = " or ".join(str(bus - 1 + self._first_channel) for bus in _BUSES)
        hint = f"Set the message's channel to {names}"
        if number == "0":
            hint += ", or play a file of another program, which numbers the buses 1 and 2, with first_channel=0"
            hint += " (python-can's tools: --bus-kwargs first_channel=0)"
        raise can.CanOperationError(f"there is no motor bus {channel}. {hint}")


def _checked_channel(first_channel: int | str) -> int:
    if str(first_channel) not in {"0", "1"}:
        raise can.CanInitializationError(
            f"the first bus cannot be channel {first_channel}. Set first_channel to 0 or 1"
        )
    return int(first_channel)


def _checked_bus(motor_bus: int | str) -> int:
    if str(motor_bus) not in {"1", "2"}:
        raise can.CanInitializationError(f"there is no motor bus {motor_bus}. Set motor_bus to 1 or 2")
    return int(motor_bus)


def _checked_palm(palm: PalmName | int | str) -> PalmName:
    """python-can's command line turns 0220 into a number on its way here."""
    named = next((name for name in PALMS if name == str(palm).zfill(4)), None)
    if named is None:
        raise can.CanInitializationError(f"unknown palm {palm}. Set palm to one of {', '.join(PALMS)}")
    return named


def _ethercat(channel: Any, palm: PalmName | None, clock: Clock) -> Transport:
    if not channel:
        raise can.CanInitializationError("no channel. Give the network interface that the hand is connected to")
    return EthercatTransport("hand", EthercatSettings(interface=str(channel), palm=palm), clock)
