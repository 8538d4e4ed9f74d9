"""Things that go wrong on a wire, on purpose: a wrapper around any link, and the faults it can inject.

One wrapper injects one fault and counts how often; wrappers can be nested. What a fault must know of a driver's
messages (where its counters and values stand) is said once by the driver's tests in a :class:`MessageLayout`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from drivers.links import Datagram, Link, link_health
from tactile_lab.errors import DeviceError

WORKING_COUNTER_LOW = "working counter low"
SLAVE_TO_SAFEOP = "slave to SAFEOP"


@runtime_checkable
class Injectable(Protocol):
    """A link whose far end can be told to misbehave in its own way, as an EtherCAT ring can."""

    def inject(self, fault: str) -> None:
        """Let the far end do ``fault`` once. Raises ValueError for one it does not know."""


@dataclass(frozen=True)
class When:
    """Which received messages a fault strikes: every ``every``-th from number ``first`` on, ``count`` in all.

    ``share`` strikes at random instead; ``count`` 0 is without end.
    """

    first: int = 10
    every: int = 1
    count: int = 1
    share: float | None = None

    def strikes(self, number: int, struck: int, rng: np.random.Generator) -> bool:
        """Whether message ``number`` (from 0) is struck when ``struck`` were before it."""
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
    """What faults must know of a driver's messages; left out where a message has no such thing.

    Attributes:
        counters: sequence counters.
        values: where the measured values begin and end (one past the last byte).
        seal: makes check bytes right again after a field was changed.
        saturate: the message with a value at its limit, as the device would send it.
    """

    counters: tuple[Field, ...] = ()
    values: tuple[int, int] | None = None
    seal: Callable[[bytes], bytes] | None = None
    saturate: Callable[[bytes], bytes] | None = None

    def sealed(self, payload: bytes) -> bytes:
        """The message with right check bytes."""
        return self.seal(payload) if self.seal else payload


class Fault:
    """One way to go wrong. ``strike`` treats a message that is hit, ``spare`` one that is not."""

    name = "none"

    def strike(self, datagram: Datagram) -> list[Datagram]:
        """What arrives instead of a message that is hit."""
        return [datagram]

    def spare(self, datagram: Datagram) -> list[Datagram]:
        """What arrives for a message that is not hit."""
        return [datagram]

    def held(self) -> list[Datagram]:
        """What was held back and arrives with this reading of the link."""
        return []


class Drop(Fault):
    """The message is lost."""

    name = "drop"

    def strike(self, datagram: Datagram) -> list[Datagram]:
        return []


class Duplicate(Fault):
    """The message arrives twice."""

    name = "duplicate"

    def strike(self, datagram: Datagram) -> list[Datagram]:
        return [datagram, datagram]


class Reorder(Fault):
    """The message arrives behind the next one."""

    name = "reorder"

    def __init__(self) -> None:
        self._late: list[Datagram] = []

    def strike(self, datagram: Datagram) -> list[Datagram]:
        self._late.append(datagram)
        return []

    def spare(self, datagram: Datagram) -> list[Datagram]:
        late, self._late = self._late, []
        return [datagram, *(replace(message, stamp_ns=datagram.stamp_ns) for message in late)]


class Delay(Fault):
    """From the hit on nothing arrives for some readings of the link; then all of it does, stamped late."""

    name = "delay"

    def __init__(self, readings: int = 30) -> None:
        self._readings, self._left = readings, 0
        self._late: list[Datagram] = []

    def strike(self, datagram: Datagram) -> list[Datagram]:
        self._left = self._readings
        return self.spare(datagram)

    def spare(self, datagram: Datagram) -> list[Datagram]:
        if self._left:
            self._late.append(datagram)
            return []
        late, self._late = self._late, []
        return [*(replace(message, stamp_ns=datagram.stamp_ns) for message in late), datagram]

    def held(self) -> list[Datagram]:
        self._left = max(0, self._left - 1)
        return []


class Truncate(Fault):
    """The message's end is missing."""

    name = "truncate"

    def __init__(self, missing: int = 1) -> None:
        self._missing = missing

    def strike(self, datagram: Datagram) -> list[Datagram]:
        return [replace(datagram, payload=datagram.payload[: -self._missing])]


