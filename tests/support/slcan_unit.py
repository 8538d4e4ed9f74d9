"""A serial CAN adapter (slcan text protocol) with an emulated CAN device behind it."""

from __future__ import annotations

from collections.abc import Callable

from drivers.core.errors import CodecError
from drivers.emulators.ati.unit import Unit
from drivers.hardware.can_bus import CanFrame, decode_frame, encode_frame

_DONE, _REFUSED = b"\r", b"\a"


def encode_line(frame: CanFrame) -> bytes:
    """Encode a frame with an 11-bit identifier as the adapter does."""
    return f"t{frame.identifier:03X}{len(frame.data)}{frame.data.hex().upper()}\r".encode("ascii")


def decode_line(line: bytes) -> CanFrame:
    """Decode a line without its line end. Raises CodecError if it is not a frame."""
    try:
        text = line.decode("ascii")
        frame = CanFrame(int(text[1:4], 16), bytes.fromhex(text[5:]))
        if text[:1] != "t" or int(text[4]) != len(frame.data):
            raise ValueError
    except (ValueError, IndexError) as error:
        raise CodecError(f"{line[:40]!r} is no frame", where="slcan") from error
    return frame


class SlcanUnit:
    """One adapter; put it on a pseudo terminal.

    Args:
        device: the device on its bus.

    Attributes:
        damage: changes each line that the adapter writes, like a faulty serial line.
        refused: number of lines that it did not understand.
    """

    def __init__(self, device: Unit) -> None:
        self.damage: Callable[[bytes], bytes] = lambda line: line
        self.refused = 0
        self._device, self._open, self._buffer = device, False, b""

    @property
    def rate_hz(self) -> float:
        """Of the device."""
        return self._device.rate_hz

    def handle(self, payload: bytes) -> list[bytes]:
        """Process text; returns the answers of adapter and device."""
        *lines, self._buffer = (self._buffer + payload).split(b"\r")
        return [answer for line in lines for answer in self._answers(line)]

    def tick(self) -> bytes | None:
        """Messages that the device sends by itself."""
        message = self._device.tick()
        return None if message is None or not self._open else self.damage(encode_line(decode_frame(message)))

    def _answers(self, line: bytes) -> list[bytes]:
        if line[:1] in (b"O", b"L", b"C"):
            self._open = line[:1] != b"C"
        elif line[:1] == b"t" and self._open:
            return self._pass_on(line)
        elif line[:1] not in (b"S", b"s", b"V", b"N", b"F", b""):
            self.refused += 1
            return [_REFUSED]
        return [_DONE]

    def _pass_on(self, line: bytes) -> list[bytes]:
        try:
            answers = self._device.handle(encode_frame(decode_line(line)))
        except CodecError:
            self.refused += 1
            return [_REFUSED]
        return [b"z\r", *(self.damage(encode_line(decode_frame(answer))) for answer in answers)]
