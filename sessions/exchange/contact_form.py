"""The exchange format ``tactile-contacts/1`` as a document: its keys, and checks of their values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array, FARTHEST_m, LARGEST_GRASP_m

FORMAT = "tactile-contacts/1"

_LARGEST_OBJECT_m = 2.0
"""Larger outlines, and larger motions of the hand between two grasps, must be in millimetres."""

_LARGEST_WORKSPACE_m = 20.0
"""Contacts of one session that are farther apart must be in millimetres."""

_MOST_GRASPS, _MOST_CONTACTS, _MOST_CORNERS, _MOST_ERRORS = 10_000, 100, 2000, 12
"""Of a log, of one grasp, of a true outline, and of those that contacts of one finger share."""


def _unit(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    length = math.hypot(*vector)
    if abs(length - 1.0) > 0.01:
        raise ValueError(f"a normal must have length 1, not {length:.3g}")
    return vector


def _rigid(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    matrix = np.array(rows)
    rotation = matrix[:3, :3]
    bottom = np.allclose(matrix[3], [0.0, 0.0, 0.0, 1.0], atol=1e-6)
    if not bottom or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4) or np.linalg.det(rotation) < 0:
        raise ValueError("not a rigid motion (rotation, translation, last row 0 0 0 1)")
    return rows


def _covariance(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    matrix = np.array(rows)
    if not np.allclose(matrix, matrix.T, rtol=1e-6, atol=1e-15) or np.linalg.eigvalsh(matrix).min() < -1e-12:
        raise ValueError("not a covariance (symmetric, no negative variance)")
    return rows


def _short(limit: float, unit: str) -> AfterValidator:
    """A standard deviation above the limit must be in another unit."""

    def check(sigma: float) -> float:
        if sigma > limit:
            raise ValueError(f"{sigma:.4g} is too large; is it in {unit}?")
        return sigma

    return AfterValidator(check)


Vector = tuple[float, float, float]
Row = tuple[float, float, float, float]
RigidRows = Annotated[tuple[Row, Row, Row, Row], AfterValidator(_rigid)]
CovarianceRows = Annotated[tuple[Vector, Vector, Vector], AfterValidator(_covariance)]
FingerName = Annotated[str, Field(min_length=1, max_length=40)]
_Length = Annotated[float, _short(0.2, "millimetres")]
_Moves = Annotated[tuple[float, ...], Field(min_length=1, max_length=_MOST_ERRORS)]
_Angle = Annotated[float, _short(float(np.pi), "degrees")]


class MotionSigma(StrictModel):
    """Standard deviations of one re-orientation, per axis.

    ``unheld`` is the share of them that holds where the hand left the object in place. ``palm_m`` is the palm's own, in
    each grasp, which all its contacts have in common.
    """

    translation_m: _Length = Field(ge=0.0)
    rotation_rad: _Angle = Field(ge=0.0)
    unheld: float = Field(default=1.0, gt=0.0, le=1.0)
    palm_m: _Length = Field(default=0.0, ge=0.0)


class StepSigmaEntry(StrictModel):
    """Standard deviations of one grasp's ``hand_motion_world``, per axis."""

    translation_m: _Length = Field(ge=0.0)
    rotation_rad: _Angle = Field(ge=0.0)


class ObjectTruth(StrictModel):
    """The true object in its own coordinates: an outline, or the name of a mesh file next to the log."""

    name: str = "object"
    polygon_m: tuple[tuple[float, float], ...] | None = Field(default=None, min_length=3, max_length=_MOST_CORNERS)
    mesh: str | None = None

    @field_validator("mesh")
    @classmethod
    def _beside_the_log(cls, mesh: str | None) -> str | None:
        if mesh is not None and (mesh in {"", ".", ".."} or any(mark in mesh for mark in "/\\\0")):
            raise ValueError(f"{mesh!r} is not the name of a file in the log's own folder")
        return mesh

    @model_validator(mode="after")
    def _in_metres(self) -> Self:
        if self.polygon_m and (extent := float(np.ptp(self.polygon_m, axis=0).max())) > _LARGEST_OBJECT_m:
            raise ValueError(f"its polygon is {extent:.4g} m wide; are its lengths in millimetres?")
        return self


class ContactEntry(StrictModel):
    """One contact. Its own sigmas take precedence over those of the log."""

    finger: FingerName
    point_world_m: Vector
    normal_world: Annotated[Vector, AfterValidator(_unit)]
    point_sigma_m: _Length | None = Field(default=None, gt=0.0)
    point_covariance_m2: CovarianceRows | None = None
    shared_covariance_m2: CovarianceRows | None = None
    shared_moves_m: tuple[_Moves, _Moves, _Moves] | None = None
    shared_by_all: bool = False
    normal_sigma_rad: _Angle | None = Field(default=None, gt=0.0)
    force_N: float | None = Field(default=None, ge=0.0)

    @model_validator(mode="after")
    def _shared_once(self) -> Self:
        if self.shared_moves_m is None:
            return self
        if self.shared_covariance_m2 is not None:
            raise ValueError("shared_moves_m says what shared_covariance_m2 says, and more: give one of them")
        if len({len(row) for row in self.shared_moves_m}) > 1:
            raise ValueError("the three rows of shared_moves_m need the same length, one number for each error")
        if self.point_covariance_m2 is not None:
            moves = np.array(self.shared_moves_m)
            left = np.array(self.point_covariance_m2) - moves @ moves.T
            if np.linalg.eigvalsh(left).min() < -1e-12:
                raise ValueError("shared_moves_m moves the point farther than point_covariance_m2 says")
        return self