class FlipBit(Fault):
    """One bit of the message is wrong; ``bit`` counts from the first byte's lowest, negative from the end."""

    name = "flip a bit"

    def __init__(self, bit: int) -> None:
        self._bit = bit

    def strike(self, datagram: Datagram) -> list[Datagram]:
        damaged = bytearray(datagram.payload)
        place = self._bit % (8 * len(damaged))
        damaged[place // 8] ^= 1 << place % 8
        return [replace(datagram, payload=bytes(damaged))]


class StaleSequence(Fault):
    """The message carries the counters of the one before it."""

    name = "stale sequence"

    def __init__(self, layout: MessageLayout) -> None:
        self._layout = layout
        self._before: list[int] | None = None

    def strike(self, datagram: Datagram) -> list[Datagram]:
        payload = datagram.payload
        for field, value in zip(self._layout.counters, self._before or [], strict=False):
            payload = field.write(payload, value)
        return [replace(datagram, payload=self._layout.sealed(payload))]

    def spare(self, datagram: Datagram) -> list[Datagram]:
        self._before = [field.read(datagram.payload) for field in self._layout.counters]
        return [datagram]


class CounterWrap(Fault):
    """The device's counters are near their end: from the first message on they run so that one wraps at the hit."""

    name = "counter wrap"

    def __init__(self, layout: MessageLayout, at: int) -> None:
        self._layout, self._at = layout, at
        self._shifts: list[int] | None = None

    def strike(self, datagram: Datagram) -> list[Datagram]:
        return self.spare(datagram)

    def spare(self, datagram: Datagram) -> list[Datagram]:
        payload = datagram.payload
        if self._shifts is None:
            self._shifts = [-field.read(payload) - self._at for field in self._layout.counters]
        for field, shift in zip(self._layout.counters, self._shifts, strict=True):
            payload = field.write(payload, field.read(payload) + shift)
        return [replace(datagram, payload=self._layout.sealed(payload))]


class Saturate(Fault):
    """A value stands at its limit."""

    name = "saturate"

    def __init__(self, layout: MessageLayout) -> None:
        if layout.saturate is None:
            raise ValueError("the layout does not say how a saturated message looks")
        self._saturate = layout.saturate

    def strike(self, datagram: Datagram) -> list[Datagram]:
        return [replace(datagram, payload=self._saturate(datagram.payload))]


class StuckValue(Fault):
    """The measured values do not move any more, and neither does the device's last counter.

    Messages of one length are taken as of one kind.
    """

    name = "stuck value"

    def __init__(self, layout: MessageLayout) -> None:
        if layout.values is None:
            raise ValueError("the layout does not say where the values stand")
        self._layout, (self._from, self._to) = layout, layout.values
        self._kept: dict[int, bytes] = {}

    def strike(self, datagram: Datagram) -> list[Datagram]:
        kept = self._kept.setdefault(len(datagram.payload), datagram.payload)
        payload = datagram.payload[: self._from] + kept[self._from : self._to] + datagram.payload[self._to :]
        if self._layout.counters[1:]:
            field = self._layout.counters[-1]
            payload = field.write(payload, field.read(kept))
        return [replace(datagram, payload=self._layout.sealed(payload))]


class Unplug(Fault):
    """The wire is pulled: from the hit on reading and writing fail, until the link is opened again."""

    name = "unplug"

    def strike(self, datagram: Datagram) -> list[Datagram]:
        raise DeviceError("the wire is unplugged", hint="Plug it in and connect again")


class ClockJump(Fault):
    """The host's clock jumps: from the hit on the stamps are off."""

    name = "clock jump"

    def __init__(self, jump_ns: int) -> None:
        self._jump_ns, self._off_ns = jump_ns, 0

    def strike(self, datagram: Datagram) -> list[Datagram]:
        self._off_ns = self._jump_ns
        return self.spare(datagram)

    def spare(self, datagram: Datagram) -> list[Datagram]:
        return [replace(datagram, stamp_ns=datagram.stamp_ns + self._off_ns)]


class FarEnd(Fault):
    """The far end does something of its own, such as :data:`WORKING_COUNTER_LOW` or :data:`SLAVE_TO_SAFEOP`."""

    def __init__(self, name: str, link: Injectable) -> None:
        self.name, self._link = name, link

    def strike(self, datagram: Datagram) -> list[Datagram]:
        self._link.inject(self.name)
        return [datagram]


class FaultyLink:
    """Any link, with a fault.

    Args:
        link: what to wrap.
        fault: what goes wrong.
        when: which messages it strikes.
        seed: of the random ones.

    Attributes:
        injected: how often the fault struck.
        received: messages that came from the wrapped link while armed.
        armed: whether the fault can strike; while it is not, messages pass.
    """

    def __init__(self, link: Link, fault: Fault, when: When | None = None, seed: int = 0) -> None:
        self.name, self._link, self.fault = link.name, link, fault
        self.injected = self.received = 0
        self._when, self._rng = when or When(), np.random.default_rng(seed)
        self.armed = True
        self._unplugged = False

    def open(self) -> None:
        """Open the wrapped link; plugs an unplugged wire in."""
        self._link.open()
        self._unplugged = False

    def close(self) -> None:
        """Close the wrapped link."""
        self._link.close()

    def send(self, payload: bytes) -> None:
        """Send one message. Raises DeviceError, also while unplugged."""
        self._check_plug()
        self._link.send(payload)

    def receive(self) -> list[Datagram]:
        """What arrives, faults included. Raises DeviceError, also while unplugged."""
        self._check_plug()
        if not self.armed:
            return self._link.receive()
        arrived = self.fault.held()
        for datagram in self._link.receive():
            arrived += self._treat(datagram)
        return arrived

    def health(self) -> tuple[str, ...]:
        """What the wrapped link knows to be wrong."""
        return link_health(self._link)

    def inject(self, fault: str) -> None:
        """Pass a far end's fault on. Raises ValueError when the wrapped link knows none."""
        if not isinstance(self._link, Injectable):
            raise ValueError(f"{self.name}: the far end of this link has no fault {fault!r}")
        self._link.inject(fault)

    def _treat(self, datagram: Datagram) -> list[Datagram]:
        struck = self._when.strikes(self.received, self.injected, self._rng)
        self.received += 1
        if not struck:
            return self.fault.spare(datagram)
        self.injected += 1
        try:
            return self.fault.strike(datagram)
        except DeviceError as error:
            self._unplugged = True
            raise DeviceError(error.what, where=self.name, hint=error.hint) from error

    def _check_plug(self) -> None:
        if self._unplugged:
            raise DeviceError("the wire is unplugged", where=self.name, hint="Plug it in and connect again")


def standard_faults(layout: MessageLayout) -> dict[str, tuple[Fault, When]]:
    """A fresh fault of every kind that a driver with such messages can meet, by name, with its schedule."""
    faults: list[tuple[Fault, When]] = [
        (Drop(), When(count=3, every=4)),
        (Duplicate(), When(count=3, every=4)),
        (Reorder(), When(count=3, every=4)),
        (Delay(), When()),
        (Truncate(), When(count=3, every=4)),
        (FlipBit(-2), When(count=3, every=4)),
        (Unplug(), When()),
        (ClockJump(10_000_000_000), When()),
    ]
    if layout.counters:
        faults += [(StaleSequence(layout), When(count=3, every=4)), (CounterWrap(layout, at=10), When())]
    if layout.saturate:
        faults.append((Saturate(layout), When(count=3, every=4)))
    if layout.values:
        faults.append((StuckValue(layout), When(count=0)))
    return {fault.name: (fault, when) for fault, when in faults}
