"""Describes the unknown part of a shape in words for the operator.

Directions are those of someone who stands behind the arm: "far" is along the world's x axis, "left" along its y axis.
"""

from __future__ import annotations

import math

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Array
from tactile_lab.autonomy.variance_planner import KnownShape
from tactile_lab.slam.exploration.policy import Surface

SECTORS = ("far", "far left", "left", "near left", "near", "near right", "right", "far right")
KNOWN_WELL = 0.9
"""Known share of the surface above which nothing is called unknown."""


def direction(x: float, y: float) -> str:
    """The direction of a vector on the table."""
    turns = math.atan2(y, x) / (2.0 * math.pi)
    return SECTORS[round(turns * len(SECTORS)) % len(SECTORS)]


def describe_unknown(known: KnownShape | None, world_T_object: Pose2 | None) -> str:
    """Which part of the object is least known, as seen from its middle."""
    if known is None or world_T_object is None:
        return "the whole object is unknown"
    if known.explored >= KNOWN_WELL:
        return f"{known.explored:.0%} of the surface is known"
    if known.surface is None:
        return "no closed shape yet"
    worst = _worst_sector(known.surface, known.centre_m, world_T_object)
    return f"{known.explored:.0%} of the surface is known; least known is the {SECTORS[worst]} side"


def _worst_sector(surface: Surface, centre_m: Array, world_T_object: Pose2) -> int:
    """The sector, seen from the middle, with the largest mean uncertainty of its part of the surface."""
    offsets_m = surface.points_m[:, :2] - centre_m
    turns = (np.arctan2(offsets_m[:, 1], offsets_m[:, 0]) + world_T_object.theta()) / (2.0 * np.pi)
    sectors = np.round(turns * len(SECTORS)).astype(int) % len(SECTORS)
    sizes = np.bincount(sectors, surface.sizes, minlength=len(SECTORS))
    sums = np.bincount(sectors, surface.sizes * surface.sigma_m, minlength=len(SECTORS))
    return int(np.argmax(sums / np.maximum(sizes, 1e-12)))
