"""Recorded BioTacs through our slots, fingertip and estimators.

Normals: one 19-electrode BioTac pressed by hand on a plate, the plate's normal by motion capture (4030 samples). The
motion capture's frame is not that of the electrodes: one fixed rotation between the two is fitted (orthogonal
Procrustes) on the first half of the recording and judged on the second. The electrodes come mean-centred, which is
used as the tare. Untouched: three BioTac SP and two empty sockets on a Shadow hand, 9.8 s.
"""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from drivers.biotac.biotac import BioTac, BioTacCalibration, BioTacSettings
from drivers.biotac.electrodes import electrode_layout
from drivers.biotac.estimator import contact_from_electrodes, force_direction
from drivers.biotac.slot_codec import Channel, Slot, electrode_channel, encode_slot
from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import DeviceError
from drivers.shadow.device.tactile_requests import BIOTAC_ROTATION

SP = BioTacCalibration.model_validate({"electrodes": 24, "distal_T_sensor": {"translation_m": (0.0, 0.0, 0.013)}})


@pytest.fixture(scope="module")
def recording(lab_data: Path) -> tuple[Array, Array]:
    """Electrode changes (4030, 19) and measured normals (4030, 3)."""
    folder = lab_data / "biotac_normal"
    return np.loadtxt(folder / "X1.txt").T, np.loadtxt(folder / "Y1.txt").T


def rotation_between(source: Array, target: Array) -> Array:
    """Rotation R that best turns directions ``source`` into ``target`` (orthogonal Procrustes, no reflection)."""
    u, _, vt = np.linalg.svd(target.T @ source)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def angles_deg(estimated: Array, measured: Array) -> Array:
    """Angular errors on the second half after the rotation fitted on the first."""
    half = len(measured) // 2
    known = np.isfinite(estimated).all(axis=1)
    first, second = known[:half], known[half:]
    turn = rotation_between(estimated[:half][first], measured[:half][first])
    cosine = np.sum((estimated[half:][second] @ turn.T) * measured[half:][second], axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def test_contact_normals_agree_with_motion_capture(recording: tuple[Array, Array]) -> None:
    change, measured = recording
    contact = contact_from_electrodes(change, electrode_layout(19), noise_counts=15)
    errors = angles_deg(contact.normals, measured)
    assert np.isfinite(contact.normals).all(axis=1).mean() > 0.95
    assert np.median(errors) < 11.0  # measured 9.5
    assert np.quantile(errors, 0.9) < 20.0  # measured 16.7


def test_the_sum_of_squeezed_normals_agrees_nearly_as_well(recording: tuple[Array, Array]) -> None:
    change, measured = recording
    assert np.median(angles_deg(force_direction(change, electrode_layout(19)), measured)) < 12.0


def test_squeezed_electrodes_beat_all_electrodes_and_a_constant_guess(recording: tuple[Array, Array]) -> None:
    change, measured = recording
    layout = electrode_layout(19)
    everything = -change @ layout.normals
    everything /= np.linalg.norm(everything, axis=1, keepdims=True)
    guess = measured.mean(axis=0) / np.linalg.norm(measured.mean(axis=0))
    constant = np.degrees(np.arccos(measured @ guess))
    ours = np.median(angles_deg(contact_from_electrodes(change, layout).normals, measured))
    assert ours < 0.5 * np.median(angles_deg(everything, measured))
    assert ours < 0.5 * np.median(constant)


@dataclass(frozen=True)
class Reading:
    stamp_ns: int
    tactile_type: int
    tactile_valid: int
    tactile: bytes


def untouched_readings(path: Path) -> list[Reading]:
    """Each recorded message as the slots of one rotation of requests: what the palm sent to make it."""
    readings = []
    with path.open() as table:
        for row in list(csv.reader(table))[1:]:
            fingers = [_values(row[start : start + 6]) for start in range(8, 8 + 6 * 5, 6)]
            start_ns = 1_000_000_000 * int(row[4]) + int(row[5])
            for step, request in enumerate(BIOTAC_ROTATION):
                readings.append(_reading(fingers, request, start_ns + 700_000 * step))
    return readings


def _values(cells: list[str]) -> tuple[tuple[int, int], dict[int, int]]:
    pac0, pac1, pdc, tac, tdc = (int(cell) & 0xFFFF for cell in cells[:5])
    electrodes = {electrode_channel(n): value for n, value in enumerate(json.loads(cells[5]), 1)}
    return (pac0, pac1), {Channel.PDC: pdc, Channel.TAC: tac, Channel.TDC: tdc} | electrodes


def _reading(fingers: list[tuple[tuple[int, int], dict[int, int]]], request: int, stamp_ns: int) -> Reading:
    slots = (
        encode_slot(Slot(pac, {c: values[c] for c in (request, request + 1) if c in values}), request)
        for pac, values in fingers
    )
    return Reading(stamp_ns, request, 0b11111, b"".join(slots))


def test_untouched_fingers_report_no_contact_and_empty_sockets_are_rejected(lab_data: Path) -> None:
    readings = untouched_readings(lab_data / "tactile_gcn_biotac_sp" / "untouched.csv")
    tips = {finger: BioTac(finger, SP, BioTacSettings()) for finger in FINGERS}
    rotation = len(BIOTAC_ROTATION)
    for reading in readings[: 10 * rotation]:
        for tip in tips.values():
            tip.update(reading)
    fitted = {finger for finger, tip in tips.items() if "no sensor fitted" not in " ".join(tip.health())}
    assert fitted == {"FF", "MF", "TH"}
    for finger, tip in tips.items():
        if finger in fitted:
            tip.tare(np.eye(3))
        else:
            with pytest.raises(DeviceError):
                tip.tare(np.eye(3))
    starts = range(10 * rotation, len(readings), 20 * rotation)
    for start, end in pairwise([*starts, len(readings)]):
        for finger, tip in tips.items():
            tip.begin_capture()
            for reading in readings[start:end]:
                tip.update(reading)
            assert tip.contact(np.eye(3)) is None, finger
            assert finger not in fitted or tip.load_N(np.eye(3)) < 0.3
    assert [tips[finger].health() for finger in ("FF", "MF", "TH")] == [(), (), ()]
