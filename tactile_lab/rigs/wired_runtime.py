"""The rig runtime of a rig on wires: the drivers of a laboratory on their own transports, in real time."""

from __future__ import annotations

from collections.abc import Callable

from drivers.camera.camera import Camera
from drivers.camera.camera_process import CameraProcess
from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.installed.extras import require_package
from drivers.core.transports import TappedTransport, Transport
from drivers.fingertips.kind import LinkedKind
from drivers.fingertips.wiring import make_transport
from drivers.hardware.tcp import TcpTransport
from drivers.shadow.device.hand_process import HandProcess
from sessions.perception.interpreter import BASE_LINK, CAMERA_LINK, Observer, fingertip_link
from sessions.recording.recorder import Recorder
from sessions.rig_runtime.rig_runtime import RigRuntime
from sessions.rig_runtime.sensor_stream import SensorStream
from sessions.rig_runtime.state_recording import TruthReading
from tactile_lab.rigs.build import build_interpreter, fitted_tips, force_ranges_N, force_tips
from tactile_lab.rigs.description import Rig
from tactile_lab.rigs.wired import camera_source, force_wire, hand_setup, wires_of
from tactile_lab.rigs.wires import RemoteCamera


def build_wired_runtime(
    rig: Rig,
    recorder: Recorder,
    clock: Clock,
    *,
    truth: Callable[[], TruthReading] | None = None,
    first_move: bool | None = None,
) -> RigRuntime:
    """All devices of a rig on wires, on tapped transports, not yet connected.

    Args:
        rig: of kind ``wired``.
        recorder: of the session.
        clock: the monotonic one.
        truth: of emulators.
        first_move: nudge each motor when connecting; as the rig file says when None.
    """
    description, wires, positioner = rig.description, wires_of(rig), rig.description.positioner_kind
    observer = Observer(recorder, build_interpreter(rig))
    check = wires.hand.first_move if first_move is None else first_move
    return RigRuntime(
        clock=clock,
        cycle_ns=round(description.cycle_s * NANOSECONDS),
        hand=HandProcess(hand_setup(rig), observer, patience_s=wires.hand.patience_s, check_map=check),
        base=positioner.device(
            TappedTransport(positioner.transport(wires.base, description.base, BASE_LINK, clock), observer, clock),
            clock,
            description.base,
        ),
        observer=observer,
        wrench_devices=_streams(rig, observer, clock),
        camera=_camera(rig, observer, clock),
        fingertip_calibrations=force_tips(rig),
        truth=truth,
        force_ranges_N=force_ranges_N(rig),
    )


def _streams(rig: Rig, observer: Observer, clock: Clock) -> dict[str, SensorStream]:
    """The live devices of linked fingertips, by finger."""
    if not isinstance(kind := rig.description.fingertip_kind, LinkedKind):
        return {}
    settings, streams = rig.description.fingertip_settings, {}
    for finger, calibration in fitted_tips(rig).items():
        own = make_transport(wires_of(rig).fingertips[finger], fingertip_link(finger), clock)
        transport = TappedTransport(own, observer, clock)
        device = kind.device(finger, calibration, settings, transport, clock, force_wire(rig, finger))
        streams[finger] = SensorStream(device, transport)
    return streams


def _camera(rig: Rig, observer: Observer, clock: Clock) -> Camera | None:
    if (wiring := wires_of(rig).camera) is None:
        return None
    require_package("cv2")
    transport: Transport
    if isinstance(wiring, RemoteCamera):
        transport = TcpTransport(CAMERA_LINK, wiring.host, wiring.port, clock)
    else:
        transport = CameraProcess(CAMERA_LINK, camera_source(rig, wiring))
    return Camera(TappedTransport(transport, observer, clock), clock)
