"""``properties.json``: mass, centre of mass, inertia and friction of the object, each with its standard deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from gtsam import Pose3

from drivers.core.atomic_files import write_whole
from drivers.core.contacts import Array
from drivers.core.errors import SessionError
from drivers.core.poses import planar
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.perception.weighing.value import Value
from tactile_lab.evaluation.files.plain import json_text, read_json_object
from tactile_lab.evaluation.inertia import EvenBody, PrincipalInertia
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh

PROPERTIES = "properties.json"
_SCHEMA_VERSION = 1


def write_properties(
    folder: Path,
    properties: ObjectProperties,
    world_T_object: Sequence[Pose3 | None],
    shape: SurfaceMesh | None = None,
) -> None:
    """Write what was measured; nothing where nothing was.

    Args:
        folder: of the results.
        properties: of a session, or of its replay.
        world_T_object: the estimated pose at each grasp, which brings the centre of mass into the object frame.
        shape: the estimated surface, object frame; None if there is none, or its top was not measured.

    Raises:
        WriteError: the folder cannot be written.
    """
    if not properties.is_known:
        return
    centre = _centre(properties, world_T_object)
    record = {
        "schema_version": _SCHEMA_VERSION,
        "mass_kg": properties.mass_kg,
        "centre_of_mass_m": centre,
        "inertia": _inertia(properties.mass_kg, centre, shape),
        "table_friction_N": properties.table_friction_N,
        "table_friction": properties.table_friction,
        "tip_friction_at_least": properties.tip_friction_at_least,
        "times_weighed": len(properties.hangings),
        "times_weighed_free": len(properties.centres),
    }
    write_whole(folder / PROPERTIES, json_text(record))


@dataclass(frozen=True)
class MeasuredBody:
    """What a session measured of an object; None where it did not.

    Attributes:
        mass_kg: mass.
        centre_m: of mass, x and y in the object frame, shape (2,).
        table_friction: coefficient of friction of the table.
        centre_sigma_m: standard deviation of the centre along each axis.
        inertia: about the centre of mass, object frame.
        hung_free: whether nothing but the fingertips held it when it was weighed; else it stood on an edge.
    """

    mass_kg: Value | None = None
    centre_m: Array | None = None
    table_friction: Value | None = None
    centre_sigma_m: float = 0.0
    inertia: PrincipalInertia | None = None
    hung_free: bool = True


def read_measured(results: Path) -> MeasuredBody:
    """What a results folder says of the object. Raises SessionError for a damaged file."""
    file = results / PROPERTIES
    if not file.is_file():
        return MeasuredBody()
    hint = "Replay the session into a new folder: tactile-lab session replay"
    record = read_json_object(file, hint=hint)
    try:
        found = MeasuredBody(
            mass_kg=_value(record.get("mass_kg")),
            table_friction=_value(record.get("table_friction")),
            hung_free=record.get("times_weighed_free") != 0,
        )
        if centre := record.get("centre_of_mass_m"):
            place_m = np.array(centre["value"], dtype=float).reshape(2)
            found = replace(found, centre_m=place_m, centre_sigma_m=float(centre["sigma"][0]))
        inertia = record.get("inertia")
        return found if inertia is None else replace(found, inertia=PrincipalInertia.from_json(inertia))
    except (KeyError, TypeError, ValueError, IndexError) as error:
        text = "mass_kg, centre_of_mass_m, inertia and table_friction need finite values"
        raise SessionError(text, where=str(file), hint=hint) from error


def _value(given: dict[str, Any] | None) -> Value | None:
    return None if given is None else Value(float(given["value"]), float(given["sigma"]))


def _centre(properties: ObjectProperties, world_T_object: Sequence[Pose3 | None]) -> dict[str, Any] | None:
    """The most certain centre of mass, x and y in the object frame; None without one, or without a pose for it."""
    placed = [each for each in properties.centres if world_T_object[each.grasp_index] is not None]
    if not placed:
        return None
    best = min(placed, key=lambda each: float(np.linalg.norm(each.sigma_m)))
    pose = world_T_object[best.grasp_index]
    assert pose is not None
    flat = planar(pose)
    sigma_m = float(np.linalg.norm(best.sigma_m) / np.sqrt(2))
    return {"value": flat.transformTo(best.place_m), "sigma": [sigma_m, sigma_m]}


def _inertia(mass: Value | None, centre: dict[str, Any] | None, shape: SurfaceMesh | None) -> dict[str, Any] | None:
    """Of the evenly filled surface; None without a mass or a closed surface."""
    if mass is None or shape is None or not shape.is_closed:
        return None
    surface = trimesh.Trimesh(shape.vertices, shape.faces, vertex_normals=shape.normals, process=False)
    body = EvenBody(surface, shape.sigma_m, mass)
    if centre is not None:
        body = replace(body, measured_centre_m=np.asarray(centre["value"]), centre_sigma_m=centre["sigma"][0])
    return body.principal().as_json()
