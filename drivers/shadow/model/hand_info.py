"""What a hand's own configuration folder says of it: its side, its fingers, its motor map.

Shadow's folder for a serial number holds ``general_info.yaml`` beside the calibration (protocols: Joint calibration
files). The kinematics here are those of a right hand with five fingers: a left hand's contacts would be mirrored, and a
hand with fewer fingers would be asked for joints that it does not have. So what the files say is compared before
anything moves.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pydantic import ConfigDict

from drivers.core import configuration
from drivers.core.configuration import StrictModel
from drivers.core.contacts import FINGERS
from drivers.core.errors import ConfigurationError
from drivers.shadow.protocol.palm_images import Side

INFO_FILE = "general_info.yaml"
_SIDES: dict[str, Side] = {"lh_": "left", "rh_": "right"}
"""Beginnings of the names of Shadow's motor maps."""


class _MapPlace(StrictModel):
    model_config = ConfigDict(extra="ignore")

    relative_path: Path


class HandInfo(StrictModel):
    """What this program needs of a ``general_info.yaml``; the file says more.

    Attributes:
        side: of the hand.
        fingers: that it has, in lower case, the thumb as ``th``.
        mapping_path: where its motor map is among Shadow's.
    """

    model_config = ConfigDict(extra="ignore")

    side: Side
    fingers: tuple[str, ...] = tuple(map(str.lower, FINGERS))
    mapping_path: _MapPlace | None = None


def load_infos(files: Iterable[Path]) -> dict[Path, HandInfo]:
    """What stands beside the files of a hand, by its path; nothing where there is no such file.

    Raises:
        ConfigurationError: such a file cannot be used.
    """
    places = dict.fromkeys(file.resolve().parent / INFO_FILE for file in files)
    return {
        place: configuration.validate(configuration.load(place), HandInfo, where=str(place))
        for place in places
        if place.is_file()
    }


def check_map(motors: Path, infos: dict[Path, HandInfo]) -> None:
    """Compare a motor map of Shadow's with what the hand's own folder names.

    Raises:
        ConfigurationError: they differ: the map is another hand's, which can damage this one.
    """
    for place, info in infos.items():
        named = "" if info.mapping_path is None else info.mapping_path.relative_path.name
        if named and motors.name[:3] in _SIDES and motors.name != named:
            what = f"says that the hand's motor map is {named}, but the rig names {motors.name}"
            raise ConfigurationError(what, where=str(place), hint=f"Set calibration.motors to {named}")


def check_modelled(motors: Path, infos: dict[Path, HandInfo]) -> None:
    """Refuse a hand of which there are no kinematics here.

    Raises:
        ConfigurationError: it is a left hand, or misses fingers.
    """
    sides = {place: info.side for place, info in infos.items()} | {motors: _SIDES.get(motors.name[:3], "right")}
    hint = "Sessions need a right hand with five fingers. A rig of kind hand can check a left one, joint by joint"
    for place, side in sides.items():
        if side != "right":
            raise ConfigurationError("is of a left hand, whose contacts would be mirrored", where=str(place), hint=hint)
    for place, info in infos.items():
        if missing := [finger for finger in FINGERS if finger.lower() not in info.fingers]:
            what = f"is of a hand without {', '.join(missing)}"
            raise ConfigurationError(what, where=str(place), hint=hint)
