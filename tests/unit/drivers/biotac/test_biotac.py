"""BioTac: slots, units, electrode geometry, contact estimation and the fingertip."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.biotac.biotac import BioTac, BioTacCalibration, BioTacSettings, load_biotacs
from drivers.biotac.channels import core_temperature_degC
from drivers.biotac.electrodes import BallAndCylinder, EllipsoidSkin, electrode_layout
from drivers.biotac.estimator import contact_from_electrodes, force_direction
from drivers.biotac.slot_codec import Channel, Slot, decode_slot, electrode_channel, encode_slot
from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import CodecError, ConfigurationError, DeviceError
from drivers.shadow.device.tactile_requests import BIOTAC_ROTATION
from tests.support.repository import SIMULATED_HAND

TIPS = SIMULATED_HAND / "biotacs.yaml"
REST = {Channel.PDC: 1700, Channel.TAC: 2000, Channel.TDC: 2280} | {electrode_channel(n): 3000 for n in range(1, 25)}
UPRIGHT = np.eye(3)


@dataclass(frozen=True)
class Reading:
    stamp_ns: int
    tactile_type: int
    tactile_valid: int
    tactile: bytes


class Finger:
    """Feeds one finger's slot, rotation by rotation."""

    def __init__(self, tip: BioTac) -> None:
        self.tip, self.stamp_ns = tip, 0

    def feed(self, values: dict[int, int], rotations: int = 6, *, valid: bool = True) -> None:
        place = FINGERS.index(self.tip.finger)
        for _ in range(rotations):
            for request in BIOTAC_ROTATION:
                self.stamp_ns += 2_000_000
                answer = {c: values[c] for c in (request, request + 1) if c in values}
                slot = encode_slot(Slot((2040, 2041), answer), request)
                tactile = bytes(16 * place) + slot + bytes(16 * (4 - place))
                self.tip.update(Reading(self.stamp_ns, request, (1 << place) * valid, tactile))


def pressed(tip_layout_skin: Array, point: Array, *, pdc: int = 100, strength: float = 400.0) -> dict[int, int]:
    """Readings for a contact at a skin point: electrodes near it are squeezed."""
    near = strength * np.exp(-np.sum((tip_layout_skin - point) ** 2, axis=1) / (2 * 0.003**2))
    changed = {electrode_channel(n + 1): int(3000 - counts) for n, counts in enumerate(near)}
    return REST | changed | {Channel.PDC: 1700 + pdc}


@pytest.fixture
def tip() -> BioTac:
    calibration = BioTacCalibration.model_validate(
        load_biotacs(TIPS)["RF"].model_dump() | {"skin": {"kind": "ball-and-cylinder"}}
    )
    return BioTac("RF", calibration, BioTacSettings())


# --- codec ---------------------------------------------------------------------------------------------------------


def test_one_request_gives_two_values_and_two_vibration_readings() -> None:
    payload = bytes.fromhex("f807f907a406" + "0f00" + "d007" + "00" * 6)
    slot = decode_slot(payload, Channel.PDC)
    assert slot.vibration == (2040, 2041)
    assert slot.values == {Channel.PDC: 1700, Channel.TAC: 2000}
    assert encode_slot(slot, Channel.PDC) == payload


def test_the_last_electrode_comes_alone_and_invalid_values_are_left_out() -> None:
    payload = bytes.fromhex("f807f907a406" + "0f00" + "d007" + "00" * 6)
    assert decode_slot(payload, 27).values == {27: 1700}
    assert decode_slot(payload, 0).values == {}
    assert decode_slot(payload[:6] + b"\x05" + payload[7:], 1) == Slot((2040,), {1: 1700})


@settings(max_examples=50, derandomize=True)
@given(st.binary(min_size=14, max_size=18), st.integers(-1, 70_000))
def test_any_bytes_decode_or_raise_a_codec_error(payload: bytes, request_code: int) -> None:
    if len(payload) == 16:
        decode_slot(payload, request_code)
    else:
        with pytest.raises(CodecError, match="16"):
            decode_slot(payload, request_code)


@pytest.mark.parametrize("slot", [Slot((1, 2, 3), {}), Slot((), {1: 70_000})])
def test_what_does_not_fit_a_slot_is_refused(slot: Slot) -> None:
    with pytest.raises(CodecError):
        encode_slot(slot, 1)


# --- units and geometry --------------------------------------------------------------------------------------------


def test_the_core_temperature_matches_the_golden_vectors(lab_data: Path) -> None:
    golden = json.loads((lab_data / "golden_vectors.json").read_text())["biotac_conversion"]
    for counts, degC in golden["TDC_to_C"].items():
        assert core_temperature_degC(np.array(float(counts))) == pytest.approx(degC, abs=1e-3)


