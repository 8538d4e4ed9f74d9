"""The object's true poses, recomputed from the recorded marker camera.

The recording contains the detected corners of every frame, and the requested pictures. So the truth can be computed
again with another lens or other markers from the corners, or with another detector from the pictures. First the world
marker is averaged over the session while it stood still; then every grasp's frame is evaluated.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

from gtsam import Pose3

from drivers.camera.aruco import ObjectSighting, ObjectTracker, detection_in
from drivers.camera.calibration import CameraCalibration
from drivers.camera.detection import detection
from drivers.camera.frames import Detection, Frame
from drivers.camera.markers import MarkerSettings
from drivers.camera.packet import decode_packet
from drivers.core.errors import CodecError
from drivers.core.transports import Datagram

Basis = Literal["corners", "pictures"]


@dataclass
class TruthReport:
    """Quality of the marker camera's truth, for people.

    Attributes:
        basis: computed from recorded corners, or from the pictures again.
        frames: frames of the recording.
        world_frames: frames averaged for the world marker.
        world_reprojection_px: error of that mean.
        refused: number of rejected frames by reason.
        position_sigma_mm, yaw_sigma_deg: largest standard deviation of a pose; None without poses.
    """

    basis: Basis
    frames: int = 0
    world_frames: int = 0
    world_reprojection_px: float | None = None
    refused: dict[str, int] = field(default_factory=dict)
    position_sigma_mm: float | None = None
    yaw_sigma_deg: float | None = None

    def note(self, sighting: ObjectSighting) -> None:
        """Include the uncertainty of another pose."""
        self.position_sigma_mm = max(self.position_sigma_mm or 0.0, 1e3 * sighting.position_sigma_m)
        self.yaw_sigma_deg = max(self.yaw_sigma_deg or 0.0, 57.29578 * sighting.yaw_sigma_rad)


class MarkerTruth:
    """Finds the object in recorded datagrams of the camera; called with one, it returns ``world_T_object`` or None.

    Args:
        lens, markers: the calibration to use.
        recorded: all datagrams of the camera, for the world marker; each is read once.
        basis: from the recorded corners, or from the pictures again.
    """

    def __init__(
        self, lens: CameraCalibration, markers: MarkerSettings, recorded: Iterable[Datagram], basis: Basis = "corners"
    ) -> None:
        self.report = TruthReport(basis)
        self._markers, self._tracker = markers, ObjectTracker(lens, markers)
        self._verdicts: dict[int, str] = {}
        for datagram in recorded:
            self._take_world(datagram)
        self.report.world_frames = self._tracker.world.frames
        if self._tracker.world.frames:
            self.report.world_reprojection_px = self._tracker.world.reprojection_px()

    def __call__(self, datagram: Datagram) -> Pose3 | None:
        """The object's pose in one frame; None if it cannot be determined, counted by reason."""
        sighting = self.sighting(datagram)
        return None if sighting is None else sighting.world_T_object

    def camera_T_world(self) -> Pose3 | None:
        """The world in the camera's frame, by the mean of the world marker; None if it was not seen."""
        return self._tracker.world.camera_T_world()

    def sighting(self, datagram: Datagram) -> ObjectSighting | None:
        """The object in one frame, with its uncertainty."""
        try:
            found = self._find(decode_packet(datagram))
        except CodecError as error:
            self._refuse(f"the frame cannot be read: {error.what}")
            return None
        if datagram.stamp_ns not in self._verdicts:
            self._verdicts[datagram.stamp_ns] = self._tracker.take_world(found)
        seen = self._tracker.locate(datagram.stamp_ns, found, self._verdicts[datagram.stamp_ns])
        if seen.sighting is None:
            self._refuse(seen.problem)
            return None
        self.report.note(seen.sighting)
        return seen.sighting

    def _take_world(self, datagram: Datagram) -> None:
        self.report.frames += 1
        try:
            found = self._find(decode_packet(datagram))
        except CodecError:
            return
        if found.markers:
            self._verdicts[datagram.stamp_ns] = self._tracker.take_world(found)

    def _find(self, frame: Frame) -> Detection:
        if self.report.basis == "pictures" and frame.image is not None:
            return detection(frame.image, self._markers.dictionary)
        return detection_in(frame, self._markers.dictionary)

    def _refuse(self, reason: str) -> None:
        self.report.refused[reason] = self.report.refused.get(reason, 0) + 1


def report_json(report: TruthReport) -> dict[str, Any]:
    """The report as plain data."""
    return dict(vars(report))
