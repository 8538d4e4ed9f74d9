"""A family of hands as the published configurations have them.

72 right and 25 left hands with five fingers, and 24 with fewer; ten calibrations have a defect. Each hand is drawn by
its own seed.

The published files themselves are not part of this repository; the proportions, the motor maps and the kinds of defects
are theirs, everything else is made up here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drivers.shadow.model.motors import DRIVEN_JOINTS
from drivers.shadow.protocol.palm_images import PalmName
from tests.support.hand_folders import FOLDERS, HandFolder, write_folder

Tables = dict[str, Any]
"""The content of a ``calibration.yaml``."""

_FULL = [kind for kind in FOLDERS if len(kind.numbers) == len(DRIVEN_JOINTS)]
_RIGHT = [kind for kind in _FULL if kind.side == "right"]
_LEFT = [kind for kind in _FULL if kind.side == "left"]
_FEWER = [kind for kind in FOLDERS if kind not in _FULL]
_KINDS = [(_RIGHT, 72), (_LEFT, 25), (_FEWER, 24)]
_PALMS: tuple[PalmName, ...] = ("0220", "0220", "0220", "0240", "0250")
_OFF_counts, _STRETCHED = 60.0, 0.1


def _garbage(tables: Tables, rng: np.random.Generator) -> None:
    for _, points in tables["sr_calibrations"]:
        for point in points:
            point[0] = float(rng.integers(0, 5))


def _typing_error(tables: Tables, rng: np.random.Generator) -> None:
    """A digit too many in one count."""
    _, points = tables["sr_calibrations"][int(rng.integers(len(tables["sr_calibrations"])))]
    points[1][0] = 10.0 * points[1][0] + 9.0


def _fold(tables: Tables, rng: np.random.Generator) -> None:
    """Two points of the thumb's table are exchanged: the same counts would mean several angles."""
    points = tables["sr_calibrations_coupled"][0][1]
    points[0][0], points[-1][0] = points[-1][0], points[0][0]


DEFECTS: dict[str, Callable[[Tables, np.random.Generator], None]] = {
    "garbage": _garbage,
    "typing error": _typing_error,
    "fold at THJ1 and THJ2": _fold,
}
_DEFECTIVE = {5: "garbage", 17: "garbage", 23: "garbage", 31: "garbage", 40: "garbage"}
_DEFECTIVE |= {48: "typing error", 55: "typing error", 77: "typing error", 90: "typing error"}
_DEFECTIVE |= {66: "fold at THJ1 and THJ2"}


@dataclass(frozen=True)
class FamilyHand:
    """One hand.

    Attributes:
        serial: its number, and the seed of what is its own.
        kind: its folder's kind, with its palm and the motors that turn backwards.
        defect: of its calibration; "" for none.
    """

    serial: int
    kind: HandFolder
    defect: str = ""

    @property
    def group(self) -> str:
        """In words: the side, and how many fingers."""
        fingers = {5: "five fingers", 4: "Lite", 3: "extra-lite"}.get(len(self.kind.fingers), "two fingers")
        return f"{self.kind.side}, {fingers}"


def family() -> list[FamilyHand]:
    """All 121 of them."""
    places = [kinds[number % len(kinds)] for kinds, count in _KINDS for number in range(count)]
    return [_hand(serial, kind) for serial, kind in enumerate(places, 1)]


def _hand(serial: int, kind: HandFolder) -> FamilyHand:
    rng = np.random.default_rng(serial)
    backwards = tuple(name for name in kind.numbers if rng.random() < 0.2)
    own = replace(kind, palm=_PALMS[int(rng.integers(len(_PALMS)))], backwards=backwards)
    return FamilyHand(serial, own, _DEFECTIVE.get(serial, ""))


def write_hand(root: Path, hand: FamilyHand) -> HandFolder:
    """Write a hand's folder: its sensors' counts are shifted, stretched and partly reversed, then spoilt if it has a
    defect.
    """
    folder = write_folder(root / str(hand.serial), hand.kind)
    rng = np.random.default_rng([hand.serial, 1])
    tables = yaml.safe_load(folder.joints.read_text())
    for _, points in tables["sr_calibrations"]:
        _redraw(points, rng)
    if hand.defect:
        DEFECTS[hand.defect](tables, rng)
    folder.joints.write_text(yaml.safe_dump(tables))
    return folder


def _redraw(points: list[list[float]], rng: np.random.Generator) -> None:
    """Counts of a sensor with another magnet: about the middle of the scale, reversed every other time."""
    off, scale = _OFF_counts * rng.standard_normal(), 1.0 - _STRETCHED * rng.random()
    sign = -1.0 if rng.random() < 0.5 else 1.0
    for point in points:
        point[0] = float(round(2048.0 + sign * scale * (point[0] - 2048.0) + off))
