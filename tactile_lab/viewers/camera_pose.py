"""Where the camera stands, from the world marker in its pictures."""

from __future__ import annotations

from gtsam import Pose3

from drivers.camera.calibration import CameraCalibration, load_camera
from drivers.camera.detection import detection
from drivers.camera.frames import Detection, decode_image
from drivers.camera.markers import MarkerSettings
from drivers.camera.world_marker import WorldMarker
from drivers.core.configuration import load_model
from drivers.core.errors import CodecError
from tactile_lab.rigs.description import Rig


class CameraPose:
    """Looks for the world marker until one picture shows it.

    Args:
        lens, markers: the rig's calibration.
    """

    def __init__(self, lens: CameraCalibration, markers: MarkerSettings) -> None:
        self._world, self._markers = WorldMarker(lens, markers), markers
        self._is_known = False

    def first_sight(self, encoded: bytes, found: Detection | None = None) -> Pose3 | None:
        """``world_T_camera`` from the first picture that shows the marker, once; None otherwise.

        The camera's frame has z along its view, x to the right and y down, as OpenCV has it.

        Args:
            encoded: the picture.
            found: the markers that were recorded with it; None if they have to be detected now.
        """
        if self._is_known:
            return None
        try:
            found = found or detection(decode_image(encoded), self._markers.dictionary)
        except CodecError:
            return None
        if found.dictionary != self._markers.dictionary or self._markers.world_id not in found.markers:
            return None
        self._world.add(found.markers[self._markers.world_id].corners_px)
        camera_T_world = self._world.camera_T_world()
        self._is_known = camera_T_world is not None
        return None if camera_T_world is None else camera_T_world.inverse()


def camera_of_rig(rig: Rig) -> CameraPose | None:
    """What finds a rig's camera; None for a rig without one. Raises ConfigurationError for invalid files."""
    if "camera" not in rig.files:
        return None
    return CameraPose(load_camera(rig.files["camera"]), load_model(rig.files["markers"], MarkerSettings))
