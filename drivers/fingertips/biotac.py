"""The BioTac as a kind of fingertip: its calibration, its sensor, and who it says it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from gtsam import Pose3, Rot3

from drivers.biotac.biotac import BioTac, BioTacCalibration, EllipsoidSkinSettings, load_biotacs
from drivers.biotac.channels import core_temperature_degC
from drivers.biotac.electrodes import ElectrodeCount, electrodes_of
from drivers.biotac.learned_normal import LearnedNormals, load_normals
from drivers.biotac.settings import BioTacSettings
from drivers.biotac.slot_codec import Channel
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import FingertipSensor, RigidTransform, TipBody
from drivers.fingertips.kind import PalmKind, TipReport
from drivers.shadow.device.tactile_requests import TactileProtocol
from drivers.shadow.protocol.tactile_names import TactileNames

_MASS_kg = 0.008


@dataclass(frozen=True)
class KnownBioTac:
    """What the files of a rig say of one BioTac.

    Attributes:
        calibration: of the sensor.
        normals: what was learned of its normals; None where nothing was.
    """

    calibration: BioTacCalibration
    normals: LearnedNormals | None = None


class BioTacKind(PalmKind[KnownBioTac]):
    """Electrodes and pressure in a fluid under a skin, read through the palm."""

    settings = BioTacSettings
    packaged = "biotacs.yaml"
    tactile = "biotac"

    def usual(self) -> KnownBioTac:
        somewhere = RigidTransform(translation_m=(0.0, 0.0, 0.019))
        return KnownBioTac(BioTacCalibration(electrodes=19, distal_T_sensor=somewhere))

    def load(self, files: Mapping[str, Path]) -> Mapping[str, KnownBioTac]:
        normals = load_normals(files["normals"]) if "normals" in files else {}
        calibrations = load_biotacs(files["fingertips"])
        return {finger: KnownBioTac(known, normals.get(finger)) for finger, known in calibrations.items()}

    def body(self, finger: str, calibration: KnownBioTac) -> TipBody:
        surface = self.surface(calibration)
        if surface is None:
            what, hint = f"the BioTac of {finger} has no ellipsoid skin", "Describe the skin as an ellipsoid"
            raise ConfigurationError(
                what, where="simulated hand", hint=f"{hint}: the simulation supports no other shape"
            )
        semi_axes_m, distal_T_skin = surface
        x, y, z = distal_T_skin.translation().tolist()
        return TipBody(calibration.calibration.distal_T_sensor.pose(), distal_T_skin, semi_axes_m, _MASS_kg, (x, y, z))

    def surface(self, calibration: KnownBioTac) -> tuple[tuple[float, float, float], Pose3] | None:
        skin = calibration.calibration.skin
        if not isinstance(skin, EllipsoidSkinSettings):
            return None
        return skin.semi_axes_m, calibration.calibration.distal_T_sensor.pose() * Pose3(Rot3(), np.array(skin.centre_m))

    def sensor(self, finger: str, calibration: KnownBioTac, settings: BioTacSettings) -> BioTac:
        return BioTac(finger, calibration.calibration, settings, calibration.normals)

    def report(self, tip: FingertipSensor, names: TactileNames, serial: str) -> TipReport:
        assert isinstance(tip, BioTac)
        who, figures = names.words(tip.finger), biotac_figures(tip)
        problems = contradictions(names, tip.finger, tip.calibration.electrodes, serial)
        return TipReport(tuple(problems), (who, biotac_words(figures)), {"identity": who, **figures})


def contradictions(
    names: TactileNames, finger: str, electrodes: ElectrodeCount | None = None, serial: str = ""
) -> list[str]:
    """How what a finger says of itself contradicts a rig that has a BioTac there, in words.

    Args:
        names: what the fingertips say.
        finger: which.
        electrodes: of its calibration, where there is one.
        serial: of the sensor that must be there; any when empty.
    """
    kind, told = names.kind(finger), names.serial(finger)
    if kind not in (None, TactileProtocol.BIOTAC):
        return ["is not a BioTac: correct the fingertips in the rig file, or plug the sensor in"]
    problems = []
    if told and electrodes not in (None, electrodes_of(told)):
        problems.append(
            f"has {electrodes_of(told)} electrodes by its serial number, but {electrodes} by its calibration"
        )
    if told and serial not in ("", told):
        problems.append(f"its serial number is {told}, not {serial}: were two fingertips swapped?")
    return problems


def biotac_figures(tip: BioTac) -> dict[str, float | str]:
    """What a BioTac measures at rest; empty while it has not been heard."""
    rest, heat = tip.channels.recent(Channel.PDC), tip.channels.recent(Channel.TDC)
    if not (rest.size and heat.size):
        return {}
    core = core_temperature_degC(heat[-1:])[0]
    return {
        "core_C": float(core),
        "pdc_counts": float(rest.mean()),
        "pdc_spread_counts": float(np.ptp(rest)),
        "electrodes": float(tip.calibration.electrodes),
    }


def biotac_words(figures: dict[str, float | str]) -> str:
    """The same for people."""
    if not figures:
        return ""
    return f"core {figures['core_C']:.0f} C, pressure at rest {figures['pdc_counts']:.0f} counts"
