"""Calibration of a BioTac's contact normals from presses on a plate of known orientation."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from calibration.store.store import CalibrationRecord, new_record, read_record
from drivers.biotac.learned_normal import LearnedNormals, NormalsFile, Presses, StoredNormals, as_stored
from drivers.biotac.normal_training import MethodErrors, compare_methods, rotation_to_sensor, train
from drivers.biotac.press_recording import PressRecording
from drivers.core.configuration import validate
from drivers.core.errors import ConfigurationError

LARGEST_SHARE = 0.75
"""Largest share of equation 2.24's median error for learned normals to be worthwhile."""

FEWEST_WITHIN_68, MOST_WITHIN_68 = 0.5, 0.86
"""Range of the share of errors inside the stated 68 per cent for which the statement passes."""


@dataclass(frozen=True)
class NormalsCalibration:
    """The result of a calibration.

    Attributes:
        learned: from the whole recording.
        methods: errors of every method, trained on the recording's first half and tested on its second.
    """

    learned: LearnedNormals
    methods: tuple[MethodErrors, ...]

    @property
    def share(self) -> float:
        """Median error of the learned normals over that of equation 2.24 with squeezed electrodes."""
        return self._of("learned").median_deg / self._of("equation 2.24, squeezed electrodes").median_deg

    @property
    def passed(self) -> bool:
        """Whether the learned normals are better, with a correct stated error."""
        return self.share <= LARGEST_SHARE and FEWEST_WITHIN_68 <= self._of("learned").within_68 <= MOST_WITHIN_68

    def _of(self, method: str) -> MethodErrors:
        return next(row for row in self.methods if row.method == method)


def calibrate_normals(recording: PressRecording, *, in_sensor_frame: bool) -> NormalsCalibration:
    """Compare all methods on halves of the recording, and train on the whole of it.

    Args:
        recording: presses in the order of time.
        in_sensor_frame: the normals are in the BioTac frame; otherwise the rotation to it is found by equation 2.24.

    Raises:
        ConfigurationError: too few presses.
    """
    presses, electrodes = recording.presses, recording.electrodes
    methods = compare_methods(presses, electrodes, in_sensor_frame=in_sensor_frame)
    if not in_sensor_frame:
        turn = rotation_to_sensor(presses, electrodes, noise_counts=15.0)
        presses = Presses(presses.changes, presses.normals @ turn)
    return NormalsCalibration(train(presses, electrodes), tuple(methods))


def normals_record(
    found: NormalsCalibration, finger: str, rig: str, *, serial: str = "", notes: str = "", earlier: Path | None = None
) -> CalibrationRecord:
    """The record to store; other fingers of an earlier file of the same rig are kept.

    Raises:
        ConfigurationError: the earlier file is not a calibration of normals, or of another rig.
    """
    before = read_record(earlier) if earlier is not None and earlier.exists() else None
    fingers: dict[str, StoredNormals] = {}
    if before is not None:
        if before.kind != "normals" or before.rig != rig:
            what = f"contains {before.kind} of rig {before.rig}, not normals of {rig}"
            raise ConfigurationError(what, where=str(earlier), hint="Choose another file with --out")
        fingers = dict(validate(before.parameters, NormalsFile, where=str(earlier)).normals)
    fingers[finger] = as_stored(found.learned)
    return new_record(
        "normals",
        rig=rig,
        method="kernel ridge regression on equation 2.24, chosen and judged by stretches of time",
        parameters=NormalsFile(normals=fingers),
        verdict="PASS" if found.passed else "FAIL",
        devices={**(before.devices if before else {}), **({f"biotac/{finger}": serial} if serial else {})},
        residuals={**(before.residuals if before else {}), finger: {row.method: asdict(row) for row in found.methods}},
        limits={"largest share of equation 2.24's median error": LARGEST_SHARE},
        notes=notes,
    )
