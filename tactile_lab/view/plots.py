"""The page's plots over time, and the camera's newest picture."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
import viser
from PIL import Image, UnidentifiedImageError

from drivers.core.contacts import FINGERS
from tactile_lab.view.scene import Scene

_COLOURS = ("#1d5fa8", "#c2570c", "#1a8f6a", "#8a4fbf", "#b3261e")
_DASHES: tuple[list[int], ...] = ([], [8, 3], [2, 3], [9, 3, 2, 3], [14, 4])
"""Lines differ in dashes as well as in colour, so that they can be told apart in grey."""
_HEIGHT_px = 170
_WIDEST_px = 640
_SIGMAS = ("position, mm", "rotation, °", "surface, mm")


class Plots:
    """Draws forces over time, standard deviations over the grasps, and the picture, each folded below a heading.

    Args:
        server: the page.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        with server.gui.add_folder("Forces over time", expand_by_default=False):
            self._forces = _plot(server, FINGERS, "s before now", "force, N")
        with server.gui.add_folder("Uncertainty over the grasps", expand_by_default=False):
            self._uncertainty = _plot(server, _SIGMAS, "grasp", "one sigma")
        self._camera = server.gui.add_folder("Camera", expand_by_default=False, visible=False)
        self._picture: Any = None

    def draw(self, scene: Scene) -> None:
        """Update plots and picture from the state of the session."""
        self._forces.data = scene.course.force_table(FINGERS)
        self._uncertainty.data = scene.course.uncertainty_table()
        if "picture" in scene.changed or (scene.picture and self._picture is None):
            self._show(scene.picture)

    def _show(self, encoded: bytes) -> None:
        image = shown_picture(encoded)
        if image is None:
            return
        if self._picture is None:
            self._camera.visible = True
            with self._camera:
                self._picture = self._server.gui.add_image(image, format="jpeg", label="newest picture")
        else:
            self._picture.image = image


def shown_picture(encoded: bytes) -> np.ndarray[Any, np.dtype[np.uint8]] | None:
    """A picture small enough for a panel, red green blue; None if it cannot be decoded."""
    try:
        with Image.open(BytesIO(encoded)) as image:
            image.thumbnail((_WIDEST_px, image.height))
            return np.asarray(image.convert("RGB"))
    except (UnidentifiedImageError, Image.DecompressionBombError, OSError, ValueError):
        return None


def _plot(server: viser.ViserServer, names: tuple[str, ...], x_label: str, y_label: str) -> Any:
    """An empty plot with a line for each name."""
    lines = [
        {"label": name, "stroke": colour, "dash": dash, "width": 2, "points": {"show": x_label == "grasp"}}
        for name, colour, dash in zip(names, _COLOURS, _DASHES, strict=False)
    ]
    return server.gui.add_uplot(
        data=tuple(np.full((1 + len(names), 1), np.nan)),
        series=({"label": x_label}, *lines),  # type: ignore[arg-type]
        scales={"x": {"time": False}},
        axes=({"label": x_label}, {"label": y_label}),
        height=_HEIGHT_px,
    )
