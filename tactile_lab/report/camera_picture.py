"""The marker camera's last picture of a grasp with the estimate drawn into it, where the camera would see it."""

from __future__ import annotations

import base64
from dataclasses import dataclass

import numpy as np
from gtsam import Pose3

from drivers.camera.calibration import CameraCalibration, load_camera
from drivers.camera.frames import PNG_HEAD, picture_size
from drivers.camera.markers import MarkerSettings
from drivers.camera.packet import picture_of
from drivers.camera.world_marker import table_glass
from drivers.core.configuration import validate
from drivers.core.contacts import Array
from drivers.core.errors import TactileLabError
from drivers.core.poses import transform_points
from sessions.recording.session import TRAFFIC, Session
from tactile_lab.evaluation.trajectory import Poses
from tactile_lab.evaluation.truth.marker_truth import MarkerTruth
from tactile_lab.evaluation.truth.session_truth import camera_datagrams, marked_pictures, picture_messages
from tactile_lab.report.svg import Chart, Frame
from tactile_lab.rigs.description import OTHER_VERSION

_CAMERA = "camera"
_NEAREST_m = 0.01
_CARD_px = 460
"""Width at which the picture is shown; lines and dots are scaled so that they look alike in pictures of any size."""


@dataclass(frozen=True, eq=False)
class CameraView:
    """A picture, and where the camera was.

    Attributes:
        grasp: number of the grasp that it shows, from 0.
        picture: as the camera encoded it, JPEG or PNG.
        lens, markers: the session's calibration.
        camera_T_world: by the world marker.
    """

    grasp: int
    picture: bytes
    lens: CameraCalibration
    markers: MarkerSettings
    camera_T_world: Pose3

    def pixels(self, points_world_m: Array) -> Array | None:
        """Where the camera sees points of shape (n, 3) through the table's glass, shape (n, 2); None behind it."""
        eye = np.array(self.camera_T_world.inverse().translation())
        apparent = table_glass(self.markers).apparent(points_world_m, eye)
        seen = transform_points(self.camera_T_world, apparent)
        return None if not len(seen) or seen[:, 2].min() < _NEAREST_m else self.lens.project(seen)


def last_view(session: Session, world_T_object: Poses) -> tuple[CameraView | None, str]:
    """The last picture of a grasp whose pose was estimated; None without one, and why, "" for a session without camera.

    Args:
        session: with its recording.
        world_T_object: estimated pose of each grasp.
    """
    if _CAMERA not in session.manifest.calibration or not (session.folder / TRAFFIC).is_file():
        return None, ""
    try:
        return _last_view(session, world_T_object)
    except TactileLabError as error:  # the report is about the session; a picture that cannot be read is one line in it
        return None, str(error)


def _last_view(session: Session, world_T_object: Poses) -> tuple[CameraView | None, str]:
    where = f"{session.folder}/session.yaml"
    markers = validate(session.manifest.settings.get("markers", {}), MarkerSettings, where=where, hint=OTHER_VERSION)
    lens = load_camera(session.calibration_file(_CAMERA))
    camera_T_world = MarkerTruth(lens, markers, camera_datagrams(session)).camera_T_world()
    if camera_T_world is None:
        return None, "the camera did not see the world marker"
    pictures = marked_pictures(picture_messages(session))
    for grasp in sorted(pictures, reverse=True):
        if grasp < len(world_T_object) and world_T_object[grasp] is not None:
            picture = picture_of(pictures[grasp].payload)
            if picture:
                picture_size(picture)
                return CameraView(grasp, picture, lens, markers, camera_T_world), ""
    return None, "no picture of a grasp with an estimated pose was recorded"


def draw_on_picture(
    view: CameraView, outlines: list[tuple[str, Array]], contacts_world_m: Array, description: str
) -> str:
    """The picture around what is drawn, with closed outlines (style and points in the world, shape (n, 3)) and contacts
    in it, as SVG.
    """
    drawn = [(kind, pixels) for kind, points in outlines if (pixels := view.pixels(points)) is not None]
    dots = view.pixels(contacts_world_m) if len(contacts_world_m) else None
    size_px = picture_size(view.picture)
    (left, top), (right, bottom) = _around([pixels for _, pixels in drawn], size_px)
    width, height = right - left, bottom - top
    chart = Chart(Frame(float(width), float(height), 0, 0, 0, 0), (left, right), (bottom, top))
    part = f'<svg viewBox="{left} {top} {width} {height}" width="{width}" height="{height}" style="overflow:hidden">'
    whole = f'<image href="{_data_uri(view.picture)}" width="{size_px[0]}" height="{size_px[1]}"/>'
    chart.add(f"{part}{whole}</svg>")
    scale = width / _CARD_px
    for kind, pixels in drawn:
        for part, width_px in (("casing", 4.4), (kind, 2.2)):  # legible on light and on dark
            chart.path(pixels, f"seen {part}-seen", closed=True, style=f"stroke-width:{width_px * scale:.2f}")
    for dot in dots if dots is not None else ():
        chart.dot(dot, "contact-seen", radius=round(4 * scale, 2), style=f"stroke-width:{1.4 * scale:.2f}")
    return chart.text("The camera's picture", description)


def _around(drawn: list[Array], size_px: tuple[int, int]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Left upper and right lower corner of the part of a picture to show: what is drawn and as much again around it."""
    width, height = size_px
    inside = [pixels for pixels in drawn if ((pixels >= 0) & (pixels < [width, height])).all(axis=1).any()]
    if not inside:
        return (0, 0), (width, height)
    points = np.concatenate(inside)
    middle, half = (points.min(axis=0) + points.max(axis=0)) / 2, float(np.ptp(points, axis=0).max())
    low = np.clip(middle - half, 0, [width - 1, height - 1]).astype(int)
    high = np.clip(middle + half, low + 1, [width, height]).astype(int)
    return (int(low[0]), int(low[1])), (int(high[0]), int(high[1]))


def _data_uri(picture: bytes) -> str:
    kind = "png" if picture.startswith(PNG_HEAD) else "jpeg"
    return f"data:image/{kind};base64," + base64.b64encode(picture).decode("ascii")
