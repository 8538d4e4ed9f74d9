"""A rig of a real hand alone: how it is reached, and its calibration. It can be checked, not run: nothing bears it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import Field

from drivers.links import Link
from drivers.shadow.ethercat_link import EthercatLink, EthercatSettings
from drivers.shadow.hand import ShadowHand
from drivers.shadow.hand_settings import HandSettings
from drivers.shadow.joint_calibration import JointCalibration
from drivers.shadow.motor_configuration import load_configurations
from drivers.shadow.motor_polling import load_rates
from drivers.shadow.motors import MotorMap
from drivers.shadow.pysoem_link import PysoemLink
from tactile_lab.clock import Clock
from tactile_lab.errors import ConfigurationError
from tactile_lab.strict_yaml import StrictModel, load, validate

KIND = "hand"


class HandFiles(StrictModel):
    """Files of this very hand, relative to the rig file; those of Shadow's configuration folder can be used.

    Attributes:
        joints: joint sensor tables (``calibration.yaml``).
        motors: which motor pulls which joint; a wrong one can damage the hand.
        boards: settings of the motor boards (``motor_board_effort_controllers.yaml``); they keep theirs when left out.
        rates: how often motors are asked for what (``motor_data_polling.yaml``); in place of ``hand.polling``.
    """

    joints: str
    motors: str
    boards: str | None = None
    rates: str | None = None


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
    master: Literal["own", "pysoem"] = "own"
    hand: HandSettings = HandSettings(cycle_s=0.002)
    far_end: str | None = None


@dataclass(frozen=True)
class HandRig:
    """A description with the folder its files are in."""

    description: HandRigDescription
    folder: Path
    source: str

    @property
    def settings(self) -> HandSettings:
        """How the hand is driven, with the polling rates of the file that is named. Raises ConfigurationError."""
        rates = self.description.calibration.rates
        if rates is None:
            return self.description.hand
        return self.description.hand.model_copy(update={"polling": load_rates(self.folder / rates)})

    def link(self, clock: Clock) -> Link:
        """The hand's link, not open. Raises ConfigurationError when the master is not installed."""
        wanted = self.description.hand.palm
        settings = self.description.ethercat.model_copy(update={"palm": wanted})
        return (EthercatLink if self.description.master == "own" else PysoemLink)("hand", settings, clock)

    def hand(self, link: Link, clock: Clock, *, set_up_boards: bool) -> ShadowHand:
        """The hand on a link, not connected. Raises ConfigurationError for a file that can not be used.

        Args:
            link: from :meth:`link`, or one around it.
            clock: the session's.
            set_up_boards: upload the motor boards' settings when connecting.
        """
        files = self.description.calibration
        boards = load_configurations(self.folder / files.boards) if files.boards else None
        return ShadowHand(
            link,
            clock,
            JointCalibration.load(self.folder / files.joints),
            self.settings,
            MotorMap.load(self.folder / files.motors),
            boards if set_up_boards else None,
        )


def is_hand_rig(path: Path) -> bool:
    """Whether a file calls itself a rig of a hand. Raises ConfigurationError when it is no YAML."""
    content = load(path)
    return isinstance(content, dict) and content.get("kind") == KIND


def load_hand_rig(path: Path) -> HandRig:
    """Read a rig file of kind ``hand``.

    Raises:
        ConfigurationError: it does not fit, or names a palm twice.
    """
    description = validate(load(path), HandRigDescription, where=str(path))
    if description.ethercat.palm not in (None, description.hand.palm):
        hint = "Name the palm under hand alone"
        raise ConfigurationError("hand.palm and ethercat.palm differ", where=str(path), hint=hint)
    return HandRig(description, path.parent, str(path))