class LineEntry(StrictModel):
    """The approach path of one fingertip while it closed."""

    finger: FingerName
    start_world_m: Vector
    end_world_m: Vector
    touched: bool


class GraspEntry(StrictModel):
    """One grasp."""

    stamp_s: float = 0.0
    contacts: tuple[ContactEntry, ...]
    hand_motion_world: RigidRows
    motion_sigma: StepSigmaEntry | None = None
    begins_anew: bool = False
    world_T_palm: RigidRows | None = None
    closing_lines: tuple[LineEntry, ...] = ()
    world_T_object: RigidRows | None = None

    @property
    def points_m(self) -> Array:
        """Contact points, shape (n, 3), world frame."""
        return np.array([contact.point_world_m for contact in self.contacts]).reshape(-1, 3)


class Document(StrictModel):
    """A whole log."""

    format: Literal["tactile-contacts/1"]
    dimension: Literal[2, 3]
    point_sigma_m: _Length = Field(gt=0.0)
    normal_sigma_rad: _Angle = Field(gt=0.0)
    motion_sigma: MotionSigma | None = None
    object: ObjectTruth | None = None
    grasps: tuple[GraspEntry, ...] = Field(min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _is_bounded(cls, content: Any) -> Any:
        """Before every entry is looked at: millions of wrong ones would be millions of complaints."""
        grasps = content.get("grasps") if isinstance(content, dict) else None
        if isinstance(grasps, list) and len(grasps) > _MOST_GRASPS:
            raise ValueError(f"grasps: {len(grasps)} are more than the {_MOST_GRASPS} that are read")
        for index, grasp in enumerate(grasps if isinstance(grasps, list) else ()):
            for key in ("contacts", "closing_lines"):
                entries = grasp.get(key) if isinstance(grasp, dict) else None
                if isinstance(entries, list) and len(entries) > _MOST_CONTACTS:
                    raise ValueError(f"grasps.{index}.{key}: {len(entries)} are more than {_MOST_CONTACTS}")
        return content

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if not any(grasp.contacts for grasp in self.grasps):
            raise ValueError("no grasp has a contact")
        with np.errstate(over="ignore", invalid="ignore"):  # places of 1e308 m are too far, whatever their sum is
            _check_sizes(self.grasps)
            _check_origin(self.grasps)
            if self.dimension == 2:
                _check_planar(self.grasps)
        return self


def _check_sizes(grasps: Sequence[GraspEntry]) -> None:
    """Check for lengths that no hand or workspace has, and that must be in another unit."""
    for index, grasp in enumerate(grasps):
        if len(grasp.contacts) and (extent := _extent_m(grasp.points_m)) > LARGEST_GRASP_m:
            raise ValueError(f"contacts of grasp {index} are {extent:.4g} m apart; are lengths in millimetres?")
    together = np.concatenate([grasp.points_m for grasp in grasps])
    if (extent := _extent_m(together)) > _LARGEST_WORKSPACE_m:
        raise ValueError(f"the grasps are {extent:.4g} m apart; are lengths in millimetres?")
    for index, (before, grasp) in enumerate(pairwise(grasps), start=1):
        if (carried := _carried_m(before, grasp)) > _LARGEST_OBJECT_m:
            moved = f"the hand moved by {carried:.4g} m before grasp {index}"
            raise ValueError(f"{moved}; are lengths in millimetres?")


def _check_origin(grasps: Sequence[GraspEntry]) -> None:
    """All of it near the world's origin; a motion about a place within reach may shift the origin by twice as much."""
    for index, grasp in enumerate(grasps):
        points = [
            *grasp.points_m,
            *(end for line in grasp.closing_lines for end in (line.start_world_m, line.end_world_m)),
        ]
        poses = [pose for pose in (grasp.world_T_palm, grasp.world_T_object) if pose is not None]
        places = [*points, *([row[3] for row in pose[:3]] for pose in poses)]
        farthest_m = max((float(np.abs(place).max()) for place in places), default=0.0)
        shift_m = max(abs(row[3]) for row in grasp.hand_motion_world[:3])
        if (far_m := max(farthest_m, shift_m / 4)) > FARTHEST_m:
            reach = f"farther than {FARTHEST_m:g} m; move the world's origin near the object"
            raise ValueError(f"grasp {index} reaches {far_m:.4g} m from the origin, {reach}")


def _extent_m(points_m: Array) -> float:
    return float(np.ptp(points_m, axis=0).max())


def _carried_m(before: GraspEntry, grasp: GraspEntry) -> float:
    """How far the hand's motion carries the contacts of the grasp before."""
    if not before.contacts:
        return 0.0
    motion, centre = np.array(grasp.hand_motion_world), before.points_m.mean(axis=0)
    return float(np.linalg.norm(motion[:3, :3] @ centre + motion[:3, 3] - centre))


def _check_planar(grasps: Sequence[GraspEntry]) -> None:
    vectors = [v for grasp in grasps for c in grasp.contacts for v in (c.point_world_m, c.normal_world)]
    vectors += [v for grasp in grasps for line in grasp.closing_lines for v in (line.start_world_m, line.end_world_m)]
    if any(vector[2] != 0.0 for vector in vectors):
        raise ValueError("dimension 2 needs z = 0 in every point and normal")
