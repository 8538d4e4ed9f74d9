"""Modbus RTU as used by ATI's Digital F/T sensor: frames with a checksum, one request and one reply at a time."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.core.errors import CodecError

SLAVE = 10
READ_HOLDING = 0x03
START_STREAM = 0x46
UNLOCK = 0x6A
_EXCEPTION = 0x80
_LARGEST_READ = 125
_LONGEST = 2 * 256  # bytes kept while a reply is incomplete
_TABLE = [0] * 256
for _byte in range(256):
    _crc = _byte
    for _ in range(8):
        _crc = _crc >> 1 ^ (0xA001 if _crc & 1 else 0)
    _TABLE[_byte] = _crc

EXCEPTIONS = {1: "unknown function", 2: "no such register", 3: "value refused", 4: "device failure", 6: "device busy"}


@dataclass(frozen=True)
class Frame:
    """One request or reply, without its checksum."""

    slave: int
    function: int
    data: bytes

    @property
    def exception(self) -> str:
        """Why the device refused the request, in plain English; empty for an ordinary reply."""
        if not self.function & _EXCEPTION:
            return ""
        code = self.data[0] if self.data else 0
        return EXCEPTIONS.get(code, f"exception {code}")


def crc16(payload: bytes) -> int:
    """The checksum (polynomial 0xA001, initial value 0xFFFF); sent low byte first."""
    crc = 0xFFFF
    for byte in payload:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc


def encode(frame: Frame) -> bytes:
    """A frame as bytes. Raises CodecError if it is longer than Modbus allows."""
    if len(frame.data) > 252:
        raise CodecError(f"{len(frame.data)} data bytes, at most 252 fit", where="Modbus")
    body = bytes((frame.slave, frame.function)) + frame.data
    return body + crc16(body).to_bytes(2, "little")


def decode(payload: bytes) -> Frame:
    """Decode one whole frame. Raises CodecError if it is too short or its checksum is wrong."""
    if len(payload) < 4:
        raise CodecError(f"{len(payload)} bytes, a frame has at least 4", where="Modbus")
    if crc16(payload[:-2]) != int.from_bytes(payload[-2:], "little"):
        raise CodecError("wrong checksum", where="Modbus", hint="Check baud rate, parity and wiring")
    return Frame(payload[0], payload[1], payload[2:-2])


def read_request(first: int, count: int, slave: int = SLAVE) -> Frame:
    """A request for ``count`` holding registers. Raises CodecError if a reply cannot hold that many."""
    if not (0 <= first < 1 << 16 and 1 <= count <= _LARGEST_READ):
        raise CodecError(f"{count} registers from {first}", where="Modbus")
    return Frame(slave, READ_HOLDING, first.to_bytes(2, "big") + count.to_bytes(2, "big"))


def take_reply(buffer: bytearray, slave: int = SLAVE) -> Frame | None:
    """Remove the first whole reply, and everything before it, from received bytes; None if there is none yet.

    Bytes that cannot begin a valid reply are skipped, so that the remains of an earlier stream do no harm.
    """
    for start in range(len(buffer)):
        length = _reply_length(buffer[start : start + 3], slave)
        if length is None or start + length > len(buffer):
            continue
        payload = bytes(buffer[start : start + length])
        if crc16(payload[:-2]) == int.from_bytes(payload[-2:], "little"):
            del buffer[: start + length]
            return Frame(payload[0], payload[1], payload[2:-2])
    del buffer[:-_LONGEST]
    return None


def _reply_length(head: bytearray, slave: int) -> int | None:
    """Length of the reply that begins with these bytes; None if no reply begins like this."""
    if head[0] != slave:
        return None
    if len(head) < 3:
        return 5
    if head[1] == READ_HOLDING:
        return 5 + head[2]
    return 5 if head[1] & 0x7F in (READ_HOLDING, START_STREAM, UNLOCK) else None
