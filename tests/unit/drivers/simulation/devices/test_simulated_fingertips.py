"""The emulated force sensors and BioTacs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from gtsam import Pose3

from drivers.ati.protocols import rdt_codec
from drivers.biotac.electrodes import electrode_layout
from drivers.biotac.estimator import contact_from_electrodes
from drivers.biotac.slot_codec import decode_slot, electrode_channel
from drivers.core.errors import ConfigurationError
from drivers.fingertips.biotac import KnownBioTac
from drivers.shadow.protocol.palm_codec import decode_status as decode_palm
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.devices.biotac_emulator import BiotacSkin, vibration_counts
from drivers.simulation.devices.nano_sensors import RESOLUTION
from drivers.simulation.hand_plant import TrueContact
from drivers.simulation.settings import BiotacSettings, SimulationSettings
from drivers.simulation.world import SimulatedWorld
from tests.support.simulated_program import BIOTAC, MS, PERFECT, PERFECT_FORCES, CYCLE_ns, Program, records


def test_force_records_come_at_their_rate_with_both_sequences() -> None:
    program = Program()
    transport = program.start_forces()
    program.wait(200 * MS)
    datagrams = transport.receive()
    found = records(datagrams)
    assert list(found["rdt_sequence"]) == list(range(1, 21))
    assert set(np.diff(found["ft_sequence"].astype(int))) == {70}
    assert {b.stamp_ns - a.stamp_ns for a, b in pairwise(datagrams)} == {CYCLE_ns}
    assert not found["status"].any()


def test_no_records_before_a_start_and_after_a_stop() -> None:
    program = Program()
    program.wait(50 * MS)
    assert program.transports["ft/MF"].receive() == []
    transport = program.start_forces("MF")
    program.wait(50 * MS)
    assert len(transport.receive()) == 5
    transport.send(rdt_codec.encode_request(rdt_codec.Command.STOP))
    program.wait(50 * MS)
    assert transport.receive() == []


def test_a_wanted_number_of_records_is_sent() -> None:
    program = Program()
    program.transports["ft/LF"].send(rdt_codec.encode_request(rdt_codec.Command.START, 3))
    program.wait(100 * MS)
    assert len(program.transports["ft/LF"].receive()) == 3


def test_untouched_sensor_feels_the_weight_of_its_tip() -> None:
    program = Program()
    transport = program.start_forces("RF")
    program.drive({}, 40)
    wrench = records(transport.receive())["counts"][-1] / 1e6
    tip = program.world.calibration.tips["nano17"]["RF"]
    pose = program.plant.world_T_distal("RF") * tip.distal_T_sensor.pose()
    weight = pose.rotation().matrix().T @ [0, 0, -tip.mass_kg * 9.81]
    arm = tip.distal_T_sensor.pose().transformTo(np.array(tip.com_distal_m))
    np.testing.assert_allclose(wrench, np.r_[weight, np.cross(arm, weight)], atol=1.2 * RESOLUTION.max())


def test_readings_are_steps_of_the_sensors_resolution() -> None:
    program = Program(SimulationSettings())
    transport = program.start_forces("TH")
    program.wait(300 * MS)
    steps = records(transport.receive())["counts"] / 1e6 / RESOLUTION
    np.testing.assert_allclose(steps, np.rint(steps), atol=0.04)  # counts are whole millionths
    assert 0.4 < np.std(steps, axis=0).mean() < 2.5


def test_software_bias_zeroes_the_box_and_wants_a_new_start() -> None:
    program = Program(SimulationSettings(), seed=2)
    transport = program.start_forces()
    program.wait(30 * MS)
    before = records(transport.receive())["counts"][-1] / 1e6
    transport.send(rdt_codec.encode_request(rdt_codec.Command.SET_SOFTWARE_BIAS))
    program.wait(30 * MS)
    assert transport.receive() == []
    program.start_forces()
    program.wait(30 * MS)
    after = records(transport.receive())["counts"][-1] / 1e6
    assert np.abs(before[:3]).max() > 0.1
    assert np.abs(after[:3]).max() < 0.05


def pressing_on_the_table(program: Program) -> Iterator[None]:
    """Lower the hand, fingers pointing down, until a fingertip stands on the table and beyond."""
    upright = np.array([0.0, 0.25, 0.48, 0.0, np.pi / 2, 0.0])
    program.move_base(upright, 120)
    for height in np.arange(0.48, 0.35, -0.001):
        program.move_base(np.array([*upright[:2], height, *upright[3:]]), 2)
        program.drive({}, 1)
        yield


def test_truth_and_sensor_agree_when_a_fingertip_stands_on_the_table() -> None:
    program = Program()
    transport = program.start_forces("MF")
    program.drive({}, 30)
    for _ in pressing_on_the_table(program):
        if "MF" in program.world.truth().fingers_on_table:
            break
    program.drive({}, 10)
    truth = program.world.truth()
    assert "MF" in truth.fingers_on_table
    assert truth.contacts == ()
    force_N = np.linalg.norm(records(transport.receive())["counts"][-1, :3] / 1e6)
    true_N = sum(
        np.linalg.norm(contact.force_on_tip_world_N) for contact in program.plant.contacts() if contact.finger == "MF"
    )
    assert true_N > 0.05
    assert force_N == pytest.approx(true_N, abs=0.1)


def test_overloaded_sensor_says_saturated() -> None:
    settings = PERFECT.model_copy(update={"force_sensors": PERFECT_FORCES.model_copy(update={"offset_N": 1e4})})
    program = Program(settings)
    transport = program.start_forces()
    program.wait(20 * MS)
    record = records(transport.receive())[-1]
    assert rdt_codec.describe_status(int(record["status"])).messages == ("sensor saturated or disconnected",)
    assert abs(record["counts"][2]) == 17_000_000


def test_biotac_rig_has_no_force_links_and_speaks_its_protocol() -> None:
    program = Program(BIOTAC)
    assert set(program.transports) == {"hand", "base", "camera"}
    protocol = program.status(tactile_data_type=0xFFF9)
    assert protocol.tactile_valid == 0b11111
    assert int.from_bytes(protocol.tactile[0, :2].tobytes(), "little") == 2
    assert program.status(tactile_data_type=0xFFFC).tactile[3].tobytes().startswith(b"BTSIM")


def test_biotac_slots_answer_the_request_of_the_command_before() -> None:
    program = Program(BIOTAC)
    program.ask(tactile_data_type=1)
    status = decode_palm(program.ask(tactile_data_type=electrode_channel(19)).payload)
    slot = decode_slot(status.tactile[0].tobytes(), status.tactile_data_type)
    assert set(slot.values) == {1, 2}
    assert 1600 < slot.values[1] < 2900
    assert len(slot.vibration) == 2
    last = decode_palm(program.ask().payload)
    assert set(decode_slot(last.tactile[4].tobytes(), last.tactile_data_type).values) == {electrode_channel(19)}


def pressed_skin(force_N: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of point (m) and normal (rad) of equation 2.24, and the pressure's rise, over places on the pad."""
    calibration = SimulatedCalibration.from_package().tips["biotac"]["FF"].calibration
    skin = BiotacSkin(calibration, BiotacSettings(), np.random.default_rng(0))
    assert calibration.skin is not None
    surface = calibration.skin.surface()
    layout = electrode_layout(19, surface)
    rng = np.random.default_rng(1)
    places = np.column_stack([rng.uniform(-6, 6, 40), rng.uniform(-4, 4, 40), np.full(40, -8.0)]) * 1e-3
    points, normals = surface.project(places)
    rest = skin.channels(Pose3(), [])
    point_errors, angles, rises = [], [], []
    mounting = calibration.distal_T_sensor.pose()
    for point, normal in zip(points, normals, strict=True):
        into_tip = -(mounting.rotation().matrix() @ normal)
        touch = TrueContact("FF", "object", mounting.transformFrom(point), into_tip, force_N * into_tip)
        change = skin.channels(Pose3(), [touch]) - rest
        found = contact_from_electrodes(change[None, 3:], layout, noise_counts=15.0)
        point_errors.append(np.linalg.norm(found.points_m[0] - point))
        angles.append(np.arccos(np.clip(found.normals[0] @ normal, -1, 1)))
        rises.append(change[0])
    return np.array(point_errors), np.array(angles), np.array(rises)


