"""The exchange format ``tactile-contacts/1``: grasps as one JSON file, for other data and programs.

Lengths in metres, angles in radians; dimension 2 keeps three-component vectors with z = 0. One point and one normal
uncertainty apply to all contacts that do not state their own; ground truth (the object and its poses) is optional and
for evaluation only. Reading a written log returns the same values, bit for bit.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.atomic_files import write_whole
from drivers.core.clock import NANOSECONDS
from drivers.core.configuration import validate
from drivers.core.contact_checks import opposing_pairs
from drivers.core.contacts import LARGEST_SLOPE, ApproachPath, Array, Contact, Grasp, StepSigma
from drivers.core.errors import ConfigurationError
from drivers.core.poses import palm_heading, planar, spatial
from drivers.core.reading.bounded_files import LARGEST_JSON_bytes, read_input
from drivers.core.reading.json_text import parse_json
from sessions.exchange.contact_form import (
    FORMAT,
    ContactEntry,
    Document,
    GraspEntry,
    LineEntry,
    MotionSigma,
    ObjectTruth,
)

__all__ = ["FORMAT", "ContactLog", "MotionSigma", "ObjectTruth", "read_contact_log", "write_contact_log"]

_FLAT = np.array([1.0, 1.0, 0.0])


@dataclass(frozen=True)
class ContactLog:
    """A log in the program's own types.

    Attributes:
        dimension: 2 or 3.
        point_sigma_m, normal_sigma_rad: standard deviation of all points and normals, per axis, where a contact does
            not state its own.
        motion_sigma: of one re-orientation; None if unknown.
        grasps: a missing force is read as 0, a missing palm pose as the contacts' centre with the world's axes.
        truth: the object, or None; for evaluation only.
        true_poses: world_T_object at each grasp, None if not given; for evaluation only.
    """

    dimension: Literal[2, 3]
    point_sigma_m: float
    normal_sigma_rad: float
    motion_sigma: MotionSigma | None
    grasps: tuple[Grasp, ...]
    truth: ObjectTruth | None = None
    true_poses: tuple[Pose3 | None, ...] = ()


def read_contact_log(path: Path) -> ContactLog:
    """Read a log.

    Raises:
        ConfigurationError: the file cannot be read or is not JSON, its content does not fit the format, or its normals
            point into the object; the message names each entry.
    """
    content = _load_json(path)
    tag = content.get("format") if isinstance(content, dict) else None
    if tag != FORMAT:
        raise ConfigurationError(
            f"its format is {tag!r}, not {FORMAT!r}", where=str(path), hint="Give a contact log of this format"
        )
    document = validate(content, Document, where=str(path))
    grasps = tuple(_grasp(index, entry, document) for index, entry in enumerate(document.grasps))
    _check_normals(grasps, path)
    return ContactLog(
        dimension=document.dimension,
        point_sigma_m=document.point_sigma_m,
        normal_sigma_rad=document.normal_sigma_rad,
        motion_sigma=document.motion_sigma,
        grasps=grasps,
        truth=document.object,
        true_poses=tuple(_optional_pose(entry.world_T_object) for entry in document.grasps),
    )


def write_contact_log(path: Path, log: ContactLog) -> int:
    """Write a log; the same checks as for reading.

    A log of dimension 2 holds the horizontal part of its contacts and motions; contacts with a vertical normal have
        none and are left out.

    Returns:
        the number of contacts written.

    Raises:
        ConfigurationError: the log is empty or inconsistent.
        WriteError: the file cannot be written.
    """
    poses = log.true_poses or (None,) * len(log.grasps)
    grasps = [_grasp_entry(grasp, pose, log) for grasp, pose in zip(log.grasps, poses, strict=True)]
    document = {
        "format": FORMAT,
        "dimension": log.dimension,
        "point_sigma_m": log.point_sigma_m,
        "normal_sigma_rad": log.normal_sigma_rad,
        **({"motion_sigma": log.motion_sigma.model_dump(exclude_defaults=True)} if log.motion_sigma else {}),
        **({"object": log.truth.model_dump(exclude_none=True)} if log.truth else {}),
        "grasps": grasps,
    }
    validate(document, Document, where=str(path))
    write_whole(path, json.dumps(document, indent=1, allow_nan=False))
    return sum(len(grasp["contacts"]) for grasp in grasps)


# --- reading -------------------------------------------------------------------------------------------------------


def _load_json(path: Path) -> Any:
    try:
        return parse_json(read_input(path, LARGEST_JSON_bytes), object_pairs_hook=_without_repeats)
    except ValueError as error:
        raise ConfigurationError(f"is not JSON ({error})", where=str(path)) from error


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a key appears twice in one object")
    return content


def _check_normals(grasps: Sequence[Grasp], path: Path) -> None:
    found = opposing_pairs(grasps)
    if found.point_in:
        what = f"normals point into the object, in {found.inward} of {found.pairs} pairs of opposing contacts"
        raise ConfigurationError(what, where=str(path), hint="Normals must point out of the object: negate them")


def _grasp(index: int, entry: GraspEntry, document: Document) -> Grasp:
    contacts = tuple(_contact(contact, document) for contact in entry.contacts)
    own = entry.motion_sigma
    return Grasp(
        index=index,
        stamp_ns=round(entry.stamp_s * NANOSECONDS),
        contacts=contacts,
        world_T_palm=_optional_pose(entry.world_T_palm) or _assumed_palm(entry.points_m),
        hand_motion_world=Pose3(np.array(entry.hand_motion_world)),
        approach_paths=tuple(_closing_line(line) for line in entry.closing_lines),
        motion_sigma=None if own is None else StepSigma(own.translation_m, own.rotation_rad),
        begins_anew=entry.begins_anew,
    )


def _assumed_palm(points_m: Array) -> Pose3:
    """The palm if it is not given: at the contacts' centre, with the world's axes."""
    matrix = np.eye(4)
    matrix[:3, 3] = points_m.mean(axis=0) if len(points_m) else 0.0
    return Pose3(matrix)


def _contact(entry: ContactEntry, document: Document) -> Contact:
    normal = np.array(entry.normal_world)
    length = float(np.linalg.norm(normal))
    own = entry.point_covariance_m2
    sigma_m = entry.point_sigma_m or document.point_sigma_m
    return Contact(
        finger=entry.finger,
        point_world_m=np.array(entry.point_world_m),
        normal_world=normal if abs(length - 1.0) < 1e-12 else normal / length,
        point_covariance_m2=sigma_m**2 * np.eye(3) if own is None else np.array(own),
        normal_sigma_rad=entry.normal_sigma_rad or document.normal_sigma_rad,
        force_N=entry.force_N or 0.0,
        shared_covariance_m2=None if entry.shared_covariance_m2 is None else np.array(entry.shared_covariance_m2),
        shared_moves_m=None if entry.shared_moves_m is None else np.array(entry.shared_moves_m),
        shared_by_all=entry.shared_by_all,
    )


def _closing_line(entry: LineEntry) -> ApproachPath:
    return ApproachPath(entry.finger, np.array(entry.start_world_m), np.array(entry.end_world_m), entry.touched)


def _optional_pose(motion: tuple[tuple[float, ...], ...] | None) -> Pose3 | None:
    return None if motion is None else Pose3(np.array(motion))


# --- writing -------------------------------------------------------------------------------------------------------


def _grasp_entry(grasp: Grasp, world_T_object: Pose3 | None, log: ContactLog) -> dict[str, Any]:
    flat = log.dimension == 2
    contacts = [contact for contact in grasp.contacts if not flat or _horizontal(contact) >= LARGEST_SLOPE]
    scale = _FLAT if flat else np.ones(3)
    points = np.array([scale * contact.point_world_m for contact in contacts]).reshape(-1, 3)
    palm = spatial(Pose2(grasp.world_T_palm.x(), grasp.world_T_palm.y(), palm_heading(grasp.world_T_palm)))
    palm = palm if flat else grasp.world_T_palm
    entry: dict[str, Any] = {
        "stamp_s": grasp.stamp_ns / NANOSECONDS,
        "contacts": [_contact_entry(contact, log, scale) for contact in contacts],
        "hand_motion_world": _matrix(grasp.hand_motion_world, flat=flat),
    }
    if grasp.motion_sigma is not None:
        entry["motion_sigma"] = asdict(grasp.motion_sigma)
    if grasp.begins_anew:
        entry["begins_anew"] = True
    if not np.array_equal(palm.matrix(), _assumed_palm(points).matrix()):
        entry["world_T_palm"] = palm.matrix().tolist()
    if grasp.approach_paths:
        entry["closing_lines"] = [_line_entry(line, scale) for line in grasp.approach_paths]
    if world_T_object is not None:
        entry["world_T_object"] = _matrix(world_T_object, flat=flat)
    return entry


def _horizontal(contact: Contact) -> float:
    """Length of the normal's horizontal part; if it is small the contact says nothing about the horizontal outline."""
    return float(np.linalg.norm(contact.normal_world[:2]))


