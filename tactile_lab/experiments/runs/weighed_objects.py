"""Objects that the simulated hand drags, lifts and sets down, to weigh them."""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers.simulation.surfaces import GLASS
from sessions.conductor.session_outcome import SessionOutcome
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.perception.weighing.value import Value
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.runs.carried_objects import CarryWatch, watch_carries


def weigh_object(cell: Cell) -> dict[str, Any]:
    """What is known of an object after each of the first grasps has weighed it. Cell: object, mass_kg, grasps."""
    grasps, mass_kg = int(cell["grasps"]), float(cell["mass_kg"])
    outcome, watch = watch_carries(str(cell["object"]), cell.seed, grasps, mass_kg, grasps)
    known = outcome.properties
    is_tipped = known.mass_kg is not None and not known.hung_free
    mass_off = _off("mass", known.mass_kg if known.hung_free else None, mass_kg, mass_kg / 100)
    return {
        "ending": str(outcome.ending),
        "weighed": known.hung_free,
        **mass_off,
        "tipped": is_tipped,
        **_off("tipped_mass", known.mass_kg if is_tipped else None, mass_kg, mass_kg / 100),
        "worst_mass_off": max(mass_off["mass_off"], default=None),
        **_off("table", known.table_friction, GLASS.friction[0], 1.0),
        **_centre_off(known, outcome, watch),
        "tips_at_least": [] if known.tip_friction_at_least is None else [known.tip_friction_at_least],
    }


def _off(name: str, known: Value | None, true: float, unit: float) -> dict[str, list[float]]:
    """By how much a value is off, in units and in stated standard deviations; empty if it is not known."""
    if known is None:
        return {f"{name}_off": [], f"{name}_z": []}
    off = known.value - true
    return {f"{name}_off": [abs(off) / unit], f"{name}_z": [off / known.sigma]}


def _centre_off(known: ObjectProperties, outcome: SessionOutcome, watch: CarryWatch) -> dict[str, list[float]]:
    """By how much the centres of mass are off, millimetres, and each axis in stated standard deviations."""
    distances_mm: list[float] = []
    shares: list[float] = []
    for centre in known.centres:
        pose = watch.true_pose(outcome.grasps[centre.grasp_index].stamp_ns)
        off_m = centre.place_m - pose.transformFrom(watch.centre_m)
        distances_mm.append(1e3 * float(np.linalg.norm(off_m)))
        shares += (off_m / centre.sigma_m).tolist()
    return {"centre_off_mm": distances_mm, "centre_z": shares}
