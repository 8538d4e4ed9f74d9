"""The positions of a BioTac's electrodes, and the shape of its skin (protocols: BioTac electrodes).

BioTac frame: x along the finger to its tip, y to the side, z to the back of the finger; the electrodes lie in -z. The
origin of the 19-electrode model is the centre of the sphere at the end of the finger; that of the 24-electrode model
(BioTac SP) is the middle of its core.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from drivers.core.contacts import Array

ElectrodeCount = Literal[19, 24]

_CORE_19_mm = """
 0.993 -4.855 -1.116   -2.7 -3.513 -3.67   -6.2 -3.513 -3.67   -8.0 -4.956 -1.116   -10.5 -3.513 -3.67
-13.4 -4.956 -1.116    4.763 0 -2.33       3.031 -1.95 -3.33   3.031 1.95 -3.33     1.299 0 -4.33
 0.993 4.855 -1.116    -2.7 3.513 -3.67    -6.2 3.513 -3.67    -8.0 4.956 -1.116    -10.5 3.513 -3.67
-13.4 4.956 -1.116     -2.8 0 -5.08        -9.8 0 -5.08        -13.6 0 -5.08
"""
_CORE_24_mm = """
 9.81545 -3.98452 -2.76774   8.1012 -3.06593 -5.20807    2.21927 -7.16233 -3.26548   2.13094 -5.1198 -5.99249
-0.47307 -2.41094 -7.62297  -2.33393 -7.23789 -3.05908  -3.47115 -4.75292 -6.03376  -5.67567 -1.81704 -6.87514
-8.14711 -3.24539 -5.06726 -10.08207 -3.84977 -2.54111   9.81545 3.98452 -2.76774    8.1012 3.06593 -5.20807
 2.21927 7.16233 -3.26548    2.13094 5.1198 -5.99249    -0.47307 2.41094 -7.62297   -2.33393 7.23789 -3.05908
-3.47115 4.75292 -6.03376   -5.67567 1.81704 -6.87514   -8.14711 3.24539 -5.06726  -10.08207 3.84977 -2.54111
 6.57233 0 -6.40938          4.32191 -1.8519 -6.97047    4.32191 1.8519 -6.97047     1.91326 0 -7.57101
"""
_FACET_NORMAL = np.array([0.5, 0.0, -np.sqrt(0.75)])
_FACET = slice(6, 10)  # E7 to E10 of the 19-electrode model sit on a flat facet


class Skin(Protocol):
    """The outer surface of the finger when nothing touches it."""

    def project(self, points_m: Array) -> tuple[Array, Array]:
        """Project points (n, 3) outward onto the skin: skin points and outward unit normals, both (n, 3)."""


@dataclass(frozen=True)
class BallAndCylinder:
    """Skin of the 19-electrode model: a hemisphere for x > 0, a cylinder about x for x <= 0."""

    radius_m: float = 0.007

    def project(self, points_m: Array) -> tuple[Array, Array]:
        normals = np.array(points_m)
        normals[:, 0] = np.maximum(normals[:, 0], 0.0)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        skin = self.radius_m * normals
        skin[:, 0] += np.minimum(points_m[:, 0], 0.0)
        return skin, normals


@dataclass(frozen=True)
class EllipsoidSkin:
    """Skin as an ellipsoid whose axes are parallel to those of the BioTac frame.

    The defaults fit the published skin points of the BioTac SP's 24 electrodes within 0.1 mm.
    """

    semi_axes_m: tuple[float, float, float] = (0.01405, 0.00971, 0.00956)
    centre_m: tuple[float, float, float] = (0.0, 0.0, -0.00112)

    def project(self, points_m: Array) -> tuple[Array, Array]:
        """Project along the ray from the centre."""
        axes, centre = np.array(self.semi_axes_m), np.array(self.centre_m)
        direction = points_m - centre
        direction = direction / np.linalg.norm(direction / axes, axis=1, keepdims=True)
        normals = direction / axes**2
        return direction + centre, normals / np.linalg.norm(normals, axis=1, keepdims=True)


@dataclass(frozen=True)
class ElectrodeLayout:
    """Electrodes on the core and the skin above them, BioTac frame.

    Attributes:
        positions_m: on the core, shape (n, 3), electrode 1 first.
        normals: outward unit normals of the core there, shape (n, 3).
        skin: the surface that touches objects.
    """

    positions_m: Array
    normals: Array
    skin: Skin


def electrodes_of(serial: str) -> ElectrodeCount:
    """Number of electrodes of the sensor with this serial number (protocols: BioTac slots)."""
    return 24 if serial.startswith(("BTSP", "BTTB")) else 19


def electrode_layout(electrodes: ElectrodeCount, skin: Skin | None = None) -> ElectrodeLayout:
    """The layout of the 19- or 24-electrode model, with its own skin unless another is given."""
    if electrodes == 19:
        positions = _table_m(_CORE_19_mm)
        normals = BallAndCylinder().project(positions)[1]
        normals[_FACET] = _FACET_NORMAL
        return ElectrodeLayout(positions, normals, skin or BallAndCylinder())
    positions = _table_m(_CORE_24_mm)
    return ElectrodeLayout(positions, EllipsoidSkin().project(positions)[1], skin or EllipsoidSkin())


def _table_m(text: str) -> Array:
    return np.asarray(1e-3 * np.array(text.split(), float).reshape(-1, 3))
