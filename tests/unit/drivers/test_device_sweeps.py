"""Every fault of a wire against the hand, its fingertips, its CAN bridge and the camera; and faults of the slaves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import can
import cv2
import numpy as np

from drivers.biotac.biotac import BioTac, BioTacCalibration
from drivers.biotac.slot_codec import Channel, Slot, encode_slot
from drivers.camera.camera import Camera, CameraDeviceSettings
from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram, MemoryTransport, Transport, link_health
from drivers.emulators.ethercat.motor_can import MotorCanBuses
from drivers.emulators.ethercat.shadow_chain import EmulatedHand, emulated_hand
from drivers.ethercat.registers import AlCode, AlState
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.ethercat.can_bridge import ShadowBridgeBus
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.protocol.palm_codec import PalmStatus
from tactile_lab import rigs
from tests.support.driver_sweep import DriverSweep, SweptDevice
from tests.support.fake_palm import FakePalm
from tests.support.faults import SLAVE_TO_SAFEOP, WORKING_COUNTER_LOW, MessageLayout
from tests.support.memory_port import MemoryPort

JOINTS = Path(rigs.__file__).parent / "calibrations" / "simulated-hand" / "joints.yaml"
CALIBRATION = JointCalibration.load(JOINTS)
ETHERNET_CHECKS = "a palm's image carries no check of its own; on the wire Ethernet's covers it"
STANDS_STILL = "a joint that stands still, or is held, reads the same for as long"
FRAMES_LOST, FRAMES_HELD, RING_OPENED = "frames lost", "frames held back", "cable pulled"


def exchanged(hand: ShadowHand) -> list[Any]:
    """One cycle; its sample when it is a new one."""
    hand.set_targets({"FFJ3": 0.8})
    sample = hand.exchange()
    return [sample] if sample.fresh else []


class SweptHand:
    """The hand with the words of its transport, as a rig's check and its process tell them."""

    def __init__(self, transport: Transport, clock: VirtualClock, settings: HandSettings | None = None) -> None:
        self.hand = ShadowHand(transport, clock, CALIBRATION, settings or HandSettings(soft_start_s=0.0))
        self._transport = transport

    def connect(self) -> None:
        self.hand.connect()

    def close(self) -> None:
        try:
            self.hand.close()
        except DeviceError:  # it is gone, which the sweep has judged
            return

    def health(self) -> tuple[str, ...]:
        return self.hand.health() + link_health(self._transport)


class TestHand(DriverSweep):
    layout = MessageLayout(values=(4, 78))
    blind: ClassVar[dict[str, str]] = {"flip a bit": ETHERNET_CHECKS}
    stops: ClassVar[frozenset[str]] = frozenset({"unplug", "delay", "stuck value"})

    def runtime(self) -> SweptDevice:
        clock = VirtualClock()
        transport = MemoryTransport("hand", FakePalm(clock))

        def build(transport: Transport) -> SweptHand:
            return SweptHand(transport, clock)

        return SweptDevice(transport, clock, build, lambda: None, lambda swept: exchanged(swept.hand))


# --- EtherCAT ------------------------------------------------------------------------------------------------------


class FaultyRing:
    """Our EtherCAT transport, whose far end can be told to misbehave."""

    def __init__(self, hand: EmulatedHand, clock: VirtualClock) -> None:
        self.name, self.far = "hand", hand
        settings = EthercatSettings(interface="memory", poll_every=5)
        self.transport = EthercatTransport("hand", settings, clock, MemoryPort(hand.ring))
        self._hung_for = 0

    def open(self) -> None:
        self.transport.open()

    def close(self) -> None:
        self.transport.close()

    def send(self, payload: bytes) -> None:
        self._hung_for = max(0, self._hung_for - 1)
        self.far.palm.hung = self._hung_for > 0
        self.transport.send(payload)

    def receive(self) -> list[Datagram]:
        return self.transport.receive()

    def health(self) -> tuple[str, ...]:
        return self.transport.health()

    def inject(self, fault: str) -> None:
        """Raises KeyError for a fault that no ring has."""
        faults: dict[str, Callable[[], object]] = {
            WORKING_COUNTER_LOW: self._hang,
            SLAVE_TO_SAFEOP: lambda: self.far.palm_slave.fall_to(AlState.SAFEOP, AlCode.WATCHDOG),
            FRAMES_LOST: lambda: setattr(self.far.ring.faults, "drop", 3),
            FRAMES_HELD: lambda: setattr(self.far.ring.faults, "hold", 1),
            RING_OPENED: lambda: setattr(self.far.ring.faults, "connected", 0),
        }
        faults[fault]()

    def repair(self) -> None:
        self.far.ring.faults.connected = None
        self._hung_for, self.far.palm.hung = 0, False

    def _hang(self) -> None:
        self._hung_for = 4


