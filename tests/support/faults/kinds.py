"""The kinds of faults of a wire, and of the device at its end."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram
from tests.support.faults.schedule import MessageLayout, When

WORKING_COUNTER_LOW = "working counter low"
SLAVE_TO_SAFEOP = "slave to SAFEOP"


@runtime_checkable
class Injectable(Protocol):
    """A transport whose far end has faults of its own, like an EtherCAT ring."""

    def inject(self, fault: str) -> None:
        """Let the far end have ``fault`` once. Raises ValueError for an unknown one."""


class Fault:
    """One kind of fault. ``strike`` processes a message that is hit, ``spare`` one that is not."""

    name = "none"

    def strike(self, datagram: Datagram) -> list[Datagram]:
        """What arrives instead of a message that is hit."""
        return [datagram]

    def spare(self, datagram: Datagram) -> list[Datagram]:
        """What arrives for a message that is not hit."""
        return [datagram]

    def release_held(self) -> list[Datagram]:
        """Messages held back before that arrive with this reading of the transport."""
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
    """The message arrives after the next one."""

    name = "reorder"

    def __init__(self) -> None:
        self._late: list[Datagram] = []

    def strike(self, datagram: Datagram) -> list[Datagram]:
        self._late.append(datagram)
        return []

    def spare(self, datagram: Datagram) -> list[Datagram]:
        late, self._late = self._late, []
        return [datagram, *(message._replace(stamp_ns=datagram.stamp_ns) for message in late)]


class Delay(Fault):
    """From the hit on nothing arrives for some readings of the transport; then everything arrives, with late stamps."""

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
        return [*(message._replace(stamp_ns=datagram.stamp_ns) for message in late), datagram]

    def release_held(self) -> list[Datagram]:
        self._left = max(0, self._left - 1)
        return []


class Truncate(Fault):
    """The message's end is missing."""

    name = "truncate"

    def __init__(self, missing: int = 1) -> None:
        self._missing = missing

    def strike(self, datagram: Datagram) -> list[Datagram]:
        return [datagram._replace(payload=datagram.payload[: -self._missing])]


class FlipBit(Fault):
    """One bit of the message is wrong; ``bit`` counts from the first byte's lowest bit, or backwards from the end if
    negative.
    """

    name = "flip a bit"

    def __init__(self, bit: int) -> None:
        self._bit = bit

    def strike(self, datagram: Datagram) -> list[Datagram]:
        damaged = bytearray(datagram.payload)
        place = self._bit % (8 * len(damaged))
        damaged[place // 8] ^= 1 << place % 8
        return [datagram._replace(payload=bytes(damaged))]


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
        return [datagram._replace(payload=self._layout.sealed(payload))]

    def spare(self, datagram: Datagram) -> list[Datagram]:
        self._before = [field.read(datagram.payload) for field in self._layout.counters]
        return [datagram]


class CounterWrap(Fault):
    """The device's counters are near overflow: from the first message on they are such that one wraps at the hit."""

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
        return [datagram._replace(payload=self._layout.sealed(payload))]


class Saturate(Fault):
    """A value is at its limit."""

    name = "saturate"

    def __init__(self, layout: MessageLayout) -> None:
        if layout.saturate is None:
            raise ValueError("the layout does not say how a saturated message looks")
        self._saturate = layout.saturate

    def strike(self, datagram: Datagram) -> list[Datagram]:
        return [datagram._replace(payload=self._saturate(datagram.payload))]


class StuckValue(Fault):
    """The measured values do not change any more, and neither does the device's last counter.

    Messages of equal length count as the same kind.
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
        return [datagram._replace(payload=self._layout.sealed(payload))]


class Unplug(Fault):
    """The wire is unplugged: from the hit on reading and writing fail, until the transport is opened again."""

    name = "unplug"

    def strike(self, datagram: Datagram) -> list[Datagram]:
        raise DeviceError("the wire is unplugged", hint="Plug it in and connect again")


class ClockJump(Fault):
    """The host's clock jumps: from the hit on the stamps are wrong."""

    name = "clock jump"

    def __init__(self, jump_ns: int) -> None:
        self._jump_ns, self._off_ns = jump_ns, 0

    def strike(self, datagram: Datagram) -> list[Datagram]:
        self._off_ns = self._jump_ns
        return self.spare(datagram)

    def spare(self, datagram: Datagram) -> list[Datagram]:
        return [datagram._replace(stamp_ns=datagram.stamp_ns + self._off_ns)]


class FarEnd(Fault):
    """The far end has a fault of its own, such as :data:`WORKING_COUNTER_LOW` or :data:`SLAVE_TO_SAFEOP`."""

    def __init__(self, name: str, transport: Injectable) -> None:
        self.name, self._transport = name, transport

    def strike(self, datagram: Datagram) -> list[Datagram]:
        self._transport.inject(self.name)
        return [datagram]


def standard_faults(layout: MessageLayout) -> dict[str, tuple[Fault, When]]:
    """A new fault of every kind that is possible with such messages, by name, with its schedule."""
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
