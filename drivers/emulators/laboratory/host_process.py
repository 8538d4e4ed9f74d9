"""The laboratory's side of an emulator's process."""

from __future__ import annotations

from typing import Any

from drivers.core.child_process import ChildProcess
from drivers.core.orders import Order

_START_s = 60.0


class HostProcess:
    """One emulator in a separate process.

    Args:
        name: name of the device, for messages.
        role: one of :data:`drivers.emulators.laboratory.host.ROLES`, or a module with a ``make`` function of the same
            kind.
        start: arguments for the emulator.
    """

    def __init__(self, name: str, role: str, **start: Any) -> None:
        self.name, self._start = name, {"role": role, **start}
        self._child = ChildProcess("drivers.emulators.laboratory.host", f"emulated {name}")

    def start(self) -> None:
        """Start it, without waiting until it serves."""
        self._child.start(self._start)

    def await_ready(self) -> None:
        """Wait until it serves.

        Raises:
            DeviceError: it does not start; the message is its own.
        """
        self._child.ready(_START_s)

    @property
    def running(self) -> bool:
        """Whether its process is running."""
        return self._child.running

    def give(self, order: Order) -> None:
        """Send it an event from outside, such as a person's action on its device. Raises DeviceError if it is gone."""
        self._child.give(order)

    def kill(self) -> None:
        """Kill it at once, like a power cut."""
        self._child.kill()

    def close(self) -> None:
        """End it; idempotent."""
        self._child.close()
