"""Protocols that the sessions package expects of devices, samples and fingertips, implemented by the drivers.

An *instrument* is a live device with a transport. A *decoder* is the half of a device that turns one received datagram
into a sample and does nothing else; live and in a replay the session's samples come only from decoders.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.fingertip import FingertipSensor
from drivers.core.transports import Datagram

Sample_co = TypeVar("Sample_co", covariant=True)


class HandReading(Protocol):
    """Joint angles of the hand, shape (24,), radians, and when they arrived."""

    @property
    def stamp_ns(self) -> int: ...
    @property
    def joints_rad(self) -> Array: ...
    @property
    def fresh(self) -> bool: ...


def warmest_C(reading: object) -> float | None:
    """Temperature of the warmest motor in a sample of the hand; None while unknown.

    A hand that measures them has them near its motors, shape (20,), degrees Celsius; NaN if unknown.
    """
    temperature_C = getattr(getattr(reading, "motor", None), "temperature_C", None)
    if temperature_C is None or not (known := np.isfinite(temperature_C)).any():
        return None
    return float(temperature_C[known].max())


def motor_torques(reading: object, fitted: NDArray[np.bool_] | None = None) -> Array | None:
    """Strain-gauge counts of the motors in a sample of the hand, shape (20,); None before all have reported.

    Args:
        reading: the sample.
        fitted: which motors the hand has, shape (20,), the others count as 0; None: all.
    """
    torques = getattr(getattr(reading, "motor", None), "torque", None)
    if not isinstance(torques, np.ndarray):
        return None
    known = torques if fitted is None else np.where(fitted, torques, 0.0)
    return known if np.isfinite(known).all() else None


class BaseReading(Protocol):
    """Joint positions of the positioner, shape (6,), metres and radians."""

    @property
    def stamp_ns(self) -> int: ...
    @property
    def q(self) -> Array: ...


class FrameReading(Protocol):
    """One camera image."""

    @property
    def stamp_ns(self) -> int: ...
    @property
    def picture(self) -> Any:
        """As the camera encoded it."""

    @property
    def image(self) -> Any:
        """Its grey levels."""


class Decoder(Protocol[Sample_co]):
    """The receiving half of a device.

    ``receive`` may keep state of its own transport (sequence numbers, the newest motor readings) and may read its
    clock; it must use nothing else, or a replay would differ from the session.
    """

    def receive(self, datagram: Datagram) -> Sample_co | None:
        """The sample in a datagram; None if it has none. Raises CodecError for bytes of another protocol."""


class WrenchFingertip(FingertipSensor, Protocol):
    """A fingertip with its own transport."""

    def update(self, samples: Sequence[Any], /) -> None:
        """Take the samples of one datagram."""


class SlotFingertip(FingertipSensor, Protocol):
    """A fingertip whose data come inside the hand's samples."""

    def update(self, sample: Any, /) -> None:
        """Take one sample of the hand."""


class Instrument(Protocol):
    """Something that can be connected and closed."""

    def connect(self) -> None:
        """Connect completely or not at all; can be repeated. Raises DeviceError."""

    def close(self) -> None:
        """Idempotent."""


class HandInstrument(Instrument, Protocol):
    """The live hand."""

    def set_targets(self, targets_rad: Mapping[str, float], /) -> None:
        """Set joint targets by motor name, J0 for a coupled pair; other motors keep theirs."""

    def exchange(self) -> object:
        """One cycle: send demands, receive and decode."""

    def stop(self) -> None:
        """Send no demands from now on; never raises."""

    def resume(self) -> None:
        """Reset a stop or a fault; nothing moves before new targets are set."""

    def health(self) -> tuple[str, ...]:
        """What is wrong, as sentences; empty if all is well."""

    def losses(self) -> Mapping[str, int]:
        """Missing traffic since connecting, by kind. Raises DeviceError if unknown."""


class BaseInstrument(Instrument, Protocol):
    """The live positioner."""

    def set_target(self, q: Array, /) -> None:
        """Set joint targets, shape (6,), metres and radians."""

    def exchange(self) -> object:
        """One cycle: send targets, receive and decode."""

    def stop(self) -> None:
        """Hold the present position; never raises."""

    def resume(self) -> None:
        """Reset a stop or a fault; the target becomes the present position."""


@runtime_checkable
class WatchedInstrument(Protocol):
    """A device that reports its problems."""

    def health(self) -> tuple[str, ...]:
        """In words; empty when all is well."""


class PolledInstrument(Instrument, Protocol):
    """A device that sends by itself and is read once per cycle."""

    def poll(self) -> object:
        """Read everything that has arrived."""


@runtime_checkable
class AskedInstrument(Protocol):
    """A device that may send only on request."""

    def ask(self) -> None:
        """Request the next reading, if the device needs it. Raises DeviceError."""


@runtime_checkable
class NamedInstrument(Protocol):
    """A device that can identify itself."""

    @property
    def identity(self) -> str:
        """Serial number and firmware, read when it was connected; empty if unknown."""


@runtime_checkable
class CyclingInstrument(Protocol):
    """A device whose cycles run in another process, independent of the session."""

    def catch_up(self) -> None:
        """Pass what has arrived since the last call to the tap. Raises DeviceError."""

    def description(self) -> str:
        """What was found when it was connected, as sentences."""


class CameraInstrument(Instrument, Protocol):
    """The live camera."""

    def ask(self) -> None:
        """Trigger the camera; :meth:`taken` returns the picture. Raises DeviceError."""

    def take_picture(self) -> FrameReading | None:
        """The requested picture; None until it arrives. Raises DeviceError if it does not arrive in time."""


@runtime_checkable
class WatchingCamera(Protocol):
    """A camera that sends markers by itself."""

    def poll(self) -> None:
        """Read what it has sent, so that it is recorded in time. Raises DeviceError."""