class TestHandOnEtherCat(DriverSweep):
    layout = MessageLayout(values=(4, 78))
    far_end = (WORKING_COUNTER_LOW, SLAVE_TO_SAFEOP, FRAMES_LOST, FRAMES_HELD, RING_OPENED)
    blind: ClassVar[dict[str, str]] = {
        "flip a bit": ETHERNET_CHECKS,
        "stuck value": STANDS_STILL,
    }
    stops: ClassVar[frozenset[str]] = frozenset({"unplug", "delay", SLAVE_TO_SAFEOP, RING_OPENED})

    def runtime(self) -> SweptDevice:
        clock = VirtualClock()
        ring = FaultyRing(emulated_hand(clock, CALIBRATION), clock)

        def build(transport: Transport) -> SweptHand:
            return SweptHand(transport, clock)

        return SweptDevice(ring, clock, build, lambda: None, lambda swept: exchanged(swept.hand), ring.repair)


# --- fingertips in the palm ----------------------------------------------------------------------------------------


class PalmWithBioTacs(FakePalm):
    """A palm whose first fingertip is an untouched BioTac."""

    def _status(self, command: Any) -> PalmStatus:
        status = super()._status(command)
        request = int(command.tactile_data_type)
        values = {request: _reading(request), request + 1: _reading(request + 1)}
        slots = np.zeros((5, 16), np.uint8)
        slots[0] = np.frombuffer(encode_slot(Slot((2040, 2041), values), request), np.uint8)
        return PalmStatus(**(vars(status) | {"tactile_valid": 1, "tactile": slots}))


def _reading(channel: int) -> int:
    return {Channel.PDC: 1700, Channel.TAC: 2000, Channel.TDC: 2280}.get(channel, 3000)  # type: ignore[call-overload]


class SweptBioTac(SweptHand):
    """A hand with one BioTac, as a session has them."""

    def __init__(self, transport: Transport, clock: VirtualClock) -> None:
        super().__init__(transport, clock, HandSettings(soft_start_s=0.0, tactile="biotac"))
        model = {"electrodes": 19, "distal_T_sensor": {"translation_m": (0.0, 0.0, 0.019)}}
        self.tip = BioTac("FF", BioTacCalibration.model_validate(model))

    def health(self) -> tuple[str, ...]:
        return super().health() + self.tip.health()


class TestBioTacInThePalm(DriverSweep):
    layout = MessageLayout(
        values=(138, 154), saturate=lambda payload: payload[:142] + b"\xff\xff" + payload[144:]
    )  # a count that no converter gives
    blind: ClassVar[dict[str, str]] = {
        "flip a bit": ETHERNET_CHECKS,
        "stuck value": "an untouched sensor stands still: its channels are heard all the same",
    }
    stops: ClassVar[frozenset[str]] = frozenset({"unplug", "delay"})

    def runtime(self) -> SweptDevice:
        clock = VirtualClock()
        transport = MemoryTransport("hand", PalmWithBioTacs(clock))

        def use(swept: SweptBioTac) -> list[Any]:
            samples = exchanged(swept.hand)
            for sample in samples:
                swept.tip.update(sample)
            return samples

        return SweptDevice(transport, clock, lambda transport: SweptBioTac(transport, clock), lambda: None, use)


