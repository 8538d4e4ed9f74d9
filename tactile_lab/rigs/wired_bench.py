"""The bench of a rig on wires: the drivers of a laboratory on their own links, in real time."""

from __future__ import annotations

from collections.abc import Callable

from drivers.ati.nano17 import Nano17
from drivers.ati.wiring import make_link
from drivers.camera.camera import Camera
from drivers.camera.camera_process import CameraProcess
from drivers.hardware.tcp import TcpLink
from drivers.hardware.udp import UdpLink
from drivers.links import Link, TappedLink
from drivers.positioner import Positioner
from drivers.shadow.hand_process import HandProcess
from sessions.bench import Bench
from sessions.interpreter import BASE_LINK, CAMERA_LINK, Observer, fingertip_link
from sessions.recorder import Recorder
from sessions.sensor_stream import SensorStream
from sessions.state_recording import TruthReading
from tactile_lab.clock import NANOSECONDS, Clock
from tactile_lab.rigs.build import build_interpreter, force_ranges_N, force_tips
from tactile_lab.rigs.description import Rig
from tactile_lab.rigs.wired import camera_source, force_wire, hand_setup, wires_of
from tactile_lab.rigs.wires import RemoteCamera


def build_wired_bench(
    rig: Rig,
    recorder: Recorder,
    clock: Clock,
    *,
    truth: Callable[[], TruthReading] | None = None,
    first_move: bool | None = None,
) -> Bench:
    """All devices of a rig on wires, on tapped links, not yet connected.

    Args:
        rig: of kind ``wired``.
        recorder: of the session.
        clock: the monotonic one.
        truth: of stand-ins.
        first_move: nudge each motor when connecting; as the rig file says when None.
    """
    description, wires = rig.description, wires_of(rig)
    observer = Observer(recorder, build_interpreter(rig))
    check = wires.hand.first_move if first_move is None else first_move
    return Bench(
        clock=clock,
        cycle_ns=round(description.cycle_s * NANOSECONDS),
        hand=HandProcess(hand_setup(rig), observer, patience_s=wires.hand.patience_s, check_map=check),
        base=Positioner(
            TappedLink(UdpLink(BASE_LINK, wires.base.host, wires.base.port, clock), observer, clock),
            clock,
            description.base,
        ),
        observer=observer,
        wrench_devices={finger: _stream(rig, finger, observer, clock) for finger in force_tips(rig)},
        camera=_camera(rig, observer, clock),
        fingertip_calibrations=force_tips(rig),
        truth=truth,
        force_ranges_N=force_ranges_N(rig),
    )


def _stream(rig: Rig, finger: str, observer: Observer, clock: Clock) -> SensorStream:
    link = TappedLink(make_link(wires_of(rig).fingertips[finger], fingertip_link(finger), clock), observer, clock)
    device = Nano17(finger, link, clock, force_tips(rig)[finger], rig.description.nano17, force_wire(rig, finger))
    return SensorStream(device, link)


def _camera(rig: Rig, observer: Observer, clock: Clock) -> Camera | None:
    if (wiring := wires_of(rig).camera) is None:
        return None
    link: Link
    if isinstance(wiring, RemoteCamera):
        link = TcpLink(CAMERA_LINK, wiring.host, wiring.port, clock)
    else:
        link = CameraProcess(CAMERA_LINK, camera_source(rig, wiring))
    return Camera(TappedLink(link, observer, clock), clock)
