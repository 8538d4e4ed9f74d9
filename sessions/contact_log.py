"""The exchange form ``tactile-contacts/1``: grasps as one JSON file, for other people's data and programs.

Lengths in metres, angles in radians; dimension 2 keeps three-component vectors with z = 0. The form knows one point
and one normal uncertainty for all contacts, and no forces; truth (the object and its poses) is optional and meant
for evaluation only.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from gtsam import Pose3
from pydantic import AfterValidator, Field, model_validator

from tactile_lab.clock import NANOSECONDS
from tactile_lab.errors import ConfigurationError, SessionError
from tactile_lab.geometry.contacts import Array, Contact, Grasp
from tactile_lab.geometry.poses import planar, spatial
from tactile_lab.strict_yaml import StrictModel, validate

FORMAT = "tactile-contacts/1"

_LARGEST_GRASP_m = 1.0
"""No hand spans more; larger numbers are millimetres."""


def _unit(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    length = float(np.linalg.norm(vector))
    if abs(length - 1.0) > 0.01:
        raise ValueError(f"a normal has length 1, this one {length:.3g}")
    return vector


def _rigid(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    matrix = np.array(rows)
    rotation = matrix[:3, :3]
    bottom = np.allclose(matrix[3], [0.0, 0.0, 0.0, 1.0], atol=1e-6)
    if not bottom or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4) or np.linalg.det(rotation) < 0:
        raise ValueError("not a rigid motion (rotation, translation, last row 0 0 0 1)")
    return rows


_Vector = tuple[float, float, float]
_Row = tuple[float, float, float, float]
_Motion = Annotated[tuple[_Row, _Row, _Row, _Row], AfterValidator(_rigid)]


class MotionSigma(StrictModel):
    """Standard deviations of one re-orientation, per axis."""

    translation_m: float = Field(ge=0.0)
    rotation_rad: float = Field(ge=0.0)


class ObjectTruth(StrictModel):
    """The true object in its own coordinates: an outline, or the name of a mesh file beside the log."""

    name: str = "object"
    polygon_m: tuple[tuple[float, float], ...] | None = Field(default=None, min_length=3)
    mesh: str | None = None


class _ContactEntry(StrictModel):
    finger: str
    point_world_m: _Vector
    normal_world: Annotated[_Vector, AfterValidator(_unit)]


class _GraspEntry(StrictModel):
    stamp_s: float = 0.0
    contacts: tuple[_ContactEntry, ...]
    hand_motion_world: _Motion
    world_T_object: _Motion | None = None


class _Document(StrictModel):
    format: Literal["tactile-contacts/1"]
    dimension: Literal[2, 3]
    point_sigma_m: float = Field(gt=0.0)
    normal_sigma_rad: float = Field(gt=0.0)
    motion_sigma: MotionSigma
    object: ObjectTruth | None = None
    grasps: tuple[_GraspEntry, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if not any(grasp.contacts for grasp in self.grasps):
            raise ValueError("no grasp has a contact")
        for index, grasp in enumerate(self.grasps):
            _check_size(index, np.array([contact.point_world_m for contact in grasp.contacts]).reshape(-1, 3))
        if self.dimension == 2:
            _check_planar(self.grasps)
        return self


def _check_size(index: int, points_m: Array) -> None:
    if len(points_m) and (extent := float(np.ptp(points_m, axis=0).max())) > _LARGEST_GRASP_m:
        raise ValueError(f"contacts of grasp {index} lie {extent:.4g} m apart; are the lengths in millimetres?")


def _check_planar(grasps: Sequence[_GraspEntry]) -> None:
    vectors = [v for grasp in grasps for c in grasp.contacts for v in (c.point_world_m, c.normal_world)]
    if any(vector[2] != 0.0 for vector in vectors):
        raise ValueError("dimension 2 needs z = 0 in every point and normal")


@dataclass(frozen=True)
class ContactLog:
    """A log in the program's own terms.

    Attributes:
        dimension: 2 or 3.
        point_sigma_m, normal_sigma_rad: standard deviation of all points and normals, per axis.
        motion_sigma: of one re-orientation.
        grasps: forces are not part of the form and read as 0; the palm's place is taken at the contacts' centre with
            its axes along the world's.
        truth: the object, or None; for evaluation only.
        true_poses: world_T_object at each grasp, None where not given; for evaluation only.
    """

    dimension: Literal[2, 3]
    point_sigma_m: float
    normal_sigma_rad: float
    motion_sigma: MotionSigma
    grasps: tuple[Grasp, ...]
    truth: ObjectTruth | None = None
    true_poses: tuple[Pose3 | None, ...] = ()


def read_contact_log(path: Path) -> ContactLog:
    """Read a log.

    Raises:
        SessionError: the file can not be read or is no JSON.
        ConfigurationError: its content does not fit the form; the message names each entry.
    """
    content = _load_json(path)
    tag = content.get("format") if isinstance(content, dict) else None
    if tag != FORMAT:
        raise ConfigurationError(
            f"its format is {tag!r}, not {FORMAT!r}", where=str(path), hint="Name a contact log of this form"
        )
    document = validate(content, _Document, where=str(path))
    return ContactLog(
        dimension=document.dimension,
        point_sigma_m=document.point_sigma_m,
        normal_sigma_rad=document.normal_sigma_rad,
        motion_sigma=document.motion_sigma,
        grasps=tuple(_grasp(index, entry, document) for index, entry in enumerate(document.grasps)),
        truth=document.object,
        true_poses=tuple(_optional_pose(entry.world_T_object) for entry in document.grasps),
    )


def write_contact_log(path: Path, log: ContactLog) -> None:
    """Write a log; the same checks as for reading.

    A log of dimension 2 is written as the horizontal part of its contacts and motions; contacts whose normal is
    vertical have none and are left out.

    Raises:
        ConfigurationError: the log is empty or does not make sense.
        SessionError: the file can not be written.
    """
    poses = log.true_poses or (None,) * len(log.grasps)
    document = {
        "format": FORMAT,
        "dimension": log.dimension,
        "point_sigma_m": log.point_sigma_m,
        "normal_sigma_rad": log.normal_sigma_rad,
        "motion_sigma": log.motion_sigma.model_dump(),
        **({"object": log.truth.model_dump(exclude_none=True)} if log.truth else {}),
        "grasps": [
            _grasp_entry(grasp, pose, flat=log.dimension == 2) for grasp, pose in zip(log.grasps, poses, strict=True)
        ],
    }
    validate(document, _Document, where=str(path))
    try:
        path.write_text(json.dumps(document, indent=1, allow_nan=False), encoding="utf-8")
    except OSError as error:
        raise SessionError(f"can not be written ({error.strerror})", where=str(path), hint="Check the disk") from error


def _load_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=_without_repeats)
    except OSError as error:
        raise SessionError(f"can not be read ({error.strerror})", where=str(path), hint="Check the path") from error
    except (ValueError, RecursionError) as error:
        raise SessionError(f"is not JSON ({error})", where=str(path)) from error


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a key appears twice in one object")
    return content


def _grasp(index: int, entry: _GraspEntry, document: _Document) -> Grasp:
    contacts = tuple(_contact(contact, document) for contact in entry.contacts)
    centre = np.mean([contact.point_world_m for contact in contacts], axis=0) if contacts else np.zeros(3)
    return Grasp(
        index=index,
        stamp_ns=round(entry.stamp_s * NANOSECONDS),
        contacts=contacts,
        world_T_palm=Pose3(np.block([[np.eye(3), centre[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])),
        hand_motion_world=Pose3(np.array(entry.hand_motion_world)),
    )


def _contact(entry: _ContactEntry, document: _Document) -> Contact:
    normal = np.array(entry.normal_world)
    return Contact(
        finger=entry.finger,
        point_world_m=np.array(entry.point_world_m),
        normal_world=normal / np.linalg.norm(normal),
        point_covariance_m2=document.point_sigma_m**2 * np.eye(3),
        normal_sigma_rad=document.normal_sigma_rad,
        force_N=0.0,
    )


def _optional_pose(motion: tuple[_Row, ...] | None) -> Pose3 | None:
    return None if motion is None else Pose3(np.array(motion))


def _grasp_entry(grasp: Grasp, world_T_object: Pose3 | None, *, flat: bool) -> dict[str, Any]:
    entries = [_contact_entry(contact, flat=flat) for contact in grasp.contacts]
    entry: dict[str, Any] = {
        "stamp_s": grasp.stamp_ns / NANOSECONDS,
        "contacts": [contact for contact in entries if contact is not None],
        "hand_motion_world": _matrix(grasp.hand_motion_world, flat=flat),
    }
    if world_T_object is not None:
        entry["world_T_object"] = _matrix(world_T_object, flat=flat)
    return entry


def _contact_entry(contact: Contact, *, flat: bool) -> dict[str, Any] | None:
    scale = np.array([1.0, 1.0, 0.0]) if flat else np.ones(3)
    point, normal = contact.point_world_m * scale, contact.normal_world * scale
    length = float(np.linalg.norm(normal))
    if length < 0.5:  # steeper than 60 deg: it says nothing about the horizontal outline
        return None
    return {"finger": contact.finger, "point_world_m": point.tolist(), "normal_world": (normal / length).tolist()}


def _matrix(pose: Pose3, *, flat: bool) -> list[list[float]]:
    matrix: list[list[float]] = (spatial(planar(pose)) if flat else pose).matrix().tolist()
    return matrix
