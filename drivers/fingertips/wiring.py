"""How a rig file says where the readings of a finger come from: ``{wire: NAME, ...}``, the rest as that wire has it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import BeforeValidator, SerializeAsAny

from drivers.ati.wires.wire import ForceWire
from drivers.core.clock import Clock
from drivers.core.transports import Transport
from drivers.fingertips.kinds import WIRES
from drivers.force.wire_settings import WireSettings


def _of_its_kind(given: Any) -> Any:
    """Settings by the model of the wire that they name. Raises ValueError for a wire that is not registered."""
    if not isinstance(given, Mapping):
        return given
    name = given.get("wire")
    if not isinstance(name, str):
        raise ValueError(f"wire: is missing. {WIRES.listed()}")
    return WIRES[WIRES.known(name)].settings.model_validate(given)


Wiring: TypeAlias = Annotated[SerializeAsAny[WireSettings], BeforeValidator(_of_its_kind)]
"""What a rig file says of one finger's wire."""


def make_transport(wiring: WireSettings, name: str, clock: Clock) -> Transport:
    """The transport to the device, not yet open."""
    return WIRES[wiring.wire].transport(wiring, name, clock)


def make_wire(wiring: WireSettings, folder: Path) -> ForceWire:
    """How the device's messages are read; ``folder`` is that of the rig file.

    Raises:
        ConfigurationError: a calibration file cannot be used; CodecError: it is in counts, not volts.
    """
    return WIRES[wiring.wire].decoder(wiring, folder)


def place_of(wiring: WireSettings) -> str:
    """Where a wire ends, in words."""
    return WIRES[wiring.wire].place(wiring)
