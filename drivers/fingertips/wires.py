"""What the program has to know of a way in which the readings of a fingertip with a link of its own arrive."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Generic, TypeVar

from drivers.ati.wires.wire import ForceWire
from drivers.core.clock import Clock
from drivers.core.transports import Transport
from drivers.force.wire_settings import WireSettings

Settings = TypeVar("Settings", bound=WireSettings)


class WireKind(ABC, Generic[Settings]):
    """One way. Subclass it, and register an object of the subclass in
    :data:`drivers.fingertips.kinds.WIRES`.

    Attributes:
        settings: model of what a rig file says.
        emulator_host: for emulated laboratories, the module that serves such a device, fed by the simulated plant (see
            :mod:`drivers.emulators.laboratory.net_box_host`); empty where there is none.
    """

    settings: type[Settings]
    emulator_host: str = ""

    @abstractmethod
    def transport(self, settings: Settings, name: str, clock: Clock) -> Transport:
        """What carries the bytes, not yet open; ``name`` is that of recordings."""

    @abstractmethod
    def decoder(self, settings: Settings, folder: Path) -> ForceWire:
        """How bytes are decoded, and what is sent to the device.

        Args:
            folder: of the rig file.

        Raises:
            ConfigurationError, CodecError: a file that the settings name cannot be used.
        """

    @abstractmethod
    def place(self, settings: Settings) -> str:
        """Where the wire ends, in words; two sensors never share it."""

    def files(self, settings: Settings) -> Mapping[str, str]:
        """Files that the settings name, relative to the rig file, by the setting; a session keeps copies of them."""
        return {}

    def alternatives(self, settings: Settings) -> tuple[Settings, ...]:
        """Other settings under which a silent device might answer, for ``rig check`` to try."""
        return ()
