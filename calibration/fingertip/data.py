"""Mean wrenches of a force fingertip in known orientations, and their files."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import yaml
from pydantic import Field

from calibration.store.admission import Installation
from drivers.core.atomic_files import write_whole
from drivers.core.configuration import StrictModel, load, validate
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import Vector3
from drivers.shadow.protocol.palm_images import Side

Square3 = tuple[Vector3, Vector3, Vector3]
Six = tuple[float, float, float, float, float, float]


class WrenchPose(StrictModel):
    """A mean wrench in a known orientation.

    Attributes:
        world_R_distal: of the distal frame in the world, z up.
        wrench: N and N m, sensor frame.
        time_s: when, by any clock: the sensor's drift is alike in wrenches near in time. None where it is not known.
    """

    world_R_distal: Square3
    wrench: Six
    time_s: float | None = None


def wrench_pose(world_R_distal: Array, wrench: Array, time_s: float | None = None) -> WrenchPose:
    """From arrays, shapes (3, 3) and (6,)."""
    rows = [[float(value) for value in row] for row in world_R_distal]
    return WrenchPose.model_validate(
        {"world_R_distal": rows, "wrench": [float(value) for value in wrench], "time_s": time_s}
    )


class FingertipData(StrictModel):
    """A file of wrenches of one finger.

    Attributes:
        side: of the hand.
        free: untouched, in several orientations.
        presses: on a level plate from above, force upwards, in several orientations (rolled about).
    """

    format: Literal["tactile-fingertip-data/1"] = "tactile-fingertip-data/1"
    rig: str = Field(min_length=1)
    finger: Literal["FF", "MF", "RF", "LF", "TH"]
    serial: str = ""
    side: Side = "right"
    free: tuple[WrenchPose, ...]
    presses: tuple[WrenchPose, ...]


def load_fingertip_data(path: Path, here: Installation) -> FingertipData:
    """Read wrenches of this rig. Raises ConfigurationError."""
    data = validate(load(path), FingertipData, where=str(path))
    if data.rig != here.rig:
        hint = "Give the rig of the recording with --rig"
        raise ConfigurationError(f"was recorded on rig {data.rig}, not on {here.rig}", where=str(path), hint=hint)
    return data


def save_fingertip_data(path: Path, data: FingertipData) -> None:
    """Write wrenches as :func:`load_fingertip_data` reads them, whole or not at all. Raises WriteError."""
    write_whole(path, yaml.safe_dump(data.model_dump(mode="json"), sort_keys=False))
