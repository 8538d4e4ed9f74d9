"""When a fault strikes, and what it must know of the messages that it damages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class When:
    """Which received messages a fault strikes: every ``every``-th from number ``first`` on, ``count`` in all.

    With ``share`` it strikes at random instead; ``count`` 0 means no limit.
    """

    first: int = 10
    every: int = 1
    count: int = 1
    share: float | None = None

    def strikes(self, number: int, struck: int, rng: np.random.Generator) -> bool:
        """Whether message ``number`` (from 0) is struck, after ``struck`` earlier ones were."""
        if number < self.first or (self.count and struck >= self.count):
            return False
        return bool(rng.random() < self.share) if self.share is not None else (number - self.first) % self.every == 0


@dataclass(frozen=True)
class Field:
    """An unsigned counter inside a message."""

    offset: int
    size: int
    order: Literal["big", "little"] = "big"

    def read(self, payload: bytes) -> int:
        """Its value."""
        return int.from_bytes(payload[self.offset : self.offset + self.size], self.order)

    def write(self, payload: bytes, value: int) -> bytes:
        """The message with another value, which wraps."""
        word = (value % (1 << 8 * self.size)).to_bytes(self.size, self.order)
        return payload[: self.offset] + word + payload[self.offset + self.size :]


@dataclass(frozen=True)
class MessageLayout:
    """What faults must know of a driver's messages; omitted if messages have no such part.

    Attributes:
        counters: sequence counters.
        values: start and end of the measured values (one past the last byte).
        seal: corrects check bytes after a field was changed.
        saturate: returns the message with a value at its limit, as the device would send it.
    """

    counters: tuple[Field, ...] = ()
    values: tuple[int, int] | None = None
    seal: Callable[[bytes], bytes] | None = None
    saturate: Callable[[bytes], bytes] | None = None

    def sealed(self, payload: bytes) -> bytes:
        """The message with correct check bytes."""
        return self.seal(payload) if self.seal else payload
