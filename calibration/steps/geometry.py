"""Known geometry that fingertips press: the table, its edges, a calibration block, marked points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from calibration.steps.observations import Plane, Spot, Target
from drivers.core.configuration import StrictModel, load_model
from drivers.core.contacts import Array
from drivers.core.fingertip import PositiveFloat, RigidTransform, Vector3


class TableEdges(StrictModel):
    """The table's top, z = 0 of the world, and the four edges of its plate.

    Attributes:
        size_m: along the world's x and y.
        centre_m: of the plate, world x and y.
        thickness_m: of the plate.
        edge_sigma_m: how well the edges' places are known.
        pressed_m: the part of the top that is pressed, from the world's origin, per axis.
    """

    size_m: tuple[PositiveFloat, PositiveFloat]
    centre_m: tuple[float, float] = (0.0, 0.0)
    thickness_m: PositiveFloat
    edge_sigma_m: float = Field(default=2e-4, ge=0.0)
    pressed_m: PositiveFloat = 0.2


class Block(StrictModel):
    """A calibration block at a known place.

    Attributes:
        size_m: along its own axes.
        world_T_block: its centre, axes along its edges.
        sigma_m: how well its faces' places are known.
    """

    size_m: tuple[PositiveFloat, PositiveFloat, PositiveFloat]
    world_T_block: RigidTransform
    sigma_m: float = Field(default=2e-4, ge=0.0)


class KnownGeometry(StrictModel):
    """Known targets.

    Attributes:
        table: top and edges; None: only the top.
        block: None without one.
        points_world_m: marked points by name.
        point_sigma_m: how well a fingertip hits a marked point, and the point is known, per axis.
        top_sigma_m: how flat and how well known the table's top is.
    """

    table: TableEdges | None = None
    block: Block | None = None
    points_world_m: dict[str, Vector3] = Field(default_factory=dict)
    point_sigma_m: PositiveFloat = 1e-3
    top_sigma_m: PositiveFloat = 1e-4

    @model_validator(mode="after")
    def _something_beside_the_top(self) -> KnownGeometry:
        if self.table is None and self.block is None and len(self.points_world_m) < 3:
            raise ValueError(
                "needs the table's edges, a block, or at least three points: a table top alone does not determine a "
                "position on it"
            )
        return self


@dataclass(frozen=True, eq=False)
class Patch:
    """A target with the part of it that may be pressed.

    Attributes:
        target: the face or point.
        centre_world_m: middle of the part, shape (3,).
        reach_m: half the part along two directions in the face, shape (2, 3); zeros for a point.
    """

    target: Target
    centre_world_m: Array
    reach_m: Array

    @property
    def normal_world(self) -> Array:
        """Where a tip comes from: the face's normal, straight up for a point."""
        return self.target.normal_world if isinstance(self.target, Plane) else np.array([0.0, 0.0, 1.0])

    def at(self, first: float, second: float) -> Array:
        """A place on it, from -1 to 1 along both directions, shape (3,)."""
        return np.asarray(self.centre_world_m + first * self.reach_m[0] + second * self.reach_m[1])


def load_geometry(path: Path) -> KnownGeometry:
    """Read a geometry file. Raises ConfigurationError."""
    return load_model(path, KnownGeometry)


def patches(geometry: KnownGeometry) -> tuple[Patch, ...]:
    """Everything that may be pressed: the top first, then edges, block faces and points."""
    return (*_table(geometry), *_block(geometry.block), *_points(geometry))


def _table(geometry: KnownGeometry) -> Iterator[Patch]:
    table, up = geometry.table, np.array([0.0, 0.0, 1.0])
    half = table.pressed_m if table else 0.15
    plane = Plane("table top", np.zeros(3), up, geometry.top_sigma_m)
    yield Patch(plane, np.zeros(3), half * np.array([[1.0, 0, 0], [0, 1.0, 0]]))
    if table is None:
        return
    centre = np.array([*table.centre_m, -table.thickness_m / 2])
    for axis, name in enumerate("xy"):
        for sign, word in ((1.0, "+"), (-1.0, "-")):
            normal = np.zeros(3)
            normal[axis] = sign
            middle = centre + normal * table.size_m[axis] / 2
            along = np.zeros(3)
            along[1 - axis] = 0.8 * table.size_m[1 - axis] / 2
            yield Patch(
                Plane(f"table edge {word}{name}", middle, normal, table.edge_sigma_m),
                middle,
                np.array([along, np.zeros(3)]),
            )


def _block(block: Block | None) -> Iterator[Patch]:
    if block is None:
        return
    pose, half = block.world_T_block.pose(), np.array(block.size_m) / 2
    rotation, centre = pose.rotation().matrix(), np.asarray(pose.translation())
    for axis, name in enumerate("xyz"):
        for sign, word in ((1.0, "+"), (-1.0, "-")):
            normal = sign * rotation[:, axis]
            if normal[2] < -0.5:
                continue  # what stands on the table cannot be pressed from below
            first, second = (0.7 * half[other] * rotation[:, other] for other in range(3) if other != axis)
            middle = centre + half[axis] * normal
            yield Patch(Plane(f"block {word}{name}", middle, normal, block.sigma_m), middle, np.array([first, second]))


def _points(geometry: KnownGeometry) -> Iterator[Patch]:
    for name, place in geometry.points_world_m.items():
        point = np.array(place)
        yield Patch(Spot(f"point {name}", point, geometry.point_sigma_m), point, np.zeros((2, 3)))