# --- CAN bridge ----------------------------------------------------------------------------------------------------


class SweptBridge:
    """python-can's bus on the hand; its errors as ours."""

    def __init__(self, transport: Transport, clock: VirtualClock) -> None:
        self._transport, self._clock = transport, clock
        self.bus: ShadowBridgeBus | None = None

    def connect(self) -> None:
        try:
            self.bus = ShadowBridgeBus(channel="memory", transport=self._transport, clock=self._clock)
        except can.CanInitializationError as error:
            raise DeviceError(str(error), where="bridge", hint="As the words say") from error

    def close(self) -> None:
        if self.bus is not None:
            self.bus.shutdown()

    def health(self) -> tuple[str, ...]:
        return self.bus.health() if self.bus is not None else ()

    def asked(self) -> list[can.Message]:
        """A question to a motor's bootloader, and the answer."""
        assert self.bus is not None
        question = can.Message(arbitration_id=0x644, is_extended_id=False, channel=1)
        try:
            self.bus.send(question)
            answer = self.bus.recv(0.004)
        except can.CanOperationError as error:
            raise DeviceError(str(error), where="bridge", hint="As the words say") from error
        return [] if answer is None else [answer]


class TestCanBridge(DriverSweep):
    layout = MessageLayout(values=(224, 232))
    far_end = (WORKING_COUNTER_LOW, SLAVE_TO_SAFEOP, FRAMES_LOST, FRAMES_HELD, RING_OPENED)
    blind: ClassVar[dict[str, str]] = {
        "flip a bit": "CAN's own check covers the buses, and Ethernet's the image",
        "stuck value": "an answer that reads as the one before is a right answer",
        "clock jump": "stamps are those of arrival, for people",
        WORKING_COUNTER_LOW: "a palm is late now and then here; the link counts each, and the frame is sent again",
    }
    harmless: ClassVar[frozenset[str]] = frozenset({"counter wrap"})
    stops: ClassVar[frozenset[str]] = frozenset({"unplug", "delay", SLAVE_TO_SAFEOP, RING_OPENED})

    def runtime(self) -> SweptDevice:
        clock = VirtualClock()
        ring = FaultyRing(emulated_hand(clock, CALIBRATION, can=MotorCanBuses()), clock)

        def build(transport: Transport) -> SweptBridge:
            return SweptBridge(transport, clock)

        return SweptDevice(ring, clock, build, lambda: None, SweptBridge.asked, ring.repair)


# --- camera --------------------------------------------------------------------------------------------------------


class StillLife:
    """A camera before a picture that does not change."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock, self._waiting = clock, list[Datagram]()
        image = np.random.default_rng(0).integers(0, 255, (24, 32), dtype=np.uint8)
        self._picture = cv2.imencode(".png", image)[1].tobytes()

    def write(self, payload: bytes) -> None:
        self._waiting.append(Datagram(self._picture, self._clock.now_ns()))

    def read(self) -> list[Datagram]:
        arrived, self._waiting = self._waiting, []
        return arrived


class TestCamera(DriverSweep):
    layout = MessageLayout()
    blind: ClassVar[dict[str, str]] = {
        "clock jump": "a picture is stamped when it arrives, and answers a trigger of the same moment",
        "duplicate": "both pictures are of the same moment",
    }
    harmless: ClassVar[frozenset[str]] = frozenset()
    stops: ClassVar[frozenset[str]] = frozenset({"unplug", "drop", "truncate", "flip a bit", "delay", "reorder"})

    def runtime(self) -> SweptDevice:
        clock = VirtualClock()
        transport = MemoryTransport("camera", StillLife(clock))

        def build(transport: Transport) -> Camera:
            return Camera(transport, clock, CameraDeviceSettings(timeout_ms=40.0))

        return SweptDevice(transport, clock, build, lambda: None, lambda camera: [camera.capture()])
