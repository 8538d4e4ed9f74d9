"""A CAN bus as a transport, through python-can and so through any adapter it knows.

One message of the transport is one frame: its 11-bit identifier (two bytes, big-endian), then its data (0 to 8 bytes).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

import can

from drivers.core.clock import Clock
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram

_IDENTIFIER = struct.Struct(">H")
_AT_ONCE = 10_000
_SEND_TIMEOUT_S = 0.5  # the clock runs while this process waits for its turn, too


@dataclass(frozen=True)
class CanFrame:
    """One data frame with an 11-bit identifier and up to eight bytes."""

    identifier: int
    data: bytes


def encode_frame(frame: CanFrame) -> bytes:
    """A frame as a message of a transport. Raises CodecError when identifier or data are too large."""
    if not 0 <= frame.identifier < 1 << 11 or len(frame.data) > 8:
        raise CodecError(f"identifier 0x{frame.identifier:x} with {len(frame.data)} bytes", where="CAN frame")
    return _IDENTIFIER.pack(frame.identifier) + frame.data


def decode_frame(payload: bytes) -> CanFrame:
    """A message of a transport as a frame. Raises CodecError for what can be none."""
    if not 2 <= len(payload) <= 10:
        raise CodecError(f"{len(payload)} bytes, a CAN frame has 2 to 10", where="CAN frame")
    (identifier,) = _IDENTIFIER.unpack_from(payload)
    if identifier >= 1 << 11:
        raise CodecError(f"identifier 0x{identifier:x} does not fit 11 bits", where="CAN frame")
    return CanFrame(identifier, payload[2:])


class CanTransport:
    """A CAN bus; frames with long identifiers, remote and error frames are counted and left out.

    Args:
        name: the device's name in the rig.
        make_bus: opens the bus, ``can.Bus`` with the rig's arguments.
        clock: the session's clock; a frame is stamped when it is read.

    Attributes:
        foreign, error_frames: frames left out.
        damaged: readings that the adapter's own protocol could not decode.
    """

    def __init__(self, name: str, make_bus: Callable[[], can.BusABC], clock: Clock) -> None:
        self.name, self._make_bus, self._clock = name, make_bus, clock
        self.foreign = self.error_frames = self.damaged = 0
        self._bus: can.BusABC | None = None

    def open(self) -> None:
        """Open the bus. Repeatable. Raises DeviceError."""
        if self._bus is not None:
            return
        try:
            self._bus = self._make_bus()
        except (can.CanError, OSError, ValueError, ImportError, NotImplementedError) as error:
            raise DeviceError(
                f"the CAN bus cannot be opened ({error})", where=self.name, hint="Check adapter, channel and interface"
            ) from error

    def close(self) -> None:
        """Close the bus; idempotent."""
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.shutdown()

    def send(self, payload: bytes) -> None:
        """Send one frame. Raises DeviceError when the bus is gone, CodecError when it is no frame."""
        frame, bus = decode_frame(payload), self._open_bus()
        try:
            message = can.Message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=False)
            bus.send(message, timeout=_SEND_TIMEOUT_S)
        except (can.CanError, OSError) as error:
            raise DeviceError(
                f"the CAN bus does not accept frames ({error})",
                where=self.name,
                hint="Check wiring, termination and bit rate",
            ) from error

    def receive(self) -> list[Datagram]:
        """All frames that wait, oldest first. Raises DeviceError when the bus is gone."""
        bus, taken = self._open_bus(), []
        for _ in range(_AT_ONCE):
            try:
                message = bus.recv(timeout=0)
            except ValueError:  # a damaged line of a text adapter such as slcan
                self.damaged += 1
                continue
            except (can.CanError, OSError) as error:
                gone = f"the CAN bus was disconnected ({error})"
                raise DeviceError(gone, where=self.name, hint="Check the adapter") from error
            if message is None:
                break
            if self._is_wanted(message):
                frame = CanFrame(message.arbitration_id, bytes(message.data))
                taken.append(Datagram(encode_frame(frame), self._clock.now_ns()))
        return taken

    def health(self) -> tuple[str, ...]:
        """What was left out, in words; empty when nothing was."""
        counts = {
            "error frames on the bus": self.error_frames,
            "frames of another kind ignored": self.foreign,
            "damaged readings of the adapter": self.damaged,
        }
        return tuple(f"{count} {text}" for text, count in counts.items() if count)

    def _is_wanted(self, message: can.Message) -> bool:
        self.error_frames += message.is_error_frame
        other = message.is_extended_id or message.is_remote_frame or message.is_fd
        self.foreign += other and not message.is_error_frame
        return not (other or message.is_error_frame)

    def _open_bus(self) -> can.BusABC:
        if self._bus is None:
            raise DeviceError("the transport is not open", where=self.name, hint="Connect the device first")
        return self._bus