def test_pressed_biotac_tells_where_it_is_pressed() -> None:
    point_errors, angles, _ = pressed_skin(0.5)
    assert np.median(point_errors) < 0.0025
    assert np.degrees(np.median(angles)) < 15


def test_biotac_pressure_rises_with_force_until_the_skin_rests_on_the_core() -> None:
    assert np.median(pressed_skin(0.5)[2]) == pytest.approx(100, rel=0.1)
    assert np.median(pressed_skin(4.0)[2]) == pytest.approx(400, rel=0.1)


def test_biotac_vibrates_while_a_contact_slides_under_it_and_only_then() -> None:
    calibration = SimulatedCalibration.from_package().tips["biotac"]["FF"].calibration
    up = np.array([0.0, 0.0, 1.0])
    scatter = {}
    for speed_m_s in (0.0, 0.01, 0.03):
        touch = TrueContact("FF", "object", np.zeros(3), up, 0.5 * up, speed_m_s)
        skin = BiotacSkin(calibration, BiotacSettings(), np.random.default_rng(3))
        slots = [decode_slot(skin.slot(1, None, vibration_counts([touch])), 1) for _ in range(300)]
        scatter[speed_m_s] = np.std([slot.vibration for slot in slots])
    assert scatter[0.0] == pytest.approx(10.0, rel=0.1)
    assert scatter[0.01] == pytest.approx(np.hypot(10.0, 15.0), rel=0.1)
    assert scatter[0.03] == pytest.approx(np.hypot(10.0, 45.0), rel=0.1)


def test_a_fingertip_that_is_dragged_over_the_table_slides() -> None:
    program = Program(BIOTAC)
    program.drive({}, 30)
    for _ in pressing_on_the_table(program):
        if "MF" in program.world.truth().fingers_on_table:
            break
    program.drive({}, 40)
    resting = [contact.slides_m_s for contact in program.plant.contacts()]
    dragged = []
    for sideways_m in np.linspace(0.0, 0.02, 20):
        program.move_base(np.array([*program.plant.base[:1], 0.25 + sideways_m, *program.plant.base[2:]]), 1)
        dragged += [contact.slides_m_s for contact in program.plant.contacts()]
    assert max(resting) < 0.005
    assert max(dragged, default=0.0) > 0.02


def test_biotac_without_an_ellipsoid_skin_is_refused() -> None:
    packaged = SimulatedCalibration.from_package()
    biotacs = packaged.tips["biotac"]
    bare = KnownBioTac(biotacs["FF"].calibration.model_copy(update={"skin": None}))
    changed = replace(packaged, tips={"biotac": {**biotacs, "MF": bare}})
    with pytest.raises(ConfigurationError, match="BioTac of MF has no ellipsoid skin"):
        SimulatedWorld(BIOTAC, 0, changed)


def test_missing_fingertip_calibration_is_refused() -> None:
    packaged = SimulatedCalibration.from_package()
    changed = replace(packaged, tips={"nano17": {"FF": packaged.tips["nano17"]["FF"]}})
    with pytest.raises(ConfigurationError, match="no nano17 calibration for MF"):
        SimulatedWorld(PERFECT, 0, changed)
