"""The contents of a BioTac's calibration file, and the settings for checking its readings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from drivers.biotac.electrodes import BallAndCylinder, ElectrodeCount, EllipsoidSkin, Skin
from drivers.core.calibration_file import load_parameters
from drivers.core.configuration import StrictModel
from drivers.core.fingertip import RigidTransform, Vector3


class BallAndCylinderSkin(StrictModel):
    """Skin of the 19-electrode model."""

    kind: Literal["ball-and-cylinder"]
    radius_m: float = Field(default=0.007, gt=0.0)

    def surface(self) -> Skin:
        """The skin with these parameters."""
        return BallAndCylinder(self.radius_m)


class EllipsoidSkinSettings(StrictModel):
    """Skin as an ellipsoid in the BioTac frame."""

    kind: Literal["ellipsoid"]
    semi_axes_m: Vector3
    centre_m: Vector3 = (0.0, 0.0, 0.0)

    def surface(self) -> Skin:
        """The skin with these parameters."""
        return EllipsoidSkin(self.semi_axes_m, self.centre_m)


class BioTacCalibration(StrictModel):
    """One BioTac: its model, its mounting and the meaning of its signals.

    Attributes:
        electrodes: 19, or 24 for the BioTac SP.
        distal_T_sensor: BioTac frame (x to the tip, z to the back of the finger) in the distal frame.
        skin: the outer surface; by default that of the model.
        N_per_pdc_count: force per count of fluid pressure, valid until the skin rests on the core.
        N_per_electrode_count: force per count of squeezed electrodes, for harder contacts.
        touch_pdc_counts: pressure above the tare that means contact (10 counts; protocols: BioTac contact).
        electrode_noise_counts: smaller changes of an electrode are noise.
        weight_power: exponent of equation 2.24's weights.
        point_sigma_m: of the contact point along the skin, per axis; perpendicular to the skin it is a third of that.
        normal_sigma_rad: of the normal, per axis.
    """

    electrodes: ElectrodeCount
    distal_T_sensor: RigidTransform
    skin: Annotated[BallAndCylinderSkin | EllipsoidSkinSettings, Field(discriminator="kind")] | None = None
    N_per_pdc_count: float = Field(default=0.005, gt=0.0)
    N_per_electrode_count: float = Field(default=0.001, gt=0.0)
    touch_pdc_counts: float = Field(default=10.0, gt=0.0)
    electrode_noise_counts: float = Field(default=15.0, ge=0.0)
    weight_power: float = Field(default=1.0, gt=0.0)
    point_sigma_m: float = Field(default=0.00085, gt=0.0)
    normal_sigma_rad: float = Field(default=0.12, gt=0.0)


class BioTacSettings(StrictModel):
    """How readings are checked.

    Attributes:
        tare_samples: number of newest readings of each channel that a tare averages.
        tare_pdc_spread, tare_electrode_spread: their largest allowed range, counts (largest minus smallest).
        touch_samples: consecutive pressure readings above the threshold before a capture counts as a contact.
        stale_ms: age after which a channel counts as silent.
        follow_s: time constant with which the tare follows slow changes while nothing is touched; 0 for never.
    """

    tare_samples: int = Field(default=5, ge=2)
    tare_pdc_spread: float = Field(default=8.0, gt=0.0)
    tare_electrode_spread: float = Field(default=60.0, gt=0.0)
    touch_samples: int = Field(default=3, ge=1)
    stale_ms: float = Field(default=200.0, gt=0.0)
    follow_s: float = Field(default=30.0, ge=0.0)


class _CalibrationFile(StrictModel):
    biotacs: Annotated[dict[str, BioTacCalibration], Field(min_length=1)]


def load_biotacs(path: Path) -> dict[str, BioTacCalibration]:
    """Read a BioTac calibration file: finger name to calibration. Raises ConfigurationError."""
    return load_parameters(path, _CalibrationFile).biotacs
