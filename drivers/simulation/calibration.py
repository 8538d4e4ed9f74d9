"""What the simulated rig is really like: the calibrations that its devices are built from.

The rig that drives it normally uses the same files. Giving the rig others shows what a wrong calibration does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Literal

import numpy as np
from gtsam import Pose3, Rot3

from drivers.biotac.biotac import BioTacCalibration, EllipsoidSkinSettings, load_biotacs
from drivers.camera.calibration import CameraCalibration, load_camera
from drivers.camera.markers import MarkerSettings
from drivers.fingertip import FingertipCalibration, load_fingertips
from drivers.shadow.joint_calibration import JointCalibration
from drivers.shadow.motors import MotorMap
from drivers.simulation.model import TipBody
from tactile_lab.errors import ConfigurationError
from tactile_lab.geometry.contacts import FINGERS
from tactile_lab.strict_yaml import load_model

_BIOTAC_MASS_kg = 0.008


@dataclass(frozen=True)
class SimulatedCalibration:
    """The calibrations of one rig.

    Attributes:
        joints: joint sensors.
        motors: which motor pulls which joint.
        fingertips: force-sensing tips, by finger.
        biotacs: BioTac tips, by finger.
        camera: lens.
        markers: the markers on the table and under the object; the latter's side and place follow the object.
    """

    joints: JointCalibration
    motors: MotorMap
    fingertips: Mapping[str, FingertipCalibration]
    biotacs: Mapping[str, BioTacCalibration]
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
            fingertips=load_fingertips(folder / "fingertips.yaml"),
            biotacs=load_biotacs(folder / "biotacs.yaml"),
            camera=load_camera(folder / "camera.yaml"),
            markers=load_model(folder / "markers.yaml", MarkerSettings),
        )

    @classmethod
    def packaged(cls) -> SimulatedCalibration:
        """The simulated hand that comes with the program."""
        packaged = resources.files("tactile_lab") / "rigs" / "calibrations" / "simulated-hand"
        with resources.as_file(packaged) as folder:
            return cls.load(folder)

    def tip_body(self, finger: str, kind: Literal["nano17", "biotac"]) -> TipBody:
        """The body of one fingertip.

        Raises:
            ConfigurationError: the finger has no such tip, or its skin is not an ellipsoid.
        """
        known: Mapping[str, object] = self.fingertips if kind == "nano17" else self.biotacs
        if finger not in known:
            raise ConfigurationError(
                f"no {kind} calibration for {finger}",
                where="simulated hand",
                hint=f"The simulated hand needs one for each of {', '.join(FINGERS)}",
            )
        return _force_tip(self.fingertips[finger]) if kind == "nano17" else _biotac_tip(finger, self.biotacs[finger])


def _force_tip(calibration: FingertipCalibration) -> TipBody:
    return TipBody(
        distal_T_sensor=calibration.distal_T_sensor.pose(),
        distal_T_skin=Pose3(Rot3(), np.array(calibration.centre_distal_m)),
        semi_axes_m=calibration.semi_axes_m,
        mass_kg=calibration.mass_kg,
        com_distal_m=calibration.com_distal_m,
    )


def _biotac_tip(finger: str, calibration: BioTacCalibration) -> TipBody:
    if not isinstance(calibration.skin, EllipsoidSkinSettings):
        raise ConfigurationError(
            f"the BioTac of {finger} has no ellipsoid skin",
            where="simulated hand",
            hint="State the skin as an ellipsoid: the physics knows no other",
        )
    sensor = calibration.distal_T_sensor.pose()
    skin = sensor * Pose3(Rot3(), np.array(calibration.skin.centre_m))
    x, y, z = skin.translation()
    return TipBody(sensor, skin, calibration.skin.semi_axes_m, _BIOTAC_MASS_kg, (float(x), float(y), float(z)))
