"""Which hand it is, from all sources: its own configuration folder, its motor map, and the rig file.

Shadow's folder for a serial number holds ``general_info.yaml`` above the calibration (protocols: Joint calibration
files). A left hand that is mistaken for a right one has all its contacts mirrored, and a hand with fewer fingers would
be asked for joints that it does not have. So all statements are compared before anything moves.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import ConfigDict, field_validator

from drivers.core import configuration
from drivers.core.configuration import StrictModel
from drivers.core.contacts import FINGERS
from drivers.core.errors import ConfigurationError
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.palm_images import Side

INFO_FILE = "general_info.yaml"
_LEVELS = 5
"""Published folders keep the calibration up to four levels below that file."""

_ONE_HAND = "Name the files of the connected hand, and its side"
"""Which of two sides is wrong, the files cannot tell; a map of the other side would move wrong motors."""


class _MapPlace(StrictModel):
    model_config = ConfigDict(extra="ignore")

    relative_path: Path


class HandInfo(StrictModel):
    """What this program needs of a ``general_info.yaml``; the file says more.

    Attributes:
        side: of the hand.
        fingers: that it has, in lower case, the thumb as ``th``. Old published folders leave them out, others have
            ``False``: then the motor map tells.
        mapping_path: where its motor map is among Shadow's.
    """

    model_config = ConfigDict(extra="ignore")

    side: Side
    fingers: tuple[str, ...] | None = None
    mapping_path: _MapPlace | None = None

    @field_validator("fingers", mode="before")
    @classmethod
    def _none_are_stated(cls, told: object) -> object:
        return None if told in ("False", False) else told


@dataclass(frozen=True)
class HandStatement:
    """What a rig file says of its hand; None where it leaves that to the hand's files.

    Attributes:
        where: the rig file, for messages.
        side: of the hand.
        fingers: that it has.
    """

    where: str
    side: Side | None = None
    fingers: tuple[str, ...] | None = None


def load_infos(files: Iterable[Path]) -> dict[Path, HandInfo]:
    """The information files next to or above the files of a hand, by path; empty if there are none.

    Raises:
        ConfigurationError: such a file cannot be used.
    """
    places = dict.fromkeys(place for file in files if (place := _info_place(file.resolve())) is not None)
    return {place: configuration.validate(configuration.load(place), HandInfo, where=str(place)) for place in places}


def _info_place(file: Path) -> Path | None:
    return next((place for folder in [*file.parents][:_LEVELS] if (place := folder / INFO_FILE).is_file()), None)


def stated_serial(infos: Iterable[Path]) -> int | None:
    """The hand's serial number by the names of its folders, which are Shadow's; None if they contain none.

    Raises:
        ConfigurationError: the files are of two hands.
    """
    told = {int(place.parent.name): place for place in infos if place.parent.name.isdecimal()}
    if len(told) > 1:
        (one, place), (other, _) = list(told.items())[:2]
        what = f"belongs to hand {one}, but other files of the rig to hand {other}"
        raise ConfigurationError(what, where=str(place), hint="Name the files of one hand, the connected one")
    return next(iter(told), None)


def check_map(motors: Path, infos: Mapping[Path, HandInfo]) -> None:
    """Compare a motor map of Shadow's with what the hand's own folder names.

    Raises:
        ConfigurationError: they differ: the map is another hand's, which can damage this one.
    """
    for place, info in infos.items():
        named = "" if info.mapping_path is None else info.mapping_path.relative_path.name
        if named and motors.name[:3] in ("lh_", "rh_") and motors.name != named:
            what = f"says that the hand's motor map is {named}, but the rig names {motors.name}"
            hint = f"Set calibration.motors to {named}" if motors.name[:3] == named[:3] else _ONE_HAND
            raise ConfigurationError(what, where=str(place), hint=hint)


def stated_form(motors: Path, infos: Mapping[Path, HandInfo], stated: HandStatement) -> HandForm:
    """The form of the hand by all these files; a right hand's if none states the side.

    Args:
        motors: its motor map, which names the joints.
        infos: see :func:`load_infos`.
        stated: what the rig file says.

    Raises:
        ConfigurationError: the map cannot be used, or two places contradict each other.
    """
    motor_map = MotorMap.load(motors)
    told: dict[str, Side | None] = {str(place): info.side for place, info in infos.items()}
    told |= {str(motors): motor_map.stated_side, stated.where: stated.side}
    form = HandForm(_agreed_side({place: side for place, side in told.items() if side is not None}), motor_map.driven)
    for place, info in infos.items():
        if info.fingers is not None:
            _check_fingers(form, tuple(map(str.upper, info.fingers)), str(place), motors)
    if stated.fingers is not None:
        _check_fingers(form, stated.fingers, stated.where, motors)
    return form


def _agreed_side(told: Mapping[str, Side]) -> Side:
    if len(set(told.values())) > 1:
        place, side = next(iter(told.items()))
        other, its = next((where, said) for where, said in told.items() if said != side)
        what = f"is of a {side} hand, but {other} of a {its} one: contacts would be mirrored"
        raise ConfigurationError(what, where=place, hint=_ONE_HAND)
    return next(iter(told.values()), "right")


def _check_fingers(form: HandForm, fingers: tuple[str, ...], where: str, motors: Path) -> None:
    if set(fingers) == set(form.fingers):
        return
    if unknown := [finger for finger in fingers if finger not in FINGERS]:
        hint = f"Fingers are {', '.join(FINGERS)}"
        raise ConfigurationError(f"names a finger that there is not: {', '.join(unknown)}", where=where, hint=hint)
    named, driven = (", ".join(finger for finger in FINGERS if finger in some) for some in (fingers, form.fingers))
    what = f"says that the hand's fingers are {named}, but {motors} has motors for {driven}"
    raise ConfigurationError(what, where=where, hint="Name the motor map of this very hand, and its fingers")
