"""A rig with force fingertips only: which sensor is on which wire. It can be checked, but not run without a hand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.core.clock import Clock
from drivers.core.configuration import StrictModel, load, validate
from drivers.core.contacts import FINGERS
from drivers.core.errors import CodecError, ConfigurationError
from drivers.core.fingertip import FingertipCalibration, load_fingertips
from drivers.fingertips.wiring import Wiring, make_transport, make_wire, place_of
from drivers.force.wire_settings import WireSettings
from sessions.perception.interpreter import fingertip_link

KIND = "fingertips"


def one_place_each(wires: dict[str, WireSettings]) -> dict[str, WireSettings]:
    """Check that the fingers are known and their wires distinct. Raises ValueError."""
    if unknown := sorted(set(wires) - set(FINGERS)):
        raise ValueError(f"unknown finger {', '.join(unknown)}; the fingers are {', '.join(FINGERS)}")
    taken: dict[str, str] = {}
    for finger, wiring in wires.items():
        if (place := place_of(wiring)) in taken:
            raise ValueError(f"{taken[place]} and {finger} both use {place}")
        taken[place] = finger
    return wires


class FingertipRigDescription(StrictModel):
    """A rig file of kind ``fingertips``.

    Attributes:
        name, summary: for people.
        calibration: the fingertips' calibration file, relative to the rig file.
        nano17: settings of every sensor.
        wires: finger to wire.
    """

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    summary: str
    kind: Literal["fingertips"]
    calibration: str = Field(min_length=1)
    nano17: Nano17Settings = Nano17Settings()
    wires: Annotated[dict[str, Wiring], Field(min_length=1), AfterValidator(one_place_each)]


@dataclass(frozen=True)
class FingertipRig:
    """A description with the content of its files."""

    description: FingertipRigDescription
    calibrations: dict[str, FingertipCalibration]
    folder: Path
    source: str

    def device(self, finger: str, clock: Clock, wiring: WireSettings | None = None) -> Nano17:
        """The sensor of a finger on its wire, or on another that is tried; not connected.

        Raises:
            ConfigurationError: a calibration file that the wire names cannot be used.
        """
        used, calibration = wiring or self.description.wires[finger], self.calibrations[finger]
        try:
            wire = make_wire(used, self.folder)
        except CodecError as error:
            raise ConfigurationError(error.what, where=f"{self.source}: wires.{finger}", hint=error.hint) from error
        link = make_transport(used, fingertip_link(finger), clock)
        return Nano17(finger, link, clock, calibration, self.description.nano17, wire)


def is_fingertip_rig(path: Path) -> bool:
    """Whether a file is a rig file of kind fingertips. Raises ConfigurationError if it is not YAML."""
    content = load(path)
    return isinstance(content, dict) and content.get("kind") == KIND


def load_fingertip_rig(path: Path) -> FingertipRig:
    """Read a rig file of kind ``fingertips`` and every file that it names.

    Raises:
        ConfigurationError: a file that does not fit, or a finger without calibration.
    """
    description = validate(load(path), FingertipRigDescription, where=str(path))
    calibrations = load_fingertips(path.parent / description.calibration)
    if missing := sorted(set(description.wires) - set(calibrations)):
        raise ConfigurationError(
            f"the fingertip calibration {description.calibration} does not name {', '.join(missing)}",
            where=str(path),
            hint="Calibrate the finger, or remove it from wires",
        )
    return FingertipRig(description, calibrations, path.parent, str(path))