def test_the_19_electrodes_lie_where_published(lab_data: Path) -> None:
    with (lab_data / "biotac_geometry" / "biotac_19_electrodes_mm.csv").open() as table:
        rows = np.array([[float(v) for v in row] for row in list(csv.reader(table))[1:]])
    layout = electrode_layout(19)
    np.testing.assert_allclose(1e3 * layout.positions_m, rows[:, 1:4], atol=1e-9)
    np.testing.assert_allclose(layout.normals, rows[:, 4:7], atol=6e-3)
    np.testing.assert_allclose(1e3 * layout.skin.project(layout.positions_m)[0], rows[:, 7:10], atol=0.011)


def test_the_24_electrodes_lie_under_the_published_skin(lab_data: Path) -> None:
    with (lab_data / "biotac_geometry" / "biotac_sp_locations_bsadr.csv").open() as table:
        rows = np.array([[float(v) for v in row[1:7]] for row in list(csv.reader(table))[1:25]])
    layout = electrode_layout(24)
    np.testing.assert_allclose(1e3 * layout.positions_m, rows[:, :3], atol=1e-9)
    skin = EllipsoidSkin()
    published = 1e-3 * rows[:, 3:]
    assert np.abs(skin.project(published)[0] - published).max() < 1.2e-4
    assert (
        np.linalg.norm(skin.project(layout.positions_m)[0] - published, axis=1).max() < 2.1e-3
    )  # the tip carries a flat facet


@pytest.mark.parametrize("skin", [BallAndCylinder(), EllipsoidSkin()])
def test_projected_points_lie_on_the_skin_and_stay_there(skin: BallAndCylinder | EllipsoidSkin) -> None:
    inside = np.random.default_rng(0).normal(scale=0.004, size=(50, 3))
    points, normals = skin.project(inside)
    np.testing.assert_allclose(skin.project(points)[0], points, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)


# --- estimation ----------------------------------------------------------------------------------------------------


def test_pushed_aside_electrodes_do_not_attract_the_contact() -> None:
    layout, change = electrode_layout(19), np.zeros((1, 19))
    change[0, 16], change[0, 0] = -200, 900
    contact = contact_from_electrodes(change, layout)
    np.testing.assert_allclose(contact.points_m[0], [-0.0028, 0, -0.007], atol=1e-9)
    np.testing.assert_allclose(contact.normals[0], [0, 0, -1], atol=1e-9)
    np.testing.assert_allclose(force_direction(change, layout)[0], [0, 0, -1], atol=1e-9)
    assert contact.squeeze[0] == 200


def test_without_a_squeezed_electrode_there_is_no_point() -> None:
    change = np.full((2, 19), -10.0)
    assert np.isnan(contact_from_electrodes(change, electrode_layout(19), noise_counts=15).points_m).all()
    assert np.isnan(force_direction(change, electrode_layout(19), noise_counts=15)).all()


@pytest.mark.parametrize("electrodes", [19, 24])
def test_contacts_on_the_pad_are_found_within_two_millimetres(electrodes: int) -> None:
    layout = electrode_layout(19 if electrodes == 19 else 24)
    skin_points, _ = layout.skin.project(layout.positions_m)
    rng, errors = np.random.default_rng(2), []
    for _ in range(200):
        inside = np.array([rng.uniform(-0.008, 0.003), rng.uniform(-0.002, 0.002), -0.004])
        point = layout.skin.project(inside[None])[0][0]
        change = -400 * np.exp(-np.sum((skin_points - point) ** 2, axis=1) / (2 * 0.003**2))
        errors.append(np.linalg.norm(contact_from_electrodes(change[None], layout).points_m[0] - point))
    assert np.median(errors) < 0.0015
    assert np.quantile(errors, 0.95) < 0.003


# --- the fingertip -------------------------------------------------------------------------------------------------


