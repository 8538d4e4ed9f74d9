"""Settings of a rendered camera: its pose and the imperfections of its pictures."""

from __future__ import annotations

from pydantic import Field

from drivers.core.configuration import StrictModel
from drivers.core.fingertip import RigidTransform


class CameraSettings(StrictModel):
    """The camera under the table, without its lens.

    Attributes:
        world_T_camera: its pose: z along the viewing direction (up), x along the rows of the picture.
        glass_thickness_m, glass_index: the table's glass plate.
        blur_px: sharpness, one standard deviation.
        noise_levels: noise of a pixel of 255.
        jpeg_quality: of the pictures it sends.
        stream_hz: frames per second whose markers it streams; None for a camera that waits for triggers.
        late_ms: delay between taking a frame and its arrival, when it is stamped.
    """

    world_T_camera: RigidTransform = RigidTransform(translation_m=(-0.005, -0.04, -0.58), rpy_rad=(-0.07, 0.05, 0.0))
    glass_thickness_m: float = Field(default=0.008, ge=0.0)
    glass_index: float = Field(default=1.5, ge=1.0)
    blur_px: float = Field(default=0.8, gt=0.0)
    noise_levels: float = Field(default=3.0, ge=0.0)
    jpeg_quality: int = Field(default=90, ge=1, le=100)
    stream_hz: float | None = Field(default=None, gt=0.0, le=100.0)
    late_ms: float = Field(default=0.0, ge=0.0, le=500.0)