def _contact_entry(contact: Contact, log: ContactLog, scale: Array) -> dict[str, Any]:
    """A contact, without the values that the log states for all contacts."""
    steep = 1.0 if scale[2] else _horizontal(contact)
    covariance = contact.point_covariance_m2 * np.outer(scale, scale)
    normal_sigma_rad = contact.normal_sigma_rad / steep
    entry: dict[str, Any] = {
        "finger": contact.finger,
        "point_world_m": (scale * contact.point_world_m).tolist(),
        "normal_world": (scale * contact.normal_world / steep).tolist(),
    }
    if not np.array_equal(contact.point_covariance_m2, log.point_sigma_m**2 * np.eye(3)):
        entry["point_covariance_m2"] = covariance.tolist()
    if contact.shared_covariance_m2 is not None:
        entry["shared_covariance_m2"] = (contact.shared_covariance_m2 * np.outer(scale, scale)).tolist()
    if contact.shared_moves_m is not None:
        entry["shared_moves_m"] = (scale[:, None] * contact.shared_moves_m).tolist()
    if contact.shared_by_all:
        entry["shared_by_all"] = True
    if normal_sigma_rad != log.normal_sigma_rad:
        entry["normal_sigma_rad"] = normal_sigma_rad
    if contact.force_N:
        entry["force_N"] = contact.force_N
    return entry


def _line_entry(line: ApproachPath, scale: Array) -> dict[str, Any]:
    return {
        "finger": line.finger,
        "start_world_m": (scale * line.start_world_m).tolist(),
        "end_world_m": (scale * line.end_world_m).tolist(),
        "touched": line.touched,
    }


def _matrix(pose: Pose3, *, flat: bool) -> list[list[float]]:
    matrix: list[list[float]] = (spatial(planar(pose)) if flat else pose).matrix().tolist()
    return matrix
