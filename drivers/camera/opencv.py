"""OpenCV, of the extra ``camera``: imported when something of it is first used.

Who works on pictures names it from here, so that everything else runs without it: the base of an installation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.core.installed.extras import LazyPackage

if TYPE_CHECKING:
    import cv2
else:
    cv2 = LazyPackage("cv2")

__all__ = ["cv2"]
