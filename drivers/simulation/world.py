"""The simulated rig: one physics, one clock, and the far ends of all transports.

Waiting on the clock moves the world: the physics advances, and every device acts at its own times in between (force
sensors sample, motors halt for lack of demands). All random numbers come from one seed, so that the same commands give
the same bytes again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from gtsam import Pose2, Pose3, Rot3

from drivers.camera.markers import MarkerSettings
from drivers.camera.rendering.table_camera import Placed, PrintedMarker, TableCamera
from drivers.core.clock import VirtualClock
from drivers.core.contacts import Contact
from drivers.core.fingertip import RigidTransform
from drivers.core.transports import Datagram, MemoryTransport, Peer, Transport
from drivers.fingertips.kind import LinkedKind
from drivers.fingertips.kinds import FINGERTIPS
from drivers.shadow.model.hand_form import HandForm
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.devices.camera_emulator import CameraEmulator
from drivers.simulation.devices.motor_bank import MotorBank
from drivers.simulation.devices.palm_emulator import JointSensors, PalmEmulator
from drivers.simulation.fingertips import SIMULATED_FINGERTIPS, SimulatedLinks
from drivers.simulation.hand_plant import SeenPlant
from drivers.simulation.model import build_model
from drivers.simulation.objects import ObjectModel, object_model
from drivers.simulation.plant import Plant, STEP_ns
from drivers.simulation.positioners import SIMULATED_POSITIONERS
from drivers.simulation.sections import NoTactile, TactileSection, TimedDevice
from drivers.simulation.settings import SimulationSettings

_SETTLING_s = 2.0
_RANDOM_PARTS = ("object", "joints", "motors", "palm", "forces", "tactile", "camera")


@dataclass(frozen=True)
class TruthSample:
    """The true state, for the truth channel, which only the evaluation reads.

    Attributes:
        stamp_ns: time of the sample.
        world_T_object: pose of the object frame.
        contacts: contacts of fingertips with the object; one finger may touch at several points.
        fingers_on_table: fingers whose tip touches the table.
    """

    stamp_ns: int
    world_T_object: Pose3
    contacts: tuple[Contact, ...]
    fingers_on_table: tuple[str, ...]


class _Plug:
    """A peer whose cable can be unplugged: messages in both directions are lost until it is plugged in again."""

    def __init__(self, peer: Peer) -> None:
        self.peer, self.plugged = peer, True

    def write(self, payload: bytes) -> None:
        if self.plugged:
            self.peer.write(payload)

    def read(self) -> list[Datagram]:
        arrived = self.peer.read()
        return arrived if self.plugged else []


class SimulatedClock(VirtualClock):
    """A virtual clock whose waiting moves the simulated world."""

    def __init__(self, world: SimulatedWorld) -> None:
        super().__init__()
        self._world = world

    def sleep_until_ns(self, deadline_ns: int) -> None:
        self._world.advance_to(deadline_ns)
        super().sleep_until_ns(deadline_ns)


class SimulatedWorld:
    """The simulated rig.

    Args:
        settings: object, fingertips and errors of the devices.
        seed: for all random numbers.
        calibration: the true calibration of the rig; by default that of the packaged simulated hand.

    Raises:
        ConfigurationError: the object is unknown, or the calibration does not fit the settings.
        ShapeError: an object mesh cannot be used.
    """

    def __init__(
        self, settings: SimulationSettings, seed: int, calibration: SimulatedCalibration | None = None
    ) -> None:
        self.settings = settings
        self.calibration = calibration or SimulatedCalibration.from_package()
        self.object_model: ObjectModel = object_model(settings.object)
        children = np.random.SeedSequence(seed).spawn(len(_RANDOM_PARTS))
        self._random = dict(zip(_RANDOM_PARTS, map(np.random.default_rng, children), strict=True))
        self._plant = self._build_plant()
        self._peers: dict[str, Peer] = {}
        self._devices: list[TimedDevice] = []
        tips = self._simulate_fingertips()
        self._add_palm(NoTactile() if isinstance(tips, SimulatedLinks) else tips)
        self._peers["base"] = SIMULATED_POSITIONERS[settings.positioner](self._plant)
        self._add_linked_fingertips(tips)
        camera = self.build_camera(self._plant, self._markers_on_hand)
        self._peers["camera"] = camera
        self._devices.append(camera)
        self._plugs = {name: _Plug(peer) for name, peer in self._peers.items()}
        self.clock = SimulatedClock(self)

    def transports(self) -> dict[str, Transport]:
        """Transports by device name: ``hand``, ``base``, ``camera``, and ``ft/FF`` to ``ft/TH`` for fingertips with
        their own transports.
        """
        return {name: MemoryTransport(name, plug) for name, plug in self._plugs.items()}

    def unplug(self, name: str) -> None:
        """Unplug a device's cable: from now on nothing passes in either direction."""
        self._plugs[name].plugged = False

    def plug_in(self, name: str) -> None:
        """Plug in a device's cable again; what was sent meanwhile is lost."""
        self._plugs[name].plugged = True

    @property
    def plant(self) -> Plant:
        """The physics itself, for callers that advance it other than by the clock."""
        return self._plant

    @property
    def marker_settings(self) -> MarkerSettings:
        """The markers of this rig with this object: a small underside has a smaller marker, sometimes off-centre."""
        return marker_settings(self.object_model, self.calibration.markers)

    def advance_to(self, deadline_ns: int) -> None:
        """Advance the world to a time of the clock, with every device acting at its times."""
        last = deadline_ns // STEP_ns
        while True:
            due_ns = self._next_event_ns()
            step = last if due_ns is None else min(last, -(-due_ns // STEP_ns))
            self._plant.advance(step - self._plant.stamp_ns // STEP_ns)
            if due_ns is None or due_ns > self._plant.stamp_ns:
                return
            for device in self._devices:
                if device.next_event_ns == due_ns:
                    device.tick()

    def truth(self) -> TruthSample:
        """The true state now."""
        touches = self._plant.contacts()
        return TruthSample(
            stamp_ns=self._plant.stamp_ns,
            world_T_object=self._plant.world_T_object,
            contacts=tuple(
                Contact(
                    finger=touch.finger,
                    point_world_m=touch.point_world_m,
                    normal_world=touch.normal_world,
                    point_covariance_m2=np.zeros((3, 3)),
                    normal_sigma_rad=0.0,
                    force_N=float(np.linalg.norm(touch.force_on_tip_world_N)),
                )
                for touch in touches
                if touch.touched == "object"
            ),
            fingers_on_table=tuple(sorted({touch.finger for touch in touches if touch.touched == "table"})),
        )

    def _next_event_ns(self) -> int | None:
        due = [device.next_event_ns for device in self._devices]
        return min((stamp_ns for stamp_ns in due if stamp_ns is not None), default=None)

    def _build_plant(self) -> Plant:
        settings = self.settings
        form = HandForm(settings.side, self.calibration.motors.driven)
        tips = {finger: self.calibration.tip_body(finger, settings.fingertips) for finger in form.fingers}
        mount = settings.world_T_mount.pose()
        plant = Plant(build_model(self.object_model, settings.object_mass_kg, tips, mount, form), self._start(), form)
        plant.settle(_SETTLING_s if self.object_model.scanned else 0.0)
        return plant

    def _start(self) -> Pose2:
        rng, given = self._random["object"], self.settings.start
        x, y = self.settings.start_sigma_m * rng.standard_normal(2)
        yaw = rng.uniform(-np.pi, np.pi)
        return Pose2(given.x_m, given.y_m, given.yaw_rad) if given else Pose2(x, y, yaw)

    def _add_palm(self, tactile: TactileSection) -> None:
        calibration, random = self.calibration, self._random
        joints = JointSensors(calibration.joints, self.settings.joint_sensors, random["joints"])
        motors = MotorBank(self._plant, calibration.motors, random["motors"])
        self._peers["hand"] = PalmEmulator(self._plant, joints, motors, tactile, random["palm"])
        self._devices.append(motors)

    def _add_linked_fingertips(self, tips: SimulatedLinks | TactileSection) -> None:
        if isinstance(tips, SimulatedLinks):
            self._peers |= {f"ft/{finger}": peer for finger, peer in tips.peers.items()}
            self._devices += [] if tips.device is None else [tips.device]

    def _simulate_fingertips(self) -> SimulatedLinks | TactileSection:
        """Force sensors and tactile sections have their own random numbers, so that neither depends on the other."""
        kind = self.settings.fingertips
        rng = self._random["forces" if isinstance(FINGERTIPS[kind], LinkedKind) else "tactile"]
        return SIMULATED_FINGERTIPS[kind](self._plant, self.calibration.tips[kind], self.settings, rng)

    def build_camera(self, plant: SeenPlant, carried: Callable[[], tuple[Placed, ...]] = tuple) -> CameraEmulator:
        """This rig's camera for a plant; it also sees what the hand carries."""
        markers = self.marker_settings
        camera = TableCamera(self.calibration.camera, self.settings.camera, self._random["camera"])
        table = PrintedMarker(markers.dictionary, markers.world_id, markers.world_side_m)
        glued = PrintedMarker(markers.dictionary, markers.object_id, markers.object_side_m)
        return CameraEmulator(
            plant,
            camera,
            self.object_model,
            (table, markers.world_T_worldmarker.pose()),
            (glued, markers.object_T_objectmarker.pose()),
            self.settings.camera,
            carried,
        )

    def _markers_on_hand(self) -> tuple[Placed, ...]:
        """The markers of the board on the palm, at their present poses."""
        held = self.settings.hand_board
        if held is None:
            return ()
        board, world_T_board = held.board, self._plant.world_T_palm * held.palm_T_board.pose()
        side_m = board.side_m * board.scale
        places = {number: board.marker_corners_m(number).mean(axis=0) for number in board.numbers}
        return tuple(
            (PrintedMarker(board.dictionary, number, side_m), world_T_board * Pose3(Rot3(), place))
            for number, place in places.items()
        )


def marker_settings(target: ObjectModel, markers: MarkerSettings) -> MarkerSettings:
    """A rig's markers with the one that a simulated object carries."""
    glued = RigidTransform(translation_m=target.marker.centre_object_m, rpy_rad=(np.pi, 0.0, 0.0))
    return markers.model_copy(update={"object_side_m": target.marker.side_m, "object_T_objectmarker": glued})
