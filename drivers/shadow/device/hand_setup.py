"""Everything that is needed to reach and drive one real hand, in a form that can be handed to another process."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from drivers.core.clock import Clock
from drivers.core.configuration import StrictModel
from drivers.core.errors import ConfigurationError
from drivers.core.transports import Transport
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.motor_polling import load_rates
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport, find_palm
from drivers.shadow.ethercat.pysoem_transport import PysoemTransport
from drivers.shadow.model.gains import GainTable, load_gains
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.hand_info import HandInfo, HandStatement, check_map, load_infos, stated_form, stated_serial
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINT_INDEX
from drivers.shadow.model.motors import MotorMap, angles_of_driven
from drivers.shadow.protocol.motor_configuration import load_configurations
from drivers.shadow.protocol.motor_data import MAX_PWM
from drivers.shadow.protocol.palm_images import PalmName

Master = Literal["own", "pysoem"]


class HandSetup(StrictModel):
    """A hand on its cable.

    Attributes:
        name: the device's name in the rig.
        ethercat: how it is reached.
        master: our own EtherCAT master, or ``pysoem`` (the ``[ethercat]`` extra).
        hand: how it is driven; ``cycle_s`` is the period of its cycle.
        joints, motors: calibration files of this very hand.
        boards: settings to upload to the motor boards when connecting; they keep theirs when left out.
        rates: how often each type is requested from the motors, in place of ``hand.polling``.
        gains: position control as Shadow delivers it (``sr_edc_joint_position_controllers_PWM.yaml``), in place of
            ``hand.gains``; its signs state which motors turn backwards.
    """

    name: str = "hand"
    ethercat: EthercatSettings
    master: Master = "own"
    hand: HandSettings
    joints: Path
    motors: Path
    boards: Path | None = None
    rates: Path | None = None
    gains: Path | None = None

    def with_known_palm(self, clock: Clock) -> HandSetup:
        """The same hand with its palm named: as stated, else by the palm's product code on the ring.

        Raises:
            DeviceError: what is missing on the ring or wrong, and what to do.
        """
        palm = self.stated_palm or find_palm(self.wiring(), clock)
        return self.model_copy(update={"hand": self.hand.model_copy(update={"palm": palm})})

    @property
    def stated_palm(self) -> PalmName | None:
        """The palm that a file names, of the hand or of its cable; None if the ring decides."""
        return self.hand.palm if self.hand.palm_stated else self.ethercat.palm

    def settings(self) -> HandSettings:
        """How the hand is driven, with the polling rates and gains of the files. Raises ConfigurationError."""
        changes: dict[str, object] = {} if self.rates is None else {"polling": load_rates(self.rates)}
        if self.gains is not None:
            changes["gains"] = self._gains(self.gains)
        return self.hand.model_copy(update=changes)

    def _gains(self, file: Path) -> GainTable:
        form = self.form()
        driven, published = form.driven, load_gains(file, form.driven)
        if published.told_side not in (None, form.side):
            sides = f"is of a {published.told_side} hand, and the hand is a {form.side} one"
            what = f"{sides}: motors would turn the wrong way"
            raise ConfigurationError(what, where=str(file), hint="Name the table of the connected hand")
        table = published.table
        strongest = max(driven, key=lambda joint: table.of(joint).max_pwm)
        if self.hand.demand == "pwm" and (most := table.of(strongest).max_pwm) > MAX_PWM:
            what = f"max_force of {strongest} is {most:g}, but the largest duty cycle is {MAX_PWM}"
            hint = "Name the hand's PWM table, or set hand.demand to torque if this is its table for torques"
            raise ConfigurationError(what, where=str(file), hint=hint)
        return table

    def transport(self, clock: Clock) -> EthercatTransport | PysoemTransport:
        """The hand's transport, not open; to a palm that is :meth:`known`.

        Raises:
            ConfigurationError: the master is not installed, or two places name different palms.
        """
        if self.ethercat.palm not in (None, self.hand.palm):
            raise ConfigurationError(
                "hand.palm and the cable's palm differ", where=self.name, hint="Give the palm under hand only"
            )
        settings = self.wiring().model_copy(update={"palm": self.hand.palm})
        return (EthercatTransport if self.master == "own" else PysoemTransport)(self.name, settings, clock)

    def check_files(self) -> None:
        """Read every file that is named, and compare them with the files next to them. Raises ConfigurationError."""
        check_map(self.motors, self.infos())
        self.wiring()
        self._refuse_blind_joints()
        self.motor_map()
        if self.boards is not None:
            load_configurations(self.boards, self.form().driven)

    def _refuse_blind_joints(self) -> None:
        gains, turns = self.settings().gains, self.calibration().turns
        for name in self.form().driven:
            seen = any(turns[JOINT_INDEX[joint]] for joint in angles_of_driven(name))
            if not seen and gains.of(name).is_driven:
                what = (
                    f"has the same angle of {name} at every count, but its gains drive it: it would be pushed blindly"
                )
                hint = f"Calibrate {name}; if it is fixed, name the hand's own gains, whose max_force of it is 0"
                raise ConfigurationError(what, where=str(self.joints), hint=hint)

    def infos(self) -> dict[Path, HandInfo]:
        """What the hand's own folders say of it, by file. Raises ConfigurationError."""
        files = (self.joints, self.motors, self.boards, self.rates, self.gains)
        return load_infos(file for file in files if file is not None)

    def form(self) -> HandForm:
        """Which hand it is, by its files and the rig's. Raises ConfigurationError."""
        stated = HandStatement(f"{self.name} in the rig file", self.hand.side or self.ethercat.side, self.hand.fingers)
        return stated_form(self.motors, self.infos(), stated)

    def wiring(self) -> EthercatSettings:
        """How the hand is reached, with the side and the serial number that it must have. Raises ConfigurationError."""
        serial, stated = stated_serial(self.infos()), self.ethercat.serial
        if None not in (serial, stated) and serial != stated:
            what = f"names hand {stated}, but its files are those of hand {serial}"
            hint = "Use the files of the connected hand; its serial number is the folder's name"
            raise ConfigurationError(what, where=f"{self.name} in the rig file", hint=hint)
        side = self.form().side
        return self.ethercat.model_copy(update={"side": side, "serial": serial if stated is None else stated})

    def calibration(self) -> JointCalibration:
        """The calibration of the hand's joints. Raises ConfigurationError."""
        return JointCalibration.load(self.joints, self.form().joints)

    def motor_map(self) -> MotorMap:
        """Which motor pulls which joint. Raises ConfigurationError."""
        motors = MotorMap.load(self.motors)
        return motors if self.gains is None else motors.reverse(load_gains(self.gains, motors.driven).backwards)

    def device(self, transport: Transport, clock: Clock, *, set_up_boards: bool = True) -> ShadowHand:
        """The hand, not connected.

        Args:
            transport: from :meth:`transport`, or one around it.
            clock: the session's.
            set_up_boards: upload the motor boards' settings when connecting.

        Raises:
            ConfigurationError: a file that cannot be used.
        """
        boards = load_configurations(self.boards, self.form().driven) if self.boards and set_up_boards else None
        return ShadowHand(transport, clock, self.calibration(), self.settings(), self.motor_map(), boards)
