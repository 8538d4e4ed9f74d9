"""Configuration folders of every kind of hand, in the form in which Shadow publishes them, made up here.

Motor maps are the published ones (their numbers are facts of the hands); calibrations and gains are the simulated
hand's, without what the kind does not have.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import yaml

from drivers.core.contacts import FINGERS
from drivers.shadow.model.motors import DRIVEN_JOINTS, angles_of_driven
from drivers.shadow.protocol.palm_images import PalmName, Side
from tactile_lab import rigs

_SIMULATED = Path(rigs.__file__).parent / "calibrations" / "simulated-hand"
_ROW = [*(f"{finger}J{n}" for finger in FINGERS[:3] for n in range(5)), *(f"LFJ{n}" for n in range(6))]
_ROW += [*(f"THJ{n}" for n in range(1, 6)), "WRJ1", "WRJ2"]

_MAPS = {
    "rh_E_v1": (6, 5, 7, 0, 2, 1, 11, 12, 10, 16, 15, 17, 13, 4, 3, 14, 9, 19, 18, 8),
    "rh_E_v2": (6, 5, 7, 0, 2, 1, 11, 12, 10, 16, 15, 13, 17, 4, 3, 14, 9, 19, 18, 8),
    "rh_E_v3": (0, 1, 2, 3, 11, 13, 15, 16, 17, 12, 10, 14, 4, 6, 5, 7, 9, 19, 18, 8),
    "rh_E_v4": (2, 4, 3, 0, 10, 1, 11, 14, 17, 12, 13, 16, 15, 7, 6, 5, 9, 19, 18, 8),
    "rh_E_v5": (2, 4, 3, 10, 1, 0, 11, 13, 16, 12, 14, 15, 17, 5, 7, 6, 9, 19, 18, 8),
    "lh_E_v1": (16, 15, 17, 10, 12, 11, 1, 2, 0, 6, 5, 7, 3, 14, 13, 4, 19, 9, 18, 8),
    "lh_E_v3": (10, 11, 12, 13, 1, 3, 5, 6, 7, 2, 0, 4, 14, 16, 15, 17, 19, 9, 18, 8),
    "lh_E_v4": (12, 14, 13, 10, 0, 11, 1, 4, 7, 2, 3, 6, 5, 17, 16, 15, 19, 9, 18, 8),
    "lh_E_v5": (12, 14, 13, 0, 11, 10, 1, 3, 6, 2, 4, 5, 7, 15, 17, 16, 9, 19, 18, 8),
}
"""Motors in the order of ``DRIVEN_JOINTS``."""

_LITE = {"FFJ0": 5, "FFJ3": 6, "FFJ4": 15, "RFJ0": 1, "RFJ3": 0, "RFJ4": 10, "THJ1": 14, "THJ2": 13}
_LITE_V1 = {**_LITE, "MFJ0": 2, "MFJ3": 3, "MFJ4": 4, "THJ4": 12, "THJ5": 11}
_OLD_LITE = {"FFJ0": 16, "FFJ3": 5, "FFJ4": 7, "RFJ0": 1, "RFJ3": 2, "RFJ4": 10, "THJ1": 14, "THJ2": 13}
_NO_LITTLE = {joint: motor for joint, motor in zip(DRIVEN_JOINTS, _MAPS["rh_E_v3"], strict=True) if joint[:2] != "LF"}


@dataclass(frozen=True)
class HandFolder:
    """One kind of hand, and its folder once it is written.

    Attributes:
        name: of its motor map.
        numbers: motor of each driven joint that it has.
        palm: its palm.
        backwards: joints whose gains are negative.
        mirrored: a left hand with a map that serves both sides, as those of Lite hands do.
        root: the folder.
    """

    name: str
    numbers: dict[str, int]
    palm: PalmName = "0220"
    backwards: tuple[str, ...] = ()
    mirrored: bool = False
    root: Path = Path()

    @property
    def side(self) -> Side:
        """By the name of the map, unless that serves both."""
        return "left" if self.mirrored or self.name.startswith("lh") else "right"

    @property
    def fingers(self) -> tuple[str, ...]:
        """Those with motors."""
        return tuple(finger for finger in FINGERS if any(joint.startswith(finger) for joint in self.numbers))

    @property
    def info(self) -> Path:
        """The file that names side, fingers and map."""
        return self.root / "general_info.yaml"

    @property
    def joints(self) -> Path:
        """The calibration."""
        return self.root / "calibrations" / "calibration.yaml"

    @property
    def gains(self) -> Path:
        """The position control."""
        return self.root / "controls" / "host" / "pwm" / "sr_edc_joint_position_controllers_PWM.yaml"

    @property
    def motors(self) -> Path:
        """The motor map; published elsewhere."""
        return self.root / "mappings" / f"{self.name}.yaml"


FOLDERS: tuple[HandFolder, ...] = (
    *(HandFolder(name, dict(zip(DRIVEN_JOINTS, numbers, strict=True))) for name, numbers in _MAPS.items()),
    HandFolder("rh_E_v3_no_lf", _NO_LITTLE),
    HandFolder("rh_lite", {**_OLD_LITE, "MFJ0": 0, "MFJ3": 3, "MFJ4": 4, "THJ4": 18, "THJ5": 19}),
    HandFolder("rh_lite_v1", _LITE_V1),
    HandFolder("rh_lite_v1", _LITE_V1, mirrored=True),
    HandFolder("rh_extra_lite_v1", {**_LITE, "THJ4": 3, "THJ5": 2}),
    HandFolder("rh_E_v3_no_mf_rf_lf", {joint: motor for joint, motor in _NO_LITTLE.items() if joint[:2] not in "MFRF"}),
)
"""One of every kind: each side's maps, Lite and extra-lite hands, hands that lost fingers."""

