"""The readings that the thesis's text allows of its filter: of the gate, of the likelihood, and of the noise.

The gate (section 3.5.1) asks for four close contacts from two successive grasps, and for observability. How close is
not stated; the four may be those of the new grasp, close to the contacts before or to the surface, or those of both
grasps together, which are two pairs. Equation 3.9 has a field whose labels are +1 and -1 at a distance that is not
stated, with one of two kernels, of all grasps (algorithm 3.1) or of the previous one (figure 3.4). Section 3.4.1 has
10 mm and 20 degrees as standard deviations, section 3.6.2 as magnitudes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data import planar_data
from tactile_lab.experiments.data.sensing import SLIP_SIGMA_m, SLIP_SIGMA_rad
from tactile_lab.experiments.run_metrics import slam_figures
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.filter.measurement import GateSettings
from tactile_lab.slam.tracking.trackers import THESIS_SHAPE

_LEAST_NOISE = 0.05
_MAGNITUDE = 1 / 3
"""A magnitude read as three standard deviations."""


@dataclass(frozen=True)
class Reading:
    """One reading.

    Attributes:
        gate: when a particle's likelihood is not zero.
        label_m: distance from a contact at which the field's labels are +1 and -1.
        kernel: of the field.
        matching: whose field it is: of all grasps, or of the previous one.
        noise: standard deviation of the motion, as a share of what the text states.
    """

    gate: GateSettings
    label_m: float = 0.005
    kernel: Literal["squared_exponential", "thin_plate"] = "squared_exponential"
    matching: Literal["map", "previous"] = "map"
    noise: float = 1.0


_NEAR_m = 0.015
_GATES = {
    "four contacts near the previous grasp": GateSettings(close_to="previous", distance_m=_NEAR_m),
    "two pairs of successive grasps": GateSettings(
        close_to="previous", distance_m=_NEAR_m, least_contacts=2, least_eigenvalue=0.0
    ),
    "four contacts near any earlier one": GateSettings(close_to="earlier", distance_m=_NEAR_m),
    "four contacts within 15 mm of the surface": GateSettings(close_to="surface", distance_m=_NEAR_m),
    "four contacts within 5 mm of the surface": GateSettings(close_to="surface", distance_m=0.005),
    "no gate": GateSettings(least_contacts=0, least_eigenvalue=0.0),
}
_PAIRS, _SURFACE = _GATES["two pairs of successive grasps"], _GATES["four contacts within 5 mm of the surface"]

READINGS: Mapping[str, Mapping[str, Reading]] = {
    "gate, squared exponential kernel": {name: Reading(gate) for name, gate in _GATES.items()},
    "gate, thin plate kernel": {
        "two pairs of successive grasps": Reading(_PAIRS, kernel="thin_plate"),
        "four contacts within 5 mm of the surface": Reading(_SURFACE, kernel="thin_plate"),
        "no gate": Reading(_GATES["no gate"], kernel="thin_plate"),
    },
    "likelihood": {
        "labels at 2 mm": Reading(_SURFACE, label_m=0.002, kernel="thin_plate"),
        "labels at 10 mm": Reading(_SURFACE, label_m=0.010, kernel="thin_plate"),
        "field of the previous grasp": Reading(_PAIRS, kernel="thin_plate", matching="previous"),
    },
    "noise": {"magnitudes of three sigma": Reading(_SURFACE, kernel="thin_plate", noise=_MAGNITUDE)},
}
"""All readings by what they are of, and by name. Labels are at 5 mm where nothing else is said; likelihood and noise
have the thin plate and the gate of 5 mm, the field of the previous grasp that of the pairs.
"""


def settings_of(reading: Reading, noise: float) -> SlamSettings:
    """The thesis's filter in this reading, which knows the motion noise as a share of 10 mm and 20 degrees."""
    scale = max(noise * reading.noise, _LEAST_NOISE)
    shape = THESIS_SHAPE.model_copy(update={"offsurface_distance_m": reading.label_m, "kernel": reading.kernel})
    return SlamSettings.model_validate(
        {
            "method": "thesis-pf",
            "gate": reading.gate,
            "matching": reading.matching,
            "shape": shape,
            "motion": {"translation_m": scale * SLIP_SIGMA_m, "rotation_rad": scale * SLIP_SIGMA_rad},
        }
    )


def track_as_read(cell: Cell) -> dict[str, Any]:
    """The filter in one reading on planar grasps. Cell: part, reading, noise (percent), shape, grasps."""
    reading, noise = READINGS[cell["part"]][cell["reading"]], cell["noise"] / 100
    data = planar_data.simulate(cell["shape"], cell.seed, motion_scale=noise * reading.noise, count=cell["grasps"])
    slam = TactileSlam(settings_of(reading, noise), cell.seed)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    figures = slam_figures(data, slam.finish())
    hausdorff_mm = figures["hausdorff_mm"]
    return {**figures, "below_9_mm": hausdorff_mm is not None and bool(np.less(hausdorff_mm, 9.0))}
