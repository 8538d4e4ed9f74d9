"""A rig with a real hand only: its connection and calibration. It can be checked, but not run without a positioner."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import Field

from drivers.core.configuration import StrictModel, load, validate
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.hand_setup import HandSetup, Master
from drivers.shadow.ethercat.hand_transport import EthercatSettings

KIND = "hand"


class HandFiles(StrictModel):
    """Files of this very hand, relative to the rig file; those of Shadow's configuration folder can be used.

    Attributes:
        joints: joint sensor tables (``calibration.yaml``).
        motors: which motor pulls which joint; a wrong one can damage the hand.
        boards: settings of the motor boards (``motor_board_effort_controllers.yaml``); they keep theirs when left out.
        rates: how often each type is requested from the motors (``motor_data_polling.yaml``); in place of
            ``hand.polling``.
        gains: position control (``sr_edc_joint_position_controllers_PWM.yaml``); in place of ``hand.gains``.
    """

    joints: str
    motors: str
    boards: str | None = None
    rates: str | None = None
    gains: str | None = None


class HandRigDescription(StrictModel):
    """A rig file of kind ``hand``.

    Attributes:
        name, summary: for people.
        calibration: this hand's files.
        ethercat: how it is reached.
        master: our own EtherCAT master, or ``pysoem`` (the ``[ethercat]`` extra).
        hand: how it is driven.
        far_end: network interface that ``rig emulate`` serves, the other end of ``ethercat.interface``'s cable.
    """

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    summary: str
    kind: Literal["hand"]
    calibration: HandFiles
    ethercat: EthercatSettings
    master: Master = "own"
    hand: HandSettings = HandSettings()
    far_end: str | None = None


@dataclass(frozen=True)
class HandRig:
    """A description with the folder its files are in."""

    description: HandRigDescription
    folder: Path
    source: str

    @property
    def files(self) -> dict[str, Path]:
        """The files of this hand where they lie, by role."""
        named = self.description.calibration.model_dump(exclude_none=True)
        return {role: self.folder / file for role, file in named.items()}

    @property
    def setup(self) -> HandSetup:
        """The hand, with its files."""
        description = self.description
        ways = {"ethercat": description.ethercat, "master": description.master, "hand": description.hand.on_wire}
        return HandSetup.model_validate(ways | self.files)


def is_hand_rig(path: Path) -> bool:
    """Whether a file is a rig file of kind hand. Raises ConfigurationError if it is not YAML."""
    content = load(path)
    return isinstance(content, dict) and content.get("kind") == KIND


def load_hand_rig(path: Path) -> HandRig:
    """Read a rig file of kind ``hand``.

    Raises:
        ConfigurationError: it does not fit.
    """
    description = validate(load(path), HandRigDescription, where=str(path))
    return HandRig(description, path.parent, str(path))
