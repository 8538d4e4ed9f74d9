"""How the sessions of a rig are recorded."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.ati.wiring import NetBoxWiring
from drivers.camera.calibration import load_camera
from sessions.device_stamps import camera_stamp, positioner_stamp, rdt_stamp
from sessions.interpreter import BASE_LINK, CAMERA_LINK, fingertip_link
from sessions.raw_frames import Stamper
from sessions.recorder import Recorder
from sessions.traffic_settings import TrafficSettings
from tactile_lab.geometry.contacts import FINGERS
from tactile_lab.rigs.description import Rig


def stampers(rig: Rig) -> Mapping[str, Stamper]:
    """By link, what reads a device's own counter and clock out of its messages; the palm has none."""
    description = rig.description
    always: dict[str, Stamper] = {BASE_LINK: positioner_stamp, CAMERA_LINK: camera_stamp}
    if description.fingertips != "nano17":
        return always
    wires = description.wires.fingertips if description.wires else {}
    boxes = [finger for finger in FINGERS if isinstance(wires.get(finger), NetBoxWiring) or not description.wires]
    return {**always, **{fingertip_link(finger): rdt_stamp for finger in boxes}}


def traffic_settings(rig: Rig) -> TrafficSettings:
    """Simulated time waits for a slow disk; real time does not, and what does not fit is dropped and counted."""
    return TrafficSettings(when_full="wait" if rig.description.kind == "simulated" else "drop")


def record_camera(rig: Rig, recorder: Recorder, stamp_ns: int) -> None:
    """Write the camera's calibration for viewers, where the rig has a camera. Raises SessionError."""
    if "camera" in rig.files:
        camera = load_camera(rig.files["camera"])
        if camera.size_px is not None:
            recorder.camera(stamp_ns, camera.matrix, camera.distortion, camera.size_px)
