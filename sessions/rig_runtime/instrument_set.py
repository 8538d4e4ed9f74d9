"""All devices of a rig, connected one after the other and closed in the opposite order."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

from drivers.core.errors import DeviceError, TactileLabError
from sessions.perception.instruments import CyclingInstrument, Instrument, WatchedInstrument


class InstrumentSet:
    """The devices.

    Args:
        hand, base, camera: see :class:`~sessions.rig_runtime.rig_runtime.RigRuntime`.
        wrench_devices: of the fingertips' own transports, by finger; looked up each time.
    """

    def __init__(
        self,
        hand: Instrument,
        base: Instrument,
        wrench_devices: Mapping[str, Instrument],
        camera: Instrument | None,
    ) -> None:
        self._hand, self._base, self._camera = hand, base, camera
        self._wrench_devices = wrench_devices

    def connect(self) -> None:
        """Connect each device. What a hand in its own process sends meanwhile is recorded. Raises DeviceError."""
        for instrument in self._instruments():
            instrument.connect()
            if isinstance(self._hand, CyclingInstrument):
                self._hand.catch_up()

    def close(self) -> list[TactileLabError]:
        """Close each device, even if another fails. Returns the errors."""
        problems: list[TactileLabError] = []
        for instrument in reversed(self._instruments()):
            try:
                instrument.close()
            except TactileLabError as error:
                problems.append(error)
        return problems

    def problems(self, *, ask: bool = False) -> list[str]:
        """Problems of the devices, each beginning with the device's name.

        Args:
            ask: also ask a hand in its own process, which may have to be waited for.
        """
        named = {"hand": self._hand, "base": self._base, **self._wrench_devices, "camera": self._camera}
        if isinstance(self._hand, CyclingInstrument) and not ask:
            del named["hand"]
        found: list[str] = []
        for name, device in named.items():
            if isinstance(device, WatchedInstrument):
                with suppress(DeviceError):  # one that is gone has said so
                    found += [f"{name}: {words.removeprefix(f'{name}: ')}" for words in device.health()]
        return found

    def _instruments(self) -> list[Instrument]:
        camera = [] if self._camera is None else [self._camera]
        return [self._hand, self._base, *self._wrench_devices.values(), *camera]
