"""``properties.json``: mass, centre of mass and friction of the object, each with its standard deviation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gtsam import Pose3

from drivers.core.atomic_files import write_whole
from drivers.core.errors import SessionError
from drivers.core.poses import planar
from sessions.perception.weighing.object_properties import ObjectProperties, Value
from tactile_lab.evaluation.files.plain import json_text, read_json_object

PROPERTIES = "properties.json"
_SCHEMA_VERSION = 1


def write_properties(folder: Path, properties: ObjectProperties, world_T_object: Sequence[Pose3 | None]) -> None:
    """Write what was measured; nothing where nothing was.

    Args:
        folder: of the results.
        properties: of a session, or of its replay.
        world_T_object: the estimated pose at each grasp, which brings the centre of mass into the object frame.

    Raises:
        WriteError: the folder cannot be written.
    """
    if not properties.is_known:
        return
    record = {
        "schema_version": _SCHEMA_VERSION,
        "mass_kg": properties.mass_kg,
        "centre_of_mass_m": _centre(properties, world_T_object),
        "table_friction_N": properties.table_friction_N,
        "table_friction": properties.table_friction,
        "tip_friction_at_least": properties.tip_friction_at_least,
        "times_weighed": len(properties.hangings),
        "times_weighed_free": len(properties.centres),
    }
    write_whole(folder / PROPERTIES, json_text(record))


def read_mass(results: Path) -> Value | None:
    """The mass in a results folder; None if the object was not weighed. Raises SessionError for a damaged file."""
    file = results / PROPERTIES
    if not file.is_file():
        return None
    hint = "Replay the session into a new folder: tactile-lab session replay"
    mass = read_json_object(file, hint=hint).get("mass_kg")
    try:
        return None if mass is None else Value(float(mass["value"]), float(mass["sigma"]))
    except (KeyError, TypeError, ValueError) as error:
        raise SessionError("mass_kg needs a finite value and sigma", where=str(file), hint=hint) from error


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
