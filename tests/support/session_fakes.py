"""A rig of fakes with a simple protocol of eight-byte floats, and fingertips that average their samples."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.clock import VirtualClock
from drivers.core.contacts import FINGERS
from drivers.core.errors import CodecError, DeviceError
from drivers.core.fingertip import TipContact
from drivers.core.transports import Datagram, MemoryTransport, TappedTransport
from drivers.shadow.model.kinematics import JOINTS
from sessions.perception.interpreter import Interpreter, Observer, fingertip_link
from sessions.perception.perception import Perception, PerceptionSettings
from sessions.recording.recorder import NullRecorder
from sessions.rig_runtime.rig_runtime import RigRuntime
from sessions.rig_runtime.sensor_stream import SensorStream

CYCLE_ns = 10_000_000


def mount_T_forearm(q):
    turn = Rot3.Ypr(q[3], q[4], q[5]) * Rot3(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
    return Pose3(turn, np.array(q[:3]))


@dataclass(frozen=True)
class FakeHandSample:
    stamp_ns: int
    joints_rad: np.ndarray
    fresh: bool = True


@dataclass(frozen=True)
class FakeBaseSample:
    stamp_ns: int
    q: np.ndarray


@dataclass(frozen=True)
class FakeFrame:
    stamp_ns: int
    image: bytes


def floats(payload, count):
    if len(payload) != 8 * count:
        raise CodecError(f"{len(payload)} bytes instead of {8 * count}", where="fake")
    return np.frombuffer(payload)


class HandFakeDecoder:
    def receive(self, datagram):
        return FakeHandSample(datagram.stamp_ns, floats(datagram.payload, 24))


class BaseFakeDecoder:
    def receive(self, datagram):
        return FakeBaseSample(datagram.stamp_ns, floats(datagram.payload, 6))


class WrenchFakeDecoder:
    def receive(self, datagram):
        return [floats(datagram.payload, 3)]


class CameraFakeDecoder:
    def receive(self, datagram):
        return FakeFrame(datagram.stamp_ns, datagram.payload)


class FakeTip:
    """Its contact is at the mean of its samples; it refuses a tare without samples."""

    def __init__(self, finger, force_N=0.7, fault=""):
        self.finger, self.force_N, self.fault = finger, force_N, fault
        self.samples, self.capture, self.bias = [], [], np.zeros(3)

    def update(self, samples):
        self.samples = [*self.samples, *samples][-10:]
        self.capture += list(samples)

    def tare(self, world_R_distal, *, reason=""):
        if not self.samples:
            raise DeviceError("no samples to tare with", where=self.finger)
        self.bias = np.mean(self.samples, axis=0) + 0.01 * world_R_distal[2]

    def load_N(self, world_R_distal):
        return float(np.linalg.norm(self.samples[-1] - self.bias + 0.01 * world_R_distal[2])) if self.samples else 0.0

    def void(self):
        return self.fault

    def begin_capture(self):
        self.capture = []

    def contact(self, world_R_distal):
        if not self.capture:
            return None
        shift = np.mean(self.capture, axis=0) - self.bias + 1e-3 * world_R_distal[2]
        return TipContact(
            point_distal_m=np.array([0.0, -0.007, 0.02]) + 1e-3 * shift,
            normal_distal=np.array([0.0, 1.0, 0.0]),
            point_covariance_m2=np.diag([1e-8, 2e-8, 3e-8]),
            normal_sigma_rad=0.05,
            force_N=self.force_N,
            torsion_Nm=0.0,
        )

    def health(self):
        return (self.fault,) if self.fault else ()


def make_perception(*, force_N=0.7, tip=FakeTip, **options):
    return Perception(
        wrench_fingertips={finger: tip(finger, force_N) for finger in FINGERS},
        mount_T_forearm=mount_T_forearm,
        world_T_mount=options.pop("world_T_mount", Pose3(Rot3.Yaw(0.3), np.array([0.1, -0.2, 0.5]))),
        settings=options.pop("settings", PerceptionSettings()),
        **options,
    )


def make_interpreter(perception=None):
    return Interpreter(
        perception or make_perception(),
        hand=HandFakeDecoder(),
        base=BaseFakeDecoder(),
        wrenches={finger: WrenchFakeDecoder() for finger in FINGERS},
        camera=CameraFakeDecoder(),
    )


class FakePeer:
    """Returns zero, one or two messages per read: noise around a mean, and now and then a damaged message."""

    def __init__(self, clock, mean, seed, *, damage=0.0, unsteady=True):
        self._clock, self.mean, self._random = clock, np.asarray(mean, dtype=float), np.random.default_rng(seed)
        self._damage, self._unsteady = damage, unsteady
        self.received = []

    def write(self, payload):
        self.received.append(payload)

    def read(self):
        count = int(self._random.choice([0, 1, 1, 1, 2])) if self._unsteady else 1
        return [Datagram(self._message(), self._clock.now_ns()) for _ in range(count)]

    def _message(self):
        payload = (self.mean + 1e-3 * self._random.standard_normal(len(self.mean))).tobytes()
        return payload[:-1] if self._random.random() < self._damage else payload


@dataclass
class FakeDevice:
    """A live device that sends, and decodes what comes back; ``calls`` is shared between devices to record the
    order.
    """

    name: str
    transport: object
    calls: list = field(default_factory=list)
    connect_error: DeviceError | None = None
    close_error: DeviceError | None = None
    work_ns: int = 0
    clock: VirtualClock | None = None
    lost: dict[str, int] = field(default_factory=dict)

    def connect(self):
        self.calls.append(f"connect {self.name}")
        if self.connect_error:
            raise self.connect_error
        self.transport.open()

    def close(self):
        self.calls.append(f"close {self.name}")
        self.transport.close()
        if self.close_error:
            raise self.close_error

    def exchange(self):
        self.transport.send(b"demand")
        if self.work_ns:
            self.clock.sleep_until_ns(self.clock.now_ns() + self.work_ns)
        return self.transport.receive()[-1:]

    def losses(self):
        return self.lost

    def ask(self):
        self.transport.send(b"TRIGGER")

    def take_picture(self):
        return (self.transport.receive() or [None])[-1]

    def stop(self):
        self.calls.append(f"stop {self.name}")

    def set_targets(self, targets_rad):
        self.calls.append(f"targets {self.name}")

    def set_target(self, q6):
        self.calls.append(f"target {self.name}")


@dataclass
class FakeRig:
    runtime: RigRuntime
    clock: VirtualClock
    interpreter: Interpreter
    devices: dict[str, FakeDevice]
    peers: dict[str, FakePeer]
    calls: list


def _stream(device):
    return SensorStream(device, device.transport)


def make_rig(recorder=None, *, seed=0, damage=0.0, unsteady=True, start_ns=0, truth=None):
    clock, calls = VirtualClock(start_ns), []
    interpreter = make_interpreter()
    observer = Observer(recorder or NullRecorder(), interpreter)
    bend = np.array([0.3 if name[2:] in ("J1", "J2", "J3") else 0.05 for name in JOINTS])
    means = {"hand": bend, "base": [0.0, 0.1, 0.2, 0.5, 0.0, 0.1], "camera": [1.0, 2.0]}
    means |= {fingertip_link(finger): [0.1, 0.4, 0.2] for finger in FINGERS}
    peers = {
        name: FakePeer(clock, mean, [seed, index], damage=damage, unsteady=unsteady and name != "camera")
        for index, (name, mean) in enumerate(means.items())
    }
    devices = {
        name: FakeDevice(name, TappedTransport(MemoryTransport(name, peer), observer, clock), calls, clock=clock)
        for name, peer in peers.items()
    }
    runtime = RigRuntime(
        clock=clock,
        cycle_ns=CYCLE_ns,
        hand=devices["hand"],
        base=devices["base"],
        observer=observer,
        wrench_devices={finger: _stream(devices[fingertip_link(finger)]) for finger in FINGERS},
        camera=devices["camera"],
        truth=truth,
    )
    return FakeRig(runtime, clock, interpreter, devices, peers, calls)


def play_session(rig, grasps=3):
    """Connect, tare, grasp a few times with holds and moves in between, take pictures; returns the grasps."""
    runtime, made = rig.runtime, []
    runtime.connect()
    runtime.run(100_000_000)
    runtime.tare()
    for index in range(grasps):
        runtime.run(30_000_000)
        runtime.begin_capture()
        runtime.run(200_000_000)
        made.append(runtime.end_capture())
        runtime.truth_frame()
        for turn in (0.2, -0.1 * index):
            runtime.begin_hold()
            rig.peers["base"].mean = rig.peers["base"].mean + np.array([0.01, 0.0, 0.0, turn, 0.0, 0.0])
            runtime.run(50_000_000)
            runtime.end_hold()
    return made


def same_grasp(one, other):
    """Whether two grasps are equal bit by bit."""
    if (one.index, one.stamp_ns, len(one.contacts)) != (other.index, other.stamp_ns, len(other.contacts)):
        return False
    poses = [(g.world_T_palm.matrix().tobytes(), g.hand_motion_world.matrix().tobytes()) for g in (one, other)]
    return poses[0] == poses[1] and all(_same_contact(*pair) for pair in zip(one.contacts, other.contacts, strict=True))


def _same_contact(one, other):
    arrays = ("point_world_m", "normal_world", "point_covariance_m2")
    plain = ("finger", "normal_sigma_rad", "force_N")
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in arrays) and all(
        getattr(one, name) == getattr(other, name) for name in plain
    )