def test_the_shipped_calibration_points_the_biotac_along_the_finger() -> None:
    tips = load_biotacs(TIPS)
    assert set(tips) == set(FINGERS)
    rotation = tips["FF"].distal_T_sensor.pose().rotation().matrix()
    np.testing.assert_allclose(rotation, [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-12)


def test_a_wrong_electrode_count_is_refused(tmp_path: Path) -> None:
    tips = {"biotacs": {"FF": {"electrodes": 20, "distal_T_sensor": {"translation_m": [0.0, 0.0, 0.0]}}}}
    (tmp_path / "tips.yaml").write_text(json.dumps(tips))
    with pytest.raises(ConfigurationError, match="electrodes"):
        load_biotacs(tmp_path / "tips.yaml")


def test_a_touch_becomes_a_contact_in_the_distal_frame(tip: BioTac) -> None:
    finger = Finger(tip)
    finger.feed(REST)
    assert tip.health() == ("not tared",)
    tip.tare(UPRIGHT)
    assert tip.health() == ()
    assert tip.load_N(UPRIGHT) == 0.0
    tip.begin_capture()
    finger.feed(REST)
    assert tip.contact(UPRIGHT) is None
    assert tip.newest_contact() is None
    layout = electrode_layout(19)
    point = np.array([-0.003, 0.0, -0.007])
    tip.begin_capture()
    finger.feed(pressed(layout.skin.project(layout.positions_m)[0], point))
    contact = tip.contact(UPRIGHT)
    assert contact is not None
    np.testing.assert_allclose(contact.point_distal_m, [0, -0.007, 0.016], atol=1.5e-3)  # palm side, below the ball
    np.testing.assert_allclose(contact.normal_distal, [0, 1, 0], atol=0.1)  # out of the object, into the finger
    newest = tip.newest_contact()
    assert newest is not None
    np.testing.assert_allclose(newest.point_distal_m, contact.point_distal_m, atol=1e-4)
    assert contact.force_N == pytest.approx(tip.load_N(UPRIGHT), rel=0.01)
    assert 0.3 < contact.force_N < 1.5
    spread = contact.normal_distal @ contact.point_covariance_m2 @ contact.normal_distal
    assert math.sqrt(spread) < math.sqrt(np.linalg.eigvalsh(contact.point_covariance_m2)[-1]) / 2


def test_a_touch_away_from_all_electrodes_has_a_force_but_no_place(tip: BioTac) -> None:
    finger = Finger(tip)
    finger.feed(REST)
    tip.tare(UPRIGHT)
    tip.begin_capture()
    finger.feed(REST)
    assert tip.pressed_N() is None
    tip.begin_capture()
    finger.feed(REST | {Channel.PDC: 1760})
    assert tip.contact(UPRIGHT) is None
    assert tip.pressed_N() == pytest.approx(0.3, rel=0.05)


def test_before_a_tare_nothing_is_known_to_touch(tip: BioTac) -> None:
    layout, finger = electrode_layout(19), Finger(tip)
    tip.begin_capture()
    finger.feed(pressed(layout.skin.project(layout.positions_m)[0], np.array([-0.003, 0.0, -0.007])))
    assert tip.contact(UPRIGHT) is None
    assert tip.newest_contact() is None


def test_squeezed_electrodes_without_pressure_are_no_contact(tip: BioTac) -> None:
    finger, layout = Finger(tip), electrode_layout(19)
    finger.feed(REST)
    tip.tare(UPRIGHT)
    tip.begin_capture()
    finger.feed(pressed(layout.positions_m, layout.positions_m[16], pdc=8))
    assert tip.contact(UPRIGHT) is None


def test_slots_not_marked_valid_keep_the_last_values(tip: BioTac) -> None:
    finger, layout = Finger(tip), electrode_layout(19)
    finger.feed(REST)
    tip.tare(UPRIGHT)
    finger.feed(pressed(layout.positions_m, layout.positions_m[16]), valid=False)
    assert tip.load_N(UPRIGHT) == 0.0
    stamp = finger.stamp_ns + 300_000_000
    slot = encode_slot(Slot((2040,), {Channel.PDC: 1700}), Channel.PDC)
    tip.update(Reading(stamp, Channel.PDC, 0b100, bytes(32) + slot + bytes(32)))
    assert tip.health() == ("21 channels not received for more than 200 ms",)


def test_an_empty_socket_is_told_apart_and_stops_motion(tip: BioTac) -> None:
    finger = Finger(tip)
    assert tip.health() == ("no reading received yet",)
    finger.feed(dict.fromkeys(REST, 0) | {Channel.PDC: -22072 & 0xFFFF, Channel.TAC: 32570})
    assert "no sensor fitted" in tip.health()[0]
    with pytest.raises(DeviceError, match="refused"):
        tip.tare(UPRIGHT)
    finger.feed(REST)
    tip.tare(UPRIGHT)
    assert tip.void() == ""
    finger.feed(dict.fromkeys(REST, 0), rotations=1)
    assert tip.load_N(UPRIGHT) == math.inf
    assert "no sensor fitted" in tip.void()


@pytest.mark.parametrize(("channel", "complaint"), [(Channel.PDC, "pressure varies"), (7, "electrode varies")])
def test_a_tare_is_refused_while_readings_move(tip: BioTac, channel: int, complaint: str) -> None:
    finger = Finger(tip)
    finger.feed(REST, rotations=2)
    with pytest.raises(DeviceError, match="often enough"):
        tip.tare(UPRIGHT)
    finger.feed(REST, rotations=4)
    finger.feed(REST | {channel: REST[channel] + 100}, rotations=1)
    with pytest.raises(DeviceError, match=complaint):
        tip.tare(UPRIGHT)


def test_a_tactile_section_of_the_wrong_length_is_a_codec_error(tip: BioTac) -> None:
    with pytest.raises(CodecError, match="80"):
        tip.update(Reading(0, 1, 0b100, bytes(79)))


def test_vibration_is_that_of_its_own_sample(tip: BioTac) -> None:
    finger = Finger(tip)
    assert tip.vibration_at(0) == ()
    finger.feed(REST)
    assert tip.vibration_at(finger.stamp_ns) == (2040, 2041)
    finger.feed(REST, rotations=1, valid=False)
    assert tip.vibration_at(finger.stamp_ns) == ()
    finger.feed(dict.fromkeys(REST, 0))
    assert tip.vibration_at(finger.stamp_ns) == ()
