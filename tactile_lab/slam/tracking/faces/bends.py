"""How the surface of a round object turns from place to place.

A flat face has one normal, so that a grasp that turns on it is told by the normals of its contacts. On a ball it is
not: contacts that turn about its centre meet other places, with the normals that they have. Faces that stand in for a
round surface know its poses too well if that is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap

_STEP_m = 1e-4


@dataclass(frozen=True)
class Bends:
    """The smooth field's surface at some contacts, object frame.

    Attributes:
        normals: outward unit normals, shape (n, d).
        turning: their derivatives by the place, 1/m, shape (n, d, d); the last axis is the place's.
    """

    normals: Array
    turning: Array

    @classmethod
    def of(cls, contact_map: ContactMap) -> Self:
        """At the contacts of a map."""
        field, places_m = contact_map.fit(), contact_map.contacts.points_m
        gradients = field.gradient(places_m)
        steps = _STEP_m * np.eye(places_m.shape[1])
        changes = [field.gradient(places_m + step) - field.gradient(places_m - step) for step in steps]
        lengths = np.linalg.norm(gradients, axis=1)
        turning = np.stack(changes, axis=2) / (2 * _STEP_m * lengths[:, None, None])
        return cls(gradients / lengths[:, None], turning)
