"""Bodies of the hand: outer shapes and masses of every link but the fingertips, capsules, balls and one box.

Lengths in metres, masses in kilograms. Shapes follow the outer dimensions of Shadow's E-series hand; they only have to
touch what the real links would touch. Kinematics come from :mod:`drivers.shadow.model.kinematics`. They are those of a
right hand; :func:`mirror_shape` makes a left hand's of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

from drivers.core.contacts import FINGERS

Vector = tuple[float, float, float]
ORIGIN: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Capsule:
    """A capsule between two points of the link frame."""

    start_m: Vector
    end_m: Vector
    radius_m: float
    mass_kg: float


@dataclass(frozen=True)
class Ball:
    """A ball about a point of the link frame."""

    radius_m: float
    mass_kg: float
    centre_m: Vector = ORIGIN


@dataclass(frozen=True)
class Block:
    """A box about a point of the link frame, axes along the link's."""

    half_size_m: Vector
    mass_kg: float
    centre_m: Vector = ORIGIN


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid about a point of the link frame, axes along the link's."""

    semi_axes_m: Vector
    mass_kg: float
    centre_m: Vector = ORIGIN


Shape: TypeAlias = Capsule | Ball | Block | Ellipsoid


def _along_z(start_m: float, end_m: float, radius_m: float, mass_kg: float) -> Capsule:
    return Capsule((0.0, 0.0, start_m), (0.0, 0.0, end_m), radius_m, mass_kg)


FOREARM: tuple[Shape, ...] = (
    _along_z(-0.020, 0.150, 0.050, 2.5),
    Capsule((0.0, -0.010, 0.120), (0.0, -0.010, 0.195), 0.032, 0.5),
)

_FINGER: dict[str, tuple[Shape, ...]] = {
    "J4": (Ball(0.0095, 0.008),),
    "J3": (_along_z(0.008, 0.042, 0.0085, 0.030),),
    "J2": (_along_z(0.0, 0.022, 0.0080, 0.017),),
    "J1": (_along_z(0.0, 0.005, 0.0078, 0.006),),
}

LINK_SHAPES: dict[str, tuple[Shape, ...]] = {
    "WRJ2": (
        Capsule((0.0, -0.012, 0.0), (0.0, 0.012, 0.0), 0.0135, 0.05),
        Capsule((-0.026, 0.0, 0.034), (0.031, 0.0, 0.034), 0.010, 0.05),
    ),
    "WRJ1": (
        Block((0.030, 0.010, 0.040), 0.22, (0.010, 0.002, 0.044)),
        Capsule((-0.010, 0.002, 0.086), (0.034, 0.002, 0.086), 0.0095, 0.05),
        Ellipsoid((0.018, 0.014, 0.026), 0.03, (0.030, -0.004, 0.020)),
    ),
    **{f"{finger}{joint}": shapes for finger in FINGERS[:4] for joint, shapes in _FINGER.items()},
    "LFJ5": (Capsule((0.002, 0.002, 0.008), (0.0, 0.002, 0.055), 0.0105, 0.03),),
    "THJ5": (Ball(0.013, 0.010),),
    "THJ4": (_along_z(0.008, 0.032, 0.0105, 0.04),),
    "THJ3": (Ball(0.0105, 0.005),),
    "THJ2": (_along_z(0.004, 0.029, 0.0092, 0.02),),
    "THJ1": (_along_z(0.0, 0.005, 0.0078, 0.006),),
}
"""Shapes of each joint's child link, in that link's frame."""


def mirror_shape(shape: Shape) -> Shape:
    """A shape as the other hand has it, mirrored in x = 0 of its link."""
    if isinstance(shape, Capsule):
        return replace(shape, start_m=_mirror(shape.start_m), end_m=_mirror(shape.end_m))
    return replace(shape, centre_m=_mirror(shape.centre_m))


def _mirror(place_m: Vector) -> Vector:
    return (-place_m[0], *place_m[1:])
