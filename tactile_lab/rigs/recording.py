"""How the sessions of a rig are recorded."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.camera.calibration import load_camera
from drivers.core.contacts import FINGERS
from sessions.perception.interpreter import BASE_LINK, CAMERA_LINK, fingertip_link
from sessions.recording.device_stamps import STAMPERS, camera_stamp
from sessions.recording.recorder import Recorder
from sessions.recording.traffic.raw_frames import Stamper
from sessions.recording.traffic.settings import TrafficSettings
from tactile_lab.rigs.description import Rig


def stampers(rig: Rig) -> Mapping[str, Stamper]:
    """By transport, what reads a device's own counter and clock out of its messages; the palm has none."""
    description = rig.description
    found: dict[str, Stamper] = {CAMERA_LINK: camera_stamp}
    if description.positioner in STAMPERS:
        found[BASE_LINK] = STAMPERS[description.positioner]
    wires = dict.fromkeys(FINGERS, description.fingertips)  # simulated ones, whose stamper has the name of their kind
    if description.wires is not None:
        wires = {finger: wiring.wire for finger, wiring in description.wires.fingertips.items()}
    for finger, wire in wires.items():
        if wire in STAMPERS:
            found[fingertip_link(finger)] = STAMPERS[wire]
    return found


def traffic_settings(rig: Rig) -> TrafficSettings:
    """Simulated time waits for a slow disk; real time does not, and what does not fit is dropped and counted."""
    return TrafficSettings(when_full="wait" if rig.description.kind == "simulated" else "drop")


def record_camera(rig: Rig, recorder: Recorder, stamp_ns: int) -> None:
    """Write the camera's calibration for viewers, where the rig has a camera. Raises SessionError."""
    if "camera" in rig.files:
        camera = load_camera(rig.files["camera"])
        if camera.size_px is not None:
            recorder.camera(stamp_ns, camera.matrix, camera.distortion, camera.size_px)
