"""The Nano17 as a kind of fingertip: its calibration and its device."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from gtsam import Pose3, Rot3

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.ati.wires.wire import ForceWire
from drivers.core.clock import Clock
from drivers.core.fingertip import FingertipCalibration, FingertipSensor, TipBody, load_fingertips
from drivers.core.transports import Transport
from drivers.fingertips.kind import LinkedKind, TipReport
from drivers.force.force_fingertip import ForceTip
from drivers.force.plausibility import noise_objection
from drivers.shadow.protocol.tactile_names import TactileNames


class Nano17Kind(LinkedKind[FingertipCalibration]):
    """A six-axis force sensor under a shell."""

    settings = Nano17Settings
    packaged = "fingertips.yaml"

    def load(self, files: Mapping[str, Path]) -> Mapping[str, FingertipCalibration]:
        return load_fingertips(files["fingertips"])

    def body(self, finger: str, calibration: FingertipCalibration) -> TipBody:
        return TipBody(
            distal_T_sensor=calibration.distal_T_sensor.pose(),
            distal_T_skin=Pose3(Rot3(), np.array(calibration.centre_distal_m)),
            semi_axes_m=calibration.semi_axes_m,
            mass_kg=calibration.mass_kg,
            com_distal_m=calibration.com_distal_m,
        )

    def force_range_N(self, settings: Nano17Settings) -> float:
        return min(settings.force_range_N)

    def device(
        self,
        finger: str,
        calibration: FingertipCalibration,
        settings: Nano17Settings,
        transport: Transport,
        clock: Clock,
        wire: ForceWire | None,
    ) -> Nano17:
        return Nano17(finger, transport, clock, calibration, settings, wire)

    def report(self, tip: FingertipSensor, names: TactileNames, serial: str) -> TipReport:
        assert isinstance(tip, ForceTip)
        bias = np.zeros(6) if tip.tare_record is None else tip.tare_record.bias
        noise_mN, expected_mN = float(1e3 * tip.noise[:3].max()), 1e3 * tip.calibration.force_sigma_N
        figures: dict[str, float | str] = {
            "lost": float(tip.sequences.lost),
            "noise_mN": noise_mN,
            "noise_mNm": float(1e3 * tip.noise[3:].max()),
            "expected_mN": float(expected_mN),
            "expected_mNm": float(1e3 * tip.calibration.moment_sigma_Nm),
            "bias_N": float(np.abs(bias[:3]).max()),
            "bias_mNm": float(1e3 * np.abs(bias[3:]).max()),
        }
        words = (
            f"{figures['lost']:.0f} lost, noise {noise_mN:.1f} mN (expected {expected_mN:.1f}), "
            f"bias {figures['bias_N']:.2f} N"
        )
        return TipReport(tuple(filter(None, [noise_objection(tip.noise, tip.calibration)])), (words,), figures)
