"""The simulated camera under the table, as seen from its transport: a trigger in, one picture with markers out.

A streaming camera sends the markers of every frame by itself, and the picture with the next frame after a trigger.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from drivers.camera.camera import TRIGGER
from drivers.camera.detection import detection
from drivers.camera.frames import Frame, decode_image
from drivers.camera.opencv import cv2
from drivers.camera.packet import encode_packet
from drivers.camera.rendering.settings import CameraSettings
from drivers.camera.rendering.table_camera import Placed, TableCamera
from drivers.core.clock import NANOSECONDS
from drivers.core.errors import CodecError
from drivers.core.poses import transform_points
from drivers.core.transports import Datagram
from drivers.simulation.hand_plant import SeenPlant
from drivers.simulation.objects import ObjectModel


class CameraEmulator:
    """Far end of the camera's transport.

    Args:
        plant: the plant with the object.
        camera: renders the pictures.
        target: the object, for the shape of its underside.
        table_marker: the marker on the table and its pose in the world.
        object_marker: the marker under the object and its pose in the object frame.
        settings: its picture quality, rate and delay.
        carried: returns the markers on the hand and their poses in the world; they are drawn in front of all others.
    """

    def __init__(
        self,
        plant: SeenPlant,
        camera: TableCamera,
        target: ObjectModel,
        table_marker: Placed,
        object_marker: Placed,
        settings: CameraSettings,
        carried: Callable[[], tuple[Placed, ...]] = tuple,
    ) -> None:
        self._carried = carried
        self._plant, self._camera = plant, camera
        foot = target.foot_object_m
        self._foot_object_m = np.column_stack([foot, np.full(len(foot), -target.rest_height_m)])
        self._table_marker, self._object_marker = table_marker, object_marker
        self._jpeg = [cv2.IMWRITE_JPEG_QUALITY, settings.jpeg_quality]
        self._late_ns = round(1e6 * settings.late_ms)
        self._period_ns = None if settings.stream_hz is None else round(NANOSECONDS / settings.stream_hz)
        self._outbox: list[Datagram] = []
        self._counter, self._wanted = 0, False

    @property
    def next_event_ns(self) -> int | None:
        """When it streams its next frame; None for a camera that waits for triggers."""
        return None if self._period_ns is None else (self._counter + 1) * self._period_ns

    def tick(self) -> None:
        """Send a frame."""
        self._take(with_picture=self._wanted)
        self._wanted = False

    def write(self, payload: bytes) -> None:
        """Process a trigger by taking a picture.

        Raises:
            CodecError: the bytes are not a trigger.
        """
        if payload != TRIGGER:
            raise CodecError(f"{len(payload)} bytes that are not a trigger", where="simulated camera")
        if self._period_ns is None:
            self._take(with_picture=True)
        else:
            self._wanted = True

    def read(self) -> list[Datagram]:
        """What has arrived since the last call."""
        now_ns = self._plant.stamp_ns
        arrived = [frame for frame in self._outbox if frame.stamp_ns <= now_ns]
        self._outbox = self._outbox[len(arrived) :]
        return arrived

    def _take(self, *, with_picture: bool) -> None:
        self._counter += 1
        picture, stamp_ns = self._picture(), self._plant.stamp_ns + self._late_ns
        found = detection(decode_image(picture), self._table_marker[0].dictionary)
        frame = Frame(stamp_ns, None, self._counter, detection=found)
        self._outbox.append(Datagram(encode_packet(frame, picture if with_picture else b""), stamp_ns))

    def _picture(self) -> bytes:
        world_T_object = self._plant.world_T_object
        marker, object_T_marker = self._object_marker
        foot_world_m = transform_points(world_T_object, self._foot_object_m)
        markers = (self._table_marker, (marker, world_T_object * object_T_marker), *self._carried())
        image = self._camera.render(markers, foot_world_m)
        return cv2.imencode(".jpg", image, self._jpeg)[1].tobytes()
