"""The emulated hand as seen by an EtherCAT master: a bridge, and behind it a palm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from drivers.core.clock import Clock
from drivers.core.contacts import FINGERS
from drivers.emulators.ethercat.eeprom import SlaveIdentity, bare_eeprom, mapped_eeprom
from drivers.emulators.ethercat.free_hand import FreeHand
from drivers.emulators.ethercat.ring import EmulatedRing
from drivers.emulators.ethercat.slave import SlaveController
from drivers.emulators.ethercat.slave_application import Application
from drivers.ethercat.registers import SyncManager
from drivers.fingertips.kinds import as_palm_kind, palm_kind
from drivers.shadow.device.tactile_requests import TactileKind
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.palm_images import BRIDGE_PRODUCT, CAN_BYTES, PALMS, SHADOW_VENDOR, PalmImage, PalmName
from drivers.simulation.devices.motor_bank import MotorBank
from drivers.simulation.devices.palm_emulator import CanBuses, JointSensors, PalmEmulator
from drivers.simulation.fingertips import tactile_section
from drivers.simulation.hand_plant import HandPlant
from drivers.simulation.sections import NoTactile, TactileSection
from drivers.simulation.settings import JointSensorSettings, SimulationSettings

EepromKind = Literal["bare", "mapped"]

_NOT_SERVED_EDC, _NOT_SERVED_WORD = 0xCC, 0xDEAD
_SERVICE_ns = 600_000


class PalmApplication:
    """The palm's processor: passes commands on to the palm, and halts its motors in time.

    Args:
        palm: the palm that answers commands.
        motors: its motors, which halt when no demand arrives.
        image: which palm it is.
        clock: for the motors.
        service_ns: from a command's arrival to its status.

    Attributes:
        hung: whether the processor hangs.
        served: cycles that it has served.
    """

    def __init__(
        self, palm: PalmEmulator, motors: MotorBank, image: PalmImage, clock: Clock, service_ns: int = _SERVICE_ns
    ) -> None:
        self.palm, self.motors, self._image, self._clock = palm, motors, image, clock
        self.sync_managers: tuple[SyncManager, ...] = image.sync_managers()
        self.service_ns = service_ns
        self.hung = False
        self.served = 0

    def start(self) -> tuple[bytes, ...]:
        """The palm's buffer before its first cycle, which holds a marker pattern (protocols: Palm commands)."""
        size = self._image.status_bytes - CAN_BYTES
        words = np.full((size - 4) // 2, _NOT_SERVED_WORD, "<u2").tobytes()
        return _NOT_SERVED_EDC.to_bytes(4, "little") + words, bytes(CAN_BYTES)

    def serve(self, blocks: tuple[bytes, ...], *, operating: bool) -> tuple[bytes, ...] | None:
        """Serve one cycle. Outside OP all demands are treated as zero."""
        self._halt_late_motors()
        if self.hung:
            return None
        payload = b"".join(blocks)
        status = self.palm.serve(payload if operating else bytes(len(payload)))
        if status is None:
            return None
        self.served += 1
        return status[:-CAN_BYTES], status[-CAN_BYTES:]

    def _halt_late_motors(self) -> None:
        due_ns = self.motors.next_event_ns
        if due_ns is not None and self._clock.now_ns() >= due_ns:
            self.motors.tick()


@dataclass(frozen=True)
class ChainSettings:
    """Settings of the emulated slaves.

    Attributes:
        palm: kind of palm.
        eeprom: what the slaves' EEPROMs hold.
        serial: the hand's.
        product: product code of the palm; by default its usual one.
        vendor: of both slaves.
        service_ns: how long the palm needs for a command.
        seed: of noise and losses.
        tactile: fingertips that send through the palm; without a plant nothing touches them.
    """

    palm: PalmName = "0220"
    eeprom: EepromKind = "bare"
    serial: int = 634
    product: int | None = None
    vendor: int = SHADOW_VENDOR
    service_ns: int = _SERVICE_ns
    seed: int = 0
    tactile: TactileKind = "none"


@dataclass(frozen=True)
class EmulatedHand:
    """A hand on a ring, with access to its parts."""

    ring: EmulatedRing
    palm: PalmApplication
    plant: HandPlant

    @property
    def palm_slave(self) -> SlaveController:
        """The palm's slave controller."""
        return self.ring.slaves[1]


def emulated_hand(
    clock: Clock,
    calibration: JointCalibration,
    settings: ChainSettings | None = None,
    motor_map: MotorMap | None = None,
    can: CanBuses | None = None,
    plant: HandPlant | None = None,
    sensors: JointSensorSettings | None = None,
    tactile: TactileSection | None = None,
) -> EmulatedHand:
    """A hand on a ring.

    Args:
        clock: its time.
        calibration: joint tables, used in reverse.
        settings: the kind of hand.
        motor_map: which motor pulls which joint.
        can: the motors' buses.
        plant: the model that its motors move; by default a hand in free air.
        sensors: errors of its joint sensors.
        tactile: fingertips that send through the palm; by default those of the settings.
    """
    settings, free = settings or ChainSettings(), FreeHand(clock)
    plant = plant or free
    image = PALMS[settings.palm]
    rng = np.random.default_rng(settings.seed)
    joints = JointSensors(calibration, sensors or JointSensorSettings(), rng)
    motors = MotorBank(plant, motor_map or MotorMap.load(), rng)
    palm = PalmEmulator(plant, joints, motors, tactile or _fingertips(settings.tactile, free, rng), rng, image, can)
    application = PalmApplication(palm, motors, image, clock, settings.service_ns)
    return EmulatedHand(_ring(application, image, clock, settings), application, plant)


def _fingertips(kind: TactileKind, hand: FreeHand, rng: np.random.Generator) -> TactileSection:
    if (name := palm_kind(kind)) is None or (usual := as_palm_kind(name).usual()) is None:
        return NoTactile()
    return tactile_section(name, hand, dict.fromkeys(FINGERS, usual), SimulationSettings(), rng)


def _ring(palm: PalmApplication, image: PalmImage, clock: Clock, settings: ChainSettings) -> EmulatedRing:
    product = image.products[0] if settings.product is None else settings.product
    identities = (
        (SlaveIdentity(settings.vendor, BRIDGE_PRODUCT), "bridge", None),
        (SlaveIdentity(settings.vendor, product, serial=settings.serial), "palm", palm),
    )
    slaves = [_slave(identity, name, part, clock, settings.eeprom) for identity, name, part in identities]
    return EmulatedRing(slaves, settings.seed)


def _slave(
    identity: SlaveIdentity, name: str, application: Application | None, clock: Clock, kind: EepromKind
) -> SlaveController:
    managers = application.sync_managers if application else ()
    eeprom = bare_eeprom(identity) if kind == "bare" else mapped_eeprom(identity, name, managers)
    return SlaveController(eeprom, application, clock)
