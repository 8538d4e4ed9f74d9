"""The true calibration of the simulated rig, from which its devices are built.

The rig that drives it normally uses the same files. With other files it shows the effect of a wrong calibration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

from drivers.camera.calibration import CameraCalibration, load_camera
from drivers.camera.markers import MarkerSettings
from drivers.core.configuration import load_model
from drivers.core.contacts import FINGERS
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import TipBody
from drivers.fingertips.kind import FingertipKind
from drivers.fingertips.kinds import FINGERTIPS
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.motors import MotorMap


@dataclass(frozen=True)
class SimulatedCalibration:
    """The calibrations of one rig.

    Attributes:
        joints: joint sensors.
        motors: which motor pulls which joint.
        tips: by kind of fingertip: the result of that kind's :meth:`FingertipKind.load`, by finger.
        camera: lens.
        markers: the markers on the table and under the object; side and position of the latter depend on the object.
    """

    joints: JointCalibration
    motors: MotorMap
    tips: Mapping[str, Mapping[str, Any]]
    camera: CameraCalibration
    markers: MarkerSettings

    @classmethod
    def load(cls, folder: Path) -> SimulatedCalibration:
        """Read the calibration files of a hand from their folder.

        Raises:
            ConfigurationError: a file is missing or cannot be used.
        """
        return cls(
            joints=JointCalibration.load(folder / "joints.yaml"),
            motors=MotorMap.load(folder / "motors.yaml"),
            tips={name: kind.load({"fingertips": folder / kind.packaged}) for name, kind in _packaged_kinds().items()},
            camera=load_camera(folder / "camera.yaml"),
            markers=load_model(folder / "markers.yaml", MarkerSettings),
        )

    @classmethod
    def from_package(cls) -> SimulatedCalibration:
        """The simulated hand that comes with the program."""
        packaged = resources.files("tactile_lab") / "rigs" / "calibrations" / "simulated-hand"
        with resources.as_file(packaged) as folder:
            return cls.load(folder)

    @classmethod
    def of_hand(cls, kind: str, tips: Path, motors: Path) -> SimulatedCalibration:
        """The same with a motor map of its own, and fingertips of a file where the program has none of their kind.

        Raises:
            ConfigurationError: no such kind, or a file that cannot be used.
        """
        packaged = cls.from_package()
        packaged = replace(packaged, motors=MotorMap.load(motors))
        if FINGERTIPS[kind].packaged:
            return packaged
        return replace(packaged, tips={**packaged.tips, kind: FINGERTIPS[kind].load({"fingertips": tips})})

    def tip_body(self, finger: str, kind: str) -> TipBody:
        """The body of one fingertip.

        Raises:
            ConfigurationError: there is no such kind, the finger has no such tip, or its skin is not an ellipsoid.
        """
        known = self.tips.get(kind, {})
        if finger not in known:
            raise ConfigurationError(
                f"no {kind} calibration for {finger}",
                where="simulated hand",
                hint=f"The simulated hand needs one for each of {', '.join(FINGERS)}",
            )
        return FINGERTIPS[kind].body(finger, known[finger])


def _packaged_kinds() -> dict[str, FingertipKind[Any]]:
    return {name: kind for name, kind in FINGERTIPS.items() if kind.packaged}
