"""One RTDE client of the emulated box: packages in, packages out (protocols: Universal Robots). Big-endian."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

from drivers.core.errors import CodecError

_HEAD = struct.Struct(">HB")
_VERSION, _DATA = 2, ord("U")

_FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "INT32": "i",
    "UINT64": "Q",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
}

_TYPES = {
    "timestamp": "DOUBLE",
    "robot_mode": "INT32",
    "safety_mode": "INT32",
    "runtime_state": "UINT32",
    "robot_status_bits": "UINT32",
    "safety_status_bits": "UINT32",
    "speed_scaling": "DOUBLE",
    "target_speed_fraction": "DOUBLE",
    "payload": "DOUBLE",
    "payload_cog": "VECTOR3D",
    "actual_TCP_pose": "VECTOR6D",
    "actual_TCP_force": "VECTOR6D",
    "async_operation_progress": "INT32",
    "external_force_torque": "VECTOR6D",
}
_REGISTERS = {"int": "INT32", "double": "DOUBLE", "bit": "BOOL"}

Value = float | Sequence[float]


def type_of(name: str) -> str:
    """The type of a variable; ``NOT_FOUND`` for one that this box does not have."""
    for kind, type_name in _REGISTERS.items():
        if f"put_{kind}_register_" in name:
            return type_name
    return _TYPES.get(name, "NOT_FOUND")


class Box(Protocol):
    """What the box publishes and accepts."""

    version: tuple[int, int, int, int]
    highest_Hz: float

    def output(self, name: str) -> Value:
        """The present value of an output."""

    def claim(self, client: object, names: Sequence[str]) -> list[str]:
        """Reserve inputs for a client; their types, ``IN_USE`` for another's."""

    def on_inputs(self, values: Mapping[str, Value]) -> None:
        """Inputs were written."""


class RtdeClient:
    """The server's side of one connection, without its socket.

    Args:
        box: the box.
    """

    def __init__(self, box: Box) -> None:
        self._box, self._rest = box, b""
        self.outputs: list[str] = []
        """Names of what it asked for."""
        self._recipes: dict[int, list[str]] = {}
        self.rate_hz = 0.0
        """Of data packages; 0 before and between ``start`` and ``pause``."""
        self._asked_hz = 125.0

    def feed(self, data: bytes) -> bytes:
        """Take bytes; the bytes of the answers. Raises CodecError for what is no package."""
        self._rest += data
        try:
            return b"".join(package(kind, self._answer(kind, body)) for kind, body in self._packages() if kind != _DATA)
        except (struct.error, UnicodeDecodeError, IndexError) as error:
            raise CodecError(f"a package with a damaged content ({error})", where="rtde") from error

    def data(self) -> bytes:
        """One data package of the outputs as they are."""
        body = b"\x01" + b"".join(_pack(name, self._box.output(name)) for name in self.outputs)
        return package(_DATA, body)

    def _packages(self) -> Iterator[tuple[int, bytes]]:
        while len(self._rest) >= _HEAD.size:
            size, kind = _HEAD.unpack_from(self._rest)
            if size < _HEAD.size:
                raise CodecError(f"a package of {size} bytes", where="rtde")
            if len(self._rest) < size:
                return
            body, self._rest = self._rest[_HEAD.size : size], self._rest[size:]
            if kind == _DATA:
                self._take_inputs(body)
            yield kind, body

    def _answer(self, kind: int, body: bytes) -> bytes:
        match chr(kind):
            case "V":
                return bytes([int.from_bytes(body, "big") == _VERSION])
            case "v":
                return struct.pack(">4I", *self._box.version)
            case "O":
                return self._set_outputs(body)
            case "I":
                return self._set_inputs(body)
            case "S":
                self.rate_hz = self._asked_hz
                return b"\x01"
            case "P":
                self.rate_hz = 0.0
                return b"\x01"
        raise CodecError(f"a package of unknown kind {kind}", where="rtde")

    def _set_outputs(self, body: bytes) -> bytes:
        (asked_hz,) = struct.unpack_from(">d", body)
        self._asked_hz = min(asked_hz, self._box.highest_Hz)
        self.outputs = _names(body[8:])
        return b"\x01" + ",".join(map(type_of, self.outputs)).encode()

    def _set_inputs(self, body: bytes) -> bytes:
        names = _names(body)
        types = self._box.claim(self, names)
        if "IN_USE" in types or "NOT_FOUND" in types:
            return b"\x00" + ",".join(types).encode()
        recipe = len(self._recipes) + 1
        self._recipes[recipe] = names
        return bytes([recipe]) + ",".join(types).encode()

    def _take_inputs(self, body: bytes) -> None:
        at, values = 1, dict[str, Value]()
        for name in self._recipes.get(body[0], []):
            form = ">" + _FORMATS[type_of(name)]
            found = struct.unpack_from(form, body, at)
            values[name] = found[0] if len(found) == 1 else found
            at += struct.calcsize(form)
        self._box.on_inputs(values)


def package(kind: int, body: bytes) -> bytes:
    """The bytes of a package."""
    return _HEAD.pack(_HEAD.size + len(body), kind) + body


def _names(body: bytes) -> list[str]:
    return body.decode("ascii").strip(",").split(",")


def _pack(name: str, value: Value) -> bytes:
    if (type_name := type_of(name)) == "NOT_FOUND":
        return b""
    return struct.pack(">" + _FORMATS[type_name], *(value if isinstance(value, Sequence) else (value,)))