FULL_RIGHT = FOLDERS[2]


def write_folder(root: Path, kind: HandFolder) -> HandFolder:
    """Write a hand's folder; returns it with its place."""
    folder = replace(kind, root=root)
    for file in (folder.info, folder.joints, folder.gains, folder.motors):
        file.parent.mkdir(parents=True, exist_ok=True)
    place = {"package_name": "sr_edc_launch", "relative_path": f"mappings/default_mappings/{kind.name}.yaml"}
    info = {"side": kind.side, "fingers": [finger.lower() for finger in kind.fingers], "mapping_path": place}
    folder.info.write_text(yaml.safe_dump(info, default_flow_style=False))
    folder.joints.write_text(yaml.safe_dump(_calibration(kind)))
    folder.gains.write_text(yaml.safe_dump(_gains(kind)))
    folder.motors.write_text(yaml.safe_dump({"joint_to_motor_mapping": [kind.numbers.get(each, -1) for each in _ROW]}))
    return folder


def _calibration(kind: HandFolder) -> dict[str, object]:
    """The simulated hand's tables of the joints that turn."""
    joints = {joint for driven in kind.numbers for joint in angles_of_driven(driven)}
    content = yaml.safe_load((_SIMULATED / "joints.yaml").read_text())
    tables = content.get("parameters", content)
    return {
        "sr_calibrations": [row for row in tables["sr_calibrations"] if row[0] in joints],
        "sr_calibrations_coupled": [row for row in tables["sr_calibrations_coupled"] if set(row[0]) <= joints],
    }


_REPLACED_TIPS = [[f"{finger}J1", [[0.0, 20.0], [1.0, 20.0]]] for finger in FINGERS if finger != "TH"]
_FIXED_THUMB = [[[1.0, 2050.0], 20.0, -40.0], [[0.0, 2200.0], 20.0, 0.0], [[0.0, 2400.0], 20.0, 40.0]]


def fix_joints(folder: HandFolder) -> tuple[str, ...]:
    """Change a full hand's folder as that of published hand 554.

    Fingertips replace the last joints: J1 has 20 degrees at every count, and no sensor. The gains of THJ1 and of LFJ0,
    which has an unsound tendon, have a largest demand of zero. Returns these.
    """
    tables = yaml.safe_load(folder.joints.read_text())
    turning = [row for row in tables["sr_calibrations"] if row[0][2:] != "J1" or row[0] == "WRJ1"]
    content = {
        "sr_calibrations": turning + _REPLACED_TIPS,
        "sr_calibrations_coupled": [[["THJ1", "THJ2"], _FIXED_THUMB]],
    }
    folder.joints.write_text(yaml.safe_dump(content))
    gains = yaml.safe_load(folder.gains.read_text())
    for joint in (not_driven := ("LFJ0", "THJ1")):
        gains[f"sh_rh_{joint.lower()}_position_controller"]["pid"] |= {"p": 0.0, "max_force": 0.0}
    folder.gains.write_text(yaml.safe_dump(gains))
    return not_driven


_PID = {"i": 0.0, "d": 0.0, "i_clamp": 0.0, "max_force": 500.0, "position_deadband": 0.003}


def _gains(kind: HandFolder) -> dict[str, object]:
    prefix = "lh" if kind.side == "left" else "rh"
    named = {joint: -1.0 if joint in kind.backwards else 1.0 for joint in kind.numbers}
    return {
        f"sh_{prefix}_{joint.lower()}_position_controller": {
            "joint": f"{prefix}_{joint}",
            "pid": {**_PID, "p": 5000.0 * sign},
        }
        for joint, sign in named.items()
    }
